"""Modal intervening variables λ_k(p), C_k(p) as polynomials (section 7).

Displacements oscillate in the parameters, the more the later; λ_k and C_k do not. With them as
polynomials every trajectory, derivative and envelope follows without solving the equations of
motion again: q(t; p) = 2 Re Σ_k C_k(p) w(t; λ_k(p)), with w = exp(λ t) of the start, and the
response R(t; λ) of `load_tables` under a record.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar

import numpy as np

from alphacut.frame.boxes import Boxes
from alphacut.frame.calculus.jet import Array
from alphacut.frame.calculus.polynomial import Polynomial
from alphacut.frame.dynamics.flow import LinearFlow
from alphacut.frame.response.load_tables import LoadTables

PIECE = 20_000
"""Points whose values are computed together."""
Waves = tuple[Array, Array, Array]


@dataclass(frozen=True, eq=False)
class ModalModel:
    """Trajectories over the unit box from polynomials in the parameters.

    Args:
        flow: The trajectories that it stands for.
        boxes: The parameters' boxes.
        eigenvalue: λ_k, n polynomials, in 1/s.
        coefficient: C_k, n m polynomials.
        loads: Responses to the loads, and what these add to outputs at once.
        chosen: Which modes it has, by rising |λ|, shape (n,).
        error: Largest deviation of held-out trajectories, shape (T, m).
        analyses: Eigen-analyses made.
    """

    flow: LinearFlow
    boxes: Boxes
    eigenvalue: Polynomial
    coefficient: Polynomial
    loads: tuple[LoadTables, ...]
    chosen: Array
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

    @property
    def count(self) -> int:
        """Number of modes n."""
        return int(self.eigenvalue.coefficients.shape[1])

    @property
    def degree(self) -> int:
        """Total degree of the polynomials."""
        return int(self.eigenvalue.index.sum(1).max())

    def in_units(self, scale: Array) -> ModalModel:
        """Model with every output divided by its scale (m,)."""
        coefficient = self.coefficient.divided(np.tile(scale, self.count))
        loads = tuple(load.in_units(scale) for load in self.loads)
        return replace(self, coefficient=coefficient, loads=loads, error=self.error / scale)

    @cached_property
    def started(self) -> bool:
        """Whether the model has a free motion: an initial state, or no load at all."""
        return not self.loads or bool(self.coefficient.coefficients.any())

    @cached_property
    def together(self) -> Polynomial:
        """Polynomials λ_k, n, then C_k, n m of the free motion (if any) and of each load."""
        parts = [self.eigenvalue, *[self.coefficient] * self.started]
        parts += [load.share for load in self.loads]
        return Polynomial(parts[0].index, np.hstack([part.coefficients for part in parts]))

    @cached_property
    def of_output(self) -> list[Polynomial]:
        """For each output λ_k, n, then C_k, n of the free motion (if any) and of each load."""
        n, m = self.count, len(self.outputs)
        rate, amplitudes = np.split(self.together.coefficients, [n], axis=1)
        index = self.together.index
        return [Polynomial(index, np.hstack([rate, amplitudes[:, o::m]])) for o in range(m)]

    def values(self, unit: Array) -> Array:
        """Outputs at all nodes for unit coordinates (S, d), shape (S, T, m).

        They are 2 Re Σ_k C_k w(t; λ_k) over the free motion and each load.
        """
        n, time = self.count, self.time
        variables = self.together(unit)  # λ_k, then C_k of each part
        rate = variables[:, :n]
        waves = [np.exp(rate[:, None] * time[:, None])] if self.started else []
        waves += [load.at_nodes(rate) for load in self.loads]
        C = variables[:, n:].reshape(len(unit), len(waves) * n, -1)
        w = np.concatenate(waves, -1)
        return np.asarray(2 * (w.real @ C.real - w.imag @ C.imag))

    def at(self, unit: Array, node: Array, output: Array) -> tuple[Array, Array, Array]:
        """One output at one node for each of N points, with derivatives by unit coordinates.

        Args:
            unit: Unit coordinates of the points, shape (N, d).
            node: Time node of each, shape (N,).
            output: Index of the output of each, shape (N,).

        Returns:
            Values (N,), gradients (N, d) and Hessians (N, d, d), in the output's unit.
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

    def value_at(self, unit: Array, node: Array, output: Array) -> Array:
        """Values (N,) of one output at one node for each of N points, as in `at`.

        They are 2 Re Σ_k C_k w(t; λ_k) over the free motion and each load.
        """
        values, n = np.zeros(len(unit)), self.count
        for o in np.unique(output):
            of_output = np.flatnonzero(output == o)
            for rows in np.array_split(of_output, -(-len(of_output) // PIECE)):
                variables = self.of_output[o](unit[rows])  # λ_k, then C_k of each part
                for number, wave in enumerate(self.waves(variables[:, :n], node[rows]), 1):
                    amplitude = variables[:, number * n : (number + 1) * n]
                    values[rows] += 2 * (amplitude * wave[0]).real.sum(1)
        return values

    def waves(self, rate: Array, node: Array) -> Sequence[Waves]:
        """Time functions w(t; λ_k) of the free motion and of each load, with derivatives by λ.

        Args:
            rate: Eigenvalues λ_k, shape (N, n), in 1/s.
            node: Time node of each point, shape (N,).

        Returns:
            For the free motion (if any), then each load: w, dw/dλ and d²w/dλ², each (N, n).
        """
        parts = []
        if self.started:
            t = self.time[node][:, None]
            wave = np.exp(rate * t)
            parts.append((wave, t * wave, t * t * wave))
        return parts + [load.response(rate, node) for load in self.loads]


def composed(rate: Array, share: Array, waves: Waves, d: int) -> Array:
    """Value, gradient and Hessian of 2 Re Σ_k C_k w(λ_k) by the chain rule, shape (N, q).

    A function's q = 1 + d + d (d + 1)/2 numbers are its value, its gradient and the upper triangle
    of its Hessian.

    Args:
        rate: Those of λ_k, shape (N, q, n).
        share: Those of C_k, shape (N, q, n).
        waves: w, dw/dλ and d²w/dλ² at λ_k, each (N, n).
        d: Number of parameters.
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
