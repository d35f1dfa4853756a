"""Incremental dynamic analysis of a frame that yields, over the α-cuts of its inputs.

The demand of a limit is the peak of the limited output over the limit. Over the scale of a record
it is neither proportional nor monotone (Vamvatsikos and Cornell, Earthquake Engng Struct. Dyn. 31,
491, 2002), so that a limit is exceeded on a set of scales. Structures of each cut are moved at a
grid of scales, which is bisected where the result changes. That a structure exceeds the limit is
attained. That no structure does, or that all do, is estimated: a compass search (Kolda, Lewis and
Torczon, SIAM Review 45, 385, 2003) has tried to refute it. The sets of nested cuts are nested,
because they belong to the same responses.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from alphacut.base.arrays import Array, Mask
from alphacut.base.errors import checked_number, require
from alphacut.base.number_text import range_text
from alphacut.base.progress_bar import Progress
from alphacut.frame.analyses.answer import Answer, Row
from alphacut.frame.analyses.suites import scaled_records
from alphacut.frame.boxes import ALPHA, Boxes, boxes
from alphacut.frame.dynamics.yielding import YieldingFlow
from alphacut.frame.methods.sampled import SKIPPED, spread_points
from alphacut.frame.records.history import Accelerogram
from alphacut.frame.structures.storey import StoreyFrame, yields
from alphacut.fuzzy import FuzzyNumber
from alphacut.fuzzy.result import Nature

GRID_RATIO = 1.1
"""Ratio of neighbouring scales of the grid (tuned: an exceedance that begins and ends between two
neighbours may be missed; a larger ratio saves time in proportion to its logarithm)."""
RESOLUTION = 0.01
"""Relative width to which changes are bisected (tuned: it is the error of critical measures)."""
SOME = 0
ALL = 1
"""Indices of the largest demand of a cut, which tells whether some structure exceeds the limit, and
of the smallest demand, which tells whether all structures do."""


@dataclass(eq=False)
class IncrementalAnalysis:
    """Responses of a frame that yields under a scaled record, and the loop that chooses them.

    Args:
        model: The frame at rest, moved by the record alone.
        cuts: α-cuts of the fuzzy inputs.
        limits: Names of outputs and limits of their magnitudes, in SI units.
        duration: Length of the responses, in s.
        step: Step at which outputs are read, in s.
        greatest_scale: Largest scale of the record.
        events: For each event that any of several limits is exceeded, the indices of these limits.

    Attributes:
        moved: By scale, the inputs of the structures that were moved, shape (structures, inputs),
            and their demands, shape (structures, limits and events).
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
        """Compute responses until searches change no more at which scales limits are exceeded.

        A demand is the peak of an output over its limit; the demand of an event is the largest of
        its limits. Structures spread over the cuts are moved at a geometric grid of scales of the
        record. Then three steps are repeated: structures that are extreme at one scale are moved
        at the neighbouring scales; intervals of scales between which exceedance begins or ends are
        bisected; and where no exceedance (or no structure that keeps the limit) has been found, it
        is searched for at the scales that come nearest to it. All responses are kept in
        `self.moved`.

        Args:
            progress: Called with the completed fraction; up to one half, since the effort of the
                searches is not known beforehand.

        Returns:
            The scales, rising, shape (scales,), and the largest and the smallest demand of the
            structures of each cut that were moved, shape (2, levels, limits and events, scales).
            They are infinite for collapses. At the first scale all structures that were moved are
            elastic and keep every limit.

        Raises:
            RefusedError: A response does not exist.
            StepError: A response has too many events in a step, or its energy is not in balance.
        """
        structures = self._spread_structures()
        grid = self._grid(structures)
        for done, scale in enumerate(grid):
            self._move(scale, structures)
            if progress:
                progress(done / len(grid) / 2)

        searched: set[tuple[float, int, int, int]] = set()
        while True:
            scales = sorted(self.moved)
            # Structures that are extreme at one scale are tried at the neighbouring ones.
            for pair in pairwise(scales):
                extremes = np.concatenate([self._extremes(scale)[1] for scale in pair])
                for scale in pair:
                    self._move(scale, extremes)
            demands = np.stack([self._extremes(scale)[0] for scale in scales], axis=-1)
            # All sets of scales begin with one at which nothing is exceeded.
            if np.any(demands[SOME, ..., 0] > 1):
                # A structure found since then exceeds a limit at the first scale.
                self._move(scales[0] / GRID_RATIO, self.cuts.nominal)
                continue

            # What has been found: a structure that exceeds the limit, and one that does not. Scales
            # between which this changes are bisected.
            is_found = np.stack([demands[SOME] > 1, demands[ALL] <= 1])
            is_change = (is_found[..., 1:] != is_found[..., :-1]).any(axis=(0, 1, 2))
            is_wide = np.divide(scales[1:], scales[:-1]) > 1 + RESOLUTION
            wide_changes = np.flatnonzero(is_change & is_wide)
            for k in wide_changes:
                self._move(float(np.sqrt(scales[k] * scales[k + 1])), self.cuts.nominal)
            if len(wide_changes):
                continue

            # Where nothing has been found, the scales nearest to it are searched: the local maxima
            # over the scales of the largest demand, and of minus the smallest one.
            closeness = np.stack([demands[SOME], -demands[ALL]])
            closeness[is_found] = -np.inf
            padded = np.pad(closeness, [(0, 0)] * 3 + [(1, 1)], constant_values=-np.inf)
            is_peak = (closeness >= padded[..., :-2]) & (closeness >= padded[..., 2:])
            doubtful = np.argwhere(is_peak & ~is_found)
            to_search = {(scales[k], side, level, event) for side, level, event, k in doubtful}
            to_search -= searched
            if not to_search:
                return np.array(scales), demands
            for scale, side, level, event in sorted(to_search):
                self._search(scale, side, level, event)
            searched |= to_search

    @property
    def n_demands(self) -> int:
        """Number of limits and events."""
        return len(self.limits) + len(self.events)

    def peaks_at(self, scales: Array) -> Array:
        """Return the largest and smallest demand of structures spread over the cuts.

        A demand is the peak of an output over its limit. The structures are the nominal one and
        some inside, on faces and at corners of each cut. Other structures of a cut may have larger
        or smaller demands.

        Args:
            scales: Scales of the record, shape (scales,).

        Returns:
            Demands, infinite for collapses, shape (limits and events, 2, levels, scales): on the
            second axis first the largest, then the smallest.

        Raises:
            RefusedError: A response does not exist.
            StepError: A response has too many events in a step, or its energy is not in balance.
        """
        structures = self._spread_structures()
        for scale in map(float, scales):
            self._move(scale, structures)
        # Shape (2, levels, limits and events, scales).
        found = np.stack([self._extremes(float(scale))[0] for scale in scales], axis=-1)
        return np.moveaxis(found, 2, 0)

    def elastic_scales(self, points: Array) -> Array:
        """Return the scales of the record at which structures would reach limits if elastic.

        The record must not be zero throughout.

        Args:
            points: Inputs of the structures in SI units, shape (structures, inputs).

        Returns:
            Scales, shape (structures, 1 + limits). The first column is the scale at which the first
            storey yields; the others belong to the limits in their order. For an output that is
            zero in elastic structures, such as a residual drift, it is the scale at which some
            storey would have five times its yield drift.
        """
        # At a millionth of the record nothing yields, so that peaks are proportional to the scale.
        small_scale = 1e-6
        n_storeys = self.model.floors
        storeys = [(f"ductility{z}", 1.0) for z in range(1, n_storeys + 1)]
        # Ductilities of all storeys tell at which scale the first one yields.
        demands = self._peaks_over_limits(small_scale, points, [*storeys, *self.limits])
        ductility = demands[:, :n_storeys].max(axis=1, keepdims=True)
        demands = demands[:, n_storeys:]
        # An elastic response has no residual drift, for example. Such a limit is taken to be
        # reached at a ductility of 5 (tuned; it only determines the largest scale).
        demands = np.where(demands > 0, demands, ductility / 5.0)
        return np.asarray(small_scale / np.hstack([ductility, demands]))

    def _grid(self, structures: Array) -> list[float]:
        """Return rising scales in geometric progression, each at most 1.1 times the one before.

        They are two or more, and end with the largest scale of the analysis. At the first one the
        given structures are elastic and keep every limit.

        Args:
            structures: Inputs of the structures in SI units, shape (structures, inputs).
        """
        # The first scale is a grid step below the one at which the first structure yields or
        # exceeds a limit.
        first = self.elastic_scales(structures).min() / GRID_RATIO
        # At least two scales, even if the largest scale moves the structure elastically.
        first = min(first, self.greatest_scale / 2)
        count = int(np.ceil(np.log(self.greatest_scale / first) / np.log(GRID_RATIO))) + 1
        return list(map(float, np.geomspace(first, self.greatest_scale, count)))

    def _peaks_over_limits(
        self, scale: float, points: Array, limits: Sequence[tuple[str, float]]
    ) -> Array:
        """Return the largest magnitudes of outputs over their limits, infinite for collapses.

        Args:
            scale: Scale of the record.
            points: Inputs of the structures in SI units, shape (structures, inputs).
            limits: Names of outputs and their limits, which may repeat an output.

        Returns:
            Demands, shape (structures, limits).

        Raises:
            RefusedError: An output is unknown, or a response does not exist.
            StepError: A response has too many events in a step, or its energy is not in balance.
        """
        record = self.model.ground
        assert record is not None
        outputs = tuple(dict.fromkeys(output for output, _ in limits))
        ground = Accelerogram(record.step, scale * record.samples)
        # Each output is computed once, however many limits it has.
        model = replace(self.model, ground=ground, outputs=outputs)
        flow = YieldingFlow(model, self.cuts.names, self.duration, self.step)
        peaks = flow.values_and_peaks(points, takes_collapse=True)[1]
        columns = [peaks[:, outputs.index(output)] / limit for output, limit in limits]
        return np.column_stack(columns)

    def _spread_structures(self) -> Array:
        """Return inputs, in SI units, of the nominal structure and of others spread over each cut.

        These are up to 48 for each level: inside the cut, on its faces and at its corners. The
        shape is (structures, inputs), without repetitions and sorted.
        """
        cuts = self.cuts
        structures = [self.cuts.nominal[np.newaxis]]
        for level, (low, high) in enumerate(zip(cuts.lower, cuts.upper, strict=True)):
            # 16 points inside the cut, on its faces, and of its corners (tuned: more are slower and
            # leave less to the searches).
            lower, upper = cuts.unit_ends(level)
            unit = spread_points(lower, upper, count=16, skip=SKIPPED * (level + 1))
            structures.append(np.clip(cuts.to_physical(unit), low, high))
        return np.asarray(np.unique(np.concatenate(structures), axis=0))

    def _move(self, scale: float, points: Array) -> None:
        """Compute the demands of structures at a scale and add them to `self.moved[scale]`.

        `self.moved[scale]` is a pair of arrays: inputs, shape (structures, inputs), and peaks over
        limits, shape (structures, limits and events). It is made if it is missing.

        Args:
            scale: Scale of the record.
            points: Inputs in SI units, shape (…, inputs). Structures whose demands are known at
                this scale, and repetitions, are left out.
        """
        n_inputs = len(self.cuts.names)
        nothing = np.empty((0, n_inputs)), np.empty((0, self.n_demands))
        moved, demands = self.moved.get(scale, nothing)
        # Rows are compared by their bits: the same structure always has the same coordinates.
        known_rows = {row.tobytes() for row in moved}
        # Searches propose the same corners many times.
        points = np.unique(points.reshape(-1, n_inputs), axis=0)
        points = points[[row.tobytes() not in known_rows for row in points]]
        if len(points):
            new = self._peaks_over_limits(scale, points, self.limits)
            # An event of several limits occurs as soon as the largest of their demands exceeds 1.
            for event in self.events:
                new = np.column_stack([new, new[:, list(event)].max(axis=1)])
            self.moved[scale] = np.vstack([moved, points]), np.vstack([demands, new])

    def _extremes(self, scale: float) -> tuple[Array, Array]:
        """Return the largest and the smallest demand in each cut at a scale, and their inputs.

        Args:
            scale: Scale of the record, at which structures of each cut have been moved.

        Returns:
            Demands, first the largest and then the smallest, infinite for collapses, shape (2,
            levels, limits and events); and the inputs that have them, shape (2, levels, limits and
            events, inputs).
        """
        points, demands = self.moved[scale]
        lower = self.cuts.lower[:, np.newaxis]
        upper = self.cuts.upper[:, np.newaxis]
        is_inside = (points >= lower) & (points <= upper)
        inside = np.all(is_inside, axis=-1, keepdims=True)  # (levels, structures, 1)
        largest = np.where(inside, demands, -1.0).argmax(axis=1)
        # Structures outside the cut count as +∞. A collapse inside counts as the largest finite
        # number, so that it is taken before them.
        finite = np.minimum(demands, np.finfo(float).max)
        smallest = np.where(inside, finite, np.inf).argmin(axis=1)
        rows = np.stack([largest, smallest])
        return demands[rows, np.arange(demands.shape[1])], points[rows]

    def _search(self, scale: float, side: int, level: int, event: int) -> None:
        """Search for a larger or smaller demand in a cut at a scale by a compass search.

        From the structure with the most extreme demand known, steps are made along each input in
        both directions; they are halved when they gain next to nothing, and the search ends below
        1/32 of the width of the cut. All responses are added to `self.moved`.

        Args:
            scale: Scale of the record.
            side: 0 (`SOME`) for the largest, 1 (`ALL`) for the smallest demand.
            level: Index of the cut.
            event: Index of the limit or event; events follow the limits.
        """
        low = self.cuts.lower[level]
        high = self.cuts.upper[level]
        directions = np.concatenate([np.diag(high - low), np.diag(low - high)])
        demands, points = self._extremes(scale)
        # Steps from 1/4 to 1/32 of the width of the cut (tuned: smaller ones gain little).
        size = 1 / 4
        while size >= 1 / 32:
            before = demands[side, level, event]
            point = points[side, level, event]
            self._move(scale, np.clip(point + size * directions, low, high))
            demands, points = self._extremes(scale)
            if np.isclose(demands[side, level, event], before, rtol=RESOLUTION / 10):
                size /= 2


@dataclass(frozen=True, eq=False)
class Increments:
    """Demands of a frame that yields over the intensity measure of one record.

    Args:
        measure: Measures at which structures were moved, rising, shape (measures,). At the first
            one all structures that were moved are elastic and keep every limit.
        demands: Largest and smallest peak over limit of the structures that were moved, by the name
            of the limit or event, shape (2, levels, measures); infinite for collapses, or NaN in
            results that were read from files.
    """

    measure: Array
    demands: dict[str, Array]

    def is_exceeded(self, name: str) -> Mask:
        """Return whether some structure, and whether all structures exceed a limit.

        It is known of the structures that were moved only. A collapse exceeds every limit.

        Args:
            name: Name of the limit, or of the event that any of several limits is exceeded.

        Returns:
            Mask, shape (2, levels, measures), first for some and then for all structures of the
            α-cut.

        Raises:
            KeyError: There is no such limit or event.
        """
        return ~(self.demands[name] <= 1)


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class ScaledPeaks(Answer):
    """Largest and smallest peaks found at scales of each record of a suite.

    Args:
        alpha: Levels, shape (levels,).
        scales: Scales of the records, shape (scales,).
        peaks: Largest and smallest peak of the structures moved, by record and output, in SI units,
            shape (2, levels, scales); infinite for collapses.
        units: SI units of the outputs.
    """

    key = "incremental"
    title = "How do peaks grow with the scale of a record?"
    alpha: Array
    scales: Array
    peaks: dict[str, dict[str, Array]]
    units: dict[str, str]

    def text_rows(self) -> Iterator[Row]:
        """Yield a row for each record.

        The columns are the name of the record; for each output the range from the smallest to the
        largest peak that was found at the largest scale on the lowest level; and the guarantee.
        """
        for record, by_output in self.peaks.items():
            texts = []
            for output, (largest, smallest) in by_output.items():
                low = float(smallest[0, -1])
                high = float(largest[0, -1])
                ends = range_text(low, high, Nature.ATTAINED)
                # An output without a unit, such as a ductility, leaves a blank.
                texts.append(f"{output} {ends} {self.units[output]}".strip())
            title = f"peaks at scale {self.scales[-1]:g}"
            yield {"record": record, title: "; ".join(texts), "nature": str(Nature.ATTAINED)}

    def number_rows(self) -> Iterator[Row]:
        """Yield a row of numbers for each record, output, level and scale, in this order.

        The columns are record, output, its SI unit, α, scale, and the smallest ("least") and
        largest ("greatest") peak that was found, infinite for a collapse.
        """
        for record, by_output in self.peaks.items():
            for output, peaks in by_output.items():
                head: Row = {"record": record, "output": output, "unit": self.units[output]}
                measure = {"scale": self.scales}
                yield from curve_rows(head, self.alpha, measure=measure, demands=peaks)

    def words(self) -> str:
        """Return a sentence on what the peaks belong to."""
        return (
            "These are peaks of the structures that were computed; others of the cut may have"
            " smaller or larger ones. A collapse has an infinite peak."
        )


def curve_rows(
    head: Row, alpha: Array, *, measure: Mapping[str, Array], demands: Array
) -> Iterator[Row]:
    """Yield rows of the largest and smallest peak over the measure of a record.

    There is a row for each level and measure, in this order. After the given columns it has α, the
    measure, and the smallest ("least") and the largest peak ("greatest").

    Args:
        head: First columns of each row.
        alpha: Levels, shape (levels,).
        measure: Measures of shape (measures,) by the title of their column; exactly one item.
        demands: Largest and smallest peak, shape (2, levels, measures).

    Raises:
        ValueError: `measure` has not one item.
    """
    largest, smallest = demands
    ((title, measures),) = measure.items()
    for level, k in np.ndindex(largest.shape):
        yield {
            **head,
            "α": alpha[level],
            title: measures[k],
            "least": smallest[level, k],
            "greatest": largest[level, k],
        }


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
        model: A frame whose columns yield. The peaks of others are proportional to the scale.
        inputs: Fuzzy parameters by name, in SI units.
        suite: Ground accelerations; each replaces the record of the frame.
        scales: Positive factors of the records, in any order; repetitions count once.
        duration: Longest response, in s; a response ends five natural periods after its record.
        step: Step at which outputs are read, in s.
        alpha: Levels, rising within [0, 1].

    Returns:
        The largest and smallest peak, by record and output, that the nominal structure and others
        spread over each cut have, shape (2, levels, scales), over the rising scales; infinite for a
        collapse. They are attained; other structures may go farther.

    Raises:
        RefusedError: The columns do not yield, there is no scale or one is not positive, there is
            no record or one is zero throughout, or inputs or levels are not allowed.
        StepError: A response has too many events in a step, or its energy is not in balance.
    """
    value = "of another structure"
    allowed = "columns that yield"
    require(yields(model), "incremental", value=value, allowed=allowed)
    require(len(scales) > 0, "scales", value=None, allowed="one positive number or more")
    tried = np.unique([checked_number("scale", scale, positive=True) for scale in scales])
    outputs = list(map(str, model.outputs))
    # With limits of 1 in SI units, demands are peaks.
    limits = [(output, 1.0) for output in outputs]
    cuts = boxes(inputs, alpha)
    peaks: dict[str, dict[str, Array]] = {}
    for record in scaled_records(model, suite, duration=duration, step=step):
        frame = replace(model, ground=record.ground)
        analysis = IncrementalAnalysis(frame, cuts, limits, record.duration, step)
        peaks[record.name] = dict(zip(outputs, analysis.peaks_at(tried), strict=True))
    units = {output: model.unit_of(output) for output in outputs}
    return ScaledPeaks(alpha=np.array(cuts.alpha), scales=tried, peaks=peaks, units=units)
