"""The homogenised stiffness in the form that other finite-element programs read."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from alphacut.io.files import as_json, write_text
from alphacut.io.problem import BadInput
from alphacut.rve.anisotropy import AveragedPlane, ratio_of, shear_ratio_in_words
from alphacut.rve.fibre_constants import CONSTANTS, FibreConstants, fibre_constants
from alphacut.rve.result import Homogenised, error_of_means, error_of_stiffness
from alphacut.rve.spheres.cubic import cubic_constants, cubic_voigt, hill_average
from alphacut.rve.spheres.result import HomogenisedSpheres
from alphacut.stochastic.theta.truncated_normal import Array


@dataclass(frozen=True)
class _Shape:
    """What the shape of the particle makes of a card's words.

    Args:
        convention: What the isotropic constants are.
        about: What the orthotropic constants are.
        name: End of the orthotropic material's name, upper case, and key of the stiffness.
        kind: Kind of stiffness.
        order: Voigt order.
        meaning: What E is of: cylinders (eq. 16), isotropic or spheres.
    """

    convention: str
    about: str
    name: str
    kind: str
    order: tuple[str, ...]
    meaning: str


CYLINDERS = _Shape(
    "isotropic constants by eq. 16; a square array is not isotropic",
    "the whole stiffness as orthotropic constants, axes 1 and 2 along the array, 3 along the"
    " particles, which are fibres; absolute errors: ",
    "plane",
    "plane-strain stiffness",
    ("11", "22", "12"),
    "cylinders",
)
AVERAGED = replace(
    CYLINDERS,
    convention="isotropic constants of the average of the plane stiffness over all directions",
    meaning="isotropic",
)
SPHERES = _Shape(
    "isotropic constants by Hill's average; a cubic array of spheres is not isotropic",
    "the whole stiffness as orthotropic constants, axes along the cubic array; absolute errors: ",
    "cubic",
    "stiffness",
    ("11", "22", "33", "23", "13", "12"),
    "spheres",
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
        f"{card}** {about(result, fibres)}\n*MATERIAL,"
        f" NAME=HOMOGENISED_{shape(result).name.upper()}\n*ELASTIC, TYPE=ENGINEERING"
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
    name = f"HOMOGENISED_{shape(result).name.upper()}"
    return f"{card}# {about(result, fibres)}\n{name} = DEFI_MATERIAU(ELAS_ORTH=_F({told}))\n"


def ansys(result: Homogenised) -> str:
    """Materials for Ansys Mechanical APDL, in Pa: 1 isotropic, 2 orthotropic."""
    card = f"{comments(result, '!')}MP,EX,1,{result.modulus:.9e}\nMP,PRXY,1,{result.poisson:.9f}\n"
    if (fibres := constants(result)) is None:
        return card
    names = ("EX", "EY", "EZ", "PRXY", "PRXZ", "PRYZ", "GXY", "GXZ", "GYZ")
    return f"{card}! {about(result, fibres)}\n" + "".join(
        f"MP,{name},2,{value:.9e}\n"
        for name, value in zip(names, fibres.values.values(), strict=True)
    )


def numbers(result: Homogenised) -> str:
    """Everything in JSON, in Pa, with declared absolute errors.

    Without a stiffness where the model did not compute it.
    """
    modulus, nu = errors_of_constants(result)
    words = shape(result)
    document: dict[str, object] = {
        "E_Pa": result.modulus,
        "nu": result.poisson,
        "convention": words.convention,
    }
    key = "cubic" if words is SPHERES else "plane_strain"
    errors: dict[str, object] = {"E_Pa": modulus, "nu": nu}
    if result.stiffness is not None:
        document["stiffness"] = {
            "order": list(words.order),
            "shear": "engineering",
            "unit": "Pa",
            key: result.stiffness,
        }
        document["shear_ratio"], errors["shear_ratio"] = ratio_of(result)
        errors[key] = errors_of_stiffness(result)
    if (fibres := constants(result)) is not None:
        name = f"{words.name}_constants"
        document[name], errors[name] = fibres.values, fibres.errors
    return as_json({**document, "declared_error": errors}, indent=2)


def above(error: float, value: float) -> str:
    """An error rounded up, with that of a value that is printed with ten digits."""
    return f"{1.05 * (error + 5e-10 * abs(value)):.1e}"


def comments(result: Homogenised, mark: str) -> str:
    """Lines of comment: the isotropic constants' worth, and the stiffness where it is known."""
    words = shape(result)
    lines = [words.convention]
    if result.errors:
        modulus, nu = errors_of_constants(result)
        told = f"E {above(modulus, result.modulus)} Pa, nu {above(nu, 1.0)}"
        lines.append(f"declared absolute errors: {told}")
    if result.stiffness is not None:
        error, (ratio, off) = errors_of_stiffness(result), ratio_of(result)
        lines.append(shear_ratio_in_words(ratio, words.meaning))
        lines.append(f"absolute error of this ratio: {above(off + 5e-4, 0.0)}")  # three decimals
        lines.append(
            f"{words.kind} in Pa, Voigt order {', '.join(words.order)} with engineering shear"
            " strain, and the absolute errors of its entries:"
        )
        lines += [", ".join(f"{entry:.9e}" for entry in row) for row in result.stiffness]
        pairs = (zip(*rows, strict=True) for rows in zip(error, result.stiffness, strict=True))
        lines += [", ".join(above(*pair) for pair in row) for row in pairs]
    return "".join(f"{mark} {line}\n" for line in lines)


def shape(result: Homogenised) -> _Shape:
    """Words for the result's particle."""
    if isinstance(result, AveragedPlane):
        return AVERAGED
    return SPHERES if isinstance(result, HomogenisedSpheres) else CYLINDERS


def errors_of_constants(result: Homogenised) -> tuple[float, float]:
    """Declared absolute errors of E (Pa) and ν."""
    if isinstance(result, HomogenisedSpheres):
        modulus, nu = result.error_of(hill_average)
        return float(modulus), float(nu)
    modulus, nu, *_ = error_of_means(result)
    return float(modulus), float(nu)


def errors_of_stiffness(result: Homogenised) -> Array:
    """Declared absolute errors of the stiffness (Pa)."""
    if isinstance(result, HomogenisedSpheres):
        return result.error_of(lambda moduli: cubic_voigt(*moduli))
    return error_of_stiffness(result, np.asarray)


def about(result: Homogenised, fibres: FibreConstants) -> str:
    """Line of comment on orthotropic constants."""
    return shape(result).about + ", ".join(
        f"{name} {above(error, fibres.values[name])}" for name, error in fibres.errors.items()
    )


def constants(result: Homogenised) -> FibreConstants | None:
    """Orthotropic constants; None where the model did not compute the stiffness."""
    if result.stiffness is None or result.cell is None:
        return None
    if isinstance(result, HomogenisedSpheres):
        values, errors = cubic_constants(result.moduli), result.error_of(cubic_constants)
        names = zip(CONSTANTS, values, errors, strict=True)
        triples = [(name, float(value), float(error)) for name, value, error in names]
        return FibreConstants(
            {name: value for name, value, _ in triples}, {name: error for name, _, error in triples}
        )
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
        raise BadInput.of("--export", "this ending names no format", path, allowed)


def export(result: Homogenised, path: str) -> None:
    """Write the material in the format that the file's ending names."""
    write_text(path, FORMATS[Path(path).suffix](result))
