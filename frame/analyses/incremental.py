"""Incremental dynamic analysis of a frame that yields, over the α-cuts of its inputs.

The demand of a limit is the peak over the limit. Over the scale of a record it is neither
proportional nor monotone (Vamvatsikos, Cornell 2002), so that a limit is exceeded on a set of
scales. Structures of each cut are moved at a grid of scales, which is bisected where the answer
changes. An exceedance is attained by the structure that shows it; that no structure exceeds the
limit, or that all do, is estimated: a compass search (Kolda, Lewis, Torczon 2003) has tried to
refute it at the last such scale. Sets of nested cuts are nested, as they are of the same motions.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import checked_number, require
from alphacut.base.number_text import Table, range_text
from alphacut.base.progress_bar import Progress
from alphacut.frame.analyses.answer import Answer, Record
from alphacut.frame.analyses.suites import scaled_records
from alphacut.frame.boxes import ALPHA, Boxes, boxes
from alphacut.frame.dynamics.yielding import YieldingFlow
from alphacut.frame.methods.sampled import SKIPPED, spread_points
from alphacut.frame.records.history import Accelerogram
from alphacut.frame.structures.storey import StoreyFrame, yields
from alphacut.fuzzy import FuzzyNumber
from alphacut.fuzzy.result import Nature

GRID_RATIO = 1.1
"""Ratio of neighbouring scales of the grid: what happens within a step of it may be missed."""
RESOLUTION = 0.01
"""Relative width to which changes are bisected."""
SPREAD = 16
"""Structures of a kind on each level that are moved at every scale of the grid."""
SEARCHES = 0.035
"""Motions of searches over those on the grid, by inputs and events, roughly."""
FIRST_STEP, LAST_STEP = 1 / 4, 1 / 32
"""Steps of a compass search, as fractions of the width of the cut."""
ELASTIC_SCALE = 1e-6
"""Scale at which nothing yields, for what is proportional up to the first yielding."""
UNYIELDING_DUCTILITY = 5.0
"""Ductility that stands for a limit of what elastic motions lack, as residual drifts."""
SOME, ALL = 0, 1  # sides: the greatest demand of a cut, and the least one


@dataclass(eq=False)
class IncrementalAnalysis:
    """Motions of a frame that yields under a scaled record, and the loop that chooses them.

    Args:
        model: The frame at rest, moved by the record alone.
        cuts: α-cuts of the fuzzy inputs.
        limits: Outputs and limits of their magnitudes, in SI.
        duration: Length of the motions, in s.
        step: Step at which outputs are read, in s.
        greatest_scale: Scale up to which it goes.
        events: Indices of the limits of each event that any of several is exceeded.
    """

    model: StoreyFrame
    cuts: Boxes
    limits: Sequence[tuple[str, float]]
    duration: float
    step: float
    greatest_scale: float = 1.0
    events: Sequence[Sequence[int]] = ()
    moved: dict[float, tuple[Array, Array]] = field(init=False, default_factory=dict)

    def run(self, progress: Progress | None = None) -> tuple[Array, Array]:
        """Return scales (X,), rising, and the demands found there, shape (2, A, E, X).

        These are the greatest and the least one of the structures of each cut that were moved,
        infinite where they collapse. The E demands are those of the limits, then of the events.
        At the first scale all structures moved are elastic and keep every limit.
        """
        structures, searched = self._spread_structures(), set[tuple[float, int, int, int]]()
        grid = self._grid(structures)
        for done, scale in enumerate(grid):
            self._move(scale, structures)
            if progress:
                progress(done / len(grid) / 2)
        while True:
            scales = sorted(self.moved)
            for pair in pairwise(scales):  # what is extreme at one scale is tried at the next ones
                extremes = np.concatenate([self._extremes(scale)[1] for scale in pair])
                for scale in pair:
                    self._move(scale, extremes)
            demands = np.stack([self._extremes(scale)[0] for scale in scales], axis=-1)
            if np.any(demands[SOME, ..., 0] > 1):  # of a structure found since
                self._move(scales[0] / GRID_RATIO, self.cuts.nominal)
                continue
            # by sides: a structure exceeds the limit, and one does not
            is_found = np.stack([demands[SOME] > 1, demands[ALL] <= 1])
            changes = is_found[..., 1:] != is_found[..., :-1]  # (2, A, E, X − 1)
            ratios = np.divide(scales[1:], scales[:-1])
            wide = np.flatnonzero(changes.any(axis=(0, 1, 2)) & (ratios > 1 + RESOLUTION))
            for k in wide:
                self._move(float(np.sqrt(scales[k] * scales[k + 1])), self.cuts.nominal)
            if len(wide):
                continue
            # search where none is found, but nearest to it among such neighbours
            closeness = np.stack([demands[SOME], -demands[ALL]])
            closeness[is_found] = -np.inf
            padded = np.pad(closeness, [(0, 0)] * 3 + [(1, 1)], constant_values=-np.inf)
            is_peak = (closeness >= padded[..., :-2]) & (closeness >= padded[..., 2:])
            doubtful = np.argwhere(is_peak & ~is_found)
            todo = {(scales[x], side, level, event) for side, level, event, x in doubtful}
            todo -= searched
            if not todo:
                return np.array(scales), demands
            for scale, side, level, event in sorted(todo):
                self._search(scale, side, level, event)
            searched |= todo

    @property
    def n_demands(self) -> int:
        """Number of limits and events."""
        return len(self.limits) + len(self.events)

    def foresee(self) -> tuple[float, float]:
        """Return about how many motions a run takes, and how many seconds.

        Motions are timed in the middle and at the end of the scales, as they take longer the more
        often columns yield.
        """
        structures = self._spread_structures()
        grid = self._grid(structures)
        searched = SEARCHES * len(self.cuts.names) * self.n_demands
        rounds = (1 + searched) * len(grid)  # of all structures
        timed = replace(self)  # which keeps these motions to itself
        timed._move(grid[0], structures)  # compiles, and may be the first motion of the process
        start = time.perf_counter()
        for scale in (grid[len(grid) // 2], grid[-1]):
            timed._move(scale, structures)
        return rounds * len(structures), rounds * (time.perf_counter() - start) / 2

    def peaks_at(self, scales: Array) -> Array:
        """Return peaks over limits of spread structures, shape (L, 2, A, X), at scales (X,)."""
        structures = self._spread_structures()
        for scale in map(float, scales):
            self._move(scale, structures)
        found = np.stack([self._extremes(float(scale))[0] for scale in scales], axis=-1)
        return np.moveaxis(found, 2, 0)

    def elastic_scales(self, points: Array) -> Array:
        """Return the scales at which structures (S, d) would reach limits if they were elastic.

        Shape (S, 1 + L): the first column has the scale at which a storey yields.
        """
        n_storeys = self.model.floors
        storeys = [(f"ductility{z}", 1.0) for z in range(1, n_storeys + 1)]
        demands = self._peaks_over_limits(ELASTIC_SCALE, points, [*storeys, *self.limits])
        ductility, demands = np.split(demands, [n_storeys], axis=1)
        ductility = ductility.max(axis=1, keepdims=True)
        demands = np.where(demands > 0, demands, ductility / UNYIELDING_DUCTILITY)
        return np.asarray(ELASTIC_SCALE / np.hstack([ductility, demands]))

    def _grid(self, structures: Array) -> list[float]:
        """Return the scales of the grid; at the first one all structures are elastic."""
        first, last = self.elastic_scales(structures).min() / GRID_RATIO, self.greatest_scale
        first = min(first, last / 2)
        count = int(np.ceil(np.log(last / first) / np.log(GRID_RATIO))) + 1
        return [*map(float, np.geomspace(first, last, count))]

    def _peaks_over_limits(
        self, scale: float, points: Array, limits: Sequence[tuple[str, float]]
    ) -> Array:
        """Return peaks over limits (S, L) at points (S, d), infinite of motions that collapse."""
        record, outputs = self.model.ground, tuple(dict.fromkeys(output for output, _ in limits))
        assert record is not None
        ground = Accelerogram(record.step, scale * record.samples)
        model = replace(self.model, ground=ground, outputs=outputs)
        flow = YieldingFlow(model, self.cuts.names, self.duration, self.step)
        peaks = flow.values_and_peaks(points, takes_collapse=True)[1]
        return np.column_stack([peaks[:, outputs.index(x)] / limit for x, limit in limits])

    def _spread_structures(self) -> Array:
        """Return the nominal structure and others on each level, shape (S, d)."""
        cuts, structures = self.cuts, [self.cuts.nominal[None]]
        for level, (low, high) in enumerate(zip(cuts.lower, cuts.upper, strict=True)):
            unit = spread_points(*cuts.unit_ends(level), SPREAD, SKIPPED * (level + 1))
            structures.append(np.clip(cuts.to_physical(unit), low, high))
        return np.asarray(np.unique(np.concatenate(structures), axis=0))

    def _move(self, scale: float, points: Array) -> None:
        """Move those of the structures (…, d) that were not moved at this scale yet."""
        d, n_events = len(self.cuts.names), self.n_demands
        moved, demands = self.moved.get(scale, (np.empty((0, d)), np.empty((0, n_events))))
        known_rows = {row.tobytes() for row in moved}
        points = np.unique(points.reshape(-1, d), axis=0)
        if len(points := points[[row.tobytes() not in known_rows for row in points]]):
            new = self._peaks_over_limits(scale, points, self.limits)
            of_events = [new[:, [*event]].max(axis=1) for event in self.events]
            new = np.column_stack([new, *of_events])
            self.moved[scale] = np.vstack([moved, points]), np.vstack([demands, new])

    def _extremes(self, scale: float) -> tuple[Array, Array]:
        """Return greatest and least demand (2, A, E) at a scale, and their inputs (2, A, E, d)."""
        points, demands = self.moved[scale]
        lower, upper = self.cuts.lower[:, None], self.cuts.upper[:, None]
        is_inside = (points >= lower) & (points <= upper)
        inside = np.all(is_inside, axis=-1, keepdims=True)  # (A, S, 1)
        greatest = np.where(inside, demands, -1.0).argmax(axis=1)
        finite = np.minimum(demands, np.finfo(float).max)  # of collapses, before those outside
        rows = np.stack([greatest, np.where(inside, finite, np.inf).argmin(axis=1)])
        return demands[rows, np.arange(demands.shape[1])], points[rows]

    def _search(self, scale: float, side: int, level: int, event: int) -> None:
        """Search the extreme demand of an event in a cut at a scale, by compass search."""
        low, high, size = self.cuts.lower[level], self.cuts.upper[level], FIRST_STEP
        directions = np.concatenate([np.diag(high - low), np.diag(low - high)])
        demands, points = self._extremes(scale)
        while size >= LAST_STEP:
            before, point = demands[side, level, event], points[side, level, event]
            self._move(scale, np.clip(point + size * directions, low, high))
            demands, points = self._extremes(scale)
            if np.isclose(demands[side, level, event], before, rtol=RESOLUTION / 10):
                size /= 2


@dataclass(frozen=True, eq=False)
class Increments:
    """Demands of a frame that yields over a measure of one record.

    Args:
        measure: Values of the measure at which structures were moved, rising, shape (X,); at the
            first one all structures moved are elastic and keep every limit.
        demands: Greatest and least peak over limit of the structures moved, by the limit's name,
            shape (2, A, X); nan where they collapse.
    """

    measure: Array
    demands: dict[str, Array]


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class ScaledPeaks(Answer):
    """Greatest and least peaks found over the scales of each record of a suite.

    Args:
        alpha: Levels, shape (A,).
        scales: Scales of the records, shape (X,).
        peaks: Greatest and least peak of the structures moved by record and output, in SI, shape
            (2, A, X); infinite where they collapse.
        units: SI units of the outputs.
    """

    key = "incremental"
    title = "How do peaks grow with the scale of a record?"
    alpha: Array
    scales: Array
    peaks: dict[str, dict[str, Array]]
    units: dict[str, str]

    def table(self) -> Table:
        """Return the peaks at the largest scale, on the lowest level."""
        head = ("record", f"peaks at scale {self.scales[-1]:g}", "nature")
        rows: list[tuple[str, ...]] = []
        for record, by_output in self.peaks.items():
            texts = []
            for output, (high, low) in by_output.items():
                ends = range_text(float(low[0, -1]), float(high[0, -1]), Nature.ATTAINED)
                texts.append(f"{output} {ends} {self.units[output]}".strip())
            rows.append((record, "; ".join(texts), Nature.ATTAINED))
        return Table(head, rows)

    def records(self) -> list[Record]:
        """Return a row for each record, output, level and scale."""
        rows: list[Record] = []
        for record, by_output in self.peaks.items():
            for output, (high, low) in by_output.items():
                for level, column in np.ndindex(low.shape):
                    rows.append({"record": record, "output": output, "unit": self.units[output]})
                    rows[-1] |= {"α": self.alpha[level], "scale": self.scales[column]}
                    rows[-1] |= {"least peak": low[level, column]}
                    rows[-1] |= {"greatest peak": high[level, column]}
        return rows

    def words(self) -> str:
        """Return what the peaks are of."""
        return (
            "Peaks of the structures that were moved; others of the cut may have smaller or greater"
            " ones. A collapse has an infinite peak."
        )


def incremental(
    model: StoreyFrame,
    inputs: Mapping[str, FuzzyNumber],
    suite: Sequence[Accelerogram],
    scales: Sequence[float],
    *,
    duration: float,
    step: float,
    alpha: Sequence[float] = ALPHA,
) -> ScaledPeaks:
    """Return the peaks of a frame that yields at scales of each record of a suite.

    Args:
        model: A frame whose columns yield. Of others peaks are proportional to the scale.
        inputs: Fuzzy parameters by name, in SI units.
        suite: Records, as of `read_suite`; each takes the place of the frame's own.
        scales: Factors of the records, positive.
        duration: Longest motion, in s; a motion ends five natural periods after its record.
        step: Step at which outputs are read, in s.
        alpha: Levels.

    Raises:
        RefusedError: The columns do not yield, or a scale is not positive.
    """
    value, allowed = "of another structure", "columns that yield"
    require(yields(model), "incremental", value=value, allowed=allowed)
    tried = np.unique(np.array([checked_number("scale", x, positive=True) for x in scales]))
    records = scaled_records(model, suite, duration=duration, step=step)
    outputs, peaks = [*map(str, model.outputs)], dict[str, dict[str, Array]]()
    cuts = boxes(inputs, alpha)
    for record in records:
        frame = replace(model, ground=record.ground)
        limits = [(output, 1.0) for output in outputs]
        analysis = IncrementalAnalysis(frame, cuts, limits, record.duration, step)
        peaks[record.name] = dict(zip(outputs, analysis.peaks_at(tried), strict=True))
    units = {output: model.unit_of(output) for output in outputs}
    return ScaledPeaks(alpha=np.array(cuts.alpha), scales=tried, peaks=peaks, units=units)
