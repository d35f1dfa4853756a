"""Direct α-cut optimisation by SciPy for every node, bound and output (eq. 21)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from alphacut.frame.boxes import UnitFlow
from alphacut.frame.calculus.jet import Array

OPTIMISERS = ("L-BFGS-B", "differential_evolution", "shgo", "direct", "dual_annealing")


@dataclass(frozen=True)
class CutOptimisation:
    """Solves eq. 21 node by node; every evaluation of the objective is a trajectory.

    Args:
        optimiser: A local multistart ("L-BFGS-B") or one of SciPy's global optimisers.
        starts: Starting points of the multistart.
        seed: Seed of the starting points and of the random optimisers.

    Raises:
        ValueError: The optimiser is unknown.
    """

    optimiser: str = "L-BFGS-B"
    starts: int = 8
    seed: int = 0

    def __post_init__(self) -> None:
        if self.optimiser not in OPTIMISERS:
            raise ValueError(
                f"optimiser: '{self.optimiser}' is unknown; allowed are {', '.join(OPTIMISERS)}"
            )

    def bound(
        self, flow: UnitFlow, level: int, *, node: int, output: int, side: int
    ) -> tuple[float, Array, int]:
        """One bound.

        Args:
            flow: The trajectories.
            level: Index of the α-cut.
            node: Index of the time node.
            output: Index of the output.
            side: +1 for the upper bound, −1 for the lower.

        Returns:
            The bound, its unit coordinates (d,), and the number of trajectories computed.
        """
        lower, upper = flow.boxes.unit(level)
        calls = 0

        def objective(u: Array) -> float:
            nonlocal calls
            calls += 1
            return -side * float(flow.values(np.clip(u, lower, upper)[None])[0, node, output])

        found = self._minimum(objective, lower, upper)
        return -side * objective(found), np.clip(found, lower, upper), calls

    def _minimum(self, objective: Callable[[Array], float], lower: Array, upper: Array) -> Array:
        from scipy import optimize

        free = upper > lower
        if not free.any():
            return lower

        def reduced(x: Array) -> float:
            full = lower.copy()
            full[free] = x
            return objective(full)

        box = list(zip(lower[free], upper[free], strict=True))
        rng = np.random.default_rng(self.seed)
        if self.optimiser == "L-BFGS-B":
            starts = rng.uniform(lower[free], upper[free], (self.starts, int(free.sum())))
            best = min(
                (optimize.minimize(reduced, x, bounds=box, method="L-BFGS-B") for x in starts),
                key=lambda r: float(r.fun),
            )
        elif self.optimiser in ("differential_evolution", "dual_annealing"):
            best = getattr(optimize, self.optimiser)(reduced, box, rng=rng)
        else:
            best = getattr(optimize, self.optimiser)(reduced, box)
        out = lower.copy()
        out[free] = best.x
        return out
