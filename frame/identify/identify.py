"""Parameters of a storey frame from its measured natural modes.

At each level the cuts of all priors and of all measured quantities leave a set of parameters. Where
the claims among them hold together with P >= 1 − α, the set holds the true parameters with that
probability, if the opinions and the model are right. A box encloses the set, proved by linear
relaxations (`enclosure`). Samples (`Identified.samples`) fill the set and show how much narrower it
is. Predictions (`Identified.predictions`) say what its frames vibrate like.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.optimize import least_squares

from alphacut.frame.identify.enclosure import enclosure
from alphacut.frame.identify.modes import Chain, MeasuredMode, ModeCut, eigenvalue_ranges
from alphacut.frame.structures.storey import StoreyFrame
from alphacut.fuzzy import Crisp, FuzzyNumber
from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.knowledge.joint import JointClaim
from alphacut.fuzzy.refused import FailedError, require
from alphacut.fuzzy.result import ROUND_OFF, Ends
from alphacut.fuzzy.sets.claimed import ClaimedNumber, CoverageClaim, JointRule
from alphacut.fuzzy.sets.numbers import Cut, outer_steps

ALPHA = (0.05, 0.1, 0.25, 0.5, 0.75, 1.0)
LEEWAY = 0.1
"""Share of the box's width by which samples may leave it; a larger one finds a wrong box that is
much too narrow, but its walks meet the set less often."""
STEPS, MIN_WALKS, MAX_TRIES = 60, 100, 50
"""Steps of each random walk; walks at least, as they show one another the way; tries of a step."""
STARTS = 10
"""Starts of the search for a first sample."""
MARGINS = (1.0, 0.5, 0.1, 1e-2, 1e-4)
"""Distances from the ends of all ranges, in half widths, that the search asks for in turn."""

Violation = Callable[[Array], Array]
"""Distance of points (n, d) beyond each range of the set, (n, q), in half widths; <= 0 inside."""


class RefutedError(FailedError):
    """No parameters in the priors agree with the measurement at the lowest level."""


def identify(
    frame: StoreyFrame,
    prior: Mapping[str, FuzzyNumber | float],
    measured: Sequence[MeasuredMode],
    *,
    alpha: Sequence[float] = ALPHA,
) -> Identified:
    """Return boxes of a frame's parameters that agree with its measured natural modes.

    Args:
        frame: The frame; damping, initial motion and outputs do not matter.
        prior: Fuzzy numbers of the parameters, of "E", "I", "c1" … (columns of a storey), "l1" …,
            "m1" …, in SI units.
        measured: The measured modes, by rising number.
        alpha: Levels, rising within (0, 1].

    Raises:
        RefusedError: An input is no parameter of the natural modes, a mode or floor is not the
            frame's, or levels do not rise within (0, 1].
        RefutedError: No parameters in the priors agree with the measurement at the lowest level.
    """
    numbers = {k: x if isinstance(x, FuzzyNumber) else Crisp(float(x)) for k, x in prior.items()}
    _require_input(frame, measured, numbers, alpha)
    evidence = Evidence(Chain(frame, tuple(numbers)), numbers, tuple(measured))
    nominal, levels, empty = evidence.chain.nominal, np.asarray(alpha, float), 1.0
    boxes: list[tuple[Array, Array]] = []  # logarithms of parameters over nominal values
    for level in map(float, levels):
        cuts = [evidence.cut(x, level) for x in numbers.values()]
        low, high = np.log(np.array(cuts).T / nominal)
        if boxes:  # sets are nested
            low, high = np.maximum(low, boxes[-1][0]), np.minimum(high, boxes[-1][1])
        box = None
        if (low <= high).all():
            box = enclosure(evidence.chain, low, high, evidence.modes(level))
        if box is None:
            empty = level
            break
        boxes.append(box)
    if not boxes:
        raise RefutedError(
            f"no parameters in their priors agree with the measured modes at α = {levels[0]:g}:"
            f" a storey frame with such parameters is refuted (by chance with P <= {levels[0]:g})",
            "widen the priors, or check masses and numbers of modes",
        )
    boxes += [boxes[-1]] * (len(levels) - len(boxes))
    lower, upper = (nominal * np.exp(np.stack(side)) for side in zip(*boxes, strict=True))
    least, greatest = np.array([widest_cut(x) for x in numbers.values()]).T
    # rounding of exp, outwards and within the priors
    lower, upper = np.maximum(lower * (1 - 4e-16), least), np.minimum(upper * (1 + 4e-16), greatest)
    return Identified(evidence, levels, lower, upper, empty)


def _require_input(
    frame: StoreyFrame,
    measured: Sequence[MeasuredMode],
    prior: Mapping[str, FuzzyNumber],
    alpha: Sequence[float],
) -> None:
    levels, n_floors = np.asarray(alpha, float), frame.floors
    is_rising = levels.ndim == 1 and len(levels) > 0 and bool((np.diff(levels) > 0).all())
    in_range = is_rising and levels[0] > 0 and levels[-1] <= 1
    require(in_range, "identify.alpha", value=list(alpha), allowed="rising in (0, 1]")
    mode_numbers = [mode.mode for mode in measured]
    are_rising = bool(mode_numbers) and sorted(set(mode_numbers)) == mode_numbers
    require(are_rising, "identify.modes", value=mode_numbers, allowed="one or more, rising")
    largest = max(x for mode in measured for x in (mode.mode, mode.reference, *mode.shape))
    allowed = f"modes and floors from 1 to {n_floors}"
    require(largest <= n_floors, "identify.modes", value=largest, allowed=allowed)
    smallest = min(widest_cut(number).lower for number in prior.values())
    require(smallest > 0, "identify.parameters", value=smallest, allowed="positive priors")


def widest_cut(number: FuzzyNumber) -> Cut:
    """Return the widest cut that a number decides."""
    return number.cut(number.decided) if isinstance(number, ClaimedNumber) else number.support


@dataclass(frozen=True, eq=False)
class Evidence:
    """Opinions and claims on a frame's parameters and on its modes, these by rising number."""

    chain: Chain
    prior: Mapping[str, FuzzyNumber]
    measured: tuple[MeasuredMode, ...]

    @cached_property
    def numbers(self) -> dict[str, FuzzyNumber]:
        """Parameters first, then the measured quantities."""
        measured = {name: x for mode in self.measured for name, x in mode.quantities.items()}
        return {**self.prior, **measured}

    @cached_property
    def joint(self) -> JointRule | None:
        """Rule by which the claims hold together; None where there is none."""
        names = tuple(name for name, x in self.numbers.items() if isinstance(x, ClaimedNumber))
        if not names:
            return None
        return JointRule(names, False, "parameter of the measured frame", named=True)

    def cut(self, number: FuzzyNumber, alpha: float) -> Cut:
        """Return the α-cut of a number, of a claim at the level where all claims hold jointly."""
        if self.joint and isinstance(number, ClaimedNumber):
            return number.cut(alpha / len(self.joint.names))
        return number.cut(alpha)

    def modes(self, alpha: float) -> list[ModeCut]:
        """Return ranges of the measured modes at the joint level α."""
        return [mode.ranges(lambda x: self.cut(x, alpha)) for mode in self.measured]

    def violation(self, points: Array, modes: list[ModeCut]) -> Array:
        """Return how far modes at parameters (S, d) lie outside ranges, in half widths.

        There is one column for each frequency and measured amplitude, shape (S, q), ≤ 0 inside.
        """
        values, vectors = self.chain.modes(points)
        columns = []
        for mode, cut in zip(self.measured, modes, strict=True):
            shape = vectors[:, :, mode.mode - 1]
            reference = shape[:, mode.reference - 1]
            columns.append((values[:, mode.mode - 1], cut.low, cut.high))
            columns += [(shape[:, z - 1] / reference, *cut.shape[z]) for z in mode.shape]
        measured, low, high = (np.array(part) for part in zip(*columns, strict=True))
        half = np.maximum((high - low) / 2, 1e-12 * np.abs(high))
        return np.asarray(np.maximum(low - measured.T, measured.T - high) / half)


@dataclass(frozen=True, eq=False)
class Identified:
    """Parameters that agree with measured modes.

    Args:
        evidence: Priors and measured modes.
        alpha: Levels, shape (A,), rising.
        lower: Lower ends of boxes proved to hold the sets, shape (A, d), in SI units. From `empty`
            on they repeat the last one that is not proved empty.
        upper: Upper ends.
        empty: Least level whose set is proved empty; 1 if none is.
    """

    evidence: Evidence
    alpha: Array
    lower: Array
    upper: Array
    empty: float

    @property
    def names(self) -> tuple[str, ...]:
        """The parameters."""
        return self.evidence.chain.names

    @property
    def claim(self) -> JointClaim:
        """Coverage of the boxes: the claims, and the conditions under which they hold."""
        joint = JointClaim.from_inputs(self.evidence.numbers)
        model = ("the structure is such a storey frame",)
        return JointClaim(self.evidence.joint, (*joint.conditions, *model), joint.opinions)

    @property
    def numbers(self) -> dict[str, FuzzyNumber]:
        """Identified parameters as fuzzy numbers, by name, for an envelope.

        Their cuts are the sides of the boxes; below the lowest level they are the prior's support.
        Where priors or measurements are claims, so are the numbers, with one joint confidence.
        """
        rule, priors = self.evidence.joint, self.evidence.prior
        numbers: dict[str, FuzzyNumber] = {}
        for column, name in enumerate(self.names):
            ends = np.stack([self.lower[:, column], self.upper[:, column]])
            alpha, decided = self.alpha, float(self.alpha[0])
            if not isinstance(priors[name], ClaimedNumber):
                alpha, decided = np.append(0.0, alpha), 0.0
                ends = np.column_stack([priors[name].support, ends])
            numbers[name] = steps = outer_steps(tuple(alpha), tuple(ends[0]), tuple(ends[1]))
            if rule is not None:
                claim = CoverageClaim(rule.means, self.claim.conditions)
                numbers[name] = ClaimedNumber(steps, claim, decided, joint=rule)
        return numbers

    @property
    def narrowed(self) -> dict[str, float]:
        """Width of each parameter's lowest cut over that of its prior."""
        evidence, level = self.evidence, float(self.alpha[0])
        widths = np.array([evidence.cut(evidence.prior[name], level).width for name in self.names])
        return dict(zip(self.names, map(float, (self.upper - self.lower)[0] / widths), strict=True))

    def samples(self, number: int = 200, *, row: int = 0, seed: int = 0) -> Array:
        """Return points (number, d) of the set at level `alpha[row]`, about uniform in logarithms.

        The set is that of parameters whose modes lie in all measured cuts. The walks may leave the
        box that is proved to hold it by `LEEWAY`, so that the points test the proof.

        Raises:
            FailedError: No point of the set was found, or one lies outside the box or has a
                frequency outside the predictions: the proof is wrong.
        """
        evidence, level, rng = self.evidence, float(self.alpha[row]), np.random.default_rng(seed)
        nominal, modes = evidence.chain.nominal, evidence.modes(level)
        cuts = np.array([evidence.cut(prior, level) for prior in evidence.prior.values()]).T

        def parameters_of(logs: Array) -> Array:
            return np.asarray(np.clip(nominal * np.exp(logs), *cuts))

        def violation(logs: Array) -> Array:
            return evidence.violation(parameters_of(logs), modes)

        box = Ends(np.log(self.lower[row] / nominal), np.log(self.upper[row] / nominal))
        start = inner_point(violation, box, rng)
        if start is None:
            what = f"no parameters with modes in all measured cuts at α = {level:g} were met"
            raise FailedError(what, "take samples of a lower level, or the box alone")
        leeway = LEEWAY * (box.upper - box.lower)
        wider = Ends(box.lower - leeway, box.upper + leeway)
        points = parameters_of(random_walks(violation, start, wider, number, rng))
        self._require_contained(points, row)
        return points

    def _require_contained(self, points: Array, row: int) -> None:
        """Refuse points (S, d) outside the box of a level or its predicted frequencies."""
        chain, factor = self.evidence.chain, 1 + ROUND_OFF  # for rounding
        in_box = (points * factor >= self.lower[row]) & (points <= self.upper[row] * factor)
        lower, upper = self._eigenvalues(row)
        values = chain.modes(points)[0]
        are_predicted = (values * factor >= lower) & (values <= upper * factor)
        for what, holds in (("parameters", in_box), ("squared frequencies", are_predicted)):
            if not holds.all():
                sample = points[np.argmin(holds.all(1))]
                pairs = zip(self.names, map(float, sample), strict=True)
                at = ", ".join(f"{x} = {y!r}" for x, y in pairs)
                text = f"the proof is wrong: {what} that agree with the modes lie outside, at {at}"
                raise FailedError(text, "keep the case and report it")

    def _eigenvalues(self, row: int) -> tuple[Array, Array]:
        nominal = self.evidence.chain.nominal
        logs = (np.log(ends[row] / nominal) for ends in (self.lower, self.upper))
        return eigenvalue_ranges(self.evidence.chain, *logs)

    def predictions(self) -> Ends:
        """Return proved ends of all n natural frequencies on each level, (A, n) each, in Hz."""
        ranges = np.array([self._eigenvalues(row) for row in range(len(self.alpha))])
        lower, upper = np.sqrt(np.maximum(ranges, 0.0)).swapaxes(0, 1) / (2 * np.pi)
        return Ends(lower, upper)


def inner_point(violation: Violation, box: Ends, rng: np.random.Generator) -> Array | None:
    """Return a point (d,) of a box at which no range is violated, by least squares; None if not."""
    for start in range(STARTS):
        unit_point = rng.random(len(box.lower)) if start else 0.5  # the middle first
        point = box.lower + (box.upper - box.lower) * unit_point
        for margin in MARGINS:
            fitted = least_squares(
                lambda x, margin=margin: np.maximum(violation(x[None])[0] + margin, 0.0),
                point,
                bounds=(box.lower - 1e-9, box.upper + 1e-9),  # a side may have no width
                max_nfev=30,
            )
            point = np.clip(fitted.x, *box)
            if (violation(point[None]) <= 0).all():
                return np.asarray(point)
    return None


def random_walks(
    violation: Violation, start: Array, box: Ends, number: int, rng: np.random.Generator
) -> Array:
    """Return points (number, d) of a set in a box, reached by random walks from a point (d,) of it.

    Each step is a point of a random chord (hit and run), cut at points outside the set (shrinking
    slice sampler; Neal, Annals of Statistics 31, 2003). Every second chord points from one walk to
    another, as long and thin sets need (ter Braak, Statistics and Computing 16, 2006). The points
    become uniform in a convex set; in others they reach the part in which such chords lie.
    """
    points, width = np.tile(start, (max(number, MIN_WALKS), 1)), box.upper - box.lower
    chord_ends: Array = np.tile([[-1.0], [1.0]], len(points))
    for step in range(STEPS):
        direction = rng.standard_normal(points.shape) * width
        if step % 2:
            direction = rng.permutation(points) - rng.permutation(points)
        longest = np.abs(direction / np.where(width > 0, width, 1.0)).max(axis=1, keepdims=True)
        direction /= np.where(longest > 0, longest, 1.0)  # now as long as the box
        (low, high), has_moved = chord_ends, np.full(len(points), False)
        for _ in range(MAX_TRIES):
            position = rng.uniform(low, high)  # on the chord, 0 at the point itself
            candidate = points + position[:, None] * direction
            is_inside = ((box.lower <= candidate) & (candidate <= box.upper)).all(axis=1)
            is_accepted = is_inside & (violation(candidate) <= 0).all(axis=1) & ~has_moved
            points[is_accepted], has_moved[is_accepted] = candidate[is_accepted], True
            if has_moved.all():
                break
            low = np.where(position < 0, position, low)
            high = np.where(position < 0, high, position)
    return points[:number]
