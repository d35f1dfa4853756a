"""Fields on the prisms: means as by the exact series, and both phases on the interface."""

import numpy as np
import pytest

pytest.importorskip("alphacut.rve.fenicsx")

from alphacut.rve import LOADS, Phase, PrismModel
from alphacut.stochastic import HermiteMap
from tests.rve.test_result import crisp_cell

CONE, MATRIX, PARTICLE = HermiteMap(0.5, 0, 0.6, 0), Phase(20e9), Phase(80e9, 0.2)


def test_the_particles_mean_stress_and_strain_are_those_of_the_series():
    """c (C_i − C_m) ε_i = (C − C_m) ε, with C by the series."""
    fields = PrismModel(0.1, 2).fields(HermiteMap(0.5, 0, 0.5, 0), MATRIX, [PARTICLE])
    inner, weight = fields.phase == 1, np.zeros(len(fields.points))
    corners = fields.points[fields.cells[:, :3], :2]
    area = abs(np.linalg.det(corners[:, 1:] - corners[:, :1])) / 2
    np.add.at(weight, fields.cells[inner], area[inner, None])
    whole = crisp_cell(0.5, MATRIX, PARTICLE).stiffness
    contrast = np.pi / 16 * (PARTICLE.stiffness - MATRIX.stiffness)
    right = np.flatnonzero(weight * (fields.points[:, 0] > 0.5 - 1e-6))
    for load, strain in enumerate(LOADS):
        own = np.linalg.solve(contrast, (whole - MATRIX.stiffness) @ strain)
        stress = PARTICLE.stiffness @ own
        mean = weight @ fields.stress[:, :, load] / weight.sum()
        assert mean == pytest.approx(stress, abs=0.01 * abs(stress).max())
        # the mean displacement of its edge is about that of the mean strain
        moved = fields.displacement[right, :, load] - fields.displacement[weight > 0, :, load].mean(
            0
        )
        along = np.array([own[0], own[2] / 2]) * 0.5
        assert moved.mean(axis=0) == pytest.approx(along, abs=0.06 * abs(along).max())


def test_nodes_of_the_interface_stand_once_for_each_phase():
    fields = PrismModel(0.4, 2).fields(CONE, MATRIX, [PARTICLE])
    touched = [set(fields.cells[fields.phase == k].ravel()) for k in (0, 1)]
    assert not touched[0] & touched[1]
    assert len(touched[0] | touched[1]) == len(fields.points)
