"""What the commands print and write: one JSON object with the promised names, whole files, the same
whatever the workers.
"""

import json
import os
import re
import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest

from alphacut.case.load import load
from alphacut.case.sections.vibration import ENVELOPE_METHODS
from alphacut.commands.parser import split_petsc
from alphacut.entry import COMMANDS, main, parsers
from alphacut.io.files import as_json, rank, standard_output, whole_file
from alphacut.io.output_paths import alone
from alphacut.io.problem import BadInput
from alphacut.stages.vibration.envelope import method_options
from alphacut.stages.vibration.envelope_task import task_of

CASES = Path(__file__).parents[3] / "cases"
PAPER = str(CASES / "paper.toml")


def answer(arguments, capfd):
    """The one JSON object that a command prints; fails if there is anything else on standard
    output.
    """
    assert main([*arguments, "--json", "-"]) == 0
    out, _ = capfd.readouterr()
    assert out.count("\n") == 1
    return json.loads(out)


def test_cell_prints_what_it_promises(capfd):
    pytest.importorskip("dolfinx")
    found = answer(
        ["cell", PAPER, "--layers", "3", "--mesh-size", "0.5", "-rve_ksp_rtol", "1e-9"], capfd
    )
    assert {
        "E_GPa",
        "nu",
        "stress_GPa",
        "curve",
        "unknowns",
        "iterations",
        "seconds",
        "solver",
        "versions",
    } <= set(found)
    assert set(found["stress_GPa"]) == {"s11", "s12"}
    assert {"mesh", "assemble", "setup", "solve", "total", "jit"} <= set(found["seconds"])
    assert len(found["iterations"]) == 2
    assert "-rve_ksp_rtol 1e-9" in found["solver"]
    weights, curve = np.array(found["curve"]["weights"]), np.array(found["curve"]["s11"])
    assert weights @ curve == pytest.approx(found["stress_GPa"]["s11"], rel=1e-12)
    assert found["E_GPa"] == pytest.approx(24.8, abs=0.4)


def test_crisp_options_reach_the_cell(capfd):
    crisp = [
        "--set",
        "radius.a1=0.5",
        "--set",
        "radius.a3=0.5",
        "--set",
        "radius.a2=0",
        "--set",
        "radius.a4=0",
        "--method",
        "series",
    ]
    found = answer(["cell", PAPER, *crisp, "--set", "cell.inclusion_modulus=80000 MPa"], capfd)
    assert found["stress_GPa"]["s11"] == pytest.approx(
        0.467852842132, rel=1e-9
    )  # series solution at r = 0.5
    same = answer(["cell", PAPER, *crisp, "--set", "cell.inclusion_modulus=20 GPa"], capfd)
    assert same["E_GPa"] == pytest.approx(20, rel=1e-10)


def test_modulus_prints_what_it_promises_whatever_the_workers(capfd, tmp_path):
    base = ["modulus", PAPER, "--method", "series"]
    one = answer([*base, "--workers", "1", "--out", str(tmp_path / "modulus.nc")], capfd)
    two = answer([*base, "--workers", "2"], capfd)
    assert one["samples"] == 225
    assert one["alpha"] == [0, 0.25, 0.5, 0.75, 1]
    for name in ("E_GPa", "nu", "s11_GPa", "s12_GPa"):
        assert one[name] == two[name]
        assert one[name]["lower"] == sorted(one[name]["lower"])
        assert one[name]["upper"] == sorted(one[name]["upper"], reverse=True)
    handed = answer(
        [
            "envelope",
            PAPER,
            "--fuzzy",
            "E",
            "--duration",
            "0.5",
            "--modulus",
            str(tmp_path / "modulus.nc"),
        ],
        capfd,
    )
    typed = answer(["envelope", PAPER, "--fuzzy", "E", "--duration", "0.5"], capfd)
    assert handed["min"][0][0] == pytest.approx(typed["min"][0][0], rel=1e-2)
    assert handed["min"] != typed["min"]


def test_envelope_prints_what_it_promises(capfd, tmp_path):
    import xarray

    path = tmp_path / "envelope.nc"
    found = answer(
        [
            "envelope",
            PAPER,
            "--fuzzy",
            "E,m",
            "--duration",
            "1",
            "--step",
            "0.01",
            "--out",
            str(path),
        ],
        capfd,
    )
    assert np.shape(found["min"]) == np.shape(found["max"]) == (5, 3)
    assert found["trajectories"] > 0
    with xarray.open_dataset(path) as dataset:
        assert dataset["lower"].dims == ("alpha", "time", "output")
        assert dataset["upper_at"].dims == ("alpha", "time", "output", "parameter")
        assert dataset["lower"].attrs["units"] == "m"
        assert list(dataset["parameter"].values) == ["E", "m1", "m2", "m3"]
        assert {"format_version", "command", "versions", "case", "fingerprint"} <= set(
            dataset.attrs
        )
    assert [file.name for file in tmp_path.iterdir()] == ["envelope.nc"]


SAMPLED = ("vertex", "monte-carlo", "quasi-monte-carlo")


@pytest.mark.parametrize("method", ENVELOPE_METHODS)
def test_every_offered_method_runs_and_gets_the_tolerance(method, capfd):
    from alphacut import frame

    assert method in frame.METHODS
    found = answer(
        [
            "envelope",
            PAPER,
            "--method",
            method,
            "--fuzzy",
            "E",
            "--duration",
            "0.5",
            "--alpha",
            "[0, 1]",
            *(["--best-effort"] if method not in ("auto", *SAMPLED) else []),
        ],
        capfd,
    )
    assert found["min"][0][0] <= found["min"][1][0] <= found["max"][1][0] <= found["max"][0][0]
    changes = [f"envelope.method={method}"]
    if method in SAMPLED:
        with pytest.raises(BadInput, match="no such option"):
            load(PAPER, [*changes, "envelope.tolerance=2 mm"])
    else:
        task = task_of(load(PAPER, [*changes, "envelope.tolerance=2 mm"]))
        followed = method.endswith("graph-follower")
        share = 0.1 if followed else {"modal": 1 / 8}.get(method, 1.0)  # 0.1 is the case's gain
        assert method_options(task)["tolerance"] == pytest.approx(2e-3 * share)


E_SHORT = ["envelope", PAPER, "--fuzzy", "E", "--duration", "0.5"]


def test_a_certificate_encloses_the_bounds(capfd):
    found = answer([*E_SHORT, "--method", "modal", "--certify", "1e-5"], capfd)
    assert found["nature"] in ("guaranteed", "verified by sampling")
    assert main([*E_SHORT, "--certify", "1e-5", "--workers", "2", "--alpha", "0"]) == 0
    told = capfd.readouterr().out
    assert "eigen-analyses" in told
    assert "enclosed to within 10.00 µm of q1;" in told  # no word that the program chose it


def test_a_gap_in_the_case_is_that_of_the_proof(capfd):
    keys = ["--set", "envelope.certify=20 um", "--set", "envelope.method=auto"]
    asked = ["envelope", PAPER, *keys, "--duration", "0.5", "--fuzzy", "m1"]
    found = answer(asked, capfd)
    assert found["nature"] == "guaranteed"
    assert found["facts"]["gap"] == pytest.approx(2e-5, rel=1e-3)


def test_what_cannot_be_certified_is_refused(capfd):
    assert main(["envelope", "cases/pendulum.toml", "--set", "envelope.certify=1 um"]) == 2
    assert "a pendulum cannot be certified" in capfd.readouterr().err
    assert main(["envelope", PAPER, "--method", "vertex", "--certify", "1e-5"]) == 2
    assert "cannot certify" in capfd.readouterr().err


def test_a_gap_that_no_proof_reaches_is_refused_by_its_key(capfd):
    asked = ["envelope", PAPER, "--fuzzy", "E,m", "--duration", "0.5", "--alpha", "0"]
    gap = ["--set", "envelope.certify=1e-14 m", "--set", "envelope.method=auto"]
    for more in (["--certify", "1e-14"], ["--certify", "1e-14", "--explain"], gap):
        assert main([*asked, *more]) == 2
        (line,) = capfd.readouterr().err.splitlines()
        assert line.startswith("alphacut: envelope.certify: the gap 1e-14"), line
        assert line.endswith("ask for a wider gap or a lower tolerance")


def test_what_c_code_prints_does_not_spoil_the_json(capfd):
    with standard_output(True) as out:
        os.write(1, b"noise from a library\n")
        print("noise from Python", flush=True)
        out.write("{}\n")
    printed, err = capfd.readouterr()
    assert printed == "{}\n"
    assert "noise from a library" in err


def test_only_the_first_rank_speaks(capfd, monkeypatch):
    monkeypatch.setenv("OMPI_COMM_WORLD_RANK", "1")
    assert rank() == 1
    assert main(["check", PAPER]) == 0
    assert main(["check", "nowhere.toml"]) == 2
    assert capfd.readouterr() == ("", "")


def test_nothing_is_left_half_written(tmp_path):
    (tmp_path / "kept.txt").write_text("old", encoding="utf-8")

    def stopped():
        with whole_file(tmp_path / "kept.txt") as partial:
            partial.write_text("half", encoding="utf-8")
            raise RuntimeError("stopped")

    with pytest.raises(RuntimeError, match="stopped"):
        stopped()
    assert [(file.name, file.read_text()) for file in tmp_path.iterdir()] == [("kept.txt", "old")]


def test_numbers_that_are_not_finite_become_null():
    assert json.loads(as_json({"a": np.array([1.0, np.nan]), "b": {1: np.int64(2)}})) == {
        "a": [1.0, None],
        "b": {"1": 2},
    }


@pytest.mark.parametrize(
    ("words", "ours", "petsc"),
    [
        (["cell", "c.toml", "-rve_ksp_rtol", "1e-10"], ["cell", "c.toml"], {"ksp_rtol": "1e-10"}),
        (["-rve_ksp_monitor", "c.toml"], ["c.toml"], {"ksp_monitor": ""}),
        (
            ["-rve_ksp_view", "-rve_pc_type", "lu", "--json", "-"],
            ["--json", "-"],
            {"ksp_view": "", "pc_type": "lu"},
        ),
        (["-rve_shift", "-1.5", "c"], ["c"], {"shift": "-1.5"}),
    ],
)
def test_petsc_options_are_taken_out_of_the_command_line(words, ours, petsc):
    assert split_petsc(words) == (ours, petsc)


def test_a_second_run_takes_what_is_up_to_date(tmp_path, monkeypatch, capfd):
    from alphacut.stages.material import modulus
    from alphacut.stages.vibration import envelope

    arguments = [
        "run",
        PAPER,
        "--quick",
        "--set",
        "modulus.method=series",
        "--out",
        str(tmp_path),
        "--no-figures",
    ]
    assert main(arguments) == 0
    first = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))
    calls = []
    for stage in (modulus, envelope):
        monkeypatch.setattr(
            stage,
            "compute",
            lambda *given, name=stage.__name__, **named: calls.append(name) or 1 / 0,
        )
    assert main(arguments) == 0
    second = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))
    assert (second["modulus"], second["envelopes"]) == (first["modulus"], first["envelopes"])
    assert calls == []
    assert main([*arguments, "--set", "inclusion_modulus=[74, 80, 85] GPa"]) == 1
    assert calls == ["alphacut.stages.material.modulus"]
    assert main([*arguments, "--fresh"]) == 1
    capfd.readouterr()


def test_another_structure_or_record_is_computed_anew(tmp_path, capfd):
    from alphacut.stages.pipeline import Chain
    from alphacut.stages.vibration.studies import studies

    record = tmp_path / "building.record.csv"
    record.write_text((CASES / "building.record.csv").read_text(encoding="utf-8"), encoding="utf-8")
    case = tmp_path / "tower.toml"
    case.write_text((CASES / "tower.toml").read_text(encoding="utf-8"), encoding="utf-8")
    seen = set()

    def key_of(changes):
        chain = Chain(load(case, changes), tmp_path, quiet=True)
        return chain.key_of(studies(chain.case)[0], None)

    for changes in ([], ["tower.mass=12 t/m"], ["envelope.step=0.04 s"]):
        seen.add(key_of(changes))
    record.write_text(
        record.read_text(encoding="utf-8").replace("0.01,-0.00001", "0.01,-0.00002", 1),
        encoding="utf-8",
    )
    seen.add(key_of([]))
    assert len(seen) == 4


def test_a_failed_campaign_ends_with_status_3(tmp_path, monkeypatch, capfd):
    from alphacut.rve.series.model import SeriesModel

    def refuse(*_, **__):
        raise RuntimeError("no convergence here")

    monkeypatch.setattr(SeriesModel, "solve", refuse)
    assert (
        main(
            [
                "modulus",
                PAPER,
                "--method",
                "series",
                "--plan",
                "reduced",
                "--out",
                str(tmp_path / "m.nc"),
            ]
        )
        == 3
    )
    assert "samples failed" in capfd.readouterr().err
    assert not list(tmp_path.iterdir())


def test_an_interrupt_of_a_command_that_keeps_nothing_says_so(monkeypatch, capfd):
    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(COMMANDS["check"], "load", interrupted)
    assert main(["check", PAPER]) == 130
    assert "interrupted; nothing is kept" in capfd.readouterr().err


def test_a_command_line_means_the_command_that_it_begins_with():
    assert list(COMMANDS.meant(["repair", "run"])) == ["repair"]
    assert list(COMMANDS.meant(["--version", "run"])) == list(COMMANDS)
    assert list(COMMANDS.meant([])) == list(COMMANDS)


def test_a_command_loads_no_other():
    program = (
        "import sys; from alphacut.entry import main; main(['check', 'no-such.toml']);"
        " print(*(name for name in sys.modules if name.startswith('alphacut.commands.')))"
    )
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert "alphacut.commands.check" in run.stdout.split()
    assert not {"alphacut.commands.run", "alphacut.commands.cell"} & set(run.stdout.split())


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_has_help_and_takes_quiet(name):
    _, made = parsers("alphacut", COMMANDS)
    text = made[name].format_help()
    assert COMMANDS[name].ABOUT[:20].lower() in " ".join(text.split()).lower()
    assert "--quiet" in text


SHIPPED = [path for path in sorted(CASES.glob("*.toml")) if not path.stem.endswith(".quoted")]


# cases whose figures are of the kinds that others draw
DRAWN_ELSEWHERE = ("paper", "concrete", "paper-literal", "building", "spheres", "tower")
VARIANTS = ("concrete", "paper-literal")  # of the paper's case, run in the slow tests


MEASURED = """
schema = 1
title = "Measured moduli"
about = "One floor, for tests."
stages = ["modulus", "envelope"]
[modulus]
measured = "m.csv"
claim = "mean"
bounds = ["10 GPa", "60 GPa"]
[frame]
masses = ["10 t"]
lengths = "3 m"
second_moment = "1e-5 m^4"
dampers = "50 N s/m"
damper_placement = "ground"
displacements = "10 mm"
velocities = "0.1 m/s"
[envelope]
fuzzy = ["E"]
duration = "1 s"
step = "0.05 s"
alpha = [0.5, 1]
"""


def quick_run(path, folder, capfd, *more):
    """Summary of the quick form."""
    assert main(["run", str(path), "--quick", "--out", str(folder), "--quiet", *more]) == 0, (
        capfd.readouterr().err
    )
    return json.loads((folder / "summary.json").read_text(encoding="utf-8"))


@pytest.mark.parametrize(
    "path",
    [pytest.param(x, marks=[pytest.mark.slow] if x.stem in VARIANTS else []) for x in SHIPPED],
    ids=lambda path: path.stem,
)
def test_every_shipped_case_runs_in_its_quick_form(path, tmp_path, capfd):
    pytest.importorskip("dolfinx")
    undrawn = path.stem in DRAWN_ELSEWHERE
    more = ["--no-figures", "--set", "envelope.shares=false"] if undrawn else []
    if path.stem == "composite":  # every other pixel: the quick form keeps images as they are
        io = pytest.importorskip("skimage.io")
        io.imsave(tmp_path / "half.png", io.imread(path.with_suffix(".png"))[::2, ::2])
        more = ["--set", f"cell.image={tmp_path / 'half.png'}", "--set", "cell.pixel=2 µm"]
    summary = quick_run(path, tmp_path, capfd, *more)
    assert {"modulus", "envelopes"} & set(summary)
    assert bool(summary["figures"]) != undrawn
    assert all((tmp_path / name).stat().st_size > 1000 for name in summary["figures"])


def test_the_shipped_pendulum_reaches_its_own_tolerance(capfd):
    """Its quick form is coarser and asks for less."""
    assert main(["envelope", str(CASES / "pendulum.toml"), "--quiet"]) == 0, capfd.readouterr().err


@pytest.mark.slow
@pytest.mark.parametrize("name", DRAWN_ELSEWHERE)
def test_the_other_cases_draw_their_figures_too(name, tmp_path, capfd):
    summary = quick_run(CASES / f"{name}.toml", tmp_path, capfd)
    assert summary["figures"]
    assert all((tmp_path / figure).stat().st_size > 1000 for figure in summary["figures"])


def test_the_program_ends_with_its_status_its_output_and_what_was_left_for_the_end():
    program = (
        "import atexit; from alphacut.entry import leave; atexit.register(print, 'last');"
        " print('first'); leave(3)"
    )
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert (run.returncode, run.stdout, run.stderr) == (3, "first\nlast\n", "")


def test_a_run_refuses_a_folder_that_another_run_writes_into(tmp_path, capfd):
    command = ["run", PAPER, "--quick", "--out", str(tmp_path), "--quiet"]
    with alone("--out", tmp_path):
        assert main(command) == 2
    assert "another run is writing into this folder" in capfd.readouterr().err
    assert not list(tmp_path.iterdir())


def test_the_claim_of_measured_moduli_is_a_key_of_envelopes_too(tmp_path, capfd):
    (tmp_path / "m.csv").write_text("E [GPa]\n30\n31\n29.5\n32\n30.4\n", encoding="utf-8")
    path, tops = tmp_path / "c.toml", []
    path.write_text(MEASURED, encoding="utf-8")
    for claim in ("mean", "next value"):
        words = ["envelope", str(path), "--json", "-", "--quiet", "--set"]
        assert main([*words, f'modulus.claim="{claim}"']) == 0, capfd.readouterr().err
        tops.append(json.loads(capfd.readouterr().out)["max"][0][0])
    assert abs(tops[0] - tops[1]) > 1e-4


@pytest.mark.parametrize("integrator", ["midpoint", "rk4"])
def test_a_step_that_is_too_long_is_told_one_that_is_not(integrator, tmp_path, capfd):
    path, (head, _, rest) = tmp_path / "c.toml", MEASURED.partition("[modulus]")
    path.write_text(head.replace('"modulus", ', "") + rest[rest.index("[frame]") :], "utf-8")
    words = ["envelope", str(path), "--set", 'frame.modulus="[20, 25, 30] GPa"', "--quiet"]
    words += ["--method", "vertex", "--set", f"envelope.integrator={integrator}", "--strict"]
    assert main([*words, "--step", "0.5", "--duration", "2"]) == 2
    most = re.search(r"take (?:a step of )?at most (?:some )?([\d.]+) s", capfd.readouterr().err)
    main([*words, "--step", most[1], "--duration", f"{20 * float(most[1]):g}"])
    told = capfd.readouterr().err
    assert "omega_max h" not in told
    assert "duration" not in told


@pytest.mark.parametrize(
    ("streams", "status", "said"),
    [
        (">&-", 0, ""),
        (">&- 2>&-", 0, ""),
        ("| true", 0, ""),
        ("--json - >&-", 0, ""),
        (
            "> /dev/full",
            1,
            "alphacut: standard output cannot be written: No space left on device\n",
        ),
    ],
)
def test_streams_that_are_closed_or_full_leave_no_traceback(streams, status, said, tmp_path):
    words = (
        ("spectrum", str(CASES / "building.record.csv"), "--quiet")
        if "json" in streams
        else ("check", PAPER)
    )
    command = f"{sys.executable} -m alphacut {' '.join(words)} {streams}; exit ${{PIPESTATUS[0]}}"
    run = subprocess.run(["bash", "-c", command], capture_output=True, text=True)
    assert (run.returncode, run.stderr) == (status, said)


def test_warnings_of_the_libraries_are_plain_lines_each_once(monkeypatch, capfd):
    def run(*_):
        for _ in range(2):
            warnings.warn("rough\n  shares", stacklevel=1)
        return 0

    monkeypatch.setattr(COMMANDS["check"], "run", run)
    assert main(["check", PAPER]) == 0
    assert capfd.readouterr().err == "alphacut: warning: rough shares\n"
