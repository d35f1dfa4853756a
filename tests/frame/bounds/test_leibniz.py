"""Leibniz' rule of the third derivatives, term by term."""

from itertools import product

import numpy as np
import pytest
import sympy

from alphacut.frame.bounds.model_error import leibniz


@pytest.mark.parametrize("order", range(4))
def test_all_derivatives_of_a_product_of_exponentials(order, rng):
    """Of C exp(λ t) over exp(λ t) at u = 0, with C = exp(a·u) and λ = exp(b·u)."""
    (a, b), t, u = rng.random((2, 2)), 0.7, sympy.symbols("u:2")
    outer, inner = (
        [np.ones(()), x, np.einsum("i,j->ij", x, x), np.einsum("i,j,k->ijk", x, x, x)]
        for x in (a, b)
    )
    found = leibniz([x[..., None] for x in outer], inner, order)
    total = sum(t**power * part for power, part in enumerate(found))[..., 0]
    motion = sympy.exp(a @ u + t * sympy.exp(b @ u) - t)
    for axes in product(range(2), repeat=order):
        exact = sympy.diff(motion, *(u[axis] for axis in axes)) if axes else motion
        assert total[axes] == pytest.approx(float(exact.subs(dict.fromkeys(u, 0))), rel=1e-12)
