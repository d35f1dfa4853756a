"""Boxes all of whose motions pass a limit at some node: the necessity of exceeding.

A box is halved until each part has one node, output and side at which branch and bound proves that
all of its motions lie beyond the limit, with the error of the polynomials on the safe side. A point
that keeps all limits ends the proof; the least box that holds one bounds the necessity from above.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from alphacut.frame.calculus.jet import Array
from alphacut.frame.decisions.limit_search import LimitSearch, enclosed
from alphacut.frame.modal.starting_points import spread_points, trajectories

PARTS = 200
"""Parts of a box that are looked at before its proof is given up."""
EASY = 0.5
"""Share of the limits that a rough model, which is tried first, may take at most."""
UNDECIDED = 3
"""Sizes without a proof or a refutation after which the search ends."""
POINTS = 64
"""Points besides corners at which a part is looked at."""


@dataclass(frozen=True, eq=False)
class Sure:
    """Sizes of boxes whose motions all pass a limit.

    Args:
        size: Largest size proved; None where not even the least box is.
        kept: Least size whose box holds a point that keeps all limits; infinite without one.
        witness: That point, shape (d,), or None.
    """

    size: float | None
    kept: float
    witness: Array | None


def sure_exceeding(search: LimitSearch, most: float, precision: float = 1e-3) -> Sure:
    """Bounds of the size up to which every motion passes a limit.

    Args:
        search: The motion, without a model of it yet; its nominal point must pass a limit.
        most: Largest size asked for.
        precision: Wanted distance of both sizes, as a share of `most`.
    """
    fine, search.gap = search.gap, min(EASY, search.share(search.nominal) - 1)
    if search.gap > fine:
        search.fit(most)
        if not search.reason and surely(search, most)[0]:
            return Sure(most, np.inf, None)
    search.gap = fine
    search.fit(most)
    low, high, witness = 0.0, np.inf, keeping(search, most)
    if witness is None and surely(search, most)[0]:
        return Sure(most, high, None)
    proved, found = surely(search, 0.0)
    if not proved:
        witness = witness if found is None else found
        return Sure(None, high if witness is None else search.size_of(witness), witness)
    top, undecided = most, 0
    if witness is not None:
        high = top = min(search.size_of(witness), most)
    while top - low > precision * most and undecided < UNDECIDED:
        middle = (low + top) / 2
        proved, found = surely(search, middle)
        if not proved and found is None:
            found = keeping(search, middle)
        if found is not None:
            high, witness = min(search.size_of(found), middle), found
        undecided += not proved and found is None
        low, top = (middle, top) if proved else (low, middle)
    return Sure(low, high, witness)


def keeping(search: LimitSearch, size: float) -> Array | None:
    """Parameters in the box whose true motion keeps all limits, pulled to the nominal ones."""
    lower, upper = search.unit(size)
    points = spread_points(lower, upper, 4 * POINTS)
    share = np.abs(trajectories(search.model, points)).max((1, 2))

    def peak(point: Array) -> float:
        inside = np.clip(point, lower, upper)
        return float(np.abs(trajectories(search.model, inside[None])).max())

    for row in np.argsort(share)[:3]:
        best = points[row]
        if share[row] > 1:
            best = minimize(peak, best, method="Nelder-Mead", options={"maxfev": 300}).x
        point = search.model.boxes.to_physical(np.clip(best, lower, upper))
        if search.share(point) <= 1:
            return search.pulled(point, beyond=False)
    return None


def surely(search: LimitSearch, size: float) -> tuple[bool, Array | None]:
    """Whether all motions of a box are proved to pass a limit, else a point known to keep all."""
    parts, looked = [search.unit(size)], 0
    if not (parts[0][1] > parts[0][0]).any():
        point = search.model.boxes.to_physical(parts[0][0])
        return (True, None) if search.exceeded(point) else (False, point)
    while parts and looked < PARTS:
        lower, upper = parts.pop()
        looked += 1
        points = spread_points(lower, upper, POINTS)
        values = trajectories(search.model, points)  # (S, T, m)
        calm = int(np.abs(values).max((1, 2)).argmin())
        if np.abs(values[calm]).max() <= 1:
            point = search.model.boxes.to_physical(points[calm])
            if search.share(point) <= 1:
                return False, search.pulled(point, beyond=False)
        if not _beyond(search, values, lower, upper):
            axis = int((upper - lower).argmax())
            low, high = lower.copy(), upper.copy()
            low[axis] = high[axis] = (lower[axis] + upper[axis]) / 2
            parts += [(lower, high), (low, upper)]
    return not parts, None


def _beyond(search: LimitSearch, values: Array, lower: Array, upper: Array) -> bool:
    """Whether one node, output and side is proved beyond its limit all over a part."""
    least = np.stack([(-values).min(0), values.min(0)], axis=-1) - 1 - search.error[..., None]
    number = int(least.argmax())
    if least.flat[number] <= 0:
        return False
    allowed = np.array([-1 - search.error.flat[number // 2]]) - 1e-9
    opposite = np.array([number ^ 1])
    return not len(enclosed(search, lower, upper, opposite, allowed, 1000)[0])
