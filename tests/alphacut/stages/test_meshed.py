"""Cases on a mesh of the user's own: from the file to the report, or refused by what does not fit."""

import json
from pathlib import Path

import pytest

pytest.importorskip("alphacut.rve.fenicsx")

from alphacut import main
from alphacut.rve import MeshModel, Phase
from alphacut.rve.image.bounds import StiffnessBounds
from alphacut.stochastic import TruncatedNormal
from tests.alphacut.case.files import prepared
from tests.alphacut.small import CELL, replaced, summary_of, summary_of_run, told_by, written

MESH = Path(__file__).parents[3] / "meshes/two-particles.msh"


def modulus(young):
    phases = {"matrix": Phase(20e9), "particles": Phase(young)}
    model = MeshModel(MESH)
    return model.solve(TruncatedNormal(-3, 3), phases)[0].with_average("isotropic").modulus


def test_fuzzy_phases_of_a_mesh_run_to_a_report(tmp_path):
    case = prepared(tmp_path, "mesh")
    assert "cell.phases" in told_by("check", case)
    text = told_by("run", case, "--out", tmp_path / "out", "--no-figures")
    assert "not declared" in text
    assert "guaranteed" not in text
    assert "C is an upper bound of this mesh" in text
    cuts = summary_of(tmp_path / "out")["modulus"]["E_GPa"]
    ends = [cuts["lower"][0], cuts["lower"][1], cuts["upper"][0]]
    assert ends == pytest.approx([modulus(e) / 1e9 for e in (75e9, 80e9, 85e9)], rel=1e-9)
    told_by("report", tmp_path / "out")
    page = (tmp_path / "out/report.html").read_text(encoding="utf-8")
    assert "Two particles" in page
    assert "C is an upper bound of this mesh" in page


def test_a_mesh_that_is_refined_declares_its_error(tmp_path):
    words = ["--set", "mesh.refine=true", "--json", str(tmp_path / "a.json")]
    shown = told_by("cell", prepared(tmp_path, "mesh"), *words)
    assert "not declared" not in shown
    assert "Cell: one UFL form over prisms by DOLFINx, solved by PETSc's cg with theta" in shown
    found = json.loads((tmp_path / "a.json").read_text(encoding="utf-8"))
    assert 0 < modulus(80e9) / 1e9 / found["E_GPa"] - 1 < found["error"]["space"] < 1e-3


@pytest.fixture(scope="module")
def bounds():
    """Bounds of E and ν of the two particles at the ends of their modulus."""

    def of(young):
        phases = {"matrix": Phase(20e9), "particles": Phase(young)}
        return MeshModel(MESH).bounds(TruncatedNormal(-3, 3), phases)

    return {young: of(young) for young in (75e9, 80e9, 85e9)}


def test_a_mesh_has_bounds_from_both_sides(tmp_path, bounds):
    words = ["--set", "mesh.bounds=true", "--json", str(tmp_path / "a.json")]
    shown = told_by("cell", prepared(tmp_path, "mesh"), *words)
    assert "The bounds are guaranteed for this mesh's geometry" in shown
    assert "C is an upper bound" not in shown
    assert "E_x, GPa, bounds" in shown
    found = json.loads((tmp_path / "a.json").read_text(encoding="utf-8"))
    low, high = found["bounds"]["constants"]["E_GPa"]
    assert [low, high] == pytest.approx([x / 1e9 for x in bounds[80e9].young("isotropic")])
    assert low < found["E_GPa"] <= high * (1 + 1e-7)
    assert high < low * 1.001
    assert found["bounds"]["stiffness_GPa"][1] == pytest.approx(bounds[80e9].upper / 1e9)


def test_alpha_cuts_of_a_mesh_with_bounds_are_guaranteed(tmp_path, bounds):
    case, out = prepared(tmp_path, "mesh"), tmp_path / "out"
    words = ["--set", "mesh.bounds=true", "--out", str(out), "--no-figures"]
    text = told_by("run", case, *words)
    assert "guaranteed for this mesh's geometry" in text
    assert "attained" not in text
    result = summary_of(out)["modulus"]
    assert result["nature"] == "guaranteed"
    low, high = StiffnessBounds(bounds[75e9].lower, bounds[85e9].upper).young("isotropic")
    cuts = result["E_GPa"]
    assert [cuts["lower"][0], cuts["upper"][0]] == pytest.approx([low / 1e9, high / 1e9])
    assert cuts["lower"][0] < modulus(75e9) / 1e9 < modulus(85e9) / 1e9 < cuts["upper"][0]
    assert cuts["upper"][1] < 1.001 * cuts["lower"][1]
    told_by("report", out)
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "bounds are guaranteed for this mesh" in page


# 2 G_T = 20 GPa > 3 (C11 + C12) = 6 GPa
AUXETIC = '[["10 GPa", "-8 GPa", "0 Pa"], ["-8 GPa", "10 GPa", "0 Pa"], ["0 Pa", "0 Pa", "10 GPa"]]'


def test_e_and_nu_of_no_isotropic_solid_are_refused_and_c_is_kept(tmp_path):
    phases = '"20 GPa", poisson = 0.3', '"[75, 80, 85] GPa", poisson = 0.3'
    case = prepared(tmp_path, "mesh", dict.fromkeys(phases, AUXETIC))
    text = told_by("cell", case, "--json", tmp_path / "c.json")
    assert "none: 2 G_T > 3 (C11 + C12)" in text
    assert "C is an upper bound of this mesh" in text  # whose error is not declared
    found = json.loads((tmp_path / "c.json").read_text())
    assert found["E_GPa"] is found["nu"] is None
    assert found["stiffness_GPa"][0] == pytest.approx([10, -8, 0], abs=1e-9)
    words = " ".join(told_by("check", case).split())
    assert "cell.phases.matrix.modulus 10 −8 0 | −8 10 0 | 0 0 10 GPa" in words
    err = told_by("run", case, "--no-figures", f"--out={tmp_path}/out", status=3)
    assert "E would be -61.54 GPa" in err
    assert "mend the function" not in err  # advice for Python


def solved(case, path, *options):
    """The document of the command `cell`, with the mesh in a file."""
    words = ["--export", str(path), "--json", str(path.with_suffix(".json")), "--quiet"]
    told_by("cell", case, *words, *options)
    return json.loads(path.with_suffix(".json").read_text(encoding="utf-8"))


def test_an_exported_cell_taken_as_the_mesh_has_the_same_modulus(tmp_path):
    prism = {'method = "series"': 'method = "prism"', "tolerance = 1e-6": ""}
    small = ["--set", "mesh.size=0.5", "--set", "mesh.layers=4"]
    right = solved(written(tmp_path, CELL, **prism), tmp_path / "a.msh", *small)
    case = prepared(tmp_path, "mesh", {"meshes/two-particles": "a", "particles =": "inclusion ="})
    result = solved(case, tmp_path / "b.msh")
    assert result["E_GPa"] == pytest.approx(right["E_GPa"], rel=1e-12)
    assert result["declared_error"] is None
    assert result["export"]["nodes"] == right["export"]["nodes"]


@pytest.mark.parametrize("command", ["check", "run", "cell"])
@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("particles =", "stones =", "phase is 'stones'"),
        ("two-particles.msh", "README.md", "without $MeshFormat at its start"),
    ],
)
def test_what_does_not_fit_is_refused_in_one_line(tmp_path, capfd, command, old, new, message):
    folder = tmp_path / ("folder " * 30)  # what is wrong is told before a long path
    folder.mkdir()
    case = prepared(folder, "mesh", {old: new})
    out = [f"--out={tmp_path}/out"] if command == "run" else []
    assert main([command, str(case), *out]) == 2
    said = capfd.readouterr().err
    assert message in said
    assert "samples failed" not in said
    assert "Error" not in said  # as Gmsh prints


def test_phases_of_a_mesh_have_losses_by_name_whatever_their_order(tmp_path):
    case, losses = prepared(tmp_path, "mesh"), []
    row = 'particles = { modulus = "[75, 80, 85] GPa", poisson = 0.3 }'
    reordered = {row: "", "[cell.phases]": f"[cell.phases]\n{row}"}
    of_phases = [f"--set=cell.phases.{loss}" for loss in ("matrix.loss=0.02", "particles.loss=0")]
    for changes in ({}, reordered):
        case.write_text(replaced(case.read_text(), changes))
        result = summary_of_run(case, "--set=modulus.alpha=[1]", *of_phases)["modulus"]
        losses.append(result["loss"]["E"]["upper"][-1])
    assert losses[0] == pytest.approx(losses[1], rel=1e-9)
    assert 0.015 < losses[0] < 0.02  # most energy is in the matrix
