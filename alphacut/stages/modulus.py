"""Stage modulus: the fuzzy modulus of a round cell, by samples arranged into α-cuts."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from alphacut.fuzzy import Crisp, Extended, FuzzyNumber, General, Known, Reduced, Signed, propagate
from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.campaign.values import Samples
from alphacut.fuzzy.plans.method import Method as Plan
from alphacut.fuzzy.refused import RefusedError
from alphacut.fuzzy.result import Bounds as Cuts
from alphacut.fuzzy.sets.stepwise import outer_steps
from alphacut.io.files import Document
from alphacut.io.netcdf import read_dataset
from alphacut.io.provenance import source_digest, versions
from alphacut.rve.fibre_constants import fibre_constants
from alphacut.rve.result import Homogenised
from alphacut.stages.cell import GPA, CellChoice, inputs_of, parts
from alphacut.stages.store import Stage, Work
from alphacut.stochastic import ThetaLaw
from alphacut.stochastic.theta.quadrature import between_nodes

if TYPE_CHECKING:
    import xarray

    from alphacut.case.material import Mesh, ModulusSection, RadiusMap, RoundCell

SHOWN = 61
"""Points over θ of a stored stress curve."""
OF_CURVES = 1e-9
"""Relative tolerance on E with which a curve between its nodes is good to 1e-4 or so."""
SOURCES = ("space", "theta")
"""Sources of error, see rve.result.Homogenised."""
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
CURVES = {"s11": "curve11", "s12": "curve12"}
"""Variables with the stress over θ of each mean stress."""


@dataclass(frozen=True)
class CellTask:
    """Samples of the cell that share all but the inclusion's modulus.

    Args:
        choice: Model of the cell.
        crisp: Inputs that are not fuzzy, by name, in SI.
        law: Law of θ.
    """

    choice: CellChoice
    crisp: Mapping[str, float]
    law: ThetaLaw

    def __call__(self, points: Sequence[Mapping[str, float]]) -> list[dict[str, float | Array]]:
        """Outputs of each point: E, nu, stresses, curves, systems, errors, certificate."""
        stiffness = self.choice.stiffness
        every = [parts({**self.crisp, **point}, self.law, stiffness) for point in points]
        radius, matrix, _ = every[0]
        results = self.choice.model().solve(radius, matrix, [inclusion for *_, inclusion in every])
        return [
            {
                **{"E": result.modulus, "nu": result.poisson},
                **dict(zip(("s11", "s12"), result.curve.mean, strict=True)),
                **self._fibres(result),
                "systems": len(result.iterations),
                "curve11": self._shown(result.curve.theta, result.curve.s11),
                "curve12": self._shown(result.curve.theta, result.curve.s12),
                **{f"error:{source}": result.error.get(source, 0.0) for source in SOURCES},
                **{f"check:{name}": value for name, value in result.checks.items()},
            }
            for result in results
        ]

    def _fibres(self, result: Homogenised) -> dict[str, float]:
        if not self.has_fibres:
            return {}
        values = fibre_constants(result).values
        return {name: values[name] for name in FIBRES}

    @property
    def has_fibres(self) -> bool:
        """True for particles that are round fibres of an isotropic material."""
        return self.choice.square and self.choice.particles == "cylinders"

    def _shown(self, nodes: Array, stress: Array) -> Array:
        return between_nodes(nodes, stress, self.theta)

    @property
    def theta(self) -> Array:
        """The θ at which stress curves are stored, shape (SHOWN,)."""
        return np.asarray(np.linspace(self.law.lower, self.law.upper, SHOWN))

    @property
    def identity(self) -> Document:
        """Origin of a sample besides its fuzzy inputs: model, resolution, program."""
        content = {
            "choice": asdict(self.choice),
            "crisp": dict(self.crisp),
            "law": repr(self.law),
            "source": source_digest(("stochastic", "rve")),
            "versions": versions(),
        }
        read: Document = json.loads(json.dumps(content))  # tuples become lists
        return read


@dataclass(frozen=True)
class Campaign:
    """Samples to be run.

    Args:
        task: The function, for any process.
        inputs: Fuzzy inputs by name, in SI.
        plan: Search of their boxes.
        alpha: Levels, rising.
        known: Signs that mechanics proves of the cell's response.
    """

    task: CellTask
    inputs: Mapping[str, FuzzyNumber]
    plan: Plan
    alpha: tuple[float, ...]
    known: Known

    def run(self, work: Work) -> xarray.Dataset:
        """The α-cuts with all samples; a store beside them goes on after an interruption."""
        store = None if work.folder is None else work.folder / "samples.db"
        if store is not None and work.fresh:
            for old in store.parent.glob("samples.db*"):
                old.unlink()
        self.task.choice.model()  # one refusal, not one for each sample
        result = propagate(
            self.task,
            self.inputs,
            self.plan,
            alpha=self.alpha,
            shared=tuple(x for x in self.inputs if x != "inclusion_modulus") or tuple(self.inputs),
            workers=work.workers,
            progress=work.tick or False,
            known=self.known,
            store=store,
            identity=self.task.identity if store else None,
        )
        return dataset(result, self.task, self._judged(result))

    def _judged(self, result: Cuts) -> dict[str, float]:
        """Relative error of E by source: the largest of all samples, or that of the modal one."""
        largest = _largest(result, "error")
        if largest or self.task.choice.method != "prism":
            return largest
        modal = {name: number.modal for name, number in self.inputs.items()}
        values, choice = {**self.task.crisp, **modal}, self.task.choice
        radius, matrix, inclusion = parts(values, self.task.law, choice.stiffness)
        model = replace(choice, estimate=True).model()
        return dict(model.solve(radius, matrix, [inclusion])[0].error)


def campaign(
    radius: RadiusMap,
    cell: RoundCell,
    mesh: Mesh,
    modulus: ModulusSection,
    *,
    petsc: Mapping[str, str] | None = None,
    curves: bool = False,
) -> Campaign:
    """The samples that the sections of a case ask for.

    Args:
        radius: Random radius.
        cell: Phases.
        mesh: Resolution of elements.
        modulus: Method, plan, levels.
        petsc: PETSc options.
        curves: Whether the curve over θ is needed between its nodes.
    """
    numbers = inputs_of(radius, cell)
    fuzzy = {name: number for name, number in numbers.items() if number.support.width > 0}
    material = "inclusion_modulus" if cell.stiffness is None else "matrix_modulus"
    fuzzy = fuzzy or {material: numbers[material]}
    crisp = {name: number.modal for name, number in numbers.items() if name not in fuzzy}
    choice = CellChoice.of(cell, mesh, modulus, petsc or {})
    if choice.method == "prism" and cell.stiffness is None:
        support = numbers["inclusion_modulus"].support
        choice = replace(choice, moduli=(support.lower, support.upper))
    if curves and choice.method in ("auto", "series"):
        choice = replace(choice, tolerance=min(choice.tolerance or 1.0, OF_CURVES))
    task = CellTask(choice, crisp, radius.law)
    known = _known(cell, fuzzy) if modulus.method != "prism" else Known()
    return Campaign(task, fuzzy, plan_of(modulus.plan), modulus.alpha, known)


def plan_of(name: str) -> Plan:
    """The plan of a name."""
    outputs = ("E", "nu")
    plans: dict[str, Plan] = {
        "general": General(),
        "reduced": Reduced(),
        "extended": Extended(outputs=outputs),
        "signed": Signed(outputs=outputs),
    }
    return plans[name]


def _known(cell: RoundCell, inputs: Mapping[str, FuzzyNumber]) -> Known:
    """Signs of the inputs' effects on E, where mechanics proves them.

    Where both phases have the same Poisson's ratio ν >= 0, more stiff material can only stiffen: A
    and B of eq. 16 rise, and with them E = 3A/2 − A²/(2B); of spheres the bulk modulus and both
    averages of the shear modulus. The radius rises with a1, a2, a3 and falls with a4, since h1, h2,
    h3 >= 0 >= h4 (eq. 12).
    """
    if not cell.square:
        return Known()
    of = {name: number.support for name, number in cell.phases.items()}
    matrix, inclusion = of["matrix_modulus"], of["inclusion_modulus"]
    poisson = {of["matrix_poisson"], of["inclusion_poisson"]}
    stiffer, softer = inclusion.lower >= matrix.upper, inclusion.upper <= matrix.lower
    one = next(iter(poisson))
    if len(poisson) > 1 or one.width or one.lower < 0 or not (stiffer or softer):
        return Known()
    way = 1 if stiffer else -1
    signs = {"a1": way, "a2": way, "a3": way, "a4": -way}
    signs |= {"matrix_modulus": 1, "inclusion_modulus": 1}
    of_inputs = {name: {"E": sign} for name, sign in signs.items() if name in inputs}
    return Known(signs=of_inputs, source="as mechanics proves of exact cells")


def stage(campaign: Campaign) -> Stage:
    """The stage of a round cell's samples."""
    inputs = [campaign.task.identity, campaign.inputs, repr(campaign.plan), campaign.alpha]
    return Stage("modulus", inputs, ("stochastic", "rve", "fuzzy"), campaign.run)


def dataset(result: Cuts, task: CellTask, error: Mapping[str, float]) -> xarray.Dataset:
    """α-cuts of every quantity (alpha, bound), where reached, and all samples."""
    import xarray

    variables: dict[str, Any] = {}
    fibres = FIBRES if task.has_fibres else {}
    for name, (unit, about) in (BOUNDS | fibres).items():
        variables |= _cuts(result, name, {"units": unit, "long_name": about})
    variables["point"] = (
        ("sample", "parameter"),
        _samples(result).points,
        {"long_name": "inputs, in SI"},
    )
    for name in CURVES.values():
        words = {"units": "Pa", "long_name": f"homogenised stress {name[-2:]} over θ"}
        variables[name] = (("sample", "theta"), _samples(result).values.output(name), words)
    checks = _largest(result, "check")
    for kind, values in (("error", error), ("check", checks)):
        words = {"long_name": f"largest {kind} of all samples"}
        variables[kind] = ((f"{kind}_name",), list(values.values()), words)
    coordinates = {
        "error_name": list(error),
        "check_name": list(checks),
        "theta": task.theta,
        "alpha": result.alpha,
        "bound": ["lower", "upper"],
        "parameter": list(result.inputs),
    }
    return xarray.Dataset(variables, coordinates, _facts(result, task))


def _samples(result: Cuts) -> Samples:
    """All samples of the cell."""
    assert result.samples is not None
    return result.samples


def _facts(result: Cuts, task: CellTask) -> dict[str, Any]:
    return {
        "method": task.choice.method,
        "plan": result.method,
        "samples": result.evaluations,
        "solves": int(_samples(result).values.output("systems").sum()),
        "seconds": result.seconds,
        "nature": str(result.nature_of("E")),
        "particles": task.choice.particles,
        "average": task.choice.meaning,
    }


def _cuts(result: Cuts, name: str, words: Mapping[str, str]) -> dict[str, Any]:
    """Variables of one quantity: its cuts, the inputs that reach them, and its samples."""
    column = result.column(name)
    places = np.stack([result.lower_at[:, column], result.upper_at[:, column]], axis=1)
    reached = {"long_name": f"inputs that reach the ends of {name}, in SI"}
    return {
        name: (("alpha", "bound"), np.stack(result.bounds(name), axis=1), words),
        f"{name}_at": (("alpha", "bound", "parameter"), places, reached),
        f"{name}_sample": (("sample",), _samples(result).values.output(name), words),
    }


def _largest(result: Cuts, kind: str) -> dict[str, float]:
    """Largest of each error or property of the certificate over all samples."""
    values = _samples(result).values
    largest = {
        name.partition(":")[2]: float(values.output(name).max())
        for name, _ in values.layout
        if name.startswith(f"{kind}:")
    }
    return {name: value for name, value in largest.items() if value or kind == "check"}


def listed(dataset: xarray.Dataset, kind: str) -> dict[str, float]:
    """Named numbers of a dataset, such as errors by source."""
    if kind not in dataset:
        return {}
    names = map(str, dataset[f"{kind}_name"].values)
    return dict(zip(names, map(float, dataset[kind].values), strict=True))


def document(dataset: xarray.Dataset) -> Document:
    """α-cuts in GPa, their ends, nature, errors and cost."""
    ends = dataset["E"].transpose("alpha", "bound").values / GPA
    poisson = dataset["nu"].transpose("alpha", "bound").values
    names = ("samples", "solves", "seconds", "method", "plan", "nature", "particles", "average")
    return {
        "alpha": dataset["alpha"].values,
        "E_GPa": {"lower": ends[:, 0], "upper": ends[:, 1]},
        "modal_GPa": ends[-1].mean(),
        "lower_GPa": ends[0, 0],
        "upper_GPa": ends[0, 1],
        "nu": poisson[-1].mean(),
        "nu_cuts": {"lower": poisson[:, 0], "upper": poisson[:, 1]},
        "fibres": fibres(dataset),
        **{name: dataset.attrs[name] for name in names},
        "error": listed(dataset, "error"),
        "checks": listed(dataset, "check"),
    }


def fibres(dataset: xarray.Dataset) -> Document:
    """α-cuts of the constants of fibres, moduli in GPa; none of spheres."""
    cuts = {}
    for name, (unit, _) in FIBRES.items():
        if name in dataset:
            ends = dataset[name].transpose("alpha", "bound").values / (GPA if unit == "Pa" else 1)
            key = f"{name}_GPa" if unit == "Pa" else name
            cuts[key] = {"lower": ends[:, 0], "upper": ends[:, 1]}
    return cuts


def number_of(dataset: xarray.Dataset, key: str = "modulus") -> FuzzyNumber:
    """The fuzzy modulus in Pa; between two levels the wider cut holds.

    Raises:
        RefusedError: It is not positive, or lacks the levels 0 and 1.
    """
    alpha, ends = dataset["alpha"].values, dataset["E"].transpose("alpha", "bound").values
    if not float(ends.min()) > 0:
        raise RefusedError(key, f"{ends.min() / GPA:.3g} GPa", "a modulus above 0")
    if tuple(alpha) == (1.0,):
        return Crisp(float(ends.mean()))
    if (alpha[0], alpha[-1]) != (0, 1):
        raise RefusedError(key, f"{alpha.tolist()}", "levels from 0 to 1, or 1 alone")
    return outer_steps(alpha, ends[:, 0], ends[:, 1])


def read_number(path: Path | str, option: str = "--modulus") -> FuzzyNumber:
    """The fuzzy modulus in Pa from a file of this program.

    Raises:
        RefusedError: The file holds none.
    """
    data = read_dataset(Path(path), key=option)
    if not {"E", "alpha"} <= {*map(str, data.variables)}:
        raise RefusedError(option, str(path), "a modulus.nc of this program")
    return number_of(data, option)
