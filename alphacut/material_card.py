"""The homogenised stiffness in the form that other finite-element programs read."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from alphacut.output import as_json, write_text
from alphacut.problem import BadInput, Problem

if TYPE_CHECKING:
    from rve.result import Homogenised

CONVENTION = "isotropic constants by eq. 16; a square array is not isotropic, see the plane-strain stiffness"


def abaqus(result: Homogenised) -> str:
    """A material for Abaqus and CalculiX, in Pa."""
    rows = "".join(f"** {', '.join(f'{entry:.9e}' for entry in row)}\n" for row in stiffness(result))
    head = f"** {CONVENTION}\n** plane-strain stiffness in Pa, Voigt order 11, 22, 12 with engineering shear strain:\n{rows}"
    return f"{head}*MATERIAL, NAME=HOMOGENISED\n*ELASTIC, TYPE=ISOTROPIC\n{result.modulus:.9e}, {result.poisson:.9f}\n"


def aster(result: Homogenised) -> str:
    """A material for Code_Aster, in Pa."""
    return f"# {CONVENTION}\nHOMOGENISED = DEFI_MATERIAU(ELAS=_F(E={result.modulus:.9e}, NU={result.poisson:.9f}))\n"


def ansys(result: Homogenised) -> str:
    """A material for Ansys Mechanical APDL, in Pa."""
    return f"! {CONVENTION}\nMP,EX,1,{result.modulus:.9e}\nMP,PRXY,1,{result.poisson:.9f}\n"


def numbers(result: Homogenised) -> str:
    """Everything in JSON, in Pa."""
    voigt = {"order": ["11", "22", "12"], "shear": "engineering", "unit": "Pa", "plane_strain": stiffness(result)}
    return as_json({"E_Pa": result.modulus, "nu": result.poisson, "convention": CONVENTION, "stiffness": voigt}, indent=2)


FORMATS: dict[str, Callable[[Homogenised], str]] = {".inp": abaqus, ".comm": aster, ".mac": ansys, ".json": numbers}


def stiffness(result: Homogenised) -> list[list[float]]:
    """The mean plane-strain stiffness, (3, 3); empty where the model did not compute it."""
    return [] if result.stiffness is None else [[float(entry) for entry in row] for row in result.stiffness]


def check_format(path: str) -> None:
    """Refuse an ending that names no format, before anything is computed."""
    if Path(path).suffix not in FORMATS:
        allowed = ".inp (Abaqus, CalculiX), .comm (Code_Aster), .mac (Ansys), .json"
        raise BadInput(Problem("--export", "this ending names no format", path, allowed))


def export(result: Homogenised, path: str) -> None:
    """Write the material in the format that the file's ending names."""
    write_text(path, FORMATS[Path(path).suffix](result))
