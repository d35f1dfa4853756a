"""The sections of the report, each a piece of HTML: methods and their worth among them."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator, Sequence
from pathlib import Path

from markupsafe import Markup

from alphacut.figures.captions import INPUTS, in_words
from alphacut.frame.structures.quantities import Output
from alphacut.fuzzy.result import Nature
from alphacut.io.files import Document
from alphacut.io.provenance import sources
from alphacut.io.units import engineering
from alphacut.report import glossary
from alphacut.report.decisions import answered, learned
from alphacut.report.envelopes import envelopes
from alphacut.report.figures import gallery, listed, missing
from alphacut.report.key_results import key_results
from alphacut.report.material import image, microstructure, modulus, stress
from alphacut.report.tables import (
    citation,
    code,
    details,
    items,
    paragraphs,
    percent,
    section,
    sentence,
    table,
)


def sections(summary: Document, folder: Path) -> Iterator[Markup]:
    """All sections that the results allow, in reading order."""
    yield key_results(summary)
    yield missing(summary, folder)
    if "microstructure" in summary:
        seen = listed(summary, folder, "image_circles")
        yield microstructure(summary["microstructure"], seen)
    if "modulus" in summary:
        yield modulus(summary["modulus"], listed(summary, folder, "modulus"))
    if "image" in summary:
        yield image(summary["image"], listed(summary, folder, "image"))
    if "response" in summary:
        yield stress(summary["response"], listed(summary, folder, "response"))
    if "update" in summary:
        yield learned(summary, folder)
    if summary.get("envelopes"):
        yield envelopes(summary, listed(summary, folder, "exceedance"))
    yield from answered(summary, folder)
    if summary.get("shares"):
        yield shares(summary)
    yield methods(summary)
    yield section("Terms", glossary.box())
    yield gallery(summary, folder)
    yield case_text(summary)
    yield differing(summary)
    yield versions(summary)


def shares(summary: Document) -> Markup:
    """Contributions of the inputs to the widths."""
    found, studies = summary["shares"], [*summary.get("envelopes", {}).values()]
    words = paragraphs(
        "Share of the width, on the lowest level computed, that is lost when an input is fixed at"
        " its modal value and all others are kept.",
        *map(sentence, summary.get("shares_notes", ())),
    )
    kinds = dict.fromkeys(tuple(entry) for entry in found.values())
    drawn = []
    for inputs in kinds:
        of = [name for name, entry in found.items() if tuple(entry) == inputs]
        rows = [
            (INPUTS.get(name) or in_words(name), *(percent(found[x][name]) for x in of))
            for name in inputs
        ]
        level = (summary["modulus"] if of[0] in ("E", "ν") else studies[0])["alpha"][0]
        drawn.append(table((f"input, at α = {level:g}", *of), rows))
    return section("What drives the width", words, *drawn)


def case_text(summary: Document) -> Markup:
    """The case file as it was, and what the command line changed."""
    changes = [code(change) for change in summary.get("changes", ())]
    return section(
        "The case",
        paragraphs("Changed on the command line:") + items(changes) if changes else Markup(),
        details(f"{summary['case']}.toml", code(summary["case_text"], "pre")),
    )


def differing(summary: Document) -> Markup:
    """Differences from the paper in the modules that the run used."""
    found = tuple(differences(summary))
    listed = items(
        Markup("<strong>{}</strong>: {}").format(subject, text) for subject, text in found
    )
    # for a case of one's own they are no news, but they are what the numbers rest on
    if not summary.get("paper"):
        head = f"{len(found)} places where the methods differ from the paper they follow"
        listed = details(head, listed)
    return section("Differences from the paper", listed) if found else Markup("")


def versions(summary: Document) -> Markup:
    """Versions, command, and how to cite."""
    found = ", ".join(f"{name} {version}" for name, version in summary["versions"].items())
    command = Markup("Made by {} in {:.0f} s.").format(code(summary["command"]), summary["seconds"])
    return section("Versions and citation", paragraphs(command, found), code(citation(), "pre"))


PACKAGES = ("stochastic", "rve", "fuzzy", "frame")
MARK = "This differs from the paper in:"


def differences(found: Document | None = None) -> Iterator[tuple[str, str]]:
    """Subject and differences of each module, "1. … 2. …", that concern a run."""
    for package in PACKAGES:
        for name, file in sources(package):
            if file.suffix != ".py":
                continue
            if found is not None and not concerns(
                f"{package}.{name[:-3].replace('/', '.')}", found
            ):
                continue
            words = ast.get_docstring(ast.parse(file.read_text(encoding="utf-8"))) or ""
            if MARK in words:
                after = words.partition(MARK)[2].split("\n\n")[0]
                subject = re.sub(r"\s*\(.*", "", words.partition("\n")[0].rstrip("."))
                yield subject, " ".join(after.split())


def concerns(module: str, found: Document) -> bool:
    """True if a run used the module, by its summary."""
    methods = {study["method"] for study in found.get("envelopes", {}).values()}
    if module == "stochastic.radius_map":
        return "modulus" in found or "microstructure" in found
    if module.startswith("stochastic."):
        return "microstructure" in found
    if module.startswith("rve."):
        return "modulus" in found and (
            module != "rve.prism.model" or found["modulus"]["method"] == "prism"
        )
    if module == "frame.methods.graph_follower":
        return any(method.endswith("graph-follower") for method in methods)
    return not module.startswith("frame.") or bool(methods)


def methods(summary: Document) -> Markup:
    """Method and cost of each stage."""
    rows: list[tuple[object, ...]] = []
    if cell := summary.get("modulus"):
        how, cost = f"{cell['method']}, plan {cell['plan']}", f"{cell['samples']} samples"
        rows.append(("fuzzy modulus", how, cell["nature"], cost, f"{cell['seconds']:.1f}"))
    if picture := summary.get("image"):
        cost = f"{picture['iterations']} iterations"
        rows.append(("image", "trial fields", picture["nature"], cost, f"{picture['seconds']:.1f}"))
    for name, study in summary.get("envelopes", {}).items():
        how, seconds = study["method"], f"{study['seconds']:.1f}"
        rows.append((f"envelope {name}", how, study["nature"], effort(study), seconds))
    words = paragraphs(*explained(rows), *proofs(summary))
    return section(
        "Methods and cost",
        table(("stage", "method", "nature of the bounds", "cost", "seconds"), rows, numbers=3),
        words,
    )


def explained(rows: Sequence[tuple[object, ...]]) -> Iterator[str]:
    """Meaning of each nature of bounds in the table."""
    told = {nature.value: nature.sentence for nature in Nature}
    yield from (
        f"{nature.capitalize()}: {told[nature]}."
        for nature in dict.fromkeys(str(row[2]) for row in rows)
        if nature in told
    )


def proofs(summary: Document) -> Iterator[str]:
    """Gap of each certified envelope, and what it rests on."""
    for name, study in summary.get("envelopes", {}).items():
        if "proved" in study:
            ends = study["proved"]
            words = ", ".join(
                f"{output} {engineering(ends['min'][output], Output(output).unit)} …"
                f" {engineering(ends['max'][output], Output(output).unit)}"
                for output in ends["min"]
            )
            yield (
                f"Beside envelope {name} stand guaranteed bounds of the exact motion at every node"
                f" and level, on the lowest from least to greatest {words}."
            )
        if "gap" in study:
            of = str(study.get("gap_output", next(iter(study.get("min", {"q": 0})))))
            gap = engineering(float(study["gap"]), Output(of).unit, digits=2)
            worth = "proved" if "guaranteed" in str(study["nature"]) else "verified by sampling"
            yield (
                f"The bounds of envelope {name} are {worth} at every node, and no wider than {gap}"
                f" of {of} beyond what is attained. {sentence(study['proof'])}"
            )


def effort(study: Document) -> str:
    """Cost of an envelope: trajectories, or eigen-analyses."""
    kind = "eigen-analyses" if study["method"] == "modal" else "trajectories"
    return f"{study['trajectories']} {kind}"
