"""The fuzzy constants of a cell and their loss factors: as numbers, a dataset and inputs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import require
from alphacut.fuzzy import Crisp, FuzzyNumber
from alphacut.fuzzy.result import Bounds, Nature
from alphacut.fuzzy.sets.numbers import outer_steps
from alphacut.rve.result.engineering_constants import (
    FREE,
    NAMES,
    PLANE_STRAIN,
    engineering_constants,
)
from alphacut.rve.result.loss_factors import CONSTANTS, MAX_FIRST_ORDER, loss_factors
from alphacut.rve.result.result import HomogenisedStiffness
from alphacut.stages.cell import GPA, References, key_and_unit
from alphacut.stages.store import CutsResult, Numbers, Values

if TYPE_CHECKING:
    import xarray

SUFFIXES = {PLANE_STRAIN: "", FREE: "_free"}
"""What is added to the name of a constant along x and y as an output, by definition."""
FIBRES = ("E_T", "E_L", "nu_LT", "G_T", "G_L")
"""Constants of cylinders across (T) and along (L) the fibres; see rve.fibre_constants."""
PLANE = tuple(name + suffix for suffix in SUFFIXES.values() for name in NAMES)
"""Constants along x and y as outputs, by both definitions."""
QUANTITIES = ("E", "nu", "s11", "s12", *FIBRES, *PLANE)
"""Outputs that have α-cuts; s11 and s12 are mean stresses under strains of 0.01."""
CUT = ("alpha", "bound")


class LossResult(Numbers):
    """α-cuts of the loss factors of E, G and K; their errors by name, where they are declared."""

    E: CutsResult
    G: CutsResult
    K: CutsResult
    error: dict[str, float]
    nature: Nature

    @classmethod
    def of(cls, cuts: Mapping[str, Array], errors: Array | None, nature: Nature) -> LossResult:
        """The result of cuts (levels, 2) by the names of `CONSTANTS`, and of their errors (3,)."""
        named = {name: CutsResult.of(cuts[name]) for name in CONSTANTS}
        by_name = {} if errors is None else dict(zip(CONSTANTS, map(float, errors), strict=True))
        return cls(**named, error=by_name, nature=nature)


class ModulusResult(Numbers):
    """α-cuts of a cell, moduli in GPa; nature and relative errors of E, references and cost.

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


def constant_cuts(name: str, bounds: Array) -> tuple[str, CutsResult]:
    """Key and cuts of a constant, moduli in GPa, from bounds (levels, 2) in SI."""
    key, unit = key_and_unit(name)
    return key, CutsResult.of(bounds / unit)


def cuts_of(result: Bounds, names: Mapping[str, str]) -> dict[str, CutsResult]:
    """α-cuts of those outputs that a result has, moduli in GPa by NAME_GPa.

    `names` has the name of each constant by that of its output.
    """
    return dict(
        constant_cuts(name, np.stack(result.bounds(output), axis=1))
        for output, name in names.items()
        if output in result.outputs
    )


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
        lower = result.bounds(f"loss_lower[{level}][{constant}]").lower[level]
        cuts[name][level] = lower, result.bounds(f"loss_upper[{level}][{constant}]").upper[level]
    return cuts


def largest_over_samples(result: Bounds, kind: str) -> dict[str, float]:
    """Largest value over all samples of each output KIND:NAME, by NAME."""
    assert result.samples is not None
    values = result.samples.values
    return {
        name.partition(":")[2]: float(values.output(name).max())
        for name, _ in values.layout
        if name.startswith(f"{kind}:")
    }


def modulus_dataset(result: Bounds, theta: Array, losses: Mapping[str, Array]) -> xarray.Dataset:
    """Dataset in SI: α-cuts NAME, inputs NAME_at that reach them, and samples NAME_sample.

    `point` has the inputs of the samples, `curve11` their stresses 11 over θ.
    """
    import xarray

    samples = result.samples
    assert samples is not None
    variables: dict[str, Any] = {}
    for name in (name for name in QUANTITIES if name in result.outputs):
        units, column = {"units": "1" if name.startswith("nu") else "Pa"}, result.column(name)
        points = np.stack([result.lower_at[:, column], result.upper_at[:, column]], axis=1)
        variables[name] = (CUT, np.stack(result.bounds(name), axis=1), units)
        variables[f"{name}_at"] = ((*CUT, "parameter"), points)
        variables[f"{name}_sample"] = ("sample", samples.values.output(name), units)
    variables |= {f"loss_{name}": (CUT, cut) for name, cut in losses.items()}
    variables["point"] = (("sample", "parameter"), samples.points)
    curves = samples.values.output("curve11")
    variables["curve11"] = (("sample", "theta"), curves, {"units": "Pa"})
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
    minimum = float(data["E"].min())
    require(minimum > 0, "modulus", value=f"{minimum / GPA:.3g} GPa", allowed="a modulus above 0")
    require_levels(tuple(map(float, data["alpha"].values)), "modulus.alpha")
    return _stepped(data, "E")


def _stepped(data: xarray.Dataset, name: str) -> FuzzyNumber:
    """Fuzzy number of α-cuts in a dataset; between two levels the wider cut holds."""
    alpha, bounds = data["alpha"].values, data[name].transpose("alpha", "bound").values
    if tuple(alpha) == (1.0,):
        return Crisp(float(bounds.mean()))
    return outer_steps(alpha, bounds[:, 0], bounds[:, 1])


def phase_loss_cuts(losses: Sequence[FuzzyNumber], alpha: Sequence[float]) -> Array:
    """Cuts of the loss factor of each phase on some levels, shape (levels, 2, phases)."""
    return np.array([np.transpose([loss.cut(level) for loss in losses]) for level in alpha])


def loss_corners(cuts: Array, fractions: Array) -> Array:
    """Phases' loss factors where those of E, G and K are least and greatest, to first order.

    `cuts` are those of each phase, (levels, 2, phases), the same of its K and G; `fractions` are
    ∂ln c/∂ln X by X = K and G of each phase, (phases, 2, 3). Shape (levels, 2, 3, phases, 2).
    """
    slopes = fractions.sum(axis=1).T  # (constants, phases)
    lower, upper = np.moveaxis(cuts[:, :, None], 1, 0)
    minima, maxima = np.where(slopes >= 0, lower, upper), np.where(slopes >= 0, upper, lower)
    corners = np.stack([minima, maxima], axis=1)
    return np.stack([corners, corners], axis=-1)


def loss_bounds(result: HomogenisedStiffness, cuts: Array) -> tuple[Array, Array]:
    """Bounds of the loss factors of E, G and K, (levels, 2, 3), and their largest errors, (3,).

    `cuts` are those of `phase_loss_cuts`.
    """
    assert result.energies is not None
    fractions, _ = result.energies.energy_fractions(result.constants_of)
    corners = loss_corners(cuts, fractions)
    errors = [loss_factors(result, corners[0, 1, k]).errors[x] for k, x in enumerate(CONSTANTS)]
    if corners.max() <= MAX_FIRST_ORDER:  # level l, end e, constant c, phase p, K or G x
        return np.einsum("lecpx,pxc->lec", corners, fractions), np.array(errors)
    bounds = np.empty(corners.shape[:3])
    for corner in product(*map(range, bounds.shape)):
        bounds[corner] = loss_factors(result, corners[corner]).values[CONSTANTS[corner[-1]]]
    return bounds, np.array(errors)
