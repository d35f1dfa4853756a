"""Fuzzy peaks: the largest magnitude of each output over the motion, as intervals by level.

At the nodes no motion peaks higher than its envelope, and each has at least the magnitude that its
band is away from zero; what the steps between nodes may add counts as error.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.progress_bar import Progress
from alphacut.frame.boxes import ALPHA
from alphacut.frame.dynamics.yielding import AT_NODES
from alphacut.frame.envelope import Envelope, within_steps
from alphacut.frame.methods.auto import Auto
from alphacut.frame.propagation import envelope
from alphacut.frame.structures.model import StructureModel
from alphacut.frame.structures.quantities import output_of
from alphacut.fuzzy import FuzzyNumber
from alphacut.fuzzy.result import Bounds, Ends, Nature

PEAK_ERROR = 5e-3
"""Error of the peaks of limited outputs that is aimed at, as a fraction of each."""
WIDENING = 0.01
"""Fraction of a peak from which on it is said that a smaller step would narrow its bound."""
UNBOUNDED = {"lower": -np.inf, "upper": np.inf, "reached": -np.inf}
UNBOUNDED |= {"least_lower": -np.inf, "least_upper": np.inf}
"""What an unknown bound of a peak is, if the peak is no least value."""


@dataclass(frozen=True, eq=False)
class Peak:
    """Bounds of the largest magnitude of an output over time, or of its largest or least value.

    A least value ("min q3") has its own sign: farther out is lower, and its peak over a cut that
    is farthest out is bounded by `lower`.

    Args:
        alpha: Levels, rising, shape (A,).
        lower: Lower end of the peaks at the nodes over each cut, as the envelope bounds it, shape
            (A,). A bound that is not known is nan when it is given, and infinite afterwards.
        upper: Upper end of them, shape (A,).
        error: Distance by which peaks may lie outside `lower` and `upper`: that of the envelope and
            of the steps between nodes; 0 of guaranteed bounds, which contain it.
        reached: Peak that some motion in the cut is known to reach, the farthest out; −∞ (of a
            least value ∞) where none is known.
        least_lower: Bound of the peaks of all motions in the cut, proved where the bounds are: none
            is nearer to zero, or of values less far out.
        least_upper: A peak that some motion in the cut is known not to exceed; infinite where none
            is known.
        nature: Guarantee of the bounds.
        between_nodes: Part of the bound farthest out on the lowest level that motions may add
            within the steps between nodes; it falls with the square of the step.
        side: "" of a magnitude, "max" of the largest value and "min" of the least one.
        reached_at: Inputs in SI, by name, of the motion that reaches the peak on the lowest level;
            empty where none is known.
        encloses: Name of a set of inputs that the box of their cuts encloses, as "the learned
            set"; empty where all of the box counts. Then no motion is known to belong to the set.
    """

    alpha: Array
    lower: Array
    upper: Array
    error: Array
    reached: Array
    least_lower: Array
    least_upper: Array
    nature: Nature
    between_nodes: float = 0.0
    side: Literal["", "max", "min"] = ""
    reached_at: Mapping[str, float] = field(default_factory=dict)
    encloses: str = ""
    proved: Array = field(init=False)
    """No motion's peak lies farther out, shape (A,); infinite where nothing is known."""

    def __post_init__(self) -> None:
        """Take unknown bounds as infinite, on the side on which they say nothing."""
        sign, swapped = (-1, ENDS_OF_LEAST) if self.is_least else (1, {})
        for name, unknown in UNBOUNDED.items():
            values = np.asarray(getattr(self, swapped.get(name, name)), float)
            known = np.where(np.isnan(values), sign * unknown, values)
            object.__setattr__(self, swapped.get(name, name), known)
        object.__setattr__(self, "proved", 0.0 + sign * self.greatest_bounds.upper)

    @property
    def is_least(self) -> bool:
        """Whether it is the least value of an output."""
        return self.side == "min"

    @property
    def outwards(self) -> Peak:
        """The peak; of a least value that of −q, which is its largest value."""
        return mirrored(self) if self.is_least else self

    @property
    def far_end(self) -> Array:
        """Bound on each level of the peaks farthest out: the upper one, or that of least values."""
        return self.lower if self.is_least else self.upper

    @property
    def greatest_bounds(self) -> Ends:
        """A lower and an upper bound of the greatest peak, of `outwards`, shape (A,) each."""
        if self.is_least:
            return self.outwards.greatest_bounds
        # where bounds are only attained other motions may peak higher
        beyond = np.inf if self.nature is Nature.ATTAINED else self.error
        return Ends(self.reached, self.upper + beyond)

    @property
    def least_bounds(self) -> Ends:
        """A lower and an upper bound of the least peak, of `outwards`, shape (A,) each."""
        if self.is_least:
            return self.outwards.least_bounds
        smallest = -np.inf if self.side else 0.0  # of any peak
        beyond = np.inf if self.nature is Nature.ATTAINED else self.error
        lower_bound = np.maximum(np.maximum(self.lower - beyond, smallest), self.least_lower)
        # each cut contains the narrowest one, whose greatest peak bounds the least one
        return Ends(lower_bound, np.minimum(self.greatest_bounds.upper[-1:], self.least_upper))

    @property
    def is_widened_by_step(self) -> bool:
        """Whether what motions add between nodes is most of the gap or error, and much."""
        bound, reached = float(self.far_end[0]), float(self.reached[0])
        is_proved = self.nature is Nature.GUARANTEED and np.isfinite(reached)
        width = abs(bound - reached) if is_proved else float(self.error[0])
        return self.between_nodes > max(width / 2, WIDENING * abs(bound))

    @property
    def gaps(self) -> Array:
        """Gap between the bound farthest out and what is reached, over the bound, shape (A,).

        It is nan where nothing is known to be reached.
        """
        reached = np.where(np.isfinite(self.reached), self.reached, np.nan)
        difference, size = np.abs(self.far_end - reached), np.abs(self.far_end)
        ratio = np.divide(difference, size, out=np.zeros_like(size), where=size > 0)
        return np.asarray(ratio)


ENDS_OF_LEAST = {"lower": "upper", "upper": "lower"}
"""Ends that change places where the sign of a peak does."""


def mirrored(peak: Peak) -> Peak:
    """Return a peak with the signs of its values changed, as that of −q."""
    ends = {name: 0.0 - getattr(peak, ENDS_OF_LEAST.get(name, name)) for name in UNBOUNDED}
    return replace(peak, side="max" if peak.is_least else "min", **ends)


Peaks = Mapping[str, Peak]
"""Peaks by name: "q3" of a magnitude, "max q3" and "min q3" of the largest and the least value."""


def peaks(of: Envelope, names: Sequence[str] = ()) -> dict[str, Peak]:
    """Return the fuzzy peaks of an envelope `of` outputs by name: intervals of the peak by level.

    `names` are outputs, for the peaks of their magnitudes, or "max q3", "min q3"; all outputs if
    empty.
    """
    return {name: _peak_of(of, name) for name in names or map(str, of.outputs)}


def _peak_of(band: Envelope, name: str) -> Peak:
    k = [*map(str, band.outputs)].index(output_of(name))
    nature = band.natures[k] if band.natures else band.nature
    is_proved, is_signed = nature is Nature.GUARANTEED, name != output_of(name)
    smallest = -np.inf if is_signed else 0.0  # of any peak
    error = 0.0 if is_proved else band.error[..., k]  # which proved bounds contain
    ends = [(x.lower[..., k], x.upper[..., k]) for x in (band, band.attained)]
    ends_at_nodes, reached_at_nodes = (_oriented(*end, name) for end in ends)  # (A, T) each
    upper, lower = ends_at_nodes.upper.max(1), ends_at_nodes.lower.max(1)
    between = None if band.between is None else band.between[:, k]
    bound_at_nodes = ends_at_nodes.upper + error
    bound = within_steps(bound_at_nodes, between).max(1)
    above = bound - upper
    below = lower - np.maximum(ends_at_nodes.lower - error, smallest).max(1)
    least_lower, least_upper = np.full_like(upper, smallest), np.full_like(upper, np.inf)
    if band.least_peaks is not None and not is_signed:
        least_lower, least_upper = (end[:, k] for end in band.least_peaks)
    between_nodes = float(bound[0] - bound_at_nodes[0].max())
    if band.searched_peaks is not None and not is_signed:
        is_at_nodes = name.rstrip("0123456789") in AT_NODES
        return _searched_peak(band.searched_peaks, k, is_at_nodes * (bound - bound_at_nodes.max(1)))
    if is_proved:
        lower, upper = np.maximum(lower, least_lower), upper + above
    elif nature is Nature.ESTIMATED:
        # a peak is no smaller than at the nodes, whatever is added between them
        least_lower = np.maximum(least_lower, lower - below)
    reached = np.fmax(reached_at_nodes.upper, smallest).max(1)  # NaN where none is known
    if band.encloses:
        reached = np.full_like(upper, -np.inf)
    peak = Peak(
        alpha=np.asarray(band.alpha),
        lower=lower,
        upper=upper,
        error=np.zeros_like(upper) if is_proved else np.maximum(above, below),
        reached=reached,
        least_lower=least_lower,
        least_upper=least_upper,
        nature=nature,
        between_nodes=between_nodes,
        side="max" if is_signed else "",
        reached_at=_inputs_at_peak(band, k, name),
        encloses=band.encloses,
    )
    return mirrored(peak) if name.startswith("min ") else peak


def _searched_peak(found: Bounds, k: int, between: Array) -> Peak:
    """Return the fuzzy peak of output k by a search; `between` (A,) may be added between nodes."""
    lower, upper = found.lower[:, k], found.upper[:, k]
    reached, least_upper = upper, lower + between
    reached_at = dict(zip(found.inputs, found.upper_at[0, k].tolist(), strict=True))
    if found.encloses:
        reached, least_upper = np.full_like(upper, -np.inf), np.full_like(lower, np.inf)
        reached_at = {}
    return Peak(
        alpha=found.alpha,
        lower=lower,
        upper=upper,
        error=found.error[:, k] + between,
        reached=reached,
        least_lower=np.zeros_like(lower),
        least_upper=least_upper,
        nature=found.natures[k],
        between_nodes=float(between[0]),
        reached_at=reached_at,
        encloses=found.encloses,
    )


def _inputs_at_peak(band: Envelope, k: int, name: str) -> dict[str, float]:
    """Return inputs of the motion that reaches a peak of output k on the lowest level, if known."""
    low, high = band.attained
    by_side = {"max": (high, band.upper_at), "min": (-low, band.lower_at)}
    ends = [by_side[name[:3]]] if name != output_of(name) else [*by_side.values()]
    values = np.array([end[0, :, k] for end, _ in ends])  # (ends, T)
    points = np.array([at[0, :, k] for _, at in ends])  # (ends, T, n)
    values = np.where(np.isfinite(points).all(-1) & np.isfinite(values), values, -np.inf)
    if not np.isfinite(values).any():
        return {}
    farthest = np.unravel_index(values.argmax(), values.shape)
    return dict(zip(band.inputs, map(float, points[farthest]), strict=True))


def _oriented(low: Array, high: Array, name: str) -> Ends:
    """Return bounds of |q|, or of q ("max q") or −q ("min q"), from those of the output q."""
    if name.startswith("min "):
        return Ends(-high, -low)
    if name.startswith("max "):
        return Ends(low, high)
    return Ends(np.maximum(np.maximum(low, -high), 0.0), np.maximum(high, -low))


def tightest(first: Peaks, second: Peaks) -> dict[str, Peak]:
    """Return the tightest bounds of peaks by two analyses of the same response, by name.

    Guaranteed bounds are intersected and attained ones united; else the bounds of the stronger
    nature or of the smaller error are taken. Peaks that either analysis reaches are kept.
    """
    found = {**first, **second}
    for name in first.keys() & second.keys():
        both = _tighter(first[name].outwards, second[name].outwards)
        found[name] = mirrored(both) if first[name].is_least else both
    return found


def _tighter(first: Peak, second: Peak) -> Peak:
    better = max(first, second, key=lambda x: (list(Nature).index(x.nature), -x.error.max()))
    rules = {"reached": np.maximum, "least_lower": np.maximum, "least_upper": np.minimum}
    if {first.nature, second.nature} == {Nature.GUARANTEED}:
        rules |= {"lower": np.maximum, "upper": np.minimum}
    elif {first.nature, second.nature} == {Nature.ATTAINED}:
        rules |= {"lower": np.minimum, "upper": np.maximum, "error": np.maximum}
    ends: dict[str, Any]
    ends = {name: rule(getattr(first, name), getattr(second, name)) for name, rule in rules.items()}
    if "upper" in ends:
        ends["between_nodes"] = min(first, second, key=lambda x: x.upper[0]).between_nodes
    farther = first if first.reached[0] >= second.reached[0] else second
    return replace(better, reached_at=farther.reached_at, **ends)


def close_peaks(
    model: StructureModel,
    inputs: Mapping[str, FuzzyNumber],
    names: Sequence[str],
    *,
    duration: float,
    step: float,
    alpha: Sequence[float] = ALPHA,
    progress: Progress | bool | None = None,
) -> dict[str, Peak]:
    """Return peaks by the method that bounds peaks most closely, to within `PEAK_ERROR` if it can.

    `names` are those of peaks, such as "q3" and "max q3"; the others are as of `envelope`.
    """
    outputs = tuple(dict.fromkeys(map(output_of, names)))
    magnitudes = all(name == output_of(name) for name in names)
    method = Auto(PEAK_ERROR, peaks=True, magnitudes=magnitudes)
    times: dict[str, Any] = {"duration": duration, "step": step, "alpha": alpha}
    observed = model.with_outputs(outputs)
    return peaks(envelope(observed, inputs, method, progress=progress, **times), names)


def loose_peaks(peaks: Peaks, names: Sequence[str], gap: float) -> tuple[str, ...]:
    """Return the names of those peaks that are not guaranteed to within a gap, or not there at all.

    The gap is that between the bound farthest out and the reached peak, over the bound. Where the
    inputs enclose a set, no peak is known to be reached and any guaranteed one is taken.
    """

    def is_close(peak: Peak) -> bool:
        is_near = np.abs(peak.far_end - peak.reached) <= gap * np.abs(peak.far_end)
        return peak.nature is Nature.GUARANTEED and bool(is_near.all() or peak.encloses)

    return tuple(name for name in names if name not in peaks or not is_close(peaks[name]))
