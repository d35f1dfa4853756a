"""A campaign goes on from what is stored: after more levels, after a wider support, after an
interrupt.
"""

import json
import shutil
from pathlib import Path

from alphacut.case.load import load
from alphacut.entry import main
from alphacut.stages.material.campaign import campaign, identity

PAPER = str(Path(__file__).parents[3] / "cases" / "paper.toml")
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
    wider = run(
        [*SERIES, *store, "--plan", "reduced", "--set", "cell.inclusion_modulus=[70, 80, 85] GPa"],
        capfd,
    )
    assert wider["reused"] > 0
    other = run(
        [*SERIES, *store, "--plan", "reduced", "--set", "cell.matrix_modulus=21 GPa"], capfd
    )
    assert other["reused"] == 0


def test_explain_runs_nothing(tmp_path, capfd):
    store = tmp_path / "samples.db"
    assert main([*SERIES, "--plan", "reduced", "--store", str(store), "--explain"]) == 0
    assert "33 to run" in capfd.readouterr().out
    assert not store.exists()


def test_another_record_of_the_same_name_makes_the_shares_anew(tmp_path, capfd):
    cases = Path(__file__).parents[3] / "cases"
    for name in ("building.toml", "building.record.csv"):
        shutil.copy(cases / name, tmp_path)
    record = tmp_path / "building.record.csv"
    asked = [
        "run",
        str(tmp_path / "building.toml"),
        "--quick",
        "--no-figures",
        *("--set", 'envelope.fuzzy=["E"]', "--set", "envelope.duration=1 s"),
        "--out",
        str(tmp_path / "out"),
    ]
    for change in (False, True):
        if change:
            lines = record.read_text(encoding="utf-8").splitlines()
            record.write_text(
                "\n".join([*lines[:40], "0.38,3.0", *lines[41:]]) + "\n", encoding="utf-8"
            )
        assert main(asked) == 0, capfd.readouterr().err
        err = capfd.readouterr().err
        assert "shares.nc is up to date" not in err
    assert "modulus.nc is up to date" in err
    assert main(asked) == 0
    assert "shares.nc is up to date" in capfd.readouterr().err


def test_a_stored_sample_is_of_one_tolerance():
    def known(method, *changes):
        wanted = campaign(load(PAPER, [f"modulus.method={method}", *changes]))
        return identity(wanted.task)

    asked = {None: [], 1e-3: ["modulus.tolerance=1e-3"], 1e-4: ["modulus.tolerance=1e-4"]}
    found = [known("table", *changes) for changes in asked.values()]
    assert [one["choice"].pop("tolerance") for one in found] == list(asked)
    assert found[1] == found[2]  # nothing else parts them
    curves = [known("auto", *changes) for changes in asked.values()]  # beside [response]
    assert [one["choice"]["tolerance"] for one in curves] == [1e-9] * 3
