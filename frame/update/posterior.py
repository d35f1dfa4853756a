"""Parameters of a storey frame after its natural modes were measured.

At each level the cuts of all priors and of all measured quantities leave a set of parameters. Where
the claims among them hold together with P >= 1 − α, so does the set, given the opinions and the
model. Its hull is enclosed by a box, proved by linear relaxations; points of the set tried say how
much narrower it might be.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from alphacut.frame.calculus.jet import Array
from alphacut.frame.structures.storey import StoreyFrame
from alphacut.frame.update.agreement import Agreement, widest
from alphacut.frame.update.chain import Chain, eigenvalue_ranges
from alphacut.frame.update.enclosure import PASSES, Enclosure, enclosure
from alphacut.frame.update.identified import Direction, directions
from alphacut.frame.update.measured import Measurement
from alphacut.fuzzy import Crisp, FuzzyNumber
from alphacut.fuzzy.knowledge.joint import JointClaim
from alphacut.fuzzy.sets.claimed import Claim, Claimed
from alphacut.fuzzy.sets.numbers import Cut
from alphacut.fuzzy.sets.stepwise import outer_steps

ALPHA = (0.05, 0.1, 0.25, 0.5, 0.75, 1.0)


class RefutedError(ValueError):
    """Raised where no parameters in the priors agree with the measurement at any level asked."""


@dataclass(frozen=True, eq=False)
class Posterior:
    """What measured modes leave of the parameters.

    Args:
        agreement: Priors, measurement and their joint possibility.
        alpha: Levels, shape (A,), rising.
        lower: Lower ends of boxes proved to hold the sets, shape (A, d), in SI units. Above
            `height` they repeat the last one that is not proved empty.
        upper: Upper ends.
        tried_lower: Least values among points of the sets, shape (A, d); nan where none was found.
        tried_upper: Greatest values.
        best: The parameters that agree best, among those tried, shape (d,).
        height: Possibility of `best`, and the least level whose set is proved empty (1 if none is).
        directions: Directions of the logarithms of the parameters and what was learned along them.
        seconds: Wall time.
    """

    agreement: Agreement
    alpha: Array
    lower: Array
    upper: Array
    tried_lower: Array
    tried_upper: Array
    best: Array
    height: tuple[float, float]
    directions: tuple[Direction, ...]
    seconds: float = field(repr=False)

    @property
    def names(self) -> tuple[str, ...]:
        """The parameters."""
        return self.agreement.chain.names

    @property
    def claim(self) -> JointClaim:
        """What the boxes claim together."""
        joint = JointClaim.of(self.agreement.numbers)
        model = ("the structure is such a storey frame",)
        return JointClaim(self.agreement.joint, (*joint.given, *model), joint.opinions)

    @property
    def numbers(self) -> dict[str, FuzzyNumber]:
        """The parameters as fuzzy numbers that hold together, for an envelope.

        Below the lowest level the prior's support holds.
        """
        rule, priors = self.agreement.joint, self.agreement.prior
        found: dict[str, FuzzyNumber] = {}
        for column, name in enumerate(self.names):
            ends = np.stack([self.lower[:, column], self.upper[:, column]])
            alpha, decided = self.alpha, float(self.alpha[0])
            if not isinstance(priors[name], Claimed):
                alpha, decided = np.append(0.0, alpha), 0.0
                ends = np.column_stack([priors[name].support, ends])
            steps = outer_steps(tuple(alpha), tuple(ends[0]), tuple(ends[1]))
            claim = Claim("" if rule is None else rule.means, self.claim.given)
            found[name] = steps if rule is None else Claimed(steps, claim, decided, joint=rule)
        return found

    @property
    def narrowed(self) -> dict[str, float]:
        """Width of each parameter's lowest cut over that of its prior."""
        level, priors = float(self.alpha[0]), self.agreement.prior
        widths = [prior_cut(priors[name], level, self.agreement).width for name in self.names]
        found = (self.upper[0] - self.lower[0]) / np.array(widths)
        return dict(zip(self.names, map(float, found), strict=True))

    @property
    def frequencies(self) -> tuple[Array, Array]:
        """Ends of all natural frequencies over the boxes, each (A, n), proved, in Hz."""
        chain = self.agreement.chain
        logs = [np.log(ends / chain.nominal) for ends in (self.lower, self.upper)]
        found = [eigenvalue_ranges(chain, low, high) for low, high in zip(*logs, strict=True)]
        low, high = np.array(found).swapaxes(0, 1)
        return np.sqrt(np.maximum(low, 0.0)) / (2 * np.pi), np.sqrt(high) / (2 * np.pi)

    @property
    def words(self) -> str:
        """What was learned, what was not, and what is claimed."""
        lines = [
            f"prior and measurement agree to {self.height[0]:.3g} (to {self.height[1]:.3g} at most)"
        ]
        lines += [f"not learned: {one.words}" for one in self.directions if not one.learned]
        return "\n".join([*lines, str(self.claim)])


def prior_cut(number: FuzzyNumber, alpha: float, agreement: Agreement) -> Cut:
    """Cut of a prior at the joint level α."""
    return number.cut(agreement.own_level(alpha) if isinstance(number, Claimed) else alpha)


def update(
    frame: StoreyFrame,
    prior: Mapping[str, FuzzyNumber | float],
    measured: Measurement,
    *,
    alpha: Sequence[float] = ALPHA,
    passes: int = PASSES,
) -> Posterior:
    """Parameters of a frame that agree with its measured natural modes.

    Args:
        frame: The frame; damping, motion and outputs do not matter.
        prior: Fuzzy numbers of the parameters to be learned, of "E", "I", "c1" … (columns of a
            storey), "l1" …, "m1" …, in SI units.
        measured: The measured modes.
        alpha: Levels, rising within (0, 1].
        passes: Most passes of the enclosure at a level.

    Raises:
        ValueError: An input is no parameter of the natural modes, a mode or floor is not the
            frame's, or levels do not rise within (0, 1].
        RefutedError: No parameters in the priors agree with the measurement at the lowest level.
    """
    begun = time.perf_counter()
    levels = _levels(alpha)
    numbers = {k: x if isinstance(x, FuzzyNumber) else Crisp(float(x)) for k, x in prior.items()}
    _require_of(frame, measured, numbers)
    agreement = Agreement(Chain.of(frame, tuple(numbers)), numbers, measured)
    boxes, empty = _boxes(agreement, levels, passes)
    if not boxes:
        raise RefutedError(
            f"no parameters in their priors agree with the measured modes at α = {levels[0]:g}:"
            f" a storey frame with such parameters is refuted (its measured modes would be refuted"
            f" by chance with P <= {levels[0]:g})"
        )
    last = boxes[-1]
    boxes += [last] * (len(levels) - len(boxes))
    best = agreement.best(last.lower, last.upper)
    tried = _tried(agreement, levels, boxes, best)
    nominal = agreement.chain.nominal
    point = nominal * np.exp(best)
    height = float(agreement.possibility(point[None])[0])
    ends = [
        _outward(np.stack([getattr(box, side) for box in boxes]), agreement, side)
        for side in ("lower", "upper")
    ]
    return Posterior(
        agreement,
        levels,
        ends[0],
        ends[1],
        *tried,
        point,
        (height, empty),
        directions(agreement, best),
        time.perf_counter() - begun,
    )


def _levels(alpha: Sequence[float]) -> Array:
    levels = np.asarray(alpha, float)
    if (
        not (levels.ndim == 1 and len(levels) and levels[0] > 0 and levels[-1] <= 1)
        or (np.diff(levels) <= 0).any()
    ):
        raise ValueError(f"alpha: {list(alpha)} must rise within (0, 1]")
    return levels


def _require_of(
    frame: StoreyFrame, measured: Measurement, prior: Mapping[str, FuzzyNumber]
) -> None:
    for mode in measured.modes:
        if mode.mode > frame.floors:
            raise ValueError(
                f"mode {mode.mode}: the frame has {frame.floors} floors, and as many modes"
            )
        if (floor := max(mode.reference, *mode.shape, 1)) > frame.floors:
            what = f"mode {mode.mode} has an amplitude q{floor}"
            raise ValueError(f"{what}; the frame has {frame.floors} floors")
    for name, number in prior.items():
        if not widest(number).lower > 0:
            raise ValueError(
                f"the prior of {name} reaches {widest(number).lower:g}; it must be positive"
            )


def _boxes(agreement: Agreement, levels: Array, passes: int) -> tuple[list[Enclosure], float]:
    """Boxes of log parameters by level until one is empty, and that level."""
    boxes: list[Enclosure] = []
    nominal = agreement.chain.nominal
    for level in levels:
        cuts = [prior_cut(x, float(level), agreement) for x in agreement.prior.values()]
        lower, upper = np.log(np.array(cuts).T / nominal)
        if boxes:
            lower = np.maximum(lower, boxes[-1].lower)
            upper = np.minimum(upper, boxes[-1].upper)
        own = agreement.own_level(float(level))
        modes = [*agreement.measured.cuts(float(level), own)]
        found = (
            None
            if (lower > upper).any()
            else enclosure(agreement.chain, lower, upper, modes, passes)
        )
        if found is None:
            return boxes, float(level)
        boxes.append(found)
    return boxes, 1.0


def _outward(logs: Array, agreement: Agreement, side: str) -> Array:
    """Parameters of log ends (A, d), rounded outward but not beyond the priors."""
    sign = -1.0 if side == "lower" else 1.0
    ends = agreement.chain.nominal * np.exp(logs) * (1 + sign * 4e-16)
    at = int(side == "upper")
    limits = np.array([widest(x)[at] for x in agreement.prior.values()])
    return np.asarray(np.maximum(ends, limits) if at == 0 else np.minimum(ends, limits))


def _tried(
    agreement: Agreement, levels: Array, boxes: list[Enclosure], best: Array
) -> tuple[Array, Array]:
    """Least and greatest parameters among points of each set, on rays from the best point."""
    lower = np.full((len(levels), len(best)), np.nan)
    upper = lower.copy()
    nominal = agreement.chain.nominal
    for row, (level, box) in enumerate(zip(levels, boxes, strict=True)):
        if agreement.possibility(nominal[None] * np.exp(best))[0] < level:
            break
        rays = np.vstack([box.points - best, np.zeros((1, len(best)))])
        inside: Array = np.zeros(len(rays))
        outside: Array = np.ones(len(rays))
        reach = agreement.possibility(nominal * np.exp(best + rays)) >= level
        inside[reach] = 1.0
        for _ in range(20):
            middle = (inside + outside) / 2
            held = agreement.possibility(nominal * np.exp(best + middle[:, None] * rays)) >= level
            inside = np.where(held, np.maximum(inside, middle), inside)
            outside = np.where(held, outside, middle)
        points = nominal * np.exp(best + inside[:, None] * rays)
        lower[row], upper[row] = points.min(0), points.max(0)
    return lower, upper
