"""Hashin–Shtrikman bounds of clay and calcite.

Equal volumes of clay (K = 21, G = 7 GPa) and calcite (K = 76.8, G = 32 GPa); bounds of the bulk
modulus of an isotropic mixture. The source's comments give them for 50 : 50, though its test then
asks with other fractions, and for agreement to 50 GPa.
"""

from __future__ import annotations

from collections.abc import Iterator

from alphacut.rve import Phase, reference_bounds
from benchmarks.public.row import Row

NAME = "Clay and calcite (bruges)"
SOURCE = (
    "Agile Scientific, bruges, `bruges/rockphysics/test/bounds_test.py` in"
    " agile-geoscience/bruges at a4f0cd3, lines 20–21 (input) and 30–31 (numbers)"
)


def rows() -> Iterator[Row]:
    """Both bounds."""
    phases = []
    for bulk, shear in ((21e9, 7e9), (76.8e9, 32e9)):
        young = 9 * bulk * shear / (3 * bulk + shear)
        phases.append(Phase(young, young / (2 * shear) - 1))
    lower, upper = reference_bounds(phases, fractions=[0.5, 0.5], space=True).bulk
    yield Row("lower bound of K", "35.5329", lower / 1e9, unit="GPa")
    yield Row(
        "upper bound of K",
        "40.3989",
        upper / 1e9,
        digits=7,
        unit="GPa",
        tolerance=2e-6,
        remark="theirs is cut after the fourth decimal, not rounded",
    )
