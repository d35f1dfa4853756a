"""Records of two components in a case: over all angles, turned by one, and what does not fit."""

import csv
import re

import numpy as np
import pytest

from alphacut import main
from alphacut.case.content import load
from alphacut.frame import over_records, read_record
from alphacut.frame.analyses.angles import turned_components
from alphacut.stages.suite import suite_records
from tests.alphacut.small import refusals, summary_of

CASE = """
title = "A floor on columns that are not centred"
stages = ["envelope"]
[matrices]
unknowns = ["1.x", "1.y", "1.r"]
mass = [["1", "mass.npy"]]
stiffness = [["k", "stiffness.npy"]]
directions = ["x", "y"]
damping_ratio = "5 %"
[matrices.parameters]
k = "1 ± 4 %"
[matrices.outputs]
corner = { row = { "1.x" = 1.0, "1.r" = -4.0 } }
[records]
files = [["one.csv", "two.csv"]]
angle = "all"
[envelope]
fuzzy = ["k"]
alpha = [0, 1]
duration = "2 s"
step = "0.02 s"
[decision]
limits = ["corner <= 4 mm"]
"""
MASS = np.diag([20e3, 20e3, 120e3])
STIFFNESS = 2e6 * np.array([[1.0, 0, -0.5], [0, 1.4, 0.8], [-0.5, 0.8, 9.0]])


def written(folder, old="", new=""):
    rng = np.random.default_rng(5)
    for name, count, step in (
        ("one", 60, 0.02),
        ("two", 60, 0.02),
        ("three", 60, 0.02),
        ("long", 61, 0.02),
        ("slow", 60, 0.04),
    ):
        rows = "".join(f"{step * k:.2f},{x:.6f}\n" for k, x in enumerate(rng.normal(size=count)))
        (folder / f"{name}.csv").write_text(f"time [s],acceleration [m/s^2]\n{rows}")
    np.save(folder / "mass.npy", MASS)
    np.save(folder / "stiffness.npy", STIFFNESS)
    path = folder / "case.toml"
    assert old in CASE
    path.write_text(CASE.replace(old, new), encoding="utf-8")
    return path


def records_of(path):
    content = load(path).content
    return suite_records(content.records, content.envelope, content.structure)


def test_a_case_over_all_angles_gives_the_bounds_of_python_and_their_angles(tmp_path, capsys):
    path = written(tmp_path)
    assert main(["check", str(path)]) == 0
    checked = capsys.readouterr().out
    assert "RotD50(T1) used" in checked
    assert re.search(r"^mode +period .* effective mass +direction 2$", checked, re.MULTILINE)
    assert "2 components a record, all angles of incidence" in checked
    out = tmp_path / "out"
    assert main(["run", str(path), "--out", str(out), "--no-figures"]) == 0
    printed = capsys.readouterr().out
    summary = summary_of(out)
    structure = load(path).content.structure
    pair = [read_record(tmp_path / f"{name}.csv") for name in ("one", "two")]
    motion = {"duration": 2.0, "step": 0.02, "alpha": [0, 1], "all_angles": True}
    found = over_records(structure.model, structure.inputs(["k"]), [pair], **motion)
    expected = found.by_record["one+two"].peak["corner"]
    peak = summary["records"]["by_record"]["one+two"]["peak"]["corner"]
    assert peak["upper"] == pytest.approx(expected.upper)
    assert peak["worst"]["angle"] == pytest.approx(expected.worst.angle)
    where = f"one+two, {expected.worst.angle:.1f}°"
    assert where in printed
    assert "all angles of incidence, all guaranteed" in " ".join(printed.split())
    assert summary["decision"]["limits"]["corner"]["record"] == where
    assert main(["report", str(out), "--quiet", "--csv", str(tmp_path)]) == 0
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "Each peak is the largest one over all angles of incidence." in page
    head, row, *_ = csv.reader((tmp_path / "records.csv").open(encoding="utf-8"))
    values = dict(zip(head, row, strict=True))
    assert float(values["angle [deg]"]) == pytest.approx(expected.worst.angle)
    assert float(values["peak reached"]) == pytest.approx(expected.reached[0])


def test_an_angle_turns_both_components_after_their_scaling(tmp_path):
    scale = 'scale = "RotD100(T1) = 2 m/s^2"\n'
    (still,) = records_of(written(tmp_path, 'angle = "all"\n', scale))
    assert still.measures["RotD100(T1)"] == pytest.approx(2.0)
    for angle in ("30", '"30 deg"'):
        (turned,) = records_of(written(tmp_path, '"all"\n', f"{angle}\n{scale}"))
        expected = turned_components(*still.components, np.radians(30))
        assert not turned.all_angles
        assert turned.measures == still.measures
        for ground, other in zip(turned.components, expected, strict=True):
            assert ground.samples == pytest.approx(other.samples)


def test_names_of_channels_make_names_of_results(tmp_path):
    rows = "".join(f"{0.02 * k:.2f},{k % 3},{k % 5}\n" for k in range(40))
    (tmp_path / "a.csv").write_text(f"time [s],90 deg [m/s^2],0 deg [m/s^2]\n{rows}")
    path = written(tmp_path, '["one.csv", "two.csv"]', '["a.csv#90 deg", "a.csv#0 deg"]')
    (record,) = records_of(path)
    assert record.name == "a_90_deg+a_0_deg"
    long = "x" * 100
    (tmp_path / f"{long}.csv").write_text((tmp_path / "one.csv").read_text())
    (line,) = refusals(written(tmp_path, "two.csv", f"{long}.csv"))
    assert "88 characters together" in line


def test_patterns_pair_files_in_their_order(tmp_path):
    path = written(tmp_path, '["one.csv", "two.csv"]', '["[ot]*e.csv", "[tls]*o*.csv"]')
    (line,) = refusals(path)
    assert "2 and 3 files; allowed: as many files for each component" in line
    path = written(tmp_path, '["one.csv", "two.csv"]', '["[ot]*e.csv", "t*.csv"]')
    names = [record.name for record in records_of(path)]
    assert names == ["one+three", "three+two"]


def test_the_third_component_is_the_vertical_one(tmp_path):
    for name, place in (("x", "90"), ("y", "0"), ("up", "UP")):
        samples = np.random.default_rng(ord(place[0])).normal(size=40)
        numbers = "".join(f"{x:10.5f}" for x in samples)
        head = f"UNCORRECTED\nCHAN 1: {place} DEG\nACCELERATION TIME SERIES IN UNITS OF CM/SEC2\n"
        (tmp_path / f"{name}.AT2").write_text(f"{head}NPTS= 40, DT= .02 SEC\n{numbers}\n")
    path = written(tmp_path, '[["one.csv", "two.csv"]]', '[["x.AT2", "y.AT2", "up.AT2"]]')
    path.write_text(path.read_text().replace('["x", "y"]', '["x", "y", { "1.r" = 1.0 }]'))
    (record,) = records_of(path)
    assert len(record.components) == 3
    assert not [text for text in record.warnings if "vertical" in text]


SPECTRUM = '[records.spectrum]\nground_acceleration = "0.2 g"\nground_type = "B"'
PAIR = '[["one.csv", "two.csv"]]'


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (PAIR, '[["one.csv", "slow.csv"]]', "slow of 60 samples every 0.04 s"),
        (PAIR, '[["one.csv", "one.csv"]]', "one twice"),
        (PAIR, '[["one.csv", "two.csv"], "three.csv"]', "is 2 and 1 files a record"),
        (PAIR, '[["one.csv"]]', "two or three files"),
        (PAIR, '["one.csv"]', "records.angle is with one component"),
        (f'{PAIR}\nangle = "all"', '["one.csv"]', "records.files is 1 files a record; allowed: 2"),
        (PAIR, '[["one.csv", "two.csv", "three.csv"]]', "is 3 files a record; allowed: 2"),
        ('directions = ["x", "y"]', 'direction = "x"', "is 2 files a record; allowed: 1"),
        ('["x", "y"]', '["x", "z"]', "matrices.directions is z; allowed: one of r, x, y"),
        ('["x", "y"]', '["x", "x"]', "directions that differ"),
        ('["x", "y"]', '["x"]', "1 directions"),
        ('["x", "y"]', '["x", { "2.y" = 1.0 }]', "matrices.directions is 2.y"),
        ("directions", 'direction = "x"\ndirections', "directions is beside direction"),
        ("directions", 'accelerogram = "one.csv"\ndirections', "accelerogram is beside directions"),
        ('"all"', '"any"', '"all", or degrees, as 30'),
        ('"all"', "inf", 'records.angle is inf; allowed: "all", or degrees, as 30'),
        ('"all"', "nan", 'records.angle is nan; allowed: "all", or degrees, as 30'),
        ("corner <= 4 mm", "max corner <= 4 mm", "magnitudes over all angles"),
        ("[envelope]", f"{SPECTRUM}\n[envelope]", "spectrum is beside records of several"),
    ],
)
def test_what_does_not_fit_is_one_line(tmp_path, old, new, message):
    (line,) = refusals(written(tmp_path, old, new))
    assert message in line


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("[envelope]", 'scale = "RotD50(T1) = 0.5 g"\n[envelope]', "records.scale is RotD50(T1)"),
        ("[decision]", '[fragility]\nmeasure = "RotD50(T1)"', "fragility.measure is RotD50(T1)"),
    ],
)
def test_measures_of_two_components_need_them(tmp_path, old, new, message):
    path = written(tmp_path, old, new)
    text = path.read_text().replace(f'{PAIR}\nangle = "all"', '"one.csv"')
    path.write_text(text.replace('directions = ["x", "y"]', 'direction = "x"'))
    (line,) = refusals(path)
    assert message in line


@pytest.mark.parametrize(
    ("directions", "words"),
    [
        ('["x", "y"]', ""),
        ('["x", { "1.x" = 0.6, "1.y" = 0.8 }]', "the first two are not at right angles"),
        ('["x", { "1.y" = 0.5 }]', "the first two move 20,000 kg and 5,000 kg"),
    ],
)
def test_check_warns_of_directions_that_are_no_motions_of_one_ground(
    tmp_path, capsys, directions, words
):
    assert main(["check", str(written(tmp_path, '["x", "y"]', directions))]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert words in said
    assert ("warning: matrices.directions" in said) == bool(words)
