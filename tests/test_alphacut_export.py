"""What goes to other programs: material cards, and meshes that other programs read the right way round."""

import json
from pathlib import Path

import numpy as np
import pytest

from alphacut.entry import main

ROOT = Path(__file__).parent.parent
PAPER = str(ROOT / "cases" / "paper.toml")


@pytest.mark.parametrize("ending", [".inp", ".comm", ".mac", ".json"])
def test_a_material_card_holds_the_modulus(ending, tmp_path, capfd):
    path = tmp_path / f"material{ending}"
    assert main(["cell", PAPER, "--method", "series", "--export", str(path), "--json", "-"]) == 0
    found = json.loads(capfd.readouterr().out)
    text = path.read_text(encoding="utf-8")
    written = json.loads(text)["E_Pa"] if ending == ".json" else float(f"{found['E_GPa'] * 1e9:.9e}")
    assert written == pytest.approx(found["E_GPa"] * 1e9, rel=1e-9)
    assert ending == ".json" or f"{written:.9e}" in text


def test_an_ending_without_a_format_is_refused_before_computing(tmp_path, capfd):
    assert main(["cell", PAPER, "--export", str(tmp_path / "material.docx")]) == 2
    assert "names no format" in capfd.readouterr().err
    assert main(["mesh", PAPER, "--out", str(tmp_path / "mesh.docx")]) == 2
    assert "ending is not known" in capfd.readouterr().err
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
    assert main(["mesh", PAPER, "--mesh-size", "0.5", "--layers", "4", "--out", str(path), "--quiet"]) == 0
    grid = pyvista.read(path)
    volumes = grid.compute_cell_sizes()["Volume"]
    assert volumes.min() > 0
    assert volumes.sum() == pytest.approx(24, rel=1e-9)  # cell of 2 × 2 times θ from -3 to 3
    particle = volumes[grid.cell_data["phase"] == 1].sum() / 24
    assert 0.15 < particle < 0.35
