"""What `cell` and `modulus` say of their numbers, and what they refuse instead of passing over."""

import json
from pathlib import Path

import pytest

from alphacut.entry import main
from alphacut.stages.material import modulus

CASES = Path(__file__).parents[3] / "cases"
PAPER = str(CASES / "paper.toml")
STIFF = [
    "--set",
    "cell.inclusion_modulus=70 GPa",
    "--set",
    "cell.matrix_modulus=3 GPa",
    "--set",
    "radius.a1=0.79",
    "--set",
    "radius.a2=0.02",
    "--set",
    "radius.a3=0.81",
    "--set",
    "radius.a4=0.02",
]


def test_the_cell_names_its_strains_and_its_anisotropy(capfd):
    assert main(["cell", PAPER, "--method", "series"]) == 0
    out, err = capfd.readouterr()
    assert "under ε11 = ε22 = 0.01" in out
    assert "under ε12 = 0.01" in out
    assert "shear_ratio = 1.0565" in out
    assert not err


@pytest.mark.parametrize("method", ["series", "slices"])
def test_the_shear_ratio_has_one_error_on_the_screen_and_in_the_export(method, tmp_path, capfd):
    file = tmp_path / "card.json"
    assert main(["cell", PAPER, "--method", method, "--export", str(file)]) == 0
    told = json.loads(file.read_text(encoding="utf-8"))
    value, error = told["shear_ratio"], told["declared_error"]["shear_ratio"]
    assert f"shear_ratio = {value:.4f} ± {error:.1e}: " in capfd.readouterr().out


@pytest.mark.parametrize("command", ["cell", "modulus"])
def test_the_isotropic_average_takes_the_place_of_eq_16_where_the_case_says_so(command, capfd):
    """Hill's average of both shear moduli; at 19 % between them E is 9 % higher or so."""
    found = {}
    for average in ("axes", "isotropic"):
        extra = ["--method", "series", "--set", f"modulus.average={average}"]
        extra += ["--set", "modulus.alpha=[1]"] if command == "modulus" else []
        assert main([command, PAPER, *extra, *STIFF[2:], "--quiet", "--json", "-"]) == 0
        found[average] = json.loads(capfd.readouterr().out)
    own, mean = found["axes"], found["isotropic"]
    if command == "cell":
        modulus = mean["E_GPa"]
    else:
        (modulus,) = mean["E_GPa"]["upper"]
        assert mean["nature"] == own["nature"]
    assert modulus == pytest.approx(own["beside"]["isotropic_average_E_GPa"], rel=1e-5)
    assert mean["beside"]["isotropic_average_E_GPa"] is None
    assert mean["beside"]["fibres"] == own["beside"]["fibres"]


@pytest.mark.parametrize(
    "command", [["cell"], ["modulus", "--plan", "reduced", "--set", "modulus.alpha=[1]"]]
)
def test_a_modulus_that_no_isotropic_composite_has_comes_with_a_warning(command, capfd):
    assert main([command[0], PAPER, *command[1:], "--method", "series", *STIFF]) == 0
    out, err = capfd.readouterr()
    assert "shear_ratio = 1.4986" in out
    assert "warning: shear modulus" in err
    assert "can lie below that of any isotropic composite" in err


def test_the_modulus_says_what_its_bounds_are_worth_and_the_error_that_they_do_not_count(capfd):
    pytest.importorskip("dolfinx")
    coarse = [
        "--set",
        "mesh.size=0.5",
        "--set",
        "mesh.layers=3",
        "--plan",
        "reduced",
        "--set",
        "modulus.alpha=[0, 1]",
    ]
    assert main(["modulus", PAPER, "--method", "prism", *coarse, "--quiet", "--json", "-"]) == 0
    error = json.loads(capfd.readouterr().out)["error"]
    assert main(["modulus", PAPER, "--method", "prism", *coarse]) == 0
    (line,) = [line for line in capfd.readouterr().out.splitlines() if line.startswith("bounds")]
    assert line.startswith("bounds inner: attained by the parameters")
    assert f"comes on top, estimated at {sum(error.values()):.1e} of E" in line
    assert "modal sample" in line
    assert main(["modulus", PAPER, "--method", "series", "--set", "modulus.alpha=[0, 1]"]) == 0
    assert (
        "bounds guaranteed: proved to hold the true range (given that the signs"
        in capfd.readouterr().out
    )


def test_a_cross_check_prints_the_difference_that_it_found(capfd):
    pytest.importorskip("dolfinx")
    assert main(["cell", PAPER, "--cross-check", "series,slices", "--tolerance", "1e-3"]) == 0
    assert "series and slices differ by" in capfd.readouterr().out
    assert (
        main(
            ["cell", PAPER, "--cross-check", "series,slices", "--tolerance", "1e-3", "--json", "-"]
        )
        == 0
    )
    assert 0 <= json.loads(capfd.readouterr().out)["difference"] < 1e-3


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (
            ["cell", "--method", "series", "--cross-check", "series"],
            "--cross-check = series: this takes two different models",
        ),
        (["cell", "--cross-check", "series,series"], "two different models"),
        (
            ["cell", "--method", "series", "--exclude", "series"],
            "--exclude = series: the method is series",
        ),
        (
            ["modulus", "--method", "prism", "--exclude", "series"],
            "the method is prism, and only method auto leaves a choice",
        ),
        (
            ["cell", "--method", "auto", "--tolerance", "1e-16"],
            "1e-16 is out of range; allowed: a number without a unit from 1e-10 to 0.1",
        ),
        (
            ["modulus", "--method", "auto", "--tolerance", "0.2"],
            "modulus.tolerance = 0.2: 0.2 is out of range",
        ),
    ],
)
def test_what_would_be_passed_over_is_refused(words, told, capfd):
    assert main([words[0], PAPER, *words[1:]]) == 2
    err = capfd.readouterr().err
    assert len(err.splitlines()) == 1
    assert told in err


def test_a_store_that_is_none_is_bad_input(tmp_path, capfd):
    path = tmp_path / "diameters.csv"
    path.write_text("d [mm]\n1.5\n", encoding="utf-8")
    assert main(["modulus", PAPER, "--method", "series", "--store", str(path)]) == 2
    assert "is no store of samples" in capfd.readouterr().err
    assert path.read_text(encoding="utf-8") == "d [mm]\n1.5\n"


def test_a_radius_beside_the_stage_that_makes_it_is_refused_by_its_option(tmp_path, capfd):
    text = (CASES / "spheres.toml").read_text(encoding="utf-8")
    case = tmp_path / "c.toml"
    case.write_text(text, encoding="utf-8")
    (tmp_path / "spheres.circles.csv").write_bytes((CASES / "spheres.circles.csv").read_bytes())
    assert main(["cell", str(case), "--radius", "0.6"]) == 2
    assert (
        "makes this section from the particles, --radius without them; allowed: one of"
        in capfd.readouterr().err
    )


def test_many_samples_are_told_before_with_a_plan_that_takes_fewer(tmp_path, capfd, monkeypatch):
    monkeypatch.setattr(modulus, "MANY", 8)
    case = [str(CASES / "porous.toml"), "--method", "series"]
    assert main(["modulus", *case, "--alpha", "0,1", "--plan", "general"]) == 0
    told = capfd.readouterr().err
    assert "samples of the cell, every combination of the inputs' points; modulus.plan" in told
    assert main(["modulus", *case, "--alpha", "0,1", "--plan", "signed"]) == 0
    assert "samples of the cell, every" not in capfd.readouterr().err
