"""What drives the width of a vibration: also under an earthquake; left out, with the reason, where
there are no modes.
"""

import json
import re
from pathlib import Path

import numpy as np
import pytest
import xarray

from alphacut.case.load import load
from alphacut.entry import main
from alphacut.stages import width_shares
from alphacut.stages.width_shares import roughness, thinned

CASES = Path(__file__).parents[3] / "cases"
SHORT = ['stages=["envelope"]', "envelope.fuzzy=E,m3"]


def run(tmp_path, *changes, case="paper"):
    text = (CASES / f"{case}.toml").read_text(encoding="utf-8").partition("[[study]]")
    # without its studies
    whole = text[0] + ("[envelope]" + text[2].partition("[envelope]")[2] if text[1] else "")
    (tmp_path / "case.toml").write_text(whole, encoding="utf-8")
    (tmp_path / "record.csv").write_bytes((CASES / "building.record.csv").read_bytes())
    words = [word for change in (*SHORT, *changes) for word in ("--set", change)]
    return main(
        [
            "run",
            str(tmp_path / "case.toml"),
            "--quick",
            "--no-figures",
            "--quiet",
            "--out",
            str(tmp_path / "out"),
            *words,
        ]
    )


@pytest.mark.parametrize(
    ("duration", "step", "factor"),
    [(20.0, 0.01, 20), (1.0, 0.01, 1), (30.0, 0.01, 30), (0.07, 0.01, 1), (10.0, 0.02, 5)],
)
def test_shares_take_a_hundred_nodes(duration, step, factor):
    assert thinned(duration, step) == pytest.approx(factor * step)
    assert round(duration / thinned(duration, step), 9) == int(
        round(duration / thinned(duration, step), 9)
    )


def test_the_shares_of_a_modulus_tell_how_far_they_are(monkeypatch):
    seen, ends = [], (np.zeros((2, 2)), np.ones((2, 2)))
    monkeypatch.setattr(width_shares, "cell_range", lambda *_: ends)
    width_shares.modulus_shares(load(str(CASES / "porous.toml"), []), seen.append)
    assert len(seen) > 2
    assert seen[-1] == 1.0


def test_a_frame_under_an_earthquake_has_shares_and_its_report_names_periods(tmp_path, capfd):
    assert run(tmp_path, "frame.accelerogram=record.csv") == 0, capfd.readouterr().err
    with xarray.open_dataset(tmp_path / "out" / "shares.nc") as found:
        assert set(found["input"].values) == {"E", "m3"}
        assert float(found["share"].isel(time=-1).sum("input").min()) > 0.3
    summary = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))
    assert set(summary["shares"]["q3"]) == {"E", "m3"}
    assert main(["report", str(tmp_path / "out"), "--quiet"]) == 0
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "First natural periods at the modal values: 7, 3.12, 1.93 s" in page
    assert "Inner: attained by the parameters" in page
    assert page.count(">error up to<") == 1  # of the extremes
    assert ">between nodes and by error, up to<" in page
    assert "All are peaks at the nodes, " in page
    assert "no motion peaks higher than the greatest where the bounds are" in page
    assert "; between nodes at most " in page


def test_a_modal_envelope_tells_its_error(tmp_path, capfd):
    assert run(tmp_path, "envelope.method=modal") == 0, capfd.readouterr().err
    assert main(["report", str(tmp_path / "out"), "--quiet"]) == 0
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert ">error up to<" in page
    assert "eigen-analyses" in page
    assert "Estimated: from a surrogate" in page


def test_without_oscillating_modes_a_run_goes_on_without_shares(tmp_path, capfd):
    assert run(tmp_path, "frame.dampers=1 kN s/mm") == 0, capfd.readouterr().err
    assert "no shares of the width over time: a mode does not oscillate" in capfd.readouterr().err
    with xarray.open_dataset(tmp_path / "out" / "shares.nc") as found:
        assert "share" not in found


def test_shares_that_are_not_wanted_are_left_out(tmp_path, capfd):
    assert run(tmp_path, "envelope.shares=false") == 0, capfd.readouterr().err
    with xarray.open_dataset(tmp_path / "out" / "shares.nc") as found:
        assert "share" not in found
    summary = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))
    assert not summary["shares"]


def test_the_plan_tells_what_shares_cost(tmp_path, capsys):
    asked = ["envelope", str(CASES / "paper.toml"), "--explain", "--set"]
    asked += ["frame.modulus=[24, 24.8, 25] GPa", "--fuzzy", "E,m", "--method", "auto"]
    assert main(asked) == 0
    out = capsys.readouterr().out
    assert re.search(r"what drives the width, of run: about \d[\d.]* s; 3 envelopes, one with", out)
    assert "all 4 inputs fuzzy and one with each of E, m fixed" in out
    assert re.search(r"modal: about [\d.]+ s; \d+ bounds by .*; a proof is expected", out)
    assert main([*asked, "--set", "envelope.shares=false"]) == 0
    assert "what drives" not in capsys.readouterr().out


def test_a_group_counts_as_one_input_and_says_so(tmp_path, capfd):
    """Each stiffness is an input of the envelope, and all are one in the shares."""
    (tmp_path / "two.toml").write_text(
        'schema = 1\ntitle = "t"\nabout = "a"\nstages = ["envelope"]\n[frame]\nmasses = ["1 t",'
        ' "[1, 2] t"]\nlengths = "3 m"\nstiffness = "25 MN/m ± 5 %"\ndisplacements = ["1 mm",'
        ' "1 mm"]\nvelocities = "0 m/s"\ndamping_ratio = "3 %"\n[envelope]\nfuzzy = ["k", "m2"]\nduration = "0.2 s"\nstep = "0.01 s"\n'
        "alpha = [0]\n",
        encoding="utf-8",
    )
    case, note = str(tmp_path / "two.toml"), "k counts as one input in the shares; k1, k2 by name"
    assert main(["envelope", case, "--explain"]) == 0
    told = capfd.readouterr().out
    assert "one with all 3 inputs fuzzy and one with each of k, m2 fixed" in told
    assert note in told
    out = tmp_path / "out"
    assert main(["run", case, "--no-figures", "--out", str(out)]) == 0
    assert note in capfd.readouterr().err
    assert note in json.loads((out / "summary.json").read_text(encoding="utf-8"))["shares_notes"][0]


def test_rough_shares_are_told_in_a_line():
    assert roughness(0.0198) == ["shares are rough: their envelopes are good to 2 % of each peak"]
    assert roughness(0.0099) == []
