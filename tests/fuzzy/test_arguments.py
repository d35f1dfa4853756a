"""Arguments that cannot work are refused before any sample is run."""

from functools import partial
from threading import Lock

import pytest

from alphacut.fuzzy import (
    Crisp,
    Ellipsoidal,
    IntervalQuasiMonteCarlo,
    Known,
    Linear,
    RandomInput,
    Signed,
    Triangular,
    propagate,
)

GOOD = {"a": Triangular(1, 2, 3), "b": Triangular(0, 1, 2)}
CALLS = []


def total(a, b):
    CALLS.append((a, b))
    return a + b


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"inputs": [("a", 1)]}, "the inputs are a list; they must map names to fuzzy numbers"),
        (
            {"inputs": {**GOOD, "b": (0, 1)}},
            r"the input 'b' is \(0, 1\); it must be a number or a fuzzy number",
        ),
        (
            {"inputs": {"a": GOOD["a"], "c": GOOD["b"]}},
            "the function cannot be called with the inputs a, c: missing a required argument: 'b'",
        ),
        ({"plan": "signed"}, r"the plan is 'signed'; it must be a plan such as fuzzy\.General\(\)"),
        ({"alpha": "abc"}, "the α-levels are 'abc'; they must be a sequence of numbers"),
        ({"alpha": 0.5}, r"the α-levels are 0\.5; they must be a sequence of numbers"),
        ({"plan": Signed}, "it must be a plan such as"),
        ({"function": 3}, "the function is 3, which cannot be called"),
        (
            {"function": partial(lambda lock, a, b: a, Lock()), "workers": 2},
            "cannot be sent to worker processes .*what cannot be copied",
        ),
    ],
)
def test_refused_at_once(change, message):
    CALLS.clear()
    with pytest.raises(ValueError, match=message):
        propagate(**{"function": total, "inputs": GOOD, **change})
    assert not CALLS


def test_a_plain_number_is_crisp():
    mixed, spelt = (
        propagate(total, {"a": GOOD["a"], "b": b}).bounds()[0] for b in (1.5, Crisp(1.5))
    )
    assert list(mixed) == list(spelt)


def test_a_text_in_a_fuzzy_number_is_named():
    with pytest.raises(
        ValueError,
        match="the triangle holds '25 GPa'; it needs plain numbers: convert units before",
    ):
        Triangular("25 GPa", 26, 27)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {"known": {"a": 1}},
            r"known is \{'a': 1\}; it must be what is known of the function, as fuzzy.Known",
        ),
        (
            {"known": Known(signs=["a"])},
            r"the signs are \['a'\] and the derivatives \{\}; both must be mappings",
        ),
        (
            {"interactions": Linear({"a": 1}, 2)},
            r"the interactions are Linear.*; they must be a list such as",
        ),
        (
            {"known": Known(gradient_range=3)},
            "the range of the gradient is 3; it must be a function of the corners",
        ),
        (
            {"known": Known(monotone="a")},
            r"the monotone inputs are 'a'; they must be a row of names, as \('a',\)",
        ),
        ({"interactions": "ab"}, "the interactions are 'ab'; they must be a list such as"),
        (
            {"known": Known({"y": {"a": 1}})},
            "the fuzzy inputs are a.*; signs go by input first, as {'a': {'y': 1}}",
        ),
        (
            {"known": Known({"a": {"z": 1}})},
            "what is known of the model names z; its outputs are y",
        ),
        (
            {"known": Known(derivatives={"z": {"a": "y"}})},
            "what is known of the model names z; its outputs are y",
        ),
        (
            {"known": Known(gradient_range=lambda low, high: {"z": (low, high)})},
            "the range of the gradient names z; the outputs are y",
        ),
    ],
)
def test_wrong_facts_and_interactions_are_named(change, message):
    with pytest.raises(ValueError, match=message):
        propagate(total, GOOD, Signed(), **change)


@pytest.mark.parametrize(("weights", "bound"), [({"a": "x"}, 1), ([1], 1), ({"a": 1}, "1")])
def test_a_linear_interaction_needs_numbers(weights, bound):
    with pytest.raises(ValueError, match="it needs numbers by name, and a number"):
        Linear(weights, bound)


def test_plain_numbers_are_crisp_beside_random_inputs():
    load = RandomInput(lambda u, m: m + u, {"m": 3.0})
    for b in (1.5, Crisp(1.5)):
        response = IntervalQuasiMonteCarlo(4).run(total, {"a": load}, {"b": b}, alpha=[0, 1])
        assert response.mean()[0][0] == pytest.approx(5.0, abs=0.2)


def test_one_level_is_no_fuzzy_number():
    with pytest.raises(
        ValueError, match=r"the α-levels of the result are 0; a fuzzy number needs some from 0 to 1"
    ):
        propagate(total, GOOD, alpha=[0.0]).number()


@pytest.mark.parametrize(
    ("random", "message"),
    [({"a": 3.0}, "the random input a is 3.0; give RandomInput"), ({}, "there is no random input")],
)
def test_random_inputs_are_some(random, message):
    with pytest.raises(ValueError, match=message):
        IntervalQuasiMonteCarlo(4).run(total, random, {"b": 1.0}, alpha=[0, 1])


def test_a_correlation_is_a_number():
    with pytest.raises(ValueError, match="the correlation of a and b is 'x'; it must lie inside"):
        Ellipsoidal({("a", "b"): "x"})
