import csv

import pytest

pytest.importorskip("dolfinx")
from benchmarks.rve import scaling as cell_scaling
from benchmarks.rve import solvers as cell_solvers
from benchmarks.rve.solvers import Timing


def test_a_solver_that_takes_too_long_is_stopped_and_its_time_is_a_lower_bound(tmp_path, capsys):
    out = tmp_path / "solvers.csv"
    # below 15 times
    assert (
        cell_solvers.main(
            ["--mesh-size", "0.5", "--solvers", "gamg", "--cap", "1e-9", "--out", str(out)]
        )
        == 1
    )
    with out.open() as file:
        first, stopped = csv.DictReader(file)
    assert stopped["seconds"].startswith(">")
    assert stopped["times_default"].startswith(">")
    assert float(first["E_GPa"]) > 20
    assert "not 15" in capsys.readouterr().err


def test_a_modulus_that_differs_is_a_fault():
    timings = [
        Timing("theta", 10, 1.0, (7,), 2e9),
        Timing("mumps", 10, 9.0, (1,), 2e9 * (1 + 1e-7)),
        Timing("gamg", 10, 30.0, (9,), 2e9),
    ]
    (fault,) = cell_solvers.compare(timings)
    assert "E of mumps" in fault


def test_scaling_judges_each_change_alone():
    rows = [
        ("layers", 12.0, Timing("theta", 100, 1.0, (7, 7), 1.0)),
        ("layers", 24.0, Timing("theta", 200, 2.2, (5, 5), 1.0)),
        ("contrast", 4.0, Timing("theta", 100, 1.0, (7, 8), 1.0)),
        ("contrast", 1e4, Timing("theta", 100, 3.0, (8, 7), 1.0)),
    ]
    found = cell_scaling.spreads(rows)
    assert found["layers"] == pytest.approx((1.1, 7 / 5))
    assert found["contrast"] == pytest.approx((3.0, 1.0))


def test_iterations_hardly_change_with_layers_and_contrast():
    changes = {"layers": (6, 12), "contrast": (1e-4, 1e4)}
    found = cell_scaling.spreads(list(cell_scaling.series(changes, mesh_size=0.4, repeat=1)))
    assert max(count for _, count in found.values()) <= 1.5


def test_ranks_are_judged_by_the_result_of_one_and_the_model_starts_from_its_times(
    monkeypatch, capsys
):
    phases = dict.fromkeys(cell_scaling.PHASES, 1.0)
    moduli = {1: 1.0, 2: 1 + 1e-9, 3: 1 + 1e-14}

    def shared(count, size):
        whole = {"seconds": 6.0, "megabytes": 9.0, "processor": 5.0, "E": moduli[count]}
        return phases | whole | {"crowding": 1.0 if count < 3 else 1.4}

    monkeypatch.setattr(cell_scaling, "shared", shared)
    rows, faults = cell_scaling.on_ranks([1, 2, 3], 0.5)
    assert faults == 1
    assert capsys.readouterr().out.count("at once take 1.40 of the time of one") == 1
    assert [row["value"] for row in rows] == [1, 2, 3, *cell_scaling.MODELLED]
    assert cell_scaling.modelled(phases, 1)["seconds"] == pytest.approx(6.0)
    assert all(row["seconds"] < 6 for row in rows[3:])
    last = rows[-1]
    assert last["start"] == 1
    assert last["setup"] == pytest.approx(1 / 13)
    assert last["solve"] == pytest.approx(1 / 26)
