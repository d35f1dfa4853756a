"""Eigen-analyses of a structure at points of its box, and which of its modes matter."""

from __future__ import annotations

import numpy as np

from alphacut.frame.boxes import Boxes
from alphacut.frame.calculus.jet import Array
from alphacut.frame.dynamics.flow import LinearFlow
from alphacut.frame.dynamics.integrators import Exact
from alphacut.frame.structures.linear import Matrices, evaluate
from alphacut.frame.structures.modes import ModalError, Modes, eigenvectors, modes, state_matrix


def analyse(
    flow: LinearFlow,
    boxes: Boxes,
    unit: Array,
    chosen: Array | None = None,
    *,
    states: bool = False,
    order: int = 2,
) -> Modes:
    """Eigen-analyses with derivatives at unit coordinates (S, d).

    Args:
        flow: The trajectories.
        boxes: The parameters' boxes.
        unit: Where to analyse, shape (S, d).
        chosen: Indices of the modes wanted; all when None.
        states: Whether to observe the whole state [q; v] in place of the outputs.
        order: Highest order of derivatives, 0, 1 or 2.

    Raises:
        ModalError: The structure has no such modes, or the motion is not the exact one.
    """
    if not isinstance(flow.integrator, Exact):
        name = flow.integrator.name
        raise ModalError(f"modal: the integrator is {name}; take exact, or a graph follower")
    points = boxes.to_physical(unit)
    depth = {"derivatives": order > 0, "bent": order > 1}
    matrices, rows = evaluate(flow.system, flow.names, points, **depth)
    if states:
        size = rows.value.shape[-1]
        rows = rows.like(np.broadcast_to(np.eye(size), (len(unit), size, size)))
    own = modes(matrices, rows, chosen)
    if not order:
        return own
    rate, start, kick = map(boxes.in_unit, (own.eigenvalue, own.coefficient, own.load))
    return Modes(rate, start, kick, own.of)


def needed_modes(flow: LinearFlow, boxes: Boxes, allowed: Array, *, energy: bool = False) -> Array:
    """Indices of the modes whose share in some output matters.

    Args:
        flow: The trajectories.
        boxes: The parameters' boxes.
        allowed: What all modes left out may reach together, for each output, shape (m,).
        energy: Whether that is bounded by their energy, as a proof does it, and not by their own
            shapes alone: fast modes add little to a displacement, but may hold much.
    """
    matrices, rows = evaluate(flow.system, flow.names, boxes.centre[None], derivatives=False)
    rate, X, Y = (jet.value[0] for jet in eigenvectors(state_matrix(matrices)))
    state = np.abs(Y @ np.vstack([matrices.q0.value[0], matrices.v0.value[0]]))
    ground = flow.system.ground
    if ground is not None:
        record = np.abs(ground.acceleration)
        # bound of |R(t; λ)|
        push = np.minimum(record.sum() * ground.step, record.max() / np.maximum(-rate.real, 1e-300))
        state += np.abs(Y[:, len(matrices.rigid) :] @ matrices.rigid) * push[:, None]
    upper = np.flatnonzero(rate.imag >= 0)
    size = (2 * np.abs(rows.value[0] @ X).T * state / allowed)[upper]
    if energy:
        size = np.maximum(size, _by_energy(matrices, rows.value[0], X, state, upper) / allowed)
    order = np.argsort(size.max(1))
    small = order[:-1][(np.cumsum(size[order[:-1]], 0) <= 1).all(1)]
    return np.setdiff1d(upper, upper[small])


def _by_energy(matrices: Matrices, rows: Array, X: Array, state: Array, upper: Array) -> Array:
    """Bounds of what modes add to the outputs by their energy, shape (modes, m).

    An output r q + s v is at most √(r K⁻¹ rᵀ + s M⁻¹ sᵀ) times √(qᵀ K q + vᵀ M v).
    """
    M, K = matrices.mass.value[0], matrices.stiffness.value[0]
    n = len(M)
    if not np.linalg.cond(K) < 1 / np.finfo(float).eps:
        raise ModalError("a mode does not oscillate: the stiffness lets the structure drift")
    reading = [
        np.einsum("oi,io->o", part, np.linalg.solve(matrix, part.T))
        for part, matrix in ((rows[:, :n], K), (rows[:, n:], M))
    ]
    shapes = X[:, upper]
    held = [
        np.einsum("ik,ij,jk->k", part.conj(), matrix, part).real
        for part, matrix in ((shapes[:n], K), (shapes[n:], M))
    ]
    size = 2 * np.sqrt(np.maximum(held[0] + held[1], 0.0))[:, None] * state[upper]
    return np.asarray(size * np.sqrt(np.maximum(reading[0] + reading[1], 0.0)))
