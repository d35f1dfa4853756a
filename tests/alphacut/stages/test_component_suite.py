"""Records of two components in a case: over all angles, turned by one, and what does not fit."""

import csv
import re

import numpy as np
import pytest

from alphacut.case.content import load
from alphacut.frame.analyses.angles import turned_components
from alphacut.stages.suite import suite_records
from tests.alphacut.case.files import prepared
from tests.alphacut.small import summary_of, told_by


def records_of(path):
    content = load(path).content
    return suite_records(content.records, content.envelope, content.structure)


def test_bounds_over_all_angles_are_shown_with_their_angle(tmp_path):
    path = prepared(tmp_path, "components")
    checked = told_by("check", path)
    assert "RotD50(T1) used" in checked
    assert re.search(r"^mode +period .* effective mass +direction 2$", checked, re.MULTILINE)
    assert "2 components a record, all angles of incidence" in checked
    out = tmp_path / "out"
    printed = told_by("run", path, "--out", out, "--no-figures")
    summary = summary_of(out)
    peak = summary["records"]["by_record"]["one+two"]["peak"]["corner"]
    angle = peak["worst"]["angle"]
    where = f"one+two, {angle:.1f}°"
    assert where in printed
    assert "all angles of incidence, all guaranteed" in " ".join(printed.split())
    assert summary["decision"]["limits"]["corner"]["record"] == where
    told_by("report", out, "--quiet", "--csv", tmp_path)
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "Each peak is the largest one over all angles of incidence." in page
    head, row, *_ = csv.reader((tmp_path / "records.csv").open(encoding="utf-8"))
    values = dict(zip(head, row, strict=True))
    assert float(values["angle [deg]"]) == pytest.approx(angle)
    assert float(values["peak reached"]) == pytest.approx(peak["reached"][0])


def test_an_angle_turns_both_components_after_their_scaling(tmp_path):
    scale = 'scale = "RotD100(T1) = 2 m/s^2"\n'
    (still,) = records_of(prepared(tmp_path, "components", {'angle = "all"\n': scale}))
    assert still.measures["RotD100(T1)"] == pytest.approx(2.0)
    for angle in ("30", '"30 deg"'):
        (turned,) = records_of(prepared(tmp_path, "components", {'"all"\n': f"{angle}\n{scale}"}))
        expected = turned_components(*still.components, np.radians(30))
        assert not turned.all_angles
        assert turned.measures == still.measures
        for ground, other in zip(turned.components, expected, strict=True):
            assert ground.samples == pytest.approx(other.samples)


def test_names_of_channels_make_names_of_results(tmp_path):
    rows = "".join(f"{0.02 * k:.2f},{k % 3},{k % 5}\n" for k in range(40))
    (tmp_path / "a.csv").write_text(f"time [s],90 deg [m/s^2],0 deg [m/s^2]\n{rows}")
    path = prepared(
        tmp_path, "components", {'["one.csv", "two.csv"]': '["a.csv#90 deg", "a.csv#0 deg"]'}
    )
    (record,) = records_of(path)
    assert record.name == "a_90_deg+a_0_deg"


def test_patterns_pair_files_in_their_order(tmp_path):
    path = prepared(tmp_path, "components", {'["one.csv", "two.csv"]': '["[ot]*e.csv", "t*.csv"]'})
    names = [record.name for record in records_of(path)]
    assert names == ["one+three", "three+two"]


def test_the_third_component_is_the_vertical_one(tmp_path):
    for name, place in (("x", "90"), ("y", "0"), ("up", "UP")):
        samples = np.random.default_rng(ord(place[0])).normal(size=40)
        numbers = "".join(f"{x:10.5f}" for x in samples)
        head = f"UNCORRECTED\nCHAN 1: {place} DEG\nACCELERATION TIME SERIES IN UNITS OF CM/SEC2\n"
        (tmp_path / f"{name}.AT2").write_text(f"{head}NPTS= 40, DT= .02 SEC\n{numbers}\n")
    path = prepared(
        tmp_path, "components", {'[["one.csv", "two.csv"]]': '[["x.AT2", "y.AT2", "up.AT2"]]'}
    )
    path.write_text(path.read_text().replace('["x", "y"]', '["x", "y", { "1.r" = 1.0 }]'))
    (record,) = records_of(path)
    assert len(record.components) == 3
    assert not [text for text in record.warnings if "vertical" in text]
