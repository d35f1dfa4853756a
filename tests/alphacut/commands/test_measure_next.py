"""Command ``alphacut measure-next``: gains that are known, the cell's inputs, bad input, report."""

from __future__ import annotations

import html
import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from alphacut.entry import main
from alphacut.io.provenance import door
from tests.alphacut.one_floor import OMEGA, one_floor

# over a whole period the mean width is in proportion to the sum of the widths of q0 and of v0 / ω
FINE, CASE = (
    one_floor(
        fuzzy='["v0", "q0"]',
        duration=2 * np.pi / OMEGA,
        step=2 * np.pi / OMEGA / steps,
        moved="[8, 10, 12] mm",
        pushed=f"[{9e-3 * OMEGA}, {10e-3 * OMEGA}, {11e-3 * OMEGA}] m/s",
    )
    for steps in (256, 32)
)


@pytest.fixture
def case(tmp_path: Path) -> Path:
    path = tmp_path / "one.toml"
    path.write_text(CASE, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def ran(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Results of a run, with gains."""
    folder = tmp_path_factory.mktemp("ran")
    (folder / "one.toml").write_text(CASE, encoding="utf-8")
    for command in (["run", "--no-figures"], ["measure-next"]):
        asked = [*command, str(folder / "one.toml"), "--out", str(folder / "out"), "--quiet"]
        assert main(asked) == 0
    return folder / "out"


@pytest.fixture
def out(ran: Path, tmp_path: Path) -> Path:
    """A copy of them."""
    return Path(shutil.copytree(ran, tmp_path / "out"))


@pytest.mark.parametrize("output", ["q1", "v1"])
def test_gains_of_a_linear_motion(case: Path, tmp_path: Path, output: str) -> None:
    told = tmp_path / "told.json"
    case.write_text(FINE, encoding="utf-8")
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


def page_after(out: Path, *asked: str) -> str:
    """What the report says of measure-next, asked so; all of the page where it says nothing."""
    if asked:
        assert main(["measure-next", *asked, "--out", str(out), "--quiet"]) == 0
    assert main(["report", str(out), "--quiet"]) == 0
    page = html.unescape((out / "report.html").read_text(encoding="utf-8"))
    page = re.sub(r"</?a\b[^>]*>", "", page)  # links to terms
    return page.partition("<h2>What to measure next</h2>")[2].partition("</section>")[0] or page


def test_the_report_leaves_out_what_was_computed_of_another_frame(
    case: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    out, changed = tmp_path / "out", ["--set", "frame.masses=2 t"]
    assert main(["run", str(case), *changed, "--out", str(out), "--quiet", "--no-figures"]) == 0
    page = page_after(out, str(case))
    assert "The gains in measure-next.json rest on another frame than this run and are left" in page
    assert f"{door('measure-next', 'CASE.toml', '--out', out)}, with every --set of the run" in page
    assert "<table" not in page
    page = page_after(out, str(case), *changed)
    assert "<table" in page
    assert "rest on" not in page
    page = page_after(out, str(case), *changed, "--fuzzy", "q0")  # asked on purpose
    assert "<table" in page
    assert "The gains in measure-next.json rest on another envelope than this run." in page
    capfd.readouterr()


def test_gains_belong_to_the_quick_run_of_their_case(case: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert main(["run", str(case), "--quick", "--out", str(out), "--quiet", "--no-figures"]) == 0
    page = page_after(out, str(case))
    assert "<table" in page
    assert "rest on" not in page


@pytest.mark.parametrize("old", ["measure-next.json", "summary.json"])
def test_files_of_older_programs_are_shown_with_what_is_not_known(out: Path, old: str) -> None:
    told = json.loads((out / old).read_text(encoding="utf-8"))
    del told["sections"]
    (out / old).write_text(json.dumps(told), encoding="utf-8")
    page = page_after(out)
    assert "<table" in page
    assert "Older programs do not say whether measure-next.json is of this run's case." in page


@pytest.mark.parametrize("content", ["garbage", '{"a":1}', "[1]", '{"sections": 1}', "\xff"])
def test_a_damaged_file_of_gains_is_named_with_a_cure_that_works(
    ran: Path, out: Path, content: str, capfd: pytest.CaptureFixture[str]
) -> None:
    (out / "measure-next.json").write_text(content, encoding="latin-1")
    capfd.readouterr()
    assert main(["report", str(out), "--quiet"]) == 2
    (line,) = capfd.readouterr().err.splitlines()
    assert line.startswith(f"alphacut: {out / 'measure-next.json'}: this file is damaged: ")
    cure = door("measure-next", "CASE.toml", "--out", out)
    assert line.endswith(f"allowed: delete it, or make it anew: {cure}")
    shutil.copy(ran / "measure-next.json", out)
    assert "<table" in page_after(out)
    (out / "measure-next.json").unlink()
    assert main(["report", str(out), "--quiet"]) == 0


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
