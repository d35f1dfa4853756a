"""Campaign of a case: the cell as a function, its fuzzy inputs, the plan."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from alphacut.case.case import Case
from alphacut.fuzzy import Extended, FuzzyNumber, General, Known, Reduced, Signed
from alphacut.fuzzy.plans.method import Method as Plan
from alphacut.io.files import Document
from alphacut.io.provenance import source_digest, versions
from alphacut.stages.material import cell as of_cell
from alphacut.stages.material.cell_models import cell_model
from alphacut.stochastic import ThetaLaw
from alphacut.stochastic.radius_map import MapFamily
from alphacut.stochastic.theta.law import Array
from alphacut.stochastic.theta.quadrature import between_nodes

if TYPE_CHECKING:
    from alphacut.rve.result import Homogenised

SOURCES = ("space", "theta", "table")  # of error, see rve.result.Homogenised
JUDGED = ("prism", "auto")
SPANNED = ("prism",)  # methods whose samples share work over the particle's moduli
OF_CURVES = (
    1e-9  # relative tolerance on E with which the curve between the nodes is good to 1e-4 or so
)
OF_SPHERES = 1e-5
"""Relative tolerance on E of the series of spheres where none is asked for: near r = 0.97, where
maps of packed spheres end, the 1e-9 of a single cell takes seconds a sample."""
SHOWN = 61  # points of a stored stress curve


def theta_shown(law: ThetaLaw) -> Array:
    """The θ at which stress curves are stored, shape (SHOWN,)."""
    return np.linspace(law.lower, law.upper, SHOWN)


@dataclass(frozen=True)
class CellTask:
    """Task of the campaign: samples that share all but the inclusion's modulus.

    Args:
        choice: Model of the cell.
        crisp: Inputs that are not fuzzy, by name, in SI.
        family: Radius maps and the law of θ.
    """

    choice: of_cell.CellChoice
    crisp: Mapping[str, float]
    family: MapFamily

    def __call__(self, points: Sequence[Mapping[str, float]]) -> list[dict[str, float | Array]]:
        """Outputs of each point: E, nu, stresses, curves, systems, errors, certificate."""
        values = [{**self.crisp, **point} for point in points]
        radius, matrix, _ = of_cell.parts(values[0], self.family)
        inclusions = [of_cell.phases_of(value)[1] for value in values]
        results = cell_model(self.choice).solve(radius, matrix, inclusions)
        outputs: list[dict[str, float | Array]] = []
        for result in results:
            s11, s12 = result.curve.mean
            outputs.append(
                {
                    **{"E": result.modulus, "nu": result.poisson, "s11": s11, "s12": s12},
                    "systems": len(result.iterations),
                    "curve11": self.resampled(result.curve.theta, result.curve.s11),
                    "curve12": self.resampled(result.curve.theta, result.curve.s12),
                    **{f"error:{source}": result.error.get(source, 0.0) for source in SOURCES},
                    **{f"check:{name}": value for name, value in result.checks.items()},
                }
            )
        return outputs

    def judged(self, point: Mapping[str, float]) -> Homogenised | None:
        """A sample once more with its error estimate or the reason of auto."""
        if self.choice.method not in JUDGED:
            return None
        radius, matrix, inclusion = of_cell.parts({**self.crisp, **point}, self.family)
        model = cell_model(replace(self.choice, estimate=True))
        return model.solve(radius, matrix, [inclusion])[0]

    def resampled(self, nodes: Array, stress: Array) -> Array:
        """Stress curve at `SHOWN` points over θ, for pictures."""
        return between_nodes(nodes, stress, theta_shown(self.family.law))


SHOWN_OUTPUTS = ("E", "nu")
"""Outputs whose bounds are printed; curves and errors are read off at their samples."""


def plan_of(case: Case) -> Plan:
    """The plan that a case asks for."""
    plans: dict[str, Plan] = {
        "general": General(),
        "reduced": Reduced(),
        "extended": Extended(outputs=SHOWN_OUTPUTS),
        "signed": Signed(outputs=SHOWN_OUTPUTS),
    }
    return plans[case.modulus.plan]


def fuzzy_inputs(case: Case) -> dict[str, FuzzyNumber]:
    """The inputs of the cell that are fuzzy, by name, in SI."""
    numbers = of_cell.cell_inputs(case)
    found = {name: number for name, number in numbers.items() if number.support.width > 0}
    return found or {"inclusion_modulus": numbers["inclusion_modulus"]}


@dataclass(frozen=True)
class Campaign:
    """Campaign to be run: the cell's task, its fuzzy inputs, the plan.

    Args:
        task: The function, for any process.
        inputs: Fuzzy inputs by name, in SI.
        plan: How their boxes are searched.
        alpha: Levels, rising.
        shared: Inputs whose equality lets samples share a mesh and its assembly.
        known: What mechanics proves of the cell's response.
        store: File that keeps every sample; a campaign that was stopped goes on from there.
    """

    task: CellTask
    inputs: Mapping[str, FuzzyNumber]
    plan: Plan
    alpha: tuple[float, ...]
    shared: tuple[str, ...]
    known: Known
    store: Path | None = None

    @property
    def identity(self) -> Document | None:
        """Origin of a sample besides its fuzzy inputs; None without a store."""
        return identity(self.task) if self.store else None


def campaign(
    case: Case,
    *,
    petsc: Mapping[str, str] | None = None,
    store: Path | None = None,
) -> Campaign:
    """The campaign that a case asks for.

    Args:
        case: With the sections radius, cell, mesh and modulus.
        petsc: PETSc options that override the solver's.
        store: File that keeps every sample.
    """
    inputs = fuzzy_inputs(case)
    crisp = {
        name: value for name, value in of_cell.modal_values(case).items() if name not in inputs
    }
    support = case.cell.inclusion_modulus.cut(0.0)
    choice = of_cell.cell_choice(case, petsc=petsc)
    # no other method's samples depend on the range, and a wider one may take them as they are
    if choice.method in SPANNED and (support.width > 0 or choice.method != "prism"):
        choice = replace(choice, moduli=(support.lower, support.upper))
    if choice.tolerance is not None and choice.named:
        choice = replace(choice, estimate=True)  # so that every sample can be held to it
    if case.sections.response and choice.method == "auto":
        # a curve needs more nodes than its mean, and they cost little
        choice = replace(choice, tolerance=min(choice.tolerance or 1.0, OF_CURVES))
    if (choice.particles, choice.tolerance) == ("spheres", None):
        choice = replace(choice, tolerance=OF_SPHERES)
    task = CellTask(choice, crisp, case.radius.family)
    shared = tuple(name for name in inputs if name in of_cell.SHARED) or ("inclusion_modulus",)
    return Campaign(
        task, inputs, plan_of(case), case.modulus.alpha, shared, known(case, inputs), store
    )


def known(case: Case, inputs: Mapping[str, FuzzyNumber]) -> Known:
    """The signs of the inputs' effects on E, where mechanics proves them.

    Where both phases have the same Poisson's ratio ν >= 0, more stiff material can only stiffen: A
    and B of eq. 16 rise, and with them E = 3A/2 − A²/(2B); of spheres the bulk modulus and both
    averages of the shear modulus, and with them E of Hill's average. The radius rises with a1, a2,
    a3 and falls with a4, since h1, h2, h3 >= 0 >= h4 (eq. 12); under maps without slopes it rises
    with a1 and a3 as well. The law of θ has no part in it. Nothing is stated for finite elements
    on the product space, whose error depends on the mesh that moves with the radius.
    """
    cell = case.cell
    matrix, inclusion = cell.matrix_modulus.support, cell.inclusion_modulus.support
    poisson = {cell.matrix_poisson.support, cell.inclusion_poisson.support}
    stiffer, softer = inclusion.lower >= matrix.upper, inclusion.upper <= matrix.lower
    one = next(iter(poisson))
    unlike = len(poisson) > 1 or one.width or one.lower < 0
    if case.modulus.method == "prism" or unlike or not (stiffer or softer):
        return Known()
    way = 1 if stiffer else -1
    signs = {"a1": way, "a2": way, "a3": way, "a4": -way}
    signs |= {"matrix_modulus": 1, "inclusion_modulus": 1}
    of_inputs = {name: {"E": sign} for name, sign in signs.items() if name in inputs}
    return Known(signs=of_inputs, source="as mechanics proves of exact cells")


def identity(task: CellTask) -> Document:
    """Origin of a sample besides its fuzzy inputs: model, resolution, program."""
    source = source_digest(("stochastic", "rve"))
    content = {
        "choice": asdict(task.choice),
        "crisp": dict(task.crisp),
        "map": task.family.kind,
        "law": repr(task.family.law),
        "source": source,
        "versions": versions(),
    }
    # tuples become lists, as they are when read again
    found: dict[str, Any] = json.loads(json.dumps(content))
    return found
