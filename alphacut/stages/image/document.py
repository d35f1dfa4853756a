"""The result of an image as JSON and as NetCDF."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from alphacut.io.files import Document, as_json
from alphacut.io.netcdf import write_dataset
from alphacut.io.provenance import versions
from alphacut.io.units import fixed
from alphacut.rve.anisotropy import AVERAGES
from alphacut.stages.image.bounds import CURES, FuzzyImage
from alphacut.stages.image.phases import BEYOND, NATURE, phase_lines
from alphacut.stages.material.cell import GPA

if TYPE_CHECKING:
    import xarray


def document(found: FuzzyImage) -> Document:
    """The result as it is printed with ``--json``; moduli in GPa."""
    cut, alpha = found.top, found.study.alpha
    bounds = cut.bounds
    average = found.model.average
    return {
        "lower_GPa": bounds.lower / GPA,
        "upper_GPa": bounds.upper / GPA,
        "width": bounds.width,
        "E_GPa": pair(cut.modulus),
        "average": average,
        "nature": NATURE,
        "iterations": max(c.iterations for c in (found.crisp, *found.cuts)),
        "seconds": found.seconds,
        "nu": dict(zip(("lower", "upper"), cut.poisson, strict=True)),
        "G_T_GPa": pair(bounds.shear(average)),
        "plane_strain_bulk_GPa": pair(bounds.bulk),
        "cuts": {
            "alpha": alpha,
            "E_GPa": {
                "lower": [c.modulus[0] / GPA for c in found.cuts],
                "upper": [c.modulus[1] / GPA for c in found.cuts],
            },
            "nature": [NATURE for _ in found.cuts],
        },
        "error_table": error_table(found),
        "fractions": found.study.fractions,
        "phases": phase_lines(found.study),
        "boundary": BEYOND,
        "division": found.model.parts,
        "versions": versions(),
    }


def interval(ends: Mapping[str, float]) -> str:
    """An interval of moduli in GPa, for people."""
    return f"[{fixed(ends['lower'], 4)}, {fixed(ends['upper'], 4)}] GPa"


def error_table(found: FuzzyImage) -> list[Document]:
    """Source, width of E from it, its share of all of them, and what narrows it."""
    total = sum(row.width for row in found.contributions) or 1.0
    return [
        {
            "source": row.source,
            "width_GPa": row.width / GPA,
            "share": row.width / total,
            "cure": CURES[row.source],
        }
        for row in found.contributions
    ]


def pair(ends: tuple[float, float]) -> dict[str, float]:
    """An interval of moduli in GPa."""
    return {"lower": ends[0] / GPA, "upper": ends[1] / GPA}


def dataset(found: FuzzyImage) -> xarray.Dataset:
    """α-cuts of E and of the stiffness, the picture of the phases."""
    import xarray

    plane = ("y", "x")
    variables: dict[str, Any] = {
        "E": (
            ("alpha", "bound"),
            np.array([cut.modulus for cut in found.cuts]),
            {"units": "Pa", "long_name": f"Young's modulus, {AVERAGES[found.model.average]}"},
        ),
        "stiffness": (
            ("alpha", "bound", "row", "column"),
            np.array([[c.bounds.lower, c.bounds.upper] for c in found.cuts]),
            {"units": "Pa", "long_name": "bounds of the plane-strain stiffness"},
        ),
        "phase": (plane, found.phase.astype(np.float32), {"long_name": "number of the phase"}),
    }
    coordinates = {
        "alpha": list(found.study.alpha),
        "bound": ["lower", "upper"],
        "row": ["11", "22", "12"],
        "column": ["11", "22", "12"],
    }
    return xarray.Dataset(
        variables, coordinates, {"nature": document(found)["nature"], "seconds": found.seconds}
    )


def write(found: FuzzyImage, path: Path, attributes: dict[str, str | int]) -> None:
    """Write ``image.nc``, whole or not at all."""
    write_dataset(dataset(found), path, attributes | {"document": as_json(document(found))})
