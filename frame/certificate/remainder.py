"""Bounds of a modal model's third derivatives: the remainder of quadratic Taylor models."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import permutations

import numpy as np

from alphacut.frame.calculus.jet import Array
from alphacut.frame.calculus.polynomial import Polynomial, derivative
from alphacut.frame.certificate.wave_bounds import parts
from alphacut.frame.modal.model import ModalModel

MOST_PARAMETERS = 6
"""Tensors of third derivatives grow with the cube of the number of parameters."""


def require_certifiable(parameters: int) -> None:
    """Refuse what the branch and bound does not cover.

    Raises:
        ValueError: Too many parameters.
    """
    if parameters > MOST_PARAMETERS:
        raise ValueError(
            f"certify: {parameters} uncertain parameters; branch and bound is affordable up to"
            f" {MOST_PARAMETERS}; make some crisp, or leave the certificate out"
        )


def suprema(polynomial: Polynomial, reach: Array) -> list[Array]:
    """Bounds of |derivative| for |u_i| <= reach_i, orders 0 to 3, shapes (d,) * order + (K,)."""
    d = polynomial.index.shape[1]
    size = np.prod(reach**polynomial.index, axis=1)

    def bound(coefficients: Array) -> Array:
        total: Array = size @ np.abs(coefficients)
        return total

    zero = bound(polynomial.coefficients)
    first = np.stack([bound(polynomial.slope[i]) for i in range(d)])
    second = np.stack([[bound(polynomial.curve[i, j]) for j in range(d)] for i in range(d)])
    third = np.zeros((d, *second.shape))
    for i in range(d):
        for j in range(d):
            for k in range(d):
                third[i, j, k] = bound(derivative(polynomial.index, k, polynomial.curve[i, j]))
    return [zero, first, second, third]


def largest_growth(eigenvalue: Polynomial, reach: Array) -> Array:
    """Bounds of Re λ_k for |u_i| <= reach_i, shape (n,)."""
    size = np.prod(reach**eigenvalue.index, axis=1)
    real = eigenvalue.coefficients.real
    bound: Array = real[0] + size[1:] @ np.abs(real[1:])
    return bound


@dataclass(frozen=True, eq=False)
class Remainder:
    """|∂³ output / ∂u_i ∂u_j ∂u_k| <= tensor[node, output, i, j, k] in the box.

    Args:
        tensor: Shape (T, m, d, d, d), symmetric in the last three.
    """

    tensor: Array

    @classmethod
    def of(cls, model: ModalModel, lower: Array, upper: Array) -> Remainder:
        """Bounds for the box [lower, upper] by Leibniz' rule on C_k w(t; λ_k).

        Raises:
            ValueError: Too many parameters.
        """
        d, n, m = len(lower), model.count, len(model.outputs)
        require_certifiable(d)
        reach = np.maximum(np.abs(lower), np.abs(upper))
        rate, growth = suprema(model.eigenvalue, reach), largest_growth(model.eigenvalue, reach)
        out = np.zeros((len(model.time), m, d, d, d))
        for part in parts(model, growth):
            share = [x.reshape((*x.shape[:-1], n, m)) for x in suprema(part.share, reach)]
            for k in range(n):
                # (4, d, d, d, m)
                bounds = np.stack(
                    _leibniz([x[..., k, :] for x in share], [x[..., k] for x in rate])
                )
                out += np.einsum("rt,rxyzm->tmxyz", 2 * part.waves[..., k], bounds)
        return cls(out)

    def at(self, node: Array, output: Array) -> Array:
        """Tensors of N problems, shape (N, d, d, d)."""
        chosen: Array = self.tensor[node, output]
        return chosen


def _leibniz(c: list[Array], r: list[Array]) -> list[Array]:
    """Bounds of D³(C exp(λ t)) / exp(λ t) by powers of t, each of shape (d, d, d, m)."""
    d, m = r[1].shape[0], c[0].shape[-1]
    out: list[Array] = [np.zeros((d, d, d, m)) for _ in range(4)]
    out[0] += c[3]
    out[1] += c[0] * r[3][..., None]
    out[3] += c[0] * np.einsum("i,j,k->ijk", r[1], r[1], r[1])[..., None]
    # each unordered choice of one index of three appears twice
    for i, j, k in permutations(range(3)):
        axes = (i, j, k)
        single = np.einsum("ijm,k->ijkm", c[2], r[1]) + np.einsum("im,jk->ijkm", c[1], r[2])
        double = np.einsum("im,j,k->ijkm", c[1], r[1], r[1]) + np.einsum(
            "ij,k,m->ijkm", r[2], r[1], c[0]
        )
        out[1] += 0.5 * single.transpose((*axes, 3))
        out[2] += 0.5 * double.transpose((*axes, 3))
    return out
