"""Possibility and necessity that an output passes a limit, read off its α-cuts.

Passing is possible to the degree of the highest cut that reaches beyond the limit, and necessary to
one minus the degree to which staying below is possible (Dubois and Prade, Possibility Theory,
chapter 1). Proved and estimated bounds give the highest degrees that are not refuted, attained ones
the lowest that are certain. Inputs with claims make the possibility a bound of the probability.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from alphacut.fuzzy.arrays import Array, Mask
from alphacut.fuzzy.refused import real, require
from alphacut.fuzzy.result import Bounds, Nature
from alphacut.fuzzy.tables import html_table

Degrees = tuple[float, float]


@dataclass(frozen=True, eq=False, repr=False)
class Decision:
    """How possible and how necessary it is that any limit is passed.

    Args:
        possibility: Lower and upper bound, two numbers from 0 to 1.
        necessity: Likewise.
        margin: Limit less output by name of the output, in its unit: least and greatest on every
            level, two arrays of shape (levels,).
        alpha: Levels of the margin, rising.
        nature: The weakest nature of the outputs that have a limit.
        claim: What the cuts of the inputs claim.
    """

    possibility: Degrees
    necessity: Degrees
    margin: Mapping[str, tuple[Array, Array]]
    alpha: Array
    nature: Nature
    claim: str

    @property
    def verdict(self) -> str:
        """Safe where passing is impossible, unsafe where it is necessary to 1, else undecided."""
        if self.possibility[1] == 0:
            return "safe"
        return "unsafe" if self.necessity[0] == 1 else "undecided"

    def __str__(self) -> str:
        """The decision, the margin to each limit at the lowest level, and what is claimed."""
        possible, necessary = _ranged(*self.possibility), _ranged(*self.necessity)
        head = f"{self.verdict}: possibility of passing {possible}, necessity {necessary}"
        margins = [
            f"margin of {name} {_ranged(low[0], high[0])} at α = {self.alpha[0]:g}"
            for name, (low, high) in self.margin.items()
        ]
        claim = [self.claim] if self.claim else []
        return "\n".join([f"{head}, by bounds {self.nature}", *margins, *claim])

    __repr__ = __str__

    def _repr_html_(self) -> str:
        """The decision over its margins as a table, for notebooks."""
        rows = [
            (name, f"{alpha:g}", f"{low:.6g}", f"{high:.6g}")
            for name, ends in self.margin.items()
            for alpha, low, high in zip(self.alpha, *ends, strict=True)
        ]
        return html_table(("output", "α", "margin from", "margin to"), rows, below=str(self))


def decide(bounds: Bounds, limits: Mapping[str, float]) -> Decision:
    """Decision on whether outputs pass their upper limits, any of them.

    Args:
        bounds: α-cuts of the outputs; of motions their greatest values over time count.
        limits: Limit by output, in its unit.

    Raises:
        RefusedError: There is no limit, or it names no output.
    """
    require(bool(limits), "limits", limits, "one limit or more, as {'y': 4.5}")
    own = bounds.select(*limits)
    at = np.array([real(f"limit of {name}", limit) for name, limit in limits.items()])
    may, does, least, surely = (ends - at for ends in _reaches(own))
    # a cut from data may be that of a level below
    known = [min(x.known(level) for x in own.inputs.values()) for level in own.alpha]
    possible = (
        _lowest(known, (does > 0).any(axis=1)),
        _highest(own.alpha, (may > 0).any(axis=1)),
    )
    staying_low = min(_lowest(known, column <= 0) for column in surely.T)
    staying_high = min(_highest(own.alpha, column <= 0) for column in least.T)
    margin = {name: (-may[:, k], -least[:, k]) for k, name in enumerate(limits)}
    necessary = 1 - staying_high, 1 - staying_low
    return Decision(possible, necessary, margin, own.alpha, own.nature, str(own.claim))


def _reaches(bounds: Bounds) -> tuple[Array, Array, Array, Array]:
    """Greatest values not excluded and attained, least ones likewise, four (levels, outputs).

    Proofs exclude, and the error of estimated bounds; attained bounds exclude nothing. Over time
    the greatest value counts; its least is not below any lower bound, but nothing says that one
    motion attains it.
    """
    inner, (low, high) = bounds.attained, bounds.proved
    estimated = [bounds.nature_of(name) is Nature.ESTIMATED for name in bounds.outputs]
    error = np.where(estimated, bounds.error, np.inf)
    ends = (
        np.minimum(high, bounds.upper + error),
        np.nan_to_num(inner.upper, nan=-np.inf),
        np.maximum(low, bounds.lower - error),
        np.nan_to_num(inner.lower, nan=np.inf),
    )
    if bounds.time is None:
        return ends
    may, does, least, _ = (end.max(axis=1) for end in ends)
    return may, does, least, np.full(may.shape, np.inf)


def _lowest(known: Sequence[float], holds: Mask) -> float:
    """Degree that is certain: that of the highest level on which something holds."""
    rows = np.flatnonzero(holds)
    return float(known[rows[-1]]) if len(rows) else 0.0


def _highest(alpha: Array, holds: Mask) -> float:
    """Degree that is not exceeded: that of the level above the highest on which it holds."""
    rows = np.flatnonzero(holds)
    if not len(rows):
        return float(alpha[0])
    return float(alpha[rows[-1] + 1]) if rows[-1] + 1 < len(alpha) else 1.0


def _ranged(low: float, high: float) -> str:
    """Such as 0.25 … 0.5; one number where both ends read the same."""
    return " … ".join(dict.fromkeys((f"{low:.6g}", f"{high:.6g}")))
