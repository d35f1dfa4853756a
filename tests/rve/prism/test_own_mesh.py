"""Meshes of one's own: files are solved as they are, or refused with what does not fit."""

import runpy
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import KDTree

pytest.importorskip("alphacut.rve.fenicsx")

from alphacut.fuzzy import FailedError, RefusedError
from alphacut.rve import Ellipse, MeshModel, Phase, PrismModel, SeriesModel
from alphacut.rve.mesh.columns import extrude
from alphacut.rve.mesh.file import write
from alphacut.rve.mesh.wedge import vertices_and_midpoints
from alphacut.stochastic import HermiteMap, TruncatedNormal
from tests.refused import refuses

MESHES = Path(__file__).parents[3] / "meshes"
LAW, PAPER = TruncatedNormal(-3, 3), HermiteMap(0.1337, 0.1, 0.8663, 0.1692)
SOFT, HARD = Phase(20e9), Phase(80e9)


def grid_of(path):
    """The prisms of a file, as `MeshModel` takes them."""
    return MeshModel(path).cached_problem().grid


def solve(name, **phases):
    return MeshModel(MESHES / name).solve(LAW, phases)[0]


def test_a_written_cell_is_solved_as_the_cell_is(tmp_path):
    model = PrismModel(0.5, 4, stiffness=True)
    right = model.solve(PAPER, SOFT, [HARD])[0]
    grid = model.problem(PAPER).grid
    write(tmp_path / "a.msh", grid.positions(PAPER), grid.cells, grid.phase, grid.names)
    phases = {"inclusion": HARD, "matrix": SOFT}
    result = MeshModel(str(tmp_path / "a.msh")).solve(PAPER.distribution, phases)[0]
    assert result.modulus == pytest.approx(right.modulus, rel=1e-9)
    assert not result.errors
    assert np.isnan(result.estimated_error)
    assert solve("paper-coarse.msh", **phases).modulus == pytest.approx(right.modulus, rel=1e-9)


def test_two_particles_are_as_stiff_as_plane_triangles():
    """Elements of order 4 and 5 give 25.739483 GPa; those of order 2 lie above.

    Images of the discs are other cells: their stairs add 2e-4 to E at 512 × 512 pixels.
    """
    result = solve("two-particles.msh", matrix=SOFT, particles=HARD)
    assert 25.739483 < result.modulus / 1e9 < 25.739483 * 1.00015


@pytest.mark.usefixtures("read_here")
@pytest.mark.parametrize(
    ("outline", "contrast", "are_mixed", "layers"),
    [
        (Ellipse(1.0), 4, False, 2),
        (Ellipse(2.0, 30.0), 1e-2, False, 1),
        # columns of random phases: corners, and points where they cross
        (Ellipse(1.0), 9, True, 1),
    ],
)
def test_the_error_of_a_refined_mesh_covers_that_to_a_mesh_four_times_finer(
    tmp_path, rng, outline, contrast, are_mixed, layers
):
    radius = HermiteMap(0.2, 0.1, 0.6, 0.1) if layers > 1 else HermiteMap(0.45, 0, 0.45, 0)
    grid = extrude(size=rng.uniform(0.5, 0.8), radius=0.45, layers=layers, outline=outline)
    phase = np.tile(rng.integers(0, 2, len(grid.phase)), layers) if are_mixed else grid.phase
    write(tmp_path / "own.msh", grid.positions(radius), grid.cells, phase, grid.names)
    fine = MeshModel(tmp_path / "own.msh", refine=True).cached_problem().grid
    write(tmp_path / "fine.msh", fine.fixed, fine.cells, fine.phase, fine.names)
    phases = {"matrix": SOFT, "inclusion": Phase(20e9 * contrast)}
    result = MeshModel(tmp_path / "own.msh", refine=True).solve(LAW, phases)[0]
    [exact] = MeshModel(tmp_path / "fine.msh", refine=True).solve(LAW, phases)
    true = result.moduli / exact.moduli - 1
    assert (true > 0).all()  # spaces are nested: the finer mesh is softer
    assert (0.01 * result.modulus_errors < true).all()
    assert (true < result.modulus_errors).all()
    energy_error = abs(result.energies.values - exact.energies.values)
    assert (energy_error <= result.energies.errors + 1e-9 * result.modulus).all()


def quarters(path, phases):
    """Write a square of four by four squares, whose phases are numbers in an array (4, 4)."""
    corners, phase = [], []
    for i, j in np.ndindex(4, 4):
        square = np.array([[i, j], [i + 1, j], [i + 1, j + 1], [i, j + 1]]) / 2 - 1
        corners += [square[[0, 1, 2]], square[[0, 2, 3]]]
        phase += [phases[i, j]] * 2
    x, y, z = vertices_and_midpoints().T
    plane = np.stack([1 - x - y, x, y], axis=1) @ np.array(corners)
    theta = np.broadcast_to(6 * z - 3, plane.shape[:2])
    nodes = np.concatenate([plane, theta[..., np.newaxis]], axis=-1).reshape(-1, 3)
    points, cells = np.unique(nodes.round(9), axis=0, return_inverse=True)
    write(path, points, cells.reshape(-1, 15), np.array(phase), ("a", "b", "c")[: phases.max() + 1])
    return path


CHECKERBOARD = np.kron([[0, 1], [1, 0]], np.ones((2, 2), int))
ACROSS_THE_SIDES = np.roll(CHECKERBOARD, (1, 1), axis=(0, 1))
PARTICLE = np.pad(np.ones((2, 2), int), 1)
TOUCHING_AT_CORNERS = np.diag([1, 1, 0, 0])
THREE = np.array([[0, 0, 1, 1], [0, 0, 1, 1], [2, 2, 2, 2], [2, 2, 2, 2]])


@pytest.mark.parametrize(
    ("phases", "contrast", "declares"),
    [
        (CHECKERBOARD, 800, False),
        (CHECKERBOARD, 5, True),
        (ACROSS_THE_SIDES, 800, False),
        (TOUCHING_AT_CORNERS, 1 / 800, False),
        (PARTICLE, 800, True),
        (PARTICLE, 1 / 800, True),
        (THREE, 800, True),
    ],
)
def test_no_error_is_declared_where_phases_meet_crosswise(tmp_path, phases, contrast, declares):
    pytest.importorskip("gmsh")  # which writes the file
    path = quarters(tmp_path / "quarters.msh", phases)
    moduli = {"a": 1e9, "b": contrast * 1e9, "c": 30e9}
    named = {name: Phase(moduli[name]) for name in grid_of(path).names}
    [result] = MeshModel(path, refine=True).solve(LAW, named)
    assert np.isfinite(result.modulus_errors).all() == declares


def test_a_mesh_without_mid_levels_is_not_refined(tmp_path):
    grid = extrude(size=0.6, radius=0.4, layers=1)
    points = grid.positions(HermiteMap(0.4, 0, 0.4, 0)).copy()
    points[grid.cells[0, 8], 2] += 0.2  # the middle of one vertical edge
    write(tmp_path / "own.msh", points, grid.cells, grid.phase, grid.names)
    phases = {"matrix": SOFT, "inclusion": HARD}
    with pytest.raises(FailedError, match="does not stand on one level"):
        MeshModel(tmp_path / "own.msh", refine=True).solve(LAW, phases)


def write_lattice(gmsh, path, vectors, centre=(0, 0), radius=0.4):
    """Write a parallelogram, turned and moved as its vectors and centre say, around one disc."""
    geo = gmsh.model.geo
    first, second = np.array(vectors, float)
    size = np.hypot(*first) / 12

    def add_point(place):
        return geo.addPoint(*place, -3, size)

    ends = [centre + (a * first + b * second) / 2 for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    corners = [add_point(end) for end in ends]
    sides = [geo.addLine(corners[k], corners[(k + 1) % 4]) for k in range(4)]
    middle = add_point(np.array(centre))
    poles = [add_point(centre + radius * np.array(e)) for e in ((1, 0), (0, 1), (-1, 0), (0, -1))]
    arcs = [geo.addCircleArc(poles[k], middle, poles[(k + 1) % 4]) for k in range(4)]
    geo.synchronize()
    for master, side, vector in ((sides[3], sides[1], first), (sides[0], sides[2], second)):
        shift = np.eye(4)
        shift[:2, 3] = vector
        gmsh.model.mesh.setPeriodic(1, [side], [master], shift.ravel().tolist())
    disc = geo.addCurveLoop(arcs)
    surfaces = [geo.addPlaneSurface([geo.addCurveLoop(sides), disc]), geo.addPlaneSurface([disc])]
    bases = [(2, surface) for surface in surfaces]
    made = geo.extrude(bases, 0, 0, 6, numElements=[1], recombine=True)
    geo.synchronize()
    volumes = [tag for dimension, tag in made if dimension == 3]
    for volume, name in zip(volumes, ("matrix", "fibre"), strict=True):
        gmsh.model.addPhysicalGroup(3, [volume], name=name)
    gmsh.option.setNumber("Mesh.ElementOrder", 2)
    gmsh.option.setNumber("Mesh.SecondOrderIncomplete", 1)
    gmsh.model.mesh.generate(3)
    gmsh.write(str(path))


def turned(stiffness, angle):
    """Plane stiffness of a material turned counterclockwise."""
    c, s = np.cos(angle), np.sin(angle)
    rows = [c * c, s * s, c * s], [s * s, c * c, -c * s], [-2 * c * s, 2 * c * s, c * c - s * s]
    strain = np.array(rows)
    return strain.T @ stiffness @ strain


@pytest.mark.parametrize(
    ("vectors", "angle"),
    [
        ([(2, 0), (2, 2)], 0.0),
        ([(2, 0), (-4, 2)], 0.0),
        (np.sqrt(2) * np.array([(1, 1), (-1, 1)]), np.pi / 4),
        (2 * np.array([(np.cos(0.3), np.sin(0.3)), (-np.sin(0.3), np.cos(0.3))]), 0.3),
    ],
)
@pytest.mark.parametrize("unit", [1.0, 1e-3])
def test_any_cell_of_a_square_array_has_its_stiffness(tmp_path, gmsh, vectors, angle, unit):
    path = tmp_path / "cell.msh"
    centre = unit * np.array([3.0, -7.0])
    write_lattice(gmsh, path, unit * np.array(vectors), centre, 0.3 * unit)
    [found] = MeshModel(path).solve(LAW, {"matrix": SOFT, "fibre": HARD})
    [series] = SeriesModel().solve(HermiteMap(0.3, 0, 0.3, 0), SOFT, [HARD])
    right = turned(series.stiffness, angle)
    scale = right.max()
    np.testing.assert_allclose(found.stiffness, right, rtol=0, atol=2e-4 * scale)
    assert np.linalg.eigvalsh(found.stiffness - right)[0] > -1e-7 * scale


def test_three_phases_of_which_two_are_alike_are_two():
    inner = solve("ring.msh", matrix=SOFT, ring=SOFT, particle=HARD)
    outer = solve("ring.msh", matrix=SOFT, ring=HARD, particle=HARD)
    exact = PrismModel(0.25, 1, stiffness=True)
    for result, radius in ((inner, 0.5), (outer, 0.6)):
        right = exact.solve(HermiteMap(radius, 0, radius, 0), SOFT, [HARD])[0]
        assert result.modulus == pytest.approx(right.modulus, rel=2e-3)


def test_levels_may_be_uneven(tmp_path):
    """A cell that is straight along θ has one modulus whatever its levels."""
    prisms = extrude(size=0.5, radius=0.4, layers=3)
    results = []
    for power in (1.0, 2.0):
        points = prisms.positions(HermiteMap(0.4, 0, 0.4, 0)).copy()
        points[:, 2] = 6 * ((points[:, 2] + 3) / 6) ** power - 3
        half = prisms.cells[:, [8, 10, 11]]
        points[half, 2] = (points[prisms.cells[:, :3], 2] + points[prisms.cells[:, 3:6], 2]) / 2
        write(tmp_path / f"{power}.msh", points, prisms.cells, prisms.phase, prisms.names)
        model = MeshModel(tmp_path / f"{power}.msh")
        results.append(model.solve(LAW, {"matrix": SOFT, "inclusion": HARD})[0])
    assert results[1].modulus == pytest.approx(results[0].modulus, rel=1e-9)
    assert not np.allclose(results[0].curve.theta, results[1].curve.theta)


@pytest.mark.parametrize(
    ("law", "phases", "key"),
    [
        (LAW, {"matrix": SOFT}, "phase"),
        (
            LAW,
            dict.fromkeys(("matrix", "ring", "particle", "glue"), SOFT),
            "phase",
        ),
        (LAW, SOFT, "phases of the mesh"),
        (LAW, {"matrix": SOFT, "ring": 3, "particle": HARD}, "phase 'ring'"),
        (
            TruncatedNormal(-2, 3),
            dict.fromkeys(("matrix", "ring", "particle"), SOFT),
            "law of θ",
        ),
        # stretched onto the mesh, the law would move the geometry
        (
            TruncatedNormal(-3, 3 + 1e-7),
            dict.fromkeys(("matrix", "ring", "particle"), SOFT),
            "law of θ",
        ),
    ],
)
def test_law_and_phases_that_do_not_fit_are_refused(law, phases, key):
    with refuses(key):
        MeshModel(MESHES / "ring.msh").solve(law, phases)


def test_sides_that_do_not_match_are_refused_with_side_and_level():
    with pytest.raises(
        FailedError, match=r"node at .* of a side has no partner .*, on the level θ = -3"
    ):
        solve("unlike-sides.msh", matrix=SOFT, particle=HARD)


def lifted(points, cells, phase):
    points[0, 2] += 0.1
    return points, cells, phase


def narrowed(points, cells, phase):
    return points * np.stack([1 + points[:, 1] / 10, *np.ones((2, len(points)))], 1), cells, phase


def laid_down(points, cells, phase):
    theta = 2.5 * (points[:, 2] - points[:, 2].min()) / np.ptp(points[:, 2])
    return np.column_stack([theta, points[:, 1], points[:, 0]]), cells, phase


def with_a_hole(points, cells, phase):
    per_layer = len(phase) // 2
    kept = np.arange(len(phase)) % per_layer != np.flatnonzero(phase)[0]
    return points, cells[kept], phase[kept]


def twice_the_particle(points, cells, phase):
    copies = cells[phase == 1] + len(points)
    return np.tile(points, (2, 1)), np.vstack([cells, copies]), np.append(phase, [1] * len(copies))


def cut_out(points, cells, phase):
    return np.tile(points, (2, 1)), cells + len(points) * phase[:, None], phase


def dented(points, cells, phase):
    inner = np.flatnonzero(abs(points[cells[:, 6], :2]).max(axis=1) < 0.9)[0]
    points[cells[inner, 6], 0] *= -1.0
    return points, cells, phase


ON_LEVELS = [6, 7, 9, 12, 13, 14]
"""Middles of the edges of a prism's triangles."""


def bulged(points, cells, phase):
    """The middles of two opposite sides lie off them, alike at all levels."""
    middles = np.unique(cells[:, ON_LEVELS])
    off = middles[abs(abs(points[middles, 0]) - 1) < 1e-9]
    points[off, 0] += 3e-7
    return points, cells, phase


def with_middles_of_its_own(points, cells, phase):
    cells = cells.copy()
    cells[np.ix_(phase == 1, ON_LEVELS)] += len(points)
    return np.tile(points, (2, 1)), cells, phase


def with_one_middle_too_few(points, cells, phase):
    cells = cells.copy()
    cells[:, 7] = cells[:, 6]
    cells[:, 13] = cells[:, 12]
    return points, cells, phase


def begun_late(points, cells, phase):
    return points, cells, phase * (np.arange(len(phase)) >= len(phase) // 2)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lifted, "does not stand on one level"),
        (narrowed, r"the prisms fill .* %|not the parallelogram of the vectors"),
        (laid_down, r"does not stand on one level .* along θ, the third coordinate"),
        (with_a_hole, r"the prisms fill 9\d\.\d+% .* give holes a phase of their own"),
        (twice_the_particle, r"the prisms fill 112\.\d+% .* occ.fragment"),
        (cut_out, "has a prism on one side alone: a slit; .* Coherence"),
        (dented, "is folded; move corners .*Mesh.HighOrderOptimize"),
        (bulged, r"middle node at \(.*, on the level|middle node at \(.* of the cell is off it"),
        (with_middles_of_its_own, r"an edge has two middle nodes, at \(.* remove duplicate nodes"),
        (with_one_middle_too_few, "one middle node|two middle nodes|columns of prisms"),
        (begun_late, "is matrix in a layer of θ and inclusion in the next; .* two meshes"),
    ],
)
def test_prisms_that_are_no_cell_are_refused(tmp_path, change, message):
    grid = extrude(size=0.6, radius=0.4, layers=2)
    points = grid.positions(HermiteMap(0.4, 0, 0.4, 0)).copy()
    changed = change(points, grid.cells, grid.phase)
    write(tmp_path / "bad.msh", *changed, grid.names)
    with pytest.raises(FailedError, match=message):
        grid_of(tmp_path / "bad.msh")


@pytest.mark.parametrize("version", [2.2, 4.1])
def test_a_periodic_mesh_that_gmsh_scaled_is_solved_as_it_was(tmp_path, gmsh, version):
    gmsh.open(str(MESHES / "two-particles.msh"))
    gmsh.option.setNumber("Mesh.MshFileVersion", version)
    gmsh.option.setNumber("Mesh.ScalingFactor", 0.5)
    gmsh.write(str(tmp_path / "half.msh"))
    phases = {"matrix": SOFT, "particles": HARD}
    [half] = MeshModel(tmp_path / "half.msh").solve(TruncatedNormal(-1.5, 1.5), phases)
    whole = solve("two-particles.msh", **phases)
    np.testing.assert_allclose(half.stiffness, whole.stiffness, rtol=1e-7, atol=1)


@pytest.mark.parametrize(
    "content",
    [
        "// a script\nPoint(1) = {0, 0, 0};\n",
        "\n$MeshFormat\n",
        "$MeshFormatted\n",
        "",
        "$Comments\nPoint(1) = {0, 0, 0};\n",
    ],
)
def test_gmsh_is_handed_nothing_but_meshes(tmp_path, monkeypatch, content):
    """A file that is no mesh is a script to Gmsh, whatever its name: it never gets there."""
    import gmsh

    for name in ("open", "merge"):
        monkeypatch.setattr(gmsh, name, lambda *_: pytest.fail("Gmsh was handed a script"))
    for name in ("cell.msh", "cell.geo", "cell"):
        path = tmp_path / name
        path.write_text(content)
        with refuses("mesh.file"):
            grid_of(path)


def test_gmsh_is_handed_the_mesh_alone(tmp_path):
    """Comments before the mesh are read over; options beside it stay unread."""
    mesh = (MESHES / "paper-coarse.msh").read_bytes()
    path = tmp_path / "my cell.msh"
    path.write_bytes(b"$Comments\nmade by hand\n$EndComments\n" + mesh)
    made = tmp_path / "made"
    (tmp_path / "my cell.msh.opt").write_text(f'SystemCall "touch {made}";\n')
    grid = grid_of(path)
    assert grid.names == grid_of(MESHES / "paper-coarse.msh").names
    assert not made.exists()


@pytest.mark.parametrize(
    ("comment", "match"),
    [
        ("lengths along x in um\nlengths along y in mm", "um and mm"),
        ("x in cm; y in units of 5 cm", "of lengths in cm and 5 cm"),
        ("A slab. All of x, y, z in mm", "of z in mm"),
        ("x, y in mm; cell of 20 mm with fibres of 5 um; z is theta", ""),
    ],
)
def test_comments_that_contradict_the_mesh_are_refused(tmp_path, comment, match):
    path = tmp_path / "cell.msh"
    mesh = (MESHES / "paper-coarse.msh").read_bytes()
    path.write_bytes(f"$Comments\n{comment}\n$EndComments\n".encode() + mesh)
    if not match:
        assert grid_of(path).names == grid_of(MESHES / "paper-coarse.msh").names
        return
    with pytest.raises(RefusedError, match=match):
        grid_of(path)


@pytest.mark.parametrize("name", ["paper-coarse.msh", "ring.msh"])
@pytest.mark.parametrize(("version", "is_binary"), [(2.2, 0), (2.2, 1), (4.1, 0), (4.1, 1)])
def test_each_version_of_msh_is_read_as_gmsh_reads_it(tmp_path, gmsh, name, version, is_binary):
    gmsh.merge(str(MESHES / name))
    gmsh.option.setNumber("Mesh.MshFileVersion", version)
    gmsh.option.setNumber("Mesh.Binary", is_binary)
    gmsh.write(str(tmp_path / "cell.msh"))
    tags, points, _ = gmsh.model.mesh.getNodes()
    place = dict(zip(tags.tolist(), points.reshape(-1, 3), strict=True))
    grid = grid_of(tmp_path / "cell.msh")
    count = 0
    for _, group in gmsh.model.getPhysicalGroups(3):
        label = gmsh.model.getPhysicalName(3, group)
        own = grid.fixed[grid.cells[grid.phase == grid.names.index(label)]]
        tree = KDTree(own.mean(axis=1))
        for volume in gmsh.model.getEntitiesForPhysicalGroup(3, group):
            _, _, nodes = gmsh.model.mesh.getElements(3, volume)
            expected = np.array([place[tag] for tag in nodes[0].tolist()]).reshape(-1, 15, 3)
            for prism, nearest in zip(expected, tree.query(expected.mean(axis=1))[1], strict=True):
                assert KDTree(own[nearest]).query(prism)[0].max() < 1e-13
            count += len(expected)
    assert count == len(grid.cells)


TEXT = """$MeshFormat
4.1 0 8
$EndMeshFormat
$Entities
0 0 0 1
1 0 0 0 1 1 1 1 1 0
$EndEntities
$Nodes
1 1 1 1
3 1 0 1
1
0 0 0
$EndNodes
$Elements
1 1 1 1
3 1 15 1
1 1
$EndElements
"""


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("4.1 0 8", "text"),
        ("4.1 0 8\n", ""),
        ("4.1 0 8", "4.1 1 8"),
        ("0 0 0\n$End", "0 0 \0\n$End"),
        ("$EndNodes", ""),
        ("1 1 1 1\n3 1 0 1", "1 1 1 1\n3 1 0 999999999"),
        ("1 1 1 1\n3 1 0 1", "1 1 1 1\n3 1 0 -1"),
        ("3 1 15 1", "3 1 77 1"),
        ("1 1\n$EndE", "1 9\n$EndE"),
        ("0 0 0\n$End", "0 0 nan\n$End"),
        ("$EndElements", ""),
        ("$Nodes", "$Knots"),
    ],
)
def test_a_damaged_mesh_is_one_line(tmp_path, old, new):
    assert old in TEXT
    (tmp_path / "cell.msh").write_text(TEXT.replace(old, new, 1))
    with pytest.raises((RefusedError, FailedError)) as caught:
        grid_of(tmp_path / "cell.msh")
    assert "\n" not in str(caught.value)


def test_a_file_that_is_none_is_refused(tmp_path):
    (tmp_path / "no.msh").write_text("nothing")
    for path in (tmp_path / "no.msh", tmp_path / "absent.msh"):
        with pytest.raises((RefusedError, FailedError)):
            MeshModel(path).solve(LAW, {"matrix": SOFT})


CORNERS = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (0, 1, 1)]
EDGES = [(0, 1), (0, 2), (0, 3), (1, 2), (1, 4), (2, 5), (3, 4), (3, 5), (4, 5)]


def test_prisms_of_any_orientation_are_set_upright(tmp_path):
    grid = extrude(size=0.7, radius=0.4, layers=2)
    points = grid.positions(HermiteMap(0.4, 0, 0.4, 0))
    corners = np.array(CORNERS, float)
    nodes = np.vstack([corners, corners[EDGES].mean(axis=1)])
    falling = nodes * [1, 1, -1] + [0, 0, 1]
    moduli = []
    for k, images in enumerate((nodes, falling, nodes[:, [1, 0, 2]], falling[:, [1, 0, 2]])):
        order = [int(np.argmin(np.abs(nodes - image).sum(axis=1))) for image in images]
        write(tmp_path / f"{k}.msh", points, grid.cells[:, order], grid.phase, grid.names)
        [result] = MeshModel(tmp_path / f"{k}.msh").solve(LAW, {"matrix": SOFT, "inclusion": HARD})
        moduli.append(result.modulus)
    assert moduli[1:] == pytest.approx(moduli[:1] * 3, rel=1e-9)


@pytest.fixture(scope="module")
def made_again(tmp_path_factory):
    """Folder of the scripts beside the meshes, with what they make."""
    folder = tmp_path_factory.mktemp("meshes")
    scripts = [Path(shutil.copy(file, folder)) for file in MESHES.glob("*.py")]
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        patch.syspath_prepend(folder)
        for script in scripts:
            patch.delitem(sys.modules, script.stem, raising=False)
        for script in scripts:
            runpy.run_path(str(script), run_name="__main__")
    return folder


@pytest.mark.parametrize("script", ["two_particles", "ring", "unlike_sides", "paper_coarse"])
def test_each_file_is_made_again_by_its_script(made_again, script):
    name = f"{script.replace('_', '-')}.msh"
    if script == "unlike_sides":
        with pytest.raises(FailedError):
            grid_of(made_again / name)
        return
    made, stored = grid_of(made_again / name), grid_of(MESHES / name)
    assert made.names == stored.names
    assert len(made.cells) == len(stored.cells)  # by place, as Gmsh 4.15 numbers nodes otherwise
    for found, expected in ((made, stored), (stored, made)):
        distance, nearest = KDTree(centres(expected)).query(centres(found))
        assert distance.max() < 1e-9
        assert (expected.phase[nearest] == found.phase).all()
        assert KDTree(expected.fixed).query(found.fixed)[0].max() < 1e-9


def centres(grid):
    return grid.fixed[grid.cells].mean(axis=1)


def test_refine_is_a_bool():
    with refuses("refine"):
        MeshModel("own.msh", refine="no")


def test_complete_quadratic_prisms_of_gmsh_are_refused_with_its_own_option(tmp_path, gmsh):
    base = gmsh.model.occ.addRectangle(-1, -1, 0, 2, 2)
    made = gmsh.model.occ.extrude([(2, base)], 0, 0, 1, numElements=[1], recombine=True)
    gmsh.model.occ.synchronize()
    gmsh.model.addPhysicalGroup(3, [tag for dim, tag in made if dim == 3], name="matrix")
    gmsh.option.setNumber("Mesh.ElementOrder", 2)
    gmsh.option.setNumber("Mesh.MeshSizeMin", 1)
    gmsh.model.mesh.generate(3)
    gmsh.write(str(tmp_path / "cell.msh"))
    with pytest.raises(FailedError, match=r"Prism 18.*SecondOrderIncomplete = 1"):
        grid_of(tmp_path / "cell.msh")
