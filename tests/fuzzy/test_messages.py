"""What a caller gets wrong in Python is said in one line, with what is allowed and the cure."""

import numpy as np
import pytest

from alphacut.frame import StoreyFrame, envelope
from alphacut.fuzzy import CampaignError, Interval, Triangular, apply, propagate, width_shares
from alphacut.io import quantity
from alphacut.rve import Phase, named
from alphacut.stochastic import HermiteMap

X = {"x": Interval(1, 2)}
RADIUS, MATRIX, STIFF = HermiteMap(0.3, 0.2, 0.8, 0.1), Phase(3e9, 0.35), Phase(70e9, 0.2)
F = Triangular(1, 2, 3)
FRAME = StoreyFrame([20e3], [3.0], 30e9, 3e-4, q0=[0.01])


class Quantity:
    magnitude, units = 3.0, "metre"

    def __float__(self):
        return 3.0


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        (
            lambda: propagate(lambda x: None, X),
            "returned None, no real number: is its return missing",
        ),
        (lambda: propagate(lambda x: {"y": {"z": x}}, X), "'y' is a mapping; outputs have one lev"),
        (lambda: propagate(lambda x: Quantity(), X), r"'y' has the unit metre; return a real num"),
        (lambda: propagate(lambda x, p: x, {**X, "p": "2 ± 0.1"}), r"quantity\.fuzzy\('\[24, 25"),
        (
            lambda: propagate(lambda x: x, X, store=3, identity={"v": 1}),
            "the store is 3; it must be the path of a file",
        ),
        (
            lambda: propagate(lambda x: x, X, store="s.db", identity="v1"),
            "identity is 'v1'; it must",
        ),
        (lambda: propagate(lambda x: np.ones(10_000) * x, X), "50,000 searches of the surface"),
        (lambda: propagate(lambda x: x, X).plot("y", 3), "the axes are 3; give Matplotlib's"),
        (lambda: width_shares(lambda inputs: 3, X), r"two arrays, such as .*, and it returned 3$"),
        (lambda: F * "2", "holds '2'; it needs plain numbers"),
        (lambda: F + True, "holds True; it needs plain numbers"),
        (lambda: Phase("3 GPa"), "Young's modulus is '3 GPa'; a phase takes plain numbers"),
        (lambda: Phase(F), "an input of fuzzy.propagate"),
        (lambda: HermiteMap("a", 0.1, 0.2, 0.1), "radii inside"),
        (lambda: named("series").solve(RADIUS, MATRIX, STIFF), "a list of the inclusions' phases"),
        (
            lambda: named("series").solve(MATRIX, RADIUS, [STIFF]),
            "solve got Phase, HermiteMap, list",
        ),
        (lambda: named("series").solve(RADIUS, MATRIX, []), r"list \(empty\); it takes the radius"),
        (
            lambda: envelope(FRAME, {"E": F}, duration=1e6, step=1e-4),
            "10,000,000,000 steps of 0.0001",
        ),
        (lambda: named("spheres"), r"spheres are solved by alphacut\.rve\.spheres\.series"),
        (lambda: named("series", particles="spheres"), r"model\.SphereSeriesModel\(\)"),
    ],
)
def test_what_is_wrong_is_said_in_one_line(wrong, said):
    with pytest.raises((ValueError, CampaignError), match=said) as refused:
        wrong()
    assert "\n" not in str(refused.value)


def test_a_long_error_of_a_sample_is_quoted_by_its_first_line():
    def fails(x):
        raise ValueError("first line\n" + "second line " * 1000)

    with pytest.raises(CampaignError, match="ValueError: first line …") as failed:
        propagate(fails, X)
    assert len(str(failed.value)) < 1000
    assert "second line" in failed.value.failures[0][1]


def test_numpy_names_what_takes_a_fuzzy_number():
    with pytest.raises(TypeError, match=r"numpy\.exp takes no fuzzy number; .* fuzzy\.apply"):
        np.exp(F)
    with pytest.raises(TypeError, match=r"numpy\.hypot takes no fuzzy number; take propagate or"):
        np.hypot(F, 3.0)
    assert apply(np.exp, F).support == pytest.approx((np.e, np.e**3))
    assert (np.float64(2) * F).support == (2, 6)
    assert (F - np.float64(1)).support == (0, 2)
    assert [x.support for x in np.array([1.0, 2.0]) * F] == [(1, 3), (2, 6)]


def test_text_with_units_is_read_by_the_function_that_the_message_names():
    assert quantity.fuzzy("[1, 2, 3] kN", "N") == Triangular(1000, 2000, 3000)
    assert quantity.fuzzy("2 ± 0.1 kN", "N").support == pytest.approx((1900, 2100))


def test_labels_of_a_pandas_object_name_the_outputs():
    pandas = pytest.importorskip("pandas")

    def model(x):
        return pandas.Series({"a": x, "b": 2 * x})

    assert propagate(model, X).outputs == ("a", "b")
    frame = propagate(lambda x: pandas.DataFrame({"a": [x, x], "b": [1, 2]}), X, alpha=[0])
    assert frame.outputs == ("a[0]", "a[1]", "b[0]", "b[1]")
    assert propagate(lambda x: pandas.Series([x, 2 * x]), X, alpha=[0]).outputs == ("y[0]", "y[1]")
