"""A campaign goes on from what is stored: after more levels, after a wider support, after an interrupt."""

import json
from pathlib import Path

from alphacut.entry import main

PAPER = str(Path(__file__).parent.parent / "cases" / "paper.toml")
SERIES = ["modulus", PAPER, "--method", "series"]


def run(arguments, capfd):
    """The JSON answer of a command."""
    assert main([*arguments, "--json", "-"]) == 0
    return json.loads(capfd.readouterr().out)


def test_a_wider_support_and_other_plans_take_what_is_stored(tmp_path, capfd):
    store = ["--store", str(tmp_path / "samples.db")]
    first = run([*SERIES, *store, "--plan", "reduced"], capfd)
    assert first["reused"] == 0
    again = run([*SERIES, *store, "--plan", "reduced"], capfd)
    assert again["reused"] == again["samples"] == 33
    assert again["E_GPa"] == first["E_GPa"]
    whole = run([*SERIES, *store], capfd)
    assert 0 < whole["reused"] < whole["samples"] == 225
    wider = run([*SERIES, *store, "--plan", "reduced", "--inclusion-modulus", "[70, 80, 85] GPa"], capfd)
    assert wider["reused"] > 0
    other = run([*SERIES, *store, "--plan", "reduced", "--matrix-modulus", "21 GPa"], capfd)
    assert other["reused"] == 0


def test_explain_runs_nothing(tmp_path, capfd):
    store = tmp_path / "samples.db"
    assert main([*SERIES, "--plan", "reduced", "--store", str(store), "--explain"]) == 0
    assert "33 to run" in capfd.readouterr().out
    assert not store.exists()
