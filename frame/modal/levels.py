"""Bounds on all α-levels, from the narrowest box to the widest, so that they are nested."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from alphacut.frame.boxes import UnitFlow
from alphacut.frame.calculus.jet import Array
from alphacut.frame.modal.exact_response import ExactResponse
from alphacut.frame.modal.model import ModalModel
from alphacut.frame.modal.polish import Polish
from alphacut.frame.modal.search import ModalSearch
from alphacut.fuzzy.progress_bar import Progress, share

Found = tuple[Array, Array, Array]
"""As `Levels`, of one level, in units of the outputs."""
Levels = tuple[Array, Array, Array]
"""Bounds (A, T, m, 2) of (−output, output), unit coordinates (A, T, m, 2, d), what is left."""
LEFT, ENDS = 0.1, 0.5
"""Shares of the wanted error that Newton's method may leave, and that a last pass may gain."""
UNSEEN = 4.0
"""Factor on what the last independent pass gained, or might have without being followed."""


def search_levels(
    flow: UnitFlow,
    model: ModalModel,
    seed: int,
    wanted: float,
    progress: Progress | None,
    *,
    passes: int = 8,
) -> Levels:
    """Optima of the polynomials; one pass takes less effort throughout, for those polished."""
    cuts, scaled = model.boxes, model.in_units(flow.scale)
    search = replace(ModalSearch.suited(scaled, seed, wanted), passes=passes)
    if passes == 1:
        search = replace(search, passes=1, basins=1, resolution=1.0, small=LEFT * wanted)

    def level(index: int, inner: Array | None, tick: Progress) -> Found:
        del inner
        bounds, at, left, gained = search.run(scaled, *cuts.unit(index), tick)
        return bounds, at, left + UNSEEN * np.maximum(gained, search.quiet)[:, None]

    return _nested(flow, level, progress, "searched")


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

    def level(index: int, inner: Array | None, tick: Progress) -> Found:
        starts = [at[index]] if inner is None else [at[index], inner]
        own = replace(polish, kept=flow.kept, name=f"passes {index}")
        bounds, points, left, gained = own.run(exact, starts, *cuts.unit(index), tick)
        return bounds, points, left + UNSEEN * np.maximum(gained, polish.quiet)[:, None]

    return _nested(flow, level, progress, "polished")


def _nested(
    flow: UnitFlow,
    level: Callable[[int, Array | None, Progress], Found],
    progress: Progress | None,
    name: str,
) -> Levels:
    """All levels, those that are kept under `name` taken from there; "" keeps nothing."""
    count, kept = len(flow.boxes.alpha), flow.kept if name else None
    found: list[Found] = []
    for done, index in enumerate(reversed(range(count))):
        tick = share(progress, done / count, (done + 1) / count)
        tick(0.0)
        old = kept.load(f"{name} {index}") if kept is not None else None
        if old is not None:
            found.insert(0, (old["bounds"], old["at"], old["left"]))
            continue
        bounds, at, left = level(index, found[0][1] if found else None, tick)
        if found:
            better = found[0][0] > bounds
            bounds[better], at[better] = found[0][0][better], found[0][1][better]
        found.insert(0, (bounds, at, left))
        if kept is not None:
            kept.save(f"{name} {index}", {"bounds": bounds, "at": at, "left": left})
    bounds, at, left = (np.stack(part) for part in zip(*found, strict=True))
    unit = flow.scale[:, None]
    return bounds * unit, at, left * unit
