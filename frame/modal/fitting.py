"""Fit of the modal model: polynomials of rising degree until held-out trajectories agree.

They are fitted to eigen-analyses at points of the box, of those modes that matter.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import ceil, log

import numpy as np

from alphacut.frame.boxes import Boxes
from alphacut.frame.calculus.jet import Array, Jet
from alphacut.frame.calculus.low_discrepancy import chebyshev_points
from alphacut.frame.calculus.polynomial import Polynomial, fit, terms
from alphacut.frame.dynamics.flow import LinearFlow
from alphacut.frame.dynamics.integrators import Exact
from alphacut.frame.modal.ground_response import Direct, LoadTables
from alphacut.frame.modal.model import ModalModel
from alphacut.frame.response.duhamel import impulses
from alphacut.frame.structures.assembly import Matrices
from alphacut.frame.structures.linear import courses_of_forces, evaluate, histories
from alphacut.frame.structures.modes import (
    ModalError,
    Modes,
    eigenvectors,
    joined,
    modes,
    require_single,
    state_matrix,
)

MANY = 6
"""Number of parameters up to which polynomials may replace trajectories; beyond, they only guide
Newton's method."""
MOST_TERMS = 2500
"""Most monomials of a polynomial."""


def fit_modes(
    flow: LinearFlow,
    boxes: Boxes,
    *,
    tolerance: float = 1e-6,
    budget: int = 280,
    scale: Array | float = 1.0,
    energy: bool = False,
    degree: int | None = None,
) -> ModalModel:
    """Fit polynomials of rising degree until held-out trajectories meet `tolerance`.

    Args:
        flow: The trajectories to stand for.
        boxes: The parameters' boxes.
        tolerance: Wanted deviation, in units of the outputs.
        budget: Most eigen-analyses.
        scale: Factor on the tolerance for each output, shape (m,).
        energy: Whether modes are left out by their energy alone, as a proof needs it.
        degree: The only degree to fit, whatever its error; all from 2 on unless given.

    Raises:
        ModalError: No oscillating modes, or double ones whose polynomials do not reach the
            tolerance.
    """
    d = len(flow.names)
    tests = _held_out(d)
    truth, scale = flow.values(boxes.to_physical(tests)), np.asarray(scale)
    allowed = tolerance / 4 * np.broadcast_to(scale, truth.shape[-1:])
    chosen = needed_modes(flow, boxes, allowed, energy=energy)
    best: ModalModel | None = None
    fitted_modes, reached = list[Modes](), list[float]()
    degrees = range(2, 13 if d <= MANY else 3) if degree is None else (degree,)
    for total in degrees:
        points = fit_points(d, total)
        if len(tests) + len(points) > budget or terms(d, total) > MOST_TERMS:
            break
        count = sum(len(some.eigenvalue.value) for some in fitted_modes)
        if count < len(points):  # the points of lower degrees are among them
            fitted_modes.append(analyse(flow, boxes, points[count:], chosen))
        model = _fitted(flow, boxes, points, joined(fitted_modes), total, chosen)
        error = np.abs(model.values(tests) - truth).max(0)
        reached.append(float((error / scale).max()))
        if best is None or reached[-1] < (best.error / scale).max():
            best = replace(model, error=error, analyses=len(tests) + len(points))
        if reached[-1] <= tolerance or hopeless(reached, tolerance, d, budget):
            break
    if best is None:
        raise ModalError(
            f"modal: {d} parameters need more than {budget} eigen-analyses; raise the budget, or"
            " use graph-follower"
        )
    if degree is None and (best.error / scale).max() > tolerance:
        require_single(
            evaluate(flow.system, flow.names, boxes.to_physical(tests), derivatives=False)[0],
            best.chosen,
        )
    return best


def hopeless(reached: Sequence[float], tolerance: float, d: int, budget: int) -> bool:
    """Tells whether no degree within the budget reaches the tolerance at the rate seen so far.

    Args:
        reached: Errors of degrees 2, 3, …
        tolerance: The error needed.
        d: Number of parameters.
        budget: Most eigen-analyses.
    """
    if len(reached) < 3 or not 0 < reached[-1] < reached[-3]:
        return len(reached) >= 4 and reached[-1] >= reached[-3]
    rate = (reached[-1] / reached[-3]) ** 0.5
    degree = 1 + len(reached) + log(tolerance / reached[-1]) / log(rate)
    needed = ceil(degree) - 1  # a degree of grace
    return (
        needed > 12
        or terms(d, needed) > MOST_TERMS
        or len(_held_out(d)) + len(fit_points(d, needed)) > budget
    )


def fit_points(d: int, degree: int) -> Array:
    """Points of analysis for a total degree in d variables, shape (S, d)."""
    data = 1 + d + d * (d + 1) // 2
    count = ceil((2.5 if d <= 6 else 5) * terms(d, degree) / data)
    return np.vstack([np.zeros((1, d)), chebyshev_points(d, count)])


def fit_states(model: ModalModel) -> list[Polynomial]:
    """Polynomials of the states [φ_k; λ_k φ_k] of the model's modes.

    Returns:
        What the initial state puts into them, and what a unit impulse of each load does.
    """
    unit = fit_points(len(model.boxes.names), model.degree)
    analysed = analyse(model.flow, model.boxes, unit, model.chosen, states=True)
    return _shares(unit, analysed, model.degree)


def _fitted(
    flow: LinearFlow, boxes: Boxes, points: Array, analysed: Modes, degree: int, chosen: Array
) -> ModalModel:
    rate, time = fit(points, analysed.eigenvalue, degree), flow.time
    free, *forced = _shares(points, analysed, degree)
    kinds = [(LoadTables, course) for course in histories(flow.system).values()]
    kinds += [(Direct, course) for course in courses_of_forces(flow.system)]
    pairs = zip(kinds, forced, strict=False)  # without what acts at once, where nothing does
    loads = tuple(kind(course, time, rate, share) for (kind, course), share in pairs)
    nothing = np.zeros((len(time), len(flow.outputs)))
    return ModalModel(flow, boxes, rate, free, loads, chosen, nothing, 0)


def _shares(points: Array, data: Modes, degree: int) -> list[Polynomial]:
    """Polynomials of what the initial state puts into n modes' m rows, and what each load does."""
    flat = (
        jet.map(lambda x: x.reshape((*x.shape[:-2], -1))) for jet in (data.coefficient, *data.loads)
    )
    return [fit(points, jet, degree) for jet in flat]


def _held_out(d: int) -> Array:
    """Corners and inner points that no fit uses, shape (≤ 24, d)."""
    rng = np.random.default_rng(20)
    corners = np.sign(rng.uniform(-1, 1, (12, d)))
    points: Array = np.unique(
        np.vstack([corners, np.ones((1, d)), -np.ones((1, d)), rng.uniform(-1, 1, (8, d))]), axis=0
    )
    return points


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
    has_ground = flow.system.ground is not None
    found_modes = modes(matrices, rows, matrices.pushes(ground=has_ground), chosen)
    if not states and matrices.feeds is not None:
        direct = _as_modes(matrices.feeds, found_modes.eigenvalue.value.shape[-1])
        found_modes = replace(found_modes, loads=(*found_modes.loads, *direct))
    return found_modes.map(boxes.in_unit) if order else found_modes


def _as_modes(feeds: Jet, count: int) -> list[Jet]:
    """What each load adds at once, as twice the real part of a share of the first of n modes."""
    first = np.eye(count)[0][:, None] / 2
    columns = [feeds[..., i][..., None, :] for i in range(feeds.value.shape[-1])]
    return [column * first for column in columns]


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
    state = np.abs(Y @ matrices.start.value[0])
    pushes = matrices.pushes(ground=flow.system.ground is not None).value[0]
    for course, push in zip(histories(flow.system).values(), pushes.T, strict=True):
        # bound of |R(t; λ)|
        size = course.extremes[0] / np.maximum(-rate.real, 1e-300)
        most = np.minimum(float(impulses(course, flow.time)[-1]), size)
        state += np.abs(Y @ np.append(0.0 * push, push))[:, None] * most[:, None]
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
    tests = [
        np.einsum("ik,ij,jk->k", part.conj(), matrix, part).real
        for part, matrix in ((shapes[:n], K), (shapes[n:], M))
    ]
    size = 2 * np.sqrt(np.maximum(tests[0] + tests[1], 0.0))[:, None] * state[upper]
    return np.asarray(size * np.sqrt(np.maximum(reading[0] + reading[1], 0.0)))
