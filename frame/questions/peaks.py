"""Fuzzy peaks: the largest magnitude of each output over the motion, as intervals by level.

At the nodes no motion peaks higher than its envelope, and each has at least the magnitude that its
band is away from zero. Both are read off bounds that exclude values and bounds that are attained,
so that a peak is as sure as its envelope; what the steps between nodes may add counts as error.

Exceeding a limit is possible to the degree of the highest α-cut that holds such a motion. It is
necessary to one less the degree to which not exceeding it is possible (Dubois and Prade,
Possibility Theory, chapter 1). The α-cut of a peak is the answer: a peak that stays below the limit
excludes the motion on its level and above. One that is attained above it proves the possibility.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from alphacut.frame.envelope import Envelope
from alphacut.fuzzy.arrays import Array, Mask
from alphacut.fuzzy.refused import checked_number, require, require_choice
from alphacut.fuzzy.result import Ends, Nature

ANY = "any of them"
"""Name of the event that any of several limits is exceeded."""
PEAK_BOUNDS = ("lower", "upper", "error", "reached", "least_proved", "least_reached")
"""Arrays of a `Peak` over the levels."""


def output_of(peak: str) -> str:
    """Return the output of a peak: "q3" of "max q3"."""
    return peak.removeprefix("max ").removeprefix("min ").removeprefix("mean ")


@dataclass(frozen=True, eq=False)
class Peak:
    """Bounds of the largest magnitude of an output over time, or of its largest value.

    Args:
        alpha: Levels, rising, shape (A,).
        lower: Least peak at the nodes over each cut, as the envelope bounds it, shape (A,).
        upper: Greatest peak at the nodes over each cut, as the envelope bounds it.
        error: Distance by which peaks may lie outside `lower` and `upper`: that of the envelope and
            of the steps between nodes; 0 of guaranteed bounds, which contain it.
        reached: Peak that some motion in the cut is known to reach.
        least_proved: Peak that each motion in the cut is proved to have at least.
        least_reached: Peak that some motion in the cut is known not to exceed; infinite without
            one.
        nature: Nature of the bounds.
        is_signed: Whether it is a largest value, which may be negative, instead of a magnitude.
        reached_at: Inputs in SI, by name, of the motion that reaches the peak on the lowest level;
            empty where none is known.
    """

    alpha: Array
    lower: Array
    upper: Array
    error: Array
    reached: Array
    least_proved: Array
    least_reached: Array
    nature: Nature
    is_signed: bool = False
    reached_at: Mapping[str, float] = field(default_factory=dict)

    @property
    def greatest_bounds(self) -> Ends:
        """A lower and an upper bound of the greatest peak in each cut, shape (A,) each.

        If the envelope is only attained the upper one is infinite: other motions may peak higher.
        """
        is_attained = self.nature is Nature.ATTAINED
        return Ends(self.reached, self.upper + (np.inf if is_attained else self.error))

    @property
    def least_bounds(self) -> Ends:
        """A lower and an upper bound of the least peak in each cut, shape (A,) each.

        Each cut contains the narrowest one, whose greatest peak bounds the least peak from above.
        """
        smallest = -np.inf if self.is_signed else 0.0  # of any peak
        lower_bound = np.maximum(self.lower - self.error, smallest)
        if self.nature is Nature.ATTAINED:
            lower_bound = np.full_like(lower_bound, smallest)
        upper_bound = np.minimum(self.greatest_bounds.upper[-1:], self.least_reached)
        return Ends(np.maximum(lower_bound, self.least_proved), upper_bound)


Peaks = Mapping[str, Peak]
"""Peaks by name: "q3" of a magnitude, "max q3" of a value, "min q3" of the largest value of −q3."""


def peaks(envelope: Envelope, names: Sequence[str] = ()) -> dict[str, Peak]:
    """Return the fuzzy peaks of an envelope's outputs by name: intervals of the peak by level.

    Args:
        envelope: The envelope.
        names: Outputs, for the peaks of their magnitudes, or "max q3", "min q3"; all outputs if
            empty.

    Returns:
        Bounds of the greatest and least peak in each cut, their error, and peaks that are reached.
    """
    return {name: _peak_of(envelope, name) for name in names or map(str, envelope.outputs)}


def _peak_of(envelope: Envelope, name: str) -> Peak:
    """Return one fuzzy peak of an envelope by its name."""
    k = [*map(str, envelope.outputs)].index(output_of(name))
    nature = envelope.natures[k] if envelope.natures else envelope.nature
    is_proved, is_signed = nature is Nature.GUARANTEED, name != output_of(name)
    smallest = -np.inf if is_signed else 0.0  # of any peak
    error = 0.0 if is_proved else envelope.error[..., k]  # which proved bounds contain
    band, attained = (
        _oriented(ends.lower[..., k], ends.upper[..., k], name)  # (A, T) each
        for ends in (envelope, envelope.attained)
    )
    upper, lower = band.upper.max(1), band.lower.max(1)
    between = None if envelope.between is None else envelope.between[:, k]
    above = within_steps(band.upper + error, between).max(1) - upper
    below = lower - np.maximum(band.lower - error, smallest).max(1)
    least_proved, least_reached = np.full_like(upper, smallest), np.full_like(upper, np.inf)
    if envelope.least_peaks is not None and not is_signed:
        least_proved, least_reached = (end[:, k] for end in envelope.least_peaks)
    if is_proved:
        lower, upper = np.maximum(lower, least_proved), upper + above
    reached = np.where(np.isnan(attained.upper), smallest, attained.upper).max(1)
    return Peak(
        alpha=np.asarray(envelope.alpha),
        lower=lower,
        upper=upper,
        error=0.0 * upper if is_proved else np.maximum(above, below),
        reached=np.maximum(reached, smallest),
        least_proved=least_proved,
        least_reached=least_reached,
        nature=nature,
        is_signed=is_signed,
        reached_at=_inputs_at_peak(envelope, k, name),
    )


def _inputs_at_peak(envelope: Envelope, k: int, name: str) -> dict[str, float]:
    """Return inputs of the motion that reaches a peak of output k on the lowest level, if known."""
    low, high = envelope.attained
    ends = [(high, envelope.upper_at), (-low, envelope.lower_at)]
    if name != output_of(name):  # of one side
        ends = ends[:1] if name.startswith("max ") else ends[1:]
    values = np.array([end[0, :, k] for end, _ in ends])  # (ends, T)
    points = np.array([at[0, :, k] for _, at in ends])  # (ends, T, n)
    values = np.where(np.isfinite(points).all(-1) & np.isfinite(values), values, -np.inf)
    if not np.isfinite(values).any():
        return {}
    farthest = np.unravel_index(values.argmax(), values.shape)
    return dict(zip(envelope.inputs, map(float, points[farthest]), strict=True))


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
    both = {name: _tighter(first[name], second[name]) for name in first if name in second}
    return {**first, **second, **both}


def _tighter(first: Peak, second: Peak) -> Peak:
    """Return the tighter bounds of one peak by two analyses, as `tightest` says."""
    natures = {first.nature, second.nature}
    if natures == {Nature.GUARANTEED}:
        lower, upper = np.maximum(first.lower, second.lower), np.minimum(first.upper, second.upper)
        better = replace(first, lower=lower, upper=upper)
    elif natures == {Nature.ATTAINED}:
        lower, upper = np.minimum(first.lower, second.lower), np.maximum(first.upper, second.upper)
        error = np.maximum(first.error, second.error)
        better = replace(first, lower=lower, upper=upper, error=error)
    elif len(natures) == 1:
        better = min(first, second, key=lambda peak: peak.error.max())
    else:
        better = max(first, second, key=lambda peak: list(Nature).index(peak.nature))
    farther = first if first.reached[0] >= second.reached[0] else second
    return replace(
        better,
        reached_at=farther.reached_at,
        reached=np.maximum(first.reached, second.reached),
        least_proved=np.maximum(first.least_proved, second.least_proved),
        least_reached=np.minimum(first.least_reached, second.least_reached),
    )


def within_steps(size: Array, between: Array | None) -> Array:
    """Return upper bounds of a magnitude over the step before each node, shape (…, T).

    Args:
        size: The magnitude at the time nodes, shape (…, T).
        between: What it may exceed both ends of each step by, shape (…, T); None for nothing.
    """
    if between is None:
        return size
    inside = np.maximum(size[..., 1:], size[..., :-1]) + between[..., 1:]
    return np.concatenate([size[..., :1], inside], axis=-1)


def require_limits(limits: Mapping[str, float], outputs: Sequence[str]) -> None:
    """Refuse an empty set of limits, unknown outputs, and limits of magnitudes not above 0.

    Raises:
        RefusedError: There is no limit, one names no output, or one of a magnitude is not positive;
            those of "max q3" and "min q3" may have any sign.
    """
    require(bool(limits), "limits", value=None, allowed="one limit or more, as {'q3': 0.1}")
    for name, limit in limits.items():
        require_choice("limits", name, outputs)
        is_magnitude = not name.startswith(("max ", "min "))
        checked_number(f"limit of {name}", float(limit), positive=is_magnitude)


@dataclass(frozen=True, eq=False)
class Passing:
    """Degrees to which exceeding a limit at some time is possible and necessary.

    Args:
        possibility: Lower and upper bound, from 0 to 1.
        necessity: Lower and upper bound, from 0 to 1.
        margin: Limit less greatest and less least peak on each level, shape (A, 2), in SI units;
            −inf where nothing excludes a greater peak. Of any limit: as fractions of the limits.
        lowest: Lowest level computed; below it nothing is known.
        nature: Nature of the bounds that both degrees rest on.
        is_reached: Whether a motion in some cut is known to exceed it, if only at level 0.
    """

    possibility: tuple[float, float]
    necessity: tuple[float, float]
    margin: Array
    lowest: float
    nature: Nature
    is_reached: bool

    @property
    def outcome(self) -> str:
        """(Not) exceeded, on and above the lowest level; can be exceeded; or undecided."""
        if self.possibility[1] <= self.lowest:
            return "not exceeded"
        if self.necessity[0] >= 1 - self.lowest:
            return "exceeded"
        return "can be exceeded" if self.is_reached else "undecided"

    @property
    def verdict(self) -> str:
        """The outcome in words, with the level from which on it holds if that is not 0."""
        return verdict_words(self.outcome, self.lowest)


def verdict_words(outcome: str, lowest: float) -> str:
    """Return the outcome as a text, with the level from which on it holds if that is not 0."""
    holds_from = bool(lowest) and outcome in ("exceeded", "not exceeded")
    return f"{outcome} from α = {lowest:g} up" if holds_from else outcome


def passing(peaks: Peaks, limits: Mapping[str, float]) -> dict[str, Passing]:
    """Return possibility and necessity that the magnitude of each output exceeds its limit.

    Args:
        peaks: Fuzzy peaks of the outputs.
        limits: Largest magnitude allowed by output, in SI units.

    Returns:
        One answer for each limit by output, and one named `ANY` if there are several.

    Raises:
        RefusedError: There is no limit, one is not positive, or it names no output.
    """
    require_limits(limits, [*peaks])
    answers = {name: _passing_of(peaks[name], float(limit)) for name, limit in limits.items()}
    if len(answers) > 1:
        answers[ANY] = _passing_of_any(answers, limits)
    return answers


def _passing_of(peak: Peak, limit: float) -> Passing:
    """Return the degrees to which it is possible and necessary that a peak exceeds its limit.

    The necessity of exceeding is 1 less the possibility of not exceeding (Dubois, Prade 1988).
    """
    greatest, least, alpha = peak.greatest_bounds, peak.least_bounds, peak.alpha
    reaches, is_excluded = greatest.lower > limit, greatest.upper <= limit
    possibility = _highest(alpha, reaches), _excluded(alpha, is_excluded)
    is_kept = np.broadcast_to(least.upper <= limit, alpha.shape)  # by some motion
    possibility_of_keeping = _highest(alpha, is_kept), _excluded(alpha, least.lower > limit)
    return Passing(
        possibility=possibility,
        necessity=(1 - possibility_of_keeping[1], 1 - possibility_of_keeping[0]),
        margin=limit - np.stack([greatest.upper, least.lower], axis=1),
        lowest=float(alpha[0]),
        nature=peak.nature,
        is_reached=bool(reaches.any()),
    )


def _passing_of_any(answers: Mapping[str, Passing], limits: Mapping[str, float]) -> Passing:
    """Return the degrees to which any of several limits is exceeded.

    The possibility is that of the limit most possibly exceeded. The necessity is at least that of
    each limit, and 0 if no motion of the highest cut exceeds a limit.
    """
    passings = list(answers.values())
    possibility = [max(x.possibility[k] for x in passings) for k in (0, 1)]
    are_kept = all(x.possibility[1] < 1 for x in passings)  # by all motions of the highest cut
    relative_margins = [  # of a limit of 0 they are the sign
        x.margin / abs(limits[name]) if limits[name] else np.sign(x.margin)
        for name, x in answers.items()
    ]
    return Passing(
        possibility=(possibility[0], possibility[1]),
        necessity=(max(x.necessity[0] for x in passings), 0.0 if are_kept else 1.0),
        margin=np.min(relative_margins, axis=0),
        lowest=passings[0].lowest,
        nature=Nature.weakest(x.nature for x in passings),
        is_reached=any(x.is_reached for x in passings),
    )


def _highest(alpha: Array, holds: Mask) -> float:
    """Return the highest level at which the mask (A,) holds, 0 without one."""
    return float(alpha[holds][-1]) if holds.any() else 0.0


def _excluded(alpha: Array, excluded: Mask) -> float:
    """Return the lowest level from which on the mask (A,) holds on all levels, 1 without one."""
    open_ = np.flatnonzero(~excluded)
    first = open_[-1] + 1 if len(open_) else 0
    return float(alpha[first]) if first < len(alpha) else 1.0
