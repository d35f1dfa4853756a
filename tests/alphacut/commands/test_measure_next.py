"""Command ``alphacut measure-next``: gains that are known, the cell's inputs, bad input, report."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

from alphacut.entry import main
from tests.alphacut.one_floor import OMEGA, one_floor

# over a whole period the mean width is in proportion to the sum of the widths of q0 and of v0 / ω
CASE = one_floor(
    fuzzy='["v0", "q0"]',
    duration=2 * np.pi / OMEGA,
    step=2 * np.pi / OMEGA / 256,
    moved="[8, 10, 12] mm",
    pushed=f"[{9e-3 * OMEGA}, {10e-3 * OMEGA}, {11e-3 * OMEGA}] m/s",
)


@pytest.fixture
def case(tmp_path: Path) -> Path:
    path = tmp_path / "one.toml"
    path.write_text(CASE, encoding="utf-8")
    return path


@pytest.mark.parametrize("output", ["q1", "v1"])
def test_gains_of_a_linear_motion(case: Path, tmp_path: Path, output: str) -> None:
    told = tmp_path / "told.json"
    asked = ["--output", output, "--json", str(told), "--quiet"]
    assert main(["measure-next", str(case), *asked]) == 0
    found = json.loads(told.read_text(encoding="utf-8"))
    assert found["answer"] == output
    assert [*found["gains"]] == ["q1_0", "v1_0"]
    for name, share in (("q1_0", 2 / 3), ("v1_0", 1 / 3)):
        gain = found["gains"][name]
        assert gain["half"] == pytest.approx(share / 2, rel=5e-3)
        assert gain["half_least"] == pytest.approx(share / 2, rel=5e-3)
        assert gain["exact"] == pytest.approx(share, rel=5e-3)


def test_the_width_is_told_with_its_unit_and_what_it_is(
    case: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["measure-next", str(case)]) == 0
    told = capsys.readouterr().out
    assert re.match(r"q1: mean width at nodes every 0\.\d+ s [\d.]+ mm at α = 0, less by", told), (
        told
    )


def test_the_report_of_the_folder_shows_it(case: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert main(["run", str(case), "--out", str(out), "--quiet"]) == 0
    assert main(["measure-next", str(case), "--out", str(out), "--quiet"]) == 0
    assert main(["report", str(out), "--quiet"]) == 0
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "<h2>What to measure next</h2>" in page
    assert page.count("Width lost if an input is known twice as well, and exactly") == 1


def test_inputs_of_the_cell_stand_in_for_its_modulus(tmp_path: Path) -> None:
    paper = Path(__file__).parents[3] / "cases" / "paper.toml"
    told = tmp_path / "told.json"
    asked = ["--json", str(told), "--quiet", "--set", 'stages=["modulus"]']
    assert main(["measure-next", str(paper), *asked]) == 0
    found = json.loads(told.read_text(encoding="utf-8"))
    assert found["answer"] == "E"
    assert [*found["gains"]] == ["a4", "a2", "inclusion_modulus"]
    lost = sum(gain["exact"] for gain in found["gains"].values())
    assert lost == pytest.approx(1, abs=0.1)  # about linear


@pytest.mark.parametrize(
    ("arguments", "pattern"),
    [
        (["--output", "q7"], "there is no such output"),
        (["--fuzzy", "m"], "crisp"),
        (["--set", "exceedance.limit=3 m"], "exceedance"),
        (["--set", "envelope.method=none"], "envelope.method"),
        (["--set", "frame.rayleigh_mass=9e6 1/s"], "; allowed: modes that oscillate"),
    ],
)
def test_questions_that_make_no_sense(
    case: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], pattern: str
) -> None:
    assert main(["measure-next", str(case), *arguments]) == 2
    told = capsys.readouterr().err.strip()
    assert pattern in told
    assert len(told.splitlines()) == 1


def test_a_pendulum_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    path = Path(__file__).parents[3] / "cases" / "pendulum.toml"
    assert main(["measure-next", str(path)]) == 2
    assert "linear structures" in capsys.readouterr().err


def test_fuzzy_inputs_that_are_held_fixed_are_told(
    case: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    assert main(["measure-next", str(case), "--fuzzy", "v0"]) == 0
    out = capfd.readouterr().out
    assert out.endswith("fixed at the middle of the top cut, since no study names them: q1_0\n")
