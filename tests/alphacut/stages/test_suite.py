"""A suite of records: measures, scaling, peaks by record, fragility against its closed form."""

import re

import numpy as np
import pandas as pd
import pytest

from alphacut.base.number_text import text_table
from alphacut.case.content import load
from alphacut.figures.answers import draw_incremental, draw_spectra
from alphacut.figures.style import figure_style, save
from alphacut.frame import (
    Fragility,
    eurocode8_spectrum,
    read_suite,
    scale_suite,
    spectral_acceleration,
)
from alphacut.io.typed_json import from_document
from alphacut.stages.suite import suite_records
from tests.alphacut.case import files
from tests.alphacut.case.files import prepared
from tests.alphacut.small import summary_of, summary_of_run, told_by

QUICKER = {"0.01 s": "0.02 s"}
YIELDING = QUICKER | {"masses": 'yield_force = ["40 kN ± 9 %"]\nmasses', '"k1"': '"fy1"'}
PERIOD = 2 * np.pi * np.sqrt(20e3 / 8e6)
"""Natural period of the most plausible structure, in s."""


def records_of(folder, *changes):
    content = load(prepared(folder, "suite", changes)).content
    return suite_records(content.records, content.envelope, content.structure)


@pytest.mark.parametrize(
    ("scale", "measure", "value"),
    [('"PGA = 0.3 g"', "PGA", 0.3 * 9.80665), ('"Sa(T1) = 2 m/s^2"', "Sa(T1)", 2.0)],
)
def test_records_are_scaled_to_a_measure(tmp_path, scale, measure, value):
    records = records_of(tmp_path, ("[envelope]", f"scale = {scale}\n[envelope]"))
    for record in records:
        assert record.measures[measure] == pytest.approx(value)
        size = spectral_acceleration(record.ground, PERIOD, 0.05)
        assert record.measures["Sa(T1)"] == pytest.approx(size)


SPECTRUM = """[records.spectrum]
ground_acceleration = "0.2 g"
ground_type = "B"
[envelope]"""


def test_records_are_scaled_to_a_spectrum_as_in_python(tmp_path):
    path = prepared(tmp_path, "suite", QUICKER | {"[envelope]": SPECTRUM})
    told_by("run", path, "--quiet", "--out", tmp_path / "out")
    summary = summary_of(tmp_path / "out")
    assert "figures/spectra.svg" in summary["figures"]
    suite = read_suite([tmp_path / "one.csv", tmp_path / "two.csv"])
    scaled = scale_suite(suite, eurocode8_spectrum(0.2 * 9.80665, "B"), PERIOD)
    for record in scaled.suite:
        measures = summary["records"]["by_record"][record.name]["measures"]
        assert measures["PGA"] == pytest.approx(record.extremes[0])
    assert text_table(*scaled.table()) in told_by("check", path)
    with figure_style():
        (axes,) = draw_spectra(scaled).axes
    *_, mean, _, target, floor = (line.get_ydata() for line in axes.lines)
    assert mean == pytest.approx(scaled.spectra.mean(axis=0)[1:-1] / 9.80665)
    assert min(mean / target) >= 0.9 - 1e-9
    assert floor == pytest.approx(0.9 * target)


def test_each_record_has_its_length_and_five_periods_unless_cut(tmp_path):
    records = records_of(tmp_path)
    free = 1.58 + 5 * PERIOD
    assert [record.duration for record in records] == pytest.approx([free] * 2, abs=0.01)
    cut = records_of(tmp_path, ('"9 s"', '"0.5 s"'))
    assert [record.duration for record in cut] == pytest.approx([0.5] * 2)
    assert all(0.3 < record.facts.truncated_fraction < 0.95 for record in cut)


def test_columns_without_a_head_have_step_and_unit_from_the_case(tmp_path):
    files.suite(tmp_path)
    samples = np.loadtxt(tmp_path / "one.csv", delimiter=",", skiprows=1)[:, 1]
    np.savetxt(tmp_path / "plain.txt", samples)
    new = '[records]\nstep = "0.02 s"\nunit = "m/s^2"\nfiles = ["plain.txt", "two.csv"]'
    record, _ = records_of(tmp_path, ('[records]\nfiles = ["one.csv", "two.csv"]', new))
    assert record.ground.step == 0.02
    assert record.ground.samples == pytest.approx(samples)


def test_what_is_unusual_in_a_record_is_a_warning(tmp_path):
    late = "".join(f"{10 + 0.02 * k:.2f},{60 * np.sin(k)}\n" for k in range(80))
    (tmp_path / "late.csv").write_text(f"time [s],acceleration [m/s^2]\n{late}")
    stated = 'step = "0.02 s"\nunit = "m/s^2"\nfiles = ["late.csv"'
    records = records_of(tmp_path, ('files = ["one.csv"', stated))
    warnings = "\n".join(warning for record in records for warning in record.warnings)
    assert "of record late its times begin at 10 s" in warnings
    assert "of record late its peak is 6.12 g" in warnings
    assert "records.step" not in warnings


def test_the_mean_over_records_is_one_structures_and_is_shown(tmp_path):
    limits = '[decision]\nlimits = ["mean drift1 <= 9 mm"]\n[fragility]'
    path, out = prepared(tmp_path, "suite", QUICKER | {"[fragility]": limits}), tmp_path / "out"
    asked = ["--set", "frame.outputs=['drift1', 'a1']"]
    told = told_by("run", path, "--out", out, *asked)
    summary = summary_of(out)
    # what is asked for has peaks, limited or not, and is shown
    shown = dict(re.findall(r"^(\S.*), \w+  +(.*)$", told, re.MULTILINE))
    assert set(shown) == {"drift1", "a1", "mean drift1", "mean a1"}
    assert all(set(x["peak"]) == {"drift1", "a1"} for x in summary["records"]["by_record"].values())
    peak = summary["decision"]["limits"]["mean drift1"]["peak"]
    records = summary["records"]
    assert peak["proved"][0] == pytest.approx(records["statistics"]["drift1"]["mean"][0], rel=1e-9)
    assert shown["drift1"].endswith(" two")
    reached, _, limit, verdict = shown["mean drift1"].split()[-4:]
    assert float(reached) == pytest.approx(1e3 * peak["reached"][0], rel=1e-3)
    assert (limit, verdict) == ("9", "yes")
    # no number is of different structures
    assert peak["least_upper"] == [None, None]
    assert set(records["statistics"]["drift1"]) == {"mean", "median", "84 %"}


def test_check_shows_what_was_read_and_says_what_is_off(tmp_path):
    path = prepared(tmp_path, "suite")
    text = (tmp_path / "two.csv").read_text().splitlines()
    moved = [text[0], *(f"{t},{float(a) + 0.2}" for t, a in (x.split(",") for x in text[1:]))]
    (tmp_path / "two.csv").write_text("\n".join(moved) + "\n")
    told = told_by("check", path, "--set", "envelope.duration='1 s'")
    assert "mean/peak" in told
    assert "the mean of record two is" in told
    assert "of the Arias intensity of record" in told


def test_fragility_of_columns_that_yield_has_sets_of_measures_for_each_record(tmp_path):
    case = prepared(tmp_path, "suite", YIELDING | {"40 kN ± 9 %": "[36, 40, 46] kN"})
    answer = from_document(Fragility, summary_of_run(case)["fragility"])
    limit, rows = answer.limits["drift1"], pd.DataFrame(answer.known_records(answer.crossings()))
    assert limit.nature == "estimated"
    assert [*rows["record"]] == ["one", "one", "two", "two"]
    first, last = rows["first crossing [m/s^2]"], rows["last non-exceedance [m/s^2]"]
    # those of the most plausible structure lie between
    assert (first[1::2] >= first[0::2].values).all()
    assert (last[1::2] <= last[0::2].values).all()
    for row, interval in enumerate(rows["exceeded by some [m/s^2]"]):
        assert interval.startswith(f"{first[row]:.4g} … ")
    assert "over the records first crossing" in answer.table().rows[0][1]
    # the band is drawn where it changes, though measures were tried far beyond
    assert limit.measure[0] < first.min() < last.max() < limit.measure[-1] < 1.2 * last.max()
    assert [limit.band.lower[0, 0], limit.band.lower[0, -1]] == [0.0, 1.0]


def test_a_limit_that_no_measure_tried_exceeds_is_said_to_be_so(tmp_path):
    case = prepared(tmp_path, "suite", YIELDING | {'"PGA"': '"PGA"\nmost = 0.1'})
    answer = from_document(Fragility, summary_of_run(case)["fragility"])
    words = answer.table().rows[0][1]
    assert "mm/s^2 … no end" in words
    assert "first crossing beyond all measures tried" in words
    assert "inf " not in words
    assert "fragility.most tries more" in answer.words()


def test_curves_of_a_demand_have_their_record_and_are_drawn_once_with_all_limits(tmp_path):
    """The structure is elastic at the first measure: peaks are its drift under the record there."""
    limits = {'"drift1 <= 10 mm"': '"drift1 <= 10 mm", "drift1 <= 25 mm"'}
    case = prepared(tmp_path, "suite", YIELDING | limits)
    answer = from_document(Fragility, summary_of_run(case)["fragility"])
    curves = pd.DataFrame(answer.known_records(answer.curves()))
    assert set(curves["record"]) == {"one", "two"}
    assert (curves["unit"] == "m").all()
    assert set(curves["peak"]) == {"drift1"}
    for record in records_of(tmp_path):
        first = curves[(curves["record"] == record.name) & (curves["α"] == 1.0)].iloc[0]
        scale = first["PGA [m/s^2]"] / record.measures["PGA"]
        drift = scale * spectral_acceleration(record.ground, PERIOD, 0.05) / (8e6 / 20e3)
        assert first["greatest"] == pytest.approx(drift, rel=0.01)
    figure = draw_incremental(answer)
    assert len(figure.axes) == 1
    assert [text.get_text() for text in figure.axes[0].texts] == ["10 mm", "25 mm"]
    drawn = save(figure, tmp_path / "curves")[0].read_text(encoding="utf-8")
    assert drawn.count("<title>one</title>") == drawn.count("<title>two</title>") == 3


def test_a_run_without_shares_and_questions_has_a_page(tmp_path):
    question = '[fragility]\nlimits = ["drift1 <= 10 mm"]\nmeasure = "PGA"\n'
    changes = QUICKER | {question: "", "stages": "shares = false\nstages"}
    summary = summary_of_run(prepared(tmp_path, "suite", changes))
    assert "fingerprints" not in summary
    told_by("report", tmp_path / "out", "--quiet")
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "One storey under two records" in page
