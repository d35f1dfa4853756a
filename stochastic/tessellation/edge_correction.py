"""Cells seen through a window: which of them are whole, and how much each stands for.

A cell counts only if no disc whose centre lies beyond the window's edge could change it. Such a
disc, if none is larger than the largest one seen, shows no deeper in the window than that one's
radius; taking all that lies beyond for one such disc, the wall towards it is a parabola, ρ = (D +
r)/(1 + cos ψ), D the distance from the centre to the edge less the largest radius: the cell is
whole if ρ (1 + cos ψ) − r ≤ D all around, for all four edges. Large cells fail this more often than
small ones; each whole cell therefore stands for 1/p cells, p the share of places in the window
where its like would be whole (Miles 1974, Lantuéjoul 1978). This holds for a section that looks the
same everywhere, with every disc listed whose centre lies in the window.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from alphacut.stochastic.errors import UnfitDataError
from alphacut.stochastic.tessellation.apollonius import Apollonius
from alphacut.stochastic.theta.truncated_normal import Array

# directions of the left, right, lower and upper edge
EDGES = np.array([np.pi, 0.0, -np.pi / 2, np.pi / 2])


@dataclass(frozen=True, eq=False)
class WholeCells:
    """Cells to be counted, and their weights.

    Args:
        disc: Indices of the discs whose cells are whole, shape (k,).
        weight: Cells that each stands for, shape (k,); 1 in a periodic box.
    """

    disc: Array
    weight: Array


def whole_cells(diagram: Apollonius) -> WholeCells:
    """Cells clear of the window's edge, with weights that make up for the others.

    Raises:
        UnfitDataError: No cell is whole.
    """
    discs = diagram.discs
    if not discs.periodic:
        reach = _reach(diagram)
        inner, (x, y) = discs.size - 2 * discs.radii.max(), discs.centres.T - discs.radii.max()
        room = np.stack([x, inner[0] - x, y, inner[1] - y], axis=1)
        disc = np.flatnonzero((reach <= room).all(axis=1) & ~diagram.hidden & ~diagram.cut)
        if not len(disc):
            raise UnfitDataError(
                f"none of the {len(discs)} cells is whole within the window: take a larger window"
            )
        fits = (
            inner - np.stack([reach[disc, :2].sum(axis=1), reach[disc, 2:].sum(axis=1)], axis=1)
        ).prod(axis=1)
        return WholeCells(disc, discs.area / fits)
    disc = np.flatnonzero(~diagram.hidden)
    return WholeCells(disc, np.ones(len(disc)))


def _reach(diagram: Apollonius) -> Array:
    """Greatest ρ (1 + cos ψ) − r of each cell towards the four edges, shape (n, 4), in m.

    On an arc 1/ρ = C + M cos(φ − φ_j); ρ (1 + cos(φ − φ_e)) is greatest at an end of the arc or
    where its derivative vanishes.
    """
    near, far = diagram.wall()
    amplitude, constant = 1 / near + 1 / far, 1 / near - 1 / far
    towards = np.arctan2(diagram.apart[:, 1], diagram.apart[:, 0])
    reach = np.full((len(diagram.discs), 4), -np.inf)
    for edge, direction in enumerate(EDGES):
        for angle in (
            diagram.start,
            diagram.end,
            *_stationary(amplitude, constant, towards, direction),
        ):
            inside = diagram.start + np.mod(angle - diagram.start, 2 * np.pi)
            inside = np.where(inside <= diagram.end, inside, diagram.start)
            along = constant + amplitude * np.cos(inside - towards)
            with np.errstate(divide="ignore"):
                value = np.where(along > 0, (1 + np.cos(inside - direction)) / along, np.inf)
            np.maximum.at(reach[:, edge], diagram.cell, value)
    return reach - diagram.discs.radii[:, None]


def _stationary(
    amplitude: Array, constant: Array, towards: Array, direction: float
) -> tuple[Array, Array]:
    """The two angles at which ρ (1 + cos(φ − φ_e)) is stationary.

    The derivative of (1 + cos(φ − φ_e)) / (C + M cos(φ − φ_j)) vanishes where
    −C sin(φ − φ_e) + M sin(φ − φ_j) + M sin(φ_e − φ_j) = 0, that is a cos φ + b sin φ + c = 0.
    """
    a = constant * np.sin(direction) - amplitude * np.sin(towards)
    b = -constant * np.cos(direction) + amplitude * np.cos(towards)
    c = amplitude * np.sin(direction - towards)
    middle = np.arctan2(b, a)
    spread = np.arccos(np.clip(-c / np.maximum(np.hypot(a, b), 1e-300), -1, 1))
    return middle - spread, middle + spread
