"""The homogenised stiffness in the form that other finite-element programs read."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from alphacut.io.files import as_json, write_text
from alphacut.io.problem import BadInput, Problem
from alphacut.rve.anisotropy import plane_constants, shear_ratio, shear_ratio_in_words

if TYPE_CHECKING:
    from alphacut.rve.result import Homogenised

CONVENTION = "isotropic constants by eq. 16; a square array is not isotropic"
PLANE = (
    "the same plane-strain stiffness as orthotropic constants, axes along the array; for plane"
    " strain only: the rest is isotropic"
)


def abaqus(result: Homogenised) -> str:
    """Materials for Abaqus and CalculiX, in Pa: isotropic, and engineering constants."""
    card = (
        f"{comments(result, '**')}*MATERIAL, NAME=HOMOGENISED\n*ELASTIC,"
        f" TYPE=ISOTROPIC\n{result.modulus:.9e}, {result.poisson:.9f}\n"
    )
    if not (plane := constants(result)):
        return card
    values = [f"{value:.9e}" for value in plane.values()]
    rows = f"{', '.join(values[:8])}\n{values[8]}\n"
    return (
        f"{card}** {PLANE}\n*MATERIAL, NAME=HOMOGENISED_PLANE\n*ELASTIC, TYPE=ENGINEERING"
        f" CONSTANTS\n{rows}"
    )


def aster(result: Homogenised) -> str:
    """Materials for Code_Aster, in Pa: isotropic, and orthotropic."""
    card = (
        f"{comments(result, '#')}HOMOGENISED = DEFI_MATERIAU(ELAS=_F(E={result.modulus:.9e},"
        f" NU={result.poisson:.9f}))\n"
    )
    if not (plane := constants(result)):
        return card
    names = ("E_L", "E_T", "E_N", "NU_LT", "NU_LN", "NU_TN", "G_LT", "G_LN", "G_TN")
    told = ", ".join(
        f"{name}={value:.9e}" for name, value in zip(names, plane.values(), strict=True)
    )
    return f"{card}# {PLANE}\nHOMOGENISED_PLANE = DEFI_MATERIAU(ELAS_ORTH=_F({told}))\n"


def ansys(result: Homogenised) -> str:
    """Materials for Ansys Mechanical APDL, in Pa: 1 isotropic, 2 orthotropic."""
    card = f"{comments(result, '!')}MP,EX,1,{result.modulus:.9e}\nMP,PRXY,1,{result.poisson:.9f}\n"
    if not (plane := constants(result)):
        return card
    names = ("EX", "EY", "EZ", "PRXY", "PRXZ", "PRYZ", "GXY", "GXZ", "GYZ")
    return f"{card}! {PLANE}\n" + "".join(
        f"MP,{name},2,{value:.9e}\n" for name, value in zip(names, plane.values(), strict=True)
    )


def numbers(result: Homogenised) -> str:
    """Everything in JSON, in Pa; without a stiffness where the model did not compute it."""
    document: dict[str, object] = {
        "E_Pa": result.modulus,
        "nu": result.poisson,
        "convention": CONVENTION,
    }
    if result.stiffness is not None:
        document["stiffness"] = {
            "order": ["11", "22", "12"],
            "shear": "engineering",
            "unit": "Pa",
            "plane_strain": result.stiffness,
        }
        document |= {
            "shear_ratio": shear_ratio(result.stiffness),
            "plane_constants": constants(result),
        }
    return as_json(document, indent=2)


def comments(result: Homogenised, mark: str) -> str:
    """Lines of comment: worth of the isotropic constants, and the stiffness."""
    lines = [CONVENTION]
    if result.stiffness is not None:
        lines.append(shear_ratio_in_words(shear_ratio(result.stiffness)))
        lines.append(
            "plane-strain stiffness in Pa, Voigt order 11, 22, 12 with engineering shear strain:"
        )
        lines += [", ".join(f"{entry:.9e}" for entry in row) for row in result.stiffness]
    return "".join(f"{mark} {line}\n" for line in lines)


def constants(result: Homogenised) -> dict[str, float]:
    """Orthotropic constants of the plane-strain stiffness in Pa; empty without it."""
    return {} if result.stiffness is None else plane_constants(result.stiffness, result.poisson)


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
