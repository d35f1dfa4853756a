"""One result: its fields are checked, attained bounds lie inside proved ones, it prints itself."""

from dataclasses import replace

import numpy as np
import pytest

from alphacut.fuzzy import (
    Bounds,
    FailedError,
    General,
    Interval,
    Nature,
    Reduced,
    RefusedError,
    Signed,
    Triangular,
    propagate,
)
from tests.refused import refuses

ALPHA = np.array([0.0, 1.0])


def bounds(*, time=None, **changes):
    """Bounds of x² over the cuts of x = (1, 2, 4), the same at every node of time."""
    lower, upper = np.array([[1.0], [4.0]]), np.array([[16.0], [4.0]])
    places = np.sqrt(lower)[..., None], np.sqrt(upper)[..., None]
    tables = dict(lower=lower, upper=upper, error=0 * lower)
    tables |= dict(lower_at=places[0], upper_at=places[1])
    if time is not None:
        tables = {name: np.repeat(x[:, None], len(time), axis=1) for name, x in tables.items()}
    facts = dict(outputs=("y",), inputs={"x": Triangular(1, 2, 4)}, method="general")
    return Bounds(
        **{"alpha": ALPHA, "nature": Nature.ATTAINED, "time": time} | facts | tables | changes
    )


@pytest.mark.parametrize(
    "changes",
    [
        dict(alpha=np.array([0.0, 2.0])),
        dict(alpha=np.array([1.0, 0.0])),
        dict(lower=np.array([[1.0], [np.nan]])),
        dict(error=np.array([[-1.0], [0.0]])),
        dict(error=np.array([[np.nan], [0.0]])),  # only of proved bounds
        dict(outputs=("y", "z")),
        dict(units=("m", "m")),
    ],
)
def test_values_without_a_meaning_are_refused(changes):
    with pytest.raises(RefusedError):
        bounds(**changes)


def test_cuts_that_are_not_nested_are_a_failure():
    with pytest.raises(FailedError, match="not nested"):
        bounds(lower=np.array([[4.1], [3.9]]), upper=np.array([[16.0], [16.0]]))
    with pytest.raises(FailedError, match="above"):
        bounds(lower=np.array([[1.0], [4.1]]))


@pytest.mark.parametrize("nature", list(Nature))
def test_ends_that_rounding_crosses_are_put_in_order(nature):
    found = bounds(lower=np.array([[1.0], [4.0 + 1e-12]]), nature=nature, error=np.zeros((2, 1)))
    assert (found.lower <= found.upper).all()
    assert found.lower[1, 0] == 4.0
    assert found.upper[1, 0] == 4.0 + 1e-12


@pytest.mark.parametrize("method", [None, General(), Reduced(), Signed()])
def test_crisp_inputs_attain_one_value_and_prove_nothing(method):
    """Rump's function, whose evaluation has no right digit."""

    def rump(a, b):
        return (333.75 - a**2) * b**6 + a**2 * (11 * a**2 * b**2 - 121 * b**4 - 2) + 5.5 * b**8

    inputs = {"a": 77617.0, "b": Interval(33096, 33096)}
    found = propagate(rump, inputs, method, progress=False)
    assert found.nature is Nature.ATTAINED
    assert "signs" not in str(found)
    assert len(set(found.lower.ravel())) == 1


@pytest.mark.parametrize("time", [None, np.array([0.0, 0.5, 1.0])])
def test_attained_bounds_lie_inside_proved_ones_but_for_the_error_of_the_scheme(time):
    found = bounds(time=time)
    outer = found.attained._replace(lower=found.lower + 0.1, upper=found.upper - 0.1)
    with pytest.raises(FailedError, match="attained bounds lie outside the proved ones: of y"):
        replace(found, outer=outer)
    replace(found, outer=outer, error=np.full(found.lower.shape, 0.2))
    proved = replace(found, nature=Nature.GUARANTEED)
    with pytest.raises(FailedError, match="attained bounds lie outside the proved ones: of y"):
        replace(proved, inner=found.attained._replace(lower=found.lower - 0.1))
    both = replace(
        proved, inner=found.attained._replace(lower=found.lower + 0.1, upper=found.upper - 0.1)
    )
    assert (both.proved.lower == found.lower).all()
    assert (both.attained.upper < found.upper).all()
    # bounds may miss each other by a billionth of 16, the output's size, and by no more
    replace(proved, inner=found.attained._replace(upper=found.upper + 0.5 * 16e-9))
    with pytest.raises(FailedError, match="lie outside"):
        replace(proved, inner=found.attained._replace(upper=found.upper + 2 * 16e-9))


def test_a_range_at_each_time_is_no_number():
    assert bounds().number("y").cut(0) == (1, 16)
    with refuses("y"):
        bounds(time=np.array([0.0, 1.0])).number("y")


def test_text_and_dataset_say_nature_error_and_unit():
    for time in (None, np.array([0.0, 1.0])):
        found = bounds(time=time, units=("mm",), evaluations=12)
        assert "bounds attained" in str(found)
        assert "12 evaluations" in str(found)
        assert "y [mm], α = 0: 1 … 16 or wider" in str(found)
        with refuses("output"):
            found.bounds("z")
        dataset = found.to_dataset()
        assert float(dataset.upper.max()) == 16
        assert dataset.nature.item() == "attained"
