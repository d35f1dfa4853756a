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

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import reduce

import numpy as np

from alphacut.frame.envelope import Envelope
from alphacut.fuzzy.arrays import Array, Mask
from alphacut.fuzzy.refused import checked_number, require, require_choice
from alphacut.fuzzy.result import Ends, Nature

ANY = "any of them"
"""Name of the event that any of several limits is exceeded."""


def output_of(peak: str) -> str:
    """The output of a peak: "q3" of "max q3"."""
    return peak.removeprefix("max ").removeprefix("min ").removeprefix("mean ")


@dataclass(frozen=True, eq=False)
class Peaks:
    """Bounds of the largest magnitude of each output over time, or of its largest value.

    The latter is named "max q3", or "min q3" for the largest value of −q3.

    Args:
        alpha: Levels, rising, shape (A,).
        outputs: Names of the peaks, m of them.
        lower: Least peak at the nodes over each cut, as the envelope bounds it, shape (A, m).
        upper: Greatest peak at the nodes over each cut, as the envelope bounds it, shape (A, m).
        error: Distance by which peaks may lie outside `lower` and `upper`: that of the envelope and
            of the steps between nodes, shape (A, m); 0 of guaranteed bounds, which contain it.
        reached: Peak that some motion in the cut is known to reach, shape (A, m).
        least_proved: Peak that each motion in the cut is proved to have at least, shape (A, m).
        least_reached: Peak that some motion in the cut is known not to exceed; infinite without
            one.
        natures: Nature of each output's bounds, m of them.
    """

    alpha: Array
    outputs: tuple[str, ...]
    lower: Array
    upper: Array
    error: Array
    reached: Array
    least_proved: Array
    least_reached: Array
    natures: tuple[Nature, ...]

    def most(self, output: str) -> Ends:
        """Return a lower and an upper bound of the greatest peak in each cut, shape (A,) each.

        If the envelope is only attained the upper one is infinite: other motions may peak higher.
        """
        k = self.outputs.index(output)
        is_attained = self.natures[k] is Nature.ATTAINED
        upper_bound = self.upper[:, k] + (np.inf if is_attained else self.error[:, k])
        return Ends(self.reached[:, k], upper_bound)

    def least(self, output: str) -> Ends:
        """Return a lower and an upper bound of the least peak in each cut, shape (A,) each.

        Each cut contains the narrowest one, whose greatest peak bounds the least peak from above.
        """
        k = self.outputs.index(output)
        smallest = -np.inf if self._is_signed(output) else 0.0  # of any peak
        lower_bound = np.maximum(self.lower[:, k] - self.error[:, k], smallest)
        if self.natures[k] is Nature.ATTAINED:
            lower_bound = np.full_like(lower_bound, smallest)
        upper_bound = np.minimum(self.most(output).upper[-1:], self.least_reached[:, k])
        return Ends(np.maximum(lower_bound, self.least_proved[:, k]), upper_bound)

    @staticmethod
    def _is_signed(output: str) -> bool:
        return output.startswith(("max ", "min "))

    def named(self, peaks: Mapping[str, str]) -> Peaks:
        """Return a selection of these peaks under new names.

        Args:
            peaks: Peak by new name, such as several limits of one output.
        """
        columns = [self.outputs.index(peak) for peak in peaks.values()]
        names = ("lower", "upper", "error", "reached", "least_proved", "least_reached")
        ends = {name: getattr(self, name)[:, columns] for name in names}
        natures = tuple(self.natures[k] for k in columns)
        return replace(self, outputs=tuple(peaks), natures=natures, **ends)

    def nature(self, outputs: Iterable[str]) -> Nature:
        """Return the weakest nature of some peaks' bounds."""
        return Nature.weakest(self.natures[self.outputs.index(name)] for name in outputs)


def peaks(envelope: Envelope, names: Sequence[str] = ()) -> Peaks:
    """Return the fuzzy peaks of an envelope's outputs: intervals of the peak over time by level.

    Args:
        envelope: The envelope.
        names: Outputs, for the peaks of their magnitudes, or "max q3", "min q3"; all outputs if
            empty.

    Returns:
        Bounds of the greatest and least peak in each cut, their error, and peaks that are reached.
    """
    names = tuple(names) or tuple(map(str, envelope.outputs))
    columns = [list(map(str, envelope.outputs)).index(output_of(name)) for name in names]
    natures = tuple(
        (envelope.natures or (envelope.nature,) * len(envelope.outputs))[k] for k in columns
    )
    proved = np.array([nature is Nature.GUARANTEED for nature in natures])
    error = np.where(proved, 0.0, envelope.error[..., columns])  # which proved bounds contain
    between = None if envelope.between is None else envelope.between[:, columns]
    most, least = _sided(Ends(envelope.lower, envelope.upper), names, columns)  # (A, T, m)
    attained, _ = _sided(envelope.attained, names, columns)
    signed = np.array([name != output_of(name) for name in names])
    floor = np.where(signed, -np.inf, 0.0)  # no peak of a magnitude is lower
    upper, lower = most.max(1), least.max(1)
    above = within_steps(most + error, between).max(1) - upper
    below = lower - np.maximum(least - error, floor).max(1)
    least_proved = np.zeros_like(upper)
    if envelope.least_peaks is not None:
        least_proved = envelope.least_peaks.lower[:, columns]
    least_proved = np.where(signed, -np.inf, least_proved)
    lower = np.where(proved, np.maximum(lower, least_proved), lower)
    upper = np.where(proved, upper + above, upper)
    reached = np.where(np.isnan(attained), floor, attained).max(1)
    least_reached = np.full(envelope.upper[:, 0].shape, np.inf)
    if envelope.least_peaks is not None:
        least_reached = envelope.least_peaks.upper
    return Peaks(
        alpha=np.asarray(envelope.alpha),
        outputs=names,
        lower=lower,
        upper=upper,
        error=np.where(proved, 0.0, np.maximum(above, below)),
        reached=np.maximum(reached, floor),
        least_proved=least_proved,
        least_reached=np.where(signed, np.inf, least_reached[:, columns]),
        natures=natures,
    )


def _sided(band: Ends, names: Sequence[str], columns: Sequence[int]) -> tuple[Array, Array]:
    """Return upper and lower bounds of |q|, or of q ("max q") or −q ("min q"), each (A, T, m).

    Args:
        band: Lower and upper bounds of the outputs.
        names: Names of the m peaks.
        columns: Output of each peak.
    """
    upper, lower = [], []
    for name, k in zip(names, columns, strict=True):
        low, high = band.lower[..., k], band.upper[..., k]
        if name.startswith("min "):
            low, high = -high, -low
        elif name == output_of(name):  # a magnitude
            low, high = np.maximum(np.maximum(low, -high), 0.0), np.maximum(high, -low)
        upper.append(high)
        lower.append(low)
    return np.stack(upper, -1), np.stack(lower, -1)


def joined(first: Peaks, second: Peaks) -> Peaks:
    """Return two sets of peaks on the same levels, with different names, as one set."""
    names = ("lower", "upper", "error", "reached", "least_proved", "least_reached")
    ends = {name: np.hstack([getattr(first, name), getattr(second, name)]) for name in names}
    outputs, natures = (*first.outputs, *second.outputs), (*first.natures, *second.natures)
    return replace(first, outputs=outputs, natures=natures, **ends)


def tightest(first: Peaks, second: Peaks) -> Peaks:
    """Return the tightest bounds of peaks by two analyses of the same response, by output.

    Two proved bounds are intersected; else the bounds of the stronger nature or of the smaller
    error are taken. Peaks that either analysis reaches are kept.

    Args:
        first: Peaks of all or some outputs.
        second: Peaks of all or some outputs.
    """
    outputs = tuple(dict.fromkeys((*first.outputs, *second.outputs)))
    columns = [_tightest_column(first, second, output) for output in outputs]
    return reduce(joined, columns)


def _column(peaks: Peaks, output: str) -> Peaks:
    """Peaks of an output alone, arrays of shape (A, 1)."""
    return peaks.named({output: output})


def _tightest_column(first: Peaks, second: Peaks, output: str) -> Peaks:
    """Return the peaks of one output by both of two sets.

    Guaranteed bounds are intersected and attained ones united; else those of the smaller error or
    of the stronger nature are returned. What either reaches is kept.
    """
    columns = [_column(x, output) for x in (first, second) if output in x.outputs]
    if len(columns) == 1:
        return columns[0]
    left, right = columns
    if left.natures == right.natures == (Nature.GUARANTEED,):
        lower, upper = np.maximum(left.lower, right.lower), np.minimum(left.upper, right.upper)
        better = replace(left, lower=lower, upper=upper)
    elif left.natures == right.natures == (Nature.ATTAINED,):
        lower, upper = np.minimum(left.lower, right.lower), np.maximum(left.upper, right.upper)
        better = replace(left, lower=lower, upper=upper, error=np.maximum(left.error, right.error))
    elif left.natures == right.natures:
        better = min(left, right, key=lambda column: column.error.max())
    else:
        better = max(left, right, key=lambda column: list(Nature).index(column.natures[0]))
    return replace(
        better,
        reached=np.maximum(left.reached, right.reached),
        least_proved=np.maximum(left.least_proved, right.least_proved),
        least_reached=np.minimum(left.least_reached, right.least_reached),
    )


def within_steps(size: Array, between: Array | None) -> Array:
    """Return upper bounds of a magnitude over the step before each node, shape (…, T, m).

    Args:
        size: The magnitude at the nodes, shape (…, T, m).
        between: What it may exceed both ends of each step by, shape (T, m); None for nothing.
    """
    if between is None:
        return size
    out = size.copy()
    out[..., 1:, :] = np.maximum(size[..., 1:, :], size[..., :-1, :]) + between[1:]
    return out


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
    require_limits(limits, peaks.outputs)
    answers = {name: _passing_of(peaks, name, float(limit)) for name, limit in limits.items()}
    if len(answers) > 1:
        answers[ANY] = _any(answers, limits)
    return answers


def _passing_of(peaks: Peaks, output: str, limit: float) -> Passing:
    """Return the degrees to which it is possible and necessary that an output exceeds its limit.

    The necessity of exceeding is 1 less the possibility of not exceeding (Dubois, Prade 1988).
    """
    most, least, alpha = peaks.most(output), peaks.least(output), peaks.alpha
    possibility = _highest(alpha, most.lower > limit), _excluded(alpha, most.upper <= limit)
    is_kept = np.broadcast_to(least.upper <= limit, alpha.shape)  # by some motion
    possibility_of_keeping = _highest(alpha, is_kept), _excluded(alpha, least.lower > limit)
    return Passing(
        possibility=possibility,
        necessity=(1 - possibility_of_keeping[1], 1 - possibility_of_keeping[0]),
        margin=limit - np.stack([most.upper, least.lower], axis=1),
        lowest=float(alpha[0]),
        nature=peaks.nature([output]),
        is_reached=bool((most.lower > limit).any()),
    )


def _any(answers: Mapping[str, Passing], limits: Mapping[str, float]) -> Passing:
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
