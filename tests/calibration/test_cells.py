"""Random cells by prisms and slices, against the series or finer slices: errors cover."""

import numpy as np
import pytest

from tests.calibration.declared import Calibration, free_seed

FEW = 1


@pytest.mark.parametrize(
    ("draw", "cells", "has_lattices"),
    [
        ("round_cell", FEW, False),
        ("round_cell", FEW, True),
        pytest.param("round_cell", 30, False, marks=pytest.mark.slow),
        pytest.param("round_cell", 20, True, marks=pytest.mark.slow),
        pytest.param("any_cell", 8, False, marks=pytest.mark.slow),
    ],
)
def test_declared_errors_of_random_cells_cover(draw, cells, has_lattices):
    pytest.importorskip("alphacut.rve.fenicsx")
    from benchmarks.rve import random_cells

    seed = 7 if cells == FEW else free_seed(draw)
    table = Calibration(f"{draw}: declared over true", seed)
    for number in range(cells):
        rng = np.random.default_rng([seed, number])
        cell = getattr(random_cells, draw)(rng)
        lattice = random_cells.random_lattice(rng) if has_lattices else "square"
        for one in random_cells.judge(cell, rng, lattice):
            least = random_cells.NOISE
            table.estimated(one.quantity, one.declared, one.true, least=least, case=number)
    table.judge()
