"""Levin's relation in bounds of two isotropic phases, against a thermal load by DOLFINx."""

import numpy as np
import pytest

pytest.importorskip("alphacut.rve.fenicsx")

import ufl
from dolfinx import fem

from alphacut.rve import Phase, PrismModel, ProductSpace, thermal_bounds
from alphacut.rve.image.bounds import StiffnessBounds
from alphacut.stochastic import HermiteMap


def test_the_thermal_load_of_a_cell_follows_from_its_stiffness():
    """The same discretisation satisfies the relation exactly, as a mean over θ too."""
    radius = HermiteMap(0.1337, 0.1, 0.8663, 0.1692)
    phases = Phase(4e9, 0.35), Phase(70e9, 0.2)
    alpha = 60e-6, 5e-6
    options = {"ksp_rtol": "1e-12"}
    model = PrismModel(0.4, 4, petsc=options, stiffness=True, estimate=False)
    cell = ProductSpace(model, radius)
    u, v = ufl.TrialFunction(cell.space), ufl.TestFunction(cell.space)
    measures = cell.dx["matrix"], cell.dx["inclusion"]
    stiffness = [fem.Constant(cell.space.mesh, phase.stiffness) for phase in phases]
    # The pressure at ε33 = 0 is 3 K α = E α/(1 − 2 ν).
    pressures = [
        fem.Constant(cell.space.mesh, p.modulus * a / (1 - 2 * p.poisson) * np.array([1.0, 1, 0]))
        for p, a in zip(phases, alpha, strict=True)
    ]
    parts = list(zip(measures, stiffness, pressures, strict=True))
    left = sum(
        cell.density * ufl.dot(c * cell.strain(u), cell.strain(v)) * dx for dx, c, _ in parts
    )
    right = sum(cell.density * ufl.dot(b, cell.strain(v)) * dx for dx, _, b in parts)
    solved = cell.solve(cell.assemble_matrix(left), [cell.assemble_vector(right)])
    moved = fem.Function(cell.space)
    cell.assign(moved, solved.vectors[0])
    stress = [
        cell.mean(sum(cell.density * (b - c * cell.strain(moved))[i] * dx for dx, c, b in parts))
        for i in range(3)
    ]
    result = model.solve(radius, phases[0], [phases[1]])[0]
    known = StiffnessBounds(result.stiffness, result.stiffness)
    mappings = [{"modulus": phase.modulus, "poisson": phase.poisson} for phase in phases]
    thermal = thermal_bounds(known, mappings, alpha)
    expansion = np.linalg.solve(result.stiffness, stress)
    for found, true in ((thermal.stress, stress), (thermal.expansion, expansion)):
        assert abs(found[:3] - np.array(true)[:, None]).max() < 1e-9 * np.abs(true).max()
