"""Command ``alphacut update`` on the measured laboratory frame, and files of modes that are wrong."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import pytest

from alphacut.case.load import load
from alphacut.commands.update import READ
from alphacut.entry import main

CASES = Path(__file__).parents[3] / "cases"


def copied(folder: Path, *, without: str = "", **changes: str) -> Path:
    """The case and its modes in a folder, with changes of its lines by their beginnings."""
    shutil.copy(CASES / "laboratory-frame.modes.csv", folder)
    lines = (CASES / "laboratory-frame.toml").read_text(encoding="utf-8").splitlines()
    kept = [line for line in lines if not (without and line.startswith(without))]
    for key, value in changes.items():
        kept = [f"{key} = {value}" if line.startswith(f"{key} =") else line for line in kept]
    path = folder / "frame.toml"
    path.write_text("\n".join(kept) + "\n", encoding="utf-8")
    return path


def test_modes_held_out_lie_in_the_prediction(tmp_path: Path) -> None:
    told = tmp_path / "told.json"
    assert main(["update", str(CASES / "laboratory-frame.toml"), "--json", str(told)]) == 0
    found = json.loads(told.read_text(encoding="utf-8"))
    assert [held["mode"] for held in found["held_out"]] == [3, 4]
    assert all(held["inside"] for held in found["held_out"])
    for held in found["held_out"]:
        low, high = held["predicted"]
        assert (high - low) / held["measured"] < 0.13
    assert max(found["narrowed"].values()) < 0.34
    assert found["not_learned"] == []


def test_all_four_modes_at_once_refute_the_frame(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["update", str(copied(tmp_path, without="held_out"))]) == 0
    assert "storey frame with such parameters is refuted" in capsys.readouterr().out


def test_masses_that_are_unknown_too_leave_the_common_factor(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = copied(
        tmp_path,
        masses='["[4, 7] kg", "[4, 7] kg", "[4, 7] kg", "[4, 7] kg"]',
        learn='["c", "m"]',
        shape_deviation="0.01",
        frequency_deviation="0.02",
    )
    assert main(["update", str(path), "--set", "update.alpha=[0.01]"]) == 0
    told = capsys.readouterr().out
    assert re.search(r"  m1: [\d.]+ kg … [\d.]+ kg, [\d.]+ % of its prior", told), told
    lost = [x for x in told.splitlines() if x.startswith("not learned: ")]
    assert any("m1" in line for line in lost)


def test_figures_and_envelopes_before_and_after(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = copied(tmp_path, duration='"1 s"')
    folder = tmp_path / "out"
    more = ["--set", "update.alpha=[0.05]", "--set", "frame.outputs=['q4']"]
    assert main(["update", str(path), "--out", str(folder), "--quiet", *more]) == 0
    told = json.loads((folder / "update.json").read_text(encoding="utf-8"))
    assert told["envelope_width"]["q4"] < 0.5
    changed = ["frame.outputs=['q4']", "update.alpha=[0.05]"]
    assert told["sections"] == load(path, changed).traces(*READ)
    others = load(path, changed[:1]).traces(*READ)
    assert [name for name in READ if others[name] != told["sections"][name]] == ["update"]
    with next(path.parent.glob("*.modes.csv")).open("a", encoding="utf-8") as stream:
        stream.write("# another content\n")
    assert load(path, changed).traces("update") != {"update": told["sections"]["update"]}
    assert {"update-q4.png", "update-inputs.svg"} <= {path.name for path in folder.iterdir()}


@pytest.mark.parametrize(
    ("text", "pattern"),
    [
        ("mode,period,q1\n1,2,1\n", "the header is wrong"),
        ("mode,frequency,q1,q1\n1,2,1,1\n", "the header is wrong"),
        ("mode,frequency,q1,q2\n1,-2,1,1\n", "no measured mode"),
        ("mode,frequency,q1,q2\n0,2,1,1\n", "no measured mode"),
        ("mode,frequency,q1,q2\ninf,2,1,1\n", "no measured mode"),
        ("mode,frequency,q1,q2\n1,2;5,1,1\n", "no measured mode"),
        ("mode,frequency,q1,q2\n1,2,1\n", "no measured mode"),
        ("mode,frequency,q1,q2\n1,2,1,1\n1,2,,1\n", "in some rows only"),
        ("mode,frequency,q1,q2\n", "needs a header and a row"),
        ("mode,frequency,q1,q9\n1,2,1,1\n", "mode 1 has an amplitude q9; the frame has 4 floors"),
        ("mode,frequency,q1,q2\n1,1e300,1,1\n", "none above 1e+09"),
        ("mode,frequency,q1,q2\n1,1e-300,1,1\n", "no measured mode"),
        ("mode,frequency,q1,q2\n1,2,1e160,1\n", "none above 1e+09"),
        ("mode,frequency,q1,q2\n7,2,1,1\n", "4 floors"),
    ],
)
def test_files_of_modes_that_make_no_sense(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str, pattern: str
) -> None:
    path = copied(tmp_path, without="held_out")
    (tmp_path / "laboratory-frame.modes.csv").write_text(text, encoding="utf-8")
    assert main(["update", str(path)]) == 2
    told = capsys.readouterr().err.strip()
    assert pattern in told
    assert len(told.splitlines()) == 1


@pytest.mark.parametrize(
    ("change", "pattern"),
    [
        ("update.alpha=[0, 0.5]", "decide no cut at α = 0"),
        ("update.learn=['k']", "the frame has no input|unknown"),
        ("update.learn=['rayleigh_mass']", "crisp|cannot be learned"),
        ("update.measured=none.csv", "there is no such file"),
        ("update.frequency_deviation=-1", "inside .0, 1."),
        ("update.held_out=[2.5]", "no such mode was measured.*some of 1, 2, 3, 4"),
        ("update.held_out=[1, 2, 3, 4]", "no mode is left to learn from"),
        ("envelope.method=none", "envelope.method"),
    ],
)
def test_sections_that_make_no_sense(
    capsys: pytest.CaptureFixture[str], change: str, pattern: str
) -> None:
    import re

    case = str(CASES / "laboratory-frame.toml")
    assert main(["update", case, "--set", change]) == 2
    assert re.search(pattern, capsys.readouterr().err)


def test_equal_readings_name_the_keys_that_take_them(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = copied(tmp_path, without="held_out")
    row = "1,0.883,-0.378,-0.719,-0.964,-1\n"
    text = f"mode,frequency [Hz],q1,q2,q3,q4\n{row * 3}"
    (tmp_path / "laboratory-frame.modes.csv").write_text(text, encoding="utf-8")
    lines = path.read_text(encoding="utf-8").splitlines()
    kept = [line for line in lines if "_deviation" not in line]
    path.write_text("\n".join(kept), encoding="utf-8")
    asked = ["update", str(path)]
    for key in ("frequency_deviation", "shape_deviation"):
        assert main(asked) == 2
        assert f"give {key}, such as 0.01" in capsys.readouterr().err
        asked += ["--set", f"update.{key}=0.01"]
    assert main(asked) == 0
