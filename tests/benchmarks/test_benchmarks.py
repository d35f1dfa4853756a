"""Tables that say when they are wrong: the paper's numbers, relations of problems, PETSc options."""

import json
from pathlib import Path

import numpy as np
import pytest

from benchmarks.paper import main
from benchmarks.relations.__main__ import KINDS

GOLDEN = Path(__file__).parents[1] / "scenes" / "golden.json"


def test_the_table_has_every_number_and_fails_beyond_a_twentieth(tmp_path, capsys):
    paper = json.loads(GOLDEN.read_text(encoding="utf-8"))["paper"]
    summary = tmp_path / "summary.json"
    summary.write_text(json.dumps(paper), encoding="utf-8")
    assert main([str(summary)]) == 0
    table = capsys.readouterr().out.splitlines()
    assert len(table) == 2 + 11
    assert table[2].startswith("| E, most plausible | section 4.3 | 24.7561 GPa | 24.7733 GPa |")
    paper["envelopes"]["E-5s"]["min"]["q1"] *= 1.06
    summary.write_text(json.dumps(paper), encoding="utf-8")
    assert main([str(summary)]) == 1


@pytest.mark.parametrize("kind", KINDS)
def test_a_random_problem_said_otherwise_gives_no_contradiction(kind):
    chance, of = np.random.default_rng(62), KINDS[kind]
    relations = [x for x in of.relations if "processes" not in x.name]
    chosen = [relations[k] for k in chance.permutation(len(relations))[:3]]
    problem = of.drawn(chance)
    quicker = {"workers": 1, "nodes": 10}
    problem |= {name: value for name, value in quicker.items() if name in problem}
    found = dict(of.checked(problem, chance, chosen))
    assert not {name: lines for name, lines in found.items() if lines}


@pytest.mark.slow
def test_bounds_of_random_cells_hold_at_the_edges_of_what_is_allowed(rng, capsys):
    pytest.importorskip("alphacut.rve.fenicsx")
    pytest.importorskip("gmsh")
    from benchmarks.rve import extreme_cells

    wrong = extreme_cells.run(20, int(rng.integers(2**32)), None)
    assert wrong == 0, capsys.readouterr().out


def test_options_agree_in_e_or_say_why_there_is_none(monkeypatch, capsys):
    pytest.importorskip("alphacut.rve.fenicsx")
    from benchmarks.rve import solvers

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
