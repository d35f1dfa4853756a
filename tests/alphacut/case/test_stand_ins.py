"""A known, an earlier, or a measured modulus stands in for the cell; records of the ground are read
with their units.
"""

import re
from pathlib import Path

import numpy as np
import pytest

from alphacut.case.load import load
from alphacut.entry import main
from alphacut.io.problem import BadInput
from alphacut.stages.material.modulus import measured_values, stand_in
from alphacut.stages.vibration.accelerogram import accelerogram
from benchmarks.synthetic_record import SyntheticRecord, text

CASES = Path(__file__).parents[3] / "cases"
PAPER = (CASES / "paper.toml").read_text(encoding="utf-8")


def with_modulus(folder, line):
    """The paper's frame with a modulus that is not computed."""
    head, _, tail = PAPER.partition("[radius]")
    frame = "[frame]" + tail.partition("\n[frame]")[2]
    frame = "\n".join(row for row in frame.splitlines() if not row.startswith("modulus"))
    path = folder / "case.toml"
    path.write_text(
        head.replace('["modulus", "envelope"]', '["envelope"]') + f"[modulus]\n{line}\n\n{frame}\n",
        encoding="utf-8",
    )
    return path


def test_a_value_stands_in(tmp_path):
    number = stand_in(load(with_modulus(tmp_path, 'value = "[24, 25, 26] GPa"')))
    assert (number.support.lower, number.modal, number.support.upper) == (24e9, 25e9, 26e9)


def test_a_value_stands_in_for_the_stage_of_a_run_too(tmp_path, capfd):
    path = with_modulus(tmp_path, 'value = "[24, 25, 26] GPa"')
    path.write_text(
        path.read_text(encoding="utf-8").replace('["envelope"]', '["modulus", "envelope"]', 1),
        encoding="utf-8",
    )
    assert (
        main(
            [
                "run",
                str(path),
                "--quick",
                "--no-figures",
                "--out",
                str(tmp_path / "results"),
                "--quiet",
            ]
        )
        == 0
    )
    assert not (tmp_path / "results" / "modulus.nc").exists()


def test_measured_values_stand_in(tmp_path):
    (tmp_path / "cores.csv").write_text(
        "# cores\nE [GPa]\n24.1\n25.2\n23.9\n26.0\n25.0\n", encoding="utf-8"
    )
    written = 'measured = "cores.csv"\nbounds = "[10, 60] GPa"'
    number = stand_in(load(with_modulus(tmp_path, written)))
    assert number.modal == pytest.approx(25.0e9)
    assert number.support == pytest.approx((10e9, 60e9))
    assert number.cut(1 / 3) == pytest.approx((23.9e9, 26.0e9))
    normal = stand_in(load(with_modulus(tmp_path, written + '\nclaim = "mean"\nlaw = "normal"')))
    assert normal.claim.about == "mean"
    assert normal.cut(0.05).width < 3e9


def test_check_tells_how_measured_values_were_read(tmp_path, capfd):
    (tmp_path / "cores.csv").write_text("E [GPa]\n24.1\n25.2\n23.9\n", encoding="utf-8")
    written = 'measured = "cores.csv"\nbounds = "[10, 60] GPa"'
    assert main(["check", str(with_modulus(tmp_path, written))]) == 0
    line = "modulus.measured: 3 values from 23.90 GPa to 25.20 GPa, median 24.10 GPa\n"
    assert line in capfd.readouterr().out


def test_a_missing_file_of_a_case_by_its_bare_name_names_the_folder(tmp_path, capfd, monkeypatch):
    with_modulus(tmp_path, 'measured = "cores.csv"')
    monkeypatch.chdir(tmp_path)
    (case,) = tmp_path.glob("*.toml")
    assert main(["check", case.name]) == 2
    assert f"a path from the case's folder, {tmp_path}" in capfd.readouterr().err


@pytest.mark.parametrize(
    ("written", "pattern"),
    [
        ("", "decide the cuts of the next value from α = 0.3333 on, not at α = 0: give bounds"),
        ('claim = "mode"', "the claim is 'mode'; it must be 'next value', 'mean'"),
        ('claim = "mean"', "no number of values decides a mean without a law or bounds"),
        ('bounds = "[25, 60] GPa"', r"value 24.1 GPa lies outside the bounds \[25 GPa, 60 GPa\]"),
    ],
)
def test_what_measured_values_do_not_decide_is_refused(written, pattern, tmp_path):
    (tmp_path / "cores.csv").write_text("E [GPa]\n24.1\n25.2\n23.9\n26.0\n25.0\n", encoding="utf-8")
    case = load(with_modulus(tmp_path, f'measured = "cores.csv"\n{written}'))
    with pytest.raises(BadInput, match=pattern):
        stand_in(case)


def test_a_law_that_equal_values_contradict_may_be_left_out(tmp_path):
    (tmp_path / "cores.csv").write_text("E [GPa]\n30\n30\n30\n", encoding="utf-8")
    written = 'measured = "cores.csv"\nbounds = "[10, 60] GPa"\nclaim = "mean"'
    with pytest.raises(BadInput, match=r"all 3 values are 30 GPa.*: leave the law out"):
        stand_in(load(with_modulus(tmp_path, written + '\nlaw = "normal"')))
    assert stand_in(load(with_modulus(tmp_path, written))).support == pytest.approx((10e9, 60e9))


def test_an_earlier_run_stands_in(tmp_path, capfd):
    assert (
        main(
            [
                "modulus",
                str(CASES / "paper.toml"),
                "--method",
                "series",
                "--plan",
                "signed",
                "--out",
                str(tmp_path / "m.nc"),
                "--quiet",
            ]
        )
        == 0
    )
    number = stand_in(load(with_modulus(tmp_path, 'file = "m.nc"')))
    assert number.modal == pytest.approx(24.771e9, rel=1e-4)


@pytest.mark.parametrize(
    ("content", "pattern"),
    [
        ("E\n24\n", "the column .E. is not a modulus with its unit"),
        ("E [m]\n24\n", 'unit "m" is wrong'),
        ("E [GPa]\n24\n-3\n", "m.csv:3: .*no positive number"),
        ("E [GPa]\n24\n30,0\n", "m.csv:3: .*no positive number; allowed: a decimal point, 30.0$"),
        ("E [GPa]\nx\n", "m.csv:2: .*no positive number"),
        ("E [GPa]\n", "a header and a row"),
    ],
)
def test_measured_nonsense_is_refused_with_row_and_reason(content, pattern, tmp_path):
    (tmp_path / "m.csv").write_text(content, encoding="utf-8")
    with pytest.raises(BadInput, match=pattern):
        measured_values(tmp_path / "m.csv")


@pytest.mark.parametrize(
    ("content", "pattern"),
    [
        ("time,acceleration\n0,1\n1,2\n", "not time with its unit"),
        ("time [s],acceleration [m]\n0,1\n1,2\n", 'unit "m" is wrong'),
        ("time [s],acceleration [m/s^2]\n0,1\n1,x\n", "r.csv:3: .*no pair of numbers"),
        (
            "time [s],acceleration [m/s^2]\n0,1\n1,nan\n",
            "no pair of numbers; allowed: a finite time",
        ),
        ("time [s],acceleration [m/s^2]\n0,1\n1,2\n3,4\n", "not evenly spaced"),
        ("time [s]\n0\n1\n", "no comma found"),
        ("", "a header and two rows"),
    ],
)
def test_a_bad_record_is_refused_with_row_and_reason(content, pattern, tmp_path):
    (tmp_path / "r.csv").write_text(content, encoding="utf-8")
    with pytest.raises(BadInput, match=pattern):
        accelerogram(tmp_path / "r.csv")


def test_units_of_a_record_are_those_of_its_header(tmp_path):
    (tmp_path / "r.csv").write_text(
        "time [ms],acceleration [cm/s^2]\n0,100\n10,-200\n20,0\n", encoding="utf-8"
    )
    found = accelerogram(tmp_path / "r.csv")
    assert found.step == pytest.approx(0.01)
    assert found.acceleration == pytest.approx([1.0, -2.0, 0.0])


def test_the_shipped_record_is_the_one_its_program_makes():
    record = SyntheticRecord()
    stored, made = (
        np.loadtxt(lines, delimiter=",", skiprows=2)
        for lines in (CASES / "building.record.csv", text(record).splitlines())
    )
    assert stored == pytest.approx(made, abs=2e-5)
    assert np.abs(record.acceleration()).max() == pytest.approx(record.peak)
    assert record.acceleration()[0] == 0


def test_the_report_tells_the_measured_modulus_by_its_cuts(tmp_path, capfd):
    (tmp_path / "cylinders.csv").write_text(
        "E [GPa]\n27.9\n29.4\n30.1\n31.2\n33.0\n", encoding="utf-8"
    )
    text = (CASES / "building.toml").read_text(encoding="utf-8")
    text = text.replace(
        'method = "auto"\ntolerance = 1e-5\nplan = "signed"',
        'measured = "cylinders.csv"\nbounds = "[27, 34] GPa"',
    )
    (tmp_path / "building.record.csv").write_bytes((CASES / "building.record.csv").read_bytes())
    (tmp_path / "own.toml").write_text(text, encoding="utf-8")
    folder = tmp_path / "out"
    asked = ["run", str(tmp_path / "own.toml"), "--quick", "--no-figures", "--quiet"]
    asked += ["--set", "envelope.duration=2 s"]
    assert main([*asked, "--out", str(folder)]) == 0, capfd.readouterr().err
    assert main(["report", str(folder), "--quiet"]) == 0
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert "<code>modulus.measured = cylinders.csv</code>" in page
    assert '<td>0</td><td class="number">27.0000</td><td class="number">34.0000</td>' in page
    plain = re.sub("</?a[^>]*>", "", page)
    assert "result of the next value of E lies in its α-cut with P &gt;= 1 - α" in plain
    assert "bounds [27 GPa, 34 GPa]" in plain
    assert '<td>1</td><td class="number">30.1000</td><td class="number">30.1000</td>' in page


@pytest.mark.parametrize("command", ["modulus", "cell"])
def test_a_command_that_computes_a_modulus_says_that_the_case_gives_one(command, tmp_path, capfd):
    (tmp_path / "m.csv").write_text("E [GPa]\n24\n25\n26\n", encoding="utf-8")
    path = with_modulus(tmp_path, 'measured = "m.csv"\nbounds = "[10, 60] GPa"')
    assert main([command, str(path)]) == 2
    (line,) = capfd.readouterr().err.splitlines()
    assert "modulus.measured = m.csv: this gives the modulus" in line
    assert f"alphacut envelope {path}, which takes it" in line
