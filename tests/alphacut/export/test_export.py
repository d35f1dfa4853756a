"""What goes to other programs: material cards, and meshes that other programs read the right way
round.
"""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from alphacut.case.load import load
from alphacut.entry import main
from alphacut.export.fields import require_conforming
from alphacut.export.material_card import above
from alphacut.io.problem import BadInput

ROOT = Path(__file__).parents[3]
PAPER = str(ROOT / "cases" / "paper.toml")


@pytest.mark.parametrize("ending", [".inp", ".comm", ".mac", ".json"])
def test_a_material_card_holds_the_modulus(ending, tmp_path, capfd):
    path = tmp_path / f"material{ending}"
    assert main(["cell", PAPER, "--method", "series", "--export", str(path), "--json", "-"]) == 0
    found = json.loads(capfd.readouterr().out)
    text = path.read_text(encoding="utf-8")
    written = (
        json.loads(text)["E_Pa"] if ending == ".json" else float(f"{found['E_GPa'] * 1e9:.9e}")
    )
    assert written == pytest.approx(found["E_GPa"] * 1e9, rel=1e-9)
    assert ending == ".json" or f"{written:.9e}" in text


def plane_stiffness(values: list[float]) -> np.ndarray:
    """Plane-strain stiffness of orthotropic constants E1, E2, E3, ν12, ν13, ν23, G12 as the other
    programs read them.
    """
    e1, e2, e3, nu12, nu13, nu23, g12 = values[:7]
    give = np.array(
        [
            [1 / e1, -nu12 / e1, -nu13 / e1],
            [-nu12 / e1, 1 / e2, -nu23 / e2],
            [-nu13 / e1, -nu23 / e2, 1 / e3],
        ]
    )
    normal = np.linalg.inv(give)
    assert np.linalg.eigvalsh(normal).min() > 0
    stiffness = np.diag([0, 0, g12])
    stiffness[:2, :2] = normal[:2, :2]
    return stiffness


@pytest.mark.parametrize("ending", [".inp", ".comm", ".mac", ".json"])
@pytest.mark.parametrize("method", [["series"], ["prism", "--mesh-size", "0.5", "--layers", "3"]])
def test_a_material_card_holds_the_plane_stiffness_without_being_asked(
    ending, method, tmp_path, capfd
):
    pytest.importorskip("dolfinx") if method[0] == "prism" else None
    path = tmp_path / f"material{ending}"
    assert main(["cell", PAPER, "--method", *method, "--export", str(path), "--json", "-"]) == 0
    wanted = np.array(json.loads(capfd.readouterr().out)["stiffness_GPa"]) * 1e9
    text = path.read_text(encoding="utf-8")
    if ending == ".json":
        values = list(json.loads(text)["plane_constants"].values())
        assert json.loads(text)["stiffness"]["plane_strain"] == pytest.approx(wanted)
    elif ending == ".inp":
        values = [
            float(word)
            for word in text.split("CONSTANTS\n")[1].replace("\n", ",").split(",")
            if word.strip()
        ]
    elif ending == ".comm":
        values = [
            float(word) for word in re.findall(r"\w+=([\d.e+-]+)", text.split("ELAS_ORTH")[1])
        ]
    else:
        values = [float(word) for word in re.findall(r"^MP,\w+,2,(.*)$", text, re.MULTILINE)]
    assert len(values) == 9
    assert plane_stiffness(values) == pytest.approx(wanted, rel=1e-6, abs=1e-4 * wanted.max())


@pytest.mark.parametrize(("ending", "mark"), [(".inp", "**"), (".comm", "#"), (".mac", "!")])
def test_an_isotropic_card_says_how_isotropic_it_is(ending, mark, tmp_path):
    path = tmp_path / f"material{ending}"
    stiff = [
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
    assert (
        main(["cell", PAPER, "--method", "series", *stiff, "--quiet", "--export", str(path)]) == 0
    )
    (line,) = [
        line
        for line in path.read_text(encoding="utf-8").splitlines()
        if "1 in an isotropic plane" in line
    ]
    assert line.startswith(f"{mark} ")
    assert ": 1.499 (" in line
    assert "can lie below that of any isotropic composite" in line


def test_a_card_without_a_stiffness_leaves_it_out():
    from alphacut.export.material_card import FORMATS
    from alphacut.rve.result import Homogenised, StressCurve

    bare = Homogenised(
        StressCurve(np.zeros(1), np.ones(1), np.array([4e8]), np.array([1e8])), "prism"
    )
    for write in FORMATS.values():
        text = write(bare)
        assert "strain" not in text
        assert "PLANE" not in text


def test_an_ending_without_a_format_is_refused_before_computing(tmp_path, capfd):
    assert main(["cell", PAPER, "--export", str(tmp_path / "material.docx")]) == 2
    assert "names no format" in capfd.readouterr().err
    assert main(["mesh", PAPER, "--out", str(tmp_path / "mesh.docx")]) == 2
    assert "ending names no format" in capfd.readouterr().err
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["paper-coarse.vtu", "cylinder.msh"])
def test_a_shipped_mesh_is_read_and_has_both_phases(name):
    meshio = pytest.importorskip("meshio")
    from meshio._mesh import topological_dimension

    topological_dimension.setdefault("wedge15", 3)
    mesh = meshio.read(ROOT / "meshes" / name)
    assert mesh.cells[0].type == "wedge15"
    assert np.ptp(mesh.points, axis=0) == pytest.approx([2, 2, 6])


def test_wedges_stand_the_right_way_round_for_vtk(tmp_path):
    pyvista = pytest.importorskip("pyvista")
    pytest.importorskip("gmsh")
    path = tmp_path / "mesh.vtu"
    assert (
        main(["mesh", PAPER, "--mesh-size", "0.5", "--layers", "4", "--out", str(path), "--quiet"])
        == 0
    )
    grid = pyvista.read(path)
    volumes = grid.compute_cell_sizes()["Volume"]
    assert volumes.min() > 0
    assert volumes.sum() == pytest.approx(24, rel=1e-9)  # cell of 2 × 2 times θ from -3 to 3
    particle = volumes[grid.cell_data["phase"] == 1].sum() / 24
    assert 0.15 < particle < 0.35


def test_fields_of_a_homogeneous_cell_are_uniform(tmp_path):
    pytest.importorskip("dolfinx")
    from alphacut.export.fields import cell_fields

    mesh = cell_fields(load(PAPER, ["mesh.size=0.5", "mesh.layers=3", "inclusion_modulus=20 GPa"]))
    lateral = 20e9 / ((1 + 0.3) * (1 - 2 * 0.3)) * 0.01  # plane strain, ε11 = ε22 = 0.01 (eq. 6)
    assert mesh.point_data["stress_1_11_Pa"] == pytest.approx(
        np.full(len(mesh.points), lateral), rel=1e-8
    )
    assert mesh.point_data["displacement_1_in_half_sides"][:, 0] == pytest.approx(
        0.01 * mesh.points[:, 0], abs=1e-10
    )


def test_fields_name_the_interface_that_they_need():
    with pytest.raises(
        BadInput, match=r"mesh.interface = sign: fields need .*; allowed: conforming$"
    ):
        require_conforming(load(PAPER, ["mesh.interface=sign"]))


def test_stress_jumps_across_the_interface_and_displacement_does_not():
    pytest.importorskip("dolfinx")
    from alphacut.export.fields import cell_fields

    mesh = cell_fields(load(PAPER, ["mesh.size=0.4", "mesh.layers=3"]))
    _, first, count = np.unique(
        mesh.points.round(12), axis=0, return_index=True, return_counts=True
    )
    twice = mesh.points[first[count == 2]].round(12)
    assert len(twice) > 50
    pairs = [np.flatnonzero((mesh.points.round(12) == point).all(axis=1)) for point in twice[:40]]
    jumps = [abs(np.subtract(*mesh.point_data["stress_2_12_Pa"][pair])) for pair in pairs]
    assert max(jumps) > 1e7
    assert all(
        np.ptp(mesh.point_data["displacement_2_in_half_sides"][pair], axis=0).max() < 1e-14
        for pair in pairs
    )


def test_fields_come_with_errors_that_fall_with_the_mesh(tmp_path, capfd):
    pytest.importorskip("dolfinx")
    found = []
    for size in ("0.5", "0.25"):
        words = ["--mesh-size", size, "--layers", "6", "--fields", "--json", "-"]
        assert main(["mesh", PAPER, *words, "--out", str(tmp_path / "cell.vtu")]) == 0
        found.append(json.loads(capfd.readouterr().out)["declared_error"])
    for name in ("displacement_1", "displacement_2", "stress_1", "stress_2"):
        assert 0 < found[1][name] < 0.6 * found[0][name] < 0.2


COARSE = ["mesh", PAPER, "--mesh-size", "0.5", "--layers", "3", "--quiet"]


@pytest.mark.parametrize("ending", [".vtu", ".vtk", ".xdmf", ".msh", ".inp"])
def test_every_format_gives_points_wedges_and_phase_back(ending, tmp_path):
    pytest.importorskip("gmsh")
    meshio = pytest.importorskip("meshio")
    from alphacut.export.fields import MIRRORED, VTK_ORDER, prism_mesh

    wanted = prism_mesh(load(PAPER, ["mesh.size=0.5", "mesh.layers=3"]))
    assert main([*COARSE, "--out", str(tmp_path / f"cell{ending}")]) == 0
    assert [path.name for path in tmp_path.iterdir()] == [f"cell{ending}"]
    found = meshio.read(tmp_path / f"cell{ending}")
    wedges, phase = wanted.cells[0].data, wanted.cell_data["phase"][0]
    assert found.points == pytest.approx(wanted.points, abs=1e-14)
    assert [block.type for block in found.cells] == ["wedge15"]
    assert (found.cells[0].data == (wedges[:, MIRRORED] if ending in VTK_ORDER else wedges)).all()
    if ending == ".inp":
        sets = {name: np.concatenate(parts) for name, parts in found.cell_sets.items()}
        assert (sets["MATRIX"] == np.flatnonzero(phase == 0)).all()
        assert (sets["PARTICLE"] == np.flatnonzero(phase == 1)).all()
    else:
        assert (found.cell_data["phase"][0] == phase).all()


@pytest.mark.parametrize(
    "ending",
    [".bdf", ".nas", ".e", ".h5m", ".avs", ".mdpa", ".su2", ".ugrid", ".mesh", ".wkt", ".med"],
)
def test_formats_that_lose_wedges_or_phases_are_refused_in_one_line(ending, tmp_path, capfd):
    assert main([*COARSE, "--out", str(tmp_path / f"cell{ending}")]) == 2
    err = capfd.readouterr().err
    assert len(err.splitlines()) == 1
    assert "allowed: .vtu, .vtk, .xdmf, .msh, .inp" in err
    assert not list(tmp_path.iterdir())


def test_fields_are_refused_where_the_format_cannot_hold_them(tmp_path, capfd):
    assert main([*COARSE, "--fields", "--out", str(tmp_path / "cell.inp")]) == 2
    assert "cannot hold fields; allowed: .vtu, .vtk, .xdmf, .msh" in capfd.readouterr().err


@pytest.mark.parametrize("ending", [".vtk", ".xdmf", ".msh"])
def test_fields_come_back_with_their_units_in_their_names(ending, tmp_path):
    pytest.importorskip("dolfinx")
    meshio = pytest.importorskip("meshio")
    assert main([*COARSE, "--fields", "--out", str(tmp_path / f"cell{ending}")]) == 0
    found = meshio.read(tmp_path / f"cell{ending}").point_data
    names = {f"displacement_{load}_in_half_sides" for load in (1, 2)} | {
        f"stress_{load}_{c}_Pa" for load in (1, 2) for c in (11, 22, 12)
    }
    assert names <= set(found)
    assert found["stress_1_11_Pa"].max() > 1e8


def test_errors_on_cards_hold_their_own_digits_and_those_of_the_values():
    rng = np.random.default_rng()
    for error, value in 10 ** rng.uniform(-12, 12, (300, 2)):
        printed = float(f"{value:.9e}")
        assert float(above(error, value)) >= error + abs(printed - value)
        assert float(above(error, value)) <= 1.2 * (error + 5e-10 * value)
