"""The sections of the report, each a piece of HTML."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from markupsafe import Markup

from alphacut.figures.captions import in_words
from alphacut.io.files import Document
from alphacut.report import glossary, tables
from alphacut.report.decisions import decided, learned, next_measured, together
from alphacut.report.differences import differences
from alphacut.report.envelopes import envelopes, natural
from alphacut.report.figures import gallery, listed
from alphacut.report.key_results import key_results
from alphacut.report.material import given, image, microstructure, modulus, stress
from alphacut.report.methods import methods
from alphacut.report.spectrum import spectrum
from alphacut.report.tables import citation, code, details, items, paragraphs, section, table


def sections(summary: Document, folder: Path) -> Iterator[Markup]:
    """All sections that the results allow, in reading order."""
    yield key_results(summary)
    if "microstructure" in summary:
        seen = listed(summary, folder, "image_circles")
        yield microstructure(summary["microstructure"], seen)
    if "modulus" in summary:
        yield modulus(summary["modulus"], listed(summary, folder, "modulus"))
    if "image" in summary:
        yield image(summary["image"], listed(summary, folder, "image"))
    if "given_modulus" in summary:
        yield given(summary["given_modulus"])
    if "response" in summary:
        yield stress(summary["response"], listed(summary, folder, "response"))
    if words := summary.get("structure", {}).get("words"):
        yield built(words, natural(summary))
    if (folder / "spectrum.csv").is_file():
        yield spectrum(folder)
    if "update" in summary:
        yield learned(summary, folder)
    if summary.get("envelopes"):
        yield envelopes(summary, listed(summary, folder, "exceedance"))
    if "decision" in summary:
        yield decided(summary, folder)
    if "joint" in summary:
        yield together(summary, folder)
    if (folder / "measure-next.json").is_file():
        yield next_measured(folder)
    if summary.get("shares"):
        yield shares(summary["shares"], summary.get("shares_notes", ()))
    if summary.get("paper"):
        yield comparison(summary["paper"])
    yield methods(summary)
    yield section("Terms", glossary.box())
    yield gallery(summary, folder)
    yield case_text(summary)
    yield differing(summary)
    yield versions(summary)


def built(words: Document, periods: Markup) -> Markup:
    """The structure: what it is, its floors or inputs, its first periods."""
    sentences = paragraphs(*words["sentences"])
    return section("Structure", sentences, table(words["head"], words["rows"]), periods)


def shares(found: Document, notes: Sequence[str] = ()) -> Markup:
    """Contributions of the inputs to the widths."""
    from alphacut.figures.envelope import WORDS

    words = paragraphs(
        "Share of the width at α = 0 that is lost when an input is fixed at its modal value and"
        " all others are kept.",
        *map(tables.sentence, notes),
    )
    kinds = dict.fromkeys(tuple(entry) for entry in found.values())
    drawn = []
    for inputs in kinds:
        of = [name for name, entry in found.items() if tuple(entry) == inputs]
        rows = [
            (
                WORDS.get(name) or in_words(name),
                *(f"{found[quantity][name]:.1%}" for quantity in of),
            )
            for name in inputs
        ]
        drawn.append(table(("input", *of), rows))
    return section("What drives the width", words, *drawn)


def comparison(rows: Sequence[Document]) -> Markup:
    """Paper, here, difference."""
    from alphacut.stages.summary import cells

    return section(
        "Paper and here",
        table(
            ("quantity", "place", "paper", "here", "difference", "share"),
            [cells(dict(row)) for row in rows],
            numbers=2,
        ),
    )


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
