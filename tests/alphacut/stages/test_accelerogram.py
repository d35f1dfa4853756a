"""Records of the ground's acceleration as they are read."""

from __future__ import annotations

from pathlib import Path

import pytest

from alphacut.stages.vibration.accelerogram import accelerogram


def test_rounded_times_do_not_shift_the_end_of_a_record(tmp_path: Path) -> None:
    rows = "".join(f"{k / 30:.9f},{k % 7 - 3}\n" for k in range(901))
    file = tmp_path / "record.csv"
    file.write_text(f"time [s],acceleration [m/s^2]\n{rows}")
    found = accelerogram(file)
    assert found.step * 900 == pytest.approx(30, abs=1e-9)
    assert len(found.acceleration) == 901
