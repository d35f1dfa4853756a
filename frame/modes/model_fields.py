"""Changing all Taylor models of a record of modes at once, whatever its fields are called."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, is_dataclass, replace
from typing import Any, TypeVar

from alphacut.base.arrays import Array
from alphacut.frame.calculus.taylor_model import TaylorModel, all_on_subbox

T = TypeVar("T")


def with_models(value: T, change: Callable[[TaylorModel], TaylorModel]) -> T:
    """Return a copy of a value in which each Taylor model is replaced.

    Args:
        value: A Taylor model, or a list, named tuple or dataclass whose members may be any of
            these. Members without Taylor models are shared with the copy.
        change: Returns the model that takes the place of the given one. Models are taken in the
            order of the members.
    """
    found: Any = value
    if isinstance(value, TaylorModel):
        found = change(value)
    elif isinstance(value, list):
        found = [with_models(x, change) for x in value]
    elif hasattr(value, "_fields"):
        found = found._make(with_models(x, change) for x in found)
    elif is_dataclass(value):
        members = {x.name: getattr(value, x.name) for x in fields(value)}
        changed = {name: with_models(x, change) for name, x in members.items()}
        changed = {name: x for name, x in changed.items() if x is not members[name]}
        found = replace(found, **changed) if changed else value
    return found


def on_subbox(value: T, low: Array, high: Array) -> T:
    """Return a copy of a value whose Taylor models are those on the sub-box low ≤ u ≤ high.

    Args:
        value: As in `with_models`, with at least one Taylor model; all of the same d inputs.
        low: Lower ends of the sub-box, shape (d,), not below −1.
        high: Upper ends, not above 1 and not below `low`.
    """
    models = list[TaylorModel]()

    def collect(model: TaylorModel) -> TaylorModel:
        models.append(model)
        return model

    with_models(value, collect)
    # All are moved at once, which is faster than one by one.
    moved = iter(all_on_subbox(models, low, high))
    return with_models(value, lambda _: next(moved))
