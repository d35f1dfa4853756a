"""Answers on learned inputs are those of a box around the learned set, on screen, page and CSV."""

import pandas as pd

from tests.alphacut.small import summary_of, told_by

CASE = """
title = "Two stiffnesses from one frequency"
stages = ["envelope"]
[frame]
masses = ["20 t", "20 t"]
stiffness = ["[6, 14] MN/m", "[6, 14] MN/m"]
damping_ratio = "[4, 5, 6] %"
displacements = ["10 mm", "20 mm"]
outputs = ["drift1"]
[identify]
measured = "modes.csv"
learn = ["k"]
frequency_deviation = 0.01
[envelope]
fuzzy = ["k", "zeta"]
alpha = [0.05, 1]
duration = "0.5 s"
step = "0.02 s"
"""
QUESTIONS = """
[decision]
limits = ["drift1 <= 11 mm", "drift1 <= 30 mm"]
[tolerances]
limits = ["drift1 <= 30 mm"]
most = 1
[probability]
limits = ["drift1 <= 11 mm"]
random = ["zeta"]
samples = 3
"""
ALONE = CASE.replace('["k", "zeta"]', '["k"]').replace("[0.05, 1]", "[0.05]")
ALONE = ALONE.replace("[4, 5, 6] %", "5 %")
"""The learned inputs alone are fuzzy."""
BOX = "of the box around the learned set"


def run_with(folder, text):
    """The summary, the console, the page and the CSV files of a run by name."""
    (folder / "modes.csv").write_text("mode,frequency [Hz]\n1,2.199\n")
    case = folder / "case.toml"
    case.write_text(text, encoding="utf-8")
    told = " ".join(told_by("run", case, "--no-figures", "--out", folder / "out").split())
    told_by("report", folder / "out", "--csv", folder / "csv")
    (page,) = (folder / "out").glob("*.html")
    tables = {path.stem: pd.read_csv(path) for path in (folder / "csv").glob("*.csv")}
    return summary_of(folder / "out"), told, page.read_text(encoding="utf-8"), tables


def test_questions_say_of_which_box_they_are_and_claim_nothing_reached_in_it(tmp_path):
    summary, told, page, tables = run_with(tmp_path, CASE + QUESTIONS)
    low, high, _ = (summary["decision"]["limits"][x] for x in summary["decision"]["limits"])
    assert low["verdict"] == "undecided"
    assert low["possibility"] == [0.0, 1.0]
    assert low["peak"]["reached"] == [None, None]
    assert low["peak"]["reached_at"] == {}
    assert high["verdict"] == "not exceeded"
    assert summary["tolerances"]["passed"] is None
    assert summary["tolerances"]["clear"] is None
    assert "can be exceeded" not in told
    assert f"drift1| ≤ 11 mm: undecided (guaranteed {BOX})" in told
    assert f"not exceeded from α = 0.05 up (guaranteed {BOX})" in told
    assert "nothing is known to be reached" in told
    assert "reached" not in told.partition("Peaks are")[0]
    for name in ("decision", "probability", "tolerances"):
        assert tables[name]["nature"].str.endswith(BOX).all(), name
    assert tables["decision"]["peak reached"].isna().all()
    assert tables["peaks"]["peak reached"].isna().all()
    assert (tables["peaks"]["inputs"] == BOX).all()
    over_time = tables["envelope_all-drift1"]
    assert not any("attained" in title for title in over_time)
    assert sum(BOX in title for title in over_time) == 4
    assert page.count(BOX) >= 6


def test_an_envelope_of_the_learned_inputs_alone_is_that_of_the_learned_set(tmp_path):
    summary, told, _, tables = run_with(tmp_path, ALONE)
    peak = summary["envelopes"]["all"]["peak"]["drift1"]
    assert peak["nature"] == "guaranteed"
    assert BOX not in told
    assert peak["reached"][0] <= peak["upper"][0]
    assert not any(BOX in title for title in tables["envelope_all-drift1"])
    assert "exact motions agree with what is guaranteed" in told_by("verify", tmp_path / "out")


def test_limited_outputs_that_are_not_listed_have_the_bounds_of_the_learned_set(tmp_path):
    upper, members = [], []
    for name, outputs in (("unlisted", ["drift1"]), ("listed", ["drift1", "drift2"])):
        folder = tmp_path / name
        folder.mkdir()
        case = ALONE.replace('["drift1"]', str(outputs).replace("'", '"'))
        case += '[decision]\nlimits = ["drift2 <= 12 mm"]\n'
        summary, told, _, tables = run_with(folder, case)
        peak = summary["envelopes"]["all"]["peak"]["drift2"]
        assert BOX not in told
        upper.append(peak["upper"][0])
        members.append(peak["reached"][0])
        # What is drawn and tabulated over time are the outputs that the case lists.
        assert ("envelope_all-drift2" in tables) == (name == "listed")
    assert upper[0] == upper[1]
    assert members[0] == members[1] <= upper[0]


def test_nothing_is_said_to_be_open_of_studies_whose_column_reached_is_filled(tmp_path):
    studies = '[[study]]\nname = "set"\nfuzzy = ["k"]\nduration = "0.5 s"\n'
    studies += '[[study]]\nname = "box"\nfuzzy = ["k", "zeta"]\nduration = "0.5 s"\n'
    _, told, page, tables = run_with(tmp_path, CASE.replace("[0.05, 1]", "[0.05]") + studies)
    assert "box: all bounds are those of the box around the learned set." in told
    assert "box: all bounds are those" in page
    reached = tables["peaks"].set_index("study")["peak reached"]
    assert reached["set"] > 0
    assert pd.isna(reached["box"])
