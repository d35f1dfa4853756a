"""Command spectrum: table, JSON, files, and records and options that make no sense."""

from __future__ import annotations

import json
import os
import re
import threading
from pathlib import Path

import numpy as np
import pytest

from alphacut.entry import main
from alphacut.io.units import engineering


def record(folder: Path, unit: str = "g") -> Path:
    path = folder / "r.csv"
    # a push of 0.1 g that stays: an undamped oscillator reaches twice the static displacement
    rows = "".join(f"{0.1 * k:.1f},0.1\n" for k in range(101))
    path.write_text(f"time [s],acceleration [{unit}]\n{rows}", encoding="utf-8")
    return path


def test_a_push_doubles_what_it_does_slowly(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    words = [
        "--damping",
        "0 %",
        "--damping",
        "5 %",
        "--shortest",
        "0.5 s",
        "--longest",
        "2",
        "--count",
        "5",
    ]
    assert main(["spectrum", str(record(tmp_path)), *words, "--out", str(out), "--json", "-"]) == 0
    found = json.loads(capfd.readouterr().out)
    assert found["period_s"] == pytest.approx(np.geomspace(0.5, 2, 5))
    plain, damped = found["spectra"]
    assert plain["pseudo_acceleration_m_per_s2"] == pytest.approx([2 * 0.980665] * 5, rel=1e-6)
    assert max(damped["displacement_m"]) < max(plain["displacement_m"])
    table = np.genfromtxt(out / "spectrum.csv", delimiter=",", skip_header=1)
    assert table.shape == (10, 7)
    np.testing.assert_array_equal(table[:5, 2], plain["displacement_m"])
    assert {path.name for path in out.iterdir()} == {f"spectrum.{x}" for x in ("csv", "png", "svg")}


def test_the_table_names_units_and_the_error(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    assert main(["spectrum", str(record(tmp_path))]) == 0
    out = capfd.readouterr().out
    assert "m/s^2" in out
    assert "may be wrong by up to" in out


@pytest.mark.parametrize(
    ("words", "pattern"),
    [
        (["--damping", "100 %"], "--damping = 100 %: out of range"),
        (["--damping", "5 %,5 %"], "twice"),
        (["--damping", "5 %", "--damping", "5 %"], "twice"),
        (["--damping", "5 Pa"], '--damping = 5 Pa: the unit "Pa" is wrong'),
        (["--damping", ""], "--damping"),
        (["--shortest", "3 s", "--longest", "1 s"], "0 < shortest < longest"),
        (["--shortest", "1e-9 s"], "steps, above"),
        (["--longest", "4 m"], '--longest = 4 m: the unit "m" is wrong'),
        (["--count", "1"], "--count = 1: out of range"),
        (["--count", "few"], "--count"),
    ],
)
def test_options_that_make_no_sense_are_refused(
    words: list[str], pattern: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert main(["spectrum", str(record(tmp_path)), *words, "--out", str(out)]) == 2
    err = capfd.readouterr().err
    assert pattern in err
    assert "Traceback" not in err
    assert not out.exists()


def test_the_report_of_a_folder_shows_the_spectrum_in_it(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    case, out = str(Path(__file__).parents[3] / "cases" / "pendulum.toml"), tmp_path / "run"
    assert main(["run", case, "--quick", "--no-figures", "--quiet", "--out", str(out)]) == 0
    asked = ["spectrum", str(record(tmp_path)), "--damping", "2 %,5 %", "--quiet"]
    assert main([*asked, "--out", str(out)]) == 0
    assert main(["report", str(out), "--quiet"]) == 0
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "<h2>Response spectrum of r.csv</h2>" in page
    assert "displacement, 2 %" in page
    rows = (out / "spectrum.csv").read_text(encoding="utf-8").splitlines()[1:]
    five = [row.split(",") for row in rows if row.startswith("0.05,")]
    peak = max(float(row[4]) for row in five)
    assert "With damping 5 %: largest displacement" in page
    assert f"largest pseudo-acceleration {engineering(peak, 'm/s^2')}" in page
    assert "natural period, s" in page  # the figure
    whole = (out / "spectrum.csv").read_text(encoding="utf-8")
    for content in ("nothing\n", re.sub(r"(?m)^(0.05,[^,]*),.*$", r"\1,nan,nan,nan,nan", whole)):
        (out / "spectrum.csv").write_text(content, encoding="utf-8")
        assert main(["report", str(out), "--quiet"]) == 2
        assert "this is no response spectrum" in capfd.readouterr().err


def test_a_record_in_gal_and_one_with_decimal_commas(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    def largest(unit: str, factor: float) -> float:
        path = tmp_path / f"{factor:g}.csv"
        rows = "".join(f"{0.02 * k},{factor * (k % 7 - 3)}\n" for k in range(50))
        path.write_text(f"time [s],acceleration [{unit}]\n{rows}", encoding="utf-8")
        assert main(["spectrum", str(path), "--json", "-"]) == 0
        found = json.loads(capfd.readouterr().out)["spectra"][0]["displacement_m"]
        return max(map(float, found))

    assert largest("gal", 100.0) == pytest.approx(largest("m/s^2", 1.0), rel=1e-12)
    path = tmp_path / "comma.csv"
    path.write_text("time [s],acceleration [gal]\n0,000,-0,5\n0,02,1,0\n", encoding="utf-8")
    assert main(["spectrum", str(path)]) == 2
    assert "comma.csv:2: record = 0,000,-0,5: this row is no pair" in capfd.readouterr().err


def test_a_record_that_is_none_is_refused(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    assert main(["spectrum", str(tmp_path / "none.csv")]) == 2
    assert main(["spectrum", str(record(tmp_path, "m"))]) == 2
    assert capfd.readouterr().err.count("alphacut: ") == 2


def test_a_record_may_come_from_a_pipe(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    text, pipe = record(tmp_path).read_bytes(), tmp_path / "pipe"
    os.mkfifo(pipe)
    writer = threading.Thread(target=pipe.write_bytes, args=(text,), daemon=True)
    writer.start()
    assert main(["spectrum", str(pipe), "--count", "3"]) == 0, capfd.readouterr().err
    writer.join(10)
    assert "largest pseudo-acceleration" in capfd.readouterr().out


def test_a_peak_that_no_ground_reaches_is_told_with_its_cure(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    path = record(tmp_path, "m/s^2")
    path.write_text(path.read_text("utf-8").replace(",0.1\n", ",98.1\n"), "utf-8")  # in gal
    assert main(["spectrum", str(path), "--count", "3"]) == 0
    what = "warning: record: a peak of 98.1 m/s² is unusual for the ground; check the unit in its"
    assert f"{what} header" in capfd.readouterr().err
    path.write_text(path.read_text("utf-8").replace("m/s^2", "gal"), "utf-8")
    assert main(["spectrum", str(path), "--count", "3"]) == 0
    assert capfd.readouterr().err == ""
