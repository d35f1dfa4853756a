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
