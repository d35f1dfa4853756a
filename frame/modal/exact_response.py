"""Outputs at single nodes from the eigenvectors at each point, with exact gradients.

No polynomial stands between the parameters and these values: with A = X diag(λ) X⁻¹ an output is
r exp(A t) s, and its derivative by a parameter needs only the divided differences of exp(λ t).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from alphacut.frame.calculus.damped_modes import DampedModes
from alphacut.frame.calculus.jet import Array
from alphacut.frame.calculus.polynomial import Polynomial, fit
from alphacut.frame.calculus.threads import each
from alphacut.frame.modal.analyses import analyse
from alphacut.frame.modal.fitting import fit_points
from alphacut.frame.modal.ground_response import LoadTables
from alphacut.frame.modal.model import ModalModel, Waves
from alphacut.frame.structures import modes as natural
from alphacut.frame.structures.factors import Factors, factors
from alphacut.frame.structures.linear import evaluate
from alphacut.frame.structures.slopes import Slopes

PIECE = 1500
"""Points treated together; more would leave the cache."""
NEAR = 1e-3
"""Phase between two eigenvalues (rad) below which their divided difference is a derivative."""
CONDITION = 1e9
"""Condition of the eigenvectors above which modes nearly coincide at critical damping."""


@dataclass(frozen=True, eq=False)
class ExactResponse:
    """Stands for a modal model, without the error of its polynomials.

    Args:
        model: Polynomials of the same structure, in the units wanted; they give the second
            derivatives.
        scale: What the outputs are divided by, shape (m,).
        load: Tables of all modes' answer to the ground, or None.
        bent: Whether the polynomials are good enough for second derivatives; else these are zero,
            and Newton's method learns them from gradients.
    """

    model: ModalModel
    scale: Array
    load: LoadTables | None
    bent: bool = True
    secant: ClassVar[bool] = True

    @classmethod
    def of(cls, model: ModalModel, scale: Array, *, bent: bool = True) -> ExactResponse:
        """Of the structure whose polynomials are `model`, in units of `scale` (m,).

        Raises:
            ModalError: Under a record, a mode does not oscillate.
        """
        flow, cuts, load = model.flow, model.boxes, model.load
        if flow.system.ground is not None and len(model.chosen) < model.modes:
            points = fit_points(len(cuts.names), 2)
            rate = fit(points, analyse(flow, cuts, points).eigenvalue, 2)
            nothing = Polynomial(rate.index, np.zeros_like(rate.coefficients))
            load = LoadTables.build(flow.system.ground, flow.time, rate, nothing)
        return cls(model.in_units(scale), scale, load, bent)

    @property
    def time(self) -> Array:
        """Nodes, shape (T,), in s."""
        return self.model.time

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the observed quantities."""
        return self.model.outputs

    @property
    def fastest(self) -> float:
        """Largest |λ| in the middle of the box, in 1/s."""
        return self.model.fastest

    def values(self, unit: Array) -> Array:
        """Trajectories at unit coordinates (S, d), shape (S, T, m)."""
        return self.model.flow.values(self.model.boxes.to_physical(unit)) / self.scale

    def value_at(self, unit: Array, node: Array, output: Array) -> Array:
        """Values (N,) of one output at one node per point (N, d)."""
        out, flow = np.empty(len(unit)), self.model.flow

        def piece(part: tuple[Array, Array, Array]) -> None:
            rows, points, own = part
            physical = self.model.boxes.to_physical(points)
            found = self._compiled(physical, own, node[rows], output[rows], deep=False)
            if found is not None:
                out[rows] = found[0]
                return
            matrices, seen = evaluate(flow.system, flow.names, physical, derivatives=False)
            state = np.concatenate([matrices.q0.value, matrices.v0.value], -2)
            modes = _Modes.of(
                natural.state_matrix(matrices).value, seen.value, state, matrices.rigid
            )
            at = self._at(modes, own, node[rows], output[rows])
            out[rows] = (at.left * at.motion).real.sum(1)

        each(piece, pieces(unit))
        return out

    def at(self, unit: Array, node: Array, output: Array) -> tuple[Array, Array, Array]:
        """Values (N,) and gradients (N, d), exact; Hessians (N, d, d) of the polynomials, or 0."""
        f, g = np.empty(len(unit)), np.empty(unit.shape)
        H = np.zeros((*unit.shape, unit.shape[1]))
        for rows, points, own in pieces(unit):
            f[rows], g[rows], waves = self._sloped(points, own, node[rows], output[rows])
            if self.bent:
                H[rows] = self.model.at(unit[rows], node[rows], output[rows], waves)[2]
        return f, g, H

    def _sloped(
        self, points: Array, own: Array, node: Array, output: Array
    ) -> tuple[Array, Array, Waves | None]:
        """Values and gradients, by what each entry of A, the state and the rows do to them.

        Besides the waves of the polynomials' modes, where they are by the way.
        """
        flow, cuts = self.model.flow, self.model.boxes
        found = self._compiled(cuts.to_physical(points), own, node, output, deep=True)
        if found is not None:
            return found[0], found[1] * cuts.radius, None
        first = Slopes.of(flow.system, flow.names, cuts.to_physical(points))
        matrices = first.matrices
        state = np.concatenate([matrices.q0.value, matrices.v0.value], -2)
        modes = _Modes.of(natural.state_matrix(matrices).value, first.rows, state, matrices.rigid)
        at = self._at(modes, own, node, output)
        X, Y = modes.X[own], modes.Y[own]
        left = Y.swapaxes(1, 2) @ (at.left[..., None] * at.inner())
        through = (left @ X.swapaxes(1, 2)).real
        moved = (X @ at.motion[..., None])[..., 0].real
        back = (Y.swapaxes(1, 2) @ (at.left * at.wave)[..., None])[..., 0].real
        row = 1 / self.scale[output]
        slope = first.gradient(own, through, moved, back, row, output) * cuts.radius
        return (at.left * at.motion).real.sum(1), slope, None

    @cached_property
    def _factors(self) -> Factors | None:
        return factors(self.model.flow.system, self.model.flow.names)

    def _compiled(
        self, physical: Array, own: Array, node: Array, output: Array, *, deep: bool
    ) -> tuple[Array, Array] | None:
        """Values (N,) and gradients (N, d) by the parameters; None where they are had slowly."""
        flow, law = self.model.flow, self._factors
        if law is None:
            return None
        value, slopes = law.at(flow.system, flow.names, physical, derivatives=deep)
        shape = (len(value), *law.parts.shape[1:])
        arrays = (value @ law.parts.reshape(value.shape[1], -1)).reshape(shape)
        modes = DampedModes.of(arrays)
        if modes is None:
            return None
        ground = None if self.load is None else self.load.response(modes.rate[own], node)[:2]
        row, scale = law.row(value[own], output), self.scale[output][:, None]
        given = (self.time[node], value @ law.start, law.rigid, row / scale, ground, NEAR)
        out, parts, back, seen = modes.outputs(own, *given, deep=deep)
        gradient = np.zeros((len(out), physical.shape[1]))
        if deep:
            by = law.gradient(value[own], (parts, back, seen / scale), row, output)
            for j, k, slope in slopes:
                gradient[:, k] += by[:, j] * slope[own]
        return out, gradient

    def _at(self, modes: _Modes, own: Array, node: Array, output: Array) -> _AtNode:
        rate, t = modes.rate[own], self.time[node]
        left = modes.left[own, output] / self.scale[output][:, None]
        R = slope = np.zeros_like(rate)
        if self.load is not None:
            half = modes.require_pairs()
            found = self.load.response(rate[:, :half], node)
            R, slope = (np.concatenate([x, x.conj()], 1) for x in found[:2])
        return _AtNode(rate, t, left, modes.right[own], modes.push[own], R, slope)


@dataclass(frozen=True, eq=False)
class _Modes:
    """Eigenvalues (S, 2n), vectors X and Y = X⁻¹ (S, 2n, 2n), r X, Y s and Y kick."""

    rate: Array
    X: Array
    Y: Array
    left: Array
    right: Array
    push: Array

    @classmethod
    def of(cls, A: Array, rows: Array, state: Array, rigid: Array) -> _Modes:
        rate, X = natural.ordered_eigenvectors(A)
        Y = np.linalg.inv(X)
        if not (np.abs(X).sum(-2).max(-1) * np.abs(Y).sum(-2).max(-1)).max() < CONDITION:
            raise natural.ModalError("modal: two modes nearly coincide at critical damping")
        kick = np.concatenate([np.zeros_like(rigid), -rigid])
        return cls(rate, X, Y, rows @ X, (Y @ state)[..., 0], (Y @ kick)[..., 0])

    def require_pairs(self) -> int:
        """Number of conjugate pairs; raises ModalError where a mode does not oscillate."""
        half = self.rate.shape[1] // 2
        if not natural.oscillating(self.rate[:, :half]).all():
            raise natural.ModalError(
                "modal: a mode under a record does not oscillate somewhere in the box"
            )
        return half


@dataclass(frozen=True, eq=False)
class _AtNode:
    """Parts of N outputs at one node each, all (N, 2n) but time: λ, t, r X, Y s, Y kick, R, R'."""

    rate: Array
    time: Array
    left: Array
    right: Array
    push: Array
    answer: Array
    slope: Array

    @property
    def wave(self) -> Array:
        """Exp(λ t)."""
        return np.asarray(np.exp(self.rate * self.time[:, None]))

    @property
    def motion(self) -> Array:
        """Modal coordinates of the state."""
        total: Array = self.wave * self.right + self.answer * self.push
        return total

    def inner(self) -> Array:
        """Divided differences of the waves times what excites them, shape (N, 2n, 2n)."""
        wave = self.wave
        total = self._divided(wave, self.time[:, None] * wave) * self.right[:, None, :]
        if self.answer.any():
            total = total + self._divided(self.answer, self.slope) * self.push[:, None, :]
        return total

    def _divided(self, f: Array, df: Array) -> Array:
        gap = self.rate[:, :, None] - self.rate[:, None, :]
        near = np.abs(gap) * self.time[:, None, None] < NEAR
        far = (f[:, :, None] - f[:, None, :]) / np.where(near, 1.0, gap)
        return np.where(near, (df[:, :, None] + df[:, None, :]) / 2, far)


def pieces(unit: Array) -> Iterator[tuple[Array, Array, Array]]:
    """Rows that are treated together, their different points, and which of them each row has."""
    order = np.lexsort(unit.T)  # equal points side by side
    for start in range(0, len(unit), PIECE):
        rows = order[start : start + PIECE]
        points = unit[rows]
        fresh = np.append(True, (points[1:] != points[:-1]).any(1))
        yield rows, points[fresh], np.cumsum(fresh) - 1
