"""The tolerance of an envelope, as a fraction of each peak."""

import pytest

from tests.alphacut.small import told_by

CASE = """
title = "Columns far from yielding"
stages = ["envelope"]
shares = false
[frame]
masses = "20 t"
lengths = "3 m"
stiffness = "20 MN/m"
yield_force = "1 MN"
damping_ratio = "5 %"
outputs = ["q1", "residual1"]
[[force]]
history = "step"
amplitude = {1 = "[9, 10, 11] kN"}
[envelope]
fuzzy = "F1"
alpha = [0, 1]
duration = "0.2 s"
step = "0.01 s"
tolerance = "5 %"
"""


@pytest.fixture
def case(tmp_path):
    path = tmp_path / "case.toml"
    path.write_text(CASE)
    return str(path)


def test_an_output_that_stays_zero_keeps_every_tolerance(case, tmp_path):
    """A residual drift without yielding has no peak that its error, zero, were a fraction of."""
    assert "residual1" in told_by("run", case, "--out", tmp_path / "out", "--no-figures")


def test_a_larger_error_fails_by_its_output(case, tmp_path):
    """The peak between nodes is known to a few thousandths."""
    options = ["--out", str(tmp_path / "out"), "--no-figures", "--set", "envelope.tolerance=1e-7"]
    assert "the error of q1 is" in told_by("run", case, *options, status=1)
