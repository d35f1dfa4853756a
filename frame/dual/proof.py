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
4. The few nodes whose bounds are still too far above a peak are bounded over parts of the box
(`parts`).
5. What the maxima name leads to inputs whose exact motion is the other end of the gap
   (`box`).
"""

from __future__ import annotations

import os
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from typing import ClassVar

import numpy as np

from alphacut.frame.boxes import Boxes, UnitFlow
from alphacut.frame.dual.box import Box
from alphacut.frame.dual.parts import Peak
from alphacut.frame.dynamics.flow import LinearFlow
from alphacut.frame.envelope import Ends, Envelope
from alphacut.frame.methods.proof import exact
from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.progress_bar import Progress
from alphacut.fuzzy.refused import FailedError, RefusedError
from alphacut.fuzzy.result import Nature

PARTS = 32
"""Most parts of the box over which the nodes above a peak are bounded."""
HOPELESS = 0.1
"""Gap of a peak, as a share of it, above which so many parts do not close it."""


@dataclass(frozen=True)
class DualProof:
    """The method and its options.

    Args:
        gap: Distance of proved and attained bounds that suffices, as a share of each output's peak
            at the modal inputs; what the remainders leave may be more.
        peaks: The same of the bounds above a peak, as a share of it, above which the box of inputs
            is parted.
        slabs: Most parts of the modes' ranges for a bound.
        steps: Most evaluations of the dual function for each of them.
        workers: Threads, which do not change the result; all cores unless given.

    Raises:
        RefusedError: A value is not positive.
    """

    name: ClassVar[str] = "dual"
    gap: float = 2e-3
    peaks: float = 0.019
    slabs: int = 24
    steps: int = 40
    workers: int | None = None

    def __post_init__(self) -> None:
        for key in ("gap", "peaks", "slabs", "steps"):
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
        _require_order(inner, outer, flow.outputs)
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
        box = Box(flow.system, cuts.names, flow.time, low, high)
        if not (high > low).any():
            value, error, stray = box.centre_motion()
            both, margin = np.stack([-value, value], -1), error[..., None]
            at = np.broadcast_to(low, (*both.shape, len(low))).copy()
            return _Bounded(both + margin, both - margin, at, stray, len(value))
        level, workers = box.level(), self.workers or os.cpu_count() or 1
        outer, unit = level.bounds(self.gap * peak, self.slabs, self.steps, workers)
        node, output, side = (x.ravel() for x in np.indices(outer.shape))
        reached = box.reached(unit.reshape(len(node), -1), node, output, np.where(side, 1, -1))
        inner = reached.reshape(outer.shape)
        self._parted(box, (outer, inner, unit), workers)
        points = box.inputs(unit)
        if within is not None:
            better = within.inner > inner
            inner[better], points[better] = within.inner[better], within.at[better]
        return _Bounded(outer, inner, points, level.stray(), len(level.single))

    def _parted(self, box: Box, bounds: tuple[Array, Array, Array], workers: int) -> None:
        """Improve bounds (outer, inner, unit) above peaks whose gap is too wide, over parts."""
        outer, inner, unit = bounds
        top = np.maximum(inner.max(0), 0.0)  # (m, 2)
        enough = np.broadcast_to(self.peaks * top.max(1, keepdims=True), top.shape)

        def improve(o: int, s: int) -> None:
            nodes = np.flatnonzero(outer[:, o, s] > top[o, s] + enough[o, s])
            every, side = np.full(len(nodes), o), (-1, 1)[s]
            peak = Peak(
                partial(box.part, o, nodes),
                lambda unit: box.reached(unit, nodes, every, side),
                unit.shape[-1],
                s,
                outer[nodes, o, s],
                float(top[o, s]),
                float(enough[o, s]),
            )
            outer[nodes, o, s] = peak.bounds(PARTS)
            better = peak.value > inner[nodes, o, s]
            inner[nodes[better], o, s] = peak.value[better]
            unit[nodes[better], o, s] = peak.at[better]

        gap = outer.max(0) - top
        wide = np.argwhere((gap > enough) & (gap <= HOPELESS * top.max(1, keepdims=True)))
        with ThreadPoolExecutor(workers) as pool:
            for job in [pool.submit(improve, int(o), int(s)) for o, s in wide]:
                job.result()


def _require_order(inner: Array, outer: Array, outputs: tuple[str, ...]) -> None:
    """Refuse attained bounds (A, T, m, 2), less their rounding, outside proved ones.

    Raises:
        FailedError: One is outside, or no number.
    """
    wrong = ~(inner <= outer)
    if wrong.any():
        output = outputs[int(np.argwhere(wrong)[0, 2])]
        beyond = np.nanmax(np.where(wrong, inner - outer, np.nan))
        what = f"attained bounds of {output} lie outside the proved ones by {beyond:.3g}"
        raise FailedError(f"the proof is wrong: {what}", "keep the case and report it")


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
