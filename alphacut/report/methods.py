"""The report's section on methods: their cost, the worth of their bounds, what proofs rest on."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from markupsafe import Markup

from alphacut.fuzzy.samples.nature import Nature
from alphacut.io.files import Document
from alphacut.io.units import engineering
from alphacut.report.tables import paragraphs, section, sentence, table


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
    told = {nature.value: nature.sentence() for nature in Nature}
    yield from (
        f"{nature.capitalize()}: {told[nature]}."
        for nature in dict.fromkeys(str(row[2]) for row in rows)
        if nature in told
    )


def proofs(summary: Document) -> Iterator[str]:
    """Gap of each certified envelope, and what it rests on."""
    from alphacut.frame.outputs import output_unit

    for name, study in summary.get("envelopes", {}).items():
        if "proved" in study:
            ends = study["proved"]
            words = ", ".join(
                f"{output} {engineering(ends['min'][output], output_unit(output))} …"
                f" {engineering(ends['max'][output], output_unit(output))}"
                for output in ends["min"]
            )
            yield (
                f"Beside envelope {name} stand guaranteed bounds of the exact motion at every node"
                f" and level, on the lowest from least to greatest {words}."
            )
        if "gap" in study:
            of = str(study.get("gap_output", next(iter(study.get("min", {"q": 0})))))
            gap = engineering(float(study["gap"]), output_unit(of), digits=2)
            worth = "proved" if "guaranteed" in str(study["nature"]) else "verified by sampling"
            yield (
                f"The bounds of envelope {name} are {worth} at every node, and no wider than {gap}"
                f" of {of} beyond what is attained. {sentence(study['proof'])}"
            )


def effort(study: Document) -> str:
    """Cost of an envelope: trajectories, or eigen-analyses."""
    return (
        f"{study['trajectories']}"
        f" {'eigen-analyses' if study['method'] == 'modal' else 'trajectories'}"
    )
