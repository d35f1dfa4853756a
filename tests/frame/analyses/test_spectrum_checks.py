"""Limits under a response spectrum, and its errors under records."""

import numpy as np
import pytest

from alphacut.frame import (
    Accelerogram,
    Limit,
    StoreyFrame,
    drift_sensitivity,
    envelope,
    eurocode8_spectrum,
    record_spectrum,
    spectrum_accuracy,
    spectrum_checks,
    spectrum_response,
)
from alphacut.frame.modes.spectral_modes import spectral_modes
from alphacut.frame.spectra.modal_combination import Combination
from alphacut.fuzzy import Interval, Triangular
from tests.refused import refuses

SPECTRUM = eurocode8_spectrum(2.0, "C", q=3.0)


def three_storeys(**more):
    return StoreyFrame(
        masses=[5e4, 5e4, 5e4],
        stiffness=[9e7, 8e7, 7e7],
        lengths=[3.5, 3.0, 3.0],
        damping_ratio=0.05,
        outputs=("drift1", "drift3", "base_shear", "shear1"),
        **more,
    )


@pytest.fixture
def inputs(rng):
    radius = rng.uniform(0.02, 0.1, 2)
    return {
        "k1": Interval(*(9e7 * (1 + radius[0] * np.array([-1, 1])))),
        "m3": Triangular(*(5e4 * (1 + radius[1] * np.array([-1, 0, 1])))),
    }


def test_verdicts_are_those_of_samples(inputs, rng):
    frame = three_storeys()
    found = spectrum_response(frame, inputs, SPECTRUM, alpha=[0.0])
    names = tuple(inputs)
    ends = np.array([number.cut(0.0) for number in inputs.values()])
    method = Combination(SPECTRUM, "CQC", None, False)
    points = rng.uniform(*ends.T, (300, 2))
    samples = method.combined(spectral_modes(frame, names, points, method.modes))
    drift, shear = 3 * samples[:, 0], samples[:, 2]
    middle = (drift.min() + drift.max()) / 2
    limits = {0.95 * drift.min(): "exceeded", middle: "can be exceeded"}
    limits[1.02 * found.proved[0, 0, 1] * 3] = "not exceeded"
    for value, verdict in limits.items():
        checks = spectrum_checks(found, [Limit("drift1", value)], displacement_factor=3.0)
        part = checks.limits["drift1"]
        assert part.verdict == verdict
        assert part.peak_bound >= drift.max()
        if verdict == "can be exceeded":
            at = [list(part.peak.reached_at.values())]
            here = (
                3 * method.combined(spectral_modes(frame, names, np.array(at), method.modes))[0, 0]
            )
            assert here == pytest.approx(part.attained_peak)
            assert here > value
            assert "k1 = " in part.verdict_and_motion
    for floor, verdict in {
        0.95 * shear.min(): "not exceeded",
        (shear.min() + shear.max()) / 2: "can be exceeded",
        1.03 * shear.max(): "exceeded",
    }.items():
        checks = spectrum_checks(found, base_shear_floor=floor)
        assert checks.limits["min base_shear"].verdict == verdict
        needed = floor / shear.min()
        if needed > 1:
            text = checks.words().split("at most ")[1]
            assert needed <= float(text.split(",")[0]) <= 1.02 * needed
        else:
            assert "no factor" in checks.words()


@pytest.mark.parametrize("modulus", [None, 30e9])
def test_sensitivity_coefficients_are_weight_times_drift_over_shear_and_height(
    modulus, inputs, rng
):
    columns = {"second_moment": [9e-4] * 3, "modulus": modulus} if modulus else {}
    stiffness = {} if modulus else {"stiffness": [9e7, 8e7, 7e7]}
    heights = [3.5, 3.0, 3.0]
    names = ("drift1", "drift2", "drift3", "shear1", "shear2", "shear3")
    frame = StoreyFrame(masses=[5e4] * 3, lengths=heights, outputs=names, **columns, **stiffness)
    uncertain = {"l2": Interval(2.9, 3.2), "m3": inputs["m3"]}
    uncertain |= {"E": Interval(28e9, 33e9)} if modulus else {"k1": inputs["k1"]}
    found = drift_sensitivity(frame, uncertain, alpha=[0.0, 1.0], displacement_factor=2.5)
    method = Combination(SPECTRUM, "CQC", None, False)
    ends = np.array([number.cut(0.0) for number in uncertain.values()])
    points = np.vstack(
        [rng.uniform(*ends.T, (100, 3)), np.stack(np.meshgrid(*ends), -1).reshape(-1, 3)]
    )
    peaks = method.combined(spectral_modes(frame, tuple(uncertain), points, method.modes))
    heights = np.array([heights] * len(points))
    heights[:, 1] = points[:, 0]
    masses = np.full((len(points), 3), 5e4)
    masses[:, 2] = points[:, 1]
    weights = 9.80665 * masses[:, ::-1].cumsum(axis=1)[:, ::-1]
    theta = weights * 2.5 * peaks[:, :3] / (peaks[:, 3:] * heights)
    for z, peak in enumerate(found.values()):
        assert peak.upper[0] == pytest.approx(theta[:, z].max(), rel=1e-9)
        assert peak.lower[0] == pytest.approx(theta[:, z].min(), rel=1e-9)
        assert peak.upper[1] <= peak.upper[0]


@pytest.mark.parametrize(
    ("factor", "words"),
    [
        (1.0, "need not be"),
        (8.0, "1/(1 − θ)"),
        (14.0, "second-order analysis"),
        (30.0, "more than"),
    ],
)
def test_the_code_says_what_a_sensitivity_asks_for(factor, words):
    frame = three_storeys()
    theta = drift_sensitivity(frame, {"k1": 9e7 / 4}, alpha=[1.0], displacement_factor=factor)
    found = spectrum_response(frame, {"k1": 9e7 / 4}, SPECTRUM, alpha=[1.0])
    checks = spectrum_checks(found, theta=theta)
    assert words in checks.words()
    largest = float(theta["theta1"].upper[0])
    assert checks.limits["theta1"].verdict == ("exceeded" if largest > 0.3 else "not exceeded")
    assert checks.table().rows[0][0] == "|theta1| ≤ 0.3"


def test_the_errors_under_records_are_those_of_exact_motions(rng):
    frame = three_storeys()
    found = spectrum_response(frame, {"k1": Interval(8.8e7, 9.2e7)}, SPECTRUM, alpha=[0.0])
    noise = np.cumsum(rng.normal(size=(2, 100)), axis=1)
    suite = [Accelerogram(0.02, x * np.hanning(100), name=f"r{k}") for k, x in enumerate(noise)]
    answer = spectrum_accuracy(frame, found, suite, step=0.01)
    for r, record in enumerate(suite):
        moved = frame.moved_by(record)
        band = envelope(moved, {"k1": 9e7}, duration=3.0, step=0.002, alpha=[1.0], progress=False)
        peaks = np.maximum(band.upper, -band.lower)[0].max(axis=0)
        spectrum = record_spectrum(record, found.modes.periods[0][::-1])
        combined = spectrum_response(frame, {"k1": 9e7}, spectrum, alpha=[1.0]).nominal
        error = combined / peaks - 1
        assert (answer.errors[r, :, 0] <= error + 1e-3).all()
        assert (error - 1e-3 <= answer.errors[r, :, 1]).all()
        assert (np.ptp(answer.errors[r], axis=1) < 0.02).all()
    low, high = 100 * answer.errors.min(), 100 * answer.errors.max()
    assert f"{np.floor(low):+.0f} … {np.ceil(high):+.0f} %".replace("-", "−") in answer.words()
    assert answer.records()[1]["record"] == "r1"
    assert answer.table().head[1] == "errs by"


@pytest.mark.parametrize(
    ("arguments", "key"),
    [
        ({}, "limits"),
        ({"limits": [Limit("q1", 0.1)]}, "limits"),
        ({"limits": [Limit("drift1", 0.1, largest=True)]}, "limits"),
        ({"base_shear_floor": -1.0}, "base_shear_floor"),
        ({"limits": [Limit("drift1", 0.1)], "displacement_factor": 0.0}, "displacement_factor"),
    ],
)
def test_checks_that_make_no_sense_are_refused(arguments, key):
    found = spectrum_response(three_storeys(), {"k1": 9e7}, SPECTRUM, alpha=[1.0])
    with refuses(key):
        spectrum_checks(found, **arguments)
    bare = StoreyFrame(masses=[1e4], stiffness=[4e6])
    with refuses("lengths"):
        drift_sensitivity(bare, {"k1": 4e6}, alpha=[1.0])
