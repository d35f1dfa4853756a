"""Taylor models of modes are off by their rests, where these are rounding alone, against mpmath."""

import mpmath as mp
import numpy as np
import pytest

from alphacut.frame.bounds.box import Box
from alphacut.frame.calculus.taylor_model import TaylorModel
from alphacut.frame.modes.clusters import _diagonal
from tests.frame.calculus.test_taylor_model import exact_value
from tests.frame.modes.test_attained import IDLE, RECORD, drawn


def exact_modes(springs, masses, ratio):
    """ω and the shares of q3 under the ground of a shear frame by 40 digits."""
    n = len(springs)
    matrix = mp.zeros(n)
    for i in range(n):
        matrix[i, i] = (springs[i] + (springs[i + 1] if i + 1 < n else 0)) / masses[i]
        if i:
            matrix[i, i - 1] = -springs[i] / mp.sqrt(masses[i] * masses[i - 1])
            matrix[i - 1, i] = matrix[i, i - 1]
    squared, vectors = mp.eigsy(matrix)
    omega = [mp.sqrt(x * (1 - mp.mpf(ratio) ** 2)) for x in squared]
    read = [vectors[n - 1, e] / mp.sqrt(masses[n - 1]) for e in range(n)]
    driven = [mp.fsum(vectors[i, e] * mp.sqrt(masses[i]) for i in range(n)) for e in range(n)]
    return omega, [r * d for r, d in zip(read, driven, strict=True)]


@pytest.mark.parametrize("stiff", [1.0, 1e4])
def test_modes_over_a_narrow_box_are_off_by_their_rounding_at_most(stiff):
    """In 1e-9 of each input, what the series leave out is far below rounding."""
    frame, box, rng = drawn(1, stiff, RECORD)
    radius = 1e-9 * box.centre
    narrow = Box(frame, box.names, box.time, box.centre - radius, box.centre + radius)
    single = narrow.level().oscillators
    assert len(single) == 3
    ends = [
        (mp.mpf(float(a)), mp.mpf(float(b))) for a, b in zip(narrow.low, narrow.high, strict=True)
    ]
    shares = {"omega": [], "share": []}
    with mp.workdps(40):
        for u in rng.uniform(-1, 1, (12, 6)):
            unit = [mp.mpf(float(x)) for x in u]
            p = [(a + b) / 2 + (b - a) / 2 * x for (a, b), x in zip(ends, unit, strict=True)]
            omega, share = exact_modes(p[:3], p[3:], frame.damping_ratio)
            for mode, w, c in zip(single, omega, share, strict=True):
                for name, model, true in (("omega", mode.omega, w), ("share", mode.share[0, 0], c)):
                    off = abs(exact_value(model, unit) - true)
                    shares[name].append(float(off) / float(model.remainder))
    for values in shares.values():
        assert IDLE <= np.max(values) <= 1


def test_what_is_put_onto_a_diagonal_is_put_into_the_rest():
    matrix = TaylorModel.constant([[2.0, 1e-9], [-1e-9, 3.0]], 1)
    found = _diagonal(matrix, np.array([2.0, 3.5]))
    assert (np.abs(found.value - matrix.value) <= found.remainder).all()
    assert found.remainder == pytest.approx(np.array([[0, 1e-9], [1e-9, 0.5]]))
