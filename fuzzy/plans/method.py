"""A method: a frozen dataclass that runs."""

from __future__ import annotations

from typing import Protocol

from alphacut.fuzzy.campaign.campaign import Campaign
from alphacut.fuzzy.result import Bounds
from alphacut.fuzzy.sets.boxes import Domain


class Method(Protocol):
    """A way to search the boxes of the inputs for the extremes of a model."""

    @property
    def name(self) -> str:
        """The word for it in a case file."""

    def run(self, campaign: Campaign, domain: Domain) -> Bounds:
        """Bounds of every output on every level."""
