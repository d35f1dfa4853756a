"""Leibniz' rule of the third derivatives, term by term."""

from itertools import product
from math import exp

import numpy as np
import pytest

from alphacut.frame.bounds.model_error import leibniz

RNG = np.random.default_rng(5)


def test_curved_shares_times_slopes_of_the_rate_enter_once_for_each_index():
    half = RNG.random((3, 3, 2))
    share, rate = half + half.swapaxes(0, 1), RNG.random(3)
    zero = [np.zeros((3,) * order + (2,)) for order in range(4)]
    flat = [np.zeros((3,) * order) for order in range(4)]
    found = leibniz([zero[0], zero[1], share, zero[3]], [flat[0], rate, flat[2], flat[3]], 3)
    exact = np.einsum("ijm,k->ijkm", share, rate)
    exact = exact + exact.transpose(0, 2, 1, 3) + exact.transpose(2, 0, 1, 3)
    np.testing.assert_allclose(found[1], exact, rtol=1e-12)
    assert not found[0].any()
    assert not found[2].any()
    assert not found[3].any()


@pytest.mark.parametrize("order", [0, 1, 2, 3])
def test_all_derivatives_of_a_product_of_exponentials(order: int) -> None:
    """C = exp(a·u), λ = exp(b·u) at u = 0: the derivatives of C exp(λ t) are known."""
    a, b, t = RNG.random(2), RNG.random(2), 0.7
    outer = [np.ones(()), a, np.einsum("i,j->ij", a, a), np.einsum("i,j,k->ijk", a, a, a)]
    inner = [np.ones(()), b, np.einsum("i,j->ij", b, b), np.einsum("i,j,k->ijk", b, b, b)]
    found = leibniz([x[..., None] for x in outer], inner, order)
    total = sum(t**power * part for power, part in enumerate(found))[..., 0]
    h = 1e-3 if order == 3 else 1e-4
    for axes in np.ndindex((2,) * order):

        def along(*steps: float, axes: tuple[int, ...] = axes) -> float:
            u = sum((s * np.eye(2)[k] for s, k in zip(steps, axes, strict=True)), np.zeros(2))
            return exp(a @ u) * exp(exp(b @ u) * t) / exp(t)

        signs = product((-h, h), repeat=order)
        slope = sum(np.prod(np.sign(s)) * along(*s) for s in signs) / (2 * h) ** order
        assert total[axes] == pytest.approx(slope, rel=1e-4)
