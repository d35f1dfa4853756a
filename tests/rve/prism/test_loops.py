"""Compiled loops beside DOLFINx and NumPy, and what is kept between runs."""

import json
import subprocess
import sys
from dataclasses import fields

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse
from scipy.sparse.linalg import splu

pytest.importorskip("dolfinx")

from alphacut.entry import main
from alphacut.rve import Phase
from alphacut.rve.mesh import triangulation, wedge
from alphacut.rve.mesh.periodicity import identify
from alphacut.rve.mesh.prism_grid import PrismGrid, moved
from alphacut.rve.mesh.triangulation import triangulate
from alphacut.rve.prism.slice_stress import SliceStress
from alphacut.rve.prism.system import PrismSystem
from alphacut.rve.solver import c_loops, integrals, level_stiffness
from alphacut.rve.solver.level_factors import LevelFactors, saddle_factors
from alphacut.rve.solver.level_stiffness import LevelPattern
from alphacut.stochastic import HermiteMap, TruncatedNormal

MAP = HermiteMap(0.4, 0.1, 0.5, 0.2, TruncatedNormal())
PHASES = Phase(20e9, 0.3), Phase(80e9, 0.2)
CASE = "cases/paper.toml"


def by_dolfinx(system, poisson, share, strain):
    """Reduced stiffness and load of one phase, made by DOLFINx on a mesh of whole wedges."""
    import basix.ufl
    import dolfinx
    import ufl
    from dolfinx import fem
    from mpi4py import MPI

    grid = system.grid
    points = wedge._points_by_entity()
    ones = [[np.eye(len(p)).reshape(len(p), 1, len(p), 1) for p in part] for part in points]
    kinds = 0, basix.MapType.identity, basix.SobolevSpace.H1, False, 1, 2
    scalar = basix.ufl.custom_element(wedge.PRISM, [], wedge._coefficients(), points, ones, *kinds)
    of = {n: basix.ufl.blocked_element(scalar, shape=(n,)) for n in (2, 3)}
    mesh = dolfinx.mesh.create_mesh(MPI.COMM_SELF, cells=grid.cells, x=system.positions, e=of[3])
    space = fem.functionspace(mesh, of[2])
    at, weights = wedge.slab_rule()
    rule = {"quadrature_rule": "custom", "quadrature_points": at, "quadrature_weights": weights}
    element = basix.ufl.quadrature_element("prism", points=at, weights=weights)
    weight = fem.Function(fem.functionspace(mesh, element))
    own = mesh.topology.original_cell_index
    weight.x.array[:] = (share * system.form._density)[own].ravel()
    u, v = ufl.TrialFunction(space), ufl.TestFunction(space)
    c = Phase(1.0, poisson).stiffness
    moduli = ufl.as_matrix(c.tolist())

    def strain_of(w):
        slope = ufl.grad(w)
        return ufl.as_vector([slope[0, 0], slope[1, 1], slope[0, 1] + slope[1, 0]])

    dx = ufl.dx(mesh, metadata=rule)
    stiff = fem.form(weight * ufl.inner(moduli * strain_of(u), strain_of(v)) * dx)
    given = ufl.as_vector([float(e) for e in strain])
    force = fem.form(-weight * ufl.inner(moduli * given, strain_of(v)) * dx)
    nodes = np.empty(space.dofmap.index_map.size_local, np.int64)
    nodes[space.dofmap.list] = mesh.geometry.input_global_indices[mesh.geometry.dofmap]
    first = system.numbering.unknown_of_node[nodes]
    unknowns = np.where(first[:, None] >= 0, first[:, None] + np.arange(2), -1).ravel()
    kept = unknowns >= 0
    carry = np.zeros((len(unknowns), system.numbering.size))
    carry[np.flatnonzero(kept), unknowns[kept]] = 1
    matrix = fem.assemble_matrix(stiff).to_dense()
    return carry.T @ matrix @ carry, carry.T @ fem.assemble_vector(force).array


@pytest.mark.parametrize("radius", [0.5, 0.0])
def test_stiffness_and_loads_are_those_of_dolfinx(radius):
    grid = PrismGrid(triangulate(size=0.7, radius=radius), 2, radius > 0)
    system = PrismSystem(grid, pytest.importorskip("mpi4py.MPI").COMM_SELF)
    system.move(MAP)
    system.set_poisson(PHASES)
    strain = np.array([0.3, -0.2, 0.7])
    for phase in (0, 1):
        share = system.share if phase else 1 - system.share
        matrix, load = by_dolfinx(system, PHASES[phase].poisson, share, strain)
        found = system.stiffness(phase)
        dense = found.convert("dense").getDenseArray()
        assert abs(dense - matrix).max() < 1e-13 * abs(matrix).max()
        assert abs(system.load(phase, strain).array - load).max() < 1e-13 * abs(load).max()


def spread_matrices(count):
    """Positive definite matrices of a strip of triangles: their pattern, their entries, dense."""
    random = np.random.default_rng(7)
    corners = np.array([[k, k + 1, k + 2, (5 * k) % 23 - 1] for k in range(20)])
    pattern = LevelPattern(corners)
    halves = random.standard_normal((count, len(corners), 4, 4))
    elements = halves @ halves.swapaxes(-1, -2) + 0.1 * np.eye(4)
    values = [pattern.values(one) for one in elements]
    dense = np.zeros((count, pattern.size, pattern.size))
    row, column = pattern.rows_columns
    dense[:, row, column] = dense[:, column, row] = values
    return pattern, values, dense


@pytest.mark.parametrize("seed", [None, 1, 2])
@pytest.mark.parametrize(("count", "columns"), [(1, 1), (3, 2), (8, 3), (13, 4), (17, 7), (2, 0)])
def test_factors_are_those_of_numpy(count, columns, seed):
    pattern, values, dense = spread_matrices(count)
    mixed = None if seed is None else np.random.default_rng(seed).permutation(pattern.size)
    factors = LevelFactors(pattern, iter(values), mixed)
    vectors = np.random.default_rng(8).standard_normal((count, pattern.size, columns))
    forward, backward = factors.forward(vectors), factors.backward(vectors)
    order = factors._order
    assert sorted(order) == list(range(pattern.size))
    assert seed is not None or (order[1::2] == order[::2] + 1).all()  # a node's displacements
    for k, matrix in enumerate(dense):
        lower = np.linalg.cholesky(matrix[np.ix_(order, order)])
        first = scipy.linalg.solve_triangular(lower, vectors[k][order], lower=True)
        second = np.empty_like(vectors[k])
        second[order] = scipy.linalg.solve_triangular(lower.T, vectors[k])
        assert forward[k] == pytest.approx(first, rel=1e-12, abs=1e-12)
        assert backward[k] == pytest.approx(second, rel=1e-12, abs=1e-12)


def test_dissection_parts_a_plane_and_its_factors_take_less_work():
    plane = triangulate(size=0.04, radius=0.5)
    unknowns = identify(plane).unknown[plane.triangles]
    middles = plane.points[plane.triangles[:, :3]].mean(axis=1)
    pattern, work = LevelPattern(unknowns), []
    row, column = pattern.rows_columns
    lower = scipy.sparse.coo_matrix((np.full(len(row), -1.0), (row, column)))
    matrix = (lower + lower.T + 100 * scipy.sparse.eye(pattern.size)).tocsc()
    for order in (pattern.dissected(), LevelPattern(unknowns, middles).dissected()):
        assert sorted(order) == list(range(pattern.size))
        own = matrix[order][:, order]
        factor = splu(own, "NATURAL", diag_pivot_thresh=0, options={"SymmetricMode": True}).L
        work.append((np.diff(factor.indptr) ** 2.0).sum())
    assert work[1] < 0.85 * work[0]


def test_factors_of_saddle_points_are_those_of_elimination_row_by_row():
    random, triangles = np.random.default_rng(9), np.array([1, 2, 4])
    unknowns = (5 * np.arange(6)[:, None] + random.permutation(12)) % 30
    unknowns[0, 0] = -1
    halves = random.standard_normal((3, 6, 12, 12))
    elements = np.zeros((3, 6, 13, 13))
    elements[:, :, :12, :12] = halves @ halves.swapaxes(-1, -2) + np.eye(12)
    beside = random.standard_normal((3, len(triangles), 12))
    elements[:, triangles, 12, :12] = elements[:, triangles, :12, 12] = beside
    elements[:, triangles, 12, 12] = -1e-3
    factors = saddle_factors(LevelPattern(unknowns), triangles, elements)
    whole = np.column_stack([unknowns, np.full(6, -1)])
    whole[triangles, 12] = 30 + np.arange(3)
    vectors = random.standard_normal((3, 33, 2))
    forward, backward = factors.forward(vectors), factors.backward(vectors)
    order = factors._order
    for k, parts in enumerate(elements):
        dense = np.zeros((34, 34))  # what is fixed goes into the last row and column
        for own, part in zip(whole, parts, strict=True):
            dense[np.ix_(own, own)] += part
        rest, signs = dense[np.ix_(order, order)], np.where(order < 30, 1.0, -1.0)
        lower = np.zeros((33, 33))
        for j in range(33):
            lower[:, j] = rest[:, j] * signs[j] / np.sqrt(rest[j, j] * signs[j])
            rest = rest - signs[j] * np.outer(lower[:, j], lower[:, j])
        first = signs[:, None] * scipy.linalg.solve_triangular(lower, vectors[k][order], lower=True)
        second = np.empty_like(vectors[k])
        second[order] = scipy.linalg.solve_triangular(lower.T, vectors[k])
        assert forward[k] == pytest.approx(first, rel=1e-10, abs=1e-10)
        assert backward[k] == pytest.approx(second, rel=1e-10, abs=1e-10)


@pytest.mark.parametrize("bad", [-1e9, np.nan])
def test_one_matrix_that_is_not_positive_definite_is_refused(bad):
    pattern, values, _ = spread_matrices(10)
    values[9][0] = bad
    with pytest.raises(RuntimeError, match="wrong sign"):
        LevelFactors(pattern, iter(values))


def same(one, other):
    """Whether two meshes are alike to the last bit."""
    return all(
        np.array_equal(getattr(one, part.name), getattr(other, part.name)) for part in fields(one)
    )


def test_a_mesh_is_kept_to_the_last_bit(tmp_path, monkeypatch):
    asked, gmsh = [], triangulation._gmsh_triangles

    def counted(*what):
        asked.append(what)
        return gmsh(*what)

    monkeypatch.setattr(triangulation, "_gmsh_triangles", counted)
    meshes = [triangulate(size=0.5, radius=0.4, cache=tmp_path / "new") for _ in range(2)]
    assert same(*meshes)
    assert same(meshes[0], triangulate(size=0.5, radius=0.4))
    assert len(asked) == 2
    assert not same(meshes[0], triangulate(size=0.5, radius=0.45, cache=tmp_path / "new"))
    assert not same(meshes[0], triangulate(size=0.6, radius=0.4, cache=tmp_path / "new"))
    kept = list((tmp_path / "new").iterdir())
    assert len(kept) == 3
    for file in kept:
        file.write_bytes(file.read_bytes()[:100])
    assert same(meshes[0], triangulate(size=0.5, radius=0.4, cache=tmp_path / "new"))
    assert len(asked) == 5


def test_the_integral_is_found_again_without_ufl_and_made_where_it_is_gone(tmp_path, monkeypatch):
    monkeypatch.setattr(integrals, "kernels", lambda: tmp_path)
    made, compiled = [], integrals._compiled
    monkeypatch.setattr(integrals, "_compiled", lambda *which: made.append(1) or compiled(*which))
    find = integrals.triangle_integral.__wrapped__
    find(2, weighted=True)
    find(2, weighted=True)
    assert len(made) == 1
    note = next(path for path in tmp_path.iterdir() if not path.suffix)
    told, asked = note.read_text(encoding="utf-8"), {"scalar_type": "float32", "table_rtol": 0.1}
    monkeypatch.setattr("ffcx.options._load_options", lambda: ({}, asked))  # of folder or home
    note.write_text(str(tmp_path / "nowhere.so") + "\ntabulate", encoding="utf-8")
    find(2, weighted=True)
    assert len(made) == 2
    assert note.read_text(encoding="utf-8") == told


def test_what_a_killed_compilation_leaves_is_not_waited_for(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    integrals.triangle_integral.__wrapped__(1)
    assert [path.name for path in tmp_path.iterdir()] == ["alphacut"]  # no "fenics" to wait in
    assert {path.suffix for path in integrals.kernels().iterdir()} == {"", ".so"}


def test_loops_are_compiled_once_and_need_a_compiler(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    source = tmp_path / "three.c"
    source.write_text("int three(void) { return 3; }\n", encoding="utf-8")
    assert c_loops.c_loops.__wrapped__(source).three() == 3
    monkeypatch.setenv("CC", "no-such-compiler")
    assert c_loops.c_loops.__wrapped__(source).three() == 3
    source.write_text("int three(void) { return 4; }\n", encoding="utf-8")
    with pytest.raises(RuntimeError, match=r"three.c needs a C compiler, as DOLFINx does"):
        c_loops.c_loops.__wrapped__(source)


def test_the_program_gives_what_the_process_gives(capfd):
    words = ["solve", CASE, "--mesh-size", "0.5", "--layers", "2", "--json", "-"]
    assert main(words, program="test", names={"solve": "cell"}) == 0
    here = json.loads(capfd.readouterr().out)
    run = subprocess.run(
        [sys.executable, "-m", "rve", *words], capture_output=True, text=True, check=True
    )
    there = json.loads(run.stdout)
    assert here.pop("seconds") != there.pop("seconds")
    assert here == there


def slopes_by_numpy(table, nodes):
    """Derivatives of shape functions in the plane, shape (m, q, 2, n), and determinants."""
    jacobian = np.einsum("qan,mnx->mqax", table, nodes)
    return np.linalg.inv(jacobian) @ table, np.linalg.det(jacobian)


def strains_by_numpy(slopes):
    """Strains (3) that two components of each node make, shape (m, q, 3, 2 n)."""
    found = np.zeros((*slopes.shape[:2], 3, 2 * slopes.shape[-1]))
    found[..., 0, 0::2] = found[..., 2, 1::2] = slopes[:, :, 0]
    found[..., 1, 1::2] = found[..., 2, 0::2] = slopes[:, :, 1]
    return found


def test_stiffness_of_curved_triangles_is_that_of_numpy():
    random = np.random.default_rng(9)
    nodes = np.array([[0, 0], [1, 0], [0, 1], [0.5, 0], [0, 0.5], [0.5, 0.5]])
    nodes = nodes + 0.03 * random.standard_normal((4, 6, 2))
    moduli = random.standard_normal((4, 3, 3))
    slopes, determinant = slopes_by_numpy(
        level_stiffness.gradients(level_stiffness._CORNERS), nodes
    )
    strain = strains_by_numpy(slopes)
    found = np.einsum("mq,mqai,mab,mqbj->mij", determinant / 6, strain, moduli, strain)
    assert level_stiffness.element_stiffness(nodes, moduli) == pytest.approx(found, abs=1e-13)


@pytest.mark.parametrize("loads", [0, 1, 2, 3, 5, 6])
def test_strains_are_those_of_numpy(loads):
    grid = PrismGrid(triangulate(size=0.9, radius=0.5), 2)
    points, weights = wedge.slab_rule()
    slices = SliceStress(grid, grid.positions(MAP), points, weights)
    moved = np.random.default_rng(10).standard_normal((grid.nodes, 2, loads))
    found, determinant = slices.strain(grid.cells, moved, points)
    table = wedge.tabulate(points, derivatives=True)[:2].transpose(1, 0, 2)
    slopes, wanted = slopes_by_numpy(table, slices.positions[grid.cells, :2])
    values = moved[grid.cells].reshape(len(grid.cells), 1, 30, loads)
    assert determinant == pytest.approx(wanted, rel=1e-13)
    assert found == pytest.approx(strains_by_numpy(slopes) @ values, rel=1e-12, abs=1e-12)
    assert slices.determinants() == pytest.approx(wanted, rel=1e-13)


@pytest.mark.parametrize("radius", [0.3, 0.5, 0.8])
def test_only_edges_across_a_diagonal_outside_the_particle_stay_straight(radius):
    plane = triangulate(size=0.2, radius=0.5)
    points = moved(plane, radius)
    ends = plane.points[plane.ends]
    sides = [np.sign(np.round(ends[..., 0] + k * ends[..., 1], 9)) for k in (1, -1)]
    crossing = np.any([side.prod(axis=1) < 0 for side in sides], axis=0)
    outside = (np.linalg.norm(ends, axis=2) >= 0.5 - 1e-9).all(axis=1)
    bend = np.linalg.norm(points[plane.vertices :] - points[plane.ends].mean(axis=1), axis=1)
    arc = plane.arc[plane.vertices :]
    assert (crossing & outside).any()
    assert bend[crossing & ~arc].max() < 1e-14
    if radius != 0.5:
        assert bend[outside & ~crossing & ~arc].max() > 1e-4
