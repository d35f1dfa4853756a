"""Certificates of random frames, half of them under cut and odd records, against trajectories."""

from __future__ import annotations

from typing import Any

import pytest

from benchmarks.frame.random_certificates import judged


def hold(row: dict[str, Any]) -> bool:
    return row["violation"] <= 0 and row["disagreement"] <= row["gap"]


@pytest.mark.parametrize("seed", [1, 8])
def test_no_trajectory_leaves_a_certificate(seed: int) -> None:
    assert hold(judged(seed, (200, 500)))


@pytest.mark.slow
def test_no_trajectory_leaves_the_certificates_of_random_frames() -> None:
    """All 100, with 100,000 trajectories: python -m benchmarks.frame.random_certificates."""
    rows = [judged(seed, (2000, 20_000)) for seed in range(100, 110)]
    proved = [row for row in rows if row["violation"] == row["violation"]]
    assert len(proved) >= 8
    assert all(map(hold, proved))
