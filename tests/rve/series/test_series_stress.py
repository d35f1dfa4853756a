import numpy as np
import pytest

from alphacut.rve import Phase
from alphacut.rve.series.stiffness import square_stiffness
from alphacut.rve.series.stress import SeriesField

MATRIX = Phase(20e9)
CELLS = [(0.5, Phase(80e9)), (0.8, Phase(200e9, 0.1)), (0.9, Phase(0.2e9, 0.4)), (0.3, MATRIX)]


def exact_stiffness(radius, inclusion):
    return square_stiffness(np.array([radius]), MATRIX, [inclusion]).matrix[0, 0]


@pytest.mark.parametrize(("radius", "inclusion"), CELLS)
@pytest.mark.parametrize("strain", np.eye(3))
def test_mean_stress_is_the_stiffness_times_the_strain(radius, inclusion, strain):
    """Two independent ways to the mean: the field over the cell, and the potentials' jumps across
    it.
    """
    stiffness = exact_stiffness(radius, inclusion)
    np.testing.assert_allclose(
        SeriesField(radius, MATRIX, inclusion).spread(strain).mean,
        stiffness @ strain,
        atol=1e-9 * stiffness.max(),
    )


@pytest.mark.parametrize(("radius", "inclusion"), CELLS)
def test_tractions_are_continuous_and_the_field_is_periodic(radius, inclusion):
    field, angle, strain = (
        SeriesField(radius, MATRIX, inclusion),
        np.linspace(0, 6, 40),
        np.array([0.3, -0.2, 0.5]),
    )
    outer, inner = field.interface(angle, strain), field.interface(angle, strain, outside=False)
    np.testing.assert_allclose(outer, inner, atol=1e-9 * np.abs(outer).max())
    side = np.linspace(-0.9, 0.9, 9)
    for axis in (0, 1):
        low, high = (np.insert(side[:, None], axis, value, axis=1) for value in (-1.0, 1.0))
        np.testing.assert_allclose(
            field.stress(low, strain), field.stress(high, strain), rtol=1e-9, atol=1e-3
        )


def test_homogeneous_cell_has_no_spread():
    spread = SeriesField(0.6, MATRIX, MATRIX).spread(np.array([0.01, 0.02, 0.03]))
    uniform = MATRIX.stiffness @ [0.01, 0.02, 0.03]
    for values in (spread.mean, spread.least, spread.greatest):
        np.testing.assert_allclose(values, uniform, rtol=1e-10)
    assert spread.deviation.max() < 1e-9 * uniform.max()


def test_hole_in_a_wide_plate_doubles_hydrostatic_stress():
    """Lamé: at a small traction-free hole the hoop stress is twice the far stress."""
    field = SeriesField(0.01, MATRIX, Phase(1.0))
    far = MATRIX.stiffness @ [1.0, 1.0, 0.0]
    assert field.stress(np.array([[0.0100001, 0.0]]), np.array([1.0, 1.0, 0.0]))[
        0, 1
    ] == pytest.approx(2 * far[0], rel=1e-3)
