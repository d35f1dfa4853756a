"""Fuzzy modulus of a case: samples of the cell rearranged into α-cuts, or measured values."""

from __future__ import annotations

import math
import re
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from alphacut.case.case import WHOLE, Case
from alphacut.fuzzy import Crisp, FuzzyNumber, from_data, propagate
from alphacut.fuzzy.result import Bounds
from alphacut.fuzzy.samples.model import Samples
from alphacut.fuzzy.sets.stepwise import outer_steps
from alphacut.io.csv_rows import CsvFile
from alphacut.io.files import Document
from alphacut.io.netcdf import read_dataset, write_dataset
from alphacut.io.problem import BadInput
from alphacut.io.progress import Tick
from alphacut.io.provenance import attributes, versions
from alphacut.stages.material.campaign import Campaign, theta_shown
from alphacut.stages.material.cell import GPA, POSITIVE, CellChoice, anisotropy, parts
from alphacut.stages.material.cell_models import cell_model
from alphacut.stochastic import ThetaLaw, TruncatedNormal

if TYPE_CHECKING:
    import xarray

    from alphacut.rve.result import Homogenised


QUANTITIES = {"E": ("Pa", "effective Young's modulus"), "nu": ("1", "effective Poisson's ratio")}
STRESSES = {
    "s11": ("Pa", "mean homogenised stress 11 under ε11 = ε22 = 0.01"),
    "s12": ("Pa", "mean homogenised stress 12 under ε12 = 0.01"),
}
BOUNDS = QUANTITIES | STRESSES
CURVES = {
    "s11": ("curve11", "stress 11 under ε11 = ε22 = 0.01"),
    "s12": ("curve12", "stress 12 under ε12 = 0.01"),
}
"""Variables with the stress over θ of each mean stress, and their words."""
AVERAGE = {
    "cylinders": "eq. 16",
    "isotropic": "the isotropic average of the plane stiffness",
    "spheres": "Hill's isotropic average",
}
"""What E and ν mean, see `CellChoice.meaning`."""


@dataclass(frozen=True)
class FuzzyModulus:
    """The campaign's result for one case.

    Args:
        result: Bounds of every output over the levels, with all samples.
        choice: Model of the cell that was used.
        law: Law of θ.
        judged: The modal sample once more, with its estimated error and auto's reason; None for
            models that give both with every sample.
        shear_ratio: Anisotropy of the modal cell, see `rve.anisotropy`; None where it could not be
            had.
    """

    result: Bounds
    choice: CellChoice
    law: ThetaLaw = field(default_factory=TruncatedNormal)
    judged: Homogenised | None = None
    shear_ratio: tuple[float, float] | None = None

    @property
    def number(self) -> FuzzyNumber:
        """The fuzzy modulus in Pa, to be handed on."""
        return self.result.number("E")

    @property
    def nature(self) -> str:
        """Nature of the bounds of E."""
        return str(self.result.nature_of("E"))

    @property
    def samples(self) -> Samples:
        """All samples of the cell."""
        assert self.result.samples is not None
        return self.result.samples

    @property
    def meaning(self) -> str:
        """Sentence on the worth of E's bounds, with what a proof rests on."""
        given = " and ".join(self.result.basis)
        proved = f"proved, given that {given}"
        return proved if self.nature == "guaranteed" else "values of samples"

    @property
    def reason(self) -> str:
        """Choice of method auto at the modal point, with its reason; else empty."""
        return self.judged.reason if self.judged and self.choice.method == "auto" else ""

    @property
    def error(self) -> dict[str, float]:
        """Estimated relative error of E by source, of all samples or the modal one."""
        return self.largest("error") or (dict(self.judged.error) if self.judged else {})

    @property
    def worth(self) -> str:
        """Line on the worth of E's bounds, and the model's error beside them."""
        parts = ", ".join(f"{name} {value:.1e}" for name, value in self.error.items())
        one = self.judged and not self.largest("error")
        whose = "modal sample" if one else "largest of all samples"
        told = f"estimated at {sum(self.error.values()):.1e} of E ({parts}; {whose})"
        base = self.result.nature_of("nu")
        nu = "" if self.nature == str(base) else f"; bounds of nu are {base}"
        return (
            f"bounds {self.nature}: {self.meaning}{nu}; the error of the cell's model"
            f" comes on top, {told if parts else 'not estimated'}"
        )

    @property
    def solves(self) -> int:
        """Linear systems solved; those that samples are projected on count once."""
        systems = self.samples.values.output("systems")
        if self.choice.method != "prism" or self.choice.moduli is None:
            return int(systems.sum())
        columns = [k for k, name in enumerate(self.result.inputs) if name != "inclusion_modulus"]
        _, first = np.unique(self.samples.points[:, columns], axis=0, return_index=True)
        return int(systems[first].sum())

    def largest(self, kind: str) -> dict[str, float]:
        """Largest of each error or property of the certificate over all samples."""
        values = self.samples.values
        found = {
            name.partition(":")[2]: float(values.output(name).max())
            for name, _ in values.layout
            if name.startswith(f"{kind}:")
        }
        return {name: value for name, value in found.items() if value or kind == "check"}

    def document(self) -> Document:
        """The result as it is printed with ``--json``; moduli and stresses in GPa."""
        found = {name: self.result.bounds(name) for name in BOUNDS}
        scaled = {
            ("nu" if name == "nu" else f"{name}_GPa"): (1.0 if name == "nu" else GPA, ends)
            for name, ends in found.items()
        }
        return {
            "alpha": self.result.alpha,
            **{
                name: {"lower": lower / unit, "upper": upper / unit}
                for name, (unit, (lower, upper)) in scaled.items()
            },
            "samples": self.result.evaluations,
            "solves": self.solves,
            "calls": self.result.calls,
            "reused": self.result.reused,
            "seconds": self.result.seconds,
            "nature": self.nature,
            "notes": list(self.result.notes),
            "plan": self.result.method,
            "method": self.choice.method,
            "particles": self.choice.particles,
            "average": self.choice.meaning,
            "reason": self.reason,
            "error": self.error,
            "shear_ratio": self.shear_ratio and self.shear_ratio[0],
            "shear_ratio_error": self.shear_ratio and self.shear_ratio[1],
            "checks": self.largest("check"),
            "versions": versions(),
        }

    def dataset(self) -> xarray.Dataset:
        """α-cuts of every quantity (alpha, bound), where reached, and all samples."""
        import xarray

        result, checks = self.result, self.largest("check")
        variables: dict[str, Any] = {}
        for name, (unit, about) in BOUNDS.items():
            average = f", {AVERAGE[self.choice.meaning]}" if name in QUANTITIES else ""
            variables |= self._cuts(name, unit, about + average)
        point = {"long_name": "inputs of each sample, in SI"}
        variables["point"] = (("sample", "parameter"), self.samples.points, point)
        variables |= self._curves()
        for kind, largest in (("error", self.error), ("check", checks)):
            words = {"long_name": f"largest {kind} of all samples"}
            variables[kind] = ((f"{kind}_name",), list(largest.values()), words)
        coordinates = {
            "error_name": list(self.error),
            "check_name": list(checks),
            "theta": theta_shown(self.law),
            "alpha": result.alpha,
            "bound": ["lower", "upper"],
            "parameter": list(result.inputs),
        }
        return xarray.Dataset(variables, coordinates, self._facts())

    def _cuts(self, name: str, unit: str, about: str) -> dict[str, Any]:
        """Variables of one quantity: its cuts, the inputs that reach them, and its samples."""
        result = self.result
        column = result.column(name)
        places = np.stack([result.lower_at[:, column], result.upper_at[:, column]], axis=1)
        words = {"units": unit, "long_name": about}
        reached = {"long_name": f"inputs that reach the ends of {name}, in SI"}
        return {
            name: (("alpha", "bound"), np.stack(result.bounds(name), axis=1), words),
            f"{name}_at": (("alpha", "bound", "parameter"), places, reached),
            f"{name}_sample": (("sample",), self.samples.values.output(name), words),
        }

    def _curves(self) -> dict[str, Any]:
        """Stress over θ of every sample."""
        return {
            name: (
                ("sample", "theta"),
                self.samples.values.output(name),
                {"units": "Pa", "long_name": f"homogenised {about}"},
            )
            for name, about in CURVES.values()
        }

    def _facts(self) -> dict[str, Any]:
        """Attributes of the dataset."""
        facts: dict[str, Any] = {
            "method": self.choice.method,
            "reason": self.reason,
            "plan": self.result.method,
            "samples": self.result.evaluations,
            "solves": self.solves,
            "seconds": self.result.seconds,
            "nature": self.nature,
            "particles": self.choice.particles,
            "average": self.choice.meaning,
        }
        if self.shear_ratio is not None:
            names = ("shear_ratio", "shear_ratio_error")
            facts |= dict(zip(names, self.shear_ratio, strict=True))
        return facts


def compute(wanted: Campaign, *, workers: int = 1, progress: Tick | None = None) -> FuzzyModulus:
    """Run a campaign.

    Args:
        wanted: What is to be run.
        workers: Processes; the result is the same for any number. Under ``mpirun … -m
            mpi4py.futures`` all of those are used.
        progress: Told the share done.
    """
    # a model that cannot be had is one problem, not one for each sample
    cell_model(wanted.task.choice)
    result = propagate(
        wanted.task,
        wanted.inputs,
        wanted.plan,
        alpha=wanted.alpha,
        shared=wanted.shared,
        workers=workers,
        progress=progress or False,
        known=wanted.known,
        store=wanted.store,
        identity=wanted.identity,
    )
    modal = {name: number.modal for name, number in wanted.inputs.items()}
    cell = parts({**wanted.task.crisp, **modal}, wanted.task.family)
    choice, law = wanted.task.choice, wanted.task.family.law
    ratio = anisotropy(*cell, choice.particles)
    return FuzzyModulus(result, choice, law, wanted.task.judged(modal), ratio)


def write(modulus: FuzzyModulus, path: Path | str, *, case_text: str, key: str) -> None:
    """Write ``modulus.nc``, whole or not at all.

    Args:
        modulus: What to write.
        path: The file.
        case_text: The case it is of.
        key: Fingerprint of what it depends on.
    """
    write_dataset(modulus.dataset(), path, attributes(case_text, key))


def listed(dataset: xarray.Dataset, kind: str) -> dict[str, float]:
    """Named numbers of a dataset, such as errors by source."""
    if kind not in dataset:
        return {}
    return {
        str(name): float(value)
        for name, value in zip(dataset[f"{kind}_name"].values, dataset[kind].values, strict=True)
    }


def read_number(path: Path | str, option: str = "--modulus") -> FuzzyNumber:
    """The fuzzy modulus in Pa from a file that `write` made.

    Between two levels the wider cut holds, since nothing is known of E there.

    Raises:
        BadInput: The file is missing, holds no positive modulus or not all of it, or was written by
            a newer program.
    """
    dataset = read_dataset(Path(path), key=option)
    try:
        alpha, ends = dataset["alpha"].values, dataset["E"].transpose("alpha", "bound").values
    except (ValueError, KeyError) as error:
        raise BadInput.of(
            option,
            f"the file holds no α-cuts of a modulus ({error})",
            str(path),
            "a modulus.nc of this program",
        ) from None
    if not (low := float(ends.min())) > 0:
        what = f"{Path(path).name} holds an E down to {low / GPA:.3g} GPa"
        raise BadInput.of(option, what, allowed=f"an E that is positive throughout: {POSITIVE}")
    if tuple(alpha) == (1.0,):
        return Crisp(float(ends.mean()))
    if (alpha[0], alpha[-1]) != (0, 1):
        raise BadInput.of(
            option, "the file's levels leave cuts of E out", f"{alpha.tolist()}", WHOLE
        )
    return outer_steps(alpha, ends[:, 0], ends[:, 1])


def stand_in(case: Case) -> FuzzyNumber | None:
    """Modulus in Pa that the case gives; None if it gives none."""
    given = case.sections.modulus
    if given is None or given.value is not None:
        return given.value if given else None
    if given.file is not None:
        return read_number(case.beside(given.file), "modulus.file")
    return None if given.measured is None else measured_modulus(case, given.measured)


HEADER = "E [GPa]"
NAMES = r"E|E_?c?m?|E_?mod(ul(us)?)?|(young'?s?[\s_-]*)?modul(us|i)|elastic[\s_-]modulus"


def measured_modulus(case: Case, file: str) -> FuzzyNumber:
    """The fuzzy modulus in Pa that a CSV file's values decide as claimed; BadInput if not."""
    key, wanted = "modulus.measured", case.modulus
    values = measured_values(case.beside(file), key)
    bounds = None if wanted.bounds is None else wanted.bounds.support
    try:
        number = from_data(values, wanted.claim, bounds=bounds, law=wanted.law)
        number.cut(0.0)
    except ValueError as error:
        allowed = 'bounds such as bounds = "[10, 60] GPa"'
        raise case.refuse(key, in_gpa(str(error)), allowed) from None
    given = tuple(in_gpa(condition) for condition in number.claim.conditions)
    return replace(number, claim=replace(number.claim, conditions=given))


def in_gpa(told: str) -> str:
    """A text of the library with its moduli, of 1e6 Pa and more, in GPa."""
    return re.sub(r"\d[\d.]*e\+\d+", lambda found: f"{float(found[0]) / GPA:g} GPa", told)


def measured_values(path: Path, key: str = "modulus.measured") -> list[float]:
    """Measured moduli in Pa; BadInput without unit or where a row is no positive number."""
    file = CsvFile(path, key, "file", HEADER)
    (line, first), *rows = file.rows()
    scale = file.scale(line, ",".join(first), "a modulus", "Pa", pattern=NAMES)
    return [scale * positive(file, line, ",".join(row)) for line, row in rows]


def positive(file: CsvFile, line: int, text: str) -> float:
    """One value of the column."""
    with suppress(ValueError):
        if 0 < (value := float(text)) < math.inf:
            return value
    cure = text.replace(",", ".") if re.fullmatch(r"\s*\d+,\d+\s*", text) else ""
    allowed = f"a decimal point, {cure.strip()}" if cure else "a number such as 30.5"
    raise file.refuse(line, "this row is no positive number", text, allowed)
