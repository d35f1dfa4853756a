"""Stored envelopes are tested again, and a contradiction ends a run."""

from dataclasses import replace

from alphacut.commands import check
from alphacut.entry import main
from alphacut.frame import propagation
from alphacut.frame.verification.self_test import with_motions_tested
from tests.alphacut.small import written

PROOF = ("--set", "envelope.method=auto")


def narrower(envelope):
    return replace(envelope, lower=0.98 * envelope.lower, upper=0.98 * envelope.upper, inner=None)


def planted(found, model):
    return with_motions_tested(narrower(found), model)


def run(case, folder):
    return main(["run", str(case), "--out", str(folder), "--no-figures", "--quiet", *PROOF])


def test_what_a_run_stored_is_verified_and_a_narrower_envelope_contradicted(
    tmp_path, capfd, monkeypatch
):
    folder = tmp_path / "out"
    assert run(written(tmp_path), folder) == 0
    files = sorted(folder.iterdir())
    assert main(["verify", str(folder)]) == 0
    assert "exact motions agree with it (guaranteed)" in capfd.readouterr().out
    stored = check.envelope_of
    monkeypatch.setattr(check, "envelope_of", lambda data: narrower(stored(data)))
    assert main(["verify", str(folder)]) == 1
    assert "the proof is wrong: q1 at t = " in capfd.readouterr().err
    assert sorted(folder.iterdir()) == files


def test_a_contradiction_ends_a_run(tmp_path, capfd, monkeypatch):
    monkeypatch.setattr(propagation, "with_motions_tested", planted)
    assert run(written(tmp_path), tmp_path / "out") == 1
    err = capfd.readouterr().err
    assert "the proof is wrong: q1" in err
    assert "Traceback" not in err


def test_a_folder_without_an_envelope_is_refused(tmp_path, capfd):
    assert main(["verify", str(tmp_path)]) == 2
    assert "allowed: results of a run with an envelope" in capfd.readouterr().err
