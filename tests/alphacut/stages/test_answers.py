"""Questions of a case: their answers, and what a further one touches."""

from pkgutil import resolve_name

import numpy as np
import pytest

from alphacut.case.analyses import ANALYSES, answer_class
from alphacut.case.cell import CellCase
from alphacut.case.content import Content, load
from alphacut.case.generated import section_at
from alphacut.case.limits import parse_limit
from alphacut.case.structures import with_structures
from alphacut.frame import Decision, Exact, LinearFlow
from alphacut.frame.analyses.answer import Answer
from alphacut.io.typed_json import from_document
from tests.alphacut.small import summary_of, summary_of_run, written
from tests.refused import refuses


@pytest.fixture(scope="module")
def summary(two_floors):
    return summary_of(two_floors)


def test_decision_and_probability_agree(summary):
    """A limit that no motion passes has no probability of being passed, and one that all pass has 1."""
    limits, events = summary["decision"]["limits"], summary["probability"]["events"]
    assert set(limits) == set(events)
    assert {limit["nature"] for limit in limits.values()} == {"guaranteed"}
    verdicts = {name: limit["verdict"] for name, limit in limits.items()}
    assert (verdicts["q2"], verdicts["drift1"]) == ("not exceeded", "exceeded")
    assert max(events["q2"]["upper"]) == 0
    assert min(events["drift1"]["lower"]) == 1
    margin = limits["q2"]["limit"] - np.array(limits["q2"]["peak"]["upper"])
    assert limits["q2"]["margin"]["lower"] == pytest.approx(margin)


def test_tolerances_keep_what_the_decision_keeps(summary):
    answer = summary["tolerances"]
    assert answer["nature"] == "guaranteed"
    assert 1 < answer["kept"] < answer["passed"] <= answer["most"]
    assert set(answer["supports"]) == {"E", "m1"}
    for support in answer["supports"].values():
        low, high = support["kept"]
        assert low < support["own"][0] < support["nominal"] < support["own"][1] < high


@pytest.mark.parametrize(
    ("text", "peak", "value", "is_relative"),
    [
        ("drift1 <= 40 mm", "drift1", 0.04, False),
        ("drift1 <= 0.5 %", "drift1", 0.005, True),
        ("base_shear<=9 N", "base_shear", 9.0, False),
        ("max q3 <= -2 mm", "max q3", -0.002, False),
        ("min q3 >= -60 mm", "min q3", -0.06, False),
        ("moment <= 2 kN m", "moment", 2e3, False),
        ("residual2 <= 1/200", "residual2", 0.005, True),
    ],
)
def test_limits_are_read(text, peak, value, is_relative):
    limit = parse_limit(text)
    assert (limit.peak, limit.value, limit.is_relative) == (peak, value, is_relative)


def test_limits_of_every_storey_are_of_least_heights_and_weights(tmp_path):
    limits = ["drift <= 2 %", "max a <= 1 g", "base_shear <= 5 %"]
    limits += ["drift2 <= 1/100", "max a2 <= 2 g"]
    asked = LIMITS.split("limits = ")[0].replace('["7 t", "7 t"]', '["[6, 7, 8] t", "7 t"]')
    text = f'title = "Storeys"\nstages = ["envelope"]\n{asked}limits = {limits}\n'
    limits = summary_of_run(written(tmp_path, text), "--set=shares=false")["decision"]["limits"]
    del limits["any of them"]
    values, g = {name: limit["limit"] for name, limit in limits.items()}, 9.80665
    expected = {"drift1": 0.058, "drift2 <= 2 %": 0.06, "drift2 <= 1/100": 0.03, "max a1": g}
    expected |= {"max a2 <= 1 g": g, "max a2 <= 2 g": 2 * g, "base_shear": 0.05 * g * 13e3}
    assert values == pytest.approx(expected)


WRONG = ["q1", "q1 <= ", "q1 <= -1 m", "q1 <= 3 N", "q 1 <= 3 m", 7]
WRONG += ["max q3 >= 2 mm", "min q3 <= 2 mm", "q3 >= 2 mm", "q3 <= 1/200", "drift <= 1/0"]
WRONG += ["r1 <= [1, 2] m", "r1 <= 5 m ± 1 m"]


@pytest.mark.parametrize("text", WRONG)
def test_limits_without_a_meaning_are_refused(text):
    with refuses(""):
        parse_limit(text)


def test_every_question_is_complete():
    """Of each entry the class of the answer, the section and the pictures exist."""
    asked = set()
    for key, analysis in ANALYSES.items():
        assert answer_class(key).key == key
        assert analysis.pictures
        if analysis.section:
            asked.add(key)
            assert section_at(key, analysis.section).key == key
        for picture in analysis.pictures.values():
            assert picture.caption
            assert callable(resolve_name(picture.draw))
    for kind, built in ((Content, True), (CellCase, False)):
        assert asked <= set(with_structures(kind, built=built).model_fields)


def test_every_answer_is_registered():
    def below(kind):
        for inner in kind.__subclasses__():
            yield inner
            yield from below(inner)

    own = {x for x in below(Answer) if x.__module__.startswith("alphacut.frame.")}
    not_asked = (
        "Sensitivity",
        "SuitePeaks",
        "AnglePeaks",
        "LearnedInputs",
        "ScaledSuite",
        "ScaledPeaks",
    )
    registered = {answer_class(key) for key in ANALYSES}
    assert {x.__name__ for x in own - registered} <= set(not_asked)


LIMITS = """
[frame]
stiffness = ["80 kN/m ± 5 %", "60 kN/m"]
masses = ["7 t", "7 t"]
lengths = ["[2.9, 3, 3.1] m", "3 m"]
damping_ratio = "2 %"
displacements = ["50 mm", "0 mm"]
outputs = ["q2", "drift1"]
[envelope]
fuzzy = ["k1"]
alpha = [0, 1]
duration = "2 s"
step = "0.02 s"
[decision]
limits = ["drift1 <= 1 %", "drift1 <= 3 %", "max drift1 <= 60 mm", "min drift1 >= -60 mm",
          "min drift1 >= -20 mm", "min drift1 >= -40.6 mm", "min q2 >= 1 m", "q1 <= 1 m", "max q1 <= 2 m"]
"""


def test_an_output_has_several_limits_of_each_side_and_of_its_magnitude(tmp_path):
    case = written(tmp_path, 'title = "Limits"\nstages = ["envelope"]\n' + LIMITS)
    summary = summary_of_run(case)
    limits = summary["decision"]["limits"]
    assert limits["drift1 <= 1 %"]["limit"] == pytest.approx(0.029)  # of the least height
    verdicts = {name: limit["verdict"] for name, limit in limits.items()}
    assert verdicts == {
        "drift1 <= 1 %": "exceeded",
        "drift1 <= 3 %": "not exceeded",
        "max drift1": "not exceeded",
        "min drift1 >= -60 mm": "not exceeded",
        "min drift1 >= -20 mm": "exceeded",
        "min drift1 >= -40.6 mm": "can be exceeded",
        "min q2": "exceeded",
        "q1": "not exceeded",  # no output of the frame's own
        "max q1": "not exceeded",
        "any of them": "exceeded",
    }
    band = summary["envelopes"]["all"]
    least = limits["min drift1 >= -60 mm"]["peak"]
    assert least["proved"][0] == pytest.approx(band["min"]["drift1"], rel=0.02)
    assert least["reached"][0] >= least["proved"][0]
    head, texts = from_document(Decision, summary["decision"]).table()
    rows = [dict(zip(head, row, strict=True)) for row in texts]
    assert rows[0]["limit"] == "|drift1| ≤ 1 % (29.00 mm)"
    # the inputs that the verdict names move so
    stiffness = limits["min drift1 >= -40.6 mm"]["peak"]["reached_at"]["k1"]
    assert rows[5]["verdict"] == f"can be exceeded, as at k1 = {stiffness / 1e3:.2f} kN/m"
    flow = LinearFlow(load(case).content.structure.model, ("k1",), 2.0, 1e-3, Exact())
    drift = [*map(str, flow.outputs)].index("drift1")
    assert flow.values(np.array([[stiffness]])).min(axis=1)[0, drift] < -0.0406


def test_a_frame_at_rest_is_a_stage_with_verdicts(tmp_path):
    case = """title = "One storey under a push"
stages = ["static"]
[frame]
masses = ["20 t", "20 t"]
stiffness = ["5 MN/m ± 10 %", "4 MN/m"]
damping_ratio = "0 %"
outputs = ["q2", "base_shear"]
[[force]]
history = "step, static"
amplitude = { 2 = "[8, 10, 12] kN" }
[static]
fuzzy = ["k1", "F2"]
alpha = [0, 1]
limits = ["q2 <= 6 mm", "q2 <= 5 mm", "base_shear <= 9 kN"]
"""
    path = tmp_path / "push.toml"
    path.write_text(case, encoding="utf-8")
    found = summary_of_run(path)["static"]
    lower, upper = np.array(found["bounds"])[0, 0]
    assert lower == pytest.approx(8e3 / 5.5e6 + 8e3 / 4e6, rel=1e-6)
    assert upper == pytest.approx(12e3 / 4.5e6 + 12e3 / 4e6, rel=1e-6)
    assert np.array(found["bounds"])[0, 1] == pytest.approx([8e3, 12e3], rel=1e-6)
    assert np.array(found["attained"]) == pytest.approx(np.array(found["bounds"]), rel=1e-6)
