"""The methods by the words that a case file has for them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any, ClassVar, Protocol

from alphacut.frame.boxes import UnitFlow
from alphacut.frame.dual.proof import DualProof
from alphacut.frame.envelope import Envelope
from alphacut.frame.methods.auto import Auto
from alphacut.frame.methods.graph_follower import GraphFollower
from alphacut.frame.methods.improved_follower import ImprovedFollower
from alphacut.frame.methods.proof import Proof
from alphacut.frame.methods.sampled import Sampled
from alphacut.frame.methods.search import Search
from alphacut.fuzzy.progress_bar import Progress
from alphacut.fuzzy.refused import require


class Method(Protocol):
    """How an envelope is found; a frozen dataclass whose fields are its options."""

    name: ClassVar[str]

    def run(self, flow: UnitFlow, progress: Progress | None = None) -> Envelope:
        """Envelope of all outputs on all levels."""


METHODS: dict[str, type[Any]] = {
    x.name: x for x in (Auto, Proof, DualProof, Search, GraphFollower, ImprovedFollower, Sampled)
}


def options_of(name: str) -> tuple[str, ...]:
    """Names of a method's options."""
    return tuple(field.name for field in fields(METHODS[name]))


def named(name: str, options: Mapping[str, object]) -> Method:
    """The method of that name.

    Raises:
        RefusedError: The name or an option is unknown, or an option's value is out of its range.
    """
    require(name in METHODS, "method", name, ", ".join(METHODS))
    allowed = options_of(name)
    for option in options:
        require(option in allowed, f"option of {name}", option, ", ".join(allowed) or "none")
    method: Method = METHODS[name](**options)
    return method
