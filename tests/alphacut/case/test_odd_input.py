"""Odd input of all kinds: one clear line each, exit status 2, nothing printed and nothing written."""

from pathlib import Path

import pytest

from alphacut.case.load import load
from alphacut.commands.envelope import OF_AUTO
from alphacut.entry import main
from alphacut.frame.methods.auto import CANDIDATES

CASES = Path(__file__).parents[3] / "cases"
PAPER = (CASES / "paper.toml").read_text(encoding="utf-8")
BUILDING = (CASES / "building.toml").read_text(encoding="utf-8")
FILES = {
    "nul": b"\0\0\0",
    "utf-16": PAPER.encode("utf-16"),
    "section twice": f"{PAPER}\n[cell]\nmatrix_modulus = '1 GPa'\n",
    "letters": PAPER.replace("matrix_modulus", "mätrix_modulus"),
    "too large": PAPER.replace('"20 GPa"', '"1e400 GPa"'),
    "too long": PAPER.replace('duration = "30 s"', 'duration = "1e9 s"'),
    "emoji": PAPER.replace('"2.5 m"', '"2.5 📏"'),
    "outside": BUILDING.replace("building.record.csv", "/nowhere/record.csv"),
    "folder": BUILDING.replace("building.record.csv", "."),
    "image": BUILDING.replace("building.record.csv", str(CASES / "composite.png")),
    "binary record": BUILDING.replace("building.record.csv", "binary.csv"),
    "name in a list": BUILDING.replace('"E", "m8"', '"E", 8'),
}


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("nul", "not TOML"),
        ("utf-16", "not UTF-8"),
        ("section twice", "cell: this is not TOML"),
        ("letters", "keys of plain letters"),
        ("too large", "the number is too large"),
        ("too long", "at most 1,000,000 steps"),
        ("emoji", 'entry 1, "2.5 📏"'),
        ("outside", "only the project, the current folder, home"),
        ("folder", "this is a folder"),
        ("image", "the record is a PNG image"),
        ("binary record", "the record is not text in UTF-8"),
        ("name in a list", 'entry 2, "8": this is not text'),
    ],
)
def test_odd_files(name, words, tmp_path, capfd, monkeypatch):
    monkeypatch.setenv("ALPHACUT_INSIDE", "1")
    text = FILES[name]
    (tmp_path / "binary.csv").write_bytes(bytes(range(256)))
    (tmp_path / "case.toml").write_bytes(text if isinstance(text, bytes) else text.encode())
    refused(["run", str(tmp_path / "case.toml"), "--out", str(tmp_path / "results")], words, capfd)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["binary.csv", "case.toml"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ("check paper --set =3", "there is no key before the ="),
        (
            "check paper --set cell=3",
            "cell is a section; allowed: cell.particles, cell.matrix_modulus",
        ),
        ("check paper --set study.name=x", "changed in the case file"),
        ("check paper --set study[0].name=x", "changed in the case file"),
        ("check paper --set frame.damping_ratio=5", '"5": 5 is out of range'),
        ("check paper --set frame.damping_ratio=[5,4,3]_%", "not in rising order"),
        (
            "check paper --set modulus.value=20_GPa --set modulus.measured=paper.toml",
            "more than one modulus",
        ),
        ("check pendulum --set envelope.method=modal", "a pendulum has no modes"),
        ("check pendulum --set envelope.integrator=exact", "this is for linear structures"),
        ("check paper --set envelope.integrator=composition4", "this is for a pendulum"),
        ("run paper --out ", "--out: the name is empty"),
        ("cell paper --cross-check ", "--cross-check: this is empty; allowed: run two models"),
        ("cell paper --exclude ", "--exclude: this is empty; allowed: not to be taken by method"),
        ("cell paper --exclude ,", "--exclude = ,: this is empty"),
        ("modulus paper --exclude ", "--exclude: this is empty"),
        ("envelope paper --exclude ", "--exclude: this is empty"),
        ("modulus paper --alpha ", "--alpha: this is empty; allowed: levels, as 0,0.5,1"),
        ("envelope paper --fuzzy ", "--fuzzy: this is empty"),
        ("measure-next paper --output ", "--output: this is empty"),
        ("envelope pendulum --modulus 20_GPa", "this structure takes no modulus"),
        ("envelope paper --exclude vertex", "'vertex' is unknown to auto"),
        ("envelope paper --exclude modal", "the method is graph-follower"),
        (
            "envelope paper --method auto --exclude modal,improved-graph-follower",
            "no method is left",
        ),
        ("envelope paper --certify 1e-6 --method vertex", "method vertex cannot certify"),
        ("envelope paper --step 1e-9", "at most 1,000,000 steps"),
    ],
)
def test_odd_options(arguments, words, tmp_path, capfd, monkeypatch):
    monkeypatch.chdir(tmp_path)
    command, case, *rest = arguments.split(" ")
    refused(
        [
            command,
            str(CASES / f"{case}.toml"),
            *(word.replace("_%", " %").replace("_GPa", " GPa") for word in rest),
        ],
        words,
        capfd,
    )
    assert not list(tmp_path.iterdir())


def test_an_empty_folder_is_not_the_current_one(capfd):
    refused(["report", ""], "FOLDER: this is empty; allowed: results of a run", capfd)


def refused(arguments, words, capfd):
    """Check that a command is refused in lines of which one holds the words."""
    assert main(arguments) == 2
    out, err = capfd.readouterr()
    assert out == ""
    assert "Traceback" not in err
    assert all(line.startswith("alphacut: ") for line in err.splitlines())
    assert words in err


def test_what_auto_takes_may_be_left_out():
    assert OF_AUTO == CANDIDATES


def test_one_value_for_all_floors_may_be_changed_from_the_command_line():
    changes = [
        "damping_ratio=[3, 4, 5] %",
        "lengths=2.6 m",
        "displacements=1 mm,2 mm,3 mm",
        "velocities=[0, 1] mm/s",
    ]
    frame = load(CASES / "paper.toml", [f"frame.{change}" for change in changes]).frame
    given = (frame.damping_ratio, frame.lengths, frame.displacements, frame.velocities)
    assert [len(values) for values in given] == [1, 1, 3, 1]
    assert frame.damping_ratio[0].modal == 0.04


def test_every_key_that_a_command_does_not_read_is_told(capfd):
    keys = ["--set", "mesh.size=0.1", "--set", "mesh.layers=6"]
    assert main(["envelope", str(CASES / "paper.toml"), *keys]) == 2
    told = capfd.readouterr().err
    assert told.count("command envelope does not read this key") == 2
    assert "mesh.size" in told
    assert "mesh.layers" in told
