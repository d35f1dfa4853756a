"""Storeys with other numbers of columns, or stiffer ones, than two alike."""

import numpy as np
import pytest

from alphacut.frame import Exact, LinearFlow, StoreyFrame
from alphacut.frame.structures.linear import frequencies

MASSES, LENGTHS = (10e3, 20e3, 5e3), (3.0, 4.0, 2.5)


def test_frequencies_are_those_of_the_chain_of_springs() -> None:
    columns = (4.0, 3.0, 1.0)
    k = [12 * c * 25e9 * 1e-5 / length**3 for c, length in zip(columns, LENGTHS, strict=True)]
    stiffness = np.array([[k[0] + k[1], -k[1], 0], [-k[1], k[1] + k[2], -k[2]], [0, -k[2], k[2]]])
    exact = np.sqrt(np.sort(np.linalg.eigvals(np.diag(1 / np.array(MASSES)) @ stiffness).real))
    assert frequencies(StoreyFrame(MASSES, LENGTHS, 25e9, 1e-5, columns=columns)) == pytest.approx(
        exact, rel=1e-12
    )


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
