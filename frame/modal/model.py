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
from alphacut.frame.calculus.modal_jet import Parts, composed
from alphacut.frame.calculus.polynomial import Polynomial
from alphacut.frame.calculus.threads import each
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
        d = unit.shape[1]
        f, g, H = np.empty(len(unit)), np.empty((len(unit), d)), np.empty((len(unit), d, d))
        rates = self.eigenvalue.quadratic(unit) if self.degree <= 2 else None
        if rates is not None and waves is None:
            waves = self._waves(rates[0], node)
        for o in np.unique(output):
            rows = np.flatnonzero(output == o)
            if rates is None:
                found = self._taylor(self.of_output[o].derivatives(unit[rows]), node[rows])
            else:
                assert waves is not None
                own = [None if w is None else (w[0][rows], w[1][rows], w[2][rows]) for w in waves]
                slopes = (rates[1][rows], rates[2])
                found = self._quadratic(self.shares[o], unit[rows], slopes, own)
            f[rows], g[rows], H[rows] = found
        return f, g, H

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
        self, shares: Sequence[Polynomial], unit: Array, slopes: tuple[Array, Array], waves: Waves
    ) -> tuple[Array, Array, Array]:
        """As `_taylor`, for degree 2, whose second derivatives are the same everywhere."""
        slope, bent = slopes
        f, g = np.zeros(len(unit)), np.zeros(slope.shape[:2])
        crossed, turned = np.zeros_like(slope), np.zeros_like(slope[:, 0])
        weights, seconds = [], []
        for own, wave in zip(shares, waves, strict=False):
            if wave is None:
                continue
            (share, first, second), (w, dw, ddw) = own.quadratic(unit), wave
            f = f + 2 * (share * w).real.sum(1)
            g = g + 2 * (first * w[:, None] + slope * (share * dw)[:, None]).real.sum(2)
            weights.append(w)
            seconds.append(second)
            turned += share * dw
            crossed += first * dw[:, None] + slope * (share * ddw)[:, None] / 2
        H = 2 * _real_product(crossed, slope.swapaxes(1, 2))
        weight, all_bent = np.hstack([turned, *weights]), np.concatenate([bent, *seconds], -1)
        curved = 2 * _real_product(weight, all_bent.reshape(-1, all_bent.shape[-1]).T)
        return f, g, H + H.swapaxes(1, 2) + curved.reshape(H.shape)

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

        def piece(rows: Array) -> None:
            values[rows] = self._value_at(unit[rows], node[rows], output[rows])

        each(piece, np.array_split(order, -(-len(order) // PIECE) or 1))
        return values

    def _value_at(self, unit: Array, node: Array, output: Array) -> Array:
        values, n = np.zeros(len(unit)), self.count
        for o in np.unique(output):
            rows = np.flatnonzero(output == o)
            parts = self.of_output[o](unit[rows])
            for place, wave in enumerate(self.waves_alone(parts[:, :n], node[rows]), 1):
                if wave is not None:
                    values[rows] += 2 * (parts[:, place * n :][:, :n] * wave).real.sum(1)
        return values

    def waves_alone(self, rate: Array, node: Array) -> list[Array | None]:
        """As `_waves`, without derivatives."""
        started = self.coefficient.coefficients.any()
        free = np.exp(rate * self.time[node][:, None]) if started else None
        return [free, None if self.load is None else self.load.response_alone(rate, node)]


def _real_product(a: Array, b: Array) -> Array:
    """Real part of a @ b for complex arrays."""
    left, right = np.concatenate([a.real, -a.imag], -1), np.concatenate([b.real, b.imag], -2)
    return np.asarray(left @ right)
