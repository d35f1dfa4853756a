"""The fuzzy modulus of a cell: α-cuts of its constants, as numbers, as a dataset and as inputs."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from alphacut.fuzzy import Crisp, FuzzyNumber
from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.refused import require
from alphacut.fuzzy.result import Bounds, Nature
from alphacut.fuzzy.sets.numbers import outer_steps
from alphacut.rve.result.engineering_constants import (
    FREE,
    NAMES,
    PLANE_STRAIN,
    engineering_constants,
)
from alphacut.rve.result.loss_factors import CONSTANTS
from alphacut.rve.result.result import HomogenisedStiffness
from alphacut.stages.cell import GPA, References
from alphacut.stages.losses import LossResult
from alphacut.stages.store import CutsResult, Numbers, Values

if TYPE_CHECKING:
    import xarray

SUFFIXES = {PLANE_STRAIN: "", FREE: "_free"}
"""What is added to the name of a constant along x and y as an output, by definition."""
ABOUT = {
    "E_x": ("Pa", "Young's modulus along x"),
    "E_y": ("Pa", "Young's modulus along y"),
    "nu_xy": ("1", "Poisson's ratio of a pull along x"),
    "G_xy": ("Pa", "shear modulus between x and y"),
}
BOUNDS = {
    "E": ("Pa", "effective Young's modulus"),
    "nu": ("1", "effective Poisson's ratio"),
    "s11": ("Pa", "mean homogenised stress 11 under ε11 = ε22 = 0.01"),
    "s12": ("Pa", "mean homogenised stress 12 under ε12 = 0.01"),
}
FIBRES = {
    "E_T": ("Pa", "Young's modulus across the fibres"),
    "E_L": ("Pa", "Young's modulus along the fibres"),
    "nu_LT": ("1", "Poisson's ratio of a pull along the fibres"),
    "G_T": ("Pa", "shear modulus across the fibres"),
    "G_L": ("Pa", "shear modulus along the fibres"),
}
"""Constants of cylinders besides; see rve.fibre_constants."""
PLANE = {
    name + suffix: (unit, f"{about}, {definition}")
    for definition, suffix in SUFFIXES.items()
    for name, (unit, about) in ABOUT.items()
}
QUANTITIES = BOUNDS | FIBRES | PLANE
"""Unit and meaning of each output that has α-cuts."""
CUT = ("alpha", "bound")


class ModulusResult(Numbers):
    """α-cuts of a cell, moduli in GPa; their nature, relative errors of E, references and cost.

    `fibres` has the constants of cylinders by name, as E_T_GPa; `plane` those along x and y by
    definition and name. Errors by source and checks are the largest of all samples.
    """

    alpha: Values
    E_GPa: CutsResult
    nu_cuts: CutsResult
    fibres: dict[str, CutsResult]
    plane: dict[str, dict[str, CutsResult]]
    method: str
    plan: str
    samples: int
    solves: int
    seconds: float
    nature: Nature
    particles: str
    average: str
    error: dict[str, float]
    checks: dict[str, float]
    references: References
    loss: LossResult | None


def plane_outputs(result: HomogenisedStiffness) -> dict[str, float]:
    """Values by the names of `PLANE`, moduli in Pa; those of the definitions that are known."""
    return {
        name + SUFFIXES[definition]: float(value)
        for definition, constants in engineering_constants(result).items()
        for name, value in zip(NAMES, constants.values, strict=True)
    }


def cuts_of(result: Bounds, names: Mapping[str, str]) -> dict[str, CutsResult]:
    """α-cuts of those outputs that a result has, moduli in GPa by NAME_GPa.

    `names` has the name of each constant by that of its output.
    """
    cuts: dict[str, CutsResult] = {}
    for output, name in names.items():
        if output in result.outputs:
            size, key = (GPA, f"{name}_GPa") if QUANTITIES[output][0] == "Pa" else (1.0, name)
            cuts[key] = CutsResult.of(np.stack(result.bounds(output), axis=1) / size)
    return cuts


def plane_cuts(result: Bounds) -> dict[str, dict[str, CutsResult]]:
    """α-cuts of the constants along x and y by definition, of those that a result has."""
    cuts = {
        definition: cuts_of(result, {name + suffix: name for name in NAMES})
        for definition, suffix in SUFFIXES.items()
    }
    return {definition: constants for definition, constants in cuts.items() if constants}


def loss_cuts(result: Bounds) -> dict[str, Array]:
    """α-cuts of the loss factors by the names of `CONSTANTS`, shape (levels, 2) each.

    They run from the least loss_lower[level][constant] of the samples to the greatest loss_upper.
    """
    cuts: dict[str, Array] = {name: np.empty((len(result.alpha), 2)) for name in CONSTANTS}
    for (constant, name), level in product(enumerate(CONSTANTS), range(len(result.alpha))):
        lower_column = result.column(f"loss_lower[{level}][{constant}]")
        upper_column = result.column(f"loss_upper[{level}][{constant}]")
        cuts[name][level] = result.lower[level, lower_column], result.upper[level, upper_column]
    return cuts


def largest(result: Bounds, kind: str) -> dict[str, float]:
    """Largest value over all samples of each output KIND:NAME, by NAME."""
    assert result.samples is not None
    values = result.samples.values
    return {
        name.partition(":")[2]: float(values.output(name).max())
        for name, _ in values.layout
        if name.startswith(f"{kind}:")
    }


def dataset(result: Bounds, theta: Array, losses: Mapping[str, Array]) -> xarray.Dataset:
    """Dataset in SI: α-cuts NAME, inputs NAME_at that reach them, and samples NAME_sample."""
    import xarray

    samples = result.samples
    assert samples is not None
    variables: dict[str, Any] = {}
    for name, (unit, about) in QUANTITIES.items():
        if name in result.outputs:
            attributes, column = {"units": unit, "long_name": about}, result.column(name)
            points = np.stack([result.lower_at[:, column], result.upper_at[:, column]], axis=1)
            about_points = {"long_name": f"inputs that reach the bounds of {name}, in SI"}
            variables[name] = (CUT, np.stack(result.bounds(name), axis=1), attributes)
            variables[f"{name}_at"] = ((*CUT, "parameter"), points, about_points)
            variables[f"{name}_sample"] = ("sample", samples.values.output(name), attributes)
    for name, cut in losses.items():
        variables[f"loss_{name}"] = (CUT, cut, {"long_name": f"loss factor of {name}"})
    about_points = {"long_name": "inputs, in SI"}
    variables["point"] = (("sample", "parameter"), samples.points, about_points)
    attributes = {"units": "Pa", "long_name": "homogenised stress 11 over θ"}
    variables["curve11"] = (("sample", "theta"), samples.values.output("curve11"), attributes)
    coordinates = {"theta": theta, "alpha": result.alpha}
    axes = {"bound": ["lower", "upper"], "parameter": list(result.inputs)}
    return xarray.Dataset(variables, coordinates | axes)


def require_levels(alpha: tuple[float, ...], key: str) -> None:
    """Refuses levels of a structure's modulus that neither go from 0 to 1 nor are 1 alone."""
    complete = alpha == (1.0,) or (alpha[0], alpha[-1]) == (0, 1)
    require(complete, key, value=list(alpha), allowed="levels from 0 to 1, or 1 alone")


def fuzzy_loss(data: xarray.Dataset) -> FuzzyNumber | None:
    """The fuzzy loss factor of E; None where the phases have none."""
    return _stepped(data, "loss_E") if "loss_E" in data else None


def fuzzy_modulus(data: xarray.Dataset) -> FuzzyNumber:
    """The fuzzy Young's modulus in Pa that α-cuts with levels from 0 to 1 make."""
    least = float(data["E"].min())
    require(least > 0, "modulus", value=f"{least / GPA:.3g} GPa", allowed="a modulus above 0")
    require_levels(tuple(map(float, data["alpha"].values)), "modulus.alpha")
    return _stepped(data, "E")


def _stepped(data: xarray.Dataset, name: str) -> FuzzyNumber:
    """Fuzzy number of stored α-cuts; between two levels the wider cut holds."""
    alpha, bounds = data["alpha"].values, data[name].transpose("alpha", "bound").values
    if tuple(alpha) == (1.0,):
        return Crisp(float(bounds.mean()))
    return outer_steps(alpha, bounds[:, 0], bounds[:, 1])
