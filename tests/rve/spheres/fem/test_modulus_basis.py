"""Moduli combined from a few solutions against those that are solved for."""

import numpy as np
import pytest

pytest.importorskip("dolfinx")
from alphacut.rve import Phase
from alphacut.rve.spheres.fem import modulus_basis
from alphacut.rve.spheres.fem.extrapolation import Meshes
from alphacut.rve.spheres.fem.modulus_basis import (
    BasisError,
    ModulusBasis,
    basis_between,
    nodes_between,
)
from alphacut.rve.spheres.fem.stiffness import OctantCell

MATRIX = Phase(20e9)


@pytest.fixture(scope="module")
def cell():
    return OctantCell(0.7, size=0.6)


def phases(moduli):
    return [Phase(float(e), 0.2) for e in moduli]


def test_two_solutions_carry_the_moduli_between_them(cell):
    basis = ModulusBasis(cell, MATRIX, phases(nodes_between(75e9, 85e9, 2)))
    for modulus in (75e9, 79e9, 85e9):
        own = cell.solve(MATRIX, Phase(modulus, 0.2)).moduli
        np.testing.assert_allclose(basis.moduli(modulus), own, rtol=1e-7)
        assert (basis.moduli(modulus) >= own * (1 - 1e-12)).all()


def test_solutions_that_are_nearly_the_same_do_no_harm(cell):
    basis = ModulusBasis(cell, MATRIX, phases(nodes_between(20e9, 200e9, 6)))
    own = cell.solve(MATRIX, Phase(200e9, 0.2)).moduli
    np.testing.assert_allclose(basis.moduli(200e9), own, rtol=1e-7)


@pytest.mark.parametrize("seed", [3, 4])
def test_what_a_few_solutions_miss_is_declared(cell, seed):
    generator = np.random.default_rng(seed)
    ends = np.sort(20e9 * 10 ** generator.uniform(-1, 1.5, 2))
    chosen, missed = basis_between(cell, MATRIX, tuple(phases(ends)), error=1e-4)
    assert missed <= 1e-4
    basis = ModulusBasis(cell, MATRIX, chosen)
    for modulus in np.exp(generator.uniform(*np.log(ends), 3)):
        own = cell.solve(MATRIX, Phase(float(modulus), 0.2)).moduli
        assert abs(basis.moduli(float(modulus)) / own - 1).max() <= missed + 1e-12


def test_one_modulus_needs_one_solution(cell):
    chosen, missed = basis_between(cell, MATRIX, tuple(phases([80e9, 80e9])), error=1e-9)
    assert (len(chosen), missed) == (1, 0.0)
    own = cell.solve(MATRIX, chosen[0]).moduli
    np.testing.assert_array_equal(ModulusBasis(cell, MATRIX, chosen).moduli(80e9), own)


def test_a_range_too_wide_for_a_few_solutions_is_refused(cell, monkeypatch):
    monkeypatch.setattr(modulus_basis, "_MOST", 2)
    with pytest.raises(BasisError, match="2 solutions leave a relative error of"):
        basis_between(cell, MATRIX, tuple(phases([1e9, 1e12])), error=1e-6)


def test_meshes_with_a_basis_give_what_they_give_without():
    sphere = Phase(80e9, 0.2)
    basis = phases(nodes_between(75e9, 85e9, 2))
    pair = Meshes(0.7, MATRIX, size=0.4), Meshes(0.7, MATRIX, size=0.4, basis=basis)
    plain, based = (meshes.judged([sphere]) for meshes in pair)
    np.testing.assert_allclose(based.moduli, plain.moduli, rtol=1e-7)
    np.testing.assert_allclose(based.errors, plain.errors, rtol=1e-2)
    assert pair[1].systems == 2 * pair[0].systems
