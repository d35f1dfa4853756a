"""Spot checks: stored samples run again, to see that the function is still the one they are of."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from time import perf_counter

import numpy as np

from alphacut.fuzzy.campaign.call import Call, Failure, Outcome, Sample
from alphacut.fuzzy.samples.model import Values
from alphacut.fuzzy.sets.given import is_real
from alphacut.fuzzy.sets.numbers import Array

_SAME = 1e-6  # of each output: solvers need not repeat themselves closer
_NOTHING = 1e-9  # differences of less, in a unit of the outputs, are those of residuals
_CURE = "a function that changed needs another identity"
RANDOM = "a random function has no bounds: give it a fixed seed"


@dataclass
class SpotCheck:
    """Runs some of the samples that a campaign takes from its store once more.

    Args:
        share: Time for it, as a share of what the samples taken from the store took when they were
            run; one is run in any case, the modal point if it is among them. 0 runs none.
        modal: Modal point of the inputs, shape (inputs,).
        runs: Samples run again so far.
        seconds: Time spent on it so far.

    Raises:
        ValueError: The share lies outside 0 … 1.
    """

    share: float
    modal: Array
    runs: int = 0
    seconds: float = 0.0
    _saved: float = field(default=0.0, repr=False)

    def __post_init__(self) -> None:
        if not (is_real(self.share) and 0 <= self.share <= 1):
            raise ValueError(
                f"the spot check has a share of {self.share!r} of the stored samples' time; it must"
                " lie in [0, 1]"
            )

    def look(
        self, call: Call, points: Array, seconds: Array, stored: Callable[[int], Sample]
    ) -> None:
        """Run the modal point and random ones of the stored points again, as time allows.

        Args:
            call: The function.
            points: Points that are stored, shape (n, inputs).
            seconds: Time that each took when it was run, shape (n,).
            stored: Sample by row.

        Raises:
            ValueError: The function gives something else than what is stored.
        """
        if not (self.share and len(points)):
            return
        self._saved += float(seconds.sum())
        order = np.random.default_rng().permutation(len(points))
        elsewhere = (points[order] != self.modal).any(axis=1)
        for row in order[np.argsort(elsewhere, kind="stable")]:
            expected = max(float(seconds[row]), self.seconds / max(self.runs, 1))
            if self.runs and self.seconds + expected > self.share * self._saved:
                return
            start = perf_counter()
            fresh = call(points[[row]])[0]
            self.seconds += perf_counter() - start
            self.runs += 1
            require_same(stored(int(row)), fresh, call.names, points[row])


def require_same(
    stored: Sample,
    fresh: Outcome,
    names: Sequence[str],
    point: Array,
    holder: str = "the store holds",
    cure: str = _CURE,
) -> None:
    """A stored sample is what the function gives now, at a point (inputs,).

    Raises:
        ValueError: It is not: other outputs, other values, or none.
    """
    place = ", ".join(f"{name} = {x:.6g}" for name, x in zip(names, point, strict=True))
    if isinstance(fresh, Failure):
        raise ValueError(
            f"{holder} a sample at {place} where the function now fails ({fresh.error}); {cure}"
        )
    old, new = (Values(sample.layout, sample.row[None]) for sample in (stored, fresh))
    if sorted(old.columns) != sorted(new.columns):
        raise ValueError(
            f"{holder} the outputs {', '.join(old.columns)}, the function gives"
            f" {', '.join(new.columns)}; {cure}"
        )
    values = new.select(old.columns)[0]
    excess = np.abs(values - stored.row) - _allowed(old)
    if (excess > 0).any():
        i = int(excess.argmax())
        found = (
            f"{holder} {old.columns[i]} = {stored.row[i]:.6g} at {place} where the function"
            f" gives {values[i]:.6g}"
        )
        raise ValueError(f"{found}; {cure}")


def _allowed(values: Values) -> Array:
    """Differences that do not count, by column: a share of the largest entry of its output."""
    sizes = [np.abs(values.output(name)) for name, _ in values.layout]
    largest = [np.full(size.size, size.max(initial=0.0)) for size in sizes]
    scale: Array = np.concatenate(largest)
    return np.maximum(_SAME * scale, _NOTHING * min(1.0, float(scale.max())))
