"""The benchmarks' functions in small."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.frame import certificate as frame_certificate
from benchmarks.frame import envelopes as frame_envelopes
from benchmarks.frame import failures as frame_failures
from benchmarks.frame import integrators as frame_integrators


@pytest.mark.slow
def test_envelope_benchmark_ranks_the_methods(tmp_path: Path) -> None:
    wanted = [
        m for m in frame_envelopes.METHODS if m[1] in ("modal", "vertex", "improved-graph-follower")
    ]
    rows = list(frame_envelopes.measured(8.0, 0.1, 1e-6, wanted, ("L-BFGS-B",)))
    error = {row["method"]: row["error_m"] for row in rows}
    assert (
        error["modal"]
        < error["Graph Follower, improved"]
        < error["transformation, general"]
        < error["vertex"]
    )
    assert error["SciPy L-BFGS-B"] < 1e-4
    assert set(error) <= set(frame_envelopes.LOOKS)
    frame_envelopes.draw(rows, tmp_path / "figure.svg")
    assert (tmp_path / "figure.svg").stat().st_size > 1000


def test_integrator_benchmark_measures_every_integrator(tmp_path: Path) -> None:
    rows = list(frame_integrators.errors([0.1, 0.05], 3.0))
    assert {row["integrator"] for row in rows} == {"midpoint", "rk4", "gauss4", "exact"}
    drift = frame_integrators.drift(2000, 0.01)
    assert drift["midpoint"][-1] < 1e-11
    assert drift["rk4"][-1] > 1e-10
    frame_integrators.draw(rows, drift, 2000, tmp_path / "figure.png")
    assert (tmp_path / "figure.png").stat().st_size > 1000


def test_integrator_benchmark_measures_the_declared_stability_limits() -> None:
    for name, limit in frame_integrators.stability_limits().items():
        assert limit == pytest.approx(frame_integrators.COMPARED[name].stability_limit, abs=0.01)


def test_certificate_benchmark_finds_no_trajectory_outside() -> None:
    row = frame_certificate.measured(6.0, 0.2, 1e-6, 3000, 1)
    assert row["gap"] <= 1.001e-6
    assert row["outside"] < 0
    assert row["beyond_inner"] < 1e-6


def test_failures_grow_with_the_width_of_the_supports(tmp_path: Path) -> None:
    rows = list(frame_failures.measured([(2, 0.02), (2, 0.2)], duration=4.0, every=1.0))
    assert {row["method"] for row in rows} == set(frame_failures.METHODS)
    assert len(rows) == 2 * 2 * 5
    assert max(row["error_m"] for row in rows) < 0.05
    assert frame_failures.inputs(16, 0.1)["v1_0"].cut(0) == pytest.approx((-0.05, 0.05))
    frame_failures.draw(rows, rows, tmp_path / "figure.png")
    assert (tmp_path / "figure.png").stat().st_size > 1000
