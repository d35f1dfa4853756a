"""Response of single modes to the motion of the ground, as a Taylor series in the eigenvalue."""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil

import numpy as np

from frame.jet import Array
from frame.linear import Accelerogram
from frame.modes import ModalError
from frame.polynomial import Polynomial

REACH = 12.0
"""Largest change of phase (rad) over the box that the series covers."""


@dataclass(frozen=True, eq=False)
class LoadTable:
    """R_k(t_j; λ) = ∫ exp(λ (t_j − s)) a(s) ds near the middle λ_k of the box, as Σ_i moment[j, k, i] ((λ − λ_k) / scale)^i.

    Args:
        middle: λ_k in the middle of the box, shape (n,).
        scale: Length that makes the coefficients of order one, in 1/s.
        moment: Coefficients, shape (T, n, order).
        share: What one unit of R_k puts into the outputs, n m polynomials.
    """

    middle: Array
    scale: float
    moment: Array
    share: Polynomial

    @classmethod
    def build(cls, ground: Accelerogram, time: Array, rate: Polynomial, share: Polynomial) -> LoadTable:
        """The table for modes whose eigenvalues are `rate` over the unit box.

        Raises:
            ModalError: The phase changes too much over the box.
        """
        middle = rate.coefficients[0]
        reach = float((np.abs(rate.coefficients[1:]).sum(0) * time[-1]).max())
        if reach > REACH:
            raise ModalError(f"modal: phases change by {reach:.1f} rad over the box, more than {REACH:g} under a load; use graph-follower")
        order = max(6, ceil(2.72 * reach + 18))
        return cls(middle, 1 / time[-1], _moments(ground.at(time), middle, time, order), share)

    def values(self, unit: Array, rate: Array) -> Array:
        """Response of the outputs at points (S, d) with eigenvalues (S, n), shape (S, T, m)."""
        powers = self._powers(rate, 0)
        share = self.share(unit).reshape(*rate.shape, -1)
        weights = share[..., None] * powers[:, :, None, :]  # (S, n, m, order)
        flat = weights.transpose(0, 2, 1, 3).reshape(-1, powers.shape[1] * powers.shape[2])
        table = self.moment.reshape(len(self.moment), -1).T
        out = 2 * (flat.real @ table.real - flat.imag @ table.imag)
        values: Array = out.reshape(len(unit), -1, len(self.moment)).swapaxes(1, 2)
        return values

    def response(self, rate: Array, node: Array) -> tuple[Array, Array, Array]:
        """R, dR/dλ and d²R/dλ² at one node per point, each shape (N, n), for eigenvalues (N, n)."""
        moment = self.moment[node]
        r0, r1, r2 = ((moment * self._powers(rate, order)).sum(-1) for order in range(3))
        return r0, r1, r2

    def _powers(self, rate: Array, derivative: int) -> Array:
        """Powers of the scaled deviation, differentiated by λ, shape (S, n, order)."""
        x = (rate - self.middle) / self.scale
        order = self.moment.shape[-1]
        plain = np.ones((*x.shape, order), complex)
        plain[..., 1:] = np.cumprod(np.broadcast_to(x[..., None], (*x.shape, order - 1)), axis=-1)
        for _ in range(derivative):
            factor = np.arange(order) / self.scale
            plain = np.concatenate([np.zeros((*x.shape, 1)), plain[..., :-1]], -1) * factor
        return plain


def _moments(acceleration: Array, middle: Array, time: Array, order: int) -> Array:
    """Taylor coefficients of R_k by scaled λ at all nodes, shape (T, n, order), for a load linear between nodes.

    Per step: ∫ of exp((λ + x/T) τ) over the step as a truncated series in x, by Gauss quadrature to round-off; from node to node
    the series is multiplied by that of exp((λ + x/T) h).
    """
    h, total = time[1] - time[0], time[-1]
    points, weights = np.polynomial.legendre.leggauss(8 + ceil(abs(middle).max() * h))
    tau = h * (1 - points) / 2  # time from the quadrature point to the end of the step
    factorial = np.cumprod(np.concatenate([[1.0], np.arange(1, order)]))
    series = (tau[:, None] / total) ** np.arange(order) / factorial  # (Q, order)
    kernel = np.exp(middle[:, None] * tau) * weights * (h / 2)  # (n, Q)
    late = (points + 1) / 2
    old, new = (np.einsum("kq,qi->ki", kernel * share, series) for share in (1 - late, late))
    advance = np.exp(middle * h)[:, None] * (h / total) ** np.arange(order) / factorial  # (n, order)
    window = np.zeros((len(middle), order, order), complex)  # truncated product with `advance` as a matrix
    for i in range(order):
        window[:, i, i:] = advance[:, : order - i]
    out = np.zeros((len(time), len(middle), order), complex)
    for j in range(1, len(time)):
        out[j] = (out[j - 1][:, None] @ window)[:, 0] + old * acceleration[j - 1] + new * acceleration[j]
    return out
