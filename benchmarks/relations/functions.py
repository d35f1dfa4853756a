"""Random functions of fuzzy inputs, and the relations of their α-cuts."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import Executor, ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from functools import partial
from multiprocessing import get_context
from typing import Any, Self

import numpy as np

from alphacut.fuzzy import Automatic, General, Knowledge, Signed, Triangular, propagate
from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.plans.design import Plan
from benchmarks.relations.relation import ROUNDED, Chance, Relation, one_level, shuffled
from benchmarks.relations.stated import Stated

PLANS: dict[str, Plan | None] = {"none": None, "automatic": Automatic(), "general": General()}
PLANS["signed"] = Signed(outputs=("rising",))


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


@dataclass(frozen=True, eq=False)
class Propagation:
    """A function with fuzzy inputs, and how its α-cuts are asked for.

    Args:
        waves: The function.
        fuzzy: Lower end, modal value and upper end of inputs by name, in the base units.
        plan: Name in `PLANS`.
        alpha: Levels.
        outputs: Outputs looked at.
        crisp: Crisp inputs besides.
        executor: Makes the executor; None where this process does everything.
    """

    waves: Waves
    fuzzy: Mapping[str, tuple[float, float, float]]
    plan: str
    alpha: tuple[float, ...] = (0.0, 0.5, 1.0)
    outputs: tuple[str, ...] = ("waves", "rising")
    crisp: Mapping[str, float] = field(default_factory=dict)
    executor: Callable[[], Executor] | None = field(default=None, repr=False)

    @classmethod
    def drawn(cls, chance: Chance) -> Self:
        """A function of one or two inputs with wave numbers up to 1.5, 4 or 12."""
        n, most = int(chance.integers(1, 3)), float(chance.choice([1.5, 4, 12]))
        ends = np.sort(chance.uniform(-1, 1, (n, 3)), axis=1)
        ends[:, 2] += 0.1
        inputs: dict[str, Any] = {f"x{i + 1}": tuple(map(float, x)) for i, x in enumerate(ends)}
        numbers, phases = chance.uniform(-most, most, (3, n)), chance.uniform(0, 6, 3)
        waves = Waves(numbers, phases, dict.fromkeys(inputs, 1.0))
        return cls(waves, inputs, str(chance.choice([*PLANS])))

    def stated(self) -> Stated:
        """Statements in the base unit."""
        units, signs = self.waves.units, {name: {"rising": 1} for name in self.fuzzy}
        inputs = {
            name: Triangular(*(x * units[name] for x in ends)) for name, ends in self.fuzzy.items()
        }
        with self.executor() if self.executor else nullcontext() as pool:
            result = propagate(
                self.waves,
                {**self.crisp, **inputs},
                PLANS[self.plan],
                alpha=self.alpha,
                knowledge=Knowledge(signs if self.plan == "signed" else {}),
                executor=pool,
                progress=False,
            )
        stated = Stated(Stated.of_bounds(result).data.sel(output=[*self.outputs]))
        return stated.scaled(dict.fromkeys(self.outputs, 1 / self.waves.unit))


def _in_units(subject: Propagation, chance: Chance) -> Propagation:
    *units, unit = (2.0 ** chance.integers(-20, 21, len(subject.fuzzy) + 1)).tolist()
    named = dict(zip(subject.waves.units, units, strict=True))
    return replace(subject, waves=replace(subject.waves, units=named, unit=unit))


EXECUTORS: dict[str, Callable[[], Executor]] = {
    "threads": partial(ThreadPoolExecutor, 3),
    "forked processes": partial(ProcessPoolExecutor, 2, get_context("fork")),
    "spawned processes": partial(ProcessPoolExecutor, 2, get_context("spawn")),
}
RELATIONS = (
    Relation("inputs in another order", shuffled),
    Relation("one level", one_level),
    Relation("one output", lambda x, chance: replace(x, outputs=x.outputs[:1])),
    Relation("one more crisp input", lambda x, chance: replace(x, crisp={"crisp": 2.0})),
    Relation("other units", _in_units, within=ROUNDED),
    *(
        Relation(name, lambda x, chance, pool=pool: replace(x, executor=pool), within=0.0)  # type: ignore[misc]
        for name, pool in EXECUTORS.items()
    ),
)
