"""Metamodel from boxes of the inputs to bounds of the outputs (section 7, [44]).

Unlike a surface in the model's place it needs no search afterwards: once trained, any fuzzy inputs
within the support that it was trained on get their bounds at once, without another run of the
model. What it learns from is another plan's bounds on many boxes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from alphacut.fuzzy.plans.transformation import Extended, General, Reduced
from alphacut.fuzzy.samples.model import Memo, Model
from alphacut.fuzzy.samples.nature import Nature
from alphacut.fuzzy.samples.result import FuzzyResult, Plan
from alphacut.fuzzy.sets.boxes import Domain
from alphacut.fuzzy.sets.given import require_fields
from alphacut.fuzzy.sets.numbers import Array, Interval, Rows

CORNERS = (
    "on one box the teacher {} has the corners alone, widened by the samples of other boxes within;"
    " where the function turns inside take Optimisation() or BranchAndBound(function) as teacher"
)
_SAFETY = 2  # the error elsewhere may be larger than on the boxes that were held out


@dataclass(frozen=True)
class Metamodel:
    """Trains a metamodel of the bounds and asks it for the cuts.

    Args:
        boxes: Boxes to learn from.
        held_out: Boxes more that it is tested on.
        teacher: Plan whose bounds on each box are learnt, at its cost for each of `boxes` and
            `held_out`, widened to hold the samples of all boxes that lie within. A box has one
            level, of which `Reduced`, `General` and `Extended` take the 2^n corners alone, enough
            where the model is monotone; where it turns inside, take `Optimisation()` or
            `BranchAndBound(function)`. The bounds are "estimated" where the teacher's are
            guaranteed, else "searched": the error holds what is seen of the teacher's misses.
        seed: Where the boxes are drawn from.

    Raises:
        ValueError: There are too few boxes.
    """

    boxes: int = 200
    held_out: int = 50
    teacher: Plan = field(default_factory=Reduced)
    seed: int = 0

    def __post_init__(self) -> None:
        require_fields(self)
        if self.boxes < 2 or self.held_out < 1:
            raise ValueError(
                f"the metamodel has {self.boxes} boxes and {self.held_out} held out; it needs 2 and"
                " 1 at least"
            )

    stepwise = True  # samples depend on those before

    def run(self, model: Model, domain: Domain) -> FuzzyResult:
        """Train on boxes within the support and predict the bounds of every cut."""
        return self.train(model, domain).bounds(domain)

    def train(self, model: Model, domain: Domain) -> TrainedBounds:
        """Learn the bounds of every output from boxes within the support of the inputs.

        Args:
            model: The model.
            domain: Its inputs; only their supports matter.

        Raises:
            ValueError: No input has a width.
        """
        from scipy.interpolate import RBFInterpolator

        domain.require_free("Metamodel")
        memo = Memo(model)
        lower, upper = (ends[0] for ends in Domain(domain.inputs, (0.0,)).boxes)
        moving = np.flatnonzero(upper > lower)
        if not len(moving):
            raise ValueError(
                "no input has a width, so there is nothing to train a metamodel on; take Reduced,"
                " which runs the model once"
            )
        unit = self._boxes(len(moving))
        boxes = [_real(box, lower, upper, moving) for box in unit]
        lessons = []
        for row, box in enumerate(boxes):
            lessons.append(self._taught(memo, domain, box))
            model.report(0.9 * (row + 1) / len(unit))
        at, values = memo.points, memo.values
        pairs = zip(lessons, boxes, strict=True)
        taught = np.array([_widened(lesson, box, at, values.array) for lesson, box in pairs])
        proved = all(result.nature is Nature.GUARANTEED for result in lessons)
        features, targets = unit.reshape(len(unit), -1), taught.reshape(len(unit), -1)
        learn, test = slice(0, self.boxes + 2), slice(self.boxes + 2, None)
        predict = RBFInterpolator(features[learn], targets[learn], kernel="cubic", degree=1)
        missed = np.abs(predict(features[test]) - targets[test]).reshape(-1, 2, taught.shape[2])
        each = len(memo) / len(unit)
        notes = [f"the teacher {type(self.teacher).__name__} took {each:.3g} runs a box"]
        if isinstance(self.teacher, Reduced | General | Extended):
            notes.append(CORNERS.format(type(self.teacher).__name__))
        support, most = (lower, upper), missed.max(axis=(0, 1))
        base = Nature.ESTIMATED if proved else Nature.SEARCHED
        return TrainedBounds(values.columns, support, predict, most, len(memo), base, (*notes,))

    def _boxes(self, inputs: int) -> Array:
        """Boxes of the unit cube, shape (n, 2, inputs): the cube, its middle, spread ones."""
        from scipy.stats import qmc

        pairs = qmc.Halton(2 * inputs, rng=np.random.default_rng(self.seed)).random(
            self.boxes + self.held_out
        )
        ends = np.sort(pairs.reshape(-1, 2, inputs), axis=1)
        first = np.array([[[0.0] * inputs, [1.0] * inputs], [[0.5] * inputs, [0.5] * inputs]])
        return np.concatenate([first, ends])

    def _taught(self, memo: Memo, domain: Domain, box: Array) -> FuzzyResult:
        """The teacher's bounds on a box."""
        inputs = {name: Interval(*box[:, i]) for i, name in enumerate(domain.names)}
        return self.teacher.run(memo, Domain(inputs, (0.0,)))


def _widened(taught: FuzzyResult, box: Array, points: Array, values: Array) -> Array:
    """Bounds on a box that hold every sample within, whatever it was for, shape (2, outputs)."""
    within = ((points >= box[0]) & (points <= box[1])).all(axis=1)
    seen = np.concatenate([taught.lower, taught.upper, values[within]])
    return np.array([seen.min(axis=0), seen.max(axis=0)])


def _real(box: Array, lower: Array, upper: Array, moving: Rows) -> Array:
    """A box of the unit cube as a box of the inputs, shape (2, inputs)."""
    ends = np.array([lower, lower])
    ends[:, moving] += box * (upper - lower)[moving]
    return np.clip(ends, lower, upper)


@dataclass(frozen=True)
class TrainedBounds:
    """A trained metamodel of the bounds.

    Args:
        outputs: Names of the outputs.
        support: Corners of the box that it was trained on, two arrays (inputs,).
        predict: From boxes of the unit cube (n, 2 · moving inputs) to bounds (n, 2 · outputs).
        missed: Largest error on the boxes that were held out, shape (outputs,).
        runs: Samples of the model that the training took.
        base: What its bounds are worth.
        notes: What is to be said of the teacher, one sentence each.
    """

    outputs: tuple[str, ...]
    support: tuple[Array, Array]
    predict: Callable[[Array], Array]
    missed: Array
    runs: int
    base: Nature
    notes: tuple[str, ...] = ()

    def bounds(self, domain: Domain) -> FuzzyResult:
        """Predicted bounds of every cut, nested, without a run of the model.

        Raises:
            ValueError: An input leaves the support that the metamodel was trained on.
        """
        domain.require_free("Metamodel")
        (low, high), (lower, upper) = self.support, domain.boxes
        width = high - low
        if (lower < low - 1e-12 * width).any() or (upper > high + 1e-12 * width).any():
            known = f"{low.tolist()} to {high.tolist()}"
            raise ValueError(
                f"the inputs leave the support that the metamodel was trained on, {known}; train it"
                " anew"
            )
        moving = width > 0
        unit = np.stack(
            [(lower - low)[:, moving] / width[moving], (upper - low)[:, moving] / width[moving]],
            axis=1,
        )
        ends = self.predict(np.clip(unit, 0, 1).reshape(len(unit), -1)).reshape(len(unit), 2, -1)
        least, most = ends.min(axis=1), ends.max(axis=1)
        nested = np.minimum.accumulate(least[::-1])[::-1], np.maximum.accumulate(most[::-1])[::-1]
        # a metamodel of bounds does not say where they are reached
        places = np.full((*least.shape, lower.shape[1]), np.nan)
        return FuzzyResult(
            domain=domain,
            outputs=self.outputs,
            lower=nested[0],
            upper=nested[1],
            lower_at=places,
            upper_at=places,
            base=self.base,
            plan="metamodel",
            runs=self.runs,
            error=np.broadcast_to(_SAFETY * self.missed, least.shape).copy(),
            proved=np.zeros(least.shape, bool),
            enforced=(nested[0] < least) | (nested[1] > most),
            notes=(self._told(), *self.notes),
        )

    def _told(self) -> str:
        missed = [f"{x:.3g} of {name}" for name, x in zip(self.outputs, self.missed, strict=True)]
        shown = ", ".join([*missed[:4], *(["…"] if len(missed) > 4 else [])])
        return (
            f"the metamodel missed its teacher's bounds of held-out boxes by up to {shown}; the"
            f" error is {_SAFETY} times that, and what the teacher misses is not in it"
        )
