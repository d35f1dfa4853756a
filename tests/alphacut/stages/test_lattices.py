"""Cases whose fibres stand in hexagons or rectangles."""

import numpy as np
import pytest

from alphacut.case.content import load
from alphacut.rve.cell.lattice import HEXAGONAL, SQUARE
from alphacut.stages.cell import CellProblem
from alphacut.stages.modulus import identity, solved
from tests.alphacut.case.test_load import fraction_case, read
from tests.alphacut.small import CELL, written


def problem(folder, *changes):
    return CellProblem.of(load(written(folder, CELL), changes).content)


def test_every_model_of_a_case_takes_its_lattice(tmp_path):
    pytest.importorskip("alphacut.rve.fenicsx")
    for lattice in ("hexagonal", "[1, 1.5]"):
        methods = "series", "slices", "prism"
        results = []
        for method in methods:
            changes = f"cell.lattice={lattice}", f"modulus.method={method}", "mesh.size=0.4"
            results.append(problem(tmp_path, *changes).solve())
        assert [result.method for result in results] == list(methods)
        exact, *others = (result.modulus for result in results)
        for result, modulus in zip(results[1:], others, strict=True):
            assert abs(modulus / exact - 1) <= result.estimated_error * (1 + 1e-6) + 1e-9
    assert problem(tmp_path).nominal.lattice == SQUARE
    assert problem(tmp_path, "cell.lattice=hexagonal").nominal.lattice == HEXAGONAL


def test_a_rectangle_of_equal_sides_is_the_square_to_the_bit(tmp_path):
    square = problem(tmp_path).solve()
    equal = problem(tmp_path, "cell.lattice=[2, 2]").solve()
    assert np.array_equal(equal.stiffness, square.stiffness)
    assert square.modulus != problem(tmp_path, "cell.lattice=hexagonal").solve().modulus


def test_a_fraction_fills_the_cell_of_its_lattice(tmp_path):
    for lattice, area in (("hexagonal", np.sqrt(12)), ("[1, 1.25]", 5.0)):
        content = read(tmp_path, fraction_case("cylinders", 0.3), [f"cell.lattice={lattice}"])
        radius, _ = content.radius_and_cell
        assert np.pi * radius(0.0) ** 2 / area == pytest.approx(0.3, rel=1e-14)
        assert CellProblem.of(content).references()["fraction"] == pytest.approx(0.3, rel=1e-12)


def test_samples_of_one_lattice_are_none_of_another(tmp_path):
    square, hexagonal = problem(tmp_path), problem(tmp_path, "cell.lattice=hexagonal")
    assert identity(square) != identity(hexagonal)
    cuts = [solved(one, progress=False, alpha=[0.0, 1.0]).bounds for one in (square, hexagonal)]
    assert (cuts[0].bounds("E")[0] != cuts[1].bounds("E")[0]).all()
