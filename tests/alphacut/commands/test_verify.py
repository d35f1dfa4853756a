"""Stored envelopes are tested again, and a contradiction ends a run."""

from dataclasses import replace

import numpy as np

from alphacut.commands import verify
from alphacut.entry import main
from alphacut.frame import propagation
from alphacut.frame.verification.self_test import with_motions_tested
from tests.alphacut.small import written

PROOF = ("--set", "envelope.method=auto")


def columns(path):
    """Titles and numbers of a CSV file."""
    titles = path.read_text(encoding="utf-8").splitlines()[0].split(",")
    return titles, np.loadtxt(path, delimiter=",", skiprows=1, ndmin=2)


def narrower(envelope):
    return replace(envelope, lower=0.98 * envelope.lower, upper=0.98 * envelope.upper, inner=None)


def planted(found, model):
    return with_motions_tested(narrower(found), model)


def run(case, folder):
    return main(["run", str(case), "--out", str(folder), "--no-figures", "--quiet", *PROOF])


def test_a_run_can_be_verified_and_gives_motions_to_other_programs(tmp_path, capfd, monkeypatch):
    folder = tmp_path / "out"
    assert run(written(tmp_path), folder) == 0
    assert main(["verify", str(folder)]) == 0
    assert "exact motions agree with it (guaranteed)" in capfd.readouterr().out
    titles, motions = columns(folder / "envelope_all_motions.csv")
    inputs_titles, inputs = columns(folder / "envelope_all_inputs.csv")
    assert titles[:2] == ["time [s]", "motion 1: q1 [m]"]
    assert inputs_titles[0] == "motion"
    assert len(inputs) >= 2
    assert motions[0, 0] == 0
    assert np.isfinite(motions).all()
    stored = verify.envelope_of
    monkeypatch.setattr(verify, "envelope_of", lambda data: narrower(stored(data)))
    assert main(["verify", str(folder)]) == 1
    assert "the proof is wrong: q1 at t = " in capfd.readouterr().err


def test_a_contradiction_ends_a_run(tmp_path, capfd, monkeypatch):
    monkeypatch.setattr(propagation, "with_motions_tested", planted)
    assert run(written(tmp_path), tmp_path / "out") == 1
    err = capfd.readouterr().err
    assert "the proof is wrong: q1" in err
    assert "Traceback" not in err


def test_a_folder_without_an_envelope_is_refused(tmp_path, capfd):
    assert main(["verify", str(tmp_path)]) == 2
    assert "allowed: results of a run with an envelope" in capfd.readouterr().err
