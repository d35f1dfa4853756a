"""Constants along x and y in both definitions, as outputs of samples."""

from __future__ import annotations

from alphacut.rve.result.engineering_constants import (
    FREE,
    NAMES,
    PLANE_STRAIN,
    engineering_constants,
)
from alphacut.rve.result.result import HomogenisedStiffness

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


def plane_outputs(result: HomogenisedStiffness) -> dict[str, float]:
    """Values by the names of `PLANE`, moduli in Pa; those of the definitions that are known."""
    return {
        name + SUFFIXES[definition]: float(value)
        for definition, constants in engineering_constants(result).items()
        for name, value in zip(NAMES, constants.values, strict=True)
    }
