"""The table of PETSc options: each gives E of the default, or says that it does not converge."""

import pytest

pytest.importorskip("alphacut.rve.fenicsx")

from benchmarks.rve import solvers


def test_options_agree_in_e_or_say_why_there_is_none(monkeypatch, capsys):
    bad = {"too few": {"pc_type": "icc", "ksp_max_it": "3"}, "none": {"pc_type": "ml"}}
    monkeypatch.setattr(solvers, "SOLVERS", solvers.SOLVERS | bad)
    rows = [solvers.timing(name, 0.5, layers=4, repeat=1) for name in solvers.SOLVERS]
    assert not list(solvers.compare(rows))
    outcomes = {row.solver: row.outcome for row in rows}
    assert outcomes.pop("too few") == "does not converge"
    assert outcomes.pop("none") == "is not in PETSc"
    assert outcomes["theta"] == outcomes["ICC"] == "converges"
    table = capsys.readouterr().out
    assert all(name in table for name in outcomes)
    assert "too few                 1326 does not converge" in table


def test_another_e_is_a_fault(capsys):
    right = solvers.Timing("theta", 40_000, 1.0, 1.0, 4, 25e9)
    wrong = solvers.Timing("ICC", 40_000, 1.0, 1.0, 90, 25.001e9)
    fast = solvers.Timing("MUMPS", 40_000, 2.0, 1.0, 1, 25e9)
    assert [fault.split(" is ")[0] for fault in solvers.compare([right, wrong, fast])] == [
        "E of ICC",
        "MUMPS",
    ]
