"""Fuzzy peaks: the largest magnitude of each output over the motion, as intervals by level.

At the nodes no motion peaks higher than its envelope, and each has at least the magnitude that its
band is away from zero; what the steps between nodes may add counts as error.

Exceeding a limit is possible to the degree of the highest α-cut that holds such a motion. It is
necessary to one less the degree to which not exceeding it is possible (Dubois and Prade,
Possibility Theory, chapter 1). A greatest peak below the limit excludes the motion on its level and
above, and one that is reached above it proves the possibility.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from alphacut.base.arrays import Array, Mask
from alphacut.base.errors import checked_number, require, require_choice
from alphacut.frame.dynamics.yielding import AT_NODES
from alphacut.frame.envelope import Envelope, within_steps
from alphacut.frame.structures.quantities import output_of
from alphacut.fuzzy.result import Bounds, Ends, Nature

ANY = "any of them"  # name of the event that any of several limits is exceeded
PEAK_BOUNDS = ("lower", "upper", "error", "reached", "least_lower", "least_upper")  # of a `Peak`


@dataclass(frozen=True, eq=False)
class Peak:
    """Bounds of the largest magnitude of an output over time, or of its largest value.

    Args:
        alpha: Levels, rising, shape (A,).
        lower: Least peak at the nodes over each cut, as the envelope bounds it, shape (A,).
        upper: Greatest peak at the nodes over each cut, as the envelope bounds it.
        error: Distance by which peaks may lie outside `lower` and `upper`: that of the envelope and
            of the steps between nodes; 0 of guaranteed bounds, which contain it.
        reached: Peak that some motion in the cut is known to reach; −∞ where none is known.
        least_lower: Lower bound of the least peak over each cut, proved where the bounds are.
        least_upper: Upper bound of it: a peak that some motion in the cut is known not to exceed;
            infinite where none is known.
        nature: Nature of the bounds.
        between_nodes: Part of the greatest bound on the lowest level that motions may add within
            the steps between nodes; it falls with the square of the step.
        is_signed: Whether it is a largest value, which may be negative, instead of a magnitude.
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
    is_signed: bool = False
    reached_at: Mapping[str, float] = field(default_factory=dict)
    encloses: str = ""

    @property
    def greatest_bounds(self) -> Ends:
        """A lower and an upper bound of the greatest peak in each cut, shape (A,) each."""
        # where bounds are only attained other motions may peak higher
        beyond = np.inf if self.nature is Nature.ATTAINED else self.error
        return Ends(self.reached, self.upper + beyond)

    @property
    def least_bounds(self) -> Ends:
        """A lower and an upper bound of the least peak in each cut, shape (A,) each."""
        smallest = -np.inf if self.is_signed else 0.0  # of any peak
        beyond = np.inf if self.nature is Nature.ATTAINED else self.error
        lower_bound = np.maximum(np.maximum(self.lower - beyond, smallest), self.least_lower)
        # each cut contains the narrowest one, whose greatest peak bounds the least one
        return Ends(lower_bound, np.minimum(self.greatest_bounds.upper[-1:], self.least_upper))


Peaks = Mapping[str, Peak]
"""Peaks by name: "q3" of a magnitude, "max q3" of a value, "min q3" of the largest value of −q3."""


def peaks(envelope: Envelope, names: Sequence[str] = ()) -> dict[str, Peak]:
    """Return the fuzzy peaks of an envelope by name: intervals of the peak by level.

    `names` are outputs, for the peaks of their magnitudes, or "max q3", "min q3"; all outputs if
    empty.
    """
    return {name: _peak_of(envelope, name) for name in names or map(str, envelope.outputs)}


def _peak_of(envelope: Envelope, name: str) -> Peak:
    k = [*map(str, envelope.outputs)].index(output_of(name))
    nature = envelope.natures[k] if envelope.natures else envelope.nature
    is_proved, is_signed = nature is Nature.GUARANTEED, name != output_of(name)
    smallest = -np.inf if is_signed else 0.0  # of any peak
    error = 0.0 if is_proved else envelope.error[..., k]  # which proved bounds contain
    ends = [(x.lower[..., k], x.upper[..., k]) for x in (envelope, envelope.attained)]
    ends_at_nodes, reached_at_nodes = (_oriented(*end, name) for end in ends)  # (A, T) each
    upper, lower = ends_at_nodes.upper.max(1), ends_at_nodes.lower.max(1)
    between = None if envelope.between is None else envelope.between[:, k]
    bound_at_nodes = ends_at_nodes.upper + error
    bound = within_steps(bound_at_nodes, between).max(1)
    above = bound - upper
    below = lower - np.maximum(ends_at_nodes.lower - error, smallest).max(1)
    least_lower, least_upper = np.full_like(upper, smallest), np.full_like(upper, np.inf)
    if envelope.least_peaks is not None and not is_signed:
        least_lower, least_upper = (end[:, k] for end in envelope.least_peaks)
    between_nodes = float(bound[0] - bound_at_nodes[0].max())
    if envelope.searched_peaks is not None and not is_signed:
        is_at_nodes = name.rstrip("0123456789") in AT_NODES
        return _searched_peak(
            envelope.searched_peaks, k, is_at_nodes * (bound - bound_at_nodes.max(1))
        )
    if is_proved:
        lower, upper = np.maximum(lower, least_lower), upper + above
    elif nature is Nature.ESTIMATED:
        # a peak is no smaller than at the nodes, whatever is added between them
        least_lower = np.maximum(least_lower, lower - below)
    reached = np.fmax(reached_at_nodes.upper, smallest).max(1)  # NaN where none is known
    if envelope.encloses:
        reached = np.full_like(upper, -np.inf)
    return Peak(
        alpha=np.asarray(envelope.alpha),
        lower=lower,
        upper=upper,
        error=np.zeros_like(upper) if is_proved else np.maximum(above, below),
        reached=reached,
        least_lower=least_lower,
        least_upper=least_upper,
        nature=nature,
        between_nodes=between_nodes,
        is_signed=is_signed,
        reached_at=_inputs_at_peak(envelope, k, name),
        encloses=envelope.encloses,
    )


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


def _inputs_at_peak(envelope: Envelope, k: int, name: str) -> dict[str, float]:
    """Return inputs of the motion that reaches a peak of output k on the lowest level, if known."""
    low, high = envelope.attained
    by_side = {"max": (high, envelope.upper_at), "min": (-low, envelope.lower_at)}
    ends = [by_side[name[:3]]] if name != output_of(name) else [*by_side.values()]
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
    shared = {name: _tighter(first[name], second[name]) for name in first if name in second}
    return {**first, **second, **shared}


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


def require_limits(limits: Mapping[str, float], outputs: Sequence[str]) -> None:
    """Refuse no limits, unknown outputs, and limits of magnitudes ("q3", no "max q3") up to 0."""
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


def passing(peaks: Peaks, limits: Mapping[str, float]) -> dict[str, Passing]:
    """Return possibility and necessity that each fuzzy peak exceeds its limit, in SI, by name.

    If there are several limits one more answer, `ANY`, is on the event that any is exceeded.

    Raises:
        RefusedError: There is no limit, one is not positive, or it names no peak.
    """
    require_limits(limits, [*peaks])
    answers = {name: _passing_of(peaks[name], float(limit)) for name, limit in limits.items()}
    if len(answers) > 1:
        answers[ANY] = _passing_of_any(answers, limits)
    return answers


def _passing_of(peak: Peak, limit: float) -> Passing:
    greatest, least, alpha = peak.greatest_bounds, peak.least_bounds, peak.alpha
    reaches, is_excluded = greatest.lower > limit, greatest.upper <= limit
    possibility = alpha[reaches].max(initial=0.0), _excluded(alpha, is_excluded)
    is_kept = np.broadcast_to(least.upper <= limit, alpha.shape)  # by some motion
    keeping = alpha[is_kept].max(initial=0.0), _excluded(alpha, least.lower > limit)
    return Passing(
        possibility=(float(possibility[0]), possibility[1]),
        # one less the possibility of keeping the limit (Dubois, Prade 1988)
        necessity=(1 - keeping[1], 1 - float(keeping[0])),
        margin=limit - np.stack([greatest.upper, least.lower], axis=1),
        lowest=float(alpha[0]),
        nature=peak.nature,
        is_reached=bool(reaches.any()),
    )


def _passing_of_any(answers: Mapping[str, Passing], limits: Mapping[str, float]) -> Passing:
    passings = list(answers.values())
    least, greatest = (max(x.possibility[k] for x in passings) for k in (0, 1))
    relative_margins = [  # of a limit of 0 they are the sign
        x.margin / abs(limits[name]) if limits[name] else np.sign(x.margin)
        for name, x in answers.items()
    ]
    return Passing(
        possibility=(least, greatest),
        # below 1 all motions of the highest cut keep all limits
        necessity=(max(x.necessity[0] for x in passings), 0.0 if greatest < 1 else 1.0),
        margin=np.min(relative_margins, axis=0),
        lowest=passings[0].lowest,
        nature=Nature.weakest(x.nature for x in passings),
        is_reached=any(x.is_reached for x in passings),
    )


def _excluded(alpha: Array, excluded: Mask) -> float:
    """Return the lowest level from which on the mask (A,) holds on all levels, 1 without one."""
    first = np.flatnonzero(~excluded).max(initial=-1) + 1
    return float(alpha[first]) if first < len(alpha) else 1.0
