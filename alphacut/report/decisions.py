"""Sections of the report on what was learned from measurements, and on what is decided."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

from markupsafe import Markup

from alphacut.figures.captions import caption, in_words
from alphacut.io.files import Document
from alphacut.io.netcdf import damaged
from alphacut.io.provenance import door
from alphacut.io.units import engineering
from alphacut.report.envelopes import between
from alphacut.report.figures import listed, picture
from alphacut.report.tables import paragraphs, percent, section, sentence, table
from alphacut.stages.measure_next import GAINS
from alphacut.stages.vibration import decision, joint, update


def learned(summary: Document, folder: Path) -> Markup:
    """What measured modes or a recorded motion teach about the inputs, and what they do not."""
    found = summary["update"]
    modes = "agreement" in found or "modes" in found.get("refuted", "")
    title = f"Learned from {'measured modes' if modes else 'a recorded motion'}"
    if "refuted" in found:
        refuted = sentence(found["refuted"]) + " The envelopes rest on the priors."
        return section(title, paragraphs(refuted))
    words = [sentence(line) for line in update.sentences(found)[1 + len(found["inputs"]) :]]
    rows = [
        (
            name,
            *(f"{low:.5g} … {high:.5g}" for low, high in (found["prior"][name], after)),
            percent(found["narrowed"][name]),
        )
        for name, ends in found["inputs"].items()
        for after in [(ends["lower"][0], ends["upper"][0])]
    ]
    head = ("input, SI", "before", f"after, at α = {found['alpha'][0]:g}", "width left")
    names = ["inputs", *found["envelope_width"]]
    return section(
        title,
        paragraphs(*words),
        table(head, rows),
        *(listed(summary, folder, f"update-{name}") for name in names),
    )


def decided(summary: Document, folder: Path) -> Markup:
    """How possible and how necessary it is that limits are exceeded, and the safety margins."""
    found = summary["decision"]
    words = [sentence(line) for line in decision.sentences(found)][len(found["limits"]) :]
    rows = []
    for name, one in found["limits"].items():
        allowed, margins, of = "", ["", ""], name
        if (margin := found["margins"].get(name)) is not None:
            unit, largest = margin["unit"], float(margin["limit"])
            allowed, of = engineering(largest, unit), margin.get("output", name)
            ends = (decision.margin_ends(found, name, level) for level in (0, -1))
            margins = [between(low, high, unit, largest) for low, high in ends]
        degrees = (decision.degree(*one[kind]) for kind in ("possibility", "necessity"))
        verdict = f"{decision.verdict_of(found, name)} ({decision.worth(found, name)})"
        rows.append((of, allowed, *degrees, verdict, *margins))
    levels = (f"margin at α = {found['alpha'][level]:g}" for level in (0, -1))
    head = ("magnitude of", "limit", "possibly exceeded", "necessarily", "verdict", *levels)
    meaning = (
        "Exceeding a limit at any node is possible to the degree of the highest α-cut that holds"
        " such a motion, and necessary to one less the degree to which keeping it is possible."
    )
    drawn = listed(summary, folder, "decision")
    return section("Decision", paragraphs(meaning), table(head, rows), drawn, paragraphs(*words))


def together(summary: Document, folder: Path) -> Markup:
    """What two values of the motion may be together."""
    found = summary["joint"]
    shares = found["share_of_rectangle"]
    rows = [
        (f"{alpha:g}", *(f"{shares[kind][level]:.1%}" for kind in ("inner", "outer")))
        for level, alpha in enumerate(found["alpha"])
    ]
    head = ("α", "reached, of the rectangle", "enclosed, of the rectangle")
    words = [sentence(x) for x in (joint.sentence(found), found["claim"]) if x]
    drawn = listed(summary, folder, "joint")
    return section("What goes together", paragraphs(*words), table(head, rows), drawn)


OWN = {"envelope", "--modulus"}
"""What `alphacut measure-next` may be asked with by itself: inputs, duration, a modulus."""


def next_measured(summary: Document, folder: Path) -> Markup:
    """Which input to measure next, where `alphacut measure-next` left its answer in the folder.

    Raises:
        BadInput: That file is damaged.
    """
    path, title = folder / "measure-next.json", "What to measure next"
    again = door("measure-next", "CASE.toml", "--out", folder)
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
        made, run = found.get("sections", {}), summary.get("sections", {})
        other = [name for name in made if made[name] != run.get(name, "")]
        names = " and ".join(other)
        told = f"The gains in {path.name} rest on another {names} than this run" if other else ""
        if run and not OWN.issuperset(other):
            cure = f"{told} and are left out: {again}, with every --set of the run, makes it anew."
            return section(title, paragraphs(cure))
        if not (made and run):
            told = f"Older programs do not say whether {path.name} is of this run's case"
        return section(title, *gains(found, folder, sentence(told)))
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise damaged(path, error, f"delete it, or make it anew: {again}") from None


def gains(found: Document, folder: Path, remark: str) -> Iterator[Markup]:
    """What is lost of the width, by input."""
    rows = [
        (in_words(name), *(percent(gain[kind]) for kind in GAINS))
        for name, gain in found["gains"].items()
    ]
    words = (
        f"Width of {found['answer']} at α = {found['alpha']:g} lost if one input is known better:"
        " about its modal value, and at least, wherever in its cut the better value may lie."
    )
    yield paragraphs(*filter(None, (words, sentence(found["note"]), remark)))
    yield table(("input", "twice as well", "at least", "exactly", "at least"), rows)
    stem = "measure-next"
    yield picture(folder / "figures" / f"{stem}.svg", caption(stem, paper=False))
