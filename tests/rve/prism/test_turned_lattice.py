"""The square lattice at 45 degrees, as a cell of two particles on a mesh of one's own."""

from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("alphacut.rve.fenicsx")
pytest.importorskip("gmsh")

from alphacut.rve import MeshModel, Phase, SeriesModel
from alphacut.stochastic import HermiteMap, TruncatedNormal

MESHES = Path(__file__).parents[3] / "meshes"
MATRIX, PARTICLE = Phase(20e9, 0.3), Phase(80e9, 0.2)
RADIUS = 0.6


def stiffness_of_two(folder, size, monkeypatch):
    """C of particles at (−½, −½) and (½, ½), whose spacing √2 lies along the diagonals."""
    monkeypatch.syspath_prepend(MESHES)
    plane = import_module("plane")

    monkeypatch.setattr(plane, "FOLDER", folder)
    plane.start()
    places = [plane.circle(x, x, RADIUS / np.sqrt(2), size) for x in (-0.5, 0.5)]
    matrix = plane.surface(plane.square(size), *places)
    particles = [plane.surface(place) for place in places]
    plane.extrude({"matrix": [matrix], "particles": particles}, f"{size}.msh", layers=1)
    model = MeshModel(folder / f"{size}.msh")
    phases = {"matrix": MATRIX, "particles": PARTICLE}
    return model.solve(TruncatedNormal(-3, 3), phases)[0].stiffness


def test_the_turned_lattice_has_the_turned_stiffness(tmp_path, monkeypatch):
    coarse, fine = (stiffness_of_two(tmp_path, size, monkeypatch) for size in (0.24, 0.12))
    one = SeriesModel().solve(HermiteMap(RADIUS, 0, RADIUS, 0), MATRIX, [PARTICLE])[0]
    bulk, deviator, shear = one.moduli  # of the axes: at 45 degrees both shears exchange
    turned = np.zeros((3, 3))
    turned[:2, :2] = bulk / 2 - shear
    turned[[0, 1], [0, 1]] = bulk / 2 + shear
    turned[2, 2] = deviator / 2
    error = abs(coarse - fine).max()
    assert error < 2e-3 * turned[0, 0]
    assert (abs(fine - turned) <= error).all()
    assert abs(turned[2, 2] / shear - 1) > 0.05
