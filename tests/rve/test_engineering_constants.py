"""Engineering constants of both definitions, and the declared errors of the stiffness."""

import numpy as np
import pytest

pytest.importorskip("alphacut.rve.fenicsx")

from petsc4py import PETSc

from alphacut.rve import Ellipse, Phase, SeriesModel, SlicesModel, constants
from alphacut.rve.mesh.curved import plane_mesh
from alphacut.rve.result.engineering_constants import AxialStiffness, EngineeringConstants
from alphacut.rve.slices.model import PlaneCell
from alphacut.stochastic import HermiteMap

MATRIX, PARTICLE = Phase(68.3e9, 0.3), Phase(379.3e9, 0.1)
R = float(np.sqrt(4 * 0.47 / np.pi))


CONSTANTS = {"E_L": 215.33, "E_x_free": 143.96, "G_T": 45.824, "G_L": 54.378}
"""Boron in aluminium, a square array, in GPa: the table of docs/howto/material.md."""


@pytest.mark.parametrize("model", [SeriesModel(), SlicesModel(0.3, 2)], ids=lambda x: x.name)
def test_boron_aluminium_has_its_constants_by_series_and_by_elements(model):
    result = model.solve(HermiteMap(R, 0, R, 0), MATRIX, [PARTICLE])[0]
    found = constants(result).values
    assert {name: found[name] / 1e9 for name in CONSTANTS} == pytest.approx(CONSTANTS, rel=1e-4)
    assert found["nu_LT"] == pytest.approx(0.19456, rel=1e-4)
    assert found["E_x"] / 1e9 == pytest.approx(147.69, abs=5e-3)  # where fibres cannot strain along


@pytest.mark.parametrize("particle", [PARTICLE, Phase(2e9, 0.4)], ids=["stiff", "soft"])
def test_hill_s_relations_are_what_a_strain_along_the_fibres_gives(particle):
    """Against a load ε33 by the operator of the plane cell, of a turned ellipse."""
    outline, radius = Ellipse(2.0, 30.0), 0.5
    model = SlicesModel(0.3, 2, outline)
    result = model.solve(HermiteMap(radius, 0, radius, 0), MATRIX, [particle])[0]
    axial = AxialStiffness.of_result(result)
    cell = PlaneCell(plane_mesh(radius, size=0.3, outline=outline), 4)
    lateral, own = strained_along(cell, (MATRIX, particle), result.cell.fraction(np.zeros(1))[0])
    assert (abs(axial.lateral - lateral) <= axial.lateral_errors + 1e-9 * lateral[0]).all()
    assert axial.axial == pytest.approx(own, rel=1e-7)
    assert abs(axial.lateral[2]) > 1e-4 * axial.lateral[0]


@pytest.mark.parametrize("sign", [-1, 1])
def test_poisson_s_ratio_errs_by_what_the_compliance_along_x_errs(sign):
    """C66 alone is off, and S_xy is not changed by it: ν_xy = −S_xy/S_xx is by S_xx alone."""
    stiffness = np.linalg.inv([[1.0, -0.3, 0.4], [-0.3, 1.0, 0.0], [0.4, 0.0, 1.0]])
    errors = np.diag([0.0, 0.0, 1e-3])
    compliance = np.linalg.inv(stiffness + sign * errors)
    declared = EngineeringConstants.of_stiffness(stiffness, errors)
    change = abs(-compliance[0, 1] / compliance[0, 0] - 0.3)
    assert change <= declared.errors[2] < 1.2 * change


def strained_along(cell, phases, fraction):
    """C13, C23, C63 and C33 by fields under ε33 = 1: an eigenstress C13 of the phases."""
    strains = cell.strains([phase.stiffness for phase in phases])
    lateral = np.array([phase.stiffness[0, 1] for phase in phases])
    mixed = lateral @ cell.weights @ strains[:, :2].sum(axis=1)
    columns = np.array([np.outer([c, c, 0], [1, 0, 0]) for c in lateral])
    stiffness, elimination = cell._form.stiffness.x.array, cell._elimination
    elastic, stiffness[:] = stiffness.copy(), columns[cell._phase].ravel()
    load = elimination.forces(cell._form.load(np.array([1.0, 0, 0])))
    stiffness[:] = elastic
    cell._form.assemble(elimination.matrix)
    ksp = PETSc.KSP().create(elimination.matrix.comm)
    ksp.setOperators(elimination.matrix)
    ksp.setType("preonly")
    ksp.pc.setType("cholesky")
    field = load.duplicate()
    ksp.solve(load, field)
    shares = np.array([1 - fraction, fraction])
    mean = shares @ [phase.stiffness[0, 0] for phase in phases]
    return mixed, mean - load.dot(field) / 4


def test_errors_of_the_constants_cover_every_stiffness_within_its_errors(rng):
    """At random stiffnesses off by their errors, with either sign; a third would not cover them."""
    covered = []
    for _ in range(20):
        root = np.eye(3) + 0.3 * rng.uniform(-1, 1, (3, 3))
        stiffness = 20e9 * root @ root.T
        errors = np.full((3, 3), 1e-3 * stiffness[0, 0])
        declared = EngineeringConstants.of_stiffness(stiffness, errors)
        for _ in range(200):
            signs = np.triu(rng.choice([-1, 1], (3, 3)))
            change = errors * (signs + np.triu(signs, 1).T)
            moved = EngineeringConstants.of_stiffness(stiffness + change, errors).values
            covered.append((abs(moved - declared.values) / declared.errors).max())
    assert 0.5 < max(covered) <= 1
