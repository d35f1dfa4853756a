"""The benchmark of plans, optimisers and packages, on the problem that costs least."""

import numpy as np

from benchmarks.fuzzy import bounds as fuzzy_bounds


def test_benchmark_counts_evaluations_and_reaches_the_goal(tmp_path, monkeypatch):
    monkeypatch.setattr(fuzzy_bounds, "LIMIT", 2000)
    monkeypatch.setattr(fuzzy_bounds, "scipy_efforts", lambda name: (2,))
    problem = fuzzy_bounds.PROBLEMS[-1]
    rows = {row.method: row for row in fuzzy_bounds.measure(problem)}
    assert rows["alphacut: signed, signs stated"].evaluations == 9
    assert rows["alphacut: reduced"].evaluations == 33
    assert rows["alphacut: general"].evaluations == 225
    assert all(
        row.error <= fuzzy_bounds.GOAL for row in rows.values() if np.isfinite(row.evaluations)
    )
    assert rows["SciPy: differential_evolution"].evaluations > 100
    fuzzy_bounds.draw(list(rows.values()), tmp_path / "bounds.png")
    assert (tmp_path / "bounds.png").stat().st_size > 10_000
