"""Cells with many discs: against the series, exact cases, bounds; and the comparison with the
one-particle model in small.
"""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

from alphacut.rve.bounds import bulk_modulus, hashin_shtrikman_bulk
from alphacut.rve.cell import Phase
from alphacut.rve.result import effective_modulus
from alphacut.rve.series.stiffness import square_stiffness
from alphacut.stochastic.particles.discs import Discs
from alphacut.stochastic.particles.packing import Packing
from alphacut.stochastic.particles.radius_laws import LogNormalRadii
from benchmarks.stochastic.averages import Isotropic, averages, mori_tanaka
from benchmarks.stochastic.representative.many_particles import many_particles

MATRIX, INCLUSION = Phase(20e9), Phase(80e9, 0.2)
PACKING = Packing(20, 0.3, LogNormalRadii(1e-3, 4e-3), gap=2e-4).make(np.random.default_rng(1))


@pytest.mark.parametrize("centre", [(0.5, 0.5), (0.13, 0.91)])
def test_one_disc_is_the_square_cell(centre):
    stiffness = many_particles(
        Discs([centre], [0.3], (1, 1)), MATRIX, INCLUSION, size=0.12, around=24
    )
    exact = square_stiffness(np.array([0.6]), MATRIX, [INCLUSION]).matrix[0, 0]
    assert stiffness == pytest.approx(exact, rel=2e-4, abs=1e-4 * exact[0, 0])


def test_four_discs_on_a_square_lattice_are_one():
    grid = np.array([(0.25, 0.25), (0.75, 0.25), (0.25, 0.75), (0.75, 0.75)])
    stiffness = many_particles(
        Discs(grid, np.full(4, 0.15), (1, 1)), MATRIX, INCLUSION, size=0.2, around=20
    )
    exact = square_stiffness(np.array([0.6]), MATRIX, [INCLUSION]).matrix[0, 0]
    assert stiffness == pytest.approx(exact, rel=4e-4, abs=3e-4 * exact[0, 0])


def test_homogeneous_cell_is_its_material():
    assert many_particles(PACKING, MATRIX, MATRIX, size=0.6) == pytest.approx(
        MATRIX.stiffness, rel=1e-10, abs=1e-2
    )


def test_packing_lies_within_the_bounds_and_converges_from_above():
    coarse, fine = (
        many_particles(PACKING, MATRIX, INCLUSION, size=size, around=around)
        for size, around in ((0.6, 8), (0.3, 16))
    )
    assert np.allclose(fine, fine.T)
    low, high = hashin_shtrikman_bulk(np.asarray(0.3), MATRIX, INCLUSION)
    assert low < bulk_modulus(fine) < high
    assert Isotropic.of(coarse).modulus == pytest.approx(Isotropic.of(fine).modulus, rel=2e-3)


def test_moduli_do_not_depend_on_where_the_box_begins():
    moved = Discs(PACKING.centres + 0.37 * PACKING.size, PACKING.radii, PACKING.size)
    first, second = (
        many_particles(discs, MATRIX, INCLUSION, size=0.4) for discs in (PACKING, moved)
    )
    assert first == pytest.approx(second, rel=3e-4, abs=3e-4 * first[0, 0])


def test_touching_discs_and_windows_are_refused():
    with pytest.raises(ValueError, match="touch or overlap"):
        many_particles(Discs([(0.3, 0.5), (0.6, 0.5)], [0.2, 0.2], (1, 1)), MATRIX, INCLUSION)
    with pytest.raises(ValueError, match="periodic square"):
        many_particles(Discs([(0.5, 0.5)], [0.2], (1, 1), periodic=False), MATRIX, INCLUSION)


def test_isotropic_projection_gives_back_a_phase():
    material = Isotropic.of(INCLUSION.stiffness)
    assert material.modulus == pytest.approx(INCLUSION.modulus, rel=1e-12)
    stress = 0.01 * 2 * material.bulk, 0.01 * 2 * material.shear
    assert effective_modulus(*stress)[0] == pytest.approx(INCLUSION.modulus, rel=1e-12)


def test_mori_tanaka_limits_and_bound():
    assert mori_tanaka(0.0, MATRIX, INCLUSION).modulus == pytest.approx(MATRIX.modulus)
    assert mori_tanaka(1.0, MATRIX, INCLUSION).modulus == pytest.approx(INCLUSION.modulus)
    low, high = hashin_shtrikman_bulk(np.asarray(0.3), MATRIX, INCLUSION)
    assert mori_tanaka(0.3, MATRIX, INCLUSION).bulk == pytest.approx(float(low), rel=1e-12)
    assert mori_tanaka(0.7, INCLUSION, MATRIX).bulk == pytest.approx(float(high), rel=1e-12)
    dilute = square_stiffness(np.array([0.05]), MATRIX, [INCLUSION]).matrix[0, 0]
    assert mori_tanaka(np.pi / 4 * 0.05**2, MATRIX, INCLUSION).modulus == pytest.approx(
        Isotropic.of(dilute).modulus, rel=1e-6
    )


def test_averages_of_equal_cells_are_the_cell():
    known = averages(np.full(20, 0.5), np.full(20, 0.05), MATRIX, INCLUSION)
    exact = Isotropic.of(
        square_stiffness(np.array([0.5]), MATRIX, [INCLUSION]).matrix[0, 0]
    ).modulus
    for value in (known.one_particle, known.equal_stress, known.single):
        assert value.modulus == pytest.approx(exact, rel=1e-6)


def test_averages_are_in_order():
    radii = np.linspace(0.2, 0.8, 50)
    known = averages(radii, np.full(50, 0.02), MATRIX, INCLUSION)
    ordered = (
        known.reuss,
        known.mori_tanaka,
        known.single,
        known.one_particle,
        known.upper,
        known.voigt,
    )
    moduli = [value.modulus for value in ordered]
    assert moduli == sorted(moduli)
    assert known.equal_stress.modulus < known.one_particle.modulus


@pytest.mark.slow
def test_comparison_in_small(tmp_path, capsys):
    path = Path(__file__).parents[3] / "benchmarks" / "stochastic" / "many_particles.py"
    spec = importlib.util.spec_from_file_location("many", path)
    many = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(many)
    many.main(
        ["--cells", "5", "--discs", "15", "--size", "0.5", "--around", "8", "--out", str(tmp_path)]
    )
    assert "one-particle model gives" in capsys.readouterr().out
    assert (tmp_path / "many_particles.svg").stat().st_size > 1000
    assert len((tmp_path / "many_particles.csv").read_text().splitlines()) == 1 + 5 + 7
