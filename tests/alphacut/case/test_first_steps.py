"""What a newcomer types wrongly is answered in one line that says what to type instead; status 2,
and nothing is computed.
"""

import re
from pathlib import Path

import pytest

from alphacut.case.load import cure
from alphacut.commands.microstructure import advise
from alphacut.entry import main
from alphacut.io import units
from alphacut.io.provenance import door
from alphacut.io.quantity import fuzzy

CASES = Path(__file__).parents[3] / "cases"
PAPER, BUILDING = str(CASES / "paper.toml"), str(CASES / "building.toml")


def refused(arguments, pattern, capfd):
    assert main(arguments) == 2
    out, err = capfd.readouterr()
    assert out == ""
    assert re.search(pattern, err), err
    assert "alphacut: alphacut" not in err
    assert len(err.splitlines()) == 1


@pytest.mark.parametrize(
    ("arguments", "pattern"),
    [
        (["rnu", PAPER], "command = rnu: .*see --help; did you mean run"),
        ([], "command line: .*see --help"),
        (
            ["modulus", PAPER, "--workers", "two"],
            "--workers = two: this is no whole number; allowed",
        ),
        (["cell", PAPER, "-ksp_rtol", "1e-3"], "-rve_ksp_rtol"),
        (
            ["cell", PAPER, "--method", "series", "-rve_ksp_rtol", "1e-3"],
            "-rve_ksp_rtol: method series does not use PETSc",
        ),
        (
            ["envelope", PAPER, "-rve_ksp_rtol", "1e-3"],
            "-rve_ksp_rtol: command envelope does not use PETSc",
        ),
        (["cell", PAPER, "--set", "radius.a2=0,1"], "write 0.1 with a point"),
        (["cell", PAPER, "--set", "cell.matrix_modulus=22,5 GPa"], "write 22.5 with a point"),
        (
            ["cell", PAPER, "--set", "cell.inclusion_modulus=[90,5, 95, 105] GPa"],
            "write 90.5 with a point",
        ),
        (["cell", PAPER, "--set", "cell.inclusion_modulus=80 gpa"], "did you mean GPa"),
        (
            ["cell", PAPER, "--set", "cell.inclusion_modulus=[95, 90, 105] GPa"],
            "lower ≤ modal ≤ upper",
        ),
        (["envelope", PAPER, "--set", "frame.masses=['20 t', '10 gt', '5 t']"], 'entry 2, "10 gt"'),
        (
            ["envelope", PAPER, "--set", "frame.masses=['20 t', '-10 t', '5 t']"],
            'entry 2, "-10 t": out of range',
        ),
        (
            ["envelope", BUILDING, "--set", "frame.masses=['20 t']"],
            "number of floors is that of frame.masses, which has 1",
        ),
        (
            ["envelope", BUILDING, "--fuzzy", "m"],
            r"alphacut modulus \S*building.toml --out modulus.nc`; .*alphacut run \S*building.toml",
        ),
    ],
)
def test_a_slip_is_answered_with_what_to_type(arguments, pattern, capfd):
    if "frame.masses=['20 t']" in arguments:
        assert main(arguments) == 2
        assert re.search(pattern, capfd.readouterr().err)
    else:
        refused(arguments, pattern, capfd)


@pytest.mark.parametrize(
    ("value", "pattern"),
    [
        ("22 GPa", 'put it in quotes: "22 GPa"'),
        ("[18, 20, 22] GPa", "put it in quotes"),
        ("0,2", "0.2, with a point"),
    ],
)
def test_broken_toml_names_its_cure(value, pattern, tmp_path, capfd):
    text = Path(PAPER).read_text(encoding="utf-8")
    (tmp_path / "c.toml").write_text(
        text.replace('matrix_modulus = "20 GPa"', f"matrix_modulus = {value}", 1), encoding="utf-8"
    )
    refused(["check", str(tmp_path / "c.toml")], pattern, capfd)


def test_a_comma_in_a_seed_asks_for_a_whole_number():
    assert cure("seed = 1,5") == "a whole number"


def test_units_with_plain_powers_are_understood():
    assert fuzzy("20000 N/mm2", "Pa").modal == 20e9
    assert fuzzy("100 cm4", "m^4").modal == fuzzy("1e-6 m^4", "m^4").modal
    assert fuzzy("9.81 m/s2", "m/s^2").modal == 9.81


def test_every_listed_unit_is_taken():
    for si, names in units.ACCEPTED.items():
        assert all(units.factor(name, si) > 0 for name in names)


def test_levels_on_the_command_line_are_a_list(capfd):
    assert main(["envelope", PAPER, "--fuzzy", "E", "--duration", "0.2", "--alpha", "0,1"]) == 0
    assert "α = 0" in capfd.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "pattern"),
    [
        (["run", PAPER, "--out", PAPER], "this is a file, and a folder is wanted"),
        (["modulus", PAPER, "--out", "FOLDER"], "this is a folder, and a file is wanted"),
        (["modulus", PAPER, "--out", "/proc/none/m.nc"], "nothing can be written in /proc"),
        (["modulus", PAPER, "--out", "m.csv"], r"this ending is not known; allowed: \.nc"),
        (["envelope", PAPER, "--out", "m.csv"], r"this ending is not known; allowed: \.nc"),
        (
            ["mesh", PAPER, "--out", "m.stl"],
            "no format that holds quadratic elements.*allowed: .vtu",
        ),
        (["cell", PAPER, "--json", "x.csv"], "not that of JSON"),
        (["cell", PAPER, "--json", PAPER + "/x.json"], "nothing can be written"),
    ],
)
def test_what_cannot_be_written_is_refused_before_computing(arguments, pattern, tmp_path, capfd):
    refused([str(tmp_path) if word == "FOLDER" else word for word in arguments], pattern, capfd)
    assert not list(tmp_path.iterdir())


def test_outside_the_environment_its_limits_are_told(monkeypatch, capfd):
    monkeypatch.setenv("ALPHACUT_INSIDE", "1")
    refused(
        ["modulus", PAPER, "--out", "/proc/none/m.nc"],
        "only the project, the current folder, home and the temporary",
        capfd,
    )
    refused(
        ["check", "/srv/none.toml"],
        "only the project, the current folder, home and the temporary",
        capfd,
    )


@pytest.mark.parametrize(
    "text",
    [
        "{",
        "[]",
        "{}",
        (
            '{"case": "x", "title": 3, "case_text": 1, "command": 2, "versions": {}, "seconds": 1,'
            ' "modulus": {}}'
        ),
    ],
)
def test_a_damaged_summary_is_named_with_its_cure(text, tmp_path, capfd):
    (tmp_path / "summary.json").write_text(text, encoding="utf-8")
    refused(["report", str(tmp_path)], "summary.json: this file is damaged: .*alphacut run", capfd)


def test_a_damaged_modulus_is_one_line_without_the_libraries_words(tmp_path, capfd):
    (tmp_path / "bad.nc").write_text("nothing", encoding="utf-8")
    refused(
        ["envelope", PAPER, "--modulus", str(tmp_path / "bad.nc")],
        "--modulus = .*bad.nc: this is no NetCDF file",
        capfd,
    )


def test_a_fragment_says_what_it_is_for_and_a_crisp_slope_is_warned_of(capfd):
    advise("[radius]\na2 = 0.3\na4 = [0.1, 0.2, 0.3]\n", "particles")
    err = capfd.readouterr().err
    assert "warning: a2 came out crisp" in err
    assert "a4 came out" not in err
    assert "put particles/radius.toml in place of [radius]" in err


def test_a_modulus_that_is_not_kept_says_how_to_keep_it(capfd):
    assert (
        main(
            [
                "modulus",
                str(CASES / "porous.toml"),
                "--method",
                "series",
                "--plan",
                "reduced",
                "--alpha",
                "0,1",
            ]
        )
        == 0
    )
    assert (
        f"--out modulus.nc, then {door()} envelope {CASES / 'porous.toml'} --modulus modulus.nc"
        in capfd.readouterr().err
    )


def test_a_run_ends_with_its_main_numbers_and_the_next_command(tmp_path, capfd):
    case = [
        "run",
        str(CASES / "paper-literal.toml"),
        "--quick",
        "--no-figures",
        "--out",
        str(tmp_path),
    ]
    assert main(case) == 0
    out, err = capfd.readouterr()
    assert re.search(r"q3 from −\S+ [mµ]?m to \S+ [mµ]?m at the lowest α", out)
    assert f"next: {door()} report {tmp_path}" in err
