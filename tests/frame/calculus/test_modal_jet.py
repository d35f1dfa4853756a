"""What modes give with derivatives: compiled code, NumPy and differences agree."""

import numpy as np
import pytest

from alphacut.frame.calculus import modal_jet
from alphacut.frame.calculus.modal_jet import composed
from alphacut.frame.calculus.polynomial import Polynomial, exponents
from tests.frame.compiler import compiled


def drawn(seed, d, n, degree, count=20):
    """Polynomials of n rates and shares at points: a function of them, all in one."""
    rng = np.random.default_rng(seed)
    index = exponents(d, degree)
    shape = (len(index), 3 * n)
    both = Polynomial(index, rng.normal(size=shape) + 1j * rng.normal(size=shape))
    return both, rng.uniform(-0.5, 0.5, (count, d))


def jet(both, unit, n, place=2):
    """Σ_k 2 Re C_k sin λ_k with gradient and Hessian."""
    parts = both.derivatives(unit)
    rate, (count, d) = parts[0][:, :n], parts[1].shape[:2]
    out = np.zeros(count), np.zeros((count, d)), np.zeros((count, d, d))
    composed(parts, place, (np.sin(rate), np.cos(rate), -np.sin(rate)), out)
    return out


@compiled
@pytest.mark.parametrize(("d", "n", "degree"), [(1, 1, 1), (2, 3, 4), (6, 2, 3), (3, 1, 2)])
def test_compiled_derivatives_are_those_of_numpy(d, n, degree, monkeypatch):
    both, unit = drawn(31 * d + n, d, n, degree)
    monkeypatch.setattr(modal_jet, "_by_numpy", lambda *_: pytest.fail("no compiler"))
    fast = jet(both, unit, n)
    monkeypatch.undo()
    monkeypatch.setattr(modal_jet, "_compiled", lambda *_: False)
    for one, other in zip(fast, jet(both, unit, n), strict=True):
        assert np.abs(one - other).max() < 1e-12 * (1 + np.abs(other).max())


def test_derivatives_are_those_of_differences():
    both, unit = drawn(8, 3, 2, 3)
    value, first, second = jet(both, unit, 2)
    for i, step in enumerate(1e-5 * np.eye(3)):
        ahead, behind = jet(both, unit + step, 2), jet(both, unit - step, 2)
        assert first[:, i] == pytest.approx((ahead[0] - behind[0]) / 2e-5, rel=1e-6, abs=1e-6)
        assert second[:, i] == pytest.approx((ahead[1] - behind[1]) / 2e-5, rel=1e-6, abs=1e-5)
    assert (second == second.swapaxes(1, 2)).all()
    assert np.abs(value).max() > 0
