"""Metamodel from boxes of the inputs to bounds of the outputs (section 7, [44]).

Unlike a surface in the model's place it needs no search afterwards: once trained, any fuzzy inputs
within the support that it was trained on get their bounds at once, without another evaluation. What
it learns from is another method's bounds on many boxes.

Its error is twice the largest miss on boxes that it was not trained on, plus what samples of other
boxes show that it misses. Where that is more than a quarter of an output's width, as with a jump,
the surface is not to be trusted: the bounds of that output are then those that the samples attain.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from alphacut.fuzzy.arrays import Array, Mask
from alphacut.fuzzy.plans.method import Method
from alphacut.fuzzy.plans.transformation import Reduced
from alphacut.fuzzy.refused import FailedError, real, require
from alphacut.fuzzy.result import Bounds, Nature
from alphacut.fuzzy.samples.model import Memo, Model, Samples
from alphacut.fuzzy.sets.boxes import Domain
from alphacut.fuzzy.sets.numbers import Interval

_SAFETY = 2  # the error elsewhere may be larger than on the boxes that were held out
_TRUSTED = 0.25  # of the width: a larger error is none


@dataclass(frozen=True)
class Metamodel:
    """Trains a metamodel of the bounds and asks it for the cuts.

    Args:
        boxes: Boxes to learn from.
        held_out: Boxes more that it is tested on.
        teacher: Method whose bounds on each box are learnt, at its cost for each of `boxes` and
            `held_out`, widened to hold the samples of all boxes that lie within. `Reduced` takes
            the corners alone, enough where the model is monotone; where it turns inside, take
            `Optimisation()`.
        seed: Where the boxes are drawn from.

    Raises:
        RefusedError: There are too few boxes.
    """

    boxes: int = 200
    held_out: int = 50
    teacher: Method = field(default_factory=Reduced)
    seed: int = 0

    name = "metamodel"

    def __post_init__(self) -> None:
        for key in ("boxes", "held_out"):
            real(key, getattr(self, key), positive=True, whole=True)
        real("seed", self.seed, whole=True)

    def run(self, model: Model, domain: Domain) -> Bounds:
        """Train on boxes within the support and predict the bounds of every cut."""
        return self.train(model, domain).bounds(domain)

    def train(self, model: Model, domain: Domain) -> TrainedBounds:
        """Learn the bounds of every output from boxes within the support of the inputs.

        Args:
            model: The model.
            domain: Its inputs; only their supports matter.

        Raises:
            RefusedError: No input has a width.
        """
        from scipy.interpolate import RBFInterpolator

        domain.require_free(self.name)
        memo = Memo(model)
        memo(domain.modal[None])
        support = lower, upper = tuple(ends[0] for ends in Domain(domain.inputs, (0.0,)).boxes)
        moving = upper > lower
        require(moving.any(), "inputs", domain.names, "one with a width or more")
        unit = self._boxes(int(moving.sum()))
        boxes = [_real(box, lower, upper, moving) for box in unit]
        for done, box in enumerate(boxes):
            inputs = {name: Interval(*box[:, i]) for i, name in enumerate(domain.names)}
            self.teacher.run(memo, Domain(inputs, (0.0,)))
            model.report(0.9 * (done + 1) / len(boxes))
        lessons = np.array([_extremes(box, memo.samples) for box in boxes])
        features, targets = unit.reshape(len(unit), -1), lessons.reshape(len(unit), -1)
        learn, test = slice(0, self.boxes + 2), slice(self.boxes + 2, None)
        predict = RBFInterpolator(features[learn], targets[learn], kernel="cubic", degree=1)
        missed = np.abs(predict(features[test]) - targets[test]).reshape(-1, 2, lessons.shape[2])
        return TrainedBounds(support, predict, missed.max(axis=(0, 1)), memo.samples)

    def _boxes(self, inputs: int) -> Array:
        """Boxes of the unit cube, shape (n, 2, inputs): the cube, its middle, spread ones."""
        from scipy.stats import qmc

        drawn = qmc.Halton(2 * inputs, rng=np.random.default_rng(self.seed))
        pairs = drawn.random(self.boxes + self.held_out)
        ends = np.sort(pairs.reshape(-1, 2, inputs), axis=1)
        first = np.array([[[0.0] * inputs, [1.0] * inputs], [[0.5] * inputs, [0.5] * inputs]])
        return np.concatenate([first, ends])


def _extremes(box: Array, samples: Samples) -> Array:
    """Least and greatest value of every sample within a box, shape (2, outputs)."""
    within = ((samples.points >= box[0]) & (samples.points <= box[1])).all(axis=1)
    values = samples.values.array[within]
    return np.array([np.nanmin(values, axis=0), np.nanmax(values, axis=0)])


def _real(box: Array, lower: Array, upper: Array, moving: Mask) -> Array:
    """A box of the unit cube as a box of the inputs, shape (2, inputs)."""
    ends = np.array([lower, lower])
    ends[:, moving] += box * (upper - lower)[moving]
    return np.clip(ends, lower, upper)


@dataclass(frozen=True)
class TrainedBounds:
    """A trained metamodel of the bounds.

    Args:
        support: Corners of the box that it was trained on, two arrays (inputs,).
        predict: From boxes of the unit cube (n, 2 · moving inputs) to bounds (n, 2 · outputs).
        missed: Largest error on the boxes that were held out, shape (outputs,).
        samples: Samples of the model that the training took.
    """

    support: tuple[Array, ...]
    predict: Callable[[Array], Array]
    missed: Array
    samples: Samples

    def bounds(self, domain: Domain) -> Bounds:
        """Predicted bounds of every cut, nested, without an evaluation of the model.

        Raises:
            RefusedError: An input leaves the support that the metamodel was trained on.
        """
        domain.require_free("metamodel")
        (low, high), (lower, upper) = self.support, domain.boxes
        near = 1e-12 * (high - low)
        inside = (lower >= low - near).all() and (upper <= high + near).all()
        allowed = f"within {low.tolist()} … {high.tolist()}, which it was trained on"
        require(inside, "inputs of the metamodel", lower[0].tolist(), allowed)
        least, most = self._predicted(lower, upper)
        seen_least, seen_most = self._seen(domain)
        lacking = np.maximum(np.maximum(least - seen_least, seen_most - most), 0)
        error = _SAFETY * (self.missed + lacking)
        trusted = (error <= _TRUSTED * np.ptp(self.samples.values.array, axis=0)).all(axis=0)
        if not (trusted | np.isfinite(seen_least).all(axis=0)).all():
            cure = "take Automatic or Optimisation, or more boxes"
            raise FailedError("the metamodel misses more than a quarter of an output's range", cure)
        natures = tuple(Nature.ESTIMATED if own else Nature.ATTAINED for own in trusted)
        places = np.full((*least.shape, lower.shape[1]), np.nan)  # a metamodel does not say where
        return Bounds(
            alpha=np.array(domain.alpha),
            lower=np.where(trusted, np.minimum(least, seen_least), seen_least),
            upper=np.where(trusted, np.maximum(most, seen_most), seen_most),
            lower_at=places,
            upper_at=places,
            error=np.where(trusted, error, 0.0),
            nature=min(natures, key=list(Nature).index),
            natures=natures,
            outputs=self.samples.values.columns,
            inputs=domain.inputs,
            method="metamodel",
            evaluations=len(self.samples.points),
            samples=self.samples,
        )

    def _seen(self, domain: Domain) -> tuple[Array, Array]:
        """Least and greatest sample of each cut, infinite where it has none, (levels, outputs)."""
        values = self.samples.values.array
        inside = domain.inside(self.samples.points)[..., None] & ~np.isnan(values)
        least = np.where(inside, values, np.inf).min(axis=1)
        return least, np.where(inside, values, -np.inf).max(axis=1)

    def _predicted(self, lower: Array, upper: Array) -> tuple[Array, Array]:
        """Lower and upper ends for boxes (n, inputs), nested, two arrays (n, outputs)."""
        (low, high), moving = self.support, self.support[1] > self.support[0]
        width = (high - low)[moving]
        ends = [(corner - low)[:, moving] / width for corner in (lower, upper)]
        unit = np.clip(np.stack(ends, axis=1), 0, 1).reshape(len(lower), -1)
        table = self.predict(unit).reshape(len(lower), 2, -1)
        least = np.minimum.accumulate(table.min(axis=1)[::-1])[::-1]
        return least, np.maximum.accumulate(table.max(axis=1)[::-1])[::-1]
