"""CSV files of a run's results hold every number of the NetCDF files, with units."""

import csv
import json
import shutil
from pathlib import Path

import numpy as np
import pytest
import xarray

from alphacut.entry import main
from alphacut.export import csv_tables
from alphacut.export.csv_tables import write_tables
from tests.alphacut.one_floor import one_floor


@pytest.fixture
def results(tmp_path):
    """Folder with one dataset of two variables on two axes, and one on one axis."""
    value = np.arange(6.0).reshape(2, 3) / 7
    data = xarray.Dataset(
        {
            "lower": (("alpha", "time"), value, {"units": "m"}),
            "upper": (("alpha", "time"), value + 1, {"units": "m"}),
            "peak": (("alpha",), [1.0, 2.0]),
            "alone": ((), 3.0),
        },
        {"alpha": [0.0, 1.0], "time": ("time", [0.0, 0.1, 0.2], {"units": "s"})},
        {"format_version": 2},
    )
    data.to_netcdf(tmp_path / "envelope_all.nc")
    return tmp_path


def test_every_number_keeps_all_its_digits_and_its_unit(results):
    made = write_tables(results.glob("*.nc"), results / "tables")
    assert [file.name for file in made] == ["envelope_all.csv", "envelope_all-by-alpha.csv"]
    with made[0].open(encoding="utf-8") as file:
        head, *rows = csv.reader(file)
    assert head == ["alpha", "time [s]", "lower [m]", "upper [m]"]
    stored = np.array(rows, float)
    assert stored[:, 2].tolist() == (np.arange(6.0) / 7).tolist()
    assert stored[:, 0].tolist() == [0, 0, 0, 1, 1, 1]


def test_a_table_of_too_many_rows_is_left_out_and_that_is_said(results, monkeypatch, capfd):
    monkeypatch.setattr(csv_tables, "MOST", 5)
    made = write_tables(results.glob("*.nc"), results / "tables")
    assert [file.name for file in made] == ["envelope_all-by-alpha.csv"]
    told = capfd.readouterr().err
    assert "envelope_all.csv is left out: it had 6 rows; " in told
    assert "envelope_all.nc holds them as NetCDF" in told


@pytest.mark.parametrize(
    ("more", "what"),
    [((), "error to be added"), (("inner_lower", "inner_upper"), "error within the bounds")],
)
def test_an_error_says_whether_the_bounds_hold_it(tmp_path, more, what):
    band = (("alpha", "time", "output"), np.ones((1, 2, 1)))
    data = xarray.Dataset(
        dict.fromkeys(("lower", "upper", "error", *more), band),
        {"alpha": [0.5], "time": [0.0, 0.1], "output": ["q1"]},
        {"format_version": 2},
    )
    places = (("alpha", "time", "output", "parameter"), np.ones((1, 2, 1, 1)))
    data.assign(lower_at=places, upper_at=places).to_netcdf(tmp_path / "envelope_all.nc")
    write_tables(tmp_path.glob("*.nc"), tmp_path / "tables")
    with (tmp_path / "tables" / "envelope_all-q1.csv").open(encoding="utf-8") as file:
        (row, _) = csv.DictReader(file)
    assert row[f"{what} at alpha 0.5 [m]"] == "1.0"


def test_values_of_several_units_have_theirs_in_a_column(tmp_path):
    margin = {"units": "SI, by output"}
    data = xarray.Dataset(
        {"margin": (("alpha", "output"), np.ones((1, 2)), margin)},
        {"alpha": [0.0], "output": ["drift1", "a2"]},
        {"format_version": 2},
    )
    data.to_netcdf(tmp_path / "decision.nc")
    (made,) = write_tables(tmp_path.glob("*.nc"), tmp_path / "tables")
    lines = made.read_text(encoding="utf-8").splitlines()
    assert lines == ["alpha,output,margin,unit", "0.0,drift1,1.0,m", "0.0,a2,1.0,m/s^2"]


def table(folder: Path, name: str, data: xarray.Dataset) -> list[dict[str, str]]:
    """Rows of the CSV file of a dataset."""
    folder.mkdir()
    data.assign_attrs(format_version=2).to_netcdf(folder / f"{name}.nc")
    write_tables(folder.glob("*.nc"), folder / "tables")
    with (folder / "tables" / f"{name}.csv").open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_numbers_carry_their_nature_error_and_limit(tmp_path):
    cuts = (("alpha", "bound"), np.ones((2, 2)))
    axes = {"alpha": [0.0, 1.0], "bound": ["lower", "upper"]}
    errors = {"error": ("error_name", [1e-4, 2e-4])}
    named = axes | {"error_name": ["mesh", "layers"]}
    modulus = xarray.Dataset({"E": cuts, **errors}, named, {"nature": "guaranteed"})
    for row in table(tmp_path / "modulus", "modulus", modulus):
        assert row["nature"] == "guaranteed"
        assert float(row["declared relative error of E"]) == pytest.approx(3e-4)
    each = json.dumps({"cuts": {"nature": ["guaranteed enclosure", "guaranteed"]}})
    image = xarray.Dataset({"E": cuts}, axes, {"nature": "guaranteed", "document": each})
    natures = [row["nature"] for row in table(tmp_path / "image", "image", image)]
    assert natures == ["guaranteed enclosure"] * 2 + ["guaranteed"] * 2
    facts = {"output": "q1", "limit": 0.04, "between_nodes": 0.02, "nature": "inner: attained"}
    found = xarray.Dataset({"exceedance": cuts}, axes, facts)
    for row in table(tmp_path / "one", "exceedance", found):
        assert (row["output"], row["limit value"], row["limit unit"]) == ("q1", "0.04", "m")
        assert (row["nature"], row["more between nodes (estimated)"]) == ("inner: attained", "0.02")


def test_a_row_of_a_curve_of_probabilities_says_of_which_limit_it_is(tmp_path):
    axes = {"alpha": [0.0, 1.0], "bound": ["lower", "upper"], "event": ["q1", "a2"]}
    ends = np.array([[[[0.5, 0.25, 0.0], [0.75, 0.5, 0.25]]] * 2] * 2)
    limits = (("event", "place"), [[0.01, 0.02, 0.03], [1.0, 2.0, 3.0]])
    own = {"output": ["q1", "a2"], "limit": [0.02, 2.0], "deviation": [0.0] * 2}
    of = {f"of_{name}": ("event", x) for name, x in (own | {"between_nodes": [0.0] * 2}).items()}
    curves = {"curve": (("event", "alpha", "bound", "place"), ends), "limits": limits, **of}
    whole = {"exceedance": (("event", "alpha", "bound"), ends[..., 1]), **curves}
    found = xarray.Dataset(whole, axes, {"nature": "inner: attained, at draws"})
    assert len(table(tmp_path / "two", "exceedance", found)) == 8
    with (tmp_path / "two" / "tables" / "exceedance-curve.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    told = ["2", "a2", "3.0", "m/s^2", "1.0", "0.0", "0.25", "inner: attained, at draws"]
    assert len(rows) == 12
    assert list(rows[-1].values()) == told


def test_results_of_an_earlier_case_are_left_out(tmp_path, capfd):
    """Or removed from the folder of tables. A section removed, a study by another name, and the modulus of another case."""
    case, out, limits = tmp_path / "case.toml", tmp_path / "out", '["q1 <= 1 m"]'
    text = one_floor(fuzzy='["m1"]', duration=1, step=0.01, mass="1 t ± 5 %", moved="10 mm")
    run = ["run", str(case), "--no-figures", "--quiet", "--out", str(out)]
    case.write_text(f"{text}[decision]\nlimits = {limits}\n", encoding="utf-8")
    assert main(run) == 0
    for name in ("envelope_old", "modulus"):
        shutil.copy(out / "envelope_all.nc", out / f"{name}.nc")
    report = ["report", str(out), "--quiet", "--csv"]
    assert main([*report, str(tmp_path / "first")]) == 0
    case.write_text(text, encoding="utf-8")
    assert main(run) == 0
    assert main([*report, str(tmp_path / "later")]) == 0
    first, later = ({x.name for x in (tmp_path / at).glob("*.csv")} for at in ("first", "later"))
    assert later == {f"envelope_all-{x}.csv" for x in ("q1", "v1", "attained")} | {"peaks.csv"}
    assert {name.partition("-")[0] for name in first - later} == {"decision.csv", "decision"}
    with (tmp_path / "later" / "peaks.csv").open(encoding="utf-8") as file:
        assert {row["study"] for row in csv.DictReader(file)} == {"all"}
    (tmp_path / "first" / "mine.csv").write_text("a,b\n", encoding="utf-8")
    changed = sorted(name for name in first if name.startswith("decision"))[0]
    (tmp_path / "first" / changed).write_text("a,b\n", encoding="utf-8")
    capfd.readouterr()
    assert main([*report, str(tmp_path / "first")]) == 0
    assert {x.name for x in (tmp_path / "first").glob("*.csv")} == later | {"mine.csv", changed}
    assert f"{changed} is of an earlier report and stays, since" in capfd.readouterr().err
