"""Results of format 1, kept in tests/stored-v1, are still read; those of a newer format are refused
with what to do about it.

The files are those of `alphacut run` for the case that their summary.json holds; they are never
made anew.
"""

import json
import shutil
from pathlib import Path

import pytest
import xarray

from alphacut.entry import main
from alphacut.io.netcdf import read_dataset, read_summary
from alphacut.io.problem import BadInput
from alphacut.io.provenance import FORMAT, door
from alphacut.stages.material.modulus import read_number

OLD = Path(__file__).parent / "stored-v1"
PAPER = Path(__file__).parents[3] / "cases" / "paper.toml"


@pytest.fixture
def copy(tmp_path):
    return Path(shutil.copytree(OLD, tmp_path / "results"))


def rewritten(path, **attributes):
    """The NetCDF file with other attributes."""
    xarray.load_dataset(path).assign_attrs(attributes).to_netcdf(path)


def test_a_modulus_of_format_1_is_handed_on(capfd):
    summary = read_summary(OLD)
    assert summary["format_version"] == 1
    number = read_number(OLD / "modulus.nc")
    low, high = (number.alpha[k] for k in (0, 1))
    assert number.cut(high - 1e-9) == number.cut(low)  # of E nothing is known between two levels
    assert number.modal / 1e9 == pytest.approx(summary["modulus"]["modal_GPa"])
    assert number.support.lower / 1e9 == pytest.approx(summary["modulus"]["lower_GPa"])
    arguments = [
        "envelope",
        str(PAPER),
        "--fuzzy",
        "E",
        "--duration",
        "0.5",
        "--modulus",
        str(OLD / "modulus.nc"),
        "--json",
        "-",
    ]
    assert main(arguments) == 0
    capfd.readouterr()


@pytest.mark.parametrize("peaks", [True, False], ids=["with peaks", "without peaks"])
def test_a_folder_of_format_1_becomes_a_report(peaks, copy):
    if not peaks:  # which the first files of this format lack
        summary = json.loads((copy / "summary.json").read_text(encoding="utf-8"))
        del summary["envelopes"]["all"]["peak"]
        (copy / "summary.json").write_text(json.dumps(summary), encoding="utf-8")
    assert main(["report", str(copy), "--quiet"]) == 0
    page = (copy / "report.html").read_text(encoding="utf-8")
    assert "Sample of format 1" in page
    assert ("<h3>Peaks</h3>" in page) == peaks


def test_a_newer_file_is_refused_with_its_maker_and_a_cure(copy, capfd):
    rewritten(copy / "modulus.nc", format_version=FORMAT + 1, created_by="alphacut 9.8.7")
    assert main(["envelope", str(PAPER), "--modulus", str(copy / "modulus.nc")]) == 2
    err = capfd.readouterr().err
    assert err.count("\n") == 1
    for words in (
        f"has format {FORMAT + 1}",
        "written by alphacut 9.8.7",
        f"reads formats up to {FORMAT}",
        "install that version",
    ):
        assert words in err


def test_newer_results_are_refused_before_a_report_is_written(copy):
    summary = json.loads((copy / "summary.json").read_text(encoding="utf-8"))
    (copy / "summary.json").write_text(
        json.dumps({**summary, "format_version": FORMAT + 1}), encoding="utf-8"
    )
    assert main(["report", str(copy), "--quiet"]) == 2
    assert not (copy / "report.html").exists()


def test_a_run_does_not_overwrite_newer_results_unasked(copy, capfd):
    case = copy / "small.toml"
    case.write_text(read_summary(copy)["case_text"], encoding="utf-8")
    rewritten(copy / "modulus.nc", format_version=FORMAT + 1)
    before = (copy / "modulus.nc").read_bytes()
    arguments = ["run", str(case), "--out", str(copy), "--no-figures", "--quiet"]
    assert main(arguments) == 2
    assert f"{door()} run CASE.toml --fresh" in capfd.readouterr().err
    assert (copy / "modulus.nc").read_bytes() == before
    assert main([*arguments, "--fresh"]) == 0
    assert read_dataset(copy / "modulus.nc").attrs["format_version"] == FORMAT


@pytest.mark.parametrize("version", ["newest", "-1", "0", "1.5"])
def test_a_version_that_is_none_is_refused(version, copy):
    rewritten(copy / "modulus.nc", format_version=version)
    with pytest.raises(BadInput, match=f"tells no version of its format: {version}"):
        read_dataset(copy / "modulus.nc")


def test_what_is_no_result_is_refused(tmp_path):
    (tmp_path / "modulus.nc").write_text("no NetCDF", encoding="utf-8")
    with pytest.raises(BadInput, match="no NetCDF file"):
        read_dataset(tmp_path / "modulus.nc")
    (tmp_path / "summary.json").write_text("{", encoding="utf-8")
    with pytest.raises(BadInput, match=r"summary\.json: this file is damaged"):
        read_summary(tmp_path)


def test_a_certified_envelope_of_format_1_has_its_proved_bounds(copy):
    path = copy / "envelope_all.nc"
    old = xarray.load_dataset(path)
    old.assign(outer_lower=old["lower"] - 1e-3, outer_upper=old["upper"] + 1e-3).to_netcdf(path)
    found = read_dataset(path)
    assert found["lower"].equals(old["lower"] - 1e-3)
    assert found["upper"].equals(old["upper"] + 1e-3)
    assert found["inner_upper"].equals(old["upper"])
    assert "outer_upper" not in found
