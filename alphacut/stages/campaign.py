"""Stage modulus: samples of a cell, arranged into α-cuts of its constants."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial

import numpy as np

from alphacut.base.arrays import Array, on_one_blas_thread
from alphacut.base.errors import FailedError
from alphacut.case.material import MeshedCell
from alphacut.fuzzy import FuzzyNumber, General, Knowledge, Reduced, Signed, propagate
from alphacut.fuzzy.plans.design import Plan
from alphacut.fuzzy.result import Bounds, Nature
from alphacut.io.files import Document
from alphacut.io.provenance import file_digest, source_digest, versions
from alphacut.rve.result.result import HomogenisedStiffness
from alphacut.rve.series.fibre_constants import fibre_constants
from alphacut.rve.series.model import SeriesModel
from alphacut.stages.cell import GPA, SPHERE_TOLERANCE, CellProblem, Solve, require_isotropic
from alphacut.stages.modulus import (
    FIBRES,
    LossResult,
    ModulusResult,
    cuts_of,
    largest_over_samples,
    loss_bounds,
    loss_cuts,
    modulus_dataset,
    phase_loss_cuts,
    plane_cuts,
    plane_outputs,
)
from alphacut.stages.store import Stage, StageContext, StageResult
from alphacut.stochastic.theta.quadrature import between_nodes

TEST_TOLERANCE_FACTOR = 100.0
"""Multiple of the tolerance at which guaranteed cuts are tested."""
MAX_TEST_SIZE = 0.7
"""Largest elements that they are tested with, over half the cell's side."""
CURVE_POINTS = 61
"""Points over θ of a stored stress curve."""
OUTPUTS = ("E", "nu")
PLANS: dict[str, Plan] = {
    "general": General(),
    "reduced": Reduced(),
    "signed": Signed(outputs=OUTPUTS),
}


@on_one_blas_thread
def sample_outputs(
    model: Solve,
    problem: CellProblem,
    crisp: Mapping[str, float],
    losses: Array | None,
    points: Sequence[Mapping[str, float]],
) -> list[dict[str, float | Array]]:
    """Outputs of the cell by name, in SI, at points of the fuzzy inputs; `crisp` has the others.

    The stress curve has shape (CURVE_POINTS,), bounds of the loss factors (levels, 3).
    """
    outputs = []
    for result in model([problem.at({**crisp, **point}) for point in points]):
        require_isotropic(result)
        curve = result.curve
        fibres = fibre_constants(result).values if problem.cell.is_fibre else {}
        sample: dict[str, float | Array] = {
            "E": result.modulus,
            "nu": result.poisson,
            **dict(zip(("s11", "s12"), curve.mean, strict=True)),
            **{name: fibres[name] for name in FIBRES if name in fibres},
            **plane_outputs(result),
            "systems": len(result.iterations),
            "curve11": between_nodes(curve.theta, curve.s11, curve_theta(problem)),
            **{f"error:{name}": result.error.get(name, 0.0) for name in ("space", "theta")},
            **{f"check:{name}": value for name, value in result.checks.items()},
        }
        if losses is not None:
            bounds, errors = loss_bounds(result, losses)
            sample |= {"loss_lower": bounds[:, 0], "loss_upper": bounds[:, 1]}
            sample["loss_error"] = np.nan_to_num(errors)
        outputs.append(sample)
    return outputs


def curve_theta(problem: CellProblem) -> Array:
    """The θ at which stress curves are stored, shape (CURVE_POINTS,)."""
    return np.asarray(np.linspace(*problem.radius.theta, CURVE_POINTS))


@dataclass(frozen=True)
class CellCampaign(CellProblem):
    """Samples that the sections of a case ask for, by a solver with PETSc's options."""

    petsc: Mapping[str, str] = field(default_factory=dict)

    @cached_property
    def inputs(self) -> dict[str, FuzzyNumber]:
        """Fuzzy inputs by name, in SI; one crisp modulus where none is fuzzy."""
        numbers = self.numbers
        fuzzy = {name: number for name, number in numbers.items() if number.support.width > 0}
        names = ("inclusion_modulus", "matrix_modulus", *numbers)
        return fuzzy or next({name: numbers[name]} for name in names if name in numbers)

    def campaign_model(self, *, estimate: bool = False) -> Solve:
        """The function that solves cells; with `estimate`, prisms declare errors at extra cost."""
        modulus = self.cell.constants.get("inclusion_modulus")
        support = None if modulus is None else tuple(modulus.support)
        return self.model(estimate=estimate, modulus_range=support, petsc=self.petsc)

    @cached_property
    def nominal_estimate(self) -> HomogenisedStiffness:
        """The cell at the nominal values of its inputs, with declared errors."""
        return self.campaign_model(estimate=True)([self.nominal])[0]

    @property
    def identity(self) -> Document:
        """All but the fuzzy inputs that the outputs of a sample depend on: the key of its store."""
        return {
            "modulus": self.modulus.model_dump(exclude={"plan", "alpha"}),
            "mesh": self.mesh.model_dump(exclude={"file"}),
            "mesh_file": self.mesh.file and file_digest(self.mesh.file),
            "petsc": dict(self.petsc),
            "particles": self.cell.particles,
            "inputs": {name: repr(x) for name, x in self.numbers.items()},
            "theta": self.radius.theta,
            "stiffness": repr(self.cell.model_dump(include={"inclusion_modulus", "phases"})),
            "losses": repr((self.cell.losses, self.modulus.alpha)) if self.cell.losses else "",
            "source": source_digest(("stochastic", "rve")),
            "versions": versions(),
        }

    @property
    def propagation(self) -> Callable[..., Bounds]:
        """The function from fuzzy inputs and a plan to the α-cuts of all outputs."""
        shared = tuple(x for x in self.inputs if x != "inclusion_modulus") or tuple(self.inputs)
        return partial(propagate, self.task, alpha=self.modulus.alpha, shared=shared)

    @property
    def task(self) -> Callable[[Sequence[Mapping[str, float]]], list[dict[str, float | Array]]]:
        """The function from points of the fuzzy inputs to all outputs."""
        crisp = {name: x.nominal for name, x in self.numbers.items() if name not in self.inputs}
        problem = CellProblem(self.radius, self.cell, self.mesh, self.modulus)
        return partial(sample_outputs, self.campaign_model(), problem, crisp, self.losses)

    def run(self, context: StageContext) -> StageResult[ModulusResult]:
        """Computes all samples and the α-cuts; stored samples of an interrupted run are taken."""
        result = self.propagation(
            self.inputs,
            PLANS[self.modulus.plan],
            workers=context.workers,
            progress=context.tick,
            knowledge=self.knowledge,
            store=context.samples,
            identity=self.identity if context.samples else None,
        )
        self.require_consistent(result)
        assert result.samples is not None
        losses, loss = dict[str, Array](), None
        if self.losses is not None:
            losses = loss_cuts(result)
            loss = LossResult.of(losses, self.loss_errors(result), Nature.ATTAINED)
        is_own_mesh = isinstance(self.cell, MeshedCell) and not self.mesh.refine  # no error
        numbers = ModulusResult(
            alpha=result.alpha,
            E_GPa=cuts_of(result, {"E": "E"})["E_GPa"],
            nu_cuts=cuts_of(result, {"nu": "nu"})["nu"],
            fibres=cuts_of(result, {name: name for name in FIBRES}),
            plane=plane_cuts(result),
            method=self.modulus.method,
            plan=result.method,
            samples=result.evaluations,
            solves=int(result.samples.values.output("systems").sum()),
            seconds=result.seconds,
            nature=Nature.ATTAINED if is_own_mesh else result.nature_of("E"),
            particles=self.cell.particles,
            average=self.average_name,
            error=self.errors(result),
            checks=largest_over_samples(result, "check"),
            references=self.references(),
            loss=loss,
        )
        return StageResult(numbers, modulus_dataset(result, curve_theta(self), losses))

    def require_consistent(self, result: Bounds) -> None:
        """Requires that a coarser model agrees with guaranteed cuts of E at points inside them.

        The points are the middles of the narrowest and of the widest cut of the inputs. The
        tolerance is `TEST_TOLERANCE_FACTOR` times as large, elements are twice as large.
        """
        if result.nature_of("E") is not Nature.GUARANTEED:
            return
        modulus, size = self.modulus, min(2 * self.mesh.size, MAX_TEST_SIZE)
        default = SPHERE_TOLERANCE if self.cell.particles == "spheres" else SeriesModel.accuracy
        tolerance = TEST_TOLERANCE_FACTOR * (modulus.tolerance or default)
        coarse_campaign = replace(
            self,
            mesh=self.mesh.model_copy(update={"size": size}),
            modulus=modulus.model_copy(update={"tolerance": tolerance}),
        )
        cuts, error = np.stack(result.bounds("E"), 1), sum(self.errors(result).values())
        levels = result.alpha[[-1, 0]]
        inputs = result.inputs.items()
        points = [{name: float(np.mean(x.cut(alpha))) for name, x in inputs} for alpha in levels]
        for alpha, sample in zip(levels, coarse_campaign.task(points), strict=True):
            value = float(np.asarray(sample["E"]))
            slack = value * (error + sample["error:space"] + sample["error:theta"])
            for low, high in cuts[result.alpha <= alpha]:
                if not low - slack <= value <= high + slack:
                    what = f"E of a cell inside a cut is {value / GPA:.9g} GPa, the cut"
                    what += f" {low / GPA:.9g} … {high / GPA:.9g} GPa"
                    raise FailedError(f"the proof is wrong: {what}", "keep the case and report it")

    @property
    def losses(self) -> Array | None:
        """Cuts of the phases' loss factors; None where the case has none."""
        if not self.cell.losses:
            return None
        return phase_loss_cuts(self.cell.losses, self.modulus.alpha)

    @property
    def knowledge(self) -> Knowledge:
        """Signs of the inputs' effects on E, where mechanics proves them; else none.

        If both phases have one crisp Poisson's ratio ν ≥ 0 and one phase is the stiffer for all
        values, more of it can only stiffen the cell: A = 2 C33 and B = C11 + C12 of fibres rise
        (the paper's eq. 16), and with them E = 3A/2 − A²/(2B); of spheres the bulk modulus and both
        averages of the shear modulus. The radius Σ a_i h_i(θ) rises with a1, a2 and a3, h_i ≥ 0,
        and falls with a4, h4 ≤ 0 (the paper's eq. 12).
        """
        if not self.cell.has_series or self.modulus.method == "prism":
            return Knowledge()
        supports = {name: number.support for name, number in self.cell.constants.items()}
        matrix, inclusion = supports["matrix_modulus"], supports["inclusion_modulus"]
        poisson = supports["matrix_poisson"]
        is_stiffer, is_softer = inclusion.lower >= matrix.upper, inclusion.upper <= matrix.lower
        is_same = poisson == supports["inclusion_poisson"] and not poisson.width
        if not is_same or poisson.lower < 0 or not (is_stiffer or is_softer):
            return Knowledge()
        effect = 1 if is_stiffer else -1  # of more inclusion on E
        signs = {"a1": effect, "a2": effect, "a3": effect, "a4": -effect, "fraction": effect}
        signs |= {"matrix_modulus": 1, "inclusion_modulus": 1}
        of_inputs = {name: {"E": sign} for name, sign in signs.items() if name in self.inputs}
        return Knowledge(signs=of_inputs, source="as mechanics proves of exact cells", tests=2)

    def loss_errors(self, result: Bounds) -> Array | None:
        """Largest errors of the loss factors of E, G and K; of prisms those of the nominal cell."""
        assert self.losses is not None
        assert result.samples is not None
        if isinstance(self.cell, MeshedCell):
            return None
        if self.modulus.method == "prism":
            return loss_bounds(self.nominal_estimate, self.losses)[1]
        return np.asarray(result.samples.values.output("loss_error").max(axis=0))

    def errors(self, result: Bounds) -> dict[str, float]:
        """Relative error of E by source: the largest of all samples, or that of the nominal one."""
        errors = {x: e for x, e in largest_over_samples(result, "error").items() if e}
        if errors or self.modulus.method != "prism" or isinstance(self.cell, MeshedCell):
            return errors
        return dict(self.nominal_estimate.error)


def stage(campaign: CellCampaign) -> Stage[ModulusResult]:
    """The stage that computes the α-cuts of a cell by samples."""
    plan, alpha = campaign.modulus.plan, campaign.modulus.alpha
    inputs = [campaign.identity, campaign.inputs, campaign.stated_fraction, plan, alpha]
    packages, run = ("stochastic", "rve", "fuzzy"), campaign.run
    return Stage("modulus", inputs, packages, ModulusResult, run, has_samples=True)
