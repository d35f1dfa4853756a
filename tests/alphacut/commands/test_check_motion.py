"""What `check` says of the motion beforehand: modes and weight."""

import json
import re

import numpy as np
import pytest

from tests.alphacut.case.files import prepared
from tests.alphacut.small import told_by


def test_modes_and_weight_are_those_of_two_equal_storeys(tmp_path):
    """ω² = k/m (3 ∓ √5) / 2; effective masses are (5 ± 2 √5) / 10 of both floors."""
    case = prepared(tmp_path, "motion")
    text = told_by("check", case, f"--json={tmp_path}/check.json")
    periods = 2 * np.pi / np.sqrt(800 * (3 - np.array([1, -1]) * np.sqrt(5)) / 2)
    shares = (5 + 2 * np.sqrt(5) * np.array([1, -1])) / 10
    for number, period, share in zip((1, 2), periods, shares, strict=True):
        row = rf"^{number} +{period:.4g} s +4.00% +{100 * share:.1f}%$"
        assert re.search(row, text, re.MULTILINE), text
    assert "total weight: 980.7 kN, of 100,000 kg" in text
    modes = json.loads((tmp_path / "check.json").read_text())["modes"]
    assert modes["periods_s"] == pytest.approx(periods.tolist(), rel=1e-9)
    assert modes["effective_masses_kg"] == pytest.approx((1e5 * shares).tolist(), rel=1e-9)
