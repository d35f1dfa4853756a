"""Two exports are enough for a matrix that the caller knows to be affine."""

import numpy as np
import pytest

from alphacut.frame import affine_terms
from tests.refused import refuses


def exports_of(rng, values):
    """Exports of K_0 + E K_1 at values of E, with the exact terms."""
    halves = rng.normal(size=(2, 3, 3))
    constant, slope = (half @ half.T for half in halves)
    return [({"E": value}, constant + value * slope) for value in values], constant, slope


def test_two_exports_give_the_line_through_both(rng):
    exports, constant, slope = exports_of(rng, (30.0, 60.0))
    terms = dict(affine_terms(exports, is_affine=True))
    assert terms["E"] == pytest.approx(slope, rel=1e-9, abs=1e-9)
    assert terms[1.0] == pytest.approx(constant, rel=1e-8, abs=1e-8)
    with refuses("exports"):
        affine_terms(exports)
    with refuses("exports"):
        affine_terms(exports[:1], is_affine=True)


def test_a_further_export_is_compared_all_the_same(rng):
    exports, _, _ = exports_of(rng, (30.0, 60.0, 40.0))
    bent = [*exports[:2], ({"E": 40.0}, exports[2][1] + 0.1 * np.eye(3))]
    assert len(affine_terms(exports, is_affine=True)) == 2
    with refuses("export 3"):
        affine_terms(bent, is_affine=True)


def test_each_parameter_needs_an_export_that_moves_it_alone(rng):
    arrays = [np.diag(rng.uniform(1, 2, 3)) for _ in range(2)]
    exports = [({"E": 30.0, "k": 2.0}, arrays[0]), ({"E": 60.0, "k": 3.0}, arrays[0] + arrays[1])]
    with refuses("E"):
        affine_terms(exports, is_affine=True)
