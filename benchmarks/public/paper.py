"""Fuzzy modulus of a material, and fuzzy motion of a frame made of it.

A round particle of 75 … 85 GPa, most plausibly 80, stands in a matrix of 20 GPa, both with a
Poisson's ratio of .3. Its radius is random and fuzzy. A frame of three storeys of this material
swings freely after an earthquake. `cases/paper.toml` has every input with its place in the paper,
and marks what the paper does not state. Numbers that the paper has in figures only are in the
README.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path

from alphacut import main
from benchmarks.paper import ROOT
from benchmarks.paper import rows as rows_of_summary
from benchmarks.public.row import Row

NAME = "Paper: fuzzy modulus and motion"
SOURCE = (
    "Fuzzy dynamics of multibody systems with polymorphic uncertainty in the material"
    " microstructure, section 4.3 and Figs. 28 and 29"
)
PRINTED = 5
"""Rows of its table whose numbers the paper prints; the others are read off figures (README)."""


def rows() -> Iterator[Row]:
    """Run the case, and take its numbers."""
    with tempfile.TemporaryDirectory() as folder:
        main(["run", str(ROOT / "cases/paper.toml"), "--out", folder, "--quiet", "--no-figures"])
        table = list(rows_of_summary(Path(folder, "summary.json")))
    for row in table[:PRINTED]:
        yield Row(
            row.quantity,
            f"{row.paper:g}",
            row.here,
            unit=row.unit,
            digits=4 if row.unit == "m" else 6,
            tolerance=0.002,
            remark="the paper does not state its mesh and time step",
        )
