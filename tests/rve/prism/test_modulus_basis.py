"""Samples of one map projected on a few solutions over the particle's modulus."""

import numpy as np
import pytest

pytest.importorskip("dolfinx")

from alphacut.rve.cell import Phase
from alphacut.rve.prism.model import PrismModel
from alphacut.stochastic import HermiteMap

PAPER = HermiteMap(0.1337, 0.1, 0.8663, 0.1692)
MATRIX = Phase(20e9)
COARSE = {"mesh_size": 0.3, "layers": 4}


def moduli_of(results):
    return np.array([result.modulus for result in results])


@pytest.mark.parametrize(
    "span", [(75e9, 85e9), (2e9, 200e9), (20e9, 40e9), (20e7, 20e9), (80e9, 80e9)]
)
def test_projected_samples_meet_those_solved_by_themselves(span):
    particles = [Phase(float(e)) for e in np.geomspace(*span, 5)]
    exact = PrismModel(**COARSE, petsc={"ksp_rtol": "1e-12"}).solve(PAPER, MATRIX, particles)
    found = PrismModel(**COARSE, moduli=span).solve(PAPER, MATRIX, particles)
    assert abs(moduli_of(found) / moduli_of(exact) - 1).max() < 1e-10
    assert all("projected on solutions at" in one.reason for one in found)


def test_the_narrow_range_of_the_paper_takes_two_solutions():
    found = PrismModel(**COARSE, moduli=(75e9, 85e9)).solve(PAPER, MATRIX, [Phase(80e9)])[0]
    assert "projected on solutions at 2 moduli" in found.reason
    assert len(found.iterations) == 4


def test_a_sample_has_the_same_bits_in_any_company():
    model = PrismModel(**COARSE, moduli=(75e9, 85e9))
    particles = [Phase(e) for e in (75e9, 78e9, 80e9, 85e9)]
    together = model.solve(PAPER, MATRIX, particles)
    alone = [model.solve(PAPER, MATRIX, [particle])[0] for particle in reversed(particles)][::-1]
    assert moduli_of(together).tobytes() == moduli_of(alone).tobytes()
    assert [one.curve.s11.tobytes() for one in together] == [
        one.curve.s11.tobytes() for one in alone
    ]


def test_the_whole_stiffness_is_projected_too():
    model = {**COARSE, "stiffness": True}
    particles = [Phase(77e9, 0.1), Phase(81e9, 0.2)]
    exact = PrismModel(**model, petsc={"ksp_rtol": "1e-12"}).solve(PAPER, MATRIX, particles)
    found = PrismModel(**model, moduli=(75e9, 85e9)).solve(PAPER, MATRIX, particles)
    for own, other in zip(found, exact, strict=True):
        assert own.stiffness == pytest.approx(other.stiffness, rel=1e-9, abs=1.0)
        assert set(own.checks) == set(other.checks)


def test_a_modulus_outside_the_range_is_refused():
    with pytest.raises(ValueError, match=r"modulus 9e\+10 Pa; the range given is 7.5e\+10 to"):
        PrismModel(**COARSE, moduli=(75e9, 85e9)).solve(PAPER, MATRIX, [Phase(90e9)])
