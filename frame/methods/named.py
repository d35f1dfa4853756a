"""The methods by their names, and what may be asked of each."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields
from typing import Protocol

from alphacut.frame.boxes import UnitFlow
from alphacut.frame.calculus.numbers import require_count, require_number
from alphacut.frame.envelope import Envelope
from alphacut.frame.methods.auto import Auto
from alphacut.frame.methods.batch_graph_follower import BatchFollower
from alphacut.frame.methods.graph_follower import GraphFollower
from alphacut.frame.methods.modal import Modal
from alphacut.frame.methods.sampling import MonteCarlo, QuasiMonteCarlo, Vertex


class Method(Protocol):
    """How an envelope is found; a frozen dataclass whose fields are its options."""

    def run(self, flow: UnitFlow, progress: Callable[[float], None] | None = None) -> Envelope:
        """Envelope of all outputs on all levels."""


METHODS: dict[str, type[Method]] = {
    "auto": Auto,
    "modal": Modal,
    "graph-follower": GraphFollower,
    "improved-graph-follower": BatchFollower,
    "vertex": Vertex,
    "monte-carlo": MonteCarlo,
    "quasi-monte-carlo": QuasiMonteCarlo,
}
COUNTS = {"samples": 1, "seed": 0, "batch": 1, "spread": 1, "workers": 1, "passes": 1}
"""Options that count, with the least that each may be."""


def options_of(name: str) -> tuple[str, ...]:
    """Names of a method's options."""
    return tuple(field.name for field in fields(METHODS[name]))  # type: ignore[arg-type]


def named(name: str, options: Mapping[str, object]) -> Method:
    """The method of that name.

    Raises:
        ValueError: The name or an option is unknown, or an option's value is out of its range.
    """
    if name not in METHODS:
        raise ValueError(f"method: '{name}' is unknown; allowed are {', '.join(METHODS)}")
    allowed = options_of(name)
    for option, value in options.items():
        if option not in allowed:
            raise ValueError(
                f"option '{option}' is unknown to the method {name}; it takes"
                f" {', '.join(allowed) or 'none'}"
            )
        if option == "exclude" and isinstance(value, str):
            raise ValueError(
                f"exclude: {value!r} is not allowed; it must be a list of names, as [{value!r}]"
            )
        if option != "exclude" and value is not None:
            require_number(f"option {option}", value, "")
            require_count(f"option {option}", value, COUNTS.get(option))
    return METHODS[name](**options)
