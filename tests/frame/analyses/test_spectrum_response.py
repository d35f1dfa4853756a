"""The response-spectrum method: modes and combinations by hand, and its range over inputs."""

import numpy as np
import pytest
import scipy.linalg

from alphacut.frame import (
    MatrixStructure,
    StoreyFrame,
    TargetSpectrum,
    eurocode8_spectrum,
    spectrum_response,
)
from alphacut.fuzzy import Interval, RefusedError

SPECTRUM = eurocode8_spectrum(2.0, "B")


def by_hand(frame, spectrum, combination, ratios):
    """Combined peaks of drift1, q of the top and the base shear, mode by mode."""
    k = np.append(frame.stiffness, 0.0)
    K = np.diag(k[:-1] + k[1:]) - np.diag(k[1:-1], 1) - np.diag(k[1:-1], -1)
    squares, shapes = scipy.linalg.eigh(K, np.diag(frame.masses))
    total = np.zeros(3)
    peaks = []
    for square, shape in zip(squares, shapes.T, strict=True):
        displacement = shape * (shape @ frame.masses) * spectrum(2 * np.pi / square**0.5) / square
        peaks.append(displacement[[0, -1, 0]] * [1, 1, k[0]])
    for i, a in enumerate(squares**0.5):
        for j, b in enumerate(squares**0.5):
            rho = float(i == j)
            if combination == "CQC":  # Chopra, 13.7.10
                x, y, beta = ratios[i], ratios[j], a / b
                rho = 8 * (x * y) ** 0.5 * (beta * x + y) * beta**1.5
                rho /= (
                    (1 - beta**2) ** 2
                    + 4 * x * y * beta * (1 + beta**2)
                    + 4 * (x**2 + y**2) * beta**2
                )
            total += rho * peaks[i] * peaks[j]
    return total**0.5


@pytest.mark.parametrize(
    ("combination", "own_ratios"), [("SRSS", False), ("CQC", False), ("CQC", True)]
)
def test_combined_peaks_are_those_by_hand(combination, own_ratios, rng):
    ratios = rng.uniform(0.02, 0.2, 4)
    frame = StoreyFrame(
        masses=rng.uniform(2e4, 8e4, 4),
        stiffness=rng.uniform(2e7, 8e7, 4),
        damping_ratio=ratios,
        outputs=("drift1", "q4", "base_shear"),
    )
    inputs = {"k1": frame.stiffness[0]}
    found = spectrum_response(
        frame, inputs, SPECTRUM, combination=combination, own_ratios=own_ratios, alpha=[0]
    )
    used = ratios if own_ratios else np.full(4, 0.05)
    assert found.nominal == pytest.approx(by_hand(frame, SPECTRUM, combination, used), rel=1e-9)
    assert found.modes.mass_fractions.sum() == pytest.approx(1.0)
    assert found.modes.ratios[0] == pytest.approx(ratios)
    sums = found.modes.mass_fractions[0].cumsum()
    assert sums[found.sufficient_modes - 1] >= 0.9 - 1e-9
    assert not (sums[: found.sufficient_modes - 1] >= 0.9).any()


def test_modes_of_one_frequency_add_up_by_cqc_and_not_by_srss():
    twins = MatrixStructure(
        {"k": 4e6},
        mass=[(1.0, np.diag([1e4, 3e4]))],
        stiffness=[("k", np.diag([1.0, 3.0]))],
        observed={"sum": np.ones(2), "difference": np.array([1.0, -1.0])},
        ratios=[0.05],
    )
    rules = ("CQC", "SRSS")
    sum_, difference = np.transpose(
        [spectrum_response(twins, {"k": 4e6}, SPECTRUM, combination=x).nominal for x in rules]
    )
    omega = 20.0
    each = float(SPECTRUM(2 * np.pi / omega)) / omega**2
    assert sum_ == pytest.approx([2 * each, each * 2**0.5])
    assert difference == pytest.approx([0.0, each * 2**0.5], abs=1e-7 * each)


def test_the_range_of_one_storey_is_that_of_the_spectrum_between_its_corners():
    frame = StoreyFrame(masses=[1e4], stiffness=[4e6], outputs=("base_shear",))
    site = TargetSpectrum([0.1, 0.3, 0.5], [2.0, 4.0, 1.0])
    found = spectrum_response(frame, {"k1": Interval(3e6, 6e6)}, site, alpha=[0.0])
    low, high = found.attained[0, 0]
    # The periods .257 … .363 s contain the corner, at which the spectrum is largest.
    assert low == pytest.approx(1e4 * float(site(2 * np.pi * (1e4 / 3e6) ** 0.5)))
    assert 0.99 * 4e4 <= high <= 4e4
    assert found.mode_table().rows[0][:2] == ("1", "296.2 ms")


@pytest.mark.parametrize(
    ("change", "more", "word"),
    [
        ({"outputs": ("v1",)}, {}, "v1"),
        ({"outputs": ("a1",)}, {}, "a1"),
        ({"yield_force": [1e5]}, {}, "elastic"),
        ({}, {"combination": "ABS"}, "CQC"),
        ({}, {"modes": 0}, "modes"),
        ({}, {"own_ratios": True}, "damping ratio"),
        ({"stiffness": [1e3]}, {}, "period"),
    ],
)
def test_what_the_method_does_not_cover_is_refused(change, more, word):
    frame = StoreyFrame(**({"masses": [1e4], "stiffness": [4e6]} | change))
    with pytest.raises(RefusedError, match=word):
        spectrum_response(frame, {"k1": frame.stiffness[0]}, SPECTRUM, **more)
