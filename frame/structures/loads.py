"""Forces on a structure, and checks of what moves it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from alphacut.base.arrays import Array, Mask
from alphacut.base.errors import require, require_sequence
from alphacut.frame.records.history import Accelerogram, History

Factor = Callable[[Mapping[str, Any]], Any]


@dataclass(frozen=True, eq=False)
class Force:
    """A force amplitude · f(t) on a structure.

    Args:
        at: Floor of a storey frame, from 1; or of a structure from matrices a row over its
            unknowns, shape (n,).
        amplitude: In N, of a storey frame the nominal value of its parameter "F" and the floor; of
            a structure from matrices a number, the name of a parameter or a function of them.
        history: f; None for an impulse at t = 0, whose amplitude is in N s ("J" and the floor).
        is_inertial: Whether it is the inertia force −M ι a(t) of a component of ground motion, made
            by the structure itself.
    """

    at: int | Array
    amplitude: Factor | str | float
    history: History | None
    is_inertial: bool = False


def history_keys(forces: Sequence[Force]) -> list[tuple[object, bool] | None]:
    """Return of each force a hashable key of its history and of whether it is an inertia force.

    It is None of impulses, which have no history. Histories are compared by their values, since
    equal ones are often made twice. A force and an inertia force have different keys, because only
    the former adds to absolute accelerations at once.
    """
    keys: list[tuple[object, bool] | None] = []
    for force in forces:
        history = force.history
        keys.append(None if history is None else (history.identity, force.is_inertial))
    return keys


def distinct_histories(forces: Sequence[Force]) -> list[History]:
    """Return the histories of forces, each once, in the order of their first use.

    One is twice in the list if a force and an inertia force have it, see `history_keys`.
    """
    histories: dict[object, History] = {}
    for key, force in zip(history_keys(forces), forces, strict=True):
        if force.history is not None:
            histories.setdefault(key, force.history)
    return list(histories.values())


def adds_at_once(forces: Sequence[Force]) -> Mask:
    """Return which of the distinct histories add to absolute accelerations at once, in their order.

    A force b f(t) adds M⁻¹ b f. An inertia force −M ι a of a ground acceleration a moves relative
    to the ground, whose part ι a of the absolute acceleration just cancels it.
    """
    keys = dict.fromkeys(key for key in history_keys(forces) if key is not None)
    return np.array([not is_inertial for _, is_inertial in keys], bool)


def require_loads(ground: object, forces: Sequence[object]) -> None:
    """Check the types of a base excitation and of the forces on a structure.

    Args:
        ground: An `Accelerogram`, or None for a base at rest.
        forces: A sequence of `Force`, which may be empty. The history of each must be a `History`,
            or None for an impulse.

    Raises:
        RefusedError: One of them is of another type.
    """
    is_record = isinstance(ground, Accelerogram | None)
    require(is_record, "ground", value=type(ground).__name__, allowed="an Accelerogram, or None")
    allowed = "a sequence of Force, each with a History or None"
    require_sequence("loads", forces, allowed)
    are_forces = all(isinstance(x, Force) and isinstance(x.history, History | None) for x in forces)
    require(are_forces, "loads", value=type(forces).__name__, allowed=allowed)
