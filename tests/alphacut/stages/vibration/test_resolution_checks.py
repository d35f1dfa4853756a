"""A step or tolerance that is coarse beside the motion is warned of with its cure, and refused
where that is wanted.
"""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from alphacut.case.load import load
from alphacut.case.quick import quick
from alphacut.entry import main
from alphacut.frame import LinearFlow, StoreyFrame
from alphacut.frame.boxes import UnitFlow, boxes
from alphacut.frame.checks.tolerance import tolerance_guard
from alphacut.fuzzy import Triangular
from alphacut.stages.readiness import ready
from alphacut.stages.vibration.envelope_task import task_of

CASES = Path(__file__).parents[4] / "cases"
PAPER = str(CASES / "paper.toml")
SHORT = ["--fuzzy", "E", "--duration", "2", "--alpha", "0"]
FRAME = StoreyFrame(
    (3.0, 2.0), (1.0, 1.2), 5.0, 1.0, q0=(0.1, 0.0), outputs=("q1", "drift2", "shear1")
)


def test_the_guard_names_the_output_for_which_a_tolerance_is_coarsest():
    inputs = {"E": Triangular(4, 5, 6)}
    flow = UnitFlow(LinearFlow(FRAME, ("E",), 4, 0.05), boxes(inputs))
    peak = np.abs(flow.flow.values(np.array([[5.0]]))[0]).max(0)
    # of mixed units the first output's; the others' in proportion
    found = tolerance_guard(flow, 0.02 * peak[0])
    assert found.share == pytest.approx(0.02)
    assert not found.ok
    assert tolerance_guard(flow, found.cure).ok
    assert f"take at most {found.cure:.1g}"[:20] in found.message
    assert tolerance_guard(UnitFlow(flow.flow, flow.boxes, relative=True), 0.01).ok
    lengths = UnitFlow(
        LinearFlow(StoreyFrame((3.0, 2.0), (1.0, 1.2), 5.0, 1.0, q0=(0.1, 0.0)), ("E",), 0.5, 0.05),
        boxes(inputs),
    )
    assert tolerance_guard(lengths, 1e-3).output == "q2"  # hardly moves yet


def test_a_coarse_tolerance_warns_and_is_refused_under_strict(capfd):
    assert main(["envelope", PAPER, *SHORT, "--tolerance", "1 cm"]) == 0
    (line,) = capfd.readouterr().err.splitlines()
    assert "warning: envelope.tolerance: 0.01 m is 3." in line
    assert "or envelope.relative_tolerance = 0.001" in line
    assert main(["envelope", PAPER, *SHORT, "--tolerance", "1 cm", "--strict"]) == 2
    captured = capfd.readouterr()
    assert captured.out == ""
    assert "envelope.tolerance: 0.01 m" in captured.err
    assert (
        main(
            [
                "envelope",
                PAPER,
                *SHORT,
                "--method",
                "vertex",
                "--strict",
                "--set",
                "envelope.integrator=exact",
            ]
        )
        == 0
    )
    assert capfd.readouterr().err == ""  # that method has no tolerance


@pytest.mark.parametrize(
    "name", ["paper", "building", pytest.param("tower", marks=pytest.mark.slow), "pendulum"]
)
def test_shipped_cases_and_their_quick_forms_are_not_rough(name):
    assert ready(load(CASES / f"{name}.toml")).rough == ()
    assert ready(quick(load(CASES / f"{name}.toml"))).rough == ()


def test_a_run_and_a_check_say_it_too(tmp_path, capfd):
    changes = ["--set", "envelope.tolerance=1 cm", "--set", 'stages=["envelope"]']
    assert main(["check", PAPER, *changes, "--json", "-"]) == 0
    captured = capfd.readouterr()
    assert len(json.loads(captured.out)["warnings"]) == len(captured.err.splitlines()) > 0
    assert main(["run", PAPER, *changes, "--strict", "--out", str(tmp_path / "results")]) == 2
    assert "envelope.tolerance" in capfd.readouterr().err
    assert not (tmp_path / "results").exists()


def test_a_tolerance_may_be_a_share_of_each_peak(capfd):
    task = task_of(
        load(PAPER, ["envelope.relative_tolerance=0.1 %"], without=("envelope.tolerance",))
    )
    assert (task.tolerance, task.relative) == (0.001, True)
    found = {}
    for option, value in (
        ("--set", "envelope.relative_tolerance=0.0001"),
        ("--tolerance", "1 um"),
        ("--set", "envelope.relative_tolerance=0.01"),
    ):
        told = ["--best-effort", "--json", "-"]  # the midpoint rule keeps no micrometre
        assert main(["envelope", PAPER, *SHORT, option, value, *told]) == 0
        found[value] = json.loads(capfd.readouterr().out)["trajectories"]
    assert found["envelope.relative_tolerance=0.01"] < found["envelope.relative_tolerance=0.0001"]
    assert found["envelope.relative_tolerance=0.0001"] <= found["1 um"]


@pytest.mark.parametrize(
    ("case", "changes", "words"),
    [
        ("paper", ["envelope.relative_tolerance=0.001"], "there is a tolerance besides"),
        ("paper", ["envelope.relative_tolerance=2"], "inside (0, 1)"),
        ("pendulum", ["envelope.tolerance=1 mm"], "a pendulum's output is a force"),
    ],
)
def test_tolerances_that_contradict_each_other(case, changes, words, capfd):
    assert (
        main(
            [
                "check",
                str(CASES / f"{case}.toml"),
                *(word for change in changes for word in ("--set", change)),
            ]
        )
        == 2
    )
    assert words in capfd.readouterr().err


def test_modal_named_keeps_the_tolerance_that_is_asked_for():
    fuzzy = ["--fuzzy", "E,m", "--duration", "30", "--step", "0.1", "--alpha", "0"]
    assert main(["envelope", PAPER, *fuzzy, "--method", "modal", "--tolerance", "1e-4"]) == 0


def test_check_tells_the_wanted_error_of_each_output(capfd):
    building = str(CASES / "building.toml")
    assert main(["check", building]) == 0
    told = capfd.readouterr().out
    assert "envelope: wanted error up to q8 200 µm, drift1 66 µm, base_shear 2.0 kN\n" in told
    assert main(["check", building, "--set", 'frame.outputs=["q8", "drift1"]']) == 0
    assert "wanted error up to q8 200 µm, drift1 200 µm\n" in capfd.readouterr().out
    gap = ["--set", "envelope.certify=3 mm", "--set", "envelope.method=modal"]
    outputs = ["--set", 'frame.outputs=["drift1", "q8", "a8"]']
    assert main(["check", building, *gap, *outputs]) == 0
    assert "envelope: wanted gap up to drift1 3.0 mm, q8 9." in capfd.readouterr().out


def test_a_smaller_step_is_told_with_what_it_leaves(capfd):
    """What is left is told for the step advised: 3 % beside 3 % advises nothing."""
    building, changes = str(CASES / "building.toml"), ["--set", "envelope.step=0.04 s"]
    assert main(["check", building, *changes, "--set", 'frame.outputs=["q8", "a1"]']) == 0
    said = re.search(
        r"open by some \w+ ([\d.]+) %.* s leaves some ([\d.]+) %", capfd.readouterr().err
    )
    assert said
    assert 1 < float(said[2]) < 3 < float(said[1])
