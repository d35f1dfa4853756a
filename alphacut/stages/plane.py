"""Constants along x and y in both definitions: as outputs of samples and as rows of tables."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from alphacut.fuzzy.result import Nature
from alphacut.io.files import Document
from alphacut.io.quantity import between
from alphacut.rve.engineering_constants import FREE, NAMES, PLANE_STRAIN, engineering_constants
from alphacut.rve.result import HomogenisedStiffness

Row = tuple[str, ...]
SUFFIXES = {PLANE_STRAIN: "", FREE: "_free"}
"""What is added to a constant's name, by definition."""
ABOUT = {
    "E_x": ("Pa", "Young's modulus along x"),
    "E_y": ("Pa", "Young's modulus along y"),
    "nu_xy": ("1", "Poisson's ratio of a pull along x"),
    "G_xy": ("Pa", "shear modulus between x and y"),
}
PLANE = {
    name + suffix: (unit, f"{about}, {definition}")
    for definition, suffix in SUFFIXES.items()
    for name, (unit, about) in ABOUT.items()
}
"""Unit and meaning of each output."""
ONLY = "Plane strain alone: the other definition is for one particle of two isotropic phases"


def plane_outputs(result: HomogenisedStiffness) -> dict[str, float]:
    """Values by the names of `PLANE`, moduli in Pa; those of the definitions that are known."""
    return {
        name + SUFFIXES[definition]: float(value)
        for definition, constants in engineering_constants(result).items()
        for name, value in zip(NAMES, constants.values, strict=True)
    }


def cut_tables(
    cuts: Mapping[str, Document], nature: Nature = Nature.ATTAINED
) -> Iterator[tuple[tuple[str, ...], list[Row]]]:
    """Titles and rows of α-cuts on the lowest and highest level, a table for each definition.

    Args:
        cuts: By the names of `PLANE`, of moduli in GPa with "_GPa" after them.
        nature: Of the cuts.
    """
    for definition, suffix in SUFFIXES.items():
        rows: list[Row] = []
        for name, (unit, _) in ABOUT.items():
            cut_ends = cuts.get(name + suffix + ("_GPa" if unit == "Pa" else ""))
            if cut_ends is not None:
                ends = (
                    between(cut_ends["lower"][k], cut_ends["upper"][k], Nature.ATTAINED, 5)
                    for k in (0, -1)
                )
                shown = name.replace("nu", "ν") + (", GPa" if unit == "Pa" else "")
                rows.append((shown, *ends))
        if rows:
            yield (definition, "α = 0", "α = 1"), rows
