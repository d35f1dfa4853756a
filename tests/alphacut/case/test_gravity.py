"""P-Delta in a case: `frame.gravity` softens storeys, and `check` warns where it is left out."""

import json

import numpy as np
import pytest

from tests.alphacut.case.files import prepared
from tests.alphacut.small import told_by


@pytest.mark.parametrize(
    ("text", "gravity"), [("1 g", 9.80665), ("9.81 m/s^2", 9.81), ("0 m/s^2", 0.0)]
)
def test_gravity_softens_storeys(tmp_path, text, gravity):
    """Frequencies are the roots of ω⁴ m₁ m₂ − ω² (m₁ s₂ + m₂ (s₁ + s₂)) + s₁ s₂ = 0."""
    case = prepared(tmp_path, "gravity", {"# GRAVITY": f'gravity = "{text}"'})
    told_by("check", case, f"--json={tmp_path}/check.json")
    period = json.loads((tmp_path / "check.json").read_text())["period_s"]
    # weight over height of the storeys: 294.2 and 98.07 kN/m
    m1, m2, k2 = 60e3, 30e3, 5e6
    s1 = 2.03e6 - (m1 + m2) * gravity / 3
    s2 = k2 - m2 * gravity / 3
    half = (m1 * s2 + m2 * (s1 + s2)) / 2
    square = (half - (half**2 - m1 * m2 * s1 * s2) ** 0.5) / (m1 * m2)
    assert 2 * np.pi / period == pytest.approx(square**0.5, rel=1e-12)
