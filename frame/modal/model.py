"""Modal intervening variables λ_k(p), C_k(p) as polynomials (section 7).

Displacements oscillate in the parameters, the more the later; λ_k and C_k do not. With them as
polynomials every trajectory, derivative and envelope follows without solving the equations of
motion again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import ceil, log
from typing import ClassVar

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

MANY = 6
"""Number of parameters up to which polynomials may replace trajectories; beyond, they only guide
Newton's method."""
MOST_TERMS = 2500
"""Most monomials of a polynomial."""


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
        modes: How many the structure has.
        error: Largest deviation of held-out trajectories, shape (T, m).
        analyses: Eigen-analyses made.
    """

    flow: LinearFlow
    boxes: Boxes
    eigenvalue: Polynomial
    coefficient: Polynomial
    load: LoadTables | None
    chosen: Array
    modes: int
    error: Array
    analyses: int
    secant: ClassVar[bool] = False

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

    @property
    def fastest(self) -> float:
        """Largest |λ| in the middle of the box, in 1/s."""
        return float(np.abs(self.eigenvalue.coefficients[0]).max())

    @property
    def turned(self) -> float:
        """Largest change of a lasting mode's phase over the box, in rad."""
        middle, rest = self.eigenvalue.coefficients[0], self.eigenvalue.coefficients[1:]
        # a mode that has died down has no basins
        lasting = np.minimum(self.time[-1], 5 / np.maximum(-middle.real, 1e-300))
        return float((np.abs(rest).sum(0) * lasting).max())

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
            own = self.of_output[o]
            if self.degree <= 2:
                f[rows], g[rows], H[rows] = self._quadratic(own, unit[rows], node[rows])
            else:
                f[rows], g[rows], H[rows] = self._taylor(own.jet(unit[rows]), node[rows])
        return f, g, H

    def _quadratic(self, own: Polynomial, unit: Array, node: Array) -> tuple[Array, Array, Array]:
        """As `_taylor`, for degree 2, whose second derivatives are the same everywhere."""
        n, (both, first, second) = self.count, own.quadratic(unit)
        rate, slope = both[:, :n], first[:, :, :n]
        excited = [(slice(n, 2 * n), self._free(rate, node))]
        if self.load is not None:
            excited.append((slice(2 * n, 3 * n), self.load.response(rate, node)))
        f, g = np.zeros(len(unit)), np.zeros(first.shape[:2])
        weight = np.zeros_like(both)
        crossed = np.zeros_like(slope)
        for part, (w, dw, ddw) in excited:
            share, bent = both[:, part], first[:, :, part]
            f = f + 2 * (share * w).real.sum(1)
            g = g + 2 * (bent * w[:, None] + slope * (share * dw)[:, None]).real.sum(2)
            weight[:, part] = w
            weight[:, :n] += share * dw
            crossed += bent * dw[:, None] + slope * (share * ddw)[:, None] / 2
        H = 2 * _real_product(crossed, slope.swapaxes(1, 2))
        curved = 2 * _real_product(weight, second.reshape(-1, second.shape[-1]).T)
        return f, g, H + H.swapaxes(1, 2) + curved.reshape(H.shape)

    def _taylor(self, both: Jet, node: Array) -> tuple[Array, Array, Array]:
        n = self.count
        rate = both[..., :n]
        f, g, H = composed(rate, both[..., n : 2 * n], self._free(rate.value, node))
        if self.load is not None:
            more = composed(rate, both[..., 2 * n :], self.load.response(rate.value, node))
            f, g, H = f + more[0], g + more[1], H + more[2]
        return f, g, H

    def _free(self, rate: Array, node: Array) -> tuple[Array, Array, Array]:
        """Exp(λ t) and its derivatives by λ at one node per point, (N, n)."""
        t = self.time[node][:, None]
        wave = np.exp(rate * t)
        return wave, t * wave, t * t * wave

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


def _real_product(a: Array, b: Array) -> Array:
    """Real part of a @ b for complex arrays."""
    left, right = np.concatenate([a.real, -a.imag], -1), np.concatenate([b.real, b.imag], -2)
    return np.asarray(left @ right)


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
    return Modes(
        boxes.in_unit(rate),
        boxes.in_unit(found.coefficient),
        boxes.in_unit(found.load),
        found.of,
    )


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
    truth, scale = flow.values(boxes.to_physical(held)), np.asarray(scale)
    allowed = tolerance / 4 * np.broadcast_to(scale, truth.shape[-1:])
    samples, best = _Samples(flow, boxes, _needed(flow, boxes, allowed)), None
    reached: list[float] = []
    for degree in range(2, 13 if d <= MANY else 3):
        points = fit_points(d, degree)
        if len(held) + len(points) > budget or terms(d, degree) > MOST_TERMS:
            break
        model = samples.fitted(points, degree)
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
    """Whether no degree within the budget reaches the tolerance at the rate seen so far.

    Args:
        reached: Errors of degrees 2, 3, …
        tolerance: The error wanted.
        d: Number of parameters.
        budget: Most eigen-analyses.
    """
    if len(reached) < 3 or not 0 < reached[-1] < reached[-3]:
        return len(reached) >= 4 and reached[-1] >= reached[-3]
    rate = (reached[-1] / reached[-3]) ** 0.5
    degree = 1 + len(reached) + log(tolerance / reached[-1]) / log(rate)
    wanted = ceil(degree) - 1  # a degree of grace
    return (
        wanted > 12
        or terms(d, wanted) > MOST_TERMS
        or len(_held_out(d)) + len(fit_points(d, wanted)) > budget
    )


@dataclass(eq=False)
class _Samples:
    """Eigen-analyses at the points of rising degrees, each made once: the points are nested."""

    flow: LinearFlow
    boxes: Boxes
    chosen: Array
    found: Modes | None = None

    def fitted(self, points: Array, degree: int) -> ModalModel:
        """The model of a degree from analyses at `points`."""
        known = 0 if self.found is None else self.found.eigenvalue.value.shape[0]
        if known < len(points):
            fresh = analyse(self.flow, self.boxes, points[known:], self.chosen)
            self.found = fresh if self.found is None else self.found.joined(fresh)
        assert self.found is not None
        return _fitted(self.flow, self.boxes, points, self.found, degree, self.chosen)


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
    flow: LinearFlow, boxes: Boxes, points: Array, found: Modes, degree: int, chosen: Array
) -> ModalModel:
    flat = [
        jet.map(lambda x: x.reshape((*x.shape[:-2], -1))) for jet in (found.coefficient, found.load)
    ]
    rate = fit(points, found.eigenvalue, degree)
    ground, load = flow.system.ground, None
    if ground is not None:
        load = LoadTables.build(ground, flow.time, rate, fit(points, flat[1], degree))
    share = fit(points, flat[0], degree)
    nothing = np.zeros((len(flow.time), len(flow.outputs)))
    return ModalModel(flow, boxes, rate, share, load, chosen, found.of, nothing, 0)


def _held_out(d: int) -> Array:
    """Corners and inner points that no fit uses, shape (≤ 24, d)."""
    rng = np.random.default_rng(20)
    corners = np.sign(rng.uniform(-1, 1, (12, d)))
    points: Array = np.unique(
        np.vstack([corners, np.ones((1, d)), -np.ones((1, d)), rng.uniform(-1, 1, (8, d))]), axis=0
    )
    return points
