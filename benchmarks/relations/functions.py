"""Random functions of fuzzy inputs, and the relations of their α-cuts."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import Executor, ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import nullcontext
from dataclasses import dataclass, replace
from functools import partial
from multiprocessing import get_context

import numpy as np
import xarray as xr

from alphacut.base.arrays import Array
from alphacut.fuzzy import Automatic, General, Knowledge, Signed, Triangular, propagate
from alphacut.fuzzy.plans.design import Plan
from benchmarks.relations.relation import (
    ONE_LEVEL,
    ONE_OUTPUT,
    ROUNDED,
    SHUFFLED,
    Chance,
    Kind,
    Problem,
    Relation,
)
from benchmarks.relations.stated import of_dataset, scaled

PLANS: dict[str, Plan | None] = {"none": None, "automatic": Automatic(), "general": General()}
PLANS["signed"] = Signed(outputs=("rising",))
EXECUTORS: dict[str, Callable[[], Executor]] = {
    "threads": partial(ThreadPoolExecutor, 3),
    "forked processes": partial(ProcessPoolExecutor, 2, get_context("fork")),
    "spawned processes": partial(ProcessPoolExecutor, 2, get_context("spawn")),
}


@dataclass(frozen=True)
class Waves:
    """A sum of sines, and an output that rises with every input.

    Args:
        numbers: Wave numbers of each input, shape (terms, n).
        phases: Shape (terms,).
        units: Units of the inputs by name, in which the function takes them.
        unit: Unit of the outputs.
    """

    numbers: Array
    phases: Array
    units: Mapping[str, float]
    unit: float = 1.0

    def __call__(self, **inputs: float) -> dict[str, float]:
        """Both outputs; inputs besides those of the waves change nothing."""
        x = np.array([inputs[name] / unit for name, unit in self.units.items()])
        waves = float(np.sin(self.numbers @ x + self.phases).sum())
        rising = float((np.exp(x) + np.abs(x - 0.3) + 2 * x).sum())
        return {"waves": waves * self.unit, "rising": rising * self.unit}


def problem(waves: Waves, fuzzy: Mapping[str, tuple[float, float, float]], plan: str) -> Problem:
    """α-cuts of a function by a plan of `PLANS`; inputs by name as (lower, nominal, upper)."""
    asked = {"alpha": (0.0, 0.5, 1.0), "outputs": ("waves", "rising"), "crisp": {}}
    return {"waves": waves, "fuzzy": fuzzy, "plan": plan, "executor": nullcontext, **asked}


def drawn(chance: Chance) -> Problem:
    """A function of one or two inputs with wave numbers up to 1.5, 4 or 12."""
    n, most = int(chance.integers(1, 3)), float(chance.choice([1.5, 4, 12]))
    ends = np.sort(chance.uniform(-1, 1, (n, 3)), axis=1)
    ends[:, 2] += 0.1
    fuzzy = {f"x{i + 1}": tuple(map(float, x)) for i, x in enumerate(ends)}
    numbers, phases = chance.uniform(-most, most, (3, n)), chance.uniform(0, 6, 3)
    waves = Waves(numbers, phases, dict.fromkeys(fuzzy, 1.0))
    return problem(waves, fuzzy, str(chance.choice([*PLANS])))


def stated(problem: Problem) -> xr.Dataset:
    """Statement in the base units."""
    waves, fuzzy = problem["waves"], problem["fuzzy"]
    inputs = {x: Triangular(*(waves.units[x] * end for end in ends)) for x, ends in fuzzy.items()}
    signs = {x: {"rising": 1} for x in fuzzy} if problem["plan"] == "signed" else {}
    with problem["executor"]() as pool:
        bounds = propagate(
            waves,
            {**problem["crisp"], **inputs},
            PLANS[problem["plan"]],
            alpha=problem["alpha"],
            knowledge=Knowledge(signs),
            executor=pool,
            progress=False,
        )
    of_outputs = of_dataset(bounds.to_dataset()).sel(output=[*problem["outputs"]])
    return scaled(of_outputs, dict.fromkeys(problem["outputs"], 1 / waves.unit))


def _in_units(problem: Problem, chance: Chance) -> Problem:
    waves = problem["waves"]
    *units, unit = (2.0 ** chance.integers(-20, 21, len(waves.units) + 1)).tolist()
    return {"waves": replace(waves, units=dict(zip(waves.units, units, strict=True)), unit=unit)}


KIND = Kind(
    drawn,
    stated,
    (
        *(SHUFFLED, ONE_LEVEL, ONE_OUTPUT),
        Relation("one more crisp input", lambda x, chance: {"crisp": {"crisp": 2.0}}),
        Relation("other units", _in_units, within=ROUNDED),
        *(
            Relation(name, lambda x, chance, pool=pool: {"executor": pool}, within=0.0)  # type: ignore[misc]
            for name, pool in EXECUTORS.items()
        ),
    ),
)
