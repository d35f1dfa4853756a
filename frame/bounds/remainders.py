"""Bounds of what quadratic Taylor models of a modal model's outputs leave out.

A part of a modal model is 2 Re Σ_k C_k(p) w(t; λ_k(p)) with the wave w = exp(λ t) or w = R =
∫ exp(λ (t − s)) a(s) ds. The r-th derivative of w by λ is bounded by t^r exp(g t), or by
∫ τ^r exp(g τ) |a(t − τ)| dτ, where g is a bound of Re λ. From these follow bounds of what quadratic
Taylor models of the part leave out.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from alphacut.base.arrays import Array
from alphacut.frame.calculus.monomials import count, exponents, product_part, product_places
from alphacut.frame.calculus.taylor_model import TaylorModel
from alphacut.frame.modes.modal_model import ModalModel
from alphacut.frame.modes.model_error import largest_growth, response_parts


class Remainder(NamedTuple):
    """Bounds of what is left out of the outputs over the whole box, for T time nodes."""

    third: Array  # third derivatives by the inputs, (T, m, d, d, d)
    tables: Array  # what tables of loads miss of the values, (T, m)


def majorant_parts(polynomials: TaylorModel, reach: Array) -> list[Array]:
    """Return bounds of polynomials' derivatives over a box, as the coefficients of a majorant.

    The majorant is Σ |coefficient| (reach + v)^exponents. At v = 0 its derivatives bound the
    magnitudes of those of the polynomials at all points with |u_i| ≤ reach_i.

    Args:
        polynomials: Polynomials of d inputs u, an array of shape V, real or complex.
        reach: Half-widths, shape (d,), ≥ 0; they may exceed 1.

    Returns:
        The coefficients of degree 0, 1, 2 and 3 in v, shape (monomials, *V) each; a coefficient is
        the derivative divided by the factorials of its exponents.
    """
    magnitudes = replace(polynomials, parts=tuple(np.abs(part) for part in polynomials.parts))
    parts = magnitudes.shifted_parts(reach)
    missing = range(len(parts), 4)
    return parts[:4] + [magnitudes.homogeneous_part(degree) for degree in missing]


def remainder_bounds(model: ModalModel, lower: Array, upper: Array) -> Remainder:
    """Bound what quadratic Taylor models of a modal model's outputs leave out in a box.

    They may be expanded about any point of the box [lower, upper]. The bounds follow by majorants:
    derivatives by the inputs of C exp(λ t) over exp(λ₀ t) are at most those of Σ_p t^p C ρ^p / p!
    with majorants of C and of ρ = λ − λ₀, that is, with polynomials whose coefficients are positive
    and whose derivatives are at least as large.

    The model is that of the tables of loads, whose series are functions of λ with derivatives of
    their own. By what they miss its values differ from those of the modes.

    Args:
        model: The modal model with T time nodes, m outputs and d inputs.
        lower: Lower ends of the box in unit coordinates, shape (d,).
        upper: Upper ends, shape (d,).

    Returns:
        `third`, bounds of the third derivatives by u_i, u_j, u_k, shape (T, m, d, d, d), symmetric
        in the last three axes; and `tables`, what the tables of loads miss, shape (T, m).
    """
    d = len(lower)
    n = model.count
    m = len(model.flow.outputs)
    time = model.flow.time
    reach = np.maximum(np.abs(lower), np.abs(upper))
    growth = largest_growth(model.eigenvalue, reach)
    eigenvalue = majorant_parts(model.eigenvalue, reach)  # by degree, (monomials, n)
    rho = [part[..., np.newaxis] for part in eigenvalue]
    cubic = np.zeros((len(time), count(d, 3), m))
    of_tables = np.zeros((len(time), m))
    for part in response_parts(model, growth):
        waves = part.waves
        term = majorant_parts(part.coefficient, reach)  # of C ρ^p / p!, (monomials, n, m)
        if part.load is not None:
            missed = part.load.errors(waves)
            of_tables += 2 * missed[0] @ term[0][0]
            waves = waves + missed
        for p in range(4):
            cubic += np.tensordot(2 * waves[p], term[3], (1, 1))
            term = [
                product_part(term, rho, k, d, np.multiply, lowest=(0, 1)) / (p + 1)
                for k in range(4)
            ]
        if part.load is None:
            # The free response comes first. At t = 0 the sum over its modes is an initial
            # state, of which most cancels, and is bounded as one polynomial.
            at_start = np.full(n, 2.0) @ part.coefficient.real
            cubic[time == 0] = majorant_parts(at_start, reach)[3]

    # The third derivative of u^e at 0 is e!, and all other derivatives are zero there.
    factorials = np.array([1, 1, 2, 6])
    of_exponents = factorials[exponents(d, 3)].prod(axis=1)
    third = (cubic * of_exponents[:, np.newaxis]).swapaxes(1, 2)
    places = product_places(d, 1, 2)[:, product_places(d, 1, 1)]  # of u_i u_j u_k, (d, d, d)
    return Remainder(np.ascontiguousarray(third[..., places]), of_tables)
