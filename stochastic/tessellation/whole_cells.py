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

import numpy as np

from alphacut.fuzzy.arrays import Array, Rows
from alphacut.fuzzy.refused import require
from alphacut.stochastic.tessellation.apollonius import Apollonius

# directions of the left, right, lower and upper edge
EDGES = np.array([np.pi, 0.0, -np.pi / 2, np.pi / 2])
ANGLES = 33


def whole_cells(diagram: Apollonius) -> tuple[Rows, Array]:
    """Cells clear of the window's edge, with weights that make up for the others.

    Returns:
        Indices of the discs whose cells are whole, shape (k,), and the number of cells that each
        stands for, shape (k,); all and 1 in a periodic box.

    Raises:
        RefusedError: No cell is whole.
    """
    discs = diagram.discs
    if discs.periodic:
        return np.arange(len(discs), dtype=np.intp), np.ones(len(discs))
    reach = _reach(diagram)
    inner, (x, y) = discs.size - 2 * discs.radii.max(), discs.centres.T - discs.radii.max()
    room = np.stack([x, inner[0] - x, y, inner[1] - y], axis=1)
    disc = np.flatnonzero((reach <= room).all(axis=1) & ~diagram.cut)
    allowed = "windows in which the edge leaves a cell whole"
    require(len(disc) > 0, "size", discs.size.tolist(), allowed, "take a larger section")
    taken = reach[disc].reshape(-1, 2, 2).sum(axis=2)  # across and along
    return disc, discs.measure / (inner - taken).prod(axis=1)


def _reach(diagram: Apollonius) -> Array:
    """Greatest ρ (1 + cos ψ) − r of each cell towards the four edges, shape (n, 4), in m.

    The greatest of `ANGLES` on each arc, its ends among them: their second order is far below what
    the largest disc beyond the edge is known by.
    """
    angle = np.asarray(np.linspace(diagram.start, diagram.end, ANGLES), float)
    rho = diagram.radius_at(np.arange(len(diagram.cell), dtype=np.intp), angle)
    reach = np.full((len(diagram.discs), 4), -np.inf)
    for edge, direction in enumerate(EDGES):
        out = (rho * (1 + np.cos(angle - direction))).max(axis=0)
        np.maximum.at(reach[:, edge], diagram.cell, np.where(rho.min(axis=0) > 0, out, np.inf))
    return reach - diagram.discs.radii[:, None]
