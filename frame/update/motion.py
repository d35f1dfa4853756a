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

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import bartlett
from scipy.stats import f as law

from alphacut.frame.calculus.jet import Array
from alphacut.frame.dynamics.flow import LinearFlow
from alphacut.fuzzy import FuzzyNumber
from alphacut.fuzzy.sets.claimed import Claim, Claimed, Joint
from alphacut.fuzzy.sets.stepwise import outer_steps

ALIKE = 1e-6
"""Probability below which deviations of outputs so far apart are not those of errors alike."""
RAYS = 100
"""Random directions along which the border of a set is searched, besides two for each parameter."""


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
        found = np.empty(len(points))
        for row, (miss, slopes) in enumerate(zip(*self.misfit(points), strict=True)):
            size = np.linalg.norm(slopes, axis=0)
            basis, _ = np.linalg.qr(slopes / np.where(size > 0, size, 1.0))
            along = float(((basis.T @ miss) ** 2).sum())
            rest = float(miss @ miss) - along
            n, d = slopes.shape
            found[row] = law.sf((along / d) / max(rest / (n - d), 1e-300), d, n - d)
        return found


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
            outputs' errors are not alike.
    """
    levels = np.asarray(alpha, float)
    if tuple(prior) != record.flow.names:
        raise ValueError(
            f"the priors are of {', '.join(prior)}; they must be of {', '.join(record.flow.names)}"
        )
    if not len(levels) or levels[0] <= 0 or levels[-1] > 1 or (np.diff(levels) <= 0).any():
        raise ValueError(f"alpha: {list(alpha)} must rise within (0, 1]")
    ends = np.array([number.support for number in prior.values()])
    best, reach = _fit(record, ends)
    _require_alike(record, best)
    rng = np.random.default_rng(seed)
    rays = np.vstack([rng.normal(size=(RAYS, len(best))) @ reach.T, reach.T, -reach.T])
    widest = reach @ reach.T
    rays = np.vstack([rays, widest / np.sqrt(np.maximum(np.diag(widest), 1e-300))[:, None]])
    rays = np.vstack([rays, -rays[-len(best) :]])
    lower, upper = [], []
    for level in levels:
        points = _border(record, ends, best, rays, float(level))
        lower.append(points.min(0))
        upper.append(points.max(0))
    about = "parameter of the recorded structure"
    given = (
        f"{record.values.size} recorded values with independent normal errors of one deviation",
        "the true values lie in the priors' supports",
        "the sets found about the best values are whole",
    )
    return MotionPosterior(
        record.flow.names,
        levels,
        np.array(lower),
        np.array(upper),
        best,
        Claim(about, given),
        dict(prior),
    )


def _fit(record: RecordedMotion, ends: Array) -> tuple[Array, Array]:
    """Best parameters, and a matrix whose columns span the region about them."""
    middle, half = ends.mean(1), np.maximum(np.ptp(ends, axis=1) / 2, 1e-300)
    scale = float(np.abs(record.values).max()) or 1.0

    def miss(unit: Array) -> Array:
        return np.asarray(record.misfit((middle + half * unit)[None])[0][0] / scale)

    def slopes(unit: Array) -> Array:
        return np.asarray(-record.misfit((middle + half * unit)[None])[1][0] * half / scale)

    starts = [np.zeros(len(middle)), *np.random.default_rng(0).uniform(-0.9, 0.9, (8, len(middle)))]
    fits = [
        least_squares(miss, start, jac=slopes, bounds=(-1.0, 1.0), xtol=1e-14, ftol=1e-14)
        for start in starts
    ]
    fit = min(fits, key=lambda one: float(one.cost))
    jacobian = slopes(fit.x)
    deviation = np.sqrt(2 * fit.cost / max(len(jacobian) - len(middle), 1))
    spread = np.linalg.pinv(jacobian.T @ jacobian) * deviation**2
    values, vectors = np.linalg.eigh(spread)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    return middle + half * fit.x, half[:, None] * root


def _require_alike(record: RecordedMotion, best: Array) -> None:
    """Bartlett's test of one deviation for all outputs (Proc. R. Soc. A 160, 268, 1937)."""
    miss = record.misfit(best[None])[0].reshape(record.values.shape)
    deviations = miss.std(0, ddof=1)
    if miss.shape[1] < 2 or len(miss) <= 10 * len(best):
        return
    if deviations.max() <= 1e-9 * np.abs(record.values).max():  # a record without errors
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


def _border(record: RecordedMotion, ends: Array, best: Array, rays: Array, level: float) -> Array:
    """Points of the set of a level on rays from the best point, itself among them."""
    inside: Array = np.zeros(len(rays))
    outside: Array = np.ones(len(rays))
    for _ in range(8):  # outward until beyond the set or the priors
        held = _held(record, ends, best + outside[:, None] * rays, level)
        inside = np.where(held, outside, inside)
        outside = np.where(held, 2 * outside, outside)
        if not held.any():
            break
    for _ in range(14):
        middle = (inside + outside) / 2
        held = _held(record, ends, best + middle[:, None] * rays, level)
        inside, outside = np.where(held, middle, inside), np.where(held, outside, middle)
    return np.vstack([best[None], best + inside[:, None] * rays])


def _held(record: RecordedMotion, ends: Array, points: Array, level: float) -> Array:
    within = ((points >= ends[:, 0]) & (points <= ends[:, 1])).all(1)
    held = np.zeros(len(points), bool)
    if within.any():
        held[within] = record.possibility(points[within]) >= level
    return held
