"""Sampling plans: random or evenly spread points in every cut, for inner bounds."""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, log2
from typing import Literal

import numpy as np

from alphacut.fuzzy.samples.design import Design
from alphacut.fuzzy.samples.model import Model
from alphacut.fuzzy.samples.result import FuzzyResult
from alphacut.fuzzy.sets.boxes import Domain
from alphacut.fuzzy.sets.given import require_fields
from alphacut.fuzzy.sets.numbers import Array

_TRIES = 200  # rounds of drawing points that fulfil the interactions


@dataclass(frozen=True)
class _Sampling:
    """Points of the unit cube carried into every cut, shared by both plans.

    Args:
        samples: Points per level.
        seed: Where the points start from; the same seed gives the same points.

    Raises:
        ValueError: There is no sample.
    """

    samples: int = 256
    seed: int = 0

    stepwise = False  # all samples are known beforehand

    def __post_init__(self) -> None:
        require_fields(self)
        if self.samples < 1:
            raise ValueError(
                f"the number of samples per level is {self.samples}; it must be 1 or more"
            )

    def unit(self, count: int, inputs: int, *, level: int, turn: int) -> Array:
        """Points of the unit cube for a level, shape (count, inputs); `turn` counts repeats."""
        raise NotImplementedError

    def run(self, model: Model, domain: Domain) -> FuzzyResult:
        """Evaluate the samples of all levels; each level uses all that lie in its cut."""
        modal = domain.modal[None]
        points = [modal, *(self._points(domain, level) for level in range(len(domain.alpha)))]
        design = Design.from_samples(domain, np.unique(np.concatenate(points), axis=0))
        return design.bounds(model(design.points), plan=type(self).__name__)

    def _points(self, domain: Domain, level: int) -> Array:
        """Points of one cut, drawn again until enough fulfil the interactions."""
        lower, upper = (ends[level] for ends in domain.boxes)
        found = np.empty((0, len(lower)))
        for turn in range(_TRIES):
            unit = self.unit(self.samples, len(lower), level=level, turn=turn)
            drawn = np.clip(lower + unit * (upper - lower), lower, upper)
            found = np.concatenate([found, drawn[domain.slack(drawn, domain.alpha[level]) >= 0]])
            if len(found) >= self.samples or (lower == upper).all():
                break
        return found[: self.samples]


@dataclass(frozen=True)
class MonteCarlo(_Sampling):
    """Random points, uniform in every cut."""

    def unit(self, count: int, inputs: int, *, level: int, turn: int) -> Array:
        """Random points of the unit cube."""
        return np.random.default_rng([self.seed, level, turn]).random((count, inputs))


@dataclass(frozen=True)
class QuasiMonteCarlo(_Sampling):
    """Scrambled Sobol points in every cut.

    Args:
        samples: Points per level.
        seed: Where the scrambling starts from.
        density: "uniform", or "chebyshev", which is denser towards the ends of each cut, where
            extremes often are.

    Raises:
        ValueError: There is no sample or no such density.
    """

    density: Literal["uniform", "chebyshev"] = "uniform"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.density not in ("uniform", "chebyshev"):
            raise ValueError(
                f"the density is {self.density!r}; it must be 'uniform' or 'chebyshev'"
            )

    def unit(self, count: int, inputs: int, *, level: int, turn: int) -> Array:
        """Sobol points of the unit cube, by the density."""
        from scipy.stats import qmc

        rng = np.random.default_rng([self.seed, level, turn])
        unit: Array = qmc.Sobol(inputs, rng=rng).random_base2(ceil(log2(count)))[:count]
        return (1 - np.cos(np.pi * unit)) / 2 if self.density == "chebyshev" else unit
