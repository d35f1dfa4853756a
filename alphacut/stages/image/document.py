"""The result of an image as JSON and as NetCDF."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from shutil import rmtree
from typing import TYPE_CHECKING, Any

import numpy as np

from alphacut.io.files import Document, as_json
from alphacut.io.netcdf import write_dataset
from alphacut.io.provenance import versions
from alphacut.io.units import fixed
from alphacut.rve.image.directions import directions
from alphacut.rve.image.model import ImageCut
from alphacut.stages.image.bounds import CURES, FuzzyImage
from alphacut.stages.image.phases import BEYOND, IF, phase_lines
from alphacut.stages.material.cell import GPA

if TYPE_CHECKING:
    import xarray


def document(found: FuzzyImage) -> Document:
    """The result as it is printed with ``--json``; moduli in GPa."""
    cut, alpha = found.top, found.study.alpha
    bounds = cut.bounds
    low, high = bounds.bulk
    turned = directions(bounds)
    return {
        "lower_GPa": bounds.lower / GPA,
        "upper_GPa": bounds.upper / GPA,
        "width": bounds.width,
        "E_GPa": pair(cut.modulus),
        "nature": cut.nature + IF,
        "iterations": max(c.iterations for c in (found.crisp, *found.cuts)),
        "seconds": found.seconds,
        "nu": poisson(cut),
        "plane_strain_bulk_GPa": pair((low / 2, high / 2)),
        "cuts": {
            "alpha": alpha,
            "E_GPa": {
                "lower": [c.modulus[0] / GPA for c in found.cuts],
                "upper": [c.modulus[1] / GPA for c in found.cuts],
            },
            "nature": [c.nature + IF for c in found.cuts],
        },
        "error_table": error_table(found),
        "fractions": found.study.fractions,
        "phases": phase_lines(found.study),
        "boundary": BEYOND,
        "grains_E_GPa": pair(found.grains),
        "directions_E_GPa": {"least": pair(turned.least), "greatest": pair(turned.greatest)},
        "isotropic": {
            "plane_strain_bulk_GPa": turned.isotropic[0] / GPA,
            "shear_GPa": turned.isotropic[1] / GPA,
            "distance": turned.distance,
        },
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


def poisson(cut: ImageCut) -> dict[str, float]:
    """Bounds of ν of eq. 16, (1 − A/B)/2, by those of A and B."""
    shear, bulk = cut.bounds.shear, cut.bounds.bulk
    return {"lower": (1 - shear[1] / bulk[0]) / 2, "upper": (1 - shear[0] / bulk[1]) / 2}


def pair(ends: tuple[float, float]) -> dict[str, float]:
    """An interval of moduli in GPa."""
    return {"lower": ends[0] / GPA, "upper": ends[1] / GPA}


def dataset(found: FuzzyImage) -> xarray.Dataset:
    """α-cuts of E and of the stiffness, the picture of the phases and of the error."""
    import xarray

    plane = ("y", "x")
    variables: dict[str, Any] = {
        "E": (
            ("alpha", "bound"),
            np.array([cut.modulus for cut in found.cuts]),
            {"units": "Pa", "long_name": "effective Young's modulus, eq. 16"},
        ),
        "stiffness": (
            ("alpha", "bound", "row", "column"),
            np.array([[c.bounds.lower, c.bounds.upper] for c in found.cuts]),
            {"units": "Pa", "long_name": "bounds of the plane-strain stiffness, or of tiles' mean"},
        ),
        "phase": (plane, found.phase.astype(np.float32), {"long_name": "number of the phase"}),
        "gap": (
            plane,
            found.gap.astype(np.float32),
            {"units": "Pa", "long_name": "constitutive error of the two fields, modal inputs"},
        ),
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


def write(found: FuzzyImage, path: Path, attributes: dict[str, str | int], kept: Path) -> None:
    """Write ``image.nc``, whole or not at all, and remove the folder of what was kept for it."""
    write_dataset(dataset(found), path, attributes | {"document": as_json(document(found))})
    rmtree(kept, ignore_errors=True)
