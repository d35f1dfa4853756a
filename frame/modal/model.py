"""Modal intervening variables λ_k(p), C_k(p) as polynomials (section 7).

Displacements oscillate in the parameters, the more the later; λ_k and C_k do not. With them as
polynomials every trajectory, derivative and envelope follows without solving the equations of
motion again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar

import numpy as np

from alphacut.frame.boxes import Boxes
from alphacut.frame.calculus.jet import Array
from alphacut.frame.calculus.modal_jet import Parts, composed, composed_quadratics
from alphacut.frame.calculus.polynomial import Polynomial
from alphacut.frame.dynamics.flow import LinearFlow
from alphacut.frame.modal.ground_response import LoadTables, decaying

PIECE = 20_000
"""Points whose values are computed together."""
Waves = Sequence[tuple[Array, Array, Array] | None]


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

    def turned(self, duration: float) -> float:
        """Largest change of a lasting mode's phase over the box within a time (s), in rad."""
        middle, rest = self.eigenvalue.coefficients[0], self.eigenvalue.coefficients[1:]
        # a mode that has died down has no basins
        lasting = np.minimum(duration, 5 / np.maximum(-middle.real, 1e-300))
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
        rate = self.eigenvalue(unit)
        share = self.coefficient(unit).reshape(len(unit), self.count, -1)
        values = decaying(rate, share, self.flow.step, len(self.time))
        return values if self.load is None else values + self.load.values(unit, rate)

    def at(
        self, unit: Array, node: Array, output: Array, waves: Waves | None = None
    ) -> tuple[Array, Array, Array]:
        """Values (N,), gradients (N, d), Hessians (N, d, d) of one output, node by point (N, d).

        Args:
            unit: Unit coordinates.
            node: Time nodes, shape (N,).
            output: Which output, shape (N,).
            waves: Those of the start and, under a load, of the ground, each w, w' and w'' of shape
                (N, n), where better ones than by the polynomials λ_k are known.
        """
        count, d = unit.shape
        out = np.zeros(count), np.zeros((count, d)), np.zeros((count, d, d))
        if self.degree <= 2:
            self._quadratic(unit, node, output, waves, out)
            return out
        for o in np.unique(output):
            rows = np.flatnonzero(output == o)
            found = self._taylor(self.of_output[o].derivatives(unit[rows]), node[rows])
            for total, part in zip(out, found, strict=True):
                total[rows] = part
        return out

    def _waves(self, rate: Array, node: Array) -> Waves:
        """What the start and the ground excite at eigenvalues (N, n); None of what does not."""
        started = self.coefficient.coefficients.any()
        free = self._free(rate, node) if started else None
        return [free, None if self.load is None else self.load.response(rate, node)]

    @cached_property
    def shares(self) -> list[list[Polynomial]]:
        """For each output the polynomials of what the start and the ground put into it."""
        given = [self.coefficient] + ([] if self.load is None else [self.load.share])
        m = len(self.outputs)
        return [[Polynomial(x.index, x.coefficients[:, o::m]) for x in given] for o in range(m)]

    def _quadratic(
        self, unit: Array, node: Array, output: Array, waves: Waves | None, out: Parts
    ) -> None:
        """Add to `out` as `at`, for degree 2, whose second derivatives are the same everywhere."""
        if waves is None:
            waves = self._waves(self.eigenvalue.quadratic(unit)[0], node)
        for place, wave in enumerate(waves):
            if wave is not None:
                own = [share[place] for share in self.shares]
                composed_quadratics(unit, self.eigenvalue, own, output, wave, out)

    def _taylor(self, parts: Parts, node: Array) -> Parts:
        (count, d), rate = parts[1].shape[:2], parts[0][:, : self.count]
        out = np.zeros(count), np.zeros((count, d)), np.zeros((count, d, d))
        composed(parts, 1, self._free(rate, node), out)
        if self.load is not None:
            composed(parts, 2, self.load.response(rate, node), out)
        return out

    def _free(self, rate: Array, node: Array) -> tuple[Array, Array, Array]:
        """Exp(λ t) and its derivatives by λ at one node per point, (N, n)."""
        t = self.time[node][:, None]
        wave = np.exp(rate * t)
        return wave, t * wave, t * t * wave

    def value_at(self, unit: Array, node: Array, output: Array) -> Array:
        """Values (N,) of one output at one node per point (N, d)."""
        values, order = np.empty(len(unit)), np.argsort(output, kind="stable")
        for rows in np.array_split(order, -(-len(order) // PIECE) or 1):
            values[rows] = self._value_at(unit[rows], node[rows], output[rows])
        return values

    def _value_at(self, unit: Array, node: Array, output: Array) -> Array:
        values, n = np.zeros(len(unit)), self.count
        for o in np.unique(output):
            rows = np.flatnonzero(output == o)
            parts = self.of_output[o](unit[rows])
            for place, wave in enumerate(self._waves(parts[:, :n], node[rows]), 1):
                if wave is not None:
                    values[rows] += 2 * (parts[:, place * n :][:, :n] * wave[0]).real.sum(1)
        return values
