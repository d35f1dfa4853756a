from dataclasses import replace

import numpy as np
import pytest

from alphacut.rve import Phase
from alphacut.rve.anisotropy import (
    averaged,
    directional_shear,
    directional_young,
    plane_average,
    rotated,
    shear_ratio,
)
from alphacut.rve.cell import square_moduli
from alphacut.rve.series.model import SeriesModel
from alphacut.rve.series.stiffness import square_stiffness
from alphacut.stochastic import HermiteMap
from benchmarks.rve import sweep as cell_sweep

MATRIX = Phase(20e9)
CELL = square_stiffness(np.array([0.87]), MATRIX, [Phase(80e9, 0.2)]).matrix[0, 0]


def test_isotropic_plane_is_the_same_in_every_direction():
    angles = np.linspace(0, np.pi, 7)
    np.testing.assert_allclose(
        rotated(MATRIX.stiffness, angles),
        np.broadcast_to(MATRIX.stiffness, (7, 3, 3)),
        rtol=1e-13,
        atol=1e-3,
    )
    np.testing.assert_allclose(
        directional_young(MATRIX.stiffness, angles), 20e9 / (1 - 0.3**2), rtol=1e-13
    )
    np.testing.assert_allclose(directional_shear(MATRIX.stiffness, angles), 20e9 / 2.6, rtol=1e-13)
    assert shear_ratio(MATRIX.stiffness) == pytest.approx(1)


def test_energy_does_not_depend_on_the_axes():
    strain, angle = np.array([0.3, -0.2, 0.5]), 0.7
    tensor = np.array([[strain[0], strain[2] / 2], [strain[2] / 2, strain[1]]])
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    seen = turn @ tensor @ turn.T
    seen = np.array([seen[0, 0], seen[1, 1], 2 * seen[0, 1]])
    assert seen @ rotated(CELL, angle) @ seen == pytest.approx(strain @ CELL @ strain, rel=1e-13)


def test_square_array_repeats_every_quarter_turn_and_is_extreme_at_the_diagonal():
    angles = np.linspace(0, np.pi / 2, 46)
    young = directional_young(CELL, angles)
    np.testing.assert_allclose(young, young[::-1], rtol=1e-12)
    assert {int(young.argmax()), int(young.argmin())} <= {0, 45, 22, 23}
    assert directional_shear(CELL, np.pi / 4) / directional_shear(CELL, 0.0) == pytest.approx(
        shear_ratio(CELL), rel=1e-12
    )


def test_diagonal_shear_exceeds_axial_shear_as_the_method_says():
    """4 % at r = 0.5 and 19 % at 0.87 for the paper's phases."""
    cells = square_stiffness(np.array([0.5, 0.87]), MATRIX, [Phase(80e9)]).matrix[:, 0]
    assert [round(100 * (shear_ratio(cell) - 1)) for cell in cells] == [4, 19]


def test_isotropic_average_lies_between_those_of_equal_strain_and_stress():
    """Shear over all directions by quadrature: of strains from above, of stresses from below."""
    angles = np.linspace(0, np.pi, 360, endpoint=False)
    turned = rotated(CELL, angles)
    equal_strain = turned[:, 2, 2].mean()
    equal_stress = 1 / np.linalg.inv(turned)[:, 2, 2].mean()
    whole = CELL[0, 0] + CELL[0, 1]
    young, poisson = plane_average(square_moduli(CELL))
    assert whole == pytest.approx(young / (1 + poisson) / (1 - 2 * poisson), rel=1e-12)
    assert young / 2 / (1 + poisson) == pytest.approx((equal_strain + equal_stress) / 2, rel=1e-12)
    assert plane_average(square_moduli(MATRIX.stiffness)) == pytest.approx((20e9, 0.3), rel=1e-12)


def test_averaged_cell_has_its_own_e_errors_and_words():
    radius, phase = HermiteMap(0.3, 0.1, 0.9, 0.2), Phase(80e9, 0.2)
    result = SeriesModel(accuracy=1e-6).solve(radius, MATRIX, [phase])[0]
    fine = averaged(SeriesModel().solve(radius, MATRIX, [phase])[0])
    mean = averaged(result)
    assert mean.modulus == plane_average(square_moduli(result.stiffness))[0] > 1.03 * result.modulus
    assert mean.poisson < result.poisson
    assert abs(mean.modulus / fine.modulus - 1) <= mean.estimated_error <= 1e-5
    assert abs(mean.poisson - fine.poisson) <= mean.poisson_error <= 1e-5
    assert sum(mean.error.values()) == pytest.approx(mean.estimated_error)
    assert mean.convention in mean._repr_html_()
    assert "eq. 16" not in mean._repr_html_()
    bare = replace(result, curve=replace(result.curve, stiffness=None))
    with pytest.raises(ValueError, match="method series made no whole plane stiffness"):
        averaged(bare)


def test_sweep_of_area_fractions_stays_within_hashin_shtrikman(tmp_path):
    assert cell_sweep.main(["--count", "11", "--out", str(tmp_path)]) == 0
    rows = np.genfromtxt(tmp_path / "cell_sweep.csv", delimiter=",", names=True)
    assert rows["fraction"][[0, -1]].tolist() == [0, 0.5]
    assert rows["E_GPa"][0] == pytest.approx(20)
    assert (np.diff(rows["E_GPa"]) > 0).all()
    assert (rows["bulk_GPa"] >= rows["bulk_least_GPa"] * (1 - 1e-12)).all()
    assert (rows["bulk_GPa"] <= rows["bulk_greatest_GPa"] * (1 + 1e-12)).all()
    assert (tmp_path / "cell_sweep.svg").exists()
