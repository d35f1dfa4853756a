"""Declared errors beside true ones: collected by quantity, printed with quantiles, and judged.

    SEED=1234 ./enter python -m pytest -m slow tests/calibration -s

Without SEED each test draws one and prints it. A row has one of two kinds. Estimated: the declared
error of each value over its true one, which may not exceed it. Guaranteed: the proved width over
the width of what was attained by another method, which may not leave the bounds.
"""

from __future__ import annotations

import os
from dataclasses import dataclass, field

import numpy as np
from scipy.stats import binom

SHARE = 0.995
"""Least share of estimated values that their errors cover."""
CHANCE = 1e-6
"""Chance of a row to be judged wrong where its errors cover `SHARE`. All calibrations together have
fewer than 100 rows, so that chance ends one of ten thousand of their runs."""
MOST = 30.0
"""Most that the median of declared over true may be: over all estimates of a table, or a row of
guaranteed bounds."""
ROUNDING = 1e-9
"""Share of a value's size by which judges themselves are rounded."""


def is_rate(count: int, total: int, most: float) -> bool:
    """Whether so many of independent cases may be counted by chance if each is with a rate.

    Args:
        count: How many of the cases are.
        total: Number of cases.
        most: Largest rate that is claimed.
    """
    return bool(binom.sf(count - 1, total, most) >= CHANCE)


def free_seed(name: str) -> int:
    """A seed drawn anew, or that of the environment variable SEED; prints it."""
    seed = int(os.environ.get("SEED") or np.random.default_rng().integers(10**9))
    print(f"\n{name}: SEED={seed}")
    return seed


@dataclass
class Row:
    """Values of one quantity: shapes (N,) in parts that are joined at the end."""

    guaranteed: bool
    ratios: list[np.ndarray] = field(default_factory=list)
    covered: list[np.ndarray] = field(default_factory=list)

    @property
    def share(self) -> float:
        """Share of the values that are covered."""
        return float(np.concatenate(self.covered).mean())

    @property
    def quantiles(self) -> np.ndarray:
        """Of declared over true: 25, 50 and 95 %."""
        return np.quantile(np.concatenate(self.ratios), (0.25, 0.5, 0.95))

    @property
    def right(self) -> bool:
        """Whether enough is covered, and guaranteed bounds are near.

        More estimated values may be missed than the share: as many as chance misses with the
        probability `CHANCE`. Values of one case may be missed together, as those of one motion at
        all times. So cases are counted, each by the share of its values that is missed: of all
        independent shares with a mean, those that are 0 or 1 scatter most (Hoeffding 1963).
        """
        if not self.guaranteed:
            missed = sum(1.0 - part.mean() for part in self.covered)
            return is_rate(int(missed), len(self.covered), 1 - SHARE)
        return self.share == 1.0 and bool(self.quantiles[1] <= MOST)


@dataclass
class Calibration:
    """A table of quantities under the name of what is judged, drawn from a seed."""

    name: str
    seed: int
    rows: dict[str, Row] = field(default_factory=dict)
    violations: list[str] = field(default_factory=list)

    def estimated(
        self, quantity: str, declared, true, *, size=1.0, least=0.0, case: object = ""
    ) -> None:
        """Adds declared and true errors of values of a magnitude `size`, (N,) or one number each.

        In the ratio true errors count as at least `least`: who asks for 1e-4 and is right to 1e-12
        has not been misled. `case` tells where in a message.
        """
        declared, true, size = np.broadcast_arrays(*np.atleast_1d(declared, true, size))
        covered = true <= declared + ROUNDING * size
        floor = np.maximum(np.maximum(true, least), ROUNDING * size)
        self._add(quantity, False, declared / floor, covered, case)

    def guaranteed(self, quantity: str, proved, attained, *, size=1.0, case: object = "") -> None:
        """Adds proved lower and upper ends and those that another method attains inside, (N,) each.

        `case` tells where in a message.
        """
        (low, high), (least, most) = map(np.atleast_1d, proved), map(np.atleast_1d, attained)
        slack = ROUNDING * np.asarray(size)
        inside = (least >= low - slack) & (most <= high + slack)
        width = np.maximum(most - least, 1e-3 * np.asarray(size))
        self._add(quantity, True, (high - low) / width, inside, case)

    def _add(self, quantity, guaranteed, ratios, covered, case) -> None:
        row = self.rows.setdefault(quantity, Row(guaranteed))
        row.ratios.append(ratios.ravel())
        row.covered.append(covered.ravel())
        if not covered.all():
            worst = 1 / ratios[~covered].min() if not guaranteed else np.nan
            count = f"{(~covered).sum()} of {covered.size}"
            self.violations.append(f"{quantity}: {count}, true over declared {worst:.3g}; {case}")

    def __str__(self) -> str:
        """The table and what was violated."""
        head = f"{'quantity':24} {'nature':10} {'values':>8} {'covered':>9}"
        lines = [self.name, head + "".join(f"{q:>9} %" for q in (25, 50, 95))]
        for name, row in self.rows.items():
            nature = "guaranteed" if row.guaranteed else "estimated"
            count = sum(len(part) for part in row.covered)
            numbers = "".join(f"{q:11.3g}" for q in row.quantiles)
            lines.append(f"{name:24} {nature:10} {count:8} {100 * row.share:8.3f}%{numbers}")
        return "\n".join([*lines, *self.violations])

    def judge(self, most: float = MOST) -> None:
        """Prints the table; fails where a row is wrong, estimates are far too large, or none is.

        `most` is that of the median of all estimates.
        """
        print(f"\n{self}")
        wrong = [name for name, row in self.rows.items() if not row.right]
        estimates = [
            part for row in self.rows.values() if not row.guaranteed for part in row.ratios
        ]
        if estimates and not np.median(np.concatenate(estimates)) <= most:
            wrong.append("median of the errors")
        assert self.rows, f"{self.name}: nothing was judged (SEED={self.seed})"
        assert not wrong, f"{', '.join(wrong)} (SEED={self.seed})\n{self}"
