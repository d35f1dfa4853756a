"""Modal intervening variables λ_k(p), C_k(p) as polynomials (section 7).

Displacements oscillate in the parameters, the more the later; λ_k and C_k do not. With them as
polynomials every trajectory, derivative and envelope follows without solving the equations of
motion again.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from math import ceil

import numpy as np

from alphacut.frame.boxes import Boxes
from alphacut.frame.calculus.jet import Array, Jet
from alphacut.frame.calculus.low_discrepancy import chebyshev_points
from alphacut.frame.calculus.polynomial import Polynomial, fit, terms
from alphacut.frame.dynamics.flow import LinearFlow
from alphacut.frame.modal.ground_response import LoadTables
from alphacut.frame.structures.linear import evaluate
from alphacut.frame.structures.modes import (
    ModalError,
    Modes,
    eigenvectors,
    modes,
    require_single,
    state_matrix,
)


@dataclass(frozen=True, eq=False)
class ModalModel:
    """Trajectories over the unit box from polynomials in the parameters.

    Args:
        flow: The trajectories that it stands for.
        boxes: The parameters' boxes.
        eigenvalue: λ_k, n polynomials, in 1/s.
        coefficient: C_k, n m polynomials.
        load: Response to the ground's motion, or None.
        chosen: Which modes it has, by rising |λ|, shape (n,).
        error: Largest deviation of held-out trajectories, shape (T, m).
        analyses: Eigen-analyses made.
    """

    flow: LinearFlow
    boxes: Boxes
    eigenvalue: Polynomial
    coefficient: Polynomial
    load: LoadTables | None
    chosen: Array
    error: Array
    analyses: int

    @property
    def time(self) -> Array:
        """Nodes, shape (T,), in s."""
        return self.flow.time

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the observed quantities."""
        return self.flow.outputs

    @cached_property
    def count(self) -> int:
        """Number of modes n."""
        return self.eigenvalue.coefficients.shape[1]

    @property
    def degree(self) -> int:
        """Total degree of the polynomials."""
        return int(self.eigenvalue.index.sum(1).max())

    def in_units(self, scale: Array) -> ModalModel:
        """The same with every output divided by its scale (m,)."""
        share = Polynomial(
            self.coefficient.index, self.coefficient.coefficients / np.tile(scale, self.count)
        )
        load = None if self.load is None else self.load.in_units(scale)
        return replace(self, coefficient=share, load=load, error=self.error / scale)

    @cached_property
    def of_output(self) -> list[Polynomial]:
        """For each output λ_k, C_k and its load response: 2 n or 3 n polynomials."""
        shares = [self.coefficient.coefficients] + (
            [] if self.load is None else [self.load.share.coefficients]
        )
        m = len(self.outputs)
        columns = [
            np.hstack([self.eigenvalue.coefficients, *(share[:, o::m] for share in shares)])
            for o in range(m)
        ]
        return [Polynomial(self.eigenvalue.index, chosen) for chosen in columns]

    def values(self, unit: Array) -> Array:
        """Trajectories at unit coordinates (S, d), shape (S, T, m)."""
        rate, share = (
            self.eigenvalue(unit),
            self.coefficient(unit).reshape(len(unit), self.count, -1),
        )
        m = share.shape[-1]
        step, total = self.flow.step, len(self.time)
        size = ceil(total**0.5)
        blocks = ceil(total / size)
        fast = np.exp(rate[:, None, :] * (np.arange(size) * step)[None, :, None])
        slow = np.exp(rate[:, None, :] * (np.arange(blocks) * size * step)[None, :, None])
        right = (
            (fast[:, :, :, None] * share[:, None])
            .transpose(0, 2, 1, 3)
            .reshape(len(unit), self.count, size * m)
        )
        out = 2 * (slow.real @ right.real - slow.imag @ right.imag)
        values: Array = out.reshape(len(unit), blocks * size, m)[:, :total]
        return values if self.load is None else values + self.load.values(unit, rate)

    def at(self, unit: Array, node: Array, output: Array) -> tuple[Array, Array, Array]:
        """Values (N,), gradients (N, d), Hessians (N, d, d) of one output, node by point (N, d)."""
        d = unit.shape[1]
        f, g, H = np.empty(len(unit)), np.empty((len(unit), d)), np.empty((len(unit), d, d))
        for o in np.unique(output):
            rows = np.flatnonzero(output == o)
            f[rows], g[rows], H[rows] = self._taylor(self.of_output[o].jet(unit[rows]), node[rows])
        return f, g, H

    def _taylor(self, both: Jet, node: Array) -> tuple[Array, Array, Array]:
        n = self.count
        rate, t = both[..., :n], self.time[node][:, None]
        wave = np.exp(rate.value * t)
        f, g, H = composed(rate, both[..., n : 2 * n], (wave, t * wave, t * t * wave))
        if self.load is not None:
            more = composed(rate, both[..., 2 * n :], self.load.response(rate.value, node))
            f, g, H = f + more[0], g + more[1], H + more[2]
        return f, g, H

    def value_at(self, unit: Array, node: Array, output: Array) -> Array:
        """Values (N,) of one output at one node per point (N, d)."""
        values, n = np.empty(len(unit)), self.count
        for o in np.unique(output):
            rows = np.flatnonzero(output == o)
            both = self.of_output[o](unit[rows])
            rate = both[:, :n]
            total = both[:, n : 2 * n] * np.exp(rate * self.time[node[rows]][:, None])
            if self.load is not None:
                total = total + both[:, 2 * n :] * self.load.response_alone(rate, node[rows])
            values[rows] = 2 * total.real.sum(1)
        return values


def composed(rate: Jet, share: Jet, wave: tuple[Array, Array, Array]) -> tuple[Array, Array, Array]:
    """2 Re Σ_k C_k w(λ_k) with gradient and Hessian; `wave` holds w, w', w'', (N, n)."""
    w, dw, ddw = wave
    value = 2 * (share.value * w).real.sum(-1)
    inner = share.value * dw
    g = 2 * (share.first * w + inner * rate.first).real.sum(-1)
    mixed = share.first[:, None] * (dw * rate.first)[None, :]
    outer = (share.value * ddw * rate.first)[:, None] * rate.first[None, :]
    H = 2 * (
        share.second * w + inner * rate.second + mixed + mixed.swapaxes(0, 1) + outer
    ).real.sum(-1)
    return value, np.moveaxis(g, 0, -1), np.moveaxis(H, (0, 1), (-2, -1))


def analyse(
    flow: LinearFlow,
    boxes: Boxes,
    unit: Array,
    chosen: Array | None = None,
    *,
    states: bool = False,
) -> Modes:
    """Eigen-analyses with derivatives at unit coordinates (S, d), of the integrator.

    Args:
        flow: The trajectories.
        boxes: The parameters' boxes.
        unit: Where to analyse, shape (S, d).
        chosen: Indices of the modes wanted; all when None.
        states: Whether to observe the whole state [q; v] in place of the outputs.

    Raises:
        ModalError: The structure has no such modes, or the integrator mixes them.
    """
    matrices, rows = evaluate(flow.system, flow.names, boxes.to_physical(unit), derivatives=True)
    if states:
        rows = Jet.constant(
            np.broadcast_to(np.eye(rows.value.shape[-1]), (len(unit), *2 * rows.value.shape[-1:])),
            rows.directions,
        )
    found = modes(matrices, rows, chosen)
    rate = _discrete(found.eigenvalue, flow)
    return Modes(*(boxes.in_unit(jet) for jet in (rate, found.coefficient, found.load)))


def _discrete(rate: Jet, flow: LinearFlow) -> Jet:
    """Log R(hλ)/h: the rate at which the integrator's modes advance."""
    rational = flow.integrator.amplification
    if rational is None or (flow.system.ground is not None and rational[0]):
        raise ModalError(
            f"modal: the integrator '{flow.integrator.name}' keeps no modes here; take exact, or"
            " the method graph-follower"
        )
    if not rational[0]:
        return rate
    h, z = flow.step, flow.step * rate.value
    parts = []
    for coefficients in rational:
        p = np.polynomial.Polynomial(coefficients)
        value, slope, curve = p(z), p.deriv(1)(z), p.deriv(2)(z)
        parts.append((np.log(value), slope / value, curve / value - (slope / value) ** 2))
    f, df, ddf = (a - b for a, b in zip(*parts, strict=True))
    return rate.chain(f / h, df, ddf * h)


def fit_modes(
    flow: LinearFlow,
    boxes: Boxes,
    *,
    tolerance: float = 1e-6,
    budget: int = 280,
    scale: Array | float = 1.0,
) -> ModalModel:
    """Fit polynomials of rising degree until held-out trajectories meet `tolerance`.

    Args:
        flow: The trajectories to stand for.
        boxes: The parameters' boxes.
        tolerance: Wanted deviation, in units of the outputs.
        budget: Most eigen-analyses.
        scale: Factor on the tolerance for each output, shape (m,).

    Raises:
        ModalError: No oscillating modes, or double ones whose polynomials do not reach the
            tolerance.
    """
    d = len(flow.names)
    held = _held_out(d)
    truth = flow.values(boxes.to_physical(held))
    used, best, chosen = (
        len(held),
        None,
        _needed(flow, boxes, tolerance / 4 * np.broadcast_to(scale, truth.shape[-1:])),
    )
    for degree in range(2, 13):
        points = fit_points(d, degree)
        if used + len(points) > budget or terms(d, degree) > 2500:
            break
        model = _fitted(flow, boxes, points, degree, chosen)
        model = replace(model, analyses=used + len(points))
        error = np.abs(model.values(held) - truth).max(0)
        if best is None or (error / scale).max() < (best.error / scale).max():
            best = replace(model, error=error)
        if (error / scale).max() <= tolerance:
            break
    if best is None:
        raise ModalError(
            f"modal: {d} parameters need more than {budget} eigen-analyses; raise the budget, or"
            " use graph-follower"
        )
    if (best.error / scale).max() > tolerance:
        require_single(
            evaluate(flow.system, flow.names, boxes.to_physical(held), derivatives=False)[0], chosen
        )
    return best


def _needed(flow: LinearFlow, boxes: Boxes, allowed: Array) -> Array:
    """Indices of the modes whose share in some output matters.

    Args:
        flow: The trajectories.
        boxes: The parameters' boxes.
        allowed: What all modes left out may reach together, for each output, shape (m,).
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
    order = np.argsort(size.max(1))
    small = order[:-1][(np.cumsum(size[order[:-1]], 0) <= 1).all(1)]
    return np.setdiff1d(upper, upper[small])


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
    found = analyse(model.flow, model.boxes, unit, model.chosen, states=True)
    flat = (
        jet.map(lambda x: x.reshape((*x.shape[:-2], -1))) for jet in (found.coefficient, found.load)
    )
    free, forced = (fit(unit, jet, model.degree) for jet in flat)
    return free, forced


def _fitted(
    flow: LinearFlow, boxes: Boxes, points: Array, degree: int, chosen: Array
) -> ModalModel:
    found = analyse(flow, boxes, points, chosen)
    flat = [
        jet.map(lambda x: x.reshape((*x.shape[:-2], -1))) for jet in (found.coefficient, found.load)
    ]
    rate = fit(points, found.eigenvalue, degree)
    ground = flow.system.ground
    load = (
        None
        if ground is None
        else LoadTables.build(ground, flow.time, rate, fit(points, flat[1], degree))
    )
    return ModalModel(
        flow,
        boxes,
        rate,
        fit(points, flat[0], degree),
        load,
        chosen,
        np.zeros((len(flow.time), len(flow.outputs))),
        0,
    )


def _held_out(d: int) -> Array:
    """Corners and inner points that no fit uses, shape (≤ 24, d)."""
    rng = np.random.default_rng(20)
    corners = np.sign(rng.uniform(-1, 1, (12, d)))
    points: Array = np.unique(
        np.vstack([corners, np.ones((1, d)), -np.ones((1, d)), rng.uniform(-1, 1, (8, d))]), axis=0
    )
    return points
