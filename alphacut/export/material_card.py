"""The homogenised stiffness in the form that other finite-element programs read."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from alphacut.io.files import as_json, write_text
from alphacut.io.problem import BadInput, Problem
from alphacut.rve.anisotropy import shear_ratio, shear_ratio_in_words
from alphacut.rve.fibre_constants import FibreConstants, fibre_constants
from alphacut.rve.result import error_of_means, error_of_stiffness

if TYPE_CHECKING:
    from alphacut.rve.result import Homogenised

CONVENTION = "isotropic constants by eq. 16; a square array is not isotropic"
PLANE = (
    "the whole stiffness as orthotropic constants, axes 1 and 2 along the array, 3 along the"
    " particles, which are fibres; absolute errors: "
)


def abaqus(result: Homogenised) -> str:
    """Materials for Abaqus and CalculiX, in Pa: isotropic, and engineering constants."""
    card = (
        f"{comments(result, '**')}*MATERIAL, NAME=HOMOGENISED\n*ELASTIC,"
        f" TYPE=ISOTROPIC\n{result.modulus:.9e}, {result.poisson:.9f}\n"
    )
    if (fibres := constants(result)) is None:
        return card
    values = [f"{value:.9e}" for value in fibres.values.values()]
    rows = f"{', '.join(values[:8])}\n{values[8]}\n"
    return (
        f"{card}** {about(fibres)}\n*MATERIAL, NAME=HOMOGENISED_PLANE\n*ELASTIC, TYPE=ENGINEERING"
        f" CONSTANTS\n{rows}"
    )


def aster(result: Homogenised) -> str:
    """Materials for Code_Aster, in Pa: isotropic and orthotropic."""
    card = (
        f"{comments(result, '#')}HOMOGENISED = DEFI_MATERIAU(ELAS=_F(E={result.modulus:.9e},"
        f" NU={result.poisson:.9f}))\n"
    )
    if (fibres := constants(result)) is None:
        return card
    names = ("E_L", "E_T", "E_N", "NU_LT", "NU_LN", "NU_TN", "G_LT", "G_LN", "G_TN")
    told = ", ".join(
        f"{name}={value:.9e}" for name, value in zip(names, fibres.values.values(), strict=True)
    )
    return f"{card}# {about(fibres)}\nHOMOGENISED_PLANE = DEFI_MATERIAU(ELAS_ORTH=_F({told}))\n"


def ansys(result: Homogenised) -> str:
    """Materials for Ansys Mechanical APDL, in Pa: 1 isotropic, 2 orthotropic."""
    card = f"{comments(result, '!')}MP,EX,1,{result.modulus:.9e}\nMP,PRXY,1,{result.poisson:.9f}\n"
    if (fibres := constants(result)) is None:
        return card
    names = ("EX", "EY", "EZ", "PRXY", "PRXZ", "PRYZ", "GXY", "GXZ", "GYZ")
    return f"{card}! {about(fibres)}\n" + "".join(
        f"MP,{name},2,{value:.9e}\n"
        for name, value in zip(names, fibres.values.values(), strict=True)
    )


def numbers(result: Homogenised) -> str:
    """Everything in JSON, in Pa, with declared absolute errors.

    Without a stiffness where the model did not compute it.
    """
    modulus, nu, *_ = error_of_means(result)
    document: dict[str, object] = {
        "E_Pa": result.modulus,
        "nu": result.poisson,
        "convention": CONVENTION,
    }
    errors: dict[str, object] = {"E_Pa": modulus, "nu": nu}
    if result.stiffness is not None:
        document["stiffness"] = {
            "order": ["11", "22", "12"],
            "shear": "engineering",
            "unit": "Pa",
            "plane_strain": result.stiffness,
        }
        document["shear_ratio"] = shear_ratio(result.stiffness)
        errors["plane_strain"] = error_of_stiffness(result, np.asarray)
        errors["shear_ratio"] = float(error_of_stiffness(result, shear_ratio))
    if (fibres := constants(result)) is not None:
        document["plane_constants"], errors["plane_constants"] = fibres.values, fibres.errors
    return as_json({**document, "declared_error": errors}, indent=2)


def comments(result: Homogenised, mark: str) -> str:
    """Lines of comment: the isotropic constants' worth, and the stiffness where it is known."""
    lines = [CONVENTION]
    if result.errors:
        modulus, nu, *_ = error_of_means(result)
        lines.append(f"declared absolute errors: E {modulus:.1e} Pa, nu {nu:.1e}")
    if result.stiffness is not None:
        ratio = float(error_of_stiffness(result, shear_ratio))
        error = error_of_stiffness(result, np.asarray)
        lines.append(shear_ratio_in_words(shear_ratio(result.stiffness)))
        lines.append(f"absolute error of this ratio: {ratio:.1e}")
        lines.append(
            "plane-strain stiffness in Pa, Voigt order 11, 22, 12 with engineering shear strain,"
            " and the absolute errors of its entries:"
        )
        lines += [", ".join(f"{entry:.9e}" for entry in row) for row in result.stiffness]
        lines += [", ".join(f"{entry:.1e}" for entry in row) for row in error]
    return "".join(f"{mark} {line}\n" for line in lines)


def about(fibres: FibreConstants) -> str:
    """Line of comment on orthotropic constants."""
    return PLANE + ", ".join(f"{name} {error:.1e}" for name, error in fibres.errors.items())


def constants(result: Homogenised) -> FibreConstants | None:
    """Orthotropic constants; None where the model did not compute the stiffness."""
    if result.stiffness is None or result.cell is None:
        return None
    return fibre_constants(result)


FORMATS: dict[str, Callable[[Homogenised], str]] = {
    ".inp": abaqus,
    ".comm": aster,
    ".mac": ansys,
    ".json": numbers,
}


def check_format(path: str) -> None:
    """Refuse an ending that names no format, before anything is computed."""
    if Path(path).suffix not in FORMATS:
        allowed = ".inp (Abaqus, CalculiX), .comm (Code_Aster), .mac (Ansys), .json"
        raise BadInput(Problem("--export", "this ending names no format", path, allowed))


def export(result: Homogenised, path: str) -> None:
    """Write the material in the format that the file's ending names."""
    write_text(path, FORMATS[Path(path).suffix](result))
