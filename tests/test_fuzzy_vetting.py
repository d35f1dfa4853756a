"""Arguments that cannot work are refused before any sample is run."""

import pytest

from fuzzy import Crisp, Signed, Triangular, propagate

GOOD = {"a": Triangular(1, 2, 3), "b": Triangular(0, 1, 2)}
CALLS = []


def total(a, b):
    CALLS.append((a, b))
    return a + b


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"inputs": [("a", 1)]}, "the inputs are a list; they must map names to fuzzy numbers"),
        ({"inputs": {**GOOD, "b": (0, 1)}}, r"the input 'b' is \(0, 1\); it must be a number or a fuzzy number"),
        (
            {"inputs": {"a": GOOD["a"], "c": GOOD["b"]}},
            "the function cannot be called with the inputs a, c: missing a required argument: 'b'",
        ),
        ({"plan": "signed"}, r"the plan is 'signed'; it must be a plan such as fuzzy\.General\(\)"),
        ({"alpha": "abc"}, "the α-levels are 'abc'; they must be a sequence of numbers"),
        ({"alpha": 0.5}, r"the α-levels are 0\.5; they must be a sequence of numbers"),
        ({"plan": Signed}, "it must be a plan such as"),
        ({"function": 3}, "the function is 3, which cannot be called"),
        ({"function": lambda a, b: a, "workers": 2}, "cannot be sent to worker processes .*top level of a module"),
    ],
)
def test_refused_at_once(change, message):
    CALLS.clear()
    with pytest.raises(ValueError, match=message):
        propagate(**{"function": total, "inputs": GOOD, **change})
    assert not CALLS


def test_a_plain_number_is_crisp():
    mixed, spelt = (propagate(total, {"a": GOOD["a"], "b": b}).bounds()[0] for b in (1.5, Crisp(1.5)))
    assert list(mixed) == list(spelt)


def test_a_text_in_a_fuzzy_number_is_named():
    with pytest.raises(ValueError, match="the triangle holds '25 GPa'; it needs plain numbers: convert units before"):
        Triangular("25 GPa", 26, 27)
