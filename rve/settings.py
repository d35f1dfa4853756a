"""Ranges of what the cell's models are given, each refused in one sentence."""

from __future__ import annotations

from collections.abc import Sequence

from alphacut.rve.cell import Phase

HALVES = "in halves of the cell's side"


def require_radius(radius: float) -> None:
    """Refuse a radius outside (0, 1).

    Raises:
        ValueError: It lies outside.
    """
    if not 0 < radius < 1:
        raise ValueError(f"the radius is {radius:g}; it must lie in (0, 1), {HALVES}")


def require_mesh_size(size: float) -> None:
    """Refuse an edge length outside (0, 1].

    Raises:
        ValueError: It lies outside.
    """
    if not 0 < size <= 1:
        raise ValueError(f"the mesh size is {size:g}; it must lie in (0, 1], {HALVES}")


def require_points(points: int | None) -> None:
    """Refuse a rule in θ of fewer than two nodes; None leaves their number to the model.

    Raises:
        ValueError: There are fewer.
    """
    if points is not None and points < 2:
        raise ValueError(f"the rule in θ has {points} points; it needs at least 2")


def require_accuracy(value: float, least: float, what: str) -> None:
    """Refuse a relative error outside [least, 0.1].

    Args:
        value: The error allowed.
        least: What can be reached.
        what: Its name, such as "accuracy of the table".

    Raises:
        ValueError: It lies outside.
    """
    if not least <= value <= 0.1:
        raise ValueError(f"the {what} is {value:g}; it must lie in [{least:g}, 0.1]")


def require_parts(radius_map: object, matrix: object, inclusions: object) -> None:
    """Refuse what a model cannot solve for: the parts in another order, or no row of inclusions.

    Raises:
        ValueError: The first is no radius map, the second no phase, or the third no row of phases,
            one at least.
    """
    row = inclusions if isinstance(inclusions, Sequence) else ()
    right = callable(radius_map) and hasattr(radius_map, "distribution")
    if not (right and isinstance(matrix, Phase) and row and all(isinstance(x, Phase) for x in row)):
        got = ", ".join(type(part).__name__ for part in (radius_map, matrix, inclusions))
        raise ValueError(
            f"solve got {got}{' (empty)' if inclusions in ([], ()) else ''}; it takes the radius"
            " map, the matrix's phase, and a list of the inclusions' phases, as"
            " solve(radius, Phase(3e9), [Phase(70e9)])"
        )
