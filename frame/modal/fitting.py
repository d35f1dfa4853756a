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
from alphacut.frame.calculus.polynomial import Polynomial, fit, terms
from alphacut.frame.dynamics.flow import LinearFlow
from alphacut.frame.dynamics.integrators import Exact
from alphacut.frame.modal.model import ModalModel
from alphacut.frame.response.duhamel import absolute_moments
from alphacut.frame.response.load_tables import Direct, LoadTables
from alphacut.frame.structures.linear import Matrices, courses_of_forces, evaluate, histories
from alphacut.frame.structures.modes import (
    ModalError,
    Modes,
    eigenvectors,
    joined,
    modes,
    require_single,
    state_matrix,
)
from alphacut.fuzzy.sets.boxes import chebyshev_points

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
    """Fits modal models of rising polynomial degree until held-out trajectories meet `tolerance`.

    Args:
        flow: Flow whose trajectories the model approximates and is tested against.
        boxes: Boxes of the parameters, one a level; the fit covers the widest.
        tolerance: Largest deviation allowed, in units of the outputs.
        budget: Most eigen-analyses.
        scale: Factor on the tolerance for each output, shape (m,).
        energy: Whether modes are left out by bounds of their energy, as `needed_modes` says.
        degree: The only degree to fit, whatever its error; all from 2 on unless given.

    Returns:
        The most accurate model, with the largest deviation of each output at each node.

    Raises:
        ModalError: No oscillating modes, or double ones whose polynomials do not reach the
            tolerance.
    """
    d = len(flow.names)
    tests = _held_out(d)
    reference, scale = flow.values(boxes.to_physical(tests)), np.asarray(scale)
    allowed = tolerance / 4 * np.broadcast_to(scale, reference.shape[-1:])
    chosen = needed_modes(flow, boxes, allowed, energy=energy)
    best: ModalModel | None = None
    fitted_modes, errors = list[Modes](), list[float]()
    degrees = range(2, 13 if d <= MANY else 3) if degree is None else (degree,)
    for total in degrees:
        points = fit_points(d, total)
        if len(tests) + len(points) > budget or terms(d, total) > MOST_TERMS:
            break
        n_analysed = sum(len(some.eigenvalue.value) for some in fitted_modes)
        if n_analysed < len(points):  # the points of lower degrees are among them
            fitted_modes.append(analyse(flow, boxes, points[n_analysed:], chosen))
        model = _model_from_modes(flow, boxes, points, joined(fitted_modes), total, chosen)
        error = np.abs(model.values(tests) - reference).max(0)
        errors.append(float((error / scale).max()))
        if best is None or errors[-1] < (best.error / scale).max():
            best = replace(model, error=error, analyses=len(tests) + len(points))
        if errors[-1] <= tolerance or out_of_reach(errors, tolerance, d, budget):
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


def out_of_reach(errors: Sequence[float], tolerance: float, d: int, budget: int) -> bool:
    """Whether no degree within the budget meets the tolerance at the rate of decay seen so far.

    Args:
        errors: Errors of the fits of degrees 2, 3, …
        tolerance: The error needed.
        d: Number of parameters.
        budget: Most eigen-analyses.
    """
    if len(errors) < 3 or not 0 < errors[-1] < errors[-3]:  # no rate to go by
        return len(errors) >= 4 and errors[-1] >= errors[-3]
    rate = (errors[-1] / errors[-3]) ** 0.5  # factor of the error by a degree more
    degree = 1 + len(errors) + log(tolerance / errors[-1]) / log(rate)
    needed = ceil(degree) - 1  # a degree of grace
    return (
        needed > 12
        or terms(d, needed) > MOST_TERMS
        or len(_held_out(d)) + len(fit_points(d, needed)) > budget
    )


def fit_points(d: int, degree: int) -> Array:
    """Points of the unit box for a fit of total `degree` in d variables, shape (S, d).

    The centre comes first, then Chebyshev points. With value, gradient and Hessian of each point
    there are at least 2.5 data a coefficient up to six variables, and 5 beyond.
    """
    data = 1 + d + d * (d + 1) // 2
    count = ceil((2.5 if d <= 6 else 5) * terms(d, degree) / data)
    return np.vstack([np.zeros((1, d)), chebyshev_points(d, count)])


def fit_states(model: ModalModel) -> list[Polynomial]:
    """Fits polynomials to the modal states z_k = [φ_k; λ_k φ_k], q(t) = 2 Re Σ φ_k exp(λ_k t).

    Returns:
        First with φ_k scaled by the initial state, then one entry for each load with φ_k scaled by
        its unit impulse; each a vector of n · 2N polynomials, mode by mode, for N unknowns.
    """
    unit = fit_points(len(model.boxes.names), model.degree)
    mode_data = analyse(model.flow, model.boxes, unit, model.chosen, states=True)
    return _coefficient_polynomials(unit, mode_data, model.degree)


def _model_from_modes(
    flow: LinearFlow, boxes: Boxes, points: Array, mode_data: Modes, degree: int, chosen: Array
) -> ModalModel:
    """Fit a modal model's eigenvalues and coefficients to eigen-analyses.

    Args:
        flow: The flow that was analysed.
        boxes: Boxes of its parameters.
        points: Unit coordinates of the analyses, shape (S, d).
        mode_data: Eigenvalues and coefficients there, with derivatives.
        degree: Total degree of the polynomials.
        chosen: Indices of the modes, shape (n,).

    Returns:
        The model, its error and number of analyses still zero.
    """
    eigenvalue, time = fit(points, mode_data.eigenvalue, degree), flow.time
    free, *forced = _coefficient_polynomials(points, mode_data, degree)
    loads = [(LoadTables, history) for history in histories(flow.system).values()]
    loads += [(Direct, history) for history in courses_of_forces(flow.system)]
    # without direct feedthrough of forces to outputs, `forced` ends before `Direct` begins
    responses = tuple(
        response(history, time, eigenvalue, coefficient)
        for (response, history), coefficient in zip(loads, forced, strict=False)
    )
    zero_error = np.zeros((len(time), len(flow.outputs)))
    return ModalModel(flow, boxes, eigenvalue, free, responses, chosen, zero_error, 0)


def _coefficient_polynomials(points: Array, data: Modes, degree: int) -> list[Polynomial]:
    """Fits C_k of q(t) = 2 Re Σ C_k w(t; λ_k), n m polynomials, to modes at `points` (S, d).

    Returned are those of the free motion, then those of each load.
    """
    flat = (
        jet.map(lambda x: x.reshape((*x.shape[:-2], -1))) for jet in (data.coefficient, *data.loads)
    )
    return [fit(points, jet, degree) for jet in flat]


def _held_out(d: int) -> Array:
    """Test points of the unit box, 8 random inner ones and up to 14 corners, shape (≤ 22, d)."""
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
    """Eigenvalues λ_k and coefficients C_k at S points, with derivatives by unit coordinates.

    Args:
        flow: Flow of the structure, integrated exactly.
        boxes: Boxes of its parameters; the unit box stands for the widest.
        unit: Unit coordinates of the points, shape (S, d).
        chosen: Indices of the n modes by rising |λ|; all when None.
        states: Whether C_k is of the state [q; v], m = 2N, in place of the m outputs.
        order: Highest order of derivatives, 0, 1 or 2.

    Returns:
        Jets of λ_k, shape (S, n), in 1/s, and of C_k, shape (S, n, m): of the free motion, of each
        load, and of the direct feedthrough of each force, if any.

    Raises:
        ModalError: A mode does not oscillate, or the flow's integrator is not the exact one.
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
        feedthrough = _feedthrough(matrices.feeds, found_modes.eigenvalue.value.shape[-1])
        found_modes = replace(found_modes, loads=(*found_modes.loads, *feedthrough))
    return found_modes.map(boxes.in_unit) if order else found_modes


def _feedthrough(feeds: Jet, count: int) -> list[Jet]:
    """Direct feedthrough of each load as jets of coefficients C_k, shape (S, n, m), n = `count`.

    With `Direct`, where w of the first mode is a(t), 2 Re C_1 w is the feedthrough times a(t).
    `feeds` are the outputs by a unit of each load, shape (S, m, L).
    """
    first = np.eye(count)[0][:, None] / 2
    columns = [feeds[..., i][..., None, :] for i in range(feeds.value.shape[-1])]
    return [column * first for column in columns]


def needed_modes(flow: LinearFlow, boxes: Boxes, allowed: Array, *, energy: bool = False) -> Array:
    """Indices (n,) of the modes to keep so that the amplitudes of all others sum to `allowed`.

    They are those of the box's centre, by rising |λ|, one of each conjugate pair.

    Args:
        flow: Flow of the structure.
        boxes: Boxes of its parameters.
        allowed: Largest sum of the amplitudes of all omitted modes, for each output, shape (m,).
        energy: Whether amplitudes are bounded by the modes' energy too, as a proof does it. Fast
            modes hardly move a displacement, but may hold much energy.
    """
    matrices, rows = evaluate(flow.system, flow.names, boxes.centre[None], derivatives=False)
    eigenvalue, X, Y = (jet.value[0] for jet in eigenvectors(state_matrix(matrices)))
    modal_state = np.abs(Y @ matrices.start.value[0])
    accelerations = matrices.pushes(ground=flow.system.ground is not None).value[0]
    for history, unit_load in zip(histories(flow.system).values(), accelerations.T, strict=True):
        # |R(t; λ)| ≤ min(∫ |a|, max |a| / −Re λ)
        steady = history.extremes[0] / np.maximum(-eigenvalue.real, 1e-300)
        response = np.minimum(float(absolute_moments(0.0, history, flow.time)[0, -1]), steady)
        participation = np.abs(Y @ np.append(0.0 * unit_load, unit_load))
        modal_state += participation[:, None] * response[:, None]
    upper = np.flatnonzero(eigenvalue.imag >= 0)  # one of each conjugate pair
    amplitude = 2 * np.abs(rows.value[0] @ X[:, upper]).T * modal_state[upper]
    if energy:
        by_energy = _energy_amplitudes(matrices, rows.value[0], X[:, upper], modal_state[upper])
        amplitude = np.maximum(amplitude, by_energy)
    amplitude /= allowed
    order = np.argsort(amplitude.max(1))
    small = order[:-1][(np.cumsum(amplitude[order[:-1]], 0) <= 1).all(1)]
    return np.setdiff1d(upper, upper[small])


def _energy_amplitudes(matrices: Matrices, rows: Array, shapes: Array, state: Array) -> Array:
    """Bounds of the amplitudes of n modes in m outputs by the modes' energy, shape (n, m).

    An output r q + s v is at most √(r K⁻¹ rᵀ + s M⁻¹ sᵀ) times √(qᵀ K q + vᵀ M v), the square root
    of twice the energy.

    Args:
        matrices: Mass and stiffness of N unknowns.
        rows: Observation rows [r, s], shape (m, 2N).
        shapes: Right eigenvectors [φ; λ φ], shape (2N, n).
        state: Bounds of the modal states, shape (n, 1).

    Raises:
        ModalError: The stiffness is singular.
    """
    M, K = matrices.mass.value[0], matrices.stiffness.value[0]
    n = len(M)
    if not np.linalg.cond(K) < 1 / np.finfo(float).eps:
        raise ModalError("a mode does not oscillate: the stiffness lets the structure drift")
    row_norms, energies = np.zeros(len(rows)), np.zeros(shapes.shape[1])
    for matrix, row, shape in ((K, rows[:, :n], shapes[:n]), (M, rows[:, n:], shapes[n:])):
        row_norms += np.einsum("oi,io->o", row, np.linalg.solve(matrix, row.T))
        energies += np.einsum("ik,ij,jk->k", shape.conj(), matrix, shape).real
    # rounding may make squares negative
    size = 2 * np.sqrt(np.maximum(energies, 0.0))[:, None] * state
    return np.asarray(size * np.sqrt(np.maximum(row_norms, 0.0)))
