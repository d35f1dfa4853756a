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
from typing import Self

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import FailedError, require
from alphacut.frame.identify.enclosure import enclosure
from alphacut.frame.identify.learned import LearnedInputs, Predictions
from alphacut.frame.identify.modes import Chain, MeasuredMode, ModeCut, eigenvalue_ranges
from alphacut.frame.structures.model import StructureModel
from alphacut.frame.structures.quantities import of_storey_frame
from alphacut.frame.structures.storey import StoreyFrame
from alphacut.fuzzy import Crisp, FuzzyNumber
from alphacut.fuzzy.knowledge.joint import JointClaim
from alphacut.fuzzy.result import Ends
from alphacut.fuzzy.sets.claimed import ClaimedNumber, CoverageClaim, JointRule
from alphacut.fuzzy.sets.numbers import Cut, outer_steps

LEARNED = "the learned set"
"""Name of the set of parameters that agree with the modes, which the boxes enclose."""
ALPHA = (0.05, 0.1, 0.25, 0.5, 0.75, 1.0)


class RefutedError(FailedError):
    """The inputs of a refuted frame were asked for: it has none that agree with its modes."""


def identify(
    frame: StoreyFrame,
    inputs: Mapping[str, FuzzyNumber | float],
    modes: Sequence[MeasuredMode],
    *,
    held_out: Sequence[int] = (),
    alpha: Sequence[float] = ALPHA,
) -> Identified:
    """Return boxes of a frame's parameters that agree with its measured natural modes.

    A frame that no parameters fit is refuted; this is a result, see `Identified.refutation`.

    Args:
        frame: The frame; damping, initial motion and outputs do not matter.
        inputs: Fuzzy numbers of parameters of stiffness and mass, in SI units, as they are known
            before the measurement.
        modes: The measured modes, by rising number; see `read_modes` and `measured_mode`.
        held_out: Numbers of modes that are predicted, and not learned from.
        alpha: Levels, rising within (0, 1].

    Raises:
        RefusedError: An input is no parameter of the modes; a mode, floor or level is not as said;
            no mode is left to learn from, or one has values without scatter.

    Example:
        >>> from alphacut.frame import measured_mode
        >>> from alphacut.fuzzy import Interval
        >>> modes = [measured_mode(1, [0.98, 1.0, 1.01]), measured_mode(2, [2.6, 2.61])]
        >>> frame = StoreyFrame([1.0, 1.0], stiffness=[100.0, 100.0])
        >>> learned = identify(frame, {"k1": Interval(50, 200)}, modes, held_out=[2])
        >>> learned.is_refuted, learned.narrowed["k1"] < 0.5
        (False, True)
    """
    evidence = Evidence.of(frame, inputs, modes, held_out=held_out, alpha=alpha)
    numbers, nominal = evidence.prior, evidence.chain.nominal
    levels, empty = np.asarray(alpha, float), 1.0
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
        nothing = np.full((len(levels), len(numbers)), np.inf)
        return Identified(evidence, levels, nothing, -nothing, empty)
    boxes += [boxes[-1]] * (len(levels) - len(boxes))
    lower, upper = (nominal * np.exp(np.stack(side)) for side in zip(*boxes, strict=True))
    least, greatest = np.array([widest_cut(x) for x in numbers.values()]).T
    # rounding of exp, outwards and within the priors
    lower, upper = np.maximum(lower * (1 - 4e-16), least), np.minimum(upper * (1 + 4e-16), greatest)
    return Identified(evidence, levels, lower, upper, empty)


def widest_cut(number: FuzzyNumber) -> Cut:
    """Return the widest cut that a number decides."""
    return number.cut(number.decided) if isinstance(number, ClaimedNumber) else number.support


@dataclass(frozen=True, eq=False)
class Evidence:
    """Opinions and claims on a frame's parameters and on its modes.

    Args:
        chain: The frame.
        prior: Its parameters before the measurement, in SI.
        measured: The modes that are learned from, by rising number.
        held_out: The modes that are not, by rising number.
    """

    chain: Chain
    prior: Mapping[str, FuzzyNumber]
    measured: tuple[MeasuredMode, ...]
    held_out: tuple[MeasuredMode, ...] = ()

    @classmethod
    def of(
        cls,
        frame: StoreyFrame,
        inputs: Mapping[str, FuzzyNumber | float],
        modes: Sequence[MeasuredMode],
        *,
        held_out: Sequence[int],
        alpha: Sequence[float],
    ) -> Self:
        """Return what `identify` learns from; refuse what it refuses."""
        is_frame = isinstance(frame, StructureModel) and frame.floors > 0
        require(is_frame, "frame", value=type(frame).__name__, allowed="a StoreyFrame")
        levels = np.append(0.0, alpha)
        in_range = len(levels) > 1 and levels[-1] <= 1 and bool((np.diff(levels) > 0).all())
        require(in_range, "identify.alpha", value=list(alpha), allowed="rising in (0, 1]")
        mode_numbers = [mode.mode for mode in modes]
        are_rising = bool(modes) and sorted(set(mode_numbers)) == mode_numbers
        require(are_rising, "identify.modes", value=mode_numbers, allowed="one or more, rising")
        is_part = set(held_out) < set(mode_numbers)
        shown, allowed = ", ".join(map(str, held_out)), f"some of modes {mode_numbers}, not all"
        require(is_part, "identify.held_out", value=shown, allowed=allowed)
        learned = tuple(mode for mode in modes if mode.mode not in held_out)
        largest = max(x for mode in learned for x in (mode.mode, mode.reference, *mode.shape))
        allowed = f"modes and floors from 1 to {frame.floors}"
        require(largest <= frame.floors, "identify.modes", value=largest, allowed=allowed)
        for mode in learned:
            mode.require_scatter()
        prior = {
            name: number if isinstance(number, FuzzyNumber) else Crisp(float(number))
            for name, number in inputs.items()
        }
        chain = Chain(frame, tuple(prior))
        smallest = min(widest_cut(number).lower for number in prior.values())
        require(smallest > 0, "identify.parameters", value=smallest, allowed="positive priors")
        rest = tuple(mode for mode in modes if mode.mode in held_out)
        return cls(chain, prior, learned, rest)

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
    """Parameters of a frame that agree with its measured modes, in proved boxes.

    Args:
        evidence: Priors and measured modes.
        alpha: Levels, shape (A,), rising.
        lower: Lower ends of boxes proved to hold the sets, shape (A, d), in SI units. From `empty`
            on they repeat the last one that is not proved empty; of a refuted frame they are +∞.
        upper: Upper ends; of a refuted frame −∞.
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
    def is_refuted(self) -> bool:
        """Whether no parameters in their priors agree with the modes at the lowest level."""
        return bool(self.empty <= self.alpha[0])

    @property
    def refutation(self) -> str:
        """What the measurement says of a refuted frame; empty of others."""
        if not self.is_refuted:
            return ""
        level = f"{self.alpha[0]:g}"
        return (
            f"no parameters in their priors agree with the measured modes at α = {level}:"
            f" a storey frame with such parameters is refuted (by chance with P <= {level});"
            " widen the priors, or check masses and numbers of modes"
        )

    @property
    def claim(self) -> JointClaim:
        """Coverage of the boxes: the claims, and the conditions under which they hold."""
        joint = JointClaim.from_inputs(self.evidence.numbers)
        model = ("the structure is such a storey frame",)
        return JointClaim(self.evidence.joint, (*joint.conditions, *model), joint.opinions)

    @property
    def inputs(self) -> dict[str, FuzzyNumber]:
        """Identified parameters as fuzzy numbers, by name, for an envelope.

        Their cuts are the sides of the boxes, which hold structures that do not agree with the
        modes: results are those of the box around the learned set, and say so. Below the lowest
        level they are the prior's support.
        Where priors or measurements are claims, so are the numbers, with one joint confidence.

        Raises:
            RefutedError: The frame is refuted.
        """
        if self.is_refuted:
            raise RefutedError(self.refutation)
        rule, priors = self.evidence.joint, self.evidence.prior
        numbers: dict[str, FuzzyNumber] = {}
        for column, name in enumerate(self.names):
            ends = np.stack([self.lower[:, column], self.upper[:, column]])
            alpha, decided = self.alpha, float(self.alpha[0])
            if not isinstance(priors[name], ClaimedNumber):
                alpha, decided = np.append(0.0, alpha), 0.0
                ends = np.column_stack([priors[name].support, ends])
            numbers[name] = steps = outer_steps(
                tuple(alpha), tuple(ends[0]), tuple(ends[1]), encloses=LEARNED
            )
            if rule is not None:
                claim = CoverageClaim(rule.means, self.claim.conditions)
                numbers[name] = ClaimedNumber(steps, claim, decided, joint=rule)
        return numbers

    @property
    def narrowed(self) -> dict[str, float]:
        """Width of each parameter's box at the lowest level over that of its prior there."""
        level = float(self.alpha[0])
        cuts = [self.evidence.cut(number, level) for number in self.evidence.prior.values()]
        fractions = (self.upper - self.lower)[0] / np.array([cut.width for cut in cuts])
        return dict(zip(self.names, fractions.tolist(), strict=True))

    def predictions(self) -> Predictions:
        """Return proved bounds of all n natural frequencies on each level.

        Of a refuted frame there are none: lower bounds are +∞ and upper ones −∞.
        """
        chain = self.evidence.chain
        measured = [*self.evidence.measured, *self.evidence.held_out]
        means = {mode.mode: mode.frequency.nominal for mode in measured}
        ends = np.full((2, len(self.alpha), len(chain.mass)), np.inf)
        ends[1] = -np.inf
        if not self.is_refuted:
            boxes = np.log(np.stack([self.lower, self.upper], axis=1) / chain.nominal)  # (A, 2, d)
            eigenvalues = np.array([eigenvalue_ranges(chain, *box) for box in boxes])  # (A, 2, n)
            ends = np.sqrt(np.maximum(eigenvalues, 0.0)).swapaxes(0, 1) / (2 * np.pi)
        learned_from = tuple(mode.mode for mode in self.evidence.measured)
        return Predictions(self.alpha, ends[0], ends[1], measured=means, learned_from=learned_from)

    @cached_property
    def answer(self) -> LearnedInputs:
        """What was learned, as data for tables and files."""
        if self.is_refuted:
            return LearnedInputs(self.alpha, {}, {}, {}, "", (), {}, refuted=self.refutation)
        cuts = {name: widest_cut(number) for name, number in self.evidence.prior.items()}
        return LearnedInputs(
            alpha=self.alpha,
            inputs={
                name: Ends(self.lower[:, column], self.upper[:, column])
                for column, name in enumerate(self.names)
            },
            narrowed=self.narrowed,
            units={name: of_storey_frame(name).unit for name in self.names},
            claim=str(self.claim),
            held_out=self.predictions().held_out,
            prior={name: (cut.lower, cut.upper) for name, cut in cuts.items()},
        )

    def __str__(self) -> str:
        """Return the words of `answer`: each parameter before and after, and the held-out modes."""
        return str(self.answer)
