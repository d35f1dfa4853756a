"""What mechanics is said to prove of the cell's response holds for the exact series solution, and
is not said where it does not.
"""

from pathlib import Path

import numpy as np
import pytest

from alphacut.case.load import load
from alphacut.stages.material import modulus
from alphacut.stages.material.campaign import campaign

CASES = Path(__file__).parents[4] / "cases"


def stated(name, *changes):
    """The stated signs of the effects on E, and the campaign they belong to."""
    wanted = campaign(load(CASES / f"{name}.toml", ["modulus.method=series", *changes]))
    return {key: next(iter(sign.values())) for key, sign in wanted.known.signs.items()}, wanted


@pytest.mark.parametrize("name", ["paper", "porous"])
def test_every_stated_sign_is_that_of_the_series_solution(name):
    signs, wanted = stated(name)
    assert set(signs) == set(wanted.inputs)
    modal = {key: number.modal for key, number in wanted.inputs.items()}
    for key, number in wanted.inputs.items():
        low, high = number.support
        below, above = (wanted.task([{**modal, key: end}])[0]["E"] for end in (low, high))
        assert (above - below) * signs[key] > 0, key


def test_soft_particles_turn_the_signs_of_the_radius():
    stiff, soft = stated("paper")[0], stated("porous")[0]
    assert stiff["a2"] == -soft["a2"] == 1
    assert stiff["a4"] == -soft["a4"] == -1


@pytest.mark.parametrize(
    "change",
    [
        "cell.inclusion_poisson=0.2",
        "cell.matrix_poisson=[0.2, 0.3]",
        "inclusion_modulus=[15, 80, 85] GPa",
    ],
)
def test_nothing_is_stated_where_nothing_is_proved(change):
    assert stated("paper", change)[0] == {}


def test_nothing_is_stated_of_the_discretised_product_space():
    assert not campaign(load(CASES / "paper.toml")).known.signs


@pytest.mark.parametrize("plan", ["signed", "extended"])
def test_every_plan_bounds_poissons_ratio_by_its_own_corners(plan):
    """Where ν of the matrix is fuzzy, other corners bound ν than those that bound E."""
    changes = (
        *("cell.matrix_poisson=[0.33, 0.35, 0.37]", "cell.inclusion_poisson=[0.2, 0.22, 0.24]"),
        *("modulus.alpha=[0, 1]", "modulus.method=series"),
    )
    cases = [
        load(CASES / "paper.toml", [f"modulus.plan={name}", *changes]) for name in (plan, "general")
    ]
    own, general = (modulus.compute(campaign(case)).result for case in cases)
    for name in ("E", "nu"):
        assert np.allclose(own.bounds(name), general.bounds(name), rtol=1e-9, atol=0)
