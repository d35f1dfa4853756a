"""Every kind of bad input ends in one clear line for each problem, exit status 2, no traceback,
nothing written.
"""

import json
import re
import shlex
from pathlib import Path

import pytest

from alphacut.case.load import load
from alphacut.entry import main
from alphacut.stages.vibration.envelope_task import task_of

PAPER = Path(__file__).parents[3] / "cases" / "paper.toml"


def edited(folder: Path, old: str, new: str) -> str:
    """A copy of the paper's case with one change."""
    text = PAPER.read_text(encoding="utf-8")
    assert old in text
    path = folder / "case.toml"
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    return str(path)


CASES = r"""
unknown key | matrix_modulus = | matrix_modulos = | matrix_modulos.*no such.*mean.*matrix_modulus
unknown section | [mesh] | [mash] | mash.*no such section.*mean mesh
missing key | step = "0.01 s" |  | envelope.step: missing
wrong unit | "20 GPa" | "20 kg" | cell.matrix_modulus = "20 kg".*unit "kg" is wrong.*80 GPa
misspelt unit | "20 GPa" | "20 Gpa" | cell.matrix_modulus.*unit "Gpa" is wrong
missing unit | "20 GPa" | 20 | cell.matrix_modulus = 20.*unit is missing
needless unit | matrix_poisson = 0.3 | matrix_poisson = "0.3 m" | cell.matrix_poisson.*unit "m" is wrong
radius too large | 0.9975] | 9.975] | radius.a4.*must stay inside \(0, 1\)
ratio | inclusion_poisson = 0.3 | inclusion_poisson = 0.5 | poisson = 0.5.*inside \(-1, 0.5\)
modulus | "20 GPa" | "-20 GPa" | cell.matrix_modulus.*out of range.*greater than 0
mass | "[19, 20, 21] t" | "[0, 20, 21] t" | frame.masses.*out of range.*greater than 0
triangle | [75, 80, 85] | [85, 80, 75] | inclusion_modulus.*triangle is not in rising order
layers | layers = 12 | layers = 0 | mesh.layers = 0.*from 1 to
layers in parts | layers = 12 | layers = 1.5 | mesh.layers.*whole number
not a number | "20 GPa" | "twenty GPa" | cell.matrix_modulus.*does not begin with a number
no comma | "20 GPa" | "[20 21] GPa" | cell.matrix_modulus.*a comma is missing: write 20, 21
not finite | a1 = 0.1337 | a1 = nan | radius.a1 = nan.*does not begin with a number
not TOML | "20 GPa" | "20 GPa | cell.matrix_modulus.*not TOML
written twice | a1 = 0.1337 | a1 = 0.1337\na1 = 0.2 | radius.a1.*not TOML
unknown choice | "conforming" | "conform" | mesh.interface.*no such choice.*mean conforming
unknown input | ["E", "m"]      | ["E", "k"]      | fuzzy = k.*no input k
floors | ["2.5 m", "2.7 m", "2.7 m"] | ["2.5 m", "2.7 m"] | lengths: got 2 values for 3 floors
levels | alpha = [0, 0.25, 0.5, 0.75, 1]  | alpha = [0, 0.5, 0.25, 1]  | modulus.alpha.*rising order
level outside | alpha = [0, 0.25, 0.5, 0.75, 1]  | alpha = [0, 1.5]  | modulus.alpha.*from 0 to 1
version | schema = 1 | schema = 99 | schema = 99.*equal to 1
stage without section | [mesh]\n | [modulus.mesh]\n | modulus.mesh.*no such key
duration | step = "0.01 s" | step = "0.007 s" | duration.*not a whole number of steps
"""
"""Name, what stands in the paper's case, what takes its place, what the message says."""
ROWS = [line.replace("\\n", "\n").split(" | ") for line in CASES.strip("\n").split("\n")]


def run(line: str) -> int:
    """Status of a command line."""
    return main(shlex.split(line))


@pytest.mark.parametrize(
    ("old", "new", "pattern"), [row[1:] for row in ROWS], ids=[r[0] for r in ROWS]
)
def test_a_bad_case_is_one_line_per_problem_and_status_2(old, new, pattern, tmp_path, capfd):
    path = edited(tmp_path, old, new)
    before = set(tmp_path.iterdir())
    status = main(["modulus", path, "--out", str(tmp_path / "modulus.nc"), "--json", "-"])
    out, err = capfd.readouterr()
    assert status == 2
    assert out == ""
    assert "Traceback" not in err
    assert all(line.startswith("alphacut: ") for line in err.splitlines())
    assert any(
        re.search(pattern, line) and re.search(r"case.toml:\d+:", line) for line in err.splitlines()
    ), err
    assert set(tmp_path.iterdir()) == before


COMMANDS = r"""
cell nowhere.toml | nowhere.toml: there is no such file
cell . | this is a folder
cell PAPER --layers 0 | mesh.layers = 0
cell PAPER --set cell.inclusion_modulus=80 | inclusion_modulus = 80: the unit is missing
cell PAPER --set radius.a2=9 | must stay inside \(0, 1\)
cell PAPER --layer 3 | no such option.*mean --layers
cell PAPER --method auto --exclude serie | --exclude.*no model serie
cell PAPER --set 'matrix_modulis=20 GPa' | --set.*no key matrix_modulis.*mean cell.matrix_modulus
cell PAPER --set layers | --set.*no = in it
cell PAPER --set 'alpha=[0, 1]' | alpha is not clear.*modulus.alpha, envelope.alpha
modulus PAPER --workers 0 | --workers = 0
envelope PAPER --modulus '[26, 25, 24] GPa' | --modulus.*rising order
envelope PAPER --modulus 25 | --modulus.*unit is missing
envelope PAPER --modulus nowhere.nc | --modulus.*no such file
envelope PAPER --fuzzy E,x | no input x
envelope PAPER --fuzzy l | envelope.fuzzy = l.*crisp
envelope PAPER --step 0.2 --strict | envelope.step.*omega_max h
envelope PAPER --exclude modals | --exclude.*no method modals
envelope PAPER --method auto --exclude vertex | 'vertex' is unknown
nothing | command = nothing: there is no such command.*see --help
 | required
"""


@pytest.mark.parametrize("row", COMMANDS.strip("\n").split("\n"))
def test_a_bad_command_line_is_one_line_and_status_2(row, capfd):
    line, pattern = row.split(" | ")
    status = run(line.replace("PAPER", str(PAPER)))
    out, err = capfd.readouterr()
    assert status == 2
    assert out == ""
    assert re.search(pattern, err), err
    assert len(err.splitlines()) == 1


def test_every_problem_of_a_case_is_named_at_once(tmp_path, capfd):
    path = tmp_path / "case.toml"
    text = PAPER.read_text(encoding="utf-8")
    path.write_text(
        text.replace("20 GPa", "20 m")
        .replace("layers = 12", "layers = 0")
        .replace("a1 =", "radius_below ="),
        encoding="utf-8",
    )
    assert main(["cell", str(path)]) == 2
    err = capfd.readouterr().err
    first, second, third = err.splitlines()
    assert "radius.radius_below" in first
    assert "did you mean a1?" in first
    assert "cell.matrix_modulus" in second
    assert "mesh.layers" in third


def test_a_coarse_step_warns_with_its_phase_error(capfd):
    short = "--duration 0.4 --step 0.2 --alpha '[0, 1]' --best-effort --json -"
    assert run(f"envelope {PAPER} --fuzzy E {short}") == 0
    assert "warning: envelope.step: 0.2 s gives omega_max h = 0.652" in capfd.readouterr().err


def test_bytes_that_are_not_utf8_name_key_and_line(tmp_path, capfd):
    path = tmp_path / "case.toml"
    path.write_bytes(PAPER.read_bytes().replace(b'"20 GPa"', b'"20 \xffGPa"'))
    assert main(["cell", str(path)]) == 2
    line = PAPER.read_text(encoding="utf-8").partition("matrix_modulus")[0].count("\n") + 1
    assert (
        f"case.toml:{line}: cell.matrix_modulus: byte 0xff is not UTF-8" in capfd.readouterr().err
    )


BUILDING = str(PAPER.with_stem("building"))
KNOWN = "--modulus '[24, 25, 26] GPa' --fuzzy m8"


WORTHLESS = r"""
--step '1 s' --strict | 1 s between nodes and a first natural period of 0.96 s: up to \d+ %
--certify '1 mm' --set envelope.integrator=midpoint | midpoint: a certificate is of the exact motion
--certify '1 km' --strict | certify: 1e\+03 m lets bounds of .* more than 1 %; 0.001 m would be 1 %
--tolerance '1 mm' --set 'frame.outputs=["base_shear"]' | tolerance = 1 mm: this is a length, and no
--certify '1 mm' --set 'frame.outputs=["shear1"]' | certify = 1 mm: this is a length, and no
--set exceedance.random=m3 | exceedance.random = m3: .*crisp
"""


@pytest.mark.parametrize("row", WORTHLESS.strip().split("\n"))
def test_what_makes_an_envelope_worthless_is_said_before_it_is_computed(row, capfd):
    line, pattern = row.split(" | ")
    assert run(f"envelope {BUILDING} {KNOWN} {line}") == 2
    err = capfd.readouterr().err
    assert any(re.search(pattern, line) for line in err.splitlines()), err


def test_a_gap_is_meant_for_displacements_whatever_output_stands_first(capfd):
    gaps = []
    for outputs in ('["base_shear", "q8"]', '["q8", "base_shear"]'):
        asked = "--certify '0.1 mm' --duration '2 s' --step '0.02 s' --alpha '[0, 1]' --json -"
        changed = f"--set 'frame.outputs={outputs}' --set 'exceedance.random=[]'"
        assert run(f"envelope {BUILDING} {KNOWN} {asked} {changed}") == 0
        found = json.loads(capfd.readouterr().out)
        assert found["facts"]["gap_output"] == "q8"
        assert found["nature"] == "guaranteed"
        gaps.append(found["facts"]["gap"])
    assert gaps[0] == pytest.approx(gaps[1], rel=0.2)
    assert max(gaps) <= 1e-4


def test_warnings_of_the_library_are_told_once_and_without_python_s_words(capfd):
    short = "--duration 5 --step 0.2 --alpha '[0, 1]' --best-effort"
    assert run(f"envelope {PAPER} --fuzzy E {short}") == 0
    err = capfd.readouterr().err
    assert err.count("leaves an error of time stepping") == 1
    assert "UserWarning" not in err


def test_without_a_displacement_the_tolerance_is_a_share_of_the_peaks():
    forces = task_of(
        load(BUILDING, ['frame.outputs=["base_shear"]'], without=("envelope.tolerance",))
    )
    assert (forces.relative, forces.tolerance) == (True, 1e-3)
    assert not task_of(
        load(BUILDING, ['frame.outputs=["base_shear", "q1"]'], without=("envelope.tolerance",))
    ).relative
