"""Which solver for one shape: error of the stiffness over processor time, for every way to it.

    ./enter python -m benchmarks.rve.one_shape

A disc of radius 1/2 in a square cell [−1, 1]², the same at all θ, contrast 4. The error of a way is
the largest relative one of C11 + C12, C11 − C12 and C33, against the series; of bounds it is that
of the worse bound, and of pixels it includes that of the staircase. Processor time is the median of
five calls where one takes less than 5 s, without imports, compilation and Gmsh, and with grids set
up anew. A line ends before a call that would pass the cap. Each way has a process of its own, and
memory is by how much that grew.

Plain DOLFINx is what its users write for this plane problem: quadratic triangles with curved sides,
periodic partners eliminated, MUMPS or conjugate gradients with GAMG.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from importlib import import_module
from importlib.util import find_spec
from multiprocessing import get_context
from pathlib import Path
from statistics import median
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp

from alphacut.base.arrays import Array
from alphacut.rve.cell.cell import Phase
from alphacut.rve.fenicsx import MPI, PETSc, aij, fem, petsc, ufl
from alphacut.rve.image.model import solve_image
from alphacut.rve.image.phases import PhaseModuli
from alphacut.rve.mesh.square import open_gmsh
from alphacut.rve.prism import model as prism
from alphacut.rve.prism import own_mesh
from alphacut.rve.prism.model import PrismModel
from alphacut.rve.prism.own_mesh import LevelSetModel, MeshModel
from alphacut.rve.result.moduli import square_moduli
from alphacut.rve.series.circles import CIRCLES
from alphacut.rve.series.model import SeriesModel
from alphacut.rve.slices.model import SlicesModel
from alphacut.stochastic import HermiteMap
from benchmarks.rows import write
from benchmarks.rve import fft

RESULTS = Path(__file__).parents[1] / "results"
RADIUS = 0.5
DISC = HermiteMap(RADIUS, 0.0, RADIUS, 0.0)
MATRIX, PARTICLE = Phase(20e9), Phase(80e9)
NAMED = {"matrix": MATRIX, "inclusion": PARTICLE}
QUICK = 5.0  # seconds of a call that is repeated
REPEATS = 5
LONGEST = 6.0  # seconds, about, of the last call of a line
SOLVERS: dict[str, dict[str, str]] = {
    "MUMPS": {"ksp_type": "preonly", "pc_type": "cholesky", "pc_factor_mat_solver_type": "mumps"},
    "GAMG": {"ksp_type": "cg", "ksp_rtol": "1e-8", "pc_type": "gamg"},
}


class Found(NamedTuple):
    """What a way gives: one stiffness in Pa or the two that bound it, (3, 3) each, and unknowns."""

    stiffness: Sequence[Array]
    unknowns: int


Way = Callable[[], Found]


@dataclass(frozen=True)
class Point:
    """One point of the chart.

    Args:
        way: Name of the line.
        setting: Its resolution, in words.
        error: Largest relative error of C11 + C12, C11 − C12 and C33.
        seconds: Processor time.
        unknowns: Of one linear system.
        megabytes: By which the process grew at most.
    """

    way: str
    setting: str
    error: float
    seconds: float
    unknowns: int
    megabytes: float


def of_model(model: PrismModel | SlicesModel) -> Way:
    """Return a call of a model of round particles."""

    def call() -> Found:
        """Return its stiffness, with grids and problems set up anew."""
        prism.cached_grid.cache_clear()
        prism.cached_problem.cache_clear()
        [result] = model.solve(DISC, MATRIX, [PARTICLE])
        moduli = result.moduli
        return Found([of_moduli(*moduli)], result.unknowns)

    return call


def of_moduli(total: float, difference: float, shear: float) -> Array:
    """Return the stiffness with C11 + C12, C11 − C12 and C33."""
    axial = (total + difference) / 2
    lateral = (total - difference) / 2
    return np.array([[axial, lateral, 0.0], [lateral, axial, 0.0], [0.0, 0.0, shear]])


def of_series(terms: int) -> Way:
    """Return a call of the multipole series with some terms, of which a model takes enough."""

    def call() -> Found:
        """Return the stiffness; three moduli at one radius."""
        moduli = CIRCLES.solve(np.array([RADIUS]), (MATRIX, PARTICLE), terms)
        return Found([of_moduli(*moduli.ravel())], terms)

    return call


def of_level_set(size: float) -> Way:
    """Return a call of prisms that ignore the interface, with the particle by its sign (eq. 13)."""
    model = LevelSetModel(lambda x, y, theta: np.hypot(x, y) - RADIUS + 0 * theta, size, 1)

    def call() -> Found:
        """Return the stiffness."""
        prism.cached_grid.cache_clear()
        prism.cached_problem.cache_clear()
        [result] = model.solve(DISC.distribution, NAMED)
        return Found([np.asarray(result.stiffness)], result.unknowns)

    return call


def of_mesh(path: Path) -> Way:
    """Return a call of the bounds of a mesh from a file."""
    model = MeshModel(path)

    def call() -> Found:
        """Return both bounds of the stiffness, with the file read anew."""
        own_mesh._mesh_problem.cache_clear()
        bounds = model.bounds(DISC.distribution, NAMED)
        problem = model.moved_problem(DISC.distribution)
        return Found([bounds.lower, bounds.upper], problem.numbering.size)

    return call


def pixels(size: int) -> tuple[Array, Array]:
    """Return K + G/3 and G of the pixels of the disc in Pa, shape (size, size) each."""
    places = (np.arange(size) + 0.5) / size * 2 - 1
    inside = np.hypot(places, places[:, np.newaxis]) < RADIUS
    outer, inner = [PhaseModuli.of_young(phase.modulus, phase.poisson) for phase in NAMED.values()]
    return np.where(inside, inner.bulk, outer.bulk), np.where(inside, inner.shear, outer.shear)


def of_image(size: int) -> Way:
    """Return a call of the bounds of an image."""

    def call() -> Found:
        """Return both bounds of the stiffness."""
        bounds = solve_image(*pixels(size)).bounds
        return Found([bounds.lower, bounds.upper], 2 * size**2)

    return call


def of_fft(size: int) -> Way:
    """Return a call of the short FFT solver on an image."""
    return lambda: Found([fft.stiffness(*pixels(size))], 2 * size**2)


def write_mesh(path: Path, size: float) -> tuple[Any, Any]:
    """Write six-node triangles of the cell, opposite sides alike, with two groups of surfaces.

    Returns:
        DOLFINx's mesh of the same triangles, and the tags of its cells.
    """
    io: Any = import_module(f"dolfinx.io.gmsh{'' if find_spec('dolfinx.io.gmsh') else 'io'}")
    with open_gmsh() as gmsh:
        occ = gmsh.model.occ
        plate = occ.addRectangle(-1, -1, 0, 2, 2)
        disc = occ.addDisk(0, 0, 0, RADIUS, RADIUS)
        occ.fragment([(2, plate)], [(2, disc)])
        occ.synchronize()
        others = [tag for _, tag in gmsh.model.getEntities(2) if tag != disc]
        gmsh.model.addPhysicalGroup(2, others, 1, name="matrix")
        gmsh.model.addPhysicalGroup(2, [disc], 2, name="inclusion")
        for axis in range(2):
            sides = []
            for end in (-1.0, 1.0):
                low, high = [-1.001, -1.001, -1.0], [1.001, 1.001, 1.0]
                low[axis], high[axis] = end - 1e-3, end + 1e-3
                sides.append(
                    [tag for _, tag in gmsh.model.getEntitiesInBoundingBox(*low, *high, 1)]
                )
            shift = np.eye(4)
            shift[axis, 3] = 2
            gmsh.model.mesh.setPeriodic(1, sides[1], sides[0], shift.ravel().tolist())
        gmsh.option.setNumber("Mesh.MeshSizeMax", size)
        gmsh.option.setNumber("Mesh.ElementOrder", 2)
        gmsh.model.mesh.generate(2)
        gmsh.write(str(path))
        mesh, tags = io.model_to_mesh(gmsh.model, MPI.COMM_SELF, 0, gdim=2)[:2]
    return mesh, tags


def of_dolfinx(mesh: tuple[Any, Any], options: Mapping[str, str]) -> Way:
    """Return a call of plain DOLFINx on a mesh with tags."""
    return lambda: plane_stiffness(*mesh, options)


def plane_stiffness(mesh: Any, tags: Any, options: Mapping[str, str]) -> Found:
    """Return the effective stiffness of a plane periodic cell with tags 1 and 2 of its phases.

    Args:
        mesh: DOLFINx's mesh of triangles in [−1, 1]².
        tags: Tags of its cells.
        options: Of PETSc's solver.
    """
    space = fem.functionspace(mesh, ("Lagrange", 2, (2,)))
    constants = fem.functionspace(mesh, ("DG", 0, (3, 3)))
    stiffness = fem.Function(constants)
    values = stiffness.x.array.reshape(-1, 9)
    for tag, phase in ((1, MATRIX), (2, PARTICLE)):
        values[tags.find(tag)] = phase.stiffness.ravel()
    u, v = ufl.TrialFunction(space), ufl.TestFunction(space)
    dx = ufl.dx(domain=mesh, metadata={"quadrature_degree": 6})

    def strain(w: Any) -> Any:
        """Return (ε11, ε22, 2 ε12) of displacements."""
        g = ufl.grad(w)
        return ufl.as_vector([g[0, 0], g[1, 1], g[0, 1] + g[1, 0]])

    matrix = petsc.assemble_matrix(fem.form(ufl.inner(stiffness * strain(u), strain(v)) * dx))
    matrix.assemble()
    nodes = space.tabulate_dof_coordinates()[:, :2]
    # Partners on opposite sides have one place on the torus; the first place is held at zero.
    places = np.rint(np.mod(nodes + 1, 2 - 1e-9) * 1e7).astype(int)
    _, number = np.unique(places, axis=0, return_inverse=True)
    columns = (2 * number.ravel()[:, np.newaxis] + [0, 1]).ravel() - 2
    rows = np.flatnonzero(columns >= 0)
    size = int(columns.max()) + 1
    ones = np.ones(len(rows))
    reduce = sp.csr_matrix((ones, (rows, columns[rows])), (len(columns), size))
    indptr, indices, data = matrix.getValuesCSR()
    full = sp.csr_matrix((data, indices, indptr))
    reduced = aij((reduce.T @ full @ reduce).tocsr().sorted_indices())
    reduced.setOption(PETSc.Mat.Option.SPD, True)
    reduced.setBlockSize(2)
    translations = [reduced.createVecRight() for _ in range(2)]
    for component, vector in enumerate(translations):
        vector.array[component::2] = 1.0
        vector.normalize()
    reduced.setNearNullSpace(PETSc.NullSpace().create(vectors=translations, comm=MPI.COMM_SELF))
    database = PETSc.Options("plain_")
    for name, value in options.items():
        database[name] = value
    ksp = PETSc.KSP().create(MPI.COMM_SELF)
    ksp.setOptionsPrefix("plain_")
    ksp.setOperators(reduced)
    ksp.setFromOptions()
    found = np.empty((3, 3))
    for load in range(3):
        mean = fem.Constant(mesh, np.eye(3)[load])
        forces = fem.assemble_vector(fem.form(-ufl.inner(stiffness * mean, strain(v)) * dx)).array
        x, b = reduced.createVecs()
        b.array[:] = reduce.T @ forces
        ksp.solve(b, x)
        assert ksp.getConvergedReason() > 0
        w = fem.Function(space)
        w.x.array[:] = reduce @ x.array
        stress = stiffness * (mean + strain(w))
        for row in range(3):
            found[row, load] = fem.assemble_scalar(fem.form(stress[row] * dx)) / 4
    return Found([found], size)


def ways(folder: Path) -> dict[str, list[tuple[str, Way]]]:
    """Return all lines, each from coarse to fine; meshes are written into a folder."""
    lines: dict[str, list[tuple[str, Way]]] = {
        "series": [(f"{n} terms", of_series(n)) for n in (1, 2, 3)],
        "slices, order 4": [
            (f"h {h:g}", of_model(SlicesModel(h, 2))) for h in (0.6, 0.4, 0.25, 0.15)
        ],
        "prisms": [
            (f"h {h:g}", of_model(PrismModel(h, 1, stiffness=True, estimate=False)))
            for h in (0.5, 0.25, 0.12, 0.06, 0.03, 0.02)
        ],
    }
    meshes = {
        size: write_mesh(folder / f"{size}.msh", size) for size in (0.4, 0.2, 0.1, 0.05, 0.033)
    }
    lines["own mesh, worse bound"] = [(f"h {h:g}", of_mesh(folder / f"{h}.msh")) for h in meshes]
    for name, options in SOLVERS.items():
        lines[f"plain DOLFINx, {name}"] = [
            (f"h {h:g}", of_dolfinx(mesh, options)) for h, mesh in meshes.items()
        ]
    lines["level set"] = [(f"h {h:g}", of_level_set(h)) for h in (0.5, 0.25, 0.12, 0.06, 0.03)]
    lines["image, worse bound"] = [(f"{n}² pixels", of_image(n)) for n in (64, 128, 256, 512)]
    lines["short FFT solver"] = [(f"{n}² pixels", of_fft(n)) for n in (64, 128, 256, 512)]
    return lines


def points(way: str, longest: float) -> list[Point]:
    """Return and print all points of a way.

    Its line ends before a call that would take longer than `longest` seconds.
    """
    found = []
    [exact] = SeriesModel(points=2, accuracy=1e-12).solve(DISC, MATRIX, [PARTICLE])
    right = exact.moduli
    with tempfile.TemporaryDirectory() as folder:
        settings = ways(Path(folder))[way]
        settings[0][1]()  # compiles
        for setting, call in settings:
            solved, cost = fft.measured(call)
            errors = [abs(square_moduli(C) / right - 1).max() for C in solved.stiffness]
            repeats = REPEATS - 1 if cost.seconds < QUICK else 0
            again = [fft.measured(call)[1].seconds for _ in range(repeats)]
            seconds = median([cost.seconds, *again])
            error = max(*errors, 1e-15)
            found.append(Point(way, setting, error, seconds, solved.unknowns, cost.megabytes))
            print(
                f"{way:24} {setting:16} error {error:8.1e} {seconds:8.3f} s"
                f" {solved.unknowns:8} unknowns {cost.megabytes:6.0f} MB",
                flush=True,
            )
            if 4 * seconds > longest:
                break
    return found


def draw(found: Sequence[Point], stem: Path) -> None:
    """Draw error over time, a line for each way, with unknowns and memory at its ends."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(10, 6.5), layout="constrained")
    for number, way in enumerate(dict.fromkeys(point.way for point in found)):
        own = [point for point in found if point.way == way]
        seconds = [point.seconds for point in own]
        is_ours = not way.startswith(("plain", "short"))
        axes.loglog(
            seconds,
            [point.error for point in own],
            "o-" if is_ours else "s--",
            color=f"C{number}",
            label=way,
            ms=4,
        )
        last = own[-1]
        text = f"{last.unknowns:,} unknowns, {last.megabytes:.0f} MB"
        axes.annotate(
            text,
            (last.seconds, last.error),
            (5, 4 if number % 2 else -10),
            textcoords="offset points",
            fontsize=7.5,
            color=f"C{number}",
        )
    axes.set_xlim(right=8 * max(point.seconds for point in found))
    axes.set(
        xlabel="processor time in s",
        ylabel="largest relative error of C11 + C12, C11 − C12, C33",
        title="One disc, the same at all θ: error over time; size and memory of last points",
    )
    axes.grid(alpha=0.25)
    axes.legend(frameon=False, loc="lower right")
    for suffix in (".svg", ".png"):
        figure.savefig(stem.with_suffix(suffix), dpi=150)
    plt.close(figure)


def main(arguments: Sequence[str] | None = None) -> int:
    """Make the table and the chart."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--longest", type=float, default=LONGEST, help="seconds of a call")
    parser.add_argument("--only", nargs="*", default=(), help="ways to run")
    parser.add_argument("--out", type=Path, default=RESULTS)
    options = parser.parse_args(arguments)
    started = perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        names = options.only or list(ways(Path(folder)))
    found: list[Point] = []
    for way in names:
        with ProcessPoolExecutor(1, get_context("spawn")) as apart:
            found += apart.submit(points, way, options.longest).result()
    options.out.mkdir(parents=True, exist_ok=True)
    write([asdict(point) for point in found], options.out / "one_shape.csv")
    draw(found, options.out / "one_shape")
    print(f"made in {perf_counter() - started:.0f} s, in {options.out}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
