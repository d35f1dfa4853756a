"""CSV files of a run's results hold every number of the NetCDF files, with units."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest
import xarray

from alphacut.entry import main
from alphacut.export.csv_tables import write_tables


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
    made = write_tables(results, results / "tables")
    assert [file.name for file in made] == ["envelope_all.csv", "envelope_all-by-alpha.csv"]
    with made[0].open(encoding="utf-8") as file:
        head, *rows = csv.reader(file)
    assert head == ["alpha", "time [s]", "lower [m]", "upper [m]"]
    stored = np.array(rows, float)
    assert stored[:, 2].tolist() == (np.arange(6.0) / 7).tolist()
    assert stored[:, 0].tolist() == [0, 0, 0, 1, 1, 1]


def test_the_report_writes_them_on_demand(tmp_path, capfd):
    case = str(Path(__file__).parents[3] / "cases" / "pendulum.toml")
    out = tmp_path / "run"
    assert main(["run", case, "--quick", "--no-figures", "--quiet", "--out", str(out)]) == 0
    capfd.readouterr()
    folder = tmp_path / "tables"
    assert main(["report", str(out), "--csv", str(folder), "--json", "-"]) == 0
    told = json.loads(capfd.readouterr().out)
    assert sorted(told["tables"]) == sorted(map(str, folder.glob("*.csv")))
    assert (folder / "envelope_all.csv").read_text(encoding="utf-8").startswith("alpha,time [s]")
    (tmp_path / "file").touch()
    assert main(["report", str(out), "--csv", str(tmp_path / "file")]) == 2
