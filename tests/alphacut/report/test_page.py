"""The page, the tables and the CSV files of a run: what they say, in which units and with which signs.

Signs of limits and peaks are tested against motions drawn at random.
"""

import csv
import json
import re
import shutil
import subprocess
from dataclasses import replace
from html import escape
from pathlib import PurePosixPath

import numpy as np
import pandas as pd
import pytest

from alphacut import main
from alphacut.base.number_text import Table, range_text
from alphacut.figures.all import FIGURES, caption
from alphacut.frame import Limit, Peak, SuitePeaks, decide
from alphacut.fuzzy import Nature
from alphacut.io.results import ResultsFolder
from alphacut.report.page import render_page, render_template
from alphacut.report.results import answers, compared, comparison, drivers, peak_table, run_text
from alphacut.report.tables import frames, shown, write_csv, write_tables
from alphacut.stages.envelope import EnvelopeResult
from alphacut.stages.summary import FrameResult, Parts, Summary
from tests.alphacut.small import summary_of
from tests.refused import refuses


def changed(two_floors, folder, **keys):
    """A copy of the results with other keys in its summary."""
    copy = folder / "copy"
    shutil.copytree(two_floors, copy)
    text = json.dumps({**summary_of(two_floors), **keys})
    ResultsFolder.read(copy).put_text("summary.json", text)
    return ResultsFolder.read(copy)


@pytest.fixture(scope="module")
def page(two_floors):
    return render_page(ResultsFolder.read(two_floors))


def test_the_page_asks_nothing_of_the_network_and_shows_each_figure_once(two_floors, page):
    assert not re.search(r'(src|href)="(?!data:)', page)
    drawn = [name for name in summary_of(two_floors)["figures"] if name.endswith(".png")]
    assert page.count("data:image/png;base64,") == len(drawn) > 3
    for words in ("Can or must limits be exceeded?", "How far may tolerances go?", "How probable"):
        assert page.count(words) == 1


def test_a_caption_has_the_number_in_the_paper_the_output_and_the_study():
    assert caption("decision") == "Fuzzy peak of each limited output over its limit"
    assert caption("fig28-envelope-E-5s-q1") == "Fig. 28: Envelope of q1, study E-5s"


def test_figures_stand_in_the_sections_of_the_page_that_their_entries_name(two_floors, page):
    stems = {PurePosixPath(name).stem for name in summary_of(two_floors)["figures"]}
    *sections, others = page.split("<h2>")
    for name, figure in FIGURES.items():
        full = {"run": name, "study": f"{name}-all"}.get(figure.of)
        if figure.section and full in stems:
            text = escape(figure.caption)
            assert text not in others
            assert sum(text in section for section in sections) == 1


def test_texts_of_the_case_are_no_markup(page):
    assert "<script>alert" not in page
    assert "Two floors &lt;script&gt;" in page
    assert "made by <code>a &lt;b&gt; command</code></p>" in page
    assert "`" not in page.partition("<h2>More")[0]


def test_a_script_in_a_drawing_does_not_reach_the_page(two_floors, tmp_path):
    copy = changed(two_floors, tmp_path)
    for drawing in (copy.path / "figures").glob("*.svg"):
        drawing.write_text("<svg><script>stolen()</script></svg>", encoding="utf-8")
    assert "stolen" not in render_page(copy)


@pytest.mark.parametrize("name", ["../secret", "/etc/secret", "x-" * 100])
@pytest.mark.parametrize("key", ["figures", "envelopes", "fingerprints"])
def test_a_name_that_leads_out_of_the_folder_is_refused(two_floors, tmp_path, key, name):
    study = summary_of(two_floors)["envelopes"]["all"]
    copy = changed(two_floors, tmp_path, **{key: {name: study}})
    with refuses("copy"):
        render_page(copy)


def study_of(peaks, units):
    """An envelope with some peaks, of one guarantee."""
    numbers = {key: {} for key in ("min", "max", "error")}
    peak = next(iter(peaks.values()))
    return EnvelopeResult(
        **numbers, fuzzy=("E",), alpha=peak.alpha, peak=peaks, seconds=1.0,
        method="proof", nature=peak.nature, motions_tested=0, units=units,
    )  # fmt: skip


def peaks_of(**ends):
    """Parts of a summary with the peaks of some outputs at α = 0, 0.5 and 1."""
    units = {"drift1": "m", "a3": "m/s^2", "base_shear": "N", "q1": "m"}
    peaks = {
        name: Peak(
            **{"alpha": np.array([0, 0.5, 1]), "lower": np.array(low), "upper": np.array(up)},
            **dict.fromkeys(("reached", "least_lower", "least_upper"), np.full(3, np.nan)),
            error=np.array([0.0002]), nature=Nature.ESTIMATED,
        )
        for name, (low, up) in ends.items()
    }  # fmt: skip
    frame = FrameResult(
        omega_rad_per_s=np.ones(1), period_s=6.28, weight_N=1e6, heights_m={"drift1": 4.0}
    )
    return Parts(envelopes={"all": study_of(peaks, units)}, structure=frame)


def test_peaks_are_stated_in_the_units_that_engineers_compare():
    ends = {
        "drift1": ([0.010371, 0.0105, 0.011], [0.012004, 0.0115, 0.011]),
        "a3": ([1.0, 1.5, 2.0], [3.0, 2.5, 2.0]),
        "base_shear": ([1e4, 1e4, 2e4], [4e4, 3e4, 2e4]),
    }
    parts = peaks_of(**ends)
    decision = decide({"drift1": parts.envelopes["all"].peak["drift1"]}, Limit("drift1", 0.02))
    head, rows = peak_table(replace(parts, answered={"decision": decision}))
    assert head == ("peak of", "nominal", "α = 0.5", "α = 0", "± error", "limit", "exceeded")
    assert rows[0][:5] == ("drift1, mm", "11.00", "10.5 … 11.5", "10.37 … 12.01", "0.2")
    assert rows[0][5:] == ("20", "no")
    assert rows[1][:4] == ("  % of storey", "0.2750", "0.262 … 0.288", "0.2592 … 0.3001")
    assert rows[2][:2] == ("a3, g", "0.2039")
    assert rows[4][:4] == ("  % of weight", "2.000", "1.00 … 3.00", "1.000 … 4.000")


def test_the_record_that_moves_a_structure_farthest_is_named_once():
    ends = ([0.010371, 0.0105, 0.011], [0.012004, 0.0115, 0.011])
    parts = peaks_of(drift1=ends)
    study = parts.envelopes["all"]
    suite = SuitePeaks(
        period_s=1.0, damping_ratio=0.05, alpha=study.alpha, by_record={}, statistics={},
        units=study.units, peak=study.peak, farthest_record={"drift1": "kobe"},
    )  # fmt: skip
    head, rows = peak_table(replace(parts, envelopes={}, records=suite))
    assert [row[0] for row in rows] == ["drift1, mm", "  % of storey"]
    assert [row[head.index("record")] for row in rows] == ["kobe", ""]


def test_what_drives_the_peak_is_one_line_of_the_largest_shares():
    shares = {"q1": {"E": 0.1}, "q2": {"E": 0.2, "m1": 0.5, "d": 0.05, "l": 0.3}}
    peaks = {f"the peak of {name}": one for name, one in shares.items()}
    assert [*drivers(Parts(shares=peaks))] == [
        "Fixing m1 narrows the reached peak of q2 by 50%, l by 30%"
    ]


@pytest.mark.parametrize(
    ("low", "high", "nature", "text"),
    [
        (117.2186, 117.2186, Nature.ATTAINED, "117.22"),
        (117.2186, 117.2187, Nature.ATTAINED, "117.22"),  # inwards they would pass each other
        (117.2186, 117.2301, Nature.ATTAINED, "117.22 … 117.23"),
        (117.2186, 117.2186, Nature.GUARANTEED, "117.22"),
        (117.2186, 117.2187, Nature.GUARANTEED, "117.21 … 117.22"),
        (-117.2187, -117.2186, Nature.GUARANTEED, "−117.22 … −117.21"),
        (1.0, np.inf, Nature.GUARANTEED, "1.0000 … inf"),
    ],
)
def test_ends_of_a_range_are_never_printed_past_each_other(low, high, nature, text):
    assert range_text(low, high, nature, 5) == text
    titles = {"E from [GPa]": [low], "E to [GPa]": [high], "nature of E": [str(nature)]}
    lower, upper, _ = shown(pd.DataFrame(titles)).rows[0]
    assert float(lower.replace("−", "-")) <= float(upper.replace("−", "-"))


def test_the_first_tables_have_a_row_for_every_result(two_floors):
    summary = Summary.read(ResultsFolder.read(two_floors))
    assert [row[0] for row in peak_table(summary)[1]] == ["q2, mm", "drift1, m", "  % of storey"]
    shares = summary.shares["the peak of q2"]
    assert set(shares) == {"E", "m1"}
    assert 0.5 < sum(shares.values()) < 1.5
    assert len([row for row in answers(summary) if "tolerances" in row[0]]) == 2
    text = run_text(summary)
    assert text.startswith("Least … largest value if each input stays in its range")
    assert max(map(len, text.splitlines())) <= 80


@pytest.fixture(scope="module")
def tables(two_floors, tmp_path_factory):
    folder, opened = tmp_path_factory.mktemp("csv"), ResultsFolder.read(two_floors)
    return {
        file.stem: list(csv.reader(file.open(encoding="utf-8")))
        for file in write_tables(Summary.read(opened), opened, folder)
    }


def test_an_envelope_has_a_row_a_time_and_units_in_its_head(two_floors, tables):
    import xarray

    head, *rows = tables["envelope_all-q2"]
    assert head[0] == "time [s]"
    assert all(title.endswith("[m]") for title in head[1:])
    assert head[1].startswith("guaranteed lower at alpha 0 ")
    data = xarray.load_dataset(two_floors / "envelope_all.nc")
    assert len(rows) == data.sizes["time"]
    column = np.array([row[1] for row in rows], float)
    lower = data["lower"].sel(output="q2").isel(alpha=0).values
    assert column == pytest.approx(lower, rel=1e-12)


def test_one_peak_has_one_value_in_every_place(two_floors, tables):
    summary = summary_of(two_floors)
    assert set(tables) >= {"peaks", "decision", "probability", "tolerances", "envelope_all-drift1"}
    ends, peaks = ("lower", "upper", "error", "reached"), summary["envelopes"]["all"]["peak"]
    at_one = summary["tolerances"]["peaks"]["q2"]
    decided = {name: summary["decision"]["limits"][name]["peak"] for name in peaks}
    for name, peak in [*decided.items(), ("q2", at_one)]:
        assert [peak[end] for end in ends] == [peaks[name][end] for end in ends]
    head, *rows = tables["peaks"]
    column = [float(row[head.index("greatest peak")]) for row in rows]
    assert column == [x for peak in peaks.values() for x in peak["upper"]]
    # no motion passes the limit within the supports as they are, so more than these are kept
    assert at_one["upper"][0] + at_one["error"][0] <= 0.28
    assert summary["tolerances"]["kept"] >= 1


def test_statistics_of_records_stand_in_the_order_of_their_file():
    names = ["median", "84 %", "mean", "least"]
    statistics = {"q1": {name: np.ones(1) for name in names}}
    facts = {"period_s": 1.0, "damping_ratio": 0.05, "alpha": np.zeros(1), "units": {"q1": "m"}}
    facts |= {"by_record": {}, "peak": {}, "farthest_record": {}}
    parts = Parts(records=SuitePeaks(**facts, statistics=statistics))
    assert [
        row[0].partition(" of")[0] for row in comparison(compared([parts, parts])).rows
    ] == names


def test_numbers_of_csv_are_exact_and_its_texts_are_no_formulas(tmp_path):
    frame = pd.DataFrame(
        {"what": ["=1+1", "−3 … 4", "max a,b"], "value": [-1.5, 0.1 + 0.2, float("nan")]}
    )
    (path,) = write_csv({"answers": frame}, tmp_path)
    lines = path.read_text(encoding="utf-8").splitlines()
    assert lines[1:] == ["'=1+1,-1.5", "'-3 … 4,0.30000000000000004", '"max a,b",']


UNITS = """
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
def shown_units(tmp_path_factory):
    path = tmp_path_factory.mktemp("units")
    (path / "case.toml").write_text(UNITS, encoding="utf-8")
    arguments = ["run", f"{path}/case.toml", f"--out={path}/out", "--quiet", "--no-figures"]
    assert main(arguments) == 0
    return ResultsFolder.read(path / "out")


def test_an_output_is_shown_in_the_unit_of_its_limit(shown_units):
    summary = Summary.read(shown_units)
    labels = [row[0] for row in peak_table(summary).rows]
    assert {"drift1, cm", "base_shear, MN", "q2, mm", "a2, g"} <= set(labels)
    by_output = {part.output: part for part in summary.answered["decision"].limits.values()}
    for name, unit in (("drift1", "cm"), ("base_shear", "MN"), ("q2", "mm")):
        head, rows = summary.answered["decision"].table()
        (row,) = [row for row in rows if row[0] == by_output[name].words]
        texts = dict(zip(head, row, strict=True))
        values = [text for text in texts.values() if re.search(r"\d (c|m|M|k)?[mN]\b", text)]
        assert values
        assert all(re.search(rf"\d {unit}\b", text) for text in values), values
    page = render_page(shown_units)
    data = json.loads(re.search(r'id="envelopes">(.*?)</script>', page, re.DOTALL)[1])[0]
    pairs = zip(data["units"], data["factors"], strict=True)
    shown = dict(zip(data["outputs"], pairs, strict=True))
    assert shown["drift1"] == ("cm", pytest.approx(100.0))
    assert shown["base_shear"] == ("MN", pytest.approx(1e-6))
    assert shown["a2"] == ("g", pytest.approx(1 / 9.80665))


LIMITS, LIMITS_OF_PEAK = 700, 8
OUTPUTS = {"q1": "m", "a1": "m/s^2", "base_shear": "N"}
PREFIXES = {"n": 1e-9, "µ": 1e-6, "m": 1e-3, "": 1.0, "k": 1e3, "M": 1e6}
SI = {prefix + unit: x for prefix, x in PREFIXES.items() for unit in OUTPUTS.values()}
SI |= {"": 1.0, "g": 9.80665}
EXCEEDED = {"yes": "exceeded", "no": "not exceeded", "can be": "can be exceeded"}


def quantity(text):
    """The number of a text such as "−2.000 mm" in SI."""
    number, _, unit = text.replace("\N{MINUS SIGN}", "-").partition(" ")
    return float(number) * SI[unit]


class Drawn:
    """The peak of a side of random motions: its values, bounds of them, and limits in SI."""

    def __init__(self, rng, output, side):
        self.name, self.output, self.side = f"{side} {output}".strip(), output, side
        size, middle = 10 ** rng.uniform(-2, 1.5), rng.choice([-2, -0.5, 0, 0.5, 2])
        extremes = np.sort(size * (rng.normal(size=(6, 2)) + middle), axis=1)  # (motion, min, max)
        magnitudes = np.abs(extremes).max(axis=1)
        values = np.sort({"max": extremes[:, 1], "min": extremes[:, 0], "": magnitudes}[side])
        self.outwards = -1 if side == "min" else 1
        self.nearest, self.farthest = values[:: self.outwards][[0, -1]]
        gap = size * rng.choice([0, 0.05]) * self.outwards
        self.proved = [self.nearest - gap, self.farthest + gap]
        if not side:
            self.proved[0] = max(0.0, self.proved[0])
        limits = rng.choice([*values, *self.proved], LIMITS_OF_PEAK)
        limits += size * rng.normal(size=LIMITS_OF_PEAK) * rng.choice([0.01, 0.3])
        # each once: a case refuses a limit that it states twice
        self.limits = sorted({float(f"{x if side else abs(x):.7g}") for x in limits})

    def limit(self, value):
        """A limit of the peak, as a case states it."""
        largest = {"max": True, "min": False, "": None}[self.side]
        stated = f"{value!r} {OUTPUTS[self.output]}"
        return Limit(self.output, value, largest=largest, stated=stated)

    def verdict(self, limit):
        """What is known of the limit, from the definitions of the words."""
        nearest, farthest = (self.outwards * (x - limit) > 0 for x in self.proved)
        if not farthest:
            return "not exceeded"
        is_reached = self.outwards * (self.farthest - limit) > 0
        return "exceeded" if nearest else "can be exceeded" if is_reached else "undecided"


def parts_of(drawn):
    """Envelope and decision of the drawn bounds."""
    peaks = {}
    for x in drawn:
        ends = {"lower": x.proved[0], "upper": x.proved[1], "error": 0.0, "reached": x.farthest}
        ends |= {"least_lower": x.proved[0], "least_upper": x.nearest}
        if x.side == "min":
            ends |= {"lower": x.proved[1], "upper": x.proved[0]}
        bounds = {end: np.array([value]) for end, value in ends.items()}
        peaks[x.name] = Peak(np.zeros(1), **bounds, nature=Nature.GUARANTEED, side=x.side)
    limits = [x.limit(value) for x in drawn for value in x.limits]
    answer = decide(peaks, limits, units=OUTPUTS)
    return Parts(envelopes={"all": study_of(peaks, OUTPUTS)}, answered={"decision": answer})


def check_answer(peak, limit, cells):
    """A row of an answer: the limit's words, the verdict, margin, bound and reached value.

    Texts are rounded to the side on which they stay true, by up to one unit of the fourth digit.
    """
    size = 1.1e-3 * sum(abs(x) for x in (*peak.proved, limit))
    output = peak.output if peak.side else f"|{peak.output}|"
    before = f"{peak.side} {output} {'≥' if peak.side == 'min' else '≤'} ".lstrip()
    assert cells["limit"].startswith(before)
    assert quantity(cells["limit"].removeprefix(before)) == pytest.approx(limit, abs=size)
    assert cells["verdict"] == peak.verdict(limit)
    margin = peak.outwards * (limit - peak.proved[1])
    relation, bound = cells["bound of peak"].split(" ", 1)
    assert relation == ("≥" if peak.side == "min" else "≤")
    found = [quantity(x) for x in (cells["least margin"], bound, cells["peak reached"])]
    assert found == pytest.approx([margin, peak.proved[1], peak.farthest], abs=size)
    assert found[0] <= margin + 1e-9 * size
    assert peak.outwards * (found[1] - peak.proved[1]) >= -1e-9 * size
    assert peak.outwards * (found[2] - peak.farthest) <= 1e-9 * size


def check_peak(peak, limit, cells):
    """A row of the table of peaks: the range in order, what is reached, limit and verdict."""
    factor = SI[cells["peak of"].rpartition(", ")[2]]
    assert factor * quantity(cells["limit"]) == pytest.approx(limit, rel=1e-3)
    assert EXCEEDED.get(cells["exceeded"], cells["exceeded"]) == peak.verdict(limit)
    if not cells["α = 0"]:  # of further limits
        return
    ends, slack = sorted(peak.proved), 6e-3 * max(map(abs, peak.proved))
    shown = [factor * quantity(x) for x in cells["α = 0"].split(" … ")]
    assert shown[0] <= ends[0] + 1e-9 * slack
    assert shown[-1] >= ends[1] - 1e-9 * slack
    assert [shown[0], shown[-1]] == pytest.approx(ends, abs=slack)
    reached = factor * quantity(cells["reached"])
    assert reached == pytest.approx(peak.farthest, abs=slack)
    assert peak.outwards * (reached - peak.farthest) <= 1e-9 * slack


def test_limits_and_peaks_have_the_sign_that_they_were_given(rng):
    kinds = [(output, side) for output in OUTPUTS for side in ("max", "min", "")]
    for _ in range(LIMITS // (len(kinds) * LIMITS_OF_PEAK)):
        drawn = [Drawn(rng, *kind) for kind in kinds]
        limits = [(peak, limit) for peak in drawn for limit in peak.limits]
        parts = parts_of(drawn)
        of_limits, of_peaks = parts.answered["decision"].table(), peak_table(parts)
        console = run_text(parts)
        texts = "|".join(x for table in (of_limits, of_peaks) for row in table.rows for x in row)
        assert "|−" in texts
        written = texts + console
        assert not re.search(r"(?<![\w.])-(?=[\d.])|(?<=\de)-(?=\d)|−0(?![.\d])", written)
        rows, peak_rows, lines = of_limits.records, of_peaks.records, console.splitlines()
        assert rows[-1]["limit"] == "any of them"
        assert len(peak_rows) == len(limits) == len(rows) - 1
        answers = frames(parts)["decision"].to_dict("records")
        for (peak, limit), peak_row, row, answer in zip(
            limits, peak_rows, rows, answers, strict=False
        ):
            check_peak(peak, limit, peak_row)
            check_answer(peak, limit, row)
            assert f"decision: {row['limit']}: {peak.verdict(limit)} (guaranteed)" in lines
            found = [answer[x] for x in ("limit", "bound of peak", "peak reached")]
            assert found == pytest.approx([limit, peak.proved[1], peak.farthest], rel=1e-9)
            assert answer["verdict"] == peak.verdict(limit)


WIDE_HEAD = ("output", *(f"α = {k / 20:g}: mean over records" for k in range(21)))
WIDE_ROW = ("overturning_moment", *["1.234 … 2.345 MN*m"] * 21)
A4 = 688  # px of 210 mm less both margins of 14 mm, at 96 px an inch
MEASURED = """
<p id="measured"></p><script>
const box = document.querySelector(".scroll"), table = box.querySelector("table");
const cells = [...table.querySelectorAll("td, th")];
const cut = cells.filter((cell) => cell.scrollWidth > cell.clientWidth + 1).length;
document.getElementById("measured").textContent = JSON.stringify({
  table: table.getBoundingClientRect().right, page: document.documentElement.clientWidth, cut,
  overflow: getComputedStyle(box).overflowX, scrolled: box.scrollWidth, width: box.clientWidth });
</script></body>"""


def measured(folder, *, printed):
    """Places of a wide table in px, as chromium lays the page out on paper or on a screen."""
    table = Table(WIDE_HEAD, [WIDE_ROW] * 3)
    text = render_template("comparison.html", title="t", name="n", about="", comparison=table)
    if printed:  # the rules of the paper, in a window as wide as the paper
        text = text.replace("@media print", "@media all")
    (folder / "page.html").write_text(text.replace("</body>", MEASURED), encoding="utf-8")
    options = ["--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={folder}/profile"]
    size = f"--window-size={A4 if printed else 1000},900"
    command = ["chromium", *options, size, "--dump-dom", (folder / "page.html").as_uri()]
    dom = subprocess.run(command, capture_output=True, text=True, timeout=60, check=True).stdout
    return json.loads(re.search(r'id="measured">(.*?)</p>', dom)[1])


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("chromium") is None, reason="needs chromium")
def test_a_wide_table_is_whole_on_paper_and_scrolls_on_the_screen(tmp_path):
    found = measured(tmp_path, printed=True)
    assert found["table"] <= found["page"] + 1
    assert found["cut"] == 0
    found = measured(tmp_path, printed=False)
    assert found["overflow"] == "auto"
    assert found["scrolled"] >= found["width"]
    assert found["width"] <= found["page"]
