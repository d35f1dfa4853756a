"""Exact responses of structures whose modes the damping does not couple, at a tenth of the cost.

With S = M⁻¹K an output is ρᵀ H(S) s, where H is what a mode of squared frequency μ answers to its
start or to the ground. Its derivatives need the symmetric modes of M and K, divided differences of
H (Daleckii and Krein, 1965) and the derivatives of M and K alone; the damping is within H.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from alphacut.frame.calculus.jet import Array
from alphacut.frame.modal.exact_response import NEAR, ExactResponse, pieces
from alphacut.frame.modal.model import ModalModel, Waves
from alphacut.frame.structures.linear import Matrices, evaluate
from alphacut.frame.structures.proportional import Proportional, proportional
from alphacut.frame.structures.slopes import Slopes

CLOSE = 1e-4
"""Relative distance of two squared frequencies below which a divided difference may be a
derivative."""


def exact_response(model: ModalModel, scale: Array, *, bent: bool = True) -> ExactResponse:
    """Exact outputs in units of `scale` (m,), as `ExactResponse.of`, the cheaper way if there is.

    Raises:
        ModalError: Under a record, a mode does not oscillate.
    """
    found = ExactResponse.of(model, scale, bent=bent)
    law = proportional(model.flow.system, model.flow.names)
    if law is None:
        return found
    return ProportionalResponse(found.model, scale, found.load, bent, law)


@dataclass(frozen=True, eq=False)
class ProportionalResponse(ExactResponse):
    """As `ExactResponse`, to which points are left where a mode does not oscillate.

    Args:
        law: How the damping follows M and K.
    """

    law: Proportional | None = None

    def value_at(self, unit: Array, node: Array, output: Array) -> Array:
        """Values (N,) of one output at one node per point (N, d)."""
        out, law = np.empty(len(unit)), self._law
        for rows, points, own in pieces(unit):
            physical, names = self.model.boxes.to_physical(points), self.model.flow.names
            if law.affine:
                matrices = self._middle.moved(physical - self.model.boxes.centre).matrices
                seen = None
            else:
                matrices, seen = evaluate(law.bare, names, physical, derivatives=False)
            at = self._waves(physical, matrices, own, node[rows])
            if at is None:
                out[rows] = super().value_at(unit[rows], node[rows], output[rows])
            else:
                taken = self._taken(None if seen is None else seen.value, own, output[rows])
                out[rows] = at.value(taken, law.order[output[rows]])
        return out

    def _sloped(
        self, points: Array, own: Array, node: Array, output: Array
    ) -> tuple[Array, Array, Waves | None]:
        law, names = self._law, self.model.flow.names
        physical = self.model.boxes.to_physical(points)
        if law.affine:
            first = self._middle.moved(physical - self.model.boxes.centre)
        else:
            first = Slopes.of(law.bare, names, physical, observed=law.rows is None)
        at = self._waves(physical, first.matrices, own, node, started=bool(first.state.any()))
        if at is None:
            return super()._sloped(points, own, node, output)
        taken, order = self._taken(first.rows, own, output), law.order[output]
        by_M, by_K, back, moved = at.sensitivities(taken, order)
        seen = np.concatenate([moved, np.zeros_like(moved)], 1) / self.scale[output][:, None]
        slope = first.along(own, by_M, by_K, back, seen, output)
        for given, by in zip((law.ratio, *law.rayleigh), at.by_damping(taken, order), strict=True):
            if isinstance(given, str):
                slope[:, names.index(given)] += by
        same = at.squared.shape[1] == self.model.count
        return at.value(taken, order), slope * self.model.boxes.radius, at.all if same else None

    @property
    def _law(self) -> Proportional:
        assert self.law is not None
        return self.law

    @cached_property
    def _middle(self) -> Slopes:
        """Of an affine structure in the middle of the box, which is enough for all of it."""
        boxes = self.model.boxes
        return Slopes.of(self._law.bare, self.model.flow.names, boxes.centre[None], observed=False)

    def _taken(self, rows: Array | None, own: Array, output: Array) -> Array:
        """Rows of N problems over their outputs' scales, shape (N, n)."""
        fixed = self._law.rows
        if fixed is None:
            assert rows is not None
            found = rows[own, output, : rows.shape[-1] // 2]
        else:
            found = fixed[output]
        return found / self.scale[output][:, None]

    def _waves(
        self, physical: Array, matrices: Matrices, own: Array, node: Array, *, started: bool = False
    ) -> _Waves | None:
        """Modes of N problems and what excites them; None where one does not oscillate."""
        M, K = matrices.mass.value, matrices.stiffness.value
        below = np.linalg.inv(np.linalg.cholesky(M))
        squared, U = np.linalg.eigh(below @ K @ below.swapaxes(1, 2))
        if not (squared > 0).all():
            return None
        ratio, a, b = self._law.values(self.model.flow.names, physical)
        decay = ratio * np.sqrt(squared) + (a + b * squared) / 2
        if not (squared - decay**2 > 1e-6 * squared).all():
            return None
        shape = below.swapaxes(1, 2) @ U  # Φ with Φᵀ M Φ = I
        onto, bend = shape.swapaxes(1, 2) @ M, ratio / (2 * np.sqrt(squared)) + b / 2
        rate = -decay + 1j * np.sqrt(squared - decay**2)
        vectors = (squared[own], rate[own], bend[own], self.time[node][:, None])
        modes = _Waves(*vectors, shape[own], onto[own], [])
        start = (matrices.q0.value, matrices.v0.value)
        if started or start[0].any() or start[1].any():
            for place, (x, wave) in enumerate(zip(start, modes.free(), strict=True)):
                modes.parts.append(_Part(*wave, (onto @ x)[own, :, 0], place))
        if self.load is not None:
            modes.ground = self.load.response(rate[own], node)
            (R, slope, _), w = modes.ground, modes.turn
            amount = (onto @ matrices.rigid)[own, :, 0]
            modes.parts.append(_Part(-R / w, -slope / w, R / w**2, amount, None))
        return modes


@dataclass(frozen=True, eq=False)
class _Part:
    """One excitation: W(λ, ω) with derivatives by both, its share in each mode, all (N, n).

    The place is 0 for the initial displacement, 1 for the velocity, None for the ground.
    """

    wave: Array
    by_rate: Array
    by_turn: Array
    amount: Array
    place: int | None


@dataclass(eq=False)
class _Waves:
    """Modes of N problems at a node each: displacements Im W, velocities Im λ W, and so on.

    Args:
        squared: μ, shape (N, n).
        rate: λ.
        bend: Derivative of the decay −Re λ by μ.
        time: Of the nodes, shape (N, 1).
        shape: Φ, shape (N, n, n).
        onto: Φᵀ M.
        parts: What excites them.
        ground: Answer to the ground and its derivatives by λ, or None.
    """

    squared: Array
    rate: Array
    bend: Array
    time: Array
    shape: Array
    onto: Array
    parts: list[_Part]
    ground: tuple[Array, Array, Array] | None = None

    @property
    def all(self) -> Waves:
        """As `ModalModel.at` takes them."""
        free = None
        if any(part.place is not None for part in self.parts):
            wave = np.exp(self.rate * self.time)
            free = (wave, self.time * wave, self.time**2 * wave)
        return [free, self.ground]

    @property
    def turn(self) -> Array:
        """Damped frequency ω = Im λ."""
        return self.rate.imag

    def free(self) -> tuple[tuple[Array, Array, Array], ...]:
        """Waves of a unit start: −λ̄ exp(λ t)/ω with λ̄ = λ − 2 i ω, and exp(λ t)/ω."""
        w, left = self.turn, 2j * self.turn - self.rate
        unit = np.exp(self.rate * self.time) / w
        first = (left * unit, (self.time * left - 1) * unit, (2j - left / w) * unit)
        return first, (unit, self.time * unit, -unit / w)

    def value(self, taken: Array, order: Array) -> Array:
        """Outputs (N,) that take rows (N, n) of a derivative of the motion, (N,)."""
        kind, left = self.rate ** order[:, None], self._seen(taken)
        total = sum(left * (kind * part.wave).imag * part.amount for part in self.parts)
        return np.asarray(np.broadcast_to(total, left.shape).sum(1))

    def sensitivities(self, taken: Array, order: Array) -> tuple[Array, Array, Array, Array]:
        """Derivatives by entries of M and K (N, n, n), by the start (N, 2n), by the rows (N, n)."""
        left, n = self._seen(taken)[..., None], self.squared.shape[1]
        inner = np.zeros((len(left), n, n))
        back, moved = np.zeros((len(left), 2, n)), np.zeros((len(left), n, 1))
        bent = self._answers(order, np.ones_like(self.squared), self.bend)
        for part, answer, slope in bent:
            inner += self._divided(answer, slope) * part.amount[:, None]
            moved += (answer * part.amount)[..., None]
            if part.place is not None:
                back[:, part.place] = ((left[..., 0] * answer)[:, None] @ self.onto)[:, 0]
        inner *= left
        turned = self.shape.swapaxes(1, 2)
        by_M = -self.shape @ (inner * self.squared[:, None]) @ turned
        seen = (self.shape @ moved)[..., 0]
        return by_M, self.shape @ inner @ turned, back.reshape(len(left), -1), seen

    def by_damping(self, taken: Array, order: Array) -> tuple[Array, Array, Array]:
        """Derivatives by ζ, a and b of the decay ζ √μ + (a + b μ)/2, each (N,)."""
        left, still = self._seen(taken), np.zeros_like(self.squared)
        decays = (np.sqrt(self.squared), still + 0.5, self.squared / 2)
        found = []
        for decay in decays:
            answers = self._answers(order, still, decay)
            total = sum(left * slope * part.amount for part, _, slope in answers)
            found.append(np.broadcast_to(total, left.shape).sum(1))
        return found[0], found[1], found[2]

    def _seen(self, taken: Array) -> Array:
        return (taken[:, None] @ self.shape)[:, 0]

    def _answers(
        self, order: Array, more: Array, decay: Array
    ) -> Iterator[tuple[_Part, Array, Array]]:
        """H of each part, and its derivative where μ grows by `more` and the decay by `decay`."""
        turn = (more + 2 * self.rate.real * decay) / (2 * self.turn)
        rate, power = 1j * turn - decay, order[:, None]
        kind = self.rate**power
        lower = power * self.rate ** np.maximum(power - 1, 0) * rate
        for part in self.parts:
            slope = part.by_rate * rate + part.by_turn * turn
            yield part, (kind * part.wave).imag, (kind * slope + lower * part.wave).imag

    def _divided(self, f: Array, df: Array) -> Array:
        gap = self.squared[:, :, None] - self.squared[:, None, :]
        size = np.sqrt(self.squared)
        phase = np.abs(size[:, :, None] - size[:, None, :]) * self.time[:, :, None]
        near = (np.abs(gap) < CLOSE * self.squared[:, :, None]) & (phase < NEAR)
        far = (f[:, :, None] - f[:, None, :]) / np.where(near, 1.0, gap)
        return np.where(near, (df[:, :, None] + df[:, None, :]) / 2, far)
