"""Motion over a box from polynomials λ_k(p), C_k(p), the intervening variables of section 7.

Displacements oscillate in the inputs, the more the later; λ_k and C_k do not. Every value and
derivative follows from q(t; p) = 2 Re Σ_k C_k(p) w(t; λ_k(p)), w = exp(λ t) of the free motion, and
the response R(t; λ) = ∫ exp(λ (t − s)) a(s) ds to a load.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

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
from alphacut.fuzzy.arrays import Array, Ints

Waves = tuple[Array, Array, Array]


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
        free, *forced = (modes.share[s] for s in range(modes.share.shape[0]))
        courses = histories(flow.system).values()
        loads = [
            LoadTables(history, flow.time, modes.rate, share)
            for history, share in zip(courses, forced, strict=True)
        ]
        if structure.feeds is not None:  # 2 Re C_1 a(t) with half of it as C_1
            first = np.zeros((modes.share.shape[1], 1))
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
            jets = self.of_output[o].jets(unit[rows])
            for number, wave in enumerate(self.waves(jets[:, 0, :n], node[rows]), 1):
                amplitude = jets[..., number * n : (number + 1) * n]
                derivatives[rows] += composed(jets[..., :n], amplitude, wave, d)
        H = np.empty((len(unit), d, d))
        H[:, row, column] = H[:, column, row] = derivatives[:, 1 + d :]
        return derivatives[:, 0], derivatives[:, 1 : 1 + d], H

    def waves(self, rate: Array, node: Ints) -> Sequence[Waves]:
        """Time functions w(t; λ_k) of the free motion (if any), then of each load, at N points.

        Each has w, dw/dλ and d²w/dλ², (N, n) each, at eigenvalues λ_k (N, n) and nodes (N,).
        """
        parts = []
        if self.started:
            t = self.flow.time[node][:, None]
            wave = np.exp(rate * t)
            parts.append((wave, t * wave, t * t * wave))
        return parts + [load.response(rate, node) for load in self.loads]


def composed(rate: Array, share: Array, waves: Waves, d: int) -> Array:
    """Value, gradient and Hessian of 2 Re Σ_k C_k w(λ_k) by the chain rule, shape (N, q).

    The q = 1 + d + d (d + 1)/2 numbers are a value, a gradient and a Hessian's upper triangle;
    those of λ_k and C_k have shape (N, q, n), w, dw/dλ and d²w/dλ² at λ_k (N, n) each.
    """
    w, dw, ddw = (x[:, None] for x in waves)
    out = (share * w).real.sum(-1)
    out[:, 1:] += (share[:, :1] * dw * rate[:, 1:]).real.sum(-1)
    slope = rate[:, 1 : 1 + d]
    # ∂C ∂λ w' + C ∂λ ∂λ w''/2; with its transpose, what the Hessian has of products of slopes
    factor = share[:, 1 : 1 + d] * dw + slope * (share[:, :1] * ddw / 2)
    half = (factor @ slope.swapaxes(1, 2)).real
    row, column = np.triu_indices(d)
    out[:, 1 + d :] += half[:, row, column] + half[:, column, row]
    return np.asarray(2 * out)
