"""Guaranteed bounds of meshes of prisms by images of their slices."""

import numpy as np
import pytest

from alphacut.base.errors import RefusedError
from alphacut.rve import MeshModel, Phase, SeriesModel, VoigtPhase
from alphacut.rve.image.mesh_bounds import _slabs, mesh_bounds
from alphacut.rve.mesh.file import read_grid
from alphacut.rve.mesh.prism_grid import reference_radius
from alphacut.rve.mesh.wedge import vertices_and_midpoints
from alphacut.rve.prism.model import cached_grid
from alphacut.stochastic import HermiteMap, TruncatedNormal

LAW = TruncatedNormal(-3.0, 3.0)
MATERIALS = [Phase(20e9, 0.2), Phase(80e9, 0.3), Phase(200e9, 0.25)]


def serendipity(places):
    """Functions of the 15 nodes at places of the reference prism, shape (places, 15)."""

    def span(points):
        x, y, z = points.T
        linear = [np.ones_like(x), x, y]
        quadratic = [*linear, x * x, x * y, y * y]
        return np.array([*quadratic, *(f * z for f in quadratic), *(f * z * z for f in linear)]).T

    return span(places) @ np.linalg.inv(span(vertices_and_midpoints()))


@pytest.mark.parametrize("name", ["two-particles", "ring", "paper-coarse"])
def test_each_point_of_a_prism_lies_in_a_pixel_that_its_phase_touches(name, rng):
    grid = read_grid(f"meshes/{name}.msh")
    places = rng.dirichlet(np.ones(3), 200)[:, :2]
    functions = serendipity(np.column_stack([places, rng.random(200)]))
    points = np.einsum("pn,mnx->mpx", functions, grid.fixed[grid.cells])  # (prisms, places, 3)
    phase = np.broadcast_to(grid.phase[:, np.newaxis], points.shape[:2])
    n = 50
    row, column = np.moveaxis(np.floor((points[..., 1::-1] + 1) / 2 * n).astype(int) % n, -1, 0)
    share = []
    n_found = 0
    for ends, touched in _slabs(grid, grid.fixed, len(grid.names), pixels=n, per_layer=3):
        inside = (points[..., 2] >= ends[0]) & (points[..., 2] <= ends[1])
        assert touched[phase[inside], row[inside], column[inside]].all()
        n_found += inside.sum()
        assert touched.any(axis=0).all()
        share.append((touched.sum(axis=0) > 1).mean())
    assert n_found == pytest.approx(points[..., 0].size, rel=1e-6)
    assert max(share) < 0.35  # only pixels near interfaces are open


@pytest.mark.parametrize("name", ["ring", "paper-coarse"])
def test_the_stiffness_of_a_mesh_lies_inside_and_the_bounds_close_in(name):
    model = MeshModel(f"meshes/{name}.msh")
    names = read_grid(model.file).names
    phases = dict(zip(names, MATERIALS, strict=False))
    (result,) = model.solve(LAW, phases)
    bulk, difference, shear = result.moduli
    widths = []
    for pixels, slabs in ((24, 6), (48, 12)):
        bounds = model.bounds(LAW, phases, pixels=pixels, slabs=slabs)
        assert bounds.bulk.lower < bulk / 2 < bounds.bulk.upper
        assert bounds.shear("axes").lower < shear < bounds.shear("axes").upper
        low, high = (
            np.array([1, -1, 0]) @ end @ [1, -1, 0] for end in (bounds.lower, bounds.upper)
        )
        assert low < 2 * difference < high
        widths.append(bounds.width)
    assert widths[1] < 0.7 * widths[0]


def test_a_cone_of_the_paper_holds_the_series():
    """The mesh of a map, whose radii are those of the cone at its levels."""
    radii = HermiteMap(0.3, 0.0, 0.6, 0.0, LAW)
    grid = cached_grid(size=0.2, radius=reference_radius(radii), layers=6, parallel=False)
    bounds = mesh_bounds(grid, grid.positions(radii), LAW, MATERIALS[:2], pixels=48, slabs=18)
    (exact,) = SeriesModel().solve(radii, MATERIALS[0], MATERIALS[1:2])
    assert bounds.bulk.lower < exact.moduli[0] / 2 < bounds.bulk.upper
    assert bounds.shear("axes").lower < exact.moduli[2] < bounds.shear("axes").upper


def test_what_has_no_bounds_is_refused():
    model = MeshModel("meshes/paper-coarse.msh")
    names = read_grid(model.file).names
    phases = dict(zip(names, MATERIALS, strict=False))
    for numbers in ({"pixels": 0}, {"slabs": 1.5}):
        with pytest.raises(RefusedError):
            model.bounds(LAW, phases, **numbers)
    with pytest.raises(RefusedError, match="VoigtPhase"):
        model.bounds(
            LAW, phases | {names[0]: VoigtPhase(tuple(map(tuple, MATERIALS[0].stiffness)))}
        )
