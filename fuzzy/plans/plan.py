"""The one interface of all plans."""

from __future__ import annotations

from typing import Protocol

from alphacut.fuzzy.samples.model import Model
from alphacut.fuzzy.samples.result import FuzzyResult
from alphacut.fuzzy.sets.boxes import Domain


class Plan(Protocol):
    """A way to search the boxes of the inputs for the extremes of a model."""

    @property
    def stepwise(self) -> bool:
        """True if samples depend on those before, so that the plan reports its progress."""

    def run(self, model: Model, domain: Domain) -> FuzzyResult:
        """Bounds of every output of the model on every level."""
