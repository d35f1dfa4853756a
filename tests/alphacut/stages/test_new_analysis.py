"""A new analysis takes its own file, with options and answer, a function that draws, one entry."""

from dataclasses import dataclass
from typing import Annotated

import matplotlib.pyplot as plt
import pytest

from alphacut.base.errors import require
from alphacut.base.nature import Nature
from alphacut.base.quantity import Quantity
from alphacut.case.analyses import ANALYSES, Analysis, Picture
from alphacut.frame import Limit
from alphacut.frame.analyses.answer import Answer
from alphacut.frame.analyses.question import Question
from tests.alphacut.small import FRAME, summary_of_run, told_by, written

CASE = (
    FRAME.replace('method = "graph-follower"\ntolerance = "0.1 mm"\n', "")
    + """
[stiffest]
least = "2 kN/m"
limits = ["q1 <= 80 mm"]
"""
)
ALONE = FRAME[: FRAME.index("[envelope]")].replace('"envelope"', '"stiffest"')
ALONE += '[stiffest]\nfuzzy = ["E", "m"]\nalpha = [0, 1]\nleast = "2 kN/m"\n'


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Stiffness(Answer):
    """The largest modulus, over a least stiffness."""

    key = "stiffest"
    title = "How stiff is it?"
    modulus: float
    limits: dict[str, float]

    def text_rows(self):
        yield {"what": "E", "modulus": f"{self.modulus:g}", "nature": Nature.GUARANTEED}

    def number_rows(self):
        yield {"what": "E", "modulus [Pa]": self.modulus}

    def words(self):
        return "It is the upper end of the support."


@dataclass(frozen=True)
class Stiffest(Question):
    """How stiff the structure can be.

    Args:
        least: Smallest stiffness of interest,
            of all storeys.
        count: Number of things.
        limits: Limits of outputs.
    """

    least: Annotated[float, Quantity("N/m", above=0)]
    count: Annotated[int, Quantity(minimum=1, is_integer=True)] = 3
    limits: tuple[Limit, ...] = ()

    def require(self, model, components):
        require(self.count < 5, "count", self.count, "fewer than 5")

    def answer(self, asked, progress):
        limits = {limit.output: limit.value for limit in self.limits}
        largest = asked.inputs["E"].cut(asked.alpha[0])[1]
        return Stiffness(modulus=largest / self.least * 2e3, limits=limits)


@dataclass(frozen=True)
class StiffestAtRest(Stiffest):
    """How stiff it is at rest.

    Args:
        least: Smallest stiffness.
        count: Number.
        limits: Limits.
        fuzzy: Inputs.
        alpha: Levels.
    """

    fuzzy: tuple[str, ...] = ()
    alpha: tuple[float, ...] = (0.0,)


def draw(answer):
    figure, axes = plt.subplots()
    axes.bar([0], [answer.modulus])
    return figure


@pytest.fixture
def entry(monkeypatch):
    picture = Picture(f"{__name__}:draw", "The stiffest of all")
    found = Analysis(f"{__name__}:Stiffness", {"stiffest": picture}, f"{__name__}:Stiffest")
    monkeypatch.setitem(ANALYSES, "stiffest", found)
    return found


def test_a_new_analysis_takes_its_class_and_one_entry(tmp_path, entry):
    case, out = written(tmp_path, CASE), tmp_path / "out"
    told_by("run", case, "--out", out, "--json", "-")
    assert '"modulus": 26000000000.0' in (out / "summary.json").read_text()
    assert (out / "figures/stiffest.png").exists()
    told_by("report", out, "--csv", tmp_path / "csv", "--tables", tmp_path / "tex")
    page = (out / "report.html").read_text()
    assert page.index("How stiff is it?") < page.index("The stiffest of all")
    assert "upper end of the support" in page
    assert (tmp_path / "csv/stiffest.csv").read_text() == "what,modulus [Pa]\nE,26000000000.0\n"
    assert "guaranteed" in (tmp_path / "tex/stiffest.tex").read_text()
    told_by("run", case, "--out", out, "--json", "-")


@pytest.mark.parametrize(
    ("change", "key"),
    [
        ('stiffest.least="0 N/m"', "stiffest.least"),
        ('stiffest.least="2 m"', "stiffest.least"),
        ("stiffest.count=7", "stiffest.count"),
        ("stiffest.count=1.5", "stiffest.count"),
        ('stiffest.limits="q7 <= 3 mm"', "stiffest.limits"),
        ("stiffest.moment=1", "stiffest.count"),
    ],
)
def test_its_options_have_units_ranges_and_words_of_their_own(tmp_path, entry, change, key):
    case = written(tmp_path, CASE)
    (line,) = told_by("check", case, "--set", change, status=2).splitlines()
    assert key in line


def test_a_missing_option_is_said_in_the_words_of_its_class(tmp_path, entry):
    assert "Smallest stiffness of interest, of all storeys" in told_by(
        "check", written(tmp_path, CASE, **{'least = "2 kN/m"\n': ""}), status=2
    )


def test_an_analysis_of_a_structure_at_rest_is_a_stage(tmp_path, monkeypatch, entry):
    alone = entry._replace(section=f"{__name__}:StiffestAtRest", stage="stiffest")
    monkeypatch.setitem(ANALYSES, "stiffest", alone)
    found = summary_of_run(written(tmp_path, ALONE))
    assert found["stiffest"]["modulus"] == pytest.approx(26e9)
    told_by("check", written(tmp_path, ALONE, **{'["E", "m"]': '["E", "x"]'}), status=2)
