"""Motion over a box from polynomials λ_k(p), C_k(p), the intervening variables of section 7.

Displacements oscillate in the inputs, the more the later; λ_k and C_k do not. Every value and
derivative follows from q(t; p) = 2 Re Σ_k C_k(p) w(t; λ_k(p)), w = exp(λ t) of the free motion, and
the response R(t; λ) = ∫ exp(λ (t − s)) a(s) ds to a load.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.frame.boxes import Boxes
from alphacut.frame.calculus.taylor_model import TaylorModel, concatenate
from alphacut.frame.dynamics.flow import LinearFlow, exact_flow
from alphacut.frame.modes.damped import (
    DampedModes,
    DampedStructure,
    needed_modes,
    require_dissipation,
)
from alphacut.frame.response.load_tables import Direct, LoadTables
from alphacut.frame.structures.linear import histories
from alphacut.frame.structures.loads import distinct_histories


@dataclass(frozen=True, eq=False)
class ModalModel:
    """Trajectories over the unit box from polynomials in the parameters."""

    flow: LinearFlow  # the motion that it stands for
    boxes: Boxes  # the inputs' boxes
    structure: DampedStructure  # the structure over the widest of them
    modes: DampedModes  # its modes
    eigenvalue: TaylorModel  # λ_k, polynomials without remainders, (n,), in 1/s
    coefficient: TaylorModel  # C_k of the free motion, the same, (n, m)
    loads: tuple[LoadTables, ...]  # responses to the loads, and what these add to outputs at once

    @classmethod
    def from_modes(
        cls, flow: LinearFlow, boxes: Boxes, structure: DampedStructure, modes: DampedModes
    ) -> ModalModel:
        """The motion that modes of a structure have."""
        shares = modes.outputs(structure).polynomial
        free, *forced = (shares[s] for s in range(shares.shape[0]))
        courses = histories(flow.system).values()
        loads = [
            LoadTables(history, flow.time, modes.rate, share)
            for history, share in zip(courses, forced, strict=True)
        ]
        if structure.feeds is not None:  # 2 Re C_1 a(t) with half of it as C_1
            first = np.zeros((shares.shape[1], 1))
            first[0] = 0.5
            for h, history in enumerate(distinct_histories(flow.system.loads)):
                share = (structure.feeds[:, h] * first).polynomial
                loads.append(Direct(history, flow.time, modes.rate, share))
        return cls(flow, boxes, structure, modes, modes.rate, free, tuple(loads))

    @classmethod
    def of_degree(
        cls, flow: LinearFlow, boxes: Boxes, degree: int, allowed: Array | float = 0.0
    ) -> ModalModel:
        """The motion by polynomials of a degree.

        They are for the widest of the boxes, one a level. Modes are left out that are worth no more
        than `allowed` in each output, shape (m,).

        Raises:
            UnprovedError: The integrator is not the exact one, the structure is not known to have a
                mass and to lose energy, or a mode does not oscillate or has the frequency of
                another one.
        """
        require_dissipation(exact_flow(flow).system, boxes)
        structure = DampedStructure.over_box(flow.system, boxes, degree)
        courses = [*histories(flow.system).values()]
        chosen = needed_modes(structure, courses, flow.time, allowed)
        return cls.from_modes(flow, boxes, structure, DampedModes.of_structure(structure, chosen))

    @property
    def count(self) -> int:
        """Number of modes n."""
        return len(self.eigenvalue.value)

    @property
    def degree(self) -> int:
        """Total degree of the polynomials."""
        return len(self.eigenvalue.parts) - 1

    def in_units(self, scale: Array) -> ModalModel:
        """Model with every output divided by its scale (m,)."""
        loads = tuple(replace(load, share=load.share * (1 / scale)) for load in self.loads)
        return replace(self, coefficient=self.coefficient * (1 / scale), loads=loads)

    @cached_property
    def started(self) -> bool:
        """Whether the model has a free motion: an initial state, or no load at all."""
        return not self.loads or bool(self.coefficient.coefficients.any())

    @property
    def shares(self) -> list[TaylorModel]:
        """C_k of the free motion (if any) and of each load, shape (n, m) each."""
        return [self.coefficient] * self.started + [load.share for load in self.loads]

    @cached_property
    def together(self) -> TaylorModel:
        """Polynomials λ_k, n, then C_k of each part, n m."""
        return concatenate([self.eigenvalue, *(share.reshaped(-1) for share in self.shares)], -1)

    @cached_property
    def of_output(self) -> list[TaylorModel]:
        """For each output λ_k, n, then C_k of each part, n."""
        outputs = range(len(self.flow.outputs))
        return [
            concatenate([self.eigenvalue, *(x[:, o] for x in self.shares)], -1) for o in outputs
        ]

    def values(self, unit: Array) -> Array:
        """Outputs at all nodes for unit coordinates (S, d), shape (S, T, m).

        They are 2 Re Σ_k C_k w(t; λ_k) over the free motion and each load.
        """
        n, time = self.count, self.flow.time
        variables = self.together.at(unit)
        rate = variables[:, :n]
        waves = [np.exp(rate[:, None] * time[:, None])] if self.started else []
        waves += [load.at_nodes(rate) for load in self.loads]
        C = variables[:, n:].reshape(len(unit), len(waves) * n, -1)
        w = np.concatenate(waves, -1)
        return np.asarray(2 * (w.real @ C.real - w.imag @ C.imag))

    def at(self, unit: Array, node: Ints, output: Ints) -> tuple[Array, Array, Array]:
        """One output at one node for each of N points, with derivatives by unit coordinates.

        Points have unit coordinates (N, d); the index of each one's node and output is given.
        Returns values (N,), gradients (N, d) and Hessians (N, d, d), in the output's unit.
        """
        n, d = self.count, unit.shape[1]
        row, column = np.triu_indices(d)
        derivatives = np.zeros((len(unit), 1 + d + len(row)))  # value, gradient, upper triangle
        for o in np.unique(output):
            rows = np.flatnonzero(output == o)
            jets = self.of_output[o].jets(unit[rows]).swapaxes(0, 1)
            rate, share = jets[..., :n], jets[..., n:].reshape(*jets.shape[:2], -1, n, 1)
            waves = self.waves(rate[0], node[rows])
            derivatives[rows] = (waves[:, None] @ wave_factors(rate, share, d)[:, 0])[:, 0]
        H = np.empty((len(unit), d, d))
        H[:, row, column] = H[:, column, row] = derivatives[:, 1 + d :]
        return derivatives[:, 0], derivatives[:, 1 : 1 + d], H

    def waves(self, rate: Array, node: Ints) -> Array:
        """Time functions w(t; λ_k) of the free motion (if any), then of each load, (N, 6 P n).

        They are w, dw/dλ and d²w/dλ² of P parts and n modes, real and imaginary parts, in the order
        of `wave_factors`, at eigenvalues λ_k (N, n) and nodes (N,).
        """
        parts = list[Array]()
        if self.started:
            t = self.flow.time[node][:, None]
            wave = np.exp(rate * t)
            parts.append(np.stack([wave, t * wave, t * t * wave]))
        parts += [load.response(rate, node) for load in self.loads]
        waves = np.moveaxis(np.stack(parts), 2, 0)
        return in_planes(waves).reshape(len(rate), -1)


def wave_factors(rate: Array, C: Array, d: int) -> Array:
    """Factors of the waves w, w′, w″ in outputs, their gradients and Hessians at B points.

    Of 2 Re Σ_k C_k w(λ_k), λ (q, B, n) and C (q, B, P, n, m) with derivatives: (B, m, 6 P n, q),
    the third axis over parts, orders of w's derivative, modes, and real and imaginary parts.
    """
    rate = rate[..., None, :, None]
    out = np.zeros((*C.shape[1:3], 3, *C.shape[3:], len(C)), complex)  # (B, P, 3, n, m, q)
    out[:, :, 0] = np.moveaxis(C, 0, -1)
    for k in range(1, 1 + d):
        out[:, :, 1, ..., k] = C[0] * rate[k]
    for a, (i, j) in enumerate(zip(*np.triu_indices(d), strict=True), 1 + d):
        x, y = rate[1 + i], rate[1 + j]
        out[:, :, 1, ..., a] = C[1 + i] * y + C[1 + j] * x + C[0] * rate[a]
        out[:, :, 2, ..., a] = C[0] * x * y
    doubled = 2 * np.stack([out.real, -out.imag], 4)  # (B, P, 3, n, 2, m, q)
    flat = doubled.reshape(len(out), -1, *out.shape[-2:])
    return np.ascontiguousarray(flat.swapaxes(1, 2))


def in_planes(x: Array) -> Array:
    """Real and imaginary parts of complex numbers along a new last axis, shape (…, 2)."""
    return np.ascontiguousarray(x).view(float).reshape(*x.shape, 2)
