"""Section [decision]: degrees, margins, report, and limits that make no sense."""

from __future__ import annotations

import csv
import json
import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
import xarray

from alphacut.case.load import load
from alphacut.entry import main
from alphacut.figures import questions
from alphacut.io.units import engineering
from alphacut.stages.vibration import decision
from alphacut.stages.vibration.decision import (
    ANY,
    _peaks,
    _reasons,
    _verdicts,
    degree,
    outward,
    sentences,
    why,
    worth,
)
from alphacut.stages.vibration.envelope_task import task_of
from alphacut.stages.vibration.structure import Structure, structure
from tests.alphacut.one_floor import RIGIDITY, one_floor

# |q| = v0 / ω, base shear v0 ω m
CASE = (
    one_floor(
        fuzzy='["m1"]',
        duration=2,
        step=1e-3,
        outputs='["q1", "drift1"]',
        mass="[800, 1000, 1200] kg",
        pushed="0.5 m/s",
    )
    + "[decision]\nlimits = LIMITS\n"
)


def written(folder: Path, limits: object, more: str = "") -> Path:
    path = folder / "one.toml"
    path.write_text(CASE.replace("LIMITS", json.dumps(limits)) + more, encoding="utf-8")
    return path


def peak(mass: float) -> float:
    return 0.5 * float(np.sqrt(mass / RIGIDITY))


def test_degrees_and_margins_of_limits_and_of_any(tmp_path: Path) -> None:
    share = 100 * peak(900) / 3  # of the storey's height: exceeded beyond 900 kg, kept to 0.5
    shear = 0.5 * np.sqrt(1100 * RIGIDITY)  # exceeded from m = 1100 on: possible to 0.5
    limits = [f"drift1 <= {share} %", f"base_shear <= {shear} N"]  # the latter not observed
    out = tmp_path / "out"
    assert main(["run", str(written(tmp_path, limits)), "--out", str(out), "--quiet"]) == 0
    found = json.loads((out / "summary.json").read_text(encoding="utf-8"))["decision"]
    one, two, both = (found["limits"][x] for x in ("drift1", "base_shear", "any of them"))
    assert one["possibility"] == [1, 1]
    assert one["necessity"] == pytest.approx([0.5, 0.5], abs=0.01)
    assert two["possibility"] == pytest.approx([0.5, 0.5], abs=0.01)
    assert two["necessity"] == [0, 0]
    assert two["witness"]["m1"] == pytest.approx(1100, rel=0.01)
    assert both["possibility"] == [1, 1]
    assert both["necessity"] == pytest.approx([0.5, 0.5], abs=0.01)
    assert all(x["nature"] == "guaranteed" for x in found["limits"].values())
    margin = found["margins"]["drift1"]
    assert margin["limit"] == pytest.approx(peak(900))
    assert margin["lower"][0] == pytest.approx(peak(900) - peak(1200), abs=1e-4)
    assert margin["lower"][-1] == pytest.approx(peak(900) - peak(1000), abs=1e-4)
    assert margin["upper"][0] >= peak(900) - peak(800) - 1e-9
    assert main(["report", str(out), "--quiet"]) == 0
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "<h2>Decision</h2>" in page
    assert "<td>any of them</td>" in page
    assert "Fuzzy peak of each limited output beside its limit" in page


def test_a_safe_limit_and_a_sure_failure(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = written(tmp_path, ["q1 <= 1 m"])
    asked = ["--out", str(tmp_path / "out"), "--no-figures"]
    assert main(["run", str(path), *asked]) == 0
    kept = "safe (guaranteed, at nodes every 0.001 s: between them kept by the guaranteed envelope"
    told = capsys.readouterr().out
    assert f"|q1| > 1.000 m: possible to 0, necessary to 0: {kept}, see the margin)" in told
    assert main(["run", str(path), *asked, "--set", "decision.limits=['q1 <= 1 mm']"]) == 0
    over = "unsafe (guaranteed, at nodes every 0.001 s: exceeded there, so over time, too)"
    assert f"possible to 1, necessary to 1: {over}" in capsys.readouterr().out


def test_a_limit_is_not_called_safe_on_levels_that_are_not_computed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Beyond 1100 kg, from α = 0.5 down, the motion passes the limit."""
    out, from_up = tmp_path / "out", "from α = 0.9 up; open below"
    path = written(tmp_path, [f"q1 <= {peak(1100)} m", f"base_shear <= {1e-3 * RIGIDITY} N"])
    asked = ["--out", str(out), "--set", "envelope.alpha=[0.9, 1]"]
    assert main(["run", str(path), *asked]) == 0
    told = capsys.readouterr().out
    assert f"possible to 0 … 0.9, necessary to 0: kept {from_up} (guaranteed, at nodes" in told
    assert f": exceeded {from_up} (guaranteed, at nodes" in told
    assert main(["report", str(out), "--quiet"]) == 0
    page = re.sub("<[^>]*>", "", (out / "report.html").read_text(encoding="utf-8"))
    assert page.count(f"kept {from_up}") == 2  # key results and decisions
    assert " safe" not in told + page.partition("Terms")[0]


def test_a_verdict_tells_that_motion_between_nodes_is_left_out(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """No motion passes the limit at a node half a second apart, and some do between two."""
    out = tmp_path / "out"
    path = written(tmp_path, [f"q1 <= {0.999 * peak(1200)} m", "q1 <= 1 m"])
    asked = ["--out", str(out), "--set", "envelope.step=0.5 s"]
    assert main(["run", str(path), *asked, "--no-figures"]) == 0
    found = json.loads((out / "summary.json").read_text(encoding="utf-8"))["decision"]
    margin, end = next(iter(found["margins"].values())), "; a smaller step may settle it"
    open_by = engineering(-margin["lower"][0], "m", digits=3)
    left = f"between them open by up to {open_by}{end}"
    told = capsys.readouterr().out
    assert f"kept at the nodes (guaranteed, at nodes every 0.5 s: {left})" in told
    assert told.count("safe (") == 1  # the other limit, whose margin is positive
    each = [one["between_nodes"] for one in found["limits"].values()]
    kept = f"between them kept by the {found['peaks']} envelope, see the margin"
    assert each == [left, kept, f"between them open{end}"]
    assert main(["report", str(out), "--quiet", "--csv", str(out / "tables")]) == 0
    with (out / "tables" / "decision.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    columns = ("limit value", "limit unit", "verdict", "nature", "between nodes")
    first, last = (tuple(rows[k][name] for name in columns) for k in (0, -1))
    limit = str(next(iter(found["margins"].values()))["limit"])
    assert first == (limit, "m", "safe", "guaranteed", left)
    found["limits"]["q1 <= 1 m"]["verdict"] = "kept from α = 0.9 up; open below"
    found["limits"]["q1 <= 1 m"]["between_nodes"] = left
    at_nodes = "kept at the nodes from α = 0.9 up; open below"
    assert decision.verdict_of(found, "q1 <= 1 m") == at_nodes
    assert last == ("", "", "safe", "guaranteed", f"between them open{end}")
    (name,) = (out / "tables").glob("decision-by-alpha*")
    with name.open(encoding="utf-8") as file:
        margins = list(csv.DictReader(file))
    assert {row["nature of peaks"] for row in margins} == {found["peaks"]}
    page = (out / "report.html").read_text(encoding="utf-8")
    text = re.sub("<[^>]*>", "", page)
    assert text.count(f"kept at the nodes (guaranteed, at nodes every 0.5 s: {left}") >= 1
    assert text.count(f"at nodes every 0.5 s: {left}") >= 2  # key results and decisions


def test_two_limits_on_one_output_are_two_decisions(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, high = tmp_path / "out", f"{1000 * peak(1250)} mm"
    limits = [f"q1 <= {high}", f"q1 <= {peak(900)} m", "drift1 <= 1 m"]
    path = written(tmp_path, limits)
    assert main(["run", str(path), "--out", str(out)]) == 0
    found = json.loads((out / "summary.json").read_text(encoding="utf-8"))["decision"]
    verdicts = {name: one["verdict"] for name, one in found["limits"].items()}
    assert list(verdicts) == [limits[0], limits[1], "drift1", "any of them"]
    assert list(verdicts.values()) == ["safe", "undecided", "safe", "undecided"]
    assert found["limits"]["any of them"]["necessity"] == pytest.approx([0.5, 0.5], abs=0.01)
    margins = [found["margins"][name] for name in limits[:2]]
    assert [margin["output"] for margin in margins] == ["q1", "q1"]
    assert [margin["unit"] for margin in margins] == ["m", "m"]
    assert margins[0]["limit"] - margins[1]["limit"] == pytest.approx(peak(1250) - peak(900))
    assert margins[0]["lower"][0] - margins[1]["lower"][0] == pytest.approx(peak(1250) - peak(900))
    printed = capsys.readouterr().out
    assert f"safety margin of {limits[0]} at" in printed
    assert main(["report", str(out), "--quiet"]) == 0
    page = (out / "report.html").read_text(encoding="utf-8")
    assert page.count("<td>q1</td>") >= 2
    assert (out / "figures" / "decision.png").is_file() or (out / "decision.png").is_file()


def test_motion_between_nodes_takes_from_one_end_of_a_margin_alone(tmp_path: Path) -> None:
    out, limit = tmp_path / "out", peak(1000)
    asked = ["--out", str(out), "--no-figures", "--quiet", "--set", "envelope.step=50 ms"]
    assert main(["run", str(written(tmp_path, [f"q1 <= {limit} m"])), *asked]) == 0
    summary = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    ends, margin = summary["envelopes"]["all"]["peak"]["q1"], summary["decision"]["margins"]["q1"]
    assert ends["error"][0] > 0.005 * limit
    assert margin["upper"][0] == pytest.approx(limit - ends["lower"][0], abs=1e-12)
    assert margin["lower"][0] == pytest.approx(limit - ends["upper"][0] - ends["error"][0])


def test_a_margin_is_that_of_the_envelope_shown_where_other_limits_need_their_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The further envelope begins with the first output, whose tolerance or gap is told."""

    def peaks(nature: str, **high: float) -> xarray.Dataset:
        ends = np.array([[[0.0] * len(high), [*high.values()]]])
        axes = {"alpha": [0.0], "bound": ["lower", "upper"], "output": list(high)}
        return xarray.Dataset({"peak": (tuple(axes), ends)}, axes, {"nature": nature})

    def compute(wanted: Structure, task: object) -> None:
        assert wanted.frame is not None
        asked.append(wanted.frame.outputs)

    asked = list[tuple[str, ...]]()
    case = load(str(written(tmp_path, ["q1 <= 1 m"])))
    more = peaks("estimated", q1=9.0, base_shear=4.0)
    monkeypatch.setattr(decision.envelope, "compute", compute)
    monkeypatch.setattr(decision, "with_peaks", lambda *_: more)
    given, both = peaks("guaranteed", q1=3.0), ["base_shear", "q1"]
    found = _peaks(both, structure(case, None), task_of(case), given)
    assert asked == [("q1", "base_shear")]
    assert found["peak"].sel(output=both, bound="upper").values.tolist() == [[4.0, 3.0]]
    assert found.attrs["nature"] == "guaranteed or estimated"
    assert _peaks(["q1"], structure(case, None), task_of(case), given) is given


@pytest.mark.parametrize(
    ("limits", "pattern"),
    [
        (["q1 40 mm"], "'q1 40 mm' is no limit"),
        (["q1 <= 40"], "decision.limits"),
        (["q1 <= 40 kN"], "a quantity in m"),
        (["q1 <= -4 mm"], "greater than 0"),
        (["q1 <= 4 mm", "q1 <= 0.004 m"], "a limit is there twice"),
        (["q7 <= 4 mm"], "q7 is not among the structure's outputs"),
        (["roof <= 4 m"], "roof is not among the structure's outputs"),
        ([], "the array is empty"),
        (3, "decision.limits"),
    ],
)
def test_limits_that_make_no_sense(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], limits: object, pattern: str
) -> None:
    out = tmp_path / "out"
    assert main(["run", str(written(tmp_path, limits)), "--out", str(out)]) == 2
    told = capsys.readouterr().err.strip()
    assert pattern in told
    assert len(told.splitlines()) == 1
    assert not out.exists()


MANY = """
schema = 1
title = "Many inputs"
about = "More than a proof can take."
stages = ["envelope"]
[frame]
masses = ["20 t ± 3 %", "20 t ± 3 %", "20 t ± 3 %", "20 t ± 3 %"]
stiffness = ["40 MN/m ± 5 %", "40 MN/m ± 5 %", "40 MN/m ± 5 %", "40 MN/m ± 5 %"]
damping_ratio = RATIO
displacements = "0 m"
velocities = "1 m/s"
[envelope]
fuzzy = ["stiffness", "m"]
duration = "1 s"
step = "0.02 s"
MORE
"""
FEW = ["--set", "envelope.fuzzy=m1"]


@pytest.mark.parametrize(
    ("command", "more"),
    [
        (["check"], "[decision]\nlimits = ['q1 <= 1 m']"),
        (["run"], "[decision]\nlimits = ['q1 <= 1 m']"),
        (["check"], "certify = '1 mm'"),
        (["envelope"], "certify = '1 mm'"),
        (["envelope", "--explain"], "certify = '1 mm'"),
    ],
)
def test_a_proof_that_none_can_afford_is_refused_before(
    command: list[str], more: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "many.toml"
    path.write_text(MANY.replace("RATIO", '"3 %"').replace("MORE", more), encoding="utf-8")
    where = ["--out", str(tmp_path / "out")] if command == ["run"] else []
    assert main([command[0], str(path), *command[1:], *where]) == 2
    told = capsys.readouterr().err
    assert "proofs are affordable up to 6 fuzzy inputs, and there are 8" in told
    assert ("searched and not proved" in told) is ("decision" in more)
    assert not (tmp_path / "out").exists()


def test_a_proof_that_the_damping_forbids_is_told_before(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "own.toml"
    text = MANY.replace("RATIO", '["3 %", "3 %", "4 %", "5 %"]').replace("MORE", "certify = '1 mm'")
    path.write_text(text, encoding="utf-8")
    told = "verified by sampling, not proved: a damping ratio for each mode"
    assert main(["check", str(path), *FEW]) == 0
    assert told in "".join(capsys.readouterr())
    assert main(["envelope", str(path), "--explain", *FEW]) == 0
    assert told in capsys.readouterr().out


@pytest.mark.parametrize(
    ("ends", "kept", "told"),
    [
        ((0.0, 9.095e-13), (0.0, 1e-6), "0"),
        ((0.9999999996880433, 1.0), (0.999999, 1.0), "1"),
        ((0.25, 0.75), (0.25, 0.75), "0.25 … 0.75"),
        ((0.1234567, 0.1234568), (0.123456, 0.123457), "0.1235"),
    ],
)
def test_degrees_carry_no_digits_of_the_search(ends, kept, told):
    assert outward(ends) == pytest.approx(kept, abs=1e-15)
    assert outward(ends)[0] <= ends[0] <= ends[1] <= outward(ends)[1]
    assert degree(*ends) == told


def test_a_storey_that_is_not_there_is_told_before_its_height(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = written(tmp_path, ["drift7 <= 0.5 %"])
    assert main(["check", str(path)]) == 2
    told = capsys.readouterr().err
    assert "drift7 is not among the structure's outputs" in told
    assert "frame.lengths" not in told


def test_what_is_not_proved_is_judged_by_the_envelope_with_a_reason() -> None:
    def one(witness: object, verdict: str = "undecided") -> Any:
        return cast("Any", SimpleNamespace(verdict=verdict, scale=SimpleNamespace(witness=witness)))

    margin = np.array([[0.2, 0.1, -0.1, -0.3], [0.4, 0.3, 0.2, -0.1]])
    found = {"a": one(None), "b": one(1.0), "c": one(None), "d": one(None), ANY: one(1.0)}
    told = list(_verdicts(found, margin, "estimated"))
    kept, sure = "holds by the estimated envelope (not proved)", "holds by the guaranteed envelope"
    passed = "exceeded by the estimated envelope (not proved)"
    assert told == [kept, "undecided", "undecided", passed, "undecided"]
    assert next(_verdicts(found, margin, "guaranteed")) == sure
    calm = {"a": one(None), "b": one(None, "safe"), ANY: one(None)}
    assert list(_verdicts(calm, margin, "estimated")) == [kept, "safe", kept]
    for verdict, witness, words, *most in (
        (kept, None, "; fewer or narrower fuzzy inputs would give a proof"),
        ("undecided", None, ", since neither a proof nor a motion beyond it was found"),
        ("undecided", {"m1": 1.0}, ", since some of the motions exceed it", 0.9),
        ("undecided", {"m1": 1.0}, ", since a motion beyond it was found, and neither"),
        ("safe", None, ""),
        (sure, None, ""),
    ):
        necessity = (0.0, *(most or [1.0]))
        told = why({"verdict": verdict, "witness": witness, "necessity": necessity})
        assert told.startswith(words)
        assert bool(told) is bool(words)


def test_an_undecided_limit_is_told_with_its_reason_before_its_degrees(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = written(tmp_path, [f"q1 <= {peak(1100)} m"])
    assert main(["run", str(path), "--out", str(tmp_path / "out"), "--no-figures"]) == 0
    why = "undecided, since some of the motions exceed it and some do not; narrower inputs decide"
    told = capsys.readouterr().out
    assert f"mm: {why}. It is possible to 0.4998" in told
    assert ", both degrees guaranteed, at nodes every 0.001 s: the motion between" in told


def test_the_margin_of_an_exceeded_limit_ends_at_zero() -> None:
    one = {"possibility": (1, 1), "necessity": (1, 1), "verdict": "unsafe", "nature": "guaranteed"}
    margin = {"output": "q1", "limit": 6.3e-3, "unit": "m", "lower": [-2e-3], "upper": [1.9e-4]}
    found = {
        "limits": {"q1": {**one, "between_nodes": ""}},
        "margins": {"q1": margin},
        "alpha": [0.0],
        **{"step": 0.01, "peaks": "guaranteed", "reason": "", "claim": ""},
    }
    line = list(sentences(found))[1]
    assert "−2.00 mm … 0 m (peaks guaranteed; upper end 0 by the decision, 190 µm by them" in line
    found["limits"] = {"q1": {**found["limits"]["q1"], "verdict": "undecided", "witness": None}}
    assert "−2.00 mm … 190 µm (peaks guaranteed)" in list(sentences(found))[1]


def test_a_limit_that_the_envelope_keeps_is_told_by_what_it_spares_and_its_own_reason() -> None:
    one = {"possibility": (0, 1), "necessity": (0, 0), "nature": "verified by sampling"}
    one |= {"verdict": "holds by the estimated envelope (not proved)", "witness": None}
    margin = {"output": "q1", "limit": 6.3e-3, "unit": "m", "lower": [2e-3], "upper": [3e-3]}
    found = {
        "limits": {name: {**one, "between_nodes": ""} for name in ("q1", ANY)},
        "margins": {"q1": margin},
        "alpha": [0.0],
        **{"step": 0.01, "peaks": "estimated", "claim": ""},
        "reason": "of q1: it takes many points\nof q2: it takes more",
    }
    lines, end = list(sentences(found)), "; fewer or narrower fuzzy inputs would give a proof"
    kept = "not proved, but kept by the estimated envelope"
    assert lines[0] == f"|q1| > 6.300 mm: {kept} with 2.00 mm to spare{end}"
    assert lines[1] == f"{ANY}: {kept}{end}"
    assert lines[-1] == "not proved, of q2: it takes more"
    assert worth(found, "q1").startswith("at nodes every 0.01 s: between them kept by")
    found["limits"] = {"q1": {**one, "between_nodes": "", "possibility": (0, 0.4)}}
    assert "to spare" + end + ". It is possible to 0 … 0.4, n" in next(sentences(found))


def test_reasons_name_the_limits_that_they_are_of() -> None:
    def of(reason: str) -> Any:
        return SimpleNamespace(scale=SimpleNamespace(reason=reason))

    found = {"a": of("why"), "b": of(""), "c": of("why"), "d": of("else"), ANY: of("why")}
    assert list(_reasons(found)) == ["of a, c: why", "of d: else"]


def test_the_figure_of_decisions_leaves_out_what_a_sure_excess_rules_out() -> None:
    """The peaks alone leave room below the limit, which no motion keeps."""
    ends = [[[-1.0, -1.0], [0.5, 0.5]]]
    found = xarray.Dataset(
        {
            **{
                kind: (("limit", "bound"), [[1.0, 1.0], [low, 1.0]])
                for kind, low in (("possibility", 1.0), ("necessity", 0.0))
            },
            "margin": (("alpha", "bound", "output"), ends),
        },
        {
            **{"limit": ["a", "b"], "output": ["a", "b"], "bound": ["lower", "upper"]},
            **{"alpha": [0.0], "allowed": ("output", [1.0, 1.0])},
        },
        {"verdict": "unsafe, undecided"},
    )
    (axes,) = questions.decision(found).axes
    full, hatched, whole, none = (patch.get_bbox() for patch in axes.patches)
    assert (full.x0, full.x1, hatched.x0, hatched.x1) == (1.0, 2.0, 0.5, 1.0)
    assert (whole.x0, whole.x1, none.width) == (0.5, 2.0, 0.0)
    told = [text.get_text() for text in axes.texts]
    assert told[0].endswith("necessary to 1: exceeded for sure, not where hatched")
    assert told[1] == "exceeding is possible to 1, necessary to 0 … 1 (unknown)"


def test_explain_tells_what_decisions_of_many_inputs_may_take(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    case = load(written(tmp_path, ["q1 <= 5 cm", "drift1 <= 2 %"]))
    wanted = structure(case, None)
    (few,) = decision.explained(case, wanted, task_of(case))
    assert re.match(r"decision, of run: about \S+ s; 2 limits, ten times as much", few)
    assert "for each limit" not in few
    monkeypatch.setattr(decision, "MANY", 1)
    (many,) = decision.explained(case, wanted, task_of(case))
    assert "a minute or more for each limit where no proof covers the 1 inputs" in many


def test_the_limit_farthest_from_its_peak_is_tried_first_and_told_in_its_place(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    tried: list[float] = []
    whole = decision.exceeding

    def told(frame: Any, inputs: Any, limits: dict[str, float], **how: Any) -> Any:
        tried.append(next(iter(limits.values())))
        return whole(frame, inputs, limits, **how)

    monkeypatch.setattr(decision, "exceeding", told)
    case = load(written(tmp_path, ["q1 <= 5 cm", "drift1 <= 20 %"]))
    found = decision.decision(case, structure(case, None))
    assert tried[:2] == pytest.approx([0.6, 0.05])
    assert [*map(str, found["output"].values)] == ["q1", "drift1"]
