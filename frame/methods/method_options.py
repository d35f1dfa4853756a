"""The options that each method of an envelope takes."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import fields
from typing import Any

from alphacut.frame.calculus.numbers import require_number
from alphacut.frame.methods.batch_graph_follower import BatchFollower
from alphacut.frame.methods.graph_follower import GraphFollower
from alphacut.frame.methods.modal import Modal

CLASSES: dict[str, type[Any]] = {
    "modal": Modal,
    "graph-follower": GraphFollower,
    "improved-graph-follower": BatchFollower,
}
"""Methods whose options are the fields of a class."""

COUNTS = {"samples": 1, "seed": 0, "batch": 1, "spread": 1, "workers": 1}
"""Options that count, with the least that each may be."""


def options_of(method: str | None, function: Callable[..., Any]) -> tuple[str, ...]:
    """Names of the options.

    Args:
        method: Name of the method; None for what is done where none is named: the options of auto
            and modal.
        function: The function that computes its envelope; its keyword arguments are the options
            where no class holds them.
    """
    if method in CLASSES:
        return tuple(field.name for field in fields(CLASSES[method]))
    own = [
        name
        for name, x in inspect.signature(function).parameters.items()
        if x.kind is inspect.Parameter.KEYWORD_ONLY
    ]
    more = [] if method else [field.name for field in fields(Modal)]
    return tuple(dict.fromkeys([*own, *more]))


def _require_count(name: str, value: Any) -> None:
    least = COUNTS.get(name)
    if least is not None and (value < least or value != int(value) or isinstance(value, float)):
        raise ValueError(
            f"option {name}: {value!r} is not allowed; it must be a whole number, {least} or"
            " greater"
        )


def require_options(
    method: str | None, function: Callable[..., Any], given: Mapping[str, Any]
) -> None:
    """Refuses options that a method does not have, and texts where numbers are wanted.

    Raises:
        ValueError: An option is unknown to the method, or is no number where one is wanted.
    """
    allowed = options_of(method, function)
    for name, value in given.items():
        if name not in allowed:
            of = f"the method {method}" if method else "the default method"
            raise ValueError(
                f"option '{name}' is unknown to {of}; it takes {', '.join(allowed) or 'none'}"
            )
        if name == "exclude" and isinstance(value, str):
            raise ValueError(
                f"exclude: {value!r} is not allowed; it must be a list of names, as [{value!r}]"
            )
        if name != "exclude" and value is not None:
            require_number(f"option {name}", value, "")
            _require_count(name, value)
