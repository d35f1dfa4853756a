"""Stage modulus: the fuzzy constants of a cell and their loss factors, as numbers and a dataset.

A sample is solved by `rve/fuzzy_cell.py` (`CellSamples`), which asks a model of the cell; of prisms
that is `rve/prism/model.py`, whose samples of one map share two solutions (`modulus_basis.py`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Unpack

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import require
from alphacut.base.kept_files import file_digest
from alphacut.fuzzy import FuzzyNumber, General, Reduced, Signed
from alphacut.fuzzy.plans.design import Plan
from alphacut.fuzzy.propagation import CampaignOptions
from alphacut.fuzzy.result import Ends, Nature
from alphacut.fuzzy.sets.numbers import fuzzy_number
from alphacut.io.files import Document
from alphacut.io.provenance import source_digest, versions
from alphacut.rve.fuzzy_cell import (
    FIBRES,
    SUFFIXES,
    FuzzyStiffness,
    LossCuts,
    fuzzy_stiffness,
)
from alphacut.rve.guaranteed_cuts import with_guaranteed_cuts
from alphacut.rve.result.engineering_constants import NAMES
from alphacut.rve.result.moduli import ISOTROPIC
from alphacut.stages.cell import (
    AVERAGES,
    GPA,
    CellProblem,
    References,
    key_and_unit,
    require_levels,
)
from alphacut.stages.store import Stage, StageContext, StageResult

if TYPE_CHECKING:
    import xarray

OUTPUTS = ("E", "nu")
PLANS: dict[str, Plan] = {
    "general": General(),
    "reduced": Reduced(),
    "signed": Signed(outputs=OUTPUTS),
}


@dataclass(frozen=True, eq=False, kw_only=True)
class ModulusResult:
    """α-cuts of the constants of a cell, moduli in GPa.

    Args:
        alpha: Levels, shape (A,).
        E_GPa: α-cuts of Young's modulus.
        nu_cuts: α-cuts of Poisson's ratio.
        fibres: Constants across and along cylinders by name, as E_T_GPa.
        plane: Constants along x and y by definition and name.
        method: Model as the case names it.
        solver: How finite elements are assembled and solved; empty without them.
        plan: Plan of the samples.
        samples: Number of samples.
        solves: Number of linear systems.
        seconds: Time that they took.
        nature: Guarantee of the bounds of E.
        particles: Particles as the case has them.
        average: Average of the stiffness that gives E and ν.
        error: Relative error of E by source, the largest of all samples.
        checks: Largest violation of each property that right results have.
        references: Particle fraction and Hashin–Shtrikman bounds.
        loss: α-cuts of the loss factors, if phases have some.
    """

    alpha: Array
    E_GPa: Ends
    nu_cuts: Ends
    fibres: dict[str, Ends]
    plane: dict[str, dict[str, Ends]]
    method: str
    solver: str
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
    loss: LossCuts | None


def in_units_of_results(constants: Mapping[str, Array]) -> dict[str, Ends]:
    """Return the α-cuts of elastic constants in the units and by the keys of results.

    Args:
        constants: Lower and upper bounds in SI units by the name of the constant, such as "E_x" or
            "nu_xy", shape (levels, 2) each.

    Returns:
        The cuts: of moduli in GPa by NAME_GPa, and of Poisson's ratios by their own names.
    """
    cuts: dict[str, Ends] = {}
    for name, bounds in constants.items():
        key, unit = key_and_unit(name)
        cuts[key] = Ends(*(bounds / unit).T)
    return cuts


def infinite_if_unknown(cuts: Ends) -> Ends:
    """Return α-cuts with infinite ends where there is no bound; files have null there."""
    lower = np.where(np.isnan(cuts.lower), -np.inf, cuts.lower)
    return Ends(lower, np.where(np.isnan(cuts.upper), np.inf, cuts.upper))


def modulus_result(problem: CellProblem, stiffness: FuzzyStiffness) -> ModulusResult:
    """Return the numbers of a fuzzy stiffness in the units of results: moduli in GPa.

    Args:
        problem: The cell, for its references and the words of its method.
        stiffness: α-cuts of its constants in SI units.

    Returns:
        `plane` has the constants along the axes by name, for each of their definitions: "plane
        strain" and "no stress along the fibres". A definition without constants is left out.
        `fibres` has the constants across and along fibres, empty if they are not known. `error` is
        the largest relative error of E of all samples, by source.
    """
    # Results have moduli in GPa, while the dataset beside them has SI units. The names of constants
    # without stress along the fibres end in a suffix.
    bounds = stiffness.bounds
    known = {name: stiffness.cuts(name) for name in stiffness.constants}
    plane: dict[str, dict[str, Ends]] = {}
    for definition, suffix in SUFFIXES.items():
        along_axes = {name: known[name + suffix] for name in NAMES if name + suffix in known}
        # Constants that the model of the cell does not give are left out, not shown as unknown.
        if along_axes:
            plane[definition] = in_units_of_results(along_axes)
    return ModulusResult(
        alpha=bounds.alpha,
        E_GPa=Ends(*(known["E"] / GPA).T),
        nu_cuts=Ends(*known["nu"].T),
        fibres=in_units_of_results({name: known[name] for name in FIBRES if name in known}),
        plane=plane,
        method=problem.modulus.method,
        solver=problem.model().solver_text,
        plan=bounds.method,
        samples=bounds.evaluations,
        solves=stiffness.systems,
        seconds=bounds.seconds,
        nature=stiffness.guarantee,
        particles=problem.cell.particles,
        average=AVERAGES[problem.average] if problem.average else "spheres",
        error=dict(stiffness.error),
        checks=dict(stiffness.checks),
        references=problem.references(),
        loss=stiffness.losses,
    )


def solved(
    problem: CellProblem,
    plan: Plan | None = None,
    *,
    inputs: Mapping[str, FuzzyNumber] | None = None,
    alpha: Sequence[float] | None = None,
    **campaign: Unpack[CampaignOptions],
) -> FuzzyStiffness:
    """Return the fuzzy stiffness of a cell by a campaign of samples.

    Args:
        problem: The cell.
        plan: Plan of the samples; None for that of the case.
        inputs: Fuzzy inputs by name, in SI units; None for those of the case. Loss factors are
            added.
        alpha: α-levels; None for those of the case.
        campaign: Options of the campaign: `workers`, `progress`, and the `store` of samples with
            the `identity` that they belong to.

    Raises:
        CampaignError: Samples failed. The others are kept if there is a store.
        RefusedError: The model cannot solve the cell, or a library is missing.
    """
    # Loss factors are fuzzy inputs as well, but no coordinates of samples: each sample bounds the
    # loss of the cell over their α-cuts.
    losses = dict(zip(problem.cell.loss_names, problem.cell.losses, strict=True))
    return fuzzy_stiffness(
        problem.model(),
        problem.nominal_radius,
        problem.nominal_phases,
        {**(inputs or problem.inputs), **losses},
        plan or PLANS[problem.modulus.plan],
        alpha=alpha or problem.modulus.alpha,
        average=problem.average,
        **campaign,
    )


def identity(problem: CellProblem) -> Document:
    """Return what all samples of a campaign have in common: the key of their store.

    A stored sample is taken if this document and its own inputs are equal. Plan and α-levels are
    left out, so that a campaign with other ones finds the samples that both share. All parameters
    of the case are in it, since crisp ones are no inputs of a sample.

    Args:
        problem: The cell.

    Raises:
        OSError: The mesh file of the cell cannot be read.
    """
    cell = problem.cell
    modulus = problem.modulus
    return {
        "modulus": modulus.model_dump(exclude={"plan", "alpha"}),
        "mesh": problem.mesh.model_dump(exclude={"file"}),
        "mesh_file": problem.mesh.file and file_digest(problem.mesh.file),
        "petsc": dict(problem.petsc),
        "particles": cell.particles,
        "lattice": repr(getattr(cell, "lattice", None)),
        "inputs": {name: repr(x) for name, x in problem.numbers.items()},
        "theta": repr(getattr(problem.nominal_radius, "distribution", problem.nominal_radius)),
        "stiffness": repr(cell.model_dump(include={"inclusion_modulus", "phases"})),
        # With losses each sample has bounds of the loss factors on all levels.
        "losses": repr((cell.losses, modulus.alpha)) if cell.losses else "",
        # Other source or libraries may give other digits: their samples are not mixed.
        "source": source_digest(("stochastic", "rve")),
        "versions": versions(),
    }


def compute(problem: CellProblem, context: StageContext) -> StageResult[ModulusResult]:
    """Compute all samples and the α-cuts of the constants.

    Args:
        problem: The cell.
        context: Number of processes, progress, and the store `samples`, from which samples of an
            interrupted run are taken and to which new ones are added; None to store none.

    Raises:
        CampaignError: Samples failed. The others are kept if there is a store.
        FailedError: The mesh is too coarse for a lower bound, of a case with `mesh.bounds`.
    """
    stiffness = solved(
        problem,
        workers=context.workers,
        progress=context.tick,
        store=context.samples,
        identity=identity(problem) if context.samples else None,
    )
    if problem.mesh.bounds:
        bounds = problem.mesh_bounds([float(level) for level in stiffness.bounds.alpha])
        stiffness = with_guaranteed_cuts(stiffness, bounds, problem.average or ISOTROPIC)
    return StageResult(modulus_result(problem, stiffness), stiffness.to_dataset())


def stage(problem: CellProblem) -> Stage[ModulusResult]:
    """Return the stage that computes the α-cuts of a cell's constants by samples.

    It stores its samples, and its result is kept under the name "modulus". The result is up to date
    while the cell, its fuzzy inputs, the plan, the levels, and the source of the models are the
    same.

    Args:
        problem: The cell.

    Raises:
        OSError: The mesh file of the cell cannot be read.
    """
    plan = problem.modulus.plan
    alpha = problem.modulus.alpha
    inputs = [identity(problem), problem.inputs, problem.stated_fraction, plan, alpha]
    packages = ("stochastic", "rve", "fuzzy")
    run = partial(compute, problem)
    return Stage("modulus", inputs, packages, ModulusResult, run, has_samples=True)


def fuzzy_loss(data: xarray.Dataset) -> FuzzyNumber | None:
    """Return the fuzzy loss factor of E; None where the phases have none."""
    if "loss_E" not in data:
        return None
    return _number(data, "loss_E")


def fuzzy_modulus(data: xarray.Dataset) -> FuzzyNumber:
    """Return the fuzzy Young's modulus in Pa that the α-cuts in a dataset make.

    Args:
        data: Dataset with "E" over the axes alpha and bound (lower, upper), in Pa.

    Raises:
        RefusedError: It is not positive, or its levels neither go from 0 to 1 nor are 1 alone.
    """
    # Samples of an image with pores may have a lower bound of 0, which no structure can have.
    minimum = float(data["E"].min())
    require(minimum > 0, "modulus", value=f"{minimum / GPA:.3g} GPa", allowed="a modulus above 0")
    require_levels(tuple(map(float, data["alpha"].values)), "modulus.alpha")
    return _number(data, "E")


def _number(data: xarray.Dataset, name: str) -> FuzzyNumber:
    cuts = np.asarray(data[name].transpose("alpha", "bound").values)
    return fuzzy_number(data["alpha"].values, cuts)
