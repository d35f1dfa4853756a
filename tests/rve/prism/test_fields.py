"""Fields on the prisms are those of the exact series, and of both phases on the interface."""

import numpy as np
import pytest

pytest.importorskip("dolfinx")

from alphacut.rve.cell import LOADS, Phase
from alphacut.rve.prism.fields import cell_fields
from alphacut.rve.prism.model import PrismModel
from alphacut.rve.series.field import SeriesField
from alphacut.stochastic import HermiteMap

CONE, MATRIX, PARTICLE = HermiteMap(0.5, 0, 0.6, 0), Phase(20e9), Phase(80e9, 0.2)


def test_displacement_and_stress_are_those_of_the_series():
    fields = cell_fields(PrismModel(0.15, 4), CONE, MATRIX, PARTICLE)
    level = np.flatnonzero(fields.points[:, 2] == 0)
    inside = np.zeros(len(fields.points), bool)
    inside[fields.cells[fields.phase == 1]] = True
    exact = SeriesField(float(CONE(0.0)), MATRIX, PARTICLE)
    for load, strain in enumerate(LOADS):
        at = fields.points[level, :2], strain
        apart = fields.displacement[level, :, load] - exact.displacement(*at, inside=inside[level])
        assert abs(apart - apart.mean(axis=0)).max() < 2e-3 * abs(fields.displacement).max()
        stress = exact.stress(*at, inside=inside[level])
        assert np.median(abs(fields.stress[level, :, load] - stress)) < 0.02 * abs(stress).max()


def test_nodes_of_the_interface_stand_once_for_each_phase():
    fields = cell_fields(PrismModel(0.4, 2), CONE, MATRIX, PARTICLE)
    touched = [set(fields.cells[fields.phase == k].ravel()) for k in (0, 1)]
    assert not touched[0] & touched[1]
    assert len(touched[0] | touched[1]) == len(fields.points)
    assert fields.volume.sum() == pytest.approx(4, rel=1e-12)
