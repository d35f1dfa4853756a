"""Isolators of a case by period, strength and factors λ, against the storey that they mean."""

import numpy as np
import pytest

from alphacut.case.content import load
from alphacut.frame import BilinearIsolator
from alphacut.frame.dynamics.yielding import YieldingFlow
from tests.alphacut.case.files import prepared
from tests.refused import refuses

STRENGTH = 'strength_ratio = "5 %"'
FACTORS = f"{STRENGTH}, lambda_min = 0.8, lambda_max = 1.3"


def structure_of(folder, isolator):
    """The structure of a case with some keys of its isolators."""
    return load(prepared(folder, "isolators", {"ISOLATOR": isolator})).content.structure


def test_stiffness_after_yielding_has_the_period_and_the_force_the_strength(tmp_path):
    structure = structure_of(tmp_path, FACTORS)
    k = 100e3 * np.pi**2 / 0.2
    force = 0.05 * 100e3 * 9.80665 / 0.8
    assert structure.numbers["k1"].support == pytest.approx((0.8 * k, 1.3 * k))
    assert structure.numbers["k1"].nominal == pytest.approx(k)
    assert structure.numbers["fy1"].support == pytest.approx((0.8 * force, 1.3 * force))
    assert structure.model.hardening == (0.2, 1.0)
    by_force = FACTORS.replace(STRENGTH, f'strength = "{0.05 * 100e3 * 9.80665} N"')
    same = structure_of(tmp_path, by_force)
    assert same.numbers["fy1"].nominal == pytest.approx(force)


def test_a_linked_factor_of_k1_changes_stiffness_and_strength(tmp_path):
    linked = structure_of(tmp_path, f"{FACTORS}, linked = true")
    free = structure_of(tmp_path, FACTORS)
    assert "fy1" not in linked.numbers
    k = linked.numbers["k1"].nominal
    force = free.numbers["fy1"].nominal
    for factor in (0.8, 1.0, 1.3):
        (of_one,) = YieldingFlow(linked.model, ("k1",), 1.0, 0.02).values(np.array([[factor * k]]))
        both = np.array([[factor * k, factor * force]])
        (of_both,) = YieldingFlow(free.model, ("k1", "fy1"), 1.0, 0.02).values(both)
        assert of_one == pytest.approx(of_both, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize(
    ("key", "value"), [("period", 0.0), ("strength", -1.0), ("hardening", 1.0), ("mass", np.nan)]
)
def test_an_isolator_that_cannot_be_is_refused(key, value):
    numbers = {"mass": 1e5, "period": 2.0, "strength": 5e4, "hardening": 0.1} | {key: value}
    with refuses(key):
        BilinearIsolator.of(**numbers)
