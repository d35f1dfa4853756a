"""Bounds on all α-levels, from the narrowest box to the widest, so that they are nested."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from alphacut.frame.boxes import Boxes, UnitFlow
from alphacut.frame.calculus.jet import Array
from alphacut.frame.modal.exact_response import ExactResponse
from alphacut.frame.modal.model import ModalModel
from alphacut.frame.modal.polish import Polish
from alphacut.frame.modal.search import ModalSearch

Progress = Callable[[float], None]
Levels = tuple[Array, Array, Array]
"""Bounds (A, T, m, 2) of (−output, output), unit coordinates (A, T, m, 2, d), what is left."""
LEFT, ENDS = 0.1, 0.5
"""Shares of the wanted error that Newton's method may leave, and that a last pass may gain."""
UNSEEN = 3.0
"""Factor on what the last independent pass gained, or might have without being followed."""


def search_levels(
    flow: UnitFlow,
    model: ModalModel,
    seed: int,
    wanted: float,
    progress: Progress | None,
    *,
    guide: bool = False,
) -> Levels:
    """Optima of the polynomials; `guide` takes less effort, for those that are polished."""
    cuts, scaled = model.boxes, model.in_units(flow.scale)
    search = ModalSearch.suited(scaled, seed, wanted)
    if guide:
        search = replace(search, passes=1, basins=1, resolution=1.0, small=LEFT * wanted)

    def level(index: int, inner: Array | None) -> tuple[Array, Array, Array]:
        del inner
        bounds, at, left, gained = search.run(scaled, *cuts.unit(index))
        return bounds, at, left + UNSEEN * np.maximum(gained, search.quiet)[:, None]

    return _nested(cuts, flow, level, progress)


def polished_levels(
    flow: UnitFlow,
    exact: ExactResponse,
    at: Array,
    seed: int,
    wanted: float,
    progress: Progress | None,
) -> Levels:
    """Bounds of exact trajectories from the polynomials' optima `at` (A, T, m, 2, d)."""
    cuts, polish = flow.boxes, Polish(LEFT * wanted, ENDS * wanted, seed=seed)

    def level(index: int, inner: Array | None) -> tuple[Array, Array, Array]:
        starts = [at[index]] if inner is None else [at[index], inner]
        bounds, points, left, gained = polish.run(exact, starts, *cuts.unit(index))
        return bounds, points, left + UNSEEN * np.maximum(gained, polish.quiet)[:, None]

    return _nested(cuts, flow, level, progress)


def _nested(
    cuts: Boxes,
    flow: UnitFlow,
    level: Callable[[int, Array | None], tuple[Array, Array, Array]],
    progress: Progress | None,
) -> Levels:
    count = len(cuts.alpha)
    found: list[tuple[Array, Array, Array]] = []
    for done, index in enumerate(reversed(range(count))):
        if progress:
            progress(done / count)
        bounds, at, left = level(index, found[0][1] if found else None)
        if found:
            kept = found[0][0] > bounds
            bounds[kept], at[kept] = found[0][0][kept], found[0][1][kept]
        found.insert(0, (bounds, at, left))
    bounds, at, left = (np.stack(part) for part in zip(*found, strict=True))
    unit = flow.scale[:, None]
    return bounds * unit, at, left * unit
