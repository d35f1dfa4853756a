"""Parameters of a linear structure after its motion was recorded.

With independent normal errors of one unknown deviation, the part of the misfit along the motion's
derivatives and the rest of it are independent for the true parameters: their ratio has an F law
whatever the model's nonlinearity (Hartley, Biometrika 51, 1964). Its distribution function makes a
possibility with P(π(true) < α) = α exactly. The sets about the best parameters are searched, not
proved.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import least_squares, lsq_linear
from scipy.spatial import cKDTree
from scipy.stats import bartlett, norm
from scipy.stats import f as law

from alphacut.frame.calculus.jet import Array
from alphacut.frame.calculus.low_discrepancy import halton
from alphacut.frame.dynamics.flow import LinearFlow
from alphacut.frame.update.posterior import RefutedError
from alphacut.fuzzy import FuzzyNumber
from alphacut.fuzzy.sets.claimed import Claim, Claimed, Joint
from alphacut.fuzzy.sets.stepwise import outer_steps

ALIKE = 1e-6
"""Probability below which deviations of outputs so far apart are not those of errors alike."""
RAYS = 50
"""Random paths along which the border of a set is searched, twice; besides two a parameter."""
SINGULAR = 1e-12
"""Squared singular value of unit slopes below which a combination counts as without influence."""
AT_ONCE, EXACT = 10_000_000, 1e-9
"""Derivatives held at once; error of a record without errors, as a share of its largest value."""
BESIDE = 1e-6
"""Probability below which the true parameters have a misfit so much above that of the best fit."""
NODES, SHRINK, FARTHEST, HALVINGS = 25, 2**-0.5, 64.0, 12
"""Nodes of a path, factor on their distances, deviations to the last, halvings between two."""
DRAWN, PARTS, NEAR, STARTS = 1000, 10, 12, 12
"""Points drawn to begin fits, in so many parts; neighbours of each that fit less well than those
kept; and how many are kept at most."""
ROUNDS, GROWN, CORRECTIONS = 4, 0.02, 2
"""Times that paths begin anew at the extremes found, at most; growth of the set by which they do,
as a share of its width; and Gauss-Newton steps at each node."""


@dataclass(frozen=True, eq=False)
class RecordedMotion:
    """A recorded motion and the structure that made it.

    Args:
        flow: Trajectories by the parameters to be learned; its outputs are those recorded.
        values: Recorded motion at the nodes, shape (T, m), in SI units.
    """

    flow: LinearFlow
    values: Array

    def __post_init__(self) -> None:
        """Refuse records that do not fit the flow.

        Raises:
            ValueError: Shapes differ, a value is not finite, or there are too few.
        """
        wanted = (len(self.flow.time), len(self.flow.outputs))
        if np.shape(self.values) != wanted or not np.isfinite(self.values).all():
            raise ValueError(
                f"the record has the shape {np.shape(self.values)}; it must be {wanted}, a row for"
                " each node and a column for each output, all finite"
            )
        if np.size(self.values) <= len(self.flow.names) + 1:
            raise ValueError(
                f"the record has {np.size(self.values)} values; {len(self.flow.names)} parameters"
                " need more"
            )

    def misfit(self, points: Array) -> tuple[Array, Array]:
        """Misfit (S, N) and its derivatives (S, N, d) at parameters (S, d)."""
        motion = self.flow.taylor(points)
        count = len(points)
        miss = (self.values - motion.value).reshape(count, -1)
        slopes = np.moveaxis(motion.first, 0, -1).reshape(count, -1, points.shape[1])
        return miss, slopes

    def possibility(self, points: Array) -> Array:
        """Possibility of parameters (S, d), shape (S,)."""
        at_once = max(1, AT_ONCE // (np.size(self.values) * points.shape[1]))
        parts = np.split(points, range(at_once, len(points), at_once))
        return np.concatenate([self._possibility(part) for part in parts])

    def _possibility(self, points: Array) -> Array:
        miss, slopes = self.misfit(points)
        size = np.linalg.norm(slopes, axis=1, keepdims=True)
        slopes = slopes / np.where(size > 0, size, 1.0)
        squares, ways = np.linalg.eigh(np.swapaxes(slopes, 1, 2) @ slopes)
        told = squares > SINGULAR  # other combinations of the parameters do not move the motion
        along = (np.einsum("snd,sn->sd", slopes, miss)[:, None] @ ways)[:, 0]
        part = np.divide(along**2, squares, out=np.zeros_like(squares), where=told).sum(1)
        n, d = len(miss[0]), np.maximum(told.sum(1), 1)
        least = n * (EXACT * np.abs(self.values).max()) ** 2 + 1e-300
        rest = np.maximum((miss**2).sum(1) - part, least)
        return np.asarray(law.sf((part / d) / (rest / (n - d)), d, n - d))


@dataclass(frozen=True, eq=False)
class MotionPosterior:
    """What a record leaves of the parameters.

    Args:
        names: The parameters.
        alpha: Levels, shape (A,).
        lower: Least values found in the set about the best ones, shape (A, d).
        upper: Greatest values found.
        best: The parameters that fit best, shape (d,).
        claim: What the cuts claim.
        prior: Fuzzy number of each parameter before.
    """

    names: tuple[str, ...]
    alpha: Array
    lower: Array
    upper: Array
    best: Array
    claim: Claim
    prior: Mapping[str, FuzzyNumber]

    @property
    def narrowed(self) -> dict[str, float]:
        """Width of each parameter's lowest cut over that of its prior's support."""
        widths = np.array([number.support.width for number in self.prior.values()])
        shares = (self.upper[0] - self.lower[0]) / widths
        return dict(zip(self.names, map(float, shares), strict=True))

    @property
    def numbers(self) -> dict[str, FuzzyNumber]:
        """The parameters as fuzzy numbers that hold together.

        Below the lowest level the prior's support holds.
        """
        rule = Joint(("record",), False, self.claim.about, named=True)
        alpha, found = (0.0, *map(float, self.alpha)), {}
        for k, name in enumerate(self.names):
            low, high = self.prior[name].support
            lower, upper = np.append(low, self.lower[:, k]), np.append(high, self.upper[:, k])
            found[name] = Claimed(outer_steps(alpha, lower, upper), self.claim, joint=rule)
        return dict(found)


def learn_from_motion(
    record: RecordedMotion,
    prior: Mapping[str, FuzzyNumber],
    *,
    alpha: Sequence[float] = (0.05, 0.25, 0.5, 0.75, 1.0),
    seed: int = 0,
) -> MotionPosterior:
    """Parameters in their priors' supports that agree with a recorded motion.

    Args:
        record: The record.
        prior: Fuzzy number of each parameter of the record's flow, in its order.
        alpha: Levels, rising within (0, 1].
        seed: Of the directions searched.

    Raises:
        ValueError: The priors are not those of the flow, levels do not rise within (0, 1], or the
            errors are not alike or not independent.
        RefutedError: No parameters that were tried agree with the record.
    """
    levels = np.asarray(alpha, float)
    if tuple(prior) != record.flow.names:
        raise ValueError(
            f"the priors are of {', '.join(prior)}; they must be of {', '.join(record.flow.names)}"
        )
    if not len(levels) or levels[0] <= 0 or levels[-1] > 1 or (np.diff(levels) <= 0).any():
        raise ValueError(f"alpha: {list(alpha)} must rise within (0, 1]")
    box = _Box(record, np.array([number.support for number in prior.values()]))
    fits = box.fits()
    best, agreeing = fits[0], float(box.possibility(fits[:1])[0])
    if agreeing < levels[0]:
        raise RefutedError(
            "the record refutes the frame: the best parameters in the priors' supports agree with"
            f" it to {agreeing:.2g} (a true frame is refuted with a probability of about"
            f" {levels[0]:g}): mend the frame, the record's units or the priors"
        )
    top = box.physical(best)
    _require_alike(record, top)
    _require_independent(record, top)
    paths = np.concatenate([box.paths(fit, seed) for fit in box.apart(fits, float(levels[0]))])
    likely = box.possibility(paths)
    ends = np.array([box.extremes(paths, likely, float(level)) for level in levels])
    lower, upper = box.physical(ends[:, 0]), box.physical(ends[:, 1])
    about = "parameter of the recorded structure"
    given = (
        f"{record.values.size} recorded values with independent normal errors of one deviation",
        "the true values lie in the priors' supports",
        "the sets found about the best values are whole",
    )
    return MotionPosterior(
        record.flow.names,
        levels,
        np.minimum.accumulate(lower[::-1])[::-1],
        np.maximum.accumulate(upper[::-1])[::-1],
        top,
        Claim(about, given),
        dict(prior),
    )


@dataclass(frozen=True, eq=False)
class _Box:
    """The priors' supports, seen as [-1, 1] in each parameter.

    Args:
        record: The record.
        ends: Of the supports, shape (d, 2).
    """

    record: RecordedMotion
    ends: Array

    @property
    def half(self) -> Array:
        """Half the widths, shape (d,)."""
        return np.asarray(np.maximum(np.ptp(self.ends, axis=1) / 2, 1e-300))

    @property
    def ways(self) -> list[tuple[int, float]]:
        """The lower end of each parameter, then the upper end of each."""
        return [(k, end) for end in (-1.0, 1.0) for k in range(len(self.ends))]

    def physical(self, units: Array) -> Array:
        """Parameters (…, d) of points of the box; its faces are met exactly."""
        low, high = self.ends.T
        inner = np.clip(self.ends.mean(1) + self.half * units, low, high)
        return np.asarray(np.where(units <= -1, low, np.where(units >= 1, high, inner)))

    def possibility(self, units: Array) -> Array:
        """Possibility of points (…, d) of the box."""
        points = self.physical(units).reshape(-1, len(self.ends))
        return self.record.possibility(points).reshape(units.shape[:-1])

    def linear(self, unit: Array) -> tuple[Array, Array]:
        """Misfit and the motion's derivatives at a point, over the largest recorded value."""
        scale = float(np.abs(self.record.values).max()) or 1.0
        miss, slopes = self.record.misfit(self.physical(unit)[None])
        return miss[0] / scale, slopes[0] * self.half / scale

    def fits(self) -> Array:
        """Points that fit best about several starts, the best first, (F, d).

        A fit is left out where its misfit is too large for the true parameters beside the best's.
        """
        d, n = len(self.ends), self.record.values.size
        tight: dict[str, Any] = {"bounds": (-1.0, 1.0), "xtol": 1e-14, "ftol": 1e-14, "gtol": 1e-15}
        fits = [
            least_squares(
                lambda unit: self.linear(unit)[0], start, lambda u: -self.linear(u)[1], **tight
            )
            for start in self.starts()
        ]
        fits.sort(key=lambda one: float(one.cost))
        most = 1 + d / (n - d) * float(law.isf(BESIDE, d, n - d))
        most *= max(float(fits[0].cost), n * EXACT**2 / 2)
        return np.array([one.x for one in fits if one.cost <= most])

    def starts(self) -> Array:
        """The centre, and of points drawn those with less misfit than any drawn near, (S, d).

        Half are drawn evenly and half by their logarithms, as priors may span decades.
        """
        (low, high), drawn = self.ends.T, halton(len(self.ends), DRAWN)
        ratio = np.where(low > 0, high / np.maximum(low, 1e-300), 1.0)
        decades = 2 * low * (ratio**drawn - 1) / np.maximum(high - low, 1e-300) - 1
        many = np.where((ratio > 1) & (np.arange(DRAWN) % 2 > 0)[:, None], decades, 2 * drawn - 1)
        misfit = np.concatenate([self.squares(part) for part in np.array_split(many, PARTS)])
        near = cKDTree(many).query(many, NEAR)[1]
        lowest = np.flatnonzero(misfit <= misfit[near].min(1))
        chosen = lowest[np.argsort(misfit[lowest])[:STARTS]]
        return np.vstack([np.zeros(len(low)), 0.99 * many[chosen]])

    def squares(self, units: Array) -> Array:
        """Sum of the squares of the misfit at points (S, d) of the box, shape (S,)."""
        miss = self.record.values - self.record.flow.values(self.physical(units))
        return np.asarray((miss**2).sum((1, 2)))

    def apart(self, fits: Array, level: float) -> list[Array]:
        """The first fit, and each that no straight way within a level's set joins to one before."""
        kept, shares = [fits[0]], np.linspace(0, 1, 9)[:, None]
        for fit in fits[1:]:
            ways = np.array([fit + shares * (other - fit) for other in kept])
            if not (self.possibility(ways) >= level).all(axis=1).any():
                kept.append(fit)
        return kept

    def paths(self, fit: Array, seed: int) -> Array:
        """Paths that leave a fit, (P, M, d)."""
        starts = np.tile(fit, (len(self.ways), 1))
        rays = self.rays(fit, self.spread(fit), seed)
        return np.concatenate([rays, self.profiles(starts, self.ways)])

    def spread(self, fit: Array) -> Array:
        """Matrix whose columns span the region about a fit."""
        miss, jacobian = self.linear(fit)
        deviation = max(np.linalg.norm(miss) / np.sqrt(max(len(miss) - len(fit), 1)), EXACT)
        values, vectors = np.linalg.eigh(np.linalg.pinv(jacobian.T @ jacobian) * deviation**2)
        return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))

    def rays(self, best: Array, spread: Array, seed: int) -> Array:
        """Paths that leave a point straight and go on along the faces they meet, (P, M, d)."""
        rng, d = np.random.default_rng(seed), len(best)
        widest = spread @ spread.T
        axes = np.vstack([spread.T, widest / np.sqrt(np.maximum(np.diag(widest), 1e-300))[:, None]])
        straight = rng.uniform(-1, 1, (RAYS, d)) - best  # to anywhere in the box, and through it
        rays = np.vstack([rng.normal(size=(RAYS, d)) @ spread.T, axes, -axes, straight / FARTHEST])
        far = FARTHEST * np.append(0.0, SHRINK ** np.arange(NODES - 1)[::-1])
        return np.asarray(np.clip(best + far[:, None] * rays[:, None], -1.0, 1.0))

    def profiles(self, starts: Array, ways: Sequence[tuple[int, float]]) -> Array:
        """Paths to ends of parameters on which the others fit best, (P, M, d).

        Args:
            starts: First points, shape (P, d).
            ways: Parameter and end, -1.0 or 1.0, of each path.
        """
        points, nodes = starts, []
        which, ends = np.array([k for k, _ in ways]), np.array([end for _, end in ways])
        first = starts[np.arange(len(which)), which]
        for share in np.append(0.0, SHRINK ** np.arange(NODES - 1)[::-1]):
            for _ in range(CORRECTIONS):
                points = self.corrected(points, which, first + share * (ends - first))
            nodes.append(points)
        return np.stack(nodes, axis=1)

    def corrected(self, points: Array, which: Array, values: Array) -> Array:
        """Best points by motions linearised at some (P, d), one parameter of each at a value."""
        miss, slopes = self.record.misfit(self.physical(points))
        basis, root = np.linalg.qr(slopes * self.half)
        aim = np.einsum("snd,sn->sd", basis, miss)
        steps = map(_constrained, root, aim, points, which, values)
        return np.asarray(np.clip(points + np.array([*steps]), -1.0, 1.0))

    def extremes(self, paths: Array, likely: Array, level: float) -> Array:
        """Least and greatest values found of a level's set, shape (2, d).

        Args:
            paths: Shape (P, M, d).
            likely: Their possibility, shape (P, M).
            level: The level.
        """
        found = self.border(paths, likely, level)
        if not len(found):  # above the possibility of the best
            found = paths[0, :1]
        for _ in range(ROUNDS):
            turns, before = np.concatenate([found[found.argmin(0)], found[found.argmax(0)]]), found
            more = self.profiles(turns, self.ways)
            found = np.vstack([found, self.border(more, self.possibility(more), level)])
            grown = before.min(0) - found.min(0), found.max(0) - before.max(0)
            if np.max(grown / np.maximum(np.ptp(found, axis=0), 1e-12)) < GROWN:
                break
        return np.array([found.min(0), found.max(0)])

    def border(self, paths: Array, likely: Array, level: float) -> Array:
        """Nodes of a level's set on each path until it leaves the set, and where it does, (n, d).

        Sets apart from those of the fits may be about other points that are stationary.
        """
        held = np.logical_and.accumulate(likely >= level, axis=1)
        met = held[:, 0]
        if not met.any():
            return np.asarray(paths[held])
        last = held[met].sum(1) - 1
        rows, following = np.arange(len(last)), np.minimum(last + 1, likely.shape[1] - 1)
        inside, outside = paths[met][rows, last], paths[met][rows, following]
        for _ in range(HALVINGS):
            known = np.vstack([paths[held], inside])
            low, high = known.min(0), known.max(0)
            some = ((outside < low) | (outside > high)).any(1)  # may widen the set's hull
            if not some.any():
                break
            middle = (inside[some] + outside[some]) / 2
            good = (self.possibility(middle) >= level)[:, None]
            inside[some] = np.where(good, middle, inside[some])
            outside[some] = np.where(good, outside[some], middle)
        return np.vstack([paths[held], inside])


def _constrained(root: Array, aim: Array, point: Array, fixed: int, value: float) -> Array:
    """Step from a point of [-1, 1] nearest to root x = aim that brings one entry to a value."""
    free = np.arange(len(aim)) != fixed
    step = np.full(len(aim), np.clip(value, -1.0, 1.0) - point[fixed])
    if free.any():
        bounds = -1.0 - point[free], 1.0 - point[free]
        rest = aim - root[:, fixed] * step[fixed]
        step[free] = lsq_linear(root[:, free], rest, bounds, method="bvls").x
    return step


def _require_alike(record: RecordedMotion, best: Array) -> None:
    """Bartlett's test of one deviation for all outputs (Proc. R. Soc. A 160, 268, 1937)."""
    miss, deviations = _rest(record, best)
    if miss.shape[1] < 2 or not deviations.all():
        return
    with np.errstate(divide="ignore"):
        chance = bartlett(*miss.T).pvalue
    if chance < ALIKE and deviations.max() > 2 * deviations.min():
        each = zip(record.flow.outputs, deviations, strict=True)
        told = ", ".join(f"{deviation:.2g} of {name}" for name, deviation in each)
        raise ValueError(
            f"the recorded outputs' errors are not alike: deviations {told} (SI) of the best fit;"
            " the sets rest on one deviation for all: learn from outputs measured alike, or"
            " mend the frame where it does not fit: its damping, start, load or priors"
        )


def _require_independent(record: RecordedMotion, best: Array) -> None:
    """Tests that the best fit leaves errors without a mean, and neighbours that do not correlate.

    Both are normal with deviation 1 / √T, of their own size, for independent errors.
    """
    miss, deviations = _rest(record, best)
    if not deviations.all():
        return
    miss = miss / np.sqrt((miss**2).mean(0))
    alike = (miss[1:] * miss[:-1]).mean(0)
    allowed = float(norm.isf(ALIKE / 4 / miss.shape[1])) / np.sqrt(len(miss))
    for name, mean, correlation in zip(record.flow.outputs, miss.mean(0), alike, strict=True):
        if max(abs(mean), abs(correlation)) > allowed:
            raise ValueError(
                f"the record's errors of {name} are not independent: the best fit leaves errors"
                f" with a mean of {mean:.2g} of their size and neighbours that correlate to"
                f" {correlation:.2g} (by chance up to {allowed:.2g}): mend the frame where it does"
                " not fit (its damping, start, load or priors), the sensor's offset or timing, or"
                " keep only every third sample, say"
            )


def _rest(record: RecordedMotion, best: Array) -> tuple[Array, Array]:
    """Misfit of the outputs (T, m), and deviations (m,), 0 where too few or without errors."""
    miss = record.misfit(best[None])[0].reshape(record.values.shape)
    deviations = miss.std(0, ddof=1)
    known = len(miss) > 10 * len(best) and deviations.max() > EXACT * np.abs(record.values).max()
    return miss, deviations * known
