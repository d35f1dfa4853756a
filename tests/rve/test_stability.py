from dataclasses import replace

import numpy as np
import pytest

from alphacut.rve.series.model import SeriesModel

pytest.importorskip("alphacut.rve.planar.problem")
from benchmarks.rve import stability as cell_stability


@pytest.mark.parametrize("model", ["series", "slices, order 2", "slices, order 4"])
def test_every_edge_works_to_its_declared_error_or_is_refused(model):
    solve = cell_stability.models(small=True)[model]
    rows = [cell_stability.meet(edge, model, solve) for edge in cell_stability.EDGES]
    assert [row for row in rows if row.outcome == "WRONG"] == []
    assert all(row.sentence for row in rows if row.outcome == "refuses")
    assert sum(row.outcome == "works" for row in rows) >= 13


@pytest.mark.parametrize(
    "name", ["r = 0.98", "contrast 1e6", "map that jumps", "ν_m = ν_i = 0.4999"]
)
@pytest.mark.parametrize("model", ["table", "prism"])
def test_table_and_prism_on_some_edges(name, model):
    edge = next(edge for edge in cell_stability.EDGES if edge.name == name)
    row = cell_stability.meet(edge, model, cell_stability.models(small=True)[model])
    assert row.outcome in ("works", "refuses")
    assert model == "prism" or row.outcome == "works"


def test_locking_is_declared_by_order_2_and_cured_by_order_4():
    edge = next(edge for edge in cell_stability.EDGES if edge.name == "ν_m = ν_i = 0.4999")
    locked, cured = (
        cell_stability.meet(edge, m, cell_stability.models(small=True)[m])
        for m in ("slices, order 2", "slices, order 4")
    )
    assert 1e-2 < locked.true < locked.declared
    assert cured.true < cured.declared < 1e-2


def test_a_silent_wrong_number_is_called_wrong():
    def overstated(radius_map, matrix, particle):
        return replace(
            SeriesModel(points=3).solve(radius_map, matrix, [particle])[0],
            errors={"theta": np.full(3, 1e-9)},
        )

    row = cell_stability.meet(cell_stability.EDGES[-1], "series", overstated)
    assert row.outcome == "WRONG"
    assert row.true > 1e-9
