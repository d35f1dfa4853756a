"""Parameters of a storey frame from its measured natural modes.

At each level the cuts of all priors and of all measured quantities leave a set of parameters. Where
the claims among them hold together with P >= 1 − α, the set holds the true parameters with that
probability, if the opinions and the model are right. A box encloses the set, proved by linear
relaxations (`enclosure`). Predictions (`Identified.predictions`) are the natural frequencies of its
frames.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import FailedError, require
from alphacut.frame.identify.enclosure import enclosure
from alphacut.frame.identify.modes import Chain, MeasuredMode, ModeCut, eigenvalue_ranges
from alphacut.frame.structures.storey import StoreyFrame
from alphacut.fuzzy import Crisp, FuzzyNumber
from alphacut.fuzzy.knowledge.joint import JointClaim
from alphacut.fuzzy.result import Ends
from alphacut.fuzzy.sets.claimed import ClaimedNumber, CoverageClaim, JointRule
from alphacut.fuzzy.sets.numbers import Cut, outer_steps

ALPHA = (0.05, 0.1, 0.25, 0.5, 0.75, 1.0)


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
        prior: Fuzzy numbers of parameters of stiffness and mass, in SI units.
        measured: The measured modes, by rising number.
        alpha: Levels, rising within (0, 1].

    Raises:
        RefusedError: An input is no parameter of the modes, or a mode, floor or level is not so.
        RefutedError: No parameters in the priors agree with the measurement at the lowest level.
    """
    numbers = {k: x if isinstance(x, FuzzyNumber) else Crisp(float(x)) for k, x in prior.items()}
    evidence = Evidence(Chain(frame, tuple(numbers)), numbers, tuple(measured))
    _require_input(evidence, alpha, frame.floors)
    nominal, levels, empty = evidence.chain.nominal, np.asarray(alpha, float), 1.0
    boxes: list[tuple[Array, Array]] = []  # logarithms of parameters over nominal values
    for level in map(float, levels):
        cuts = [evidence.cut(x, level) for x in numbers.values()]
        low, high = np.log(np.array(cuts).T / nominal)
        if boxes:  # sets are nested
            low, high = np.maximum(low, boxes[-1][0]), np.minimum(high, boxes[-1][1])
        is_empty = (low > high).any()
        box = None if is_empty else enclosure(evidence.chain, low, high, evidence.modes(level))
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


def _require_input(evidence: Evidence, alpha: Sequence[float], n_floors: int) -> None:
    levels, measured = np.append(0.0, alpha), evidence.measured
    in_range = len(levels) > 1 and levels[-1] <= 1 and bool((np.diff(levels) > 0).all())
    require(in_range, "identify.alpha", value=list(alpha), allowed="rising in (0, 1]")
    mode_numbers = [mode.mode for mode in measured]
    are_rising = bool(mode_numbers) and sorted(set(mode_numbers)) == mode_numbers
    require(are_rising, "identify.modes", value=mode_numbers, allowed="one or more, rising")
    largest = max(x for mode in measured for x in (mode.mode, mode.reference, *mode.shape))
    allowed = f"modes and floors from 1 to {n_floors}"
    require(largest <= n_floors, "identify.modes", value=largest, allowed=allowed)
    smallest = min(widest_cut(number).lower for number in evidence.prior.values())
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
        means = "parameter of the measured frame"
        return JointRule(names, independent=False, means=means, named=True) if names else None

    def cut(self, number: FuzzyNumber, alpha: float) -> Cut:
        """Return the α-cut of a number, of a claim at the level where all claims hold jointly."""
        n_claims = len(self.joint.names) if self.joint else 1
        return number.cut(alpha / n_claims if isinstance(number, ClaimedNumber) else alpha)

    def modes(self, alpha: float) -> list[ModeCut]:
        """Return ranges of the measured modes at the joint level α."""
        return [mode.ranges(lambda x: self.cut(x, alpha)) for mode in self.measured]


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

    def predictions(self) -> Ends:
        """Return proved ends of all n natural frequencies on each level, (A, n) each, in Hz."""
        chain = self.evidence.chain
        boxes = np.log(np.stack([self.lower, self.upper], axis=1) / chain.nominal)  # (A, 2, d)
        ranges = np.array([eigenvalue_ranges(chain, *box) for box in boxes])
        return Ends(*np.sqrt(np.maximum(ranges, 0.0)).swapaxes(0, 1) / (2 * np.pi))
