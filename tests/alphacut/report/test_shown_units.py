"""One unit for each output: that of its limit, on page, table, figure and in sentences."""

import json
import re

import pytest

from alphacut import main
from alphacut.frame.analyses.limits import LimitResult
from alphacut.io.results import ResultsFolder
from alphacut.report.page import render_page
from alphacut.report.results import peak_table
from alphacut.stages.summary import Summary

CASE = """
title = "Units"
stages = ["envelope"]
[frame]
masses = ["20 t", "10 t"]
lengths = "3 m"
stiffness = ["[7, 8, 9] MN/m", "8 MN/m"]
damping_ratio = "5 %"
displacements = ["5 mm", "8 mm"]
outputs = ["drift1", "q2", "base_shear", "a2"]
[envelope]
fuzzy = ["k1"]
alpha = [0, 1]
duration = "1 s"
step = "0.02 s"
[decision]
limits = ["drift1 <= 2 cm", "base_shear <= 0.09 MN", "q2 <= 12 mm"]
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("units")
    (path / "case.toml").write_text(CASE, encoding="utf-8")
    arguments = ["run", f"{path}/case.toml", f"--out={path}/out", "--quiet", "--no-figures"]
    assert main(arguments) == 0
    return ResultsFolder.read(path / "out")


def test_an_output_is_shown_in_the_unit_of_its_limit(folder):
    summary = Summary.read(folder)
    labels = [row[0] for row in peak_table(summary).rows]
    assert {"drift1, cm", "base_shear, MN", "q2, mm", "a2, g"} <= set(labels)
    by_output = {part.output: part for part in summary.decision.limits.values()}
    for name, unit in (("drift1", "cm"), ("base_shear", "MN"), ("q2", "mm")):
        head, rows = summary.decision.table()
        (row,) = [row for row in rows if row[0] == by_output[name].words]
        texts = dict(zip(head, row, strict=True))
        values = [text for text in texts.values() if re.search(r"\d (c|m|M|k)?[mN]\b", text)]
        assert values
        assert all(re.search(rf"\d {unit}\b", text) for text in values), values
    page = render_page(folder)
    data = json.loads(re.search(r'id="envelopes">(.*?)</script>', page, re.DOTALL)[1])[0]
    pairs = zip(data["units"], data["factors"], strict=True)
    shown = dict(zip(data["outputs"], pairs, strict=True))
    assert shown["drift1"] == ("cm", pytest.approx(100.0))
    assert shown["base_shear"] == ("MN", pytest.approx(1e-6))
    assert shown["a2"] == ("g", pytest.approx(1 / 9.80665))
    # the peak in the table is that of the summary, times the factor
    row = next(row for row in peak_table(summary).rows if row[0] == "drift1, cm")
    peak = summary.envelopes["all"].peak["drift1"]
    assert float(row[2].split(" … ")[1]) == pytest.approx(100 * peak.upper[0], rel=1e-3)


@pytest.mark.parametrize(
    ("stated", "limit", "unit"),
    [
        ("20 mm", 0.02, ("mm", 1e3)),
        ("-60 mm", -0.06, ("mm", 1e3)),
        ("350 kN m", 350e3, ("kN m", 1e-3)),
        ("0.3 g", 2.941995, ("g", 1 / 9.80665)),
        ("2 %", 0.06, None),
        ("1/200", 0.015, None),
        ("4", 4.0, None),
        ("", 0.02, None),
    ],
)
def test_the_unit_of_a_limit_is_read_from_its_text(stated, limit, unit):
    found = LimitResult(output="q1", unit="m", limit=limit, stated=stated).stated_unit
    assert found == (None if unit is None else (unit[0], pytest.approx(unit[1])))
