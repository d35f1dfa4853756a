"""Proved envelopes of linear structures with many fuzzy inputs: the dual bound as a method.

1. A linear structure with classical modes answers as Σ_k F_k(z_k): z_k are few intervening
   variables of mode k (section 7), its frequency, its decay and its shares, F_k the exact
   response of one oscillator. They bend little over the box: z = Z u + quadratic terms + R, |R|
   proved (`eigenpairs`, `intervening`). The F_k stand in tables of proved error (`waves`).
2. For any multipliers μ

       max Σ_k F_k(z_k(u)) ≤ Σ_k max (F_k − μ_k·z_k) + max μ·(z − R)(u) + |μ|·R,

so that nothing rests on how μ is found. The cost is one of modes, tables and nodes, and hardly
one of inputs (`kernel`, `level`).
3. Where the modes' own maxima lie too far from one u, their ranges are halved: slabs of few z,
   not boxes of many u. Near the peaks, that is; elsewhere a wider gap is left.
4. What the maxima name leads to inputs whose exact motion is the other end of the gap
   (`attained`).
"""

from __future__ import annotations

import os
import time
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from alphacut.frame.boxes import Boxes, UnitFlow
from alphacut.frame.dual.attained import attained
from alphacut.frame.dual.expansion import Expansion
from alphacut.frame.dual.level import Level
from alphacut.frame.dual.structure import Classical, classical
from alphacut.frame.dynamics.flow import LinearFlow
from alphacut.frame.envelope import Ends, Envelope
from alphacut.frame.methods.proof import exact
from alphacut.frame.structures.linear import LinearSystem
from alphacut.fuzzy.arrays import Array, Rows
from alphacut.fuzzy.progress_bar import Progress
from alphacut.fuzzy.refused import RefusedError
from alphacut.fuzzy.result import Nature

ROUNDING = 1e-10
"""Share of an output's peak by which its exact values may be off."""


@dataclass(frozen=True)
class DualProof:
    """The method and its options.

    Args:
        gap: Distance of proved and attained bounds that suffices, as a share of each output's peak
            at the modal inputs; what the remainders leave may be more.
        slabs: Most parts of the modes' ranges for a bound.
        steps: Most evaluations of the dual function for each of them.
        workers: Threads, which hardly change the result; all cores unless given.

    Raises:
        RefusedError: A value is not positive.
    """

    name: ClassVar[str] = "dual"
    gap: float = 2e-3
    slabs: int = 24
    steps: int = 40
    workers: int | None = None

    def __post_init__(self) -> None:
        for key in ("gap", "slabs", "steps"):
            if not getattr(self, key) > 0:
                raise RefusedError(key, getattr(self, key), "a positive number")

    def run(self, flow: UnitFlow, progress: Progress | None = None) -> Envelope:
        """Guaranteed envelope of all outputs on all levels.

        Raises:
            UnprovedError: The structure has no classical modes that can be enclosed, or the motion
                is not the exact one.
        """
        linear, begun, cuts = exact(flow), time.perf_counter(), flow.boxes
        peak = np.abs(linear.values(cuts.modal[None])[0]).max(0)
        peak = np.where(peak > 0, peak, max(float(peak.max()), 1e-300))
        levels: list[_Bounded] = []
        for a in reversed(range(len(cuts.alpha))):
            levels.insert(0, self._level(linear, cuts, a, peak, levels[0] if levels else None))
            if progress is not None:
                progress(1 - a / len(cuts.alpha))
        inner, at = (np.stack([getattr(x, name) for x in levels]) for name in ("inner", "at"))
        outer = np.minimum.accumulate(np.stack([x.outer for x in levels]), axis=0)
        outer = np.maximum(outer, inner)  # which differ by rounding alone where they cross
        error = (outer - inner).max(-1)
        most = np.abs(outer).max((1, 3))  # (A, m)
        of_peaks = np.abs(outer.max(1) - inner.max(1)).max(-1) / np.maximum(most, 1e-300)
        return Envelope(
            alpha=cuts.alpha,
            time=flow.time,
            outputs=flow.outputs,
            inputs=cuts.inputs,
            lower=-outer[..., 0],
            upper=outer[..., 1],
            lower_at=at[..., 0, :],
            upper_at=at[..., 1, :],
            error=error,
            nature=Nature.GUARANTEED,
            method=self.name,
            units=flow.units,
            basis=("the equations of motion hold",),
            inner=Ends(-inner[..., 0], inner[..., 1]),
            between=np.max([x.stray for x in levels], axis=0),
            evaluations=inner.size,
            seconds=time.perf_counter() - begun,
            facts={
                "gap": float((error / flow.scale).max()),
                "gap_of_peaks": float(of_peaks.max()),
                "single_modes": min(x.single for x in levels),
            },
        )

    def _level(
        self, flow: LinearFlow, cuts: Boxes, a: int, peak: Array, within: _Bounded | None
    ) -> _Bounded:
        """Bounds of one level; what the level inside it attains is attained here too."""
        low, high = cuts.lower[a], cuts.upper[a]
        active, centre, radius = np.flatnonzero(high > low), (low + high) / 2, (high - low) / 2
        margin = ROUNDING * peak[:, None]
        if not len(active):
            value = flow.values(centre[None])[0]
            both = np.stack([-value, value], -1)
            at = np.broadcast_to(centre, (*both.shape, len(centre))).copy()
            return _Bounded(both + margin, both - margin, at, np.zeros_like(value), len(value))
        structure = over_box(flow.system, cuts.names, centre, radius, active)
        moved = sources(flow.system, structure)
        level = Level.of(structure, flow.system.ground, flow.time, moved)
        workers = self.workers or os.cpu_count() or 1
        outer, unit = level.bounds(self.gap * peak, self.slabs, self.steps, workers)
        points = np.tile(centre, (*outer.shape, 1))
        points[..., active] += radius[active] * unit
        points = np.clip(points, low, high)
        node, output, side = (x.ravel() for x in np.indices(outer.shape))
        flat = points.reshape(-1, len(centre)), unit.reshape(-1, len(active))
        value = attained(flow.system, structure, cuts.names, flat, (node, output), flow.time)
        inner = (np.where(side, 1, -1) * value).reshape(outer.shape) - margin
        if within is not None:
            better = within.inner > inner
            inner[better], points[better] = within.inner[better], within.at[better]
        return _Bounded(outer, inner, points, level.stray(), len(level.single))


@dataclass(frozen=True, eq=False)
class _Bounded:
    """One level's upper bounds of (−output, output).

    Args:
        outer: Proved, shape (T, m, 2).
        inner: Attained, less rounding.
        at: By these inputs, shape (T, m, 2, n), in SI units.
        stray: Of outputs from straight lines in the step to a node, shape (T, m).
        single: Modes that were enclosed one by one.
    """

    outer: Array
    inner: Array
    at: Array
    stray: Array
    single: int


def over_box(
    system: LinearSystem, names: tuple[str, ...], centre: Array, radius: Array, active: Rows
) -> Classical:
    """The structure over a box of its inputs, of which those `active` have a width."""
    inputs, d = Expansion.inputs(centre[active], radius[active]), len(active)
    own = {name: float(x) for name, x in zip(names, centre, strict=True)}
    values = {**system.parameters, **own}
    p = {name: Expansion.constant(x, d) for name, x in values.items()}
    p |= {names[i]: inputs[place] for place, i in enumerate(active)}
    return classical(system, p)


def sources(system: LinearSystem, structure: Classical) -> tuple[str, ...]:
    """Names of what moves the structure: load, velocity, start."""
    moved = np.asarray(structure.start.size().any(-1))
    present = {"load": system.ground is not None, "velocity": moved[1], "start": moved[0]}
    return tuple(name for name, is_there in present.items() if is_there)
