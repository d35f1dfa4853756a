"""Storeys with other numbers of columns, or stiffer ones, than two alike."""

from __future__ import annotations

import numpy as np
import pytest

from alphacut.frame import Exact, LinearFlow, StoreyFrame, envelope
from alphacut.frame.structures.linear import frequencies
from alphacut.fuzzy import Interval, Triangular

MASSES, LENGTHS = (10e3, 20e3, 5e3), (3.0, 4.0, 2.5)


def test_frequencies_are_those_of_the_chain_of_springs() -> None:
    columns = (4.0, 3.0, 1.0)
    k = [12 * c * 25e9 * 1e-5 / length**3 for c, length in zip(columns, LENGTHS, strict=True)]
    stiffness = np.array([[k[0] + k[1], -k[1], 0], [-k[1], k[1] + k[2], -k[2]], [0, -k[2], k[2]]])
    exact = np.sqrt(np.sort(np.linalg.eigvals(np.diag(1 / np.array(MASSES)) @ stiffness).real))
    assert frequencies(StoreyFrame(MASSES, LENGTHS, 25e9, 1e-5, columns=columns)) == pytest.approx(
        exact, rel=1e-12
    )


def test_two_columns_are_meant_where_nothing_is_said() -> None:
    assert (
        frequencies(StoreyFrame(MASSES, LENGTHS, 25e9, 1e-5)).tolist()
        == frequencies(StoreyFrame(MASSES, LENGTHS, 25e9, 1e-5, columns=(2, 2, 2))).tolist()
    )


def test_shears_and_certificates_know_of_the_columns() -> None:
    four, two = (
        StoreyFrame(
            MASSES, LENGTHS, 25e9, 1e-5, q0=(0.01, 0.02, 0.03), outputs=("q3", "shear2"), columns=c
        )
        for c in ((4,) * 3, ())
    )
    double = StoreyFrame(
        MASSES, LENGTHS, 25e9, 2e-5, q0=(0.01, 0.02, 0.03), outputs=("q3", "shear2")
    )
    inputs = {"E": Triangular(24e9, 25e9, 26e9), "l2": Interval(3.95, 4.05)}
    found, same, other = (
        envelope(f, inputs, duration=2, step=0.05, alpha=(0,), method="modal", certify=1e-4)
        for f in (four, double, two)
    )
    assert found.nature == "guaranteed"
    assert np.abs(found.upper - same.upper).max(1)[0] == pytest.approx(0, abs=1e-3)
    assert np.abs(found.upper - other.upper)[0, :, 0].max() > 0.01


@pytest.mark.parametrize(
    ("columns", "pattern"),
    [((2, 2), "columns: 2 values for 3 floors"), ((2, 0, 2), "columns: 0 is not allowed")],
)
def test_columns_that_make_no_sense_are_refused(columns: tuple[float, ...], pattern: str) -> None:
    with pytest.raises(ValueError, match=pattern):
        StoreyFrame(MASSES, LENGTHS, 25e9, 1e-5, columns=columns)


def test_the_shear_of_a_storey_is_its_stiffness_times_its_drift():
    frame = StoreyFrame(
        masses=[2e4, 1e4],
        lengths=[3.0, 2.5],
        modulus=25e9,
        second_moment=1e-6,
        q0=[0.01, 0.03],
        outputs=("shear1", "shear2", "drift2"),
    )
    start = LinearFlow(frame, (), 1, 0.01, Exact()).values(np.zeros((1, 0)))[0, 0]
    stiffness = 24 * 25e9 * 1e-6 / np.array([3.0, 2.5]) ** 3
    np.testing.assert_allclose(start, [stiffness[0] * 0.01, stiffness[1] * 0.02, 0.02], rtol=1e-12)


def test_each_storey_can_be_uncertain_by_its_columns() -> None:
    inputs = {"c1": Interval(1.9, 2.1), "c3": Interval(1.9, 2.1)}
    frame = StoreyFrame(MASSES, LENGTHS, 25e9, 1e-5, q0=(0.01, 0.02, 0.03), outputs=("q3",))
    found = envelope(frame, inputs, duration=2, step=0.05, alpha=(0,), method="modal", certify=1e-4)
    assert found.nature == "guaranteed"
    for c in ((1.9, 2, 2.1), (2.05, 2, 1.95)):
        other = StoreyFrame(
            MASSES, LENGTHS, 25e9, 1e-5, q0=(0.01, 0.02, 0.03), outputs=("q3",), columns=c
        )
        motion = LinearFlow(other, ("E",), 2, 0.05, Exact()).values(np.array([[25e9]]))[0]
        assert (motion >= found.lower[0] - 1e-12).all()
        assert (motion <= found.upper[0] + 1e-12).all()
    with pytest.raises(ValueError, match=r"c1: its support .* must be positive"):
        envelope(frame, {"c1": Interval(-0.1, 2)}, duration=2, step=0.05)
