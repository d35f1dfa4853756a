"""Leibniz' rule of the third derivatives, term by term."""

import numpy as np

from alphacut.frame.certificate.remainder import _leibniz

RNG = np.random.default_rng(5)


def test_curved_shares_times_slopes_of_the_rate_enter_once_for_each_index():
    half = RNG.random((3, 3, 2))
    share, rate = half + half.swapaxes(0, 1), RNG.random(3)
    zero = [np.zeros((3,) * order + (2,)) for order in range(4)]
    flat = [np.zeros((3,) * order) for order in range(4)]
    found = _leibniz([zero[0], zero[1], share, zero[3]], [flat[0], rate, flat[2], flat[3]])
    exact = np.einsum("ijm,k->ijkm", share, rate)
    exact = exact + exact.transpose(0, 2, 1, 3) + exact.transpose(2, 0, 1, 3)
    np.testing.assert_allclose(found[1], exact, rtol=1e-12)
    assert not found[0].any()
    assert not found[2].any()
    assert not found[3].any()
