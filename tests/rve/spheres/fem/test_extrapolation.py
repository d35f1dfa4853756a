"""Moduli extrapolated over meshes, and their declared errors, against the exact series."""

from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("dolfinx")
from alphacut.rve import Phase
from alphacut.rve.spheres.fem import extrapolation
from alphacut.rve.spheres.fem.extrapolation import Meshes
from alphacut.rve.spheres.series.stiffness import cubic_stiffness

MATRIX = Phase(20e9)


def exact(radius, matrix, inclusion):
    cell = cubic_stiffness([radius], matrix, [inclusion])
    return np.array([cell.bulk[0, 0], cell.deviator[0, 0], cell.shear[0, 0]])


@pytest.mark.parametrize("inclusion", [Phase(80e9, 0.2), Phase(2e9, 0.4)])
def test_elements_and_series_agree_within_the_declared_error(inclusion):
    found = Meshes(0.6, MATRIX, size=0.25).judged([inclusion])
    moduli, error = found.moduli[0], found.errors[0]
    true = abs(moduli / exact(0.6, MATRIX, inclusion) - 1)
    assert (true <= error).all()
    assert true.max() < 1e-3
    assert error.max() < 4e-3


def test_a_mesh_is_not_judged_by_one_as_fine():
    """Asked for 1.5 times the edges, Gmsh folds elements and has to take nearly the same."""
    inclusion = Phase(6e8)
    found = Meshes(0.76, MATRIX, size=0.27).judged([inclusion])
    moduli, error = found.moduli[0], found.errors[0]
    assert (abs(moduli / exact(0.76, MATRIX, inclusion) - 1) <= error).all()


class Made:
    """Cells whose moduli err by `off` and a power of the edge length; sizes are remembered."""

    def __init__(self, power, *, off=(), fold=0.0):
        self.power, self.off, self.fold, self.sizes = power, dict(off), fold, []

    def __call__(self, radius, *, size, comm):
        self.sizes.append(size)
        edge = min(size, self.fold) if self.fold and size >= self.fold else size
        moduli = np.array([1.0, 2.0, 3.0]) * (1 + edge**self.power + self.off.get(size, 0.0))

        def solve(matrix, phase):
            return SimpleNamespace(moduli=moduli, iterations=(9, 9, 9))

        return SimpleNamespace(unknowns=edge**-3, solve=solve)


def judged(monkeypatch, made):
    monkeypatch.setattr(extrapolation, "OctantCell", made)
    meshes = Meshes(0.6, MATRIX, size=0.2)
    return meshes, meshes.judged([Phase(80e9)])


def test_an_error_of_the_assumed_order_is_taken_off_whole(monkeypatch):
    made = Made(extrapolation.ORDER)
    meshes, found = judged(monkeypatch, made)
    np.testing.assert_allclose(found.moduli[0], [1, 2, 3], rtol=1e-4)
    np.testing.assert_allclose(found.errors, 1.5 * 0.2**extrapolation.ORDER, rtol=1e-2)
    assert sorted(made.sizes) == pytest.approx([0.2, 0.3, 0.45])
    assert (meshes.systems, found.iterations) == (9, (9, 9, 9))


@pytest.mark.parametrize("power", [2.7, 5.0])
def test_errors_of_other_orders_are_declared(monkeypatch, power):
    _, found = judged(monkeypatch, Made(power))
    assert (abs(found.moduli[0] / [1, 2, 3] - 1) <= found.errors).all()


def test_two_meshes_that_agree_by_chance_are_caught_by_a_third(monkeypatch):
    power = extrapolation.ORDER
    lucky = 0.2**power - 0.3**power  # the next mesh is as good as the finest
    _, found = judged(monkeypatch, Made(power, off={0.2 * 1.5: lucky}))
    assert abs(found.moduli[0, 0] - 1) > 0.9 * 0.2**power
    assert (abs(found.moduli[0] / [1, 2, 3] - 1) <= found.errors).all()


def test_a_finer_mesh_is_made_where_the_coarser_ones_are_as_fine(monkeypatch):
    made = Made(3.7, fold=0.21)
    meshes, found = judged(monkeypatch, made)
    assert min(made.sizes) == meshes.size == pytest.approx(0.2 / 1.5)
    assert (abs(found.moduli[0] / [1, 2, 3] - 1) <= found.errors).all()


def test_a_mesh_between_is_made_before_one_much_finer(monkeypatch):
    made = Made(3.7)
    meshes, _ = judged(monkeypatch, made)
    meshes.refine(0.15)
    assert made.sizes[3:] == [0.15]
    meshes.refine(0.05)
    assert made.sizes[4:] == pytest.approx([0.075, 0.05])


@pytest.mark.slow
def test_declared_error_holds_over_radii_and_materials():
    generator = np.random.default_rng(8)
    for _ in range(12):
        radius, size = generator.uniform(0.2, 0.95), generator.uniform(0.15, 0.3)
        matrix = Phase(20e9, generator.uniform(0, 0.4))
        inclusion = Phase(20e9 * 10 ** generator.uniform(-2, 2), generator.uniform(0, 0.4))
        found = Meshes(radius, matrix, size=size).judged([inclusion])
        moduli, error = found.moduli[0], found.errors[0]
        true = abs(moduli / exact(radius, matrix, inclusion) - 1)
        assert (true <= error + 1e-7).all(), (radius, matrix, inclusion)
