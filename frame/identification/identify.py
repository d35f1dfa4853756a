"""Parameters of a storey frame from its measured natural modes.

On each level, the cuts of all priors and of all measured quantities leave a set of parameters. If
the claims among them hold together with a probability of 1 - α or more, the set contains the true
parameters with this probability, provided that the opinions and the model are right. A box that
encloses the set is proved by linear relaxations (`enclosure`). The predictions are the natural
frequencies of the frames in the box.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import FailedError, require
from alphacut.frame.identification.contraction import contracted
from alphacut.frame.identification.enclosure import enclosure
from alphacut.frame.identification.learned import LearnedInputs, Predictions
from alphacut.frame.identification.modes import Chain, MeasuredMode, ModeCut, eigenvalue_ranges
from alphacut.frame.structures.model import StructureModel
from alphacut.frame.structures.quantities import of_storey_frame
from alphacut.frame.structures.storey import StoreyFrame
from alphacut.fuzzy import FuzzyNumber
from alphacut.fuzzy.knowledge.joint import JointClaim
from alphacut.fuzzy.result import Ends
from alphacut.fuzzy.sets.boxes import fuzzy_inputs
from alphacut.fuzzy.sets.claimed import ClaimedNumber, CoverageClaim, JointRule, widest_cut
from alphacut.fuzzy.sets.numbers import Cut, outer_steps


class RefutedError(FailedError):
    """The inputs of a refuted frame were asked for; no parameters agree with its modes."""


def identify(
    frame: StoreyFrame,
    inputs: Mapping[str, FuzzyNumber | float],
    modes: Sequence[MeasuredMode],
    *,
    held_out: Sequence[int] = (),
    alpha: Sequence[float] = (0.05, 0.1, 0.25, 0.5, 0.75, 1.0),
) -> Identified:
    """Return boxes of a frame's parameters that agree with its measured natural modes.

    If no parameters agree with the modes, the frame is refuted. This is a result, see
    `Identified.refutation`.

    Args:
        frame: The frame; damping, initial state and outputs do not matter.
        inputs: Parameters of stiffness and mass as they are known before the measurement, as fuzzy
            numbers by name, in SI units.
        modes: The measured modes by rising number; see `read_modes` and `measured_mode`.
        held_out: Numbers of modes that are predicted instead of learned from.
        alpha: Levels, rising within (0, 1].

    Returns:
        Identified: the boxes' ends `lower` and `upper` in SI, shape (levels, parameters), `empty`,
        and the words `refutation` where no parameters agree.

    Raises:
        RefusedError: An input is no parameter of the modes; a mode, floor or level is out of range;
            no mode is left to learn from, or a mode has values without scatter.

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
    priors = evidence.prior.values()
    nominal = evidence.chain.nominal
    levels = np.asarray(alpha, float)
    lower = np.full((len(levels), len(priors)), np.inf)
    upper = -lower
    empty = 1.0
    # The corners of the last box, as logarithms of parameters over their nominal values.
    low, high = np.full((2, len(priors)), [[-np.inf], [np.inf]])
    for k, level in enumerate(map(float, levels)):
        # The sets are nested, so that the box of each level lies inside that of the last one.
        prior_cuts = np.array([evidence.cut(number, level) for number in priors])
        prior_low, prior_high = np.log(prior_cuts.T / nominal)
        low = np.maximum(prior_low, low)
        high = np.minimum(prior_high, high)
        box = None
        if (low <= high).all():
            cuts = evidence.modes(level)
            box = enclosure(evidence.chain, low, high, cuts)
            # Linear programs narrow little without shapes, whereas ranges of frequencies are exact.
            if box is not None and not any(mode.shape for mode in cuts):
                box = contracted(evidence.chain, box[0], box[1], cuts)
        if box is None:
            empty = level
            break
        low, high = box
        # This level, and all higher ones unless they are computed.
        lower[k:] = nominal * np.exp(low)
        upper[k:] = nominal * np.exp(high)

    # Rounding of the exponential function, outwards and within the priors.
    if np.isfinite(lower).all():
        prior_lower, prior_upper = np.array([widest_cut(number) for number in priors]).T
        lower = np.maximum(lower * (1 - 4e-16), prior_lower)
        upper = np.minimum(upper * (1 + 4e-16), prior_upper)
    return Identified(evidence, levels, lower, upper, empty)


@dataclass(frozen=True, eq=False)
class Evidence:
    """Opinions and claims on the parameters of a frame and on its modes.

    Args:
        chain: The frame.
        prior: Its parameters before the measurement, in SI units.
        measured: The modes that are learned from, by rising number.
        held_out: The modes that are predicted, by rising number.
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
        """Check the arguments of `identify`, and divide the modes into learned and held out.

        Args:
            frame: The frame.
            inputs: Parameters of stiffness and mass before the measurement, as fuzzy numbers by
                name, in SI units; a plain number is a crisp one.
            modes: Measured modes by rising number.
            held_out: Numbers of modes that are predicted instead of learned from. They may be
                modes that the frame does not have, and may have values without scatter.
            alpha: Levels.

        Raises:
            RefusedError: The frame is no storey frame; levels do not rise within (0, 1]; modes do
                not rise, or all are held out, or one that is not measured is; a mode or floor that
                is learned from is not one of the frame or has values without scatter; or an input
                is missing, no number, no parameter of stiffness or mass, or not positive.
        """
        is_frame = isinstance(frame, StructureModel) and frame.floors > 0
        require(is_frame, "frame", value=type(frame).__name__, allowed="a StoreyFrame")
        levels = np.append(0.0, alpha)
        are_rising = bool((np.diff(levels) > 0).all()) and len(alpha) > 0 and levels[-1] <= 1
        require(are_rising, "identify.alpha", value=list(alpha), allowed="rising in (0, 1]")
        numbers = [mode.mode for mode in modes]
        are_rising = bool(modes) and sorted(set(numbers)) == numbers
        require(are_rising, "identify.modes", value=numbers, allowed="one or more, rising")
        is_part = set(held_out) < set(numbers)
        shown = ", ".join(map(str, held_out))
        allowed = f"some of modes {numbers}, not all"
        require(is_part, "identify.held_out", value=shown, allowed=allowed)

        # Modes that are held out may be of any number and without scatter: nothing is learned from
        # them.
        measured = tuple(mode for mode in modes if mode.mode not in held_out)
        for mode in measured:
            largest = max(mode.mode, mode.reference, *mode.shape)
            allowed = f"modes and floors from 1 to {frame.floors}"
            require(largest <= frame.floors, "identify.modes", value=largest, allowed=allowed)
            mode.require_scatter()
        prior = fuzzy_inputs(inputs)
        chain = Chain(frame, tuple(prior))
        # Parameters enter by their logarithms.
        smallest = min(widest_cut(number).lower for number in prior.values())
        require(smallest > 0, "identify.parameters", value=smallest, allowed="positive priors")
        return cls(chain, prior, measured, tuple(x for x in modes if x.mode in held_out))

    @cached_property
    def numbers(self) -> dict[str, FuzzyNumber]:
        """Parameters and then measured quantities by name."""
        numbers = dict(self.prior)
        for mode in self.measured:
            numbers |= mode.quantities
        return numbers

    @cached_property
    def joint(self) -> JointRule | None:
        """Rule by which the claims hold together; None if there is no claim."""
        names = tuple(name for name, x in self.numbers.items() if isinstance(x, ClaimedNumber))
        if not names:
            return None
        means = "parameter of the measured frame"
        return JointRule(names, independent=False, means=means, named=True)

    def cut(self, number: FuzzyNumber, alpha: float) -> Cut:
        """Return the cut of a parameter or measured quantity for the joint set of a level.

        An opinion is cut at α. A claim holds with a certain probability. n claims hold together
        with a probability of 1 - α or more if each holds with a probability of 1 - α/n, by the
        inequality of Bonferroni, so that each claim is cut at α/n.

        Args:
            number: Opinion or claim, one of those of this evidence.
            alpha: Level α of the set, in (0, 1].
        """
        if self.joint is not None and isinstance(number, ClaimedNumber):
            return number.cut(alpha / len(self.joint.names))
        return number.cut(alpha)

    def modes(self, alpha: float) -> list[ModeCut]:
        """Return the ranges of the modes that are learned from on a level."""
        return [mode.ranges(lambda number: self.cut(number, alpha)) for mode in self.measured]


@dataclass(frozen=True, eq=False)
class Identified:
    """Parameters of a frame that agree with its measured modes, in proved boxes.

    Args:
        evidence: Priors and measured modes.
        alpha: Levels, rising, shape (levels,).
        lower: Lower ends of the boxes that contain the sets, shape (levels, parameters), in SI
            units. From the level `empty` on they repeat the last box. For a refuted frame they are
            +∞.
        upper: Upper ends, same shape; for a refuted frame -∞.
        empty: Lowest level whose set is proved to be empty; 1 if none is.
    """

    evidence: Evidence
    alpha: Array
    lower: Array
    upper: Array
    empty: float

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters."""
        return self.evidence.chain.names

    @property
    def is_refuted(self) -> bool:
        """Whether no parameters in their priors agree with the modes on the lowest level."""
        return bool(self.empty <= self.alpha[0])

    @property
    def refutation(self) -> str:
        """A sentence that says that the measured modes refute the frame; empty if they do not.

        A frame is refuted if it is proved that no parameters within their priors agree with the
        modes on the lowest level.
        """
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
        """The claims on the coverage of the boxes, and the conditions under which they hold."""
        joint = JointClaim.from_inputs(self.evidence.numbers)
        conditions = (*joint.conditions, "the structure is such a storey frame")
        return JointClaim(self.evidence.joint, conditions, joint.opinions)

    @property
    def inputs(self) -> dict[str, FuzzyNumber]:
        """Identified parameters by name, as fuzzy numbers in SI units for an envelope.

        Their cuts are the sides of the boxes that were proved to contain all parameters which agree
        with the modes; between two levels the wider cut holds. The boxes also contain structures
        that do not agree with the modes, so that the numbers say that they enclose "the learned
        set". Below the lowest level the cut of a parameter is the support of its prior, unless the
        prior is a claim, which says nothing there. If any prior or measured quantity is a claim,
        all numbers are claims that hold together.

        Raises:
            RefutedError: The frame is refuted.
        """
        if self.is_refuted:
            raise RefutedError(self.refutation)
        numbers: dict[str, FuzzyNumber] = {}
        for column, name in enumerate(self.names):
            prior = self.evidence.prior[name]
            alpha = self.alpha
            decided = float(self.alpha[0])
            lower = self.lower[:, column]
            upper = self.upper[:, column]
            # An opinion has a support, which is the cut of level 0; a claim says nothing below its
            # level.
            if not isinstance(prior, ClaimedNumber):
                alpha = np.append(0.0, alpha)
                decided = 0.0
                lower = np.append(prior.support.lower, lower)
                upper = np.append(prior.support.upper, upper)
            steps = outer_steps(
                tuple(alpha), tuple(lower), tuple(upper), encloses="the learned set"
            )
            numbers[name] = steps
            rule = self.evidence.joint
            if rule is not None:
                claim = CoverageClaim(rule.means, self.claim.conditions)
                numbers[name] = ClaimedNumber(steps, claim, decided, joint=rule)
        return numbers

    @property
    def narrowed(self) -> dict[str, float]:
        """Width of the box of each parameter over the width of its prior, on the lowest level."""
        level = float(self.alpha[0])
        # The prior is cut at the same joint level, so that only the measurement narrows it.
        widths = [self.evidence.cut(x, level).width for x in self.evidence.prior.values()]
        fractions = (self.upper[0] - self.lower[0]) / np.array(widths)
        return dict(zip(self.names, fractions.tolist(), strict=True))

    def predictions(self) -> Predictions:
        """Return proved bounds of all natural frequencies of the frame over the box of each level.

        They are in Hz, shape (levels, modes), by rising frequency; the frame has as many modes as
        floors. Beside them stand the mean measured frequencies of all modes, by number, those that
        are held out included. For a refuted frame lower bounds are +∞ and upper bounds are -∞.
        """
        chain = self.evidence.chain
        lower = np.full((len(self.alpha), len(chain.mass)), np.inf)
        upper = -lower
        if not self.is_refuted:
            for k in range(len(self.alpha)):
                low = np.log(self.lower[k] / chain.nominal)
                high = np.log(self.upper[k] / chain.nominal)
                # Rounding may make a bound of a small eigenvalue negative.
                eigenvalues = np.maximum(eigenvalue_ranges(chain, low, high), 0.0)
                lower[k], upper[k] = np.sqrt(eigenvalues) / (2 * np.pi)
        modes = self.evidence.measured + self.evidence.held_out
        return Predictions(
            self.alpha,
            lower,
            upper,
            measured={mode.mode: mode.frequency.nominal for mode in modes},
            learned_from=tuple(mode.mode for mode in self.evidence.measured),
        )

    @cached_property
    def answer(self) -> LearnedInputs:
        """What was learned, as data for tables and files.

        It has the ends of the box of each parameter on all levels, by how much they were narrowed
        from the priors, what they claim, and the predictions of modes that were held out. For a
        refuted frame it has the levels and the refutation alone.
        """
        if self.is_refuted:
            return LearnedInputs(
                alpha=self.alpha,
                inputs={},
                narrowed={},
                units={},
                claim="",
                held_out=(),
                prior={},
                refuted=self.refutation,
            )
        inputs = {}
        prior = {}
        for column, name in enumerate(self.names):
            inputs[name] = Ends(self.lower[:, column], self.upper[:, column])
            before = widest_cut(self.evidence.prior[name])
            prior[name] = (before.lower, before.upper)
        return LearnedInputs(
            alpha=self.alpha,
            inputs=inputs,
            narrowed=self.narrowed,
            units={name: of_storey_frame(name).unit for name in self.names},
            claim=str(self.claim),
            held_out=self.predictions().held_out,
            prior=prior,
        )

    def __str__(self) -> str:
        """Return `answer` as text: each parameter before and after, and the modes held out."""
        return str(self.answer)
