"""Forces on a structure, and checks of what moves it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from alphacut.base.arrays import Array
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


def distinct_histories(forces: Sequence[Force]) -> list[History]:
    """Return the histories of forces, each once, in the order of their first use."""
    histories = {force.history.identity: force.history for force in forces if force.history}
    return list(histories.values())


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
