"""Signs of limits and peaks: as given in every text and number, against motions drawn at random."""

import csv
import re
from html import unescape

import numpy as np
import pytest

from alphacut.case.content import load
from alphacut.case.limits import DecisionSection
from alphacut.frame import Peak, decide
from alphacut.fuzzy import Nature
from alphacut.report.page import render_template
from alphacut.report.results import peak_table, run_text
from alphacut.report.tables import frames, latex, tables, write_csv
from alphacut.stages.envelope import EnvelopeResult
from alphacut.stages.summary import Parts
from tests.alphacut.small import FRAME

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

    def text(self, limit):
        """The limit as a case has it."""
        relation = ">=" if self.side == "min" else "<="
        return f"{self.name} {relation} {limit!r} {OUTPUTS[self.output]}"

    def verdict(self, limit):
        """What is known of the limit, from the definitions of the words."""
        nearest, farthest = (self.outwards * (x - limit) > 0 for x in self.proved)
        if not farthest:
            return "not exceeded"
        is_reached = self.outwards * (self.farthest - limit) > 0
        return "exceeded" if nearest else "can be exceeded" if is_reached else "undecided"


def parts_of(drawn, structure):
    """Envelope and decision of the drawn bounds."""
    peaks = {}
    for x in drawn:
        ends = {"lower": x.proved[0], "upper": x.proved[1], "error": 0.0, "reached": x.farthest}
        ends |= {"least_lower": x.proved[0], "least_upper": x.nearest}
        if x.side == "min":
            ends |= {"lower": x.proved[1], "upper": x.proved[0]}
        bounds = {end: np.array([value]) for end, value in ends.items()}
        peaks[x.name] = Peak(np.zeros(1), **bounds, nature=Nature.GUARANTEED, side=x.side)
    section = DecisionSection(limits=tuple(x.text(y) for x in drawn for y in x.limits))
    answer = decide(peaks, section.limits_of(structure), units=OUTPUTS)
    numbers = {key: {} for key in ("min", "max", "error")}
    study = EnvelopeResult(
        **numbers, fuzzy=("k1",), alpha=np.zeros(1), peak=peaks,
        seconds=1.0, method="proof", nature=Nature.GUARANTEED, motions_tested=0,
        units=OUTPUTS,
    )  # fmt: skip
    return Parts(envelopes={"all": study}, decision=answer)


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


def tables_of_page(page):
    """Rows of each table of a page, by the titles of its head."""
    tables = []
    for table in re.findall(r"<table>(.*?)</table>", page, re.DOTALL):
        head, *rows = (
            re.findall(r"<t[hd][^>]*>(.*?)</t[hd]>", row, re.DOTALL)
            for row in re.findall(r"<tr>(.*?)</tr>", table, re.DOTALL)
        )
        tables.append([dict(zip(head, map(unescape, row), strict=True)) for row in rows])
    return tables


def rows_of_latex(text):
    signs = {"$-$": "−", r"$\leq$": "≤", r"$\geq$": "≥", r"\dots{}": "…", r"\_": "_", r"\%": "%", "$^2$": "²"}  # fmt: skip
    for sign, letter in signs.items():
        text = text.replace(sign, letter)
    text = text.replace(r"\textasciicircum ", "^").replace(r"\textmu{}", "µ")
    text = text.replace(r"$\alpha$", "α")
    rows = re.findall(r"^(.*) \\\\$", text, re.MULTILINE)
    head, *rows = (row.split(" & ") for row in rows)
    return [dict(zip(head, row, strict=True)) for row in rows]


def test_limits_and_peaks_have_the_sign_that_they_were_given(tmp_path, rng):
    case = tmp_path / "case.toml"
    case.write_text(FRAME, encoding="utf-8")
    structure = load(case).content.structure
    kinds = [(output, side) for output in OUTPUTS for side in ("max", "min", "")]
    for _ in range(LIMITS // (len(kinds) * LIMITS_OF_PEAK)):
        drawn = [Drawn(rng, *kind) for kind in kinds]
        limits = [(peak, limit) for peak in drawn for limit in peak.limits]
        parts = parts_of(drawn, structure)
        of_limits, of_peaks = tables(parts)["decision"], peak_table(parts)
        page = "".join(
            render_template("comparison.html", title="", name="", about="", comparison=table)
            for table in (of_peaks, of_limits)
        )
        lines = run_text(parts).splitlines()
        written = "|".join(re.findall(r">([^<]*)</t[dh]>", page)) + "".join(lines)
        assert "|−" in written
        assert not re.search(r"(?<![\w.])-(?=[\d.])|(?<=\de)-(?=\d)|−0(?![.\d])", written)
        for peak_rows, rows in (
            (rows_of_latex(latex(of_peaks)), rows_of_latex(latex(of_limits))),
            tables_of_page(page),
        ):
            assert rows[-1]["limit"] == "any of them"
            assert len(peak_rows) == len(limits) == len(rows) - 1
            for (peak, limit), peak_row, row in zip(limits, peak_rows, rows, strict=False):
                check_peak(peak, limit, peak_row)
                check_answer(peak, limit, row)
                assert f"decision: {row['limit']}: {peak.verdict(limit)} (guaranteed)" in lines
        write_csv({x: frames(parts)[x] for x in ("peaks", "decision")}, tmp_path)
        numbers, answers = (
            list(csv.DictReader((tmp_path / f"{x}.csv").read_text("utf-8").splitlines()))
            for x in ("peaks", "decision")
        )
        for peak, number in zip(drawn, numbers, strict=True):
            ends = [float(number[x]) for x in ("least peak", "greatest peak", "peak reached")]
            assert ends == pytest.approx([*sorted(peak.proved), peak.farthest], rel=1e-9)
        for (peak, limit), answer in zip(limits, answers, strict=False):
            found = [float(answer[x]) for x in ("limit", "bound of peak", "peak reached")]
            assert found == pytest.approx([limit, peak.proved[1], peak.farthest], rel=1e-9)
            assert answer["verdict"] == peak.verdict(limit)
