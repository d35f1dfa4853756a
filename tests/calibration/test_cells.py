"""Random cells by prisms and slices, against the series or finer slices: errors cover."""

import numpy as np
import pytest

from tests.calibration.declared import Calibration, free_seed

FEW = 1


@pytest.mark.parametrize(
    ("draw", "cells"),
    [
        ("round_cell", FEW),
        *(pytest.param(*x, marks=pytest.mark.slow) for x in (("round_cell", 30), ("any_cell", 8))),
    ],
)
def test_declared_errors_of_random_cells_cover(draw, cells):
    pytest.importorskip("alphacut.rve.fenicsx")
    from benchmarks.rve import random_cells

    seed = 7 if cells == FEW else free_seed(draw)
    table = Calibration(f"{draw}: declared over true", seed)
    for number in range(cells):
        rng = np.random.default_rng([seed, number])
        for one in random_cells.judge(getattr(random_cells, draw)(rng), rng):
            least = random_cells.NOISE
            table.estimated(one.quantity, one.declared, one.true, least=least, case=number)
    table.judge()
