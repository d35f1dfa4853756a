"""Constants along the fibres, against finite elements, duality and limits."""

from dataclasses import replace

import numpy as np
import pytest

from alphacut.rve import Phase
from alphacut.rve.cell import square_moduli, square_voigt
from alphacut.rve.fibre_constants import fibre_constants
from alphacut.rve.series.model import SeriesModel
from alphacut.rve.series.stiffness import longitudinal_shear
from alphacut.stochastic import HermiteMap

PAPER = HermiteMap(0.1337, 0.1, 0.8663, 0.1692)
PAIRS = [
    (Phase(20e9, 0.2), Phase(80e9, 0.4)),
    (Phase(20e9, 0.4999), Phase(20e6, 0.1)),
    (Phase(20e9, 0.1), Phase(2e12, 0.45)),
]


def stiffness_of(values):
    """Normal stiffness (3, 3) of orthotropic constants, as other programs read them."""
    e1, e2, e3, nu12, nu13, nu23 = list(values.values())[:6]
    give = [
        [1 / e1, -nu12 / e1, -nu13 / e1],
        [-nu12 / e1, 1 / e2, -nu23 / e2],
        [-nu13 / e1, -nu23 / e2, 1 / e3],
    ]
    return np.linalg.inv(give)


def test_equal_poissons_ratios_mix_the_modulus_along_the_fibres_exactly():
    result = SeriesModel().solve(PAPER, Phase(20e9), [Phase(80e9)])[0]
    constants = fibre_constants(result)
    rule = result.curve
    share = rule.weights @ (np.pi / 4 * PAPER(rule.theta) ** 2)
    assert constants.values["E3"] == pytest.approx(20e9 + share * 60e9, rel=1e-10)
    assert constants.errors["E3"] < 1e-9 * constants.values["E3"]


def test_phases_of_one_bulk_modulus_leave_what_the_bounds_leave():
    """The plane then tells nothing of C33; the declared error is the width of the bounds."""
    matrix = Phase(20e9, 0.2)
    poisson = 0.35
    bulk = (matrix.stiffness[0, 0] + matrix.stiffness[0, 1]) / 2
    inclusion = Phase(2 * bulk * (1 + poisson) * (1 - 2 * poisson), poisson)
    result = SeriesModel().solve(PAPER, matrix, [inclusion])[0]
    near = SeriesModel().solve(PAPER, matrix, [Phase(inclusion.modulus * 1.001, poisson)])[0]
    vague, clear = fibre_constants(result), fibre_constants(near)
    assert vague.values["E3"] != clear.values["E3"]
    for name, error in vague.errors.items():
        assert abs(vague.values[name] - clear.values[name]) <= error + 2e-3 * vague.values[name]
    assert 0 < vague.errors["E3"] < 1e-3 * vague.values["E3"]


def test_longitudinal_shear_is_dual_and_dilute():
    """Keller: moduli of a contrast and of its inverse multiply to the matrix' squared."""
    radius = np.array([0.2, 0.5, 0.9, 0.99])
    matrix = Phase(20e9)
    stiff, error = longitudinal_shear(radius, matrix, Phase(80e9))
    soft, _ = longitudinal_shear(radius, matrix, Phase(5e9))
    assert stiff * soft == pytest.approx(np.full(4, matrix.stiffness[2, 2] ** 2), rel=1e-10)
    assert (error < 1e-9).all()
    share = np.pi / 4 * 0.01**2
    thin, _ = longitudinal_shear(np.array([0.01]), matrix, Phase(80e9))
    assert thin[0] / matrix.stiffness[2, 2] == pytest.approx(1 + 2 * share * 3 / 5, rel=1e-7)


def test_without_a_plane_stiffness_there_are_no_constants():
    from dataclasses import replace

    result = SeriesModel().solve(PAPER, Phase(20e9), [Phase(80e9)])[0]
    with pytest.raises(ValueError, match="solve the third load"):
        fibre_constants(replace(result, cell=None))


@pytest.mark.parametrize("part", [0, 1, 2])
@pytest.mark.parametrize(("matrix", "inclusion"), PAIRS)
def test_an_error_of_the_plane_is_declared_for_all_that_follows(matrix, inclusion, part):
    """One modulus of the plane off by what is declared of it: no more and no less is declared."""
    exact = SeriesModel().solve(PAPER, matrix, [inclusion])[0]
    error = np.where(np.arange(3) == part, 1e-6, 0.0)
    moduli = square_moduli(np.asarray(exact.curve.stiffness)) * (1 + error)
    curve = replace(exact.curve, stiffness=square_voigt(*moduli.T))
    off = fibre_constants(replace(exact, curve=curve, errors={"space": error}))
    for name, value in fibre_constants(exact).values.items():
        true = abs(off.values[name] - value)
        assert true <= off.errors[name] * (1 + 1e-6)
        if true > 1e-8 * value:
            assert off.errors[name] <= 1.8 * true
