"""Spot check: stored samples run again, to see that the function is the same."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from alphacut.fuzzy.campaign.call import Failure, Outcome, Sample
from alphacut.fuzzy.samples.model import Values
from alphacut.fuzzy.sets.numbers import Array

_SAME = 1e-6  # of the largest output: solvers need not repeat themselves closer
_CURE = "a function that changed needs another identity"


def require_same(stored: Sample, fresh: Outcome, names: Sequence[str], point: Array) -> None:
    """A stored sample is what the function gives now, at a point (inputs,).

    Raises:
        ValueError: It is not: other outputs, other values, or none.
    """
    place = ", ".join(f"{name} = {x:.6g}" for name, x in zip(names, point, strict=True))
    if isinstance(fresh, Failure):
        raise ValueError(
            f"the store holds a sample at {place} where the function now fails ({fresh.error});"
            f" {_CURE}"
        )
    old, new = (Values(sample.layout, sample.row[None]) for sample in (stored, fresh))
    if sorted(old.columns) != sorted(new.columns):
        raise ValueError(
            f"the store holds the outputs {', '.join(old.columns)}, the function gives"
            f" {', '.join(new.columns)}; {_CURE}"
        )
    values = new.select(old.columns)[0]
    apart = np.abs(values - stored.row)
    if apart.max() > _SAME * np.abs(stored.row).max():
        i = int(apart.argmax())
        found = (
            f"the store holds {old.columns[i]} = {stored.row[i]:.6g} at {place} where the function"
            f" gives {values[i]:.6g}"
        )
        raise ValueError(f"{found}; {_CURE}")
