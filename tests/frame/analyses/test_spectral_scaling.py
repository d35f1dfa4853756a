"""Records scaled to a target: known factors, floors between the periods compared, refusals."""

import numpy as np
import pytest

from alphacut.frame import (
    Accelerogram,
    StoreyFrame,
    TargetSpectrum,
    eurocode8_spectrum,
    read_suite,
    response_spectrum,
    scale_suite,
)
from tests.refused import refuses

SUITE = read_suite("cases/suite/record-200[1-4].AT2", baseline="mean")


@pytest.mark.parametrize("fit", ["record", "suite", "period"])
def test_a_record_reaches_its_own_spectrum_by_the_factor_that_made_it(fit):
    periods = np.geomspace(0.05, 4.0, 800)
    target = TargetSpectrum(periods, 2.5 * response_spectrum(SUITE[0], periods))
    scaled = scale_suite(SUITE[:1], target, 0.8, fit=fit)
    assert scaled.factors["record-2001"] == pytest.approx(2.5, rel=2e-3)
    assert scaled.suite[0].samples == pytest.approx(2.5 * SUITE[0].samples, rel=2e-3)


@pytest.mark.parametrize(("fit", "period"), [("record", 0.5), ("suite", 1.5)])
def test_the_mean_keeps_the_floors_of_en_1998_between_the_periods_compared(fit, period):
    target = eurocode8_spectrum(2.5, "C")
    scaled = scale_suite(SUITE, target, period, fit=fit)
    periods = np.append(0.0, np.linspace(0.2 * period, 2 * period, 400))
    mean = np.mean([response_spectrum(record, periods) for record in scaled.suite], axis=0)
    at_zero, *ratios = mean / target(periods)
    # One of the floors is reached, since both suites had to be raised.
    assert min(at_zero, min(ratios) / 0.9) == pytest.approx(1.0, abs=5e-3)
    assert "the floor at T = " in scaled.words()
    assert (len(set(scaled.factors.values())) == 1) == (fit == "suite")


def test_at_a_period_each_record_has_the_value_of_the_target():
    frame = StoreyFrame([50e3], stiffness=[8e6], damping_ratio=0.05)
    period = 2 * np.pi * np.sqrt(50e3 / 8e6)
    target = eurocode8_spectrum(2.0, "B", damping=0.03)
    scaled = scale_suite(SUITE, target, frame, fit="period")
    sizes = [response_spectrum(record, period, 0.03) for record in scaled.suite]
    assert sizes == pytest.approx([float(target(period))] * 4)
    assert [row["Sa/target at T1"] for row in scaled.records()] == pytest.approx([1.0] * 5)


@pytest.mark.parametrize(
    ("wrong", "key"),
    [
        ({"period": 2.5}, "period"),
        ({"period": 0.0}, "period"),
        ({"fit": "best"}, "fit"),
        ({"over": (1.5, 2.0)}, "over"),
        ({"suite": [Accelerogram(0.01, np.zeros(9))]}, "suite"),
    ],
)
def test_what_cannot_be_scaled_is_one_line(wrong, key):
    right = {"suite": SUITE, "target": eurocode8_spectrum(2.0, "B"), "period": 0.5}
    with refuses(key):
        scale_suite(**(right | wrong))
