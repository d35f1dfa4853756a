"""Cheapest tolerances for which limits provably hold, where a tolerance t costs c / t.

Of all shapes of a box of tolerances the safe scale is proved; the shape is changed until the cost
of the scaled box falls no further. What is given back is proved safe, that it is the cheapest is
as good as the search.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from alphacut.fuzzy.decisions.limits import Limits, safe_scale
from alphacut.fuzzy.sets.numbers import Array


@dataclass(frozen=True)
class Cheapest:
    """Safe tolerances by what they cost.

    Args:
        tolerances: ± of each input, proved safe together.
        cost: Σ c / t over the inputs.
        unsafe: Least factor on all of them at which a limit is known to break.
        judged: Shapes of boxes whose safe scale was proved.
    """

    tolerances: Mapping[str, float]
    cost: float
    unsafe: float
    judged: int


def cheapest_tolerances(
    function: Callable[..., object],
    nominal: Mapping[str, float],
    costs: Mapping[str, float],
    limits: Limits,
    *,
    most: float = 1e3,
    tolerance: float = 1e-9,
) -> Cheapest:
    """The box of tolerances for which limits provably hold and Σ c / t is least.

    Args:
        function: Written in arithmetic and numpy's functions, as for `safe_scale`.
        nominal: Nominal value of every input, not 0: shapes begin with equal relative tolerances.
        costs: c of each input that has a tolerance; others are exact.
        limits: Limit by output.
        most: Largest relative tolerance that is asked for.
        tolerance: Precision of each proved scale, as a share of the one of equal relative ones.

    Raises:
        ValueError: A cost is not positive or names no input, a nominal value is 0, no tolerance is
            safe, or no limit is ever reached.
    """
    from scipy.optimize import minimize

    names = tuple(costs)
    _require(nominal, costs)
    c = np.array([costs[name] for name in names], float)
    size = np.array([abs(nominal[name]) for name in names], float)
    count = 0

    def proved(shape: Array, top: float) -> tuple[Array, float]:
        nonlocal count
        count += 1
        box = dict(zip(names, map(float, shape), strict=True))
        found = safe_scale(function, nominal, box, limits, most=top, tolerance=tolerance)
        if not found.safe or not np.isfinite(found.unsafe):
            why = "no tolerance is safe" if not found.safe else "no limit is ever reached"
            why += f"; size {found.failure}: take a smaller most" if found.failure else ""
            raise ValueError(f"tolerances up to {top:g} times {box}: {why}")
        safe: Array = found.safe * shape
        return safe, found.unsafe / found.safe

    start, _ = proved(size, most)

    def cost(logs: Array) -> float:
        return float(np.log((c / proved(start * np.exp(logs - logs.mean()), 8.0)[0]).sum()))

    options = {"eps": 1e-4, "gtol": 3e-5, "maxiter": 60}
    found = minimize(cost, np.zeros(len(names)), method="BFGS", options=options)
    shape = start * np.exp(found.x - found.x.mean())
    safe, unsafe = proved(shape, 8.0)
    tolerances = dict(zip(names, map(float, safe), strict=True))
    return Cheapest(tolerances, float((c / safe).sum()), unsafe, count)


def _require(nominal: Mapping[str, float], costs: Mapping[str, float]) -> None:
    unknown = [name for name in costs if name not in nominal]
    if not costs or unknown:
        raise ValueError(
            f"the costs name {', '.join(unknown) or 'nothing'}; inputs are {', '.join(nominal)}"
        )
    if not all(x > 0 and np.isfinite(x) for x in costs.values()):
        raise ValueError(f"the costs are {dict(costs)}; they must be positive")
    if zero := [name for name in costs if nominal[name] == 0]:
        raise ValueError(f"the nominal value of {zero[0]} is 0; shift the input")
