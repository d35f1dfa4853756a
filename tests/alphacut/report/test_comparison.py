"""Several runs side by side, and tables in LaTeX."""

import csv
import re

import pytest

from tests.alphacut.small import summary_of, told_by, two_floors_run


@pytest.fixture(scope="module")
def runs(two_floors, tmp_path_factory):
    stiffer = "frame.modulus='[44, 45, 46] GPa'"
    return two_floors, two_floors_run(
        tmp_path_factory.mktemp("stiffer"), "--no-figures", "--set", stiffer
    )


def test_more_runs_have_a_column_and_a_ratio_each(runs):
    a, b = map(str, runs)
    head, *lines = (re.split(" {2,}", x) for x in told_by("report", a, b, a, b).splitlines())
    assert head[1:5] == ["first", "second", "third", "4th"]
    row = next(x for x in lines if x[0] == "greatest peak of q2")
    values = dict(zip(head, row, strict=True))
    assert values["third"] == values["first"] != values["4th"] == values["second"]
    assert values["third over first"] == "1.000"
    assert values["4th over first"] == values["second over first"]


def test_the_comparison_and_all_tables_are_written(runs, tmp_path):
    a, b = runs
    page = tmp_path / "both.html"
    words = ["--quiet", "--csv", str(tmp_path), "--tables", str(tmp_path), "--out", str(page)]
    told_by("report", a, b, *words)
    assert "greatest peak of q2" in page.read_text(encoding="utf-8")
    assert "greatest peak of q2" in (tmp_path / "comparison.tex").read_text(encoding="utf-8")
    with (tmp_path / "comparison.csv").open(encoding="utf-8") as file:
        rows = {row["at the lowest α"]: row for row in csv.DictReader(file)}
    assert len(rows) > 4
    peaks = [summary_of(x)["envelopes"]["all"]["peak"]["q2"]["upper"][0] for x in runs]
    row = rows["greatest peak of q2"]
    assert [float(row[x]) for x in ("first", "second")] == pytest.approx(
        [peak * 1e3 for peak in peaks], rel=1e-9
    )
    assert row["unit"] == "mm"
    assert float(row["second over first"]) == pytest.approx(peaks[1] / peaks[0], rel=1e-9)
    assert rows["|q2| ≤ 300 mm"]["first"] == "not exceeded"
    told_by("report", a, "--quiet", "--tables", tmp_path)
    names = {path.stem for path in tmp_path.glob("*.tex")}
    assert names >= {"decision", "peaks"}
    text = (tmp_path / "decision.tex").read_text(encoding="utf-8")
    assert r"$\leq$" in text
    assert "≤" not in text
