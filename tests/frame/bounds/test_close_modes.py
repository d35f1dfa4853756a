"""Bounds of combined peaks of close modes, at the worst that their premises allow."""

import numpy as np
import pytest

from alphacut.frame.bounds.close_modes import Moments, by_fit, by_signs
from alphacut.frame.calculus.taylor_model import TaylorModel
from alphacut.frame.spectra.modal_combination import QuadraticFit


def model(*values):
    return TaylorModel.constant(np.array(values), 1)


@pytest.mark.parametrize("modes", [2, 3, 5])
def test_the_square_lies_within_bounds_for_the_worst_correlations(modes, rng):
    closest = [np.inf, np.inf]
    for _ in range(200):
        # Magnitudes are nearly equal, where the bounds are narrowest.
        r = rng.choice([-1.0, 1.0], modes) * rng.uniform(0.95, 1.0, modes)
        products = np.outer(r, r) * (1 - np.eye(modes))
        total, w = r.sum(), np.abs(r).sum()
        largest = rng.uniform(0.1, 1.0)
        for worst in (-1.0, 1.0):
            # d is as large as it may be where it moves the square that way, and else 0.
            d = largest * (worst * products > 0)
            square = total**2 - np.sum(d * products)
            signs = by_signs(model(total), model(w**2), modes=modes, d=largest)
            assert signs.lower.value[0] <= square * (1 + 1e-12) + 1e-12
            assert square <= signs.upper.value[0] * (1 + 1e-12) + 1e-12
            closest[0] = min(closest[0], *np.abs([x.value[0] - square for x in signs]))

            y = rng.uniform(-0.1, 0.1, modes)
            fit = QuadraticFit(rng.uniform(1.0, 20.0), rng.uniform(0.01, 0.2))
            d = fit.factor * (y - y[:, np.newaxis]) ** 2 + fit.error * np.sign(worst * products)
            square = total**2 - np.sum(d * products)
            moments = Moments(model(y @ r), model(y**2 @ r))
            fitted = by_fit(model(total), moments, model(w**2), modes=modes, fit=fit)
            low, high = fitted.lower.bounds()[0][0], fitted.upper.bounds()[1][0]
            assert low <= square <= high
            closest[1] = min(closest[1], square - low, high - square)
    assert max(closest) < 0.02
