"""`check` finds what `run` would stumble over, and `run` says it before anything is computed."""

import json
import re
import shutil
from pathlib import Path

import pytest

from alphacut.case.load import load
from alphacut.entry import main
from alphacut.fuzzy import Interval
from alphacut.fuzzy.sets.stepwise import Stepwise
from alphacut.report.key_results import key_results
from alphacut.stages.plausible import between_levels
from alphacut.stages.readiness import expected, known_levels
from alphacut.stages.vibration.envelope_task import task_of
from alphacut.stages.vibration.structure import structure
from alphacut.stages.vibration.studies import cut_line

CASES = Path(__file__).parents[3] / "cases"


def own(folder, name, *changes):
    """A copy of a shipped case and its record, with changes of its text."""
    text = (CASES / f"{name}.toml").read_text(encoding="utf-8")
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    shutil.copy(CASES / "building.record.csv", folder)
    path = folder / "own.toml"
    path.write_text(text, encoding="utf-8")
    return path


BROKEN = {
    "no modulus": (
        "building",
        [('["modulus", "envelope"]', '["envelope"]')],
        r"own.toml:\d+: frame.modulus: missing.*stages = ",
    ),
    "crisp input": (
        "paper",
        [('fuzzy = ["E"]', 'fuzzy = ["l"]')],
        r"own.toml:\d+: study\[0\].fuzzy = l: this input is crisp in the case: it is one number",
    ),
    "equal values": (
        "building",
        [('"[28, 30, 34] t"', '"[10, 10, 10] t"')],
        "fuzzy = m8: this input is crisp in the case: its values are all equal; allowed: .*differ",
    ),
    "crisp random": (
        "building",
        [('random = ["E"]', 'random = ["m1"]')],
        r"own.toml:\d+: exceedance.random = m1: .*crisp",
    ),
}


@pytest.mark.parametrize("name", BROKEN)
@pytest.mark.parametrize("command", ["check", "run"])
def test_what_cannot_run_is_found_before(command, name, tmp_path, capfd):
    case, changes, pattern = BROKEN[name]
    path = own(tmp_path, case, *changes)
    more = ["--out", str(tmp_path / "results")] if command == "run" else []
    assert main([command, str(path), *more]) == 2
    err = capfd.readouterr().err
    assert re.search(pattern, err), err
    assert len(err.splitlines()) == 1
    assert not (tmp_path / "results").exists()


@pytest.mark.parametrize(
    ("old", "new", "what"),
    [
        (
            "0.02,-0.00000",
            "0.02;-0.00000",
            (
                r"building.record.csv:5: frame.accelerogram = 0.02;-0.00000: .*pair of numbers;"
                r" allowed: a finite time"
            ),
        ),
        (
            "0.02,-0.00000",
            "0.025,-0.00000",
            r"building.record.csv:5: .*0.015 s to this row, mostly 0.01 s; allowed: even steps",
        ),
        ("[m/s^2]", "[m/s]", r"building.record.csv:2: .*unit"),
    ],
)
@pytest.mark.parametrize("command", ["check", "run"])
def test_a_broken_record_is_read_by_check_and_its_line_is_that_of_the_file(
    command, old, new, what, tmp_path, capfd
):
    path = own(tmp_path, "building")
    record = tmp_path / "building.record.csv"
    record.write_text(record.read_text(encoding="utf-8").replace(old, new, 1), encoding="utf-8")
    more = ["--out", str(tmp_path / "results")] if command == "run" else []
    assert main([command, str(path), *more]) == 2
    assert re.search(what, capfd.readouterr().err)
    assert not (tmp_path / "results").exists()


def warnings(path, *more, capfd):
    assert main(["check", str(path), "--json", "-", *more]) == 0
    out, err = capfd.readouterr()
    found = json.loads(out)["warnings"]
    assert all(warning in err for warning in found)
    return found


def test_a_duration_beyond_the_record_is_remarked(tmp_path, capfd):
    path = own(tmp_path, "building", ('duration = "20 s"', 'duration = "30 s"'))
    (found,) = warnings(path, capfd=capfd)
    assert "the record ends at 20 s and the simulation at 30 s" in found


def test_a_record_that_is_cut_short_is_remarked(tmp_path, capfd):
    path = own(tmp_path, "building", ('duration = "20 s"', 'duration = "8 s"'))
    (found,) = warnings(path, capfd=capfd)
    assert "the simulation ends at 8 s, the record at 20 s: the rest of the record is" in found
    case = load(path)
    (told,) = cut_line(structure(case, Interval(24e9, 25e9)), [task_of(case)])
    assert told == "all results are of the first 8 s of the record: its rest is left out"
    modulus = {"alpha": [1.0], "E_GPa": {"lower": [24.0], "upper": [25.0]}}
    shown = key_results({"given_modulus": modulus, "structure": {"words": {"cut": [told]}}})
    assert f"{told[1:]}." in shown
    whole = load(own(tmp_path, "building"))
    assert not cut_line(structure(whole, Interval(24e9, 25e9)), [task_of(whole)])
    short = [
        "--duration=1 s",
        "--alpha=1",
        "--fuzzy=E",
        "--set",
        "frame.modulus = '[23, 24, 25] GPa'",
    ]
    assert main(["envelope", str(path), *short]) == 0
    assert "all results are of the first 1 s of the record" in capfd.readouterr().out


def test_levels_at_which_the_modulus_has_no_cut_are_remarked(tmp_path, capfd):
    levels = ("--set", "envelope.alpha=[0, 0.9, 1]", "--set", "modulus.alpha=[0, 0.5, 1]")
    (found,) = warnings(own(tmp_path, "paper"), *levels, capfd=capfd)
    assert "modulus.alpha has no 0.9; there E's wider cut of the level below stands in" in found


def test_a_modulus_yet_to_be_computed_is_expected_at_the_bound_that_the_matrix_makes(tmp_path):
    text = 'modulus = "[22.7626, 24.7561, 25.8312] GPa" # Table 1; `alphacut run` puts the computed one'
    number = expected(load(own(tmp_path, "paper", (text, "# of the cell"))))
    assert number.modal == pytest.approx(24.77e9, rel=0.01)  # the series; the matrix has 20 GPa
    assert number.support.lower < 24e9


def test_levels_of_a_modulus_that_no_study_takes_are_not_remarked(tmp_path):
    known = Stepwise((0.0, 1.0), (24e9, 25e9), (26e9, 25e9), outer=True)
    case = load(own(tmp_path, "paper"))
    assert known_levels(case, known) == (0.0, 1.0)
    assert known_levels(case, None) == case.modulus.alpha
    assert any("modulus.alpha has no 0.25" in remark for remark in between_levels(case, (0.0, 1.0)))
    crisp = own(tmp_path, "building", ('fuzzy = ["E", "m8", "l1",', 'fuzzy = ["m8", "l1",'))
    for path in (crisp, own(tmp_path, "tower")):
        assert known_levels(load(path), known) == ()
    assert not [*between_levels(case, ())]


@pytest.mark.parametrize("levels", ["[0]", "[0, 0.5]", "[0.5, 1]", "[1]"])
def test_levels_that_leave_cuts_of_the_modulus_out_are_refused_before(levels, tmp_path, capfd):
    assert main(["check", str(own(tmp_path, "paper")), "--set", f"modulus.alpha={levels}"]) == 2
    (line,) = capfd.readouterr().err.splitlines()
    assert "levels leave cuts of E out that the structure needs" in line


def test_a_coarse_step_is_warned_of(tmp_path, capfd):
    path = own(tmp_path, "building", ('integrator = "exact"', 'integrator = "midpoint"'))
    (found,) = warnings(path, capfd=capfd)
    assert "omega_max h" in found
    assert main(["run", str(path), "--strict", "--out", str(tmp_path / "results")]) == 2
    assert not (tmp_path / "results").exists()


@pytest.mark.parametrize(
    "path",
    [path for path in sorted(CASES.glob("*.toml")) if ".quoted" not in path.name],
    ids=lambda path: path.stem,
)
def test_the_shipped_cases_are_ready(path, capfd):
    told = warnings(path, capfd=capfd)
    if path.stem == "paper-literal":  # the table read literally is no building
        assert "above 1 % an envelope is rough" in told.pop()
        assert "first natural period of 0.00221 s is unusual" in told.pop()
    assert told == []


@pytest.mark.parametrize("command", ["check", "run"])
def test_a_file_of_circles_is_read_before(command, tmp_path, capfd):
    text = (CASES / "concrete.toml").read_text(encoding="utf-8")
    start = text.index("[microstructure.packing]")
    end = text.index("\n[", start)
    circles = '[microstructure.circles]\nfile = "d.csv"\nsize = ["50 mm", "50 mm"]\n'
    path = tmp_path / "own.toml"
    path.write_text(text[:start] + circles + text[end:], encoding="utf-8")
    (tmp_path / "d.csv").write_text("d [mm]\n3\n4\n", encoding="utf-8")
    more = ["--out", str(tmp_path / "results")] if command == "run" else []
    assert main([command, str(path), *more]) == 2
    told = capfd.readouterr().err
    assert "microstructure.circles.file" in told
    assert "has no column x, y" in told
    assert "'x [mm],y [mm],r [mm]'" in told
