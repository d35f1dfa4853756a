"""Response over a box from polynomials λ_k(p), C_k(p), the intervening variables of section 7.

Displacements oscillate in the inputs, the more the later; λ_k and C_k do not. Every value and
derivative follows from q(t; p) = 2 Re Σ_k C_k(p) w(t; λ_k(p)), with the wave w = exp(λ t) for the
free response, and w = R(t; λ) = ∫ exp(λ (t − s)) a(s) ds for that to a load. The free response and
the response to each load are the parts of the model.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

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


class OutputJets(NamedTuple):
    """An output at N points, with derivatives by d unit coordinates."""

    value: Array  # (N,)
    gradient: Array  # (N, d)
    hessian: Array  # (N, d, d)


@dataclass(frozen=True, eq=False)
class ModalModel:
    """Outputs over the unit box from polynomials of n modes in the d inputs; m outputs."""

    flow: LinearFlow  # the structure's exact response, which it approximates
    boxes: Boxes  # the inputs' boxes
    structure: DampedStructure  # the structure over the widest of them
    modes: DampedModes  # its modes
    eigenvalue: TaylorModel  # λ_k, polynomials without remainders, (n,), in 1/s
    coefficient: TaylorModel  # C_k of the free response, the same, (n, m)
    loads: tuple[LoadTables, ...]  # responses to the loads, and what these add to outputs at once

    @classmethod
    def from_modes(
        cls, flow: LinearFlow, boxes: Boxes, structure: DampedStructure, modes: DampedModes
    ) -> ModalModel:
        """Return the model of a structure's response that some of its damped modes give.

        Args:
            flow: The structure's exact response, with T time nodes and m outputs.
            boxes: Nested boxes of the inputs, the widest first.
            structure: The structure as Taylor models over the widest box.
            modes: Polynomials of n modes over this box, for each source: the initial state first,
                then the loads in the order of `histories(flow.system)`.
        """
        coefficients = modes.outputs(structure).polynomial  # (sources, n, m)
        loads = [
            LoadTables(history, flow.time, modes.eigenvalue, coefficients[k])
            for k, history in enumerate(histories(flow.system).values(), start=1)
        ]
        if structure.feeds is not None:
            # The wave of the first mode is the load a(t) then, so that 2 Re C_1 a(t) is the
            # feedthrough with half of it as C_1.
            half_of_first = np.zeros((coefficients.shape[1], 1))
            half_of_first[0] = 0.5
            for h, history in enumerate(distinct_histories(flow.system.loads)):
                feedthrough = (structure.feeds[:, h] * half_of_first).polynomial
                loads.append(Direct(history, flow.time, modes.eigenvalue, feedthrough))
        return cls(flow, boxes, structure, modes, modes.eigenvalue, coefficients[0], tuple(loads))

    @classmethod
    def of_degree(
        cls,
        flow: LinearFlow,
        boxes: Boxes,
        degree: int,
        tolerance: Array | float = 0.0,
        *,
        fixed: Mapping[str, float] | None = None,
    ) -> ModalModel:
        """Return the model by polynomials of one degree over the widest of some nested boxes.

        Args:
            flow: The structure's response by an exact integrator, with T time nodes and m outputs.
            boxes: Nested boxes of the inputs, one for each α-level, the widest first.
            degree: Total degree of the polynomials.
            tolerance: Modes are left out that are together worth no more than this in each output,
                shape (m,), or one number for all. At 0 no mode is left out that adds anything.
            fixed: Values of other parameters by name, where they are not nominal.

        Raises:
            UnprovedError: The integrator is not the exact one, the structure is not known to have a
                mass and to lose energy, a mode does not oscillate or has the frequency of another
                one, or the mass may be singular in the box.
            numpy.linalg.LinAlgError: A mode is defective at the midpoint of the box.
        """
        require_dissipation(exact_flow(flow).system, boxes, fixed)
        structure = DampedStructure.over_box(flow.system, boxes, degree, fixed)
        loads = list(histories(flow.system).values())
        chosen = needed_modes(structure, loads, flow.time, tolerance)
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
        """Return the model with every output divided by its scale (m,)."""
        loads = tuple(replace(load, share=load.share * (1 / scale)) for load in self.loads)
        return replace(self, coefficient=self.coefficient * (1 / scale), loads=loads)

    @cached_property
    def has_free_response(self) -> bool:
        """Whether there is a free response: an initial state, or no load at all."""
        return not self.loads or bool(self.coefficient.coefficients.any())

    @property
    def coefficients(self) -> list[TaylorModel]:
        """C_k of each part, shape (n, m): of the free response, if there is one, then of loads."""
        of_loads = [load.share for load in self.loads]
        return [self.coefficient, *of_loads] if self.has_free_response else of_loads

    @cached_property
    def together(self) -> TaylorModel:
        """Polynomials λ_k, n of them, then C_k of each part, n m."""
        flat = [coefficient.reshaped(-1) for coefficient in self.coefficients]
        return concatenate([self.eigenvalue, *flat], -1)

    @cached_property
    def by_output(self) -> list[TaylorModel]:
        """For each output the polynomials λ_k, n of them, then C_k of each part, n."""
        models = []
        for o in range(len(self.flow.outputs)):
            of_output = [coefficient[:, o] for coefficient in self.coefficients]
            models.append(concatenate([self.eigenvalue, *of_output], -1))
        return models

    def values(self, unit: Array) -> Array:
        """Return outputs at all time nodes for S points, shape (S, T, m).

        They are 2 Re Σ_k C_k w(t; λ_k) over n modes and all parts of the response, free and by
        loads; errors of the model are not contained.

        Args:
            unit: Unit coordinates of the points, shape (S, d), in [−1, 1] over the widest box.
        """
        n = self.count
        polynomials = self.together.at(unit)
        eigenvalues = polynomials[:, :n]
        waves = []  # of each part, (S, T, n)
        if self.has_free_response:
            waves.append(np.exp(eigenvalues[:, np.newaxis] * self.flow.time[:, np.newaxis]))
        waves += [load.at_nodes(eigenvalues) for load in self.loads]
        C = polynomials[:, n:].reshape(len(unit), len(waves) * n, -1)
        w = np.concatenate(waves, axis=-1)
        return np.asarray(2 * (w.real @ C.real - w.imag @ C.imag))

    def at(self, unit: Array, node: Ints, output: Ints) -> OutputJets:
        """Return one output at one time node for each of N points, with derivatives by the inputs.

        Args:
            unit: Unit coordinates of the points, shape (N, d), in [−1, 1] over the widest box.
            node: Index of the time node of each point, shape (N,).
            output: Index of the output of each point, shape (N,).

        Returns:
            `value` (N,), `gradient` (N, d) and `hessian` (N, d, d), by the unit coordinates, in the
            units of the outputs.
        """
        n = self.count
        d = unit.shape[1]
        row, column = np.triu_indices(d)
        jets = np.zeros((len(unit), 1 + d + len(row)))  # value, gradient, packed Hessian
        for o in np.unique(output):
            points = np.flatnonzero(output == o)
            polynomials = self.by_output[o].jets(unit[points]).swapaxes(0, 1)
            eigenvalues = polynomials[..., :n]
            coefficients = polynomials[..., n:].reshape(*polynomials.shape[:2], -1, n, 1)
            factors = wave_factors(eigenvalues, coefficients, d)[:, 0]
            waves = self.waves(eigenvalues[0], node[points])
            jets[points] = (waves[:, np.newaxis] @ factors)[:, 0]
        hessian = np.empty((len(unit), d, d))
        hessian[:, row, column] = jets[:, 1 + d :]
        hessian[:, column, row] = jets[:, 1 + d :]
        return OutputJets(jets[:, 0], jets[:, 1 : 1 + d], hessian)

    def waves(self, eigenvalues: Array, node: Ints) -> Array:
        """Return w(t; λ), dw/dλ and d²w/dλ² of all parts of the response, for N points.

        A part is the free response, w = exp(λ t), if the structure has one, or the response to a
        load a, w = ∫ exp(λ (t − s)) a(s) ds; parts stand in this order.

        Args:
            eigenvalues: λ of n modes, shape (N, n), in 1/s.
            node: Index of the time node t of each point, shape (N,).

        Returns:
            Real numbers, shape (N, 6 parts n). The second axis runs over parts, then w, dw/dλ,
            d²w/dλ², then modes, then real and imaginary parts.
        """
        parts = list[Array]()
        if self.has_free_response:
            t = self.flow.time[node][:, np.newaxis]
            wave = np.exp(eigenvalues * t)
            parts.append(np.stack([wave, t * wave, t * t * wave]))
        parts += [load.response(eigenvalues, node) for load in self.loads]
        waves = np.moveaxis(np.stack(parts), 2, 0)  # (N, parts, 3, n)
        return _real_and_imaginary(waves).reshape(len(eigenvalues), -1)


def wave_factors(eigenvalues: Array, C: Array, d: int) -> Array:
    """Return the factors of w, w′ and w″ in 2 Re Σ_k C_k w(λ_k) and its first two derivatives.

    The eigenvalues λ_k and coefficients C_k depend on d inputs u, and w is a function of λ, such as
    exp(λ t). By the chain rule, with w′ = dw/dλ and derivatives by the inputs u_i as indices,

        (C w)_i = C_i w + C λ_i w′,
        (C w)_ij = C_ij w + (C_i λ_j + C_j λ_i + C λ_ij) w′ + C λ_i λ_j w″.

    Args:
        eigenvalues: λ_k of n modes with first and second derivatives at B points, shape (q, B, n)
            with q = 1 + d + d (d + 1)/2: value, gradient, and second derivatives by u_i and u_j for
            i ≤ j, packed by rows.
        C: Complex C_k of m outputs for each of several parts of the response (free, to a load, …),
            with the same derivatives, shape (q, B, parts, n, m).
        d: Number of inputs.

    Returns:
        Real numbers, shape (B, m, 6 parts n, q). The third axis runs over parts, then w, w′, w″,
        then modes, then real and imaginary parts. The scalar product along it with the values of w,
        w′ and w″ in this order gives value and derivatives of the outputs.
    """
    rate = eigenvalues[..., np.newaxis, :, np.newaxis]
    _, points, parts, n, m = C.shape
    factors = np.zeros((points, parts, 3, n, m, len(C)), complex)
    of_wave = factors[:, :, 0]
    of_first_derivative = factors[:, :, 1]
    of_second_derivative = factors[:, :, 2]
    of_wave[:] = np.moveaxis(C, 0, -1)
    for a in range(1, 1 + d):
        of_first_derivative[..., a] = C[0] * rate[a]
    row, column = np.triu_indices(d)
    for a, (i, j) in enumerate(zip(row, column, strict=True), start=1 + d):
        rate_i = rate[1 + i]
        rate_j = rate[1 + j]
        of_first_derivative[..., a] = C[1 + i] * rate_j + C[1 + j] * rate_i + C[0] * rate[a]
        of_second_derivative[..., a] = C[0] * rate_i * rate_j
    # 2 Re (z w) = 2 Re z Re w − 2 Im z Im w
    doubled = 2 * np.stack([factors.real, -factors.imag], axis=4)
    flat = doubled.reshape(points, -1, m, len(C))
    return np.ascontiguousarray(flat.swapaxes(1, 2))


def _real_and_imaginary(x: Array) -> Array:
    """Return the real and imaginary parts of complex numbers along a new last axis, (…, 2)."""
    return np.ascontiguousarray(x).view(float).reshape(*x.shape, 2)
