import numpy as np
import pytest

from alphacut.rve import Phase
from alphacut.rve.series.field import SeriesField
from alphacut.rve.series.stiffness import square_stiffness

MATRIX = Phase(20e9)
CELLS = [(0.5, Phase(80e9)), (0.8, Phase(200e9, 0.1)), (0.9, Phase(0.2e9, 0.4)), (0.3, MATRIX)]


def cell_rule(radius, points=24):
    """Gauss points of the cell and weights of sum 1: rays in eight sectors, cut at the interface."""
    x, w = np.polynomial.legendre.leggauss(points)
    angle = ((np.arange(8)[:, None] + (1 + x) / 2) * np.pi / 4).ravel()
    side = 1 / np.maximum(np.abs(np.cos(angle)), np.abs(np.sin(angle)))
    places, weights, inside = [], [], []
    for k, (start, stop) in enumerate(((0 * side, 0 * side + radius), (0 * side + radius, side))):
        half = (stop - start) / 2
        ray = start[:, None] + half[:, None] * (1 + x)
        places.append(np.stack([ray.T * np.cos(angle), ray.T * np.sin(angle)], -1).reshape(-1, 2))
        share = np.tile(w, 8)[:, None] * np.pi / 8 * half[:, None] * w * ray / 4
        weights.append(share.T.ravel())
        inside.append(np.full(share.size, k == 0))
    return tuple(np.concatenate(parts) for parts in (places, weights, inside))


@pytest.mark.parametrize(("radius", "inclusion"), CELLS)
@pytest.mark.parametrize("strain", np.eye(3))
def test_mean_stress_is_the_stiffness_times_the_strain(radius, inclusion, strain):
    """The field over the cell, and the potentials' jumps across it."""
    stiffness = square_stiffness(np.array([radius]), MATRIX, [inclusion]).matrix[0, 0]
    places, weights, inside = cell_rule(radius)
    stress = SeriesField(radius, MATRIX, inclusion).stress(places, strain, inside=inside)
    np.testing.assert_allclose(weights @ stress, stiffness @ strain, atol=1e-9 * stiffness.max())


@pytest.mark.parametrize(("radius", "inclusion"), CELLS)
def test_displacement_is_continuous_and_its_jump_is_the_strain(radius, inclusion):
    field, strain = SeriesField(radius, MATRIX, inclusion), np.array([0.3, -0.2, 0.5])
    angle = np.linspace(0, 6, 40)
    rim = radius * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    outer, inner = (
        field.displacement(rim, strain, inside=np.full(40, inside)) for inside in (False, True)
    )
    np.testing.assert_allclose(outer, inner, atol=1e-9)
    tensor, none = np.array([[0.3, 0.25], [0.25, -0.2]]), np.zeros(9, bool)
    for axis in (0, 1):
        low, high = (
            np.insert(np.linspace(-0.9, 0.9, 9)[:, None], axis, value, axis=1)
            for value in (-1.0, 1.0)
        )
        jump = field.displacement(high, strain, inside=none) - field.displacement(
            low, strain, inside=none
        )
        np.testing.assert_allclose(jump, np.tile(2 * tensor[axis], (9, 1)), atol=1e-9)


def test_hole_in_a_wide_plate_doubles_hydrostatic_stress():
    """Lamé: at a small traction-free hole the hoop stress is twice the far stress."""
    field, far = SeriesField(0.01, MATRIX, Phase(1.0)), MATRIX.stiffness @ [1.0, 1.0, 0.0]
    at = field.stress(
        np.array([[0.0100001, 0.0]]), np.array([1.0, 1.0, 0.0]), inside=np.zeros(1, bool)
    )
    assert at[0, 1] == pytest.approx(2 * far[0], rel=1e-3)
