"""Section [joint]: two outputs at a time, one at two times, on a motion that is known."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from alphacut.entry import main
from tests.alphacut.one_floor import OMEGA, one_floor

STEP = 2 * np.pi / OMEGA / 64
CASE = (
    one_floor(
        fuzzy='["q0", "v0"]',
        duration=2 * np.pi / OMEGA,
        step=STEP,
        moved="[9, 10, 11] mm",
        pushed=f"[{9e-3 * OMEGA}, {10e-3 * OMEGA}, {11e-3 * OMEGA}] m/s",
    )
    + "[joint]\n"
)


def run(folder: Path, joint: str, *, page: bool = False) -> dict[str, object]:
    """The document of a run with that section."""
    path = folder / "one.toml"
    path.write_text(CASE + joint, encoding="utf-8")
    out = folder / "out"
    drawn = [] if page else ["--no-figures"]
    assert main(["run", str(path), "--out", str(out), "--quiet", *drawn]) == 0
    if page:
        assert main(["report", str(out), "--quiet"]) == 0
        text = (out / "report.html").read_text(encoding="utf-8")
        assert "<h2>What goes together</h2>" in text
        assert "the rectangle of both ranges dashed" in text
    found: dict[str, object] = json.loads((out / "summary.json").read_text())["joint"]
    return found


@pytest.mark.parametrize(("eighths", "share"), [(1, 0.5), (2, 1.0)])
def test_one_output_at_two_times_is_a_parallelogram(
    tmp_path: Path, eighths: int, share: float
) -> None:
    time = eighths * 2 * np.pi / OMEGA / 8
    found = run(tmp_path, f'outputs = ["q1"]\ntimes = ["0 s", "{time} s"]\n')
    shares = found["share_of_rectangle"]
    assert isinstance(shares, dict)
    assert shares["inner"][:-1] == pytest.approx([share] * 4, rel=1e-6)
    assert all(share - 1e-9 <= x <= 1.1 * share for x in shares["outer"][:-1])
    assert found["lower"][0][0] == pytest.approx(9e-3)  # type: ignore[index]


def test_two_outputs_at_one_time_of_other_units(tmp_path: Path) -> None:
    time = 2 * np.pi / OMEGA / 8  # v / ω = −q0 sin + v0 / ω cos: the square of both starts, turned
    found = run(tmp_path, f'outputs = ["q1", "v1"]\ntimes = ["{time} s"]\n', page=True)
    assert found["units"] == ["m", "m/s"]
    shares = found["share_of_rectangle"]
    assert isinstance(shares, dict)
    assert shares["inner"][0] == pytest.approx(0.5, rel=1e-6)
    assert shares["outer"][0] == pytest.approx(0.5, rel=1e-6)


def test_the_error_of_time_stepping_is_in_the_polygons(tmp_path: Path) -> None:
    """A rough scheme's polygon holds the pairs of the exact motion, most of a period later."""
    rough = CASE.replace("[joint]", '[joint]\ntimes = ["0 s", "END s"]\noutputs = ["q1"]\n')
    found = {}
    for integrator in ("exact", "midpoint"):
        path = tmp_path / "one.toml"
        path.write_text(rough.replace("END", f"{1.5 * np.pi / OMEGA}"), encoding="utf-8")
        out = tmp_path / integrator
        more = [
            "--set",
            f"envelope.integrator={integrator}",
            "--set",
            f"envelope.step={8 * STEP} s",
        ]
        more += ["--set", "envelope.tolerance=1 m", "--no-figures", "--quiet"]
        assert main(["run", str(path), "--out", str(out), *more]) == 0
        found[integrator] = json.loads((out / "summary.json").read_text())["joint"]
    (low, high), (least, most) = (
        np.array([found[name][side][0] for side in ("lower", "upper")])
        for name in ("exact", "midpoint")
    )
    assert (least <= low + 1e-12).all()
    assert (high <= most + 1e-12).all()
    assert (most - least)[1] > 1.2 * (high - low)[1]


@pytest.mark.parametrize(
    ("joint", "pattern"),
    [
        (f'outputs = ["q1", "v1"]\ntimes = ["0 s", "{STEP} s"]\n', "2 outputs and 2 times"),
        ('outputs = ["q1"]\ntimes = ["0 s"]\n', "1 outputs and 1 times"),
        ('outputs = ["q1"]\ntimes = ["0 s", "0 s"]\n', "both times are the same"),
        ('outputs = ["q1", "q2"]\ntimes = ["0 s"]\n', "q2 is not among"),
        ('outputs = ["q1"]\ntimes = ["0 s", "0.123456 s"]\n', "no node of the simulation"),
        ('outputs = ["q1"]\ntimes = ["0 s", "99 s"]\n', "no node of the simulation"),
        ('outputs = ["q1"]\ntimes = ["0 s", "-1 s"]\n', "joint.times"),
    ],
)
def test_pairs_that_make_no_sense(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], joint: str, pattern: str
) -> None:
    path, out = tmp_path / "one.toml", tmp_path / "out"
    path.write_text(CASE + joint, encoding="utf-8")
    assert main(["run", str(path), "--out", str(out)]) == 2
    told = capsys.readouterr().err.strip()
    assert pattern in told
    assert len(told.splitlines()) == 1
    assert not out.exists()
