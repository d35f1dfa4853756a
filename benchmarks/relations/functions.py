"""Random functions of fuzzy inputs, and the relations of their α-cuts."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import Executor, ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from multiprocessing import get_context
from typing import Self

import numpy as np

from alphacut.fuzzy import Automatic, General, Knowledge, Signed, Triangular, propagate
from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.plans.design import Plan
from benchmarks.relations.relation import ROUNDED, Chance, Relation
from benchmarks.relations.stated import Stated

PLANS: dict[str, Plan | None] = {"none": None, "automatic": Automatic(), "general": General()}
PLANS["signed"] = Signed(outputs=("rising",))


@dataclass(frozen=True)
class Waves:
    """Two outputs: a sum of sines, and one that rises with every input.

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
        inputs: Lower end, modal value and upper end by name, in the base units.
        plan: Name in `PLANS`.
        alpha: Levels.
        outputs: Outputs looked at.
        crisp: Value of one more input; None for none.
        executor: Makes the executor; None where this process does everything.
    """

    waves: Waves
    inputs: Mapping[str, tuple[float, float, float]]
    plan: str
    alpha: tuple[float, ...] = (0.0, 0.5, 1.0)
    outputs: tuple[str, ...] = ("waves", "rising")
    crisp: float | None = None
    executor: Callable[[], Executor] | None = field(default=None, repr=False)

    @classmethod
    def drawn(cls, chance: Chance) -> Self:
        """A function of one or two inputs with wave numbers up to 1.5, 4 or 12."""
        n, most = int(chance.integers(1, 3)), float(chance.choice([1.5, 4, 12]))
        ends = np.sort(chance.uniform(-1, 1, (n, 3)), axis=1)
        ends[:, 2] += 0.1
        inputs = {f"x{i + 1}": tuple(map(float, row)) for i, row in enumerate(ends)}
        numbers, phases = chance.uniform(-most, most, (3, n)), chance.uniform(0, 6, 3)
        waves = Waves(numbers, phases, dict.fromkeys(inputs, 1.0))
        return cls(waves, inputs, str(chance.choice([*PLANS])))  # type: ignore[arg-type]

    def stated(self) -> Stated:
        """Statements in the base unit."""
        numbers = {
            name: Triangular(*(x * self.waves.units[name] for x in ends))
            for name, ends in self.inputs.items()
        }
        signs = {name: {"rising": 1} for name in numbers}
        more = {} if self.crisp is None else {"crisp": self.crisp}
        knowledge = Knowledge(signs) if self.plan == "signed" else Knowledge()
        given = {"alpha": self.alpha, "knowledge": knowledge, "progress": False}
        inputs, plan = {**more, **numbers}, PLANS[self.plan]
        if self.executor is None:
            result = propagate(self.waves, inputs, plan, **given)  # type: ignore[arg-type]
        else:
            with self.executor() as pool:
                result = propagate(self.waves, inputs, plan, executor=pool, **given)  # type: ignore[arg-type]
        stated = Stated.of_bounds(result).data.sel(output=[*self.outputs])
        return Stated(stated).scaled(dict.fromkeys(self.outputs, 1 / self.waves.unit))


def _shuffled(of: Propagation, chance: Chance) -> Propagation:
    order = chance.permutation([*of.inputs])
    return replace(of, inputs={str(name): of.inputs[str(name)] for name in order})


def _in_units(of: Propagation, chance: Chance) -> Propagation:
    powers = chance.integers(-20, 21, len(of.inputs) + 1)
    *units, unit = (float(2.0**power) for power in powers)
    waves = replace(of.waves, units=dict(zip(of.waves.units, units, strict=True)), unit=unit)
    return replace(of, waves=waves)


def _forked() -> Executor:
    return ProcessPoolExecutor(2, get_context("fork"))


def _spawned() -> Executor:
    return ProcessPoolExecutor(2, get_context("spawn"))


def _threads() -> Executor:
    return ThreadPoolExecutor(3)


def _run_by(executor: Callable[[], Executor]) -> Callable[[Propagation, Chance], Propagation]:
    return lambda of, chance: replace(of, executor=executor)


RELATIONS = (
    Relation("inputs in another order", _shuffled),
    Relation("one level", lambda x, chance: replace(x, alpha=(float(chance.choice(x.alpha)),))),
    Relation("one output", lambda x, chance: replace(x, outputs=x.outputs[:1])),
    Relation("one more crisp input", lambda x, chance: replace(x, crisp=2.0)),
    Relation("other units", _in_units, within=ROUNDED),
    Relation("threads", _run_by(_threads), within=0.0),
    Relation("forked processes", _run_by(_forked), within=0.0),
    Relation("spawned processes", _run_by(_spawned), within=0.0),
)
