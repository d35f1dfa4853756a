import csv

import pytest

pytest.importorskip("alphacut.rve.planar.problem")
from benchmarks.rve import charts as cell_charts
from benchmarks.rve import methods as cell_methods


def test_small_charts_are_made_whole(tmp_path, capsys):
    assert cell_charts.main(["--small", "--only", "accuracy", "--out", str(tmp_path)]) == 0
    assert {p.name for p in tmp_path.iterdir()} == {
        "cell_accuracy.csv",
        "cell_accuracy.svg",
        "cell_accuracy.png",
    }
    with (tmp_path / "cell_accuracy.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    errors = {(row["family"], row["setting"]): float(row["error"]) for row in rows}
    assert errors["series", "5 nodes"] < errors["series", "3 nodes"] < 1e-3
    assert "made in" in capsys.readouterr().out


def test_what_takes_too_long_is_marked_and_not_run():
    calls = []

    def way():
        calls.append(1)
        return 1.0, 2.0, 10

    runs = list(cell_methods.measure(("slow", [("a", way), ("b", way)]), exact=1.0, cap=5.0))
    assert [run.capped for run in runs] == [False, True]
    assert runs[1].seconds == 5.0
    assert len(calls) == 2  # one to warm up, one measured


def test_dolfinx_mpc_agrees_with_elimination():
    pytest.importorskip("dolfinx_mpc")
    from benchmarks.rve.mpc import mpc_modulus

    ours, _, _ = cell_methods.slices(2, 0.5, 3)()
    theirs, _, unknowns = mpc_modulus(
        cell_methods.PAPER_MAP,
        cell_methods.MATRIX,
        cell_methods.PARTICLE,
        order=2,
        mesh_size=0.5,
        points=3,
    )
    assert theirs == pytest.approx(ours, rel=1e-9)
    assert unknowns > 100
