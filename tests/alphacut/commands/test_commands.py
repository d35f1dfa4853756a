"""Commands: what they print, how they end, and that nothing is left where they refuse."""

import io
import os
import re
import signal
import subprocess
import sys
import time
import tomllib
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import replace
from pathlib import Path

import pytest

from alphacut import main
from alphacut.commands import case_text, required, verify
from alphacut.commands.options import split_petsc
from alphacut.frame.verification import self_test
from alphacut.frame.verification.self_test import with_motions_tested
from alphacut.fuzzy import FailedError, RefusedError
from alphacut.io.results import Listed, ResultsFolder
from tests.alphacut.small import CELL, summary_of, told_by, written

CASES = Path(__file__).parents[3] / "cases"
RUN = [sys.executable, "-m", "alphacut"]


def spoken(*words):
    """Status, standard output and standard error of a command in this process."""
    out, err = io.StringIO(), io.StringIO()
    with redirect_stdout(out), redirect_stderr(err):
        status = main([str(word) for word in words])
    return status, out.getvalue(), err.getvalue()


def test_a_run_prints_a_table_and_leaves_its_files(tmp_path):
    case, folder = written(tmp_path), tmp_path / "out"
    status, out, err = spoken("run", case, "--out", folder, "--no-figures")
    assert status == 0
    assert len(out.splitlines()) <= 20
    assert max(map(len, out.splitlines())) <= 80
    assert out.splitlines()[1].startswith("peak of")
    assert "results are in" in err
    summary = summary_of(folder)
    assert summary["envelopes"]["all"]["max"]["q1"] == pytest.approx(0.0099, abs=3e-4)
    assert {"envelope_all.nc", "summary.json"} <= {path.name for path in folder.iterdir()}


def test_a_step_that_widens_a_bound_is_foreseen_and_said(tmp_path):
    case, folder = written(tmp_path), tmp_path / "out"
    given = (
        "--set=frame.outputs=['a1']",
        "--set=envelope.method=proof",
        "--set=envelope.tolerance=0.1 %",
    )
    for step in (0.1, 0.05):
        words = (case, *given, f"--set=envelope.step={step} s")
        foreseen = spoken("check", *words)[1]
        told = " ".join(spoken("run", *words, "--no-figures", "--out", folder)[1].split())
        peak = summary_of(folder)["envelopes"]["all"]["peak"]["a1"]
        apart = f"time nodes {step:g} s apart"
        added = re.search(rf"a1: between {apart} the .* may add (.*)% to its peak", foreseen)
        said = re.search(rf"a1: (.*)% of its bound is what may come between {apart}", told)
        assert (added is not None) == (said is not None) == (step == 0.1)
        if added and said:
            fraction = 100 * peak["between_nodes"] / peak["upper"][0]
            assert float(said[1]) == pytest.approx(fraction, rel=0.02)
            assert 0.3 * fraction < float(added[1]) < 3 * fraction
        assert "would give" not in told


def test_check_prints_doubts_with_what_was_read_or_alone(tmp_path):
    soft = "--set=frame.modulus=[22, 24, 26] kPa"
    _, out, _ = spoken("check", written(tmp_path), soft)
    assert "unusual period" in out
    assert out.endswith("no problems\n")
    _, out, err = spoken("check", written(tmp_path), soft, "--quiet")
    assert out == ""
    assert "unusual period" in err


def test_a_unit_that_may_be_wrong_is_told_before_what_is_refused(tmp_path):
    stiff = spoken("check", CASES / "building.toml", "--set=frame.second_moment='3e5 m^4'")
    assert stiff[0] == 2
    doubt, *_, refusal = stiff[2].splitlines()
    assert "frame.second_moment is 300000 m^4, which is unusual: is its unit right?" in doubt
    assert "step is 0.01 s; allowed: up to" in refusal


def test_a_material_that_is_not_found_hides_neither_doubts_nor_what_is_refused(
    tmp_path, monkeypatch
):
    def refused(content):
        raise RefusedError("mesh.file", "damaged", "a mesh")

    def failed(content):
        raise FailedError("the series does not converge")

    monkeypatch.setattr(required, "require_runnable", refused)
    monkeypatch.setattr(case_text, "foreseen_structure", failed)
    tiny = "--set=frame.modulus=[22, 24, 26] Pa"
    status, _, err = spoken("check", written(tmp_path), tiny)
    assert status == 2
    assert "frame.modulus is 22.00 Pa" in err
    assert err.splitlines()[-1].endswith("mesh.file is damaged; allowed: a mesh")


REFUSED = [
    *tomllib.loads(Path(__file__).with_name("refused.toml").read_text(encoding="utf-8"))["refused"],
    ("check case.toml --set frame.lengths=" + "[" * 3000, "too long"),
    ("check case.toml --set frame.lengths=" + "x" * 100_000, "frame.lengths"),
]


@pytest.mark.parametrize(("line", "words"), REFUSED, ids=[line[:40] for line, _ in REFUSED])
def test_bad_input_is_one_line_and_status_2(tmp_path, monkeypatch, line, words):
    monkeypatch.chdir(tmp_path)
    written(tmp_path)
    command, *options = line.replace("{cases}", str(CASES)).split(" --", 1)
    arguments = command.split(" ")
    for option in options[0].split(" --") if options else ():
        name, _, value = option.partition(" ")
        arguments += [f"--{name}", *([value] if value else [])]
    status, out, err = spoken(*arguments)
    assert (status, out) == (2, "")
    assert words in err
    assert len(err.splitlines()) == 1
    assert len(err) < 1100
    assert err[:-1].isprintable()
    assert [path.name for path in tmp_path.iterdir()] == ["case.toml"]


def test_a_file_may_hold_options_of_petsc_and_help_names_them(tmp_path, capfd):
    (tmp_path / "petsc.txt").write_text("# multigrid\n-rve_pc_type gamg  # algebraic\n-rve_x\n")
    line = split_petsc(["cell", "-options_file", str(tmp_path / "petsc.txt"), "case.toml"])
    assert line == (["cell", "case.toml"], {"pc_type": "gamg", "x": ""})
    with pytest.raises(SystemExit):
        main(["cell", "--help"])
    assert "-rve_ksp_type gmres" in capfd.readouterr().out


def test_debug_shows_the_traceback_and_what_is_done(tmp_path):
    case, missing = written(tmp_path), tmp_path / "missing.toml"
    status, _, err = spoken("check", missing)
    assert (status, len(err.splitlines())) == (2, 1)
    status, _, err = spoken("check", missing, "--debug")
    assert status == 2
    assert "Traceback" in err
    assert str(missing) in err.splitlines()[-1]
    words = ("run", case, "--out", tmp_path / "out", "--no-figures", "--quiet")
    assert "stage envelope_all is computed" in spoken(*words, "--debug")[2]
    assert "stage" not in spoken(*words)[2]


@pytest.mark.parametrize(
    ("method", "integrator", "status"), [("auto", "exact", 1), ("graph-follower", "midpoint", 0)]
)
def test_a_tolerance_that_is_missed_fails_but_for_a_graph_follower(
    tmp_path, method, integrator, status
):
    changes = {'"0.1 mm"': '"1e-20 mm"', '"exact"': f'"{integrator}"', "graph-follower": method}
    changes |= {'"2 s"': '"0.1 s"', "[0, 0.5, 1]": "[0]"}
    case = written(tmp_path, **changes)
    code, _, err = spoken("run", case, "--no-figures", f"--out={tmp_path}/out")
    assert code == status
    assert "the case allows" in err


def test_ctrl_c_ends_a_run_and_the_same_run_goes_on(tmp_path, capfd):
    case = written(tmp_path, CELL + "[mesh]\nlayers = 3\n")
    words = [*RUN, "run", str(case), "--out", str(tmp_path / "out"), "--no-figures"]
    started = subprocess.Popen(words, stderr=subprocess.PIPE, text=True, env={**os.environ})
    while started.poll() is None and not (tmp_path / "out").exists():
        time.sleep(0.05)
    started.send_signal(signal.SIGINT)
    _, err = started.communicate(timeout=60)
    # Python ends itself by the signal if that reached it in code that a library ran from a string;
    # a shell shows 130 of both.
    assert started.returncode in (0, 128 + signal.SIGINT, -signal.SIGINT)
    if started.returncode:
        assert "continues from" in err
    assert main(words[len(RUN) :]) == 0
    assert "E, GPa" in capfd.readouterr().out


ENDED = """
import os, signal, sys
from alphacut.__main__ import main
sys.argv[1:] = ["keys", "no such section"]
status = main()
for number in (signal.SIGINT, signal.SIGTERM):
    os.kill(os.getpid(), number)
sys.exit(status)
"""


def test_a_signal_at_the_very_end_leaves_the_status():
    assert subprocess.run([sys.executable, "-c", ENDED], capture_output=True).returncode == 2


PROOF = ("--set", "envelope.method=auto")


def narrower(envelope):
    return replace(envelope, lower=0.98 * envelope.lower, upper=0.98 * envelope.upper, inner=None)


def planted(found, model):
    return with_motions_tested(narrower(found), model)


def proved(case, folder):
    return main(["run", str(case), "--out", str(folder), "--no-figures", "--quiet", *PROOF])


def test_what_a_run_stored_is_verified_and_a_narrower_envelope_contradicted(tmp_path, monkeypatch):
    folder = tmp_path / "out"
    assert proved(written(tmp_path), folder) == 0
    files = sorted(folder.iterdir())
    assert "exact motions agree with what is guaranteed (guaranteed)" in told_by("verify", folder)
    stored = verify.envelope_of
    monkeypatch.setattr(verify, "envelope_of", lambda data: narrower(stored(data)))
    assert "the proof is wrong: q1 at t = " in told_by("verify", folder, status=1)
    assert sorted(folder.iterdir()) == files


def test_a_contradiction_ends_a_run(tmp_path, capfd, monkeypatch):
    monkeypatch.setattr(self_test, "with_motions_tested", planted)
    assert proved(written(tmp_path), tmp_path / "out") == 1
    err = capfd.readouterr().err
    assert "the proof is wrong: q1" in err
    assert "Traceback" not in err


def test_an_envelope_around_which_bounds_are_proved_is_not_called_guaranteed(tmp_path):
    words = ["--set", "frame.outputs=['q1']", "--set", "envelope.fuzzy=['E', 'm']"]
    folder = str(tmp_path / "out")
    told = told_by("run", written(tmp_path), "--out", folder, "--no-figures", *words)
    assert "guaranteed" not in told
    assert "exact motions by another algorithm lie in the wider bounds that are proved" in told
    told = told_by("verify", folder)
    assert "exact motions lie in the wider bounds that are proved (estimated)" in told


def test_peaks_that_a_question_had_proved_are_not_called_unproved(shipped_run):
    folder = shipped_run("laboratory-frame")
    assert "its guaranteed peaks were tested by the run" in told_by("verify", folder)


def test_a_suite_says_what_it_stores(tmp_path):
    (tmp_path / "record_one.json").write_text("{}")
    ResultsFolder(tmp_path).add_to_list({"record_one.json": Listed("", "")})
    assert "of a suite, whose peaks the run tested as it proved them" in told_by(
        "verify", tmp_path, status=2
    )
