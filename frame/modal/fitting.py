"""Fit of the modal model: polynomials of rising degree until held-out trajectories agree."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import ceil, log

import numpy as np

from alphacut.frame.boxes import Boxes
from alphacut.frame.calculus.jet import Array
from alphacut.frame.calculus.low_discrepancy import chebyshev_points
from alphacut.frame.calculus.polynomial import Polynomial, fit, terms
from alphacut.frame.dynamics.flow import LinearFlow
from alphacut.frame.modal.analyses import analyse, needed_modes
from alphacut.frame.modal.ground_response import LoadTables
from alphacut.frame.modal.model import ModalModel
from alphacut.frame.structures.linear import evaluate
from alphacut.frame.structures.modes import ModalError, Modes, joined, require_single

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
) -> ModalModel:
    """Fit polynomials of rising degree until held-out trajectories meet `tolerance`.

    Args:
        flow: The trajectories to stand for.
        boxes: The parameters' boxes.
        tolerance: Wanted deviation, in units of the outputs.
        budget: Most eigen-analyses.
        scale: Factor on the tolerance for each output, shape (m,).
        energy: Whether modes are left out by their energy alone, as a proof needs it.

    Raises:
        ModalError: No oscillating modes, or double ones whose polynomials do not reach the
            tolerance.
    """
    d = len(flow.names)
    held = _held_out(d)
    truth, scale = flow.values(boxes.to_physical(held)), np.asarray(scale)
    allowed = tolerance / 4 * np.broadcast_to(scale, truth.shape[-1:])
    chosen = needed_modes(flow, boxes, allowed, energy=energy)
    best: ModalModel | None = None
    known, reached = list[Modes](), list[float]()
    for degree in range(2, 13 if d <= MANY else 3):
        points = fit_points(d, degree)
        if len(held) + len(points) > budget or terms(d, degree) > MOST_TERMS:
            break
        count = sum(len(some.eigenvalue.value) for some in known)
        if count < len(points):  # the points of lower degrees are among them
            known.append(analyse(flow, boxes, points[count:], chosen))
        model = _fitted(flow, boxes, points, joined(known), degree, chosen)
        error = np.abs(model.values(held) - truth).max(0)
        reached.append(float((error / scale).max()))
        if best is None or reached[-1] < (best.error / scale).max():
            best = replace(model, error=error, analyses=len(held) + len(points))
        if reached[-1] <= tolerance or hopeless(reached, tolerance, d, budget):
            break
    if best is None:
        raise ModalError(
            f"modal: {d} parameters need more than {budget} eigen-analyses; raise the budget, or"
            " use graph-follower"
        )
    if (best.error / scale).max() > tolerance:
        require_single(
            evaluate(flow.system, flow.names, boxes.to_physical(held), derivatives=False)[0],
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


def fit_states(model: ModalModel) -> tuple[Polynomial, Polynomial]:
    """Polynomials of the states [φ_k; λ_k φ_k] of the model's modes.

    Returns:
        What the initial state puts into them, and what a unit impulse of the ground's acceleration
        does.
    """
    unit = fit_points(len(model.boxes.names), model.degree)
    own = analyse(model.flow, model.boxes, unit, model.chosen, states=True)
    return _shares(unit, own, model.degree)


def _fitted(
    flow: LinearFlow, boxes: Boxes, points: Array, own: Modes, degree: int, chosen: Array
) -> ModalModel:
    rate, ground, load = fit(points, own.eigenvalue, degree), flow.system.ground, None
    free, forced = _shares(points, own, degree)
    if ground is not None:
        load = LoadTables(ground, flow.time, rate, forced)
    nothing = np.zeros((len(flow.time), len(flow.outputs)))
    return ModalModel(flow, boxes, rate, free, load, chosen, own.of, nothing, 0)


def _shares(points: Array, own: Modes, degree: int) -> tuple[Polynomial, Polynomial]:
    """Polynomials of what the initial state puts into n modes' m rows, and what the ground does."""
    flat = (
        jet.map(lambda x: x.reshape((*x.shape[:-2], -1))) for jet in (own.coefficient, own.load)
    )
    free, forced = (fit(points, jet, degree) for jet in flat)
    return free, forced


def _held_out(d: int) -> Array:
    """Corners and inner points that no fit uses, shape (≤ 24, d)."""
    rng = np.random.default_rng(20)
    corners = np.sign(rng.uniform(-1, 1, (12, d)))
    points: Array = np.unique(
        np.vstack([corners, np.ones((1, d)), -np.ones((1, d)), rng.uniform(-1, 1, (8, d))]), axis=0
    )
    return points
