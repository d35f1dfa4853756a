"""Questions of a case: their answers, and what a further one touches."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from alphacut.case.content import QUESTIONS
from alphacut.fuzzy import Triangular
from alphacut.fuzzy.refused import RefusedError
from alphacut.questions.probability import shaped_like
from alphacut.questions.question import Limit, _limit
from tests.alphacut import one_case

ROOT = Path(__file__).parents[3]


@pytest.fixture(scope="module")
def summary(results):
    return json.loads((results / "summary.json").read_text(encoding="utf-8"))


def test_decision_and_probability_agree(summary):
    """A limit that no motion passes has no probability of being passed, and one that all pass has 1."""
    limits, events = summary["decision"]["limits"], summary["probability"]["events"]
    assert set(limits) == set(events)
    for name, one in limits.items():
        assert one["nature"] == "guaranteed"
        if one["verdict"] == "not exceeded":
            assert max(events[name]["upper"]) == 0
        if one["verdict"] == "exceeded":
            assert min(events[name]["lower"]) == 1


def test_margins_are_limits_less_peaks(summary):
    peak = summary["envelopes"]["all"]["peak"]["q2"]
    one = summary["decision"]["limits"]["q2"]
    margin = one["limit"] - np.array(peak["upper"])
    assert one["margin"]["lower"] == pytest.approx(margin, abs=2e-2 * one["limit"])


def test_tolerances_keep_what_the_decision_keeps(summary):
    answer = summary["tolerances"]
    assert answer["nature"] == "guaranteed"
    assert answer["kept"] is not None
    if answer["passed"] is not None:
        assert answer["kept"] < answer["passed"] <= answer["most"]
    for one in answer["supports"].values():
        assert one["kept"][0] < one["modal"] < one["kept"][1]


@pytest.mark.parametrize(
    ("text", "limit"),
    [
        ("drift1 <= 40 mm", Limit("drift1", 0.04, False, "drift1 <= 40 mm")),
        ("drift1 <= 0.5 %", Limit("drift1", 0.005, True, "drift1 <= 0.5 %")),
        ("base_shear<=9 N", Limit("base_shear", 9.0, False, "base_shear<=9 N")),
    ],
)
def test_limits_are_read(text, limit):
    assert _limit(text) == limit


@pytest.mark.parametrize("text", ["q1", "q1 <= ", "q1 <= -1 m", "q1 <= 3 N", "q 1 <= 3 m", 7])
def test_limits_without_a_meaning_are_refused(text):
    with pytest.raises(RefusedError):
        _limit(text)


def test_random_inputs_have_the_shape_of_their_membership():
    draws = shaped_like(Triangular(0, 1, 3))(np.random.default_rng(), 20_000)
    assert draws.mean() == pytest.approx(4 / 3, abs=0.01)  # of a triangular density
    assert (draws < 1).mean() == pytest.approx(1 / 3, abs=0.01)


def test_every_question_is_complete():
    assert len({one.key for one in QUESTIONS}) == len(QUESTIONS)
    for one in QUESTIONS:
        assert one.__doc__
        assert len(one.head) >= 3


FOURTH = '''"""Mean of a motion."""

import numpy as np

from alphacut.figures import style
from alphacut.questions.question import Question


class Mean(Question):
    """Mean of the modal motion."""

    key = "mean"
    title = "What is the mean?"
    caption = "Mean of the motion"
    head = ("mean of", "value", "nature")

    def answer(self, motion):
        """Mean of each limited output at the modal values."""
        flow = motion.structure.flow((), motion.duration, motion.step)
        values = flow.values(np.zeros((1, 0)))[0].mean(0)
        means = dict(zip(map(str, flow.outputs), map(float, values)))
        return {limit.output: means[limit.output] for limit in self.limits}

    @staticmethod
    def rows(document):
        return [(name, f"{value:.4g}", "attained") for name, value in document.items()]

    @staticmethod
    def words(document):
        return "The mean over time at the modal values."

    @staticmethod
    def figure(document):
        drawn, axes = style.figure()
        axes.bar(list(document), list(document.values()))
        return drawn
'''


def test_a_fourth_question_touches_one_file_and_one_table(tmp_path):
    """A section, an answer, a figure, lines of the report and a CSV file come of one file."""
    for package in ("fuzzy", "stochastic", "rve", "frame", "pyproject.toml"):
        (tmp_path / package).symlink_to(ROOT / package)
    shutil.copytree(ROOT / "alphacut", tmp_path / "alphacut", symlinks=True)
    questions = tmp_path / "alphacut" / "questions"
    (questions / "mean.py").write_text(FOURTH, encoding="utf-8")
    table = tmp_path / "alphacut" / "case" / "content.py"
    text, name = table.read_text(encoding="utf-8"), "from alphacut.questions.tolerances import"
    text = text.replace(name, f"from alphacut.questions.mean import Mean\n{name}")
    text = text.replace("(ProbabilitySection, ", "(ProbabilitySection, Mean, ")
    text = text.replace("    decision: D", "    mean: Mean | None = None\n    decision: D")
    table.write_text(text, encoding="utf-8")
    case = tmp_path / "case.toml"
    case.write_text(f'{one_case.TEXT}[mean]\nlimits = ["q2 <= 1 m"]\n', encoding="utf-8")
    environment = {**os.environ, "PYTHONPATH": str(tmp_path)}

    def alphacut(*words):
        command = [sys.executable, "-m", "alphacut", *words, "--quiet"]
        done = subprocess.run(
            command, cwd=tmp_path, env=environment, capture_output=True, text=True
        )
        assert done.returncode == 0, done.stderr

    alphacut("run", "case.toml", "--out", "out")
    alphacut("report", "out", "--csv", "csv")
    summary = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))
    assert set(summary["mean"]) == {"q2"}
    assert "figures/mean.png" in summary["figures"]
    assert "What is the mean?" in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert (tmp_path / "csv" / "mean.csv").read_text(encoding="utf-8").startswith("mean of,value")
