"""Fuzzy fields: the range of a sum is known, and the limits of long and short distances."""

from __future__ import annotations

import numpy as np
import pytest

from alphacut.fuzzy import Optimisation, propagate
from alphacut.fuzzy.field import FuzzyField

PLACES = (3.0, 6.0, 9.0, 12.0)


def field(length: float, share: float = 1.0) -> FuzzyField:
    return FuzzyField("k", PLACES, 10.0, 2.0, length, share)


def test_the_range_of_a_sum_is_exact() -> None:
    storeys = field(5.0)

    def total(**directions: float) -> float:
        return float(sum(storeys.values(**directions)))

    found = propagate(
        total,
        storeys.inputs,
        Optimisation(),
        alpha=[0.0, 0.5],
        interactions=[storeys.interaction],
    )
    z = np.array(PLACES)
    reach = 2 * np.sqrt(np.exp(-np.abs(z[:, None] - z) / 5.0).sum())
    assert found.lower[:, 0] == pytest.approx([40 - reach, 40 - reach / 2], rel=1e-3)
    assert found.upper[:, 0] == pytest.approx([40 + reach, 40 + reach / 2], rel=1e-3)


def test_each_place_keeps_its_interval_where_nothing_is_left_out() -> None:
    storeys = field(5.0)
    assert storeys.left_out == pytest.approx(0.0, abs=1e-12)
    rng = np.random.default_rng()
    ball = rng.normal(size=(20000, 4))
    ball /= np.linalg.norm(ball, axis=1, keepdims=True)
    values = np.array(storeys.values(**dict(zip(storeys.names, ball.T, strict=True))))
    assert np.abs(values - 10).max() <= 2 + 1e-12
    assert np.abs(values - 10).max(1) == pytest.approx(2, abs=0.1)


def test_few_directions_hold_a_long_field_and_say_what_they_leave_out() -> None:
    long, short = field(1e6, 0.95), field(1e-3, 0.95)
    assert len(long.names) == 1
    assert np.ptp(np.array(long.values(k_1=1.0))) < 1e-3  # storeys move together
    assert len(short.names) == 4
    few = field(8.0, 0.8)
    assert 1 <= len(few.names) < 4
    assert 0 < few.left_out < 0.3
    norms = np.linalg.norm(few.shapes, axis=1)
    assert 1 - norms.min() == pytest.approx(few.left_out)


@pytest.mark.parametrize(
    "change", [{"length": 0.0}, {"share": 1.5}, {"half_width": -1.0}, {"places": ()}]
)
def test_numbers_without_a_meaning_are_refused(change: dict[str, object]) -> None:
    given = {"places": PLACES, "centre": 1.0, "half_width": 0.1, "length": 1.0} | change
    with pytest.raises(ValueError, match="field k: "):
        FuzzyField("k", **given)  # type: ignore[arg-type]
