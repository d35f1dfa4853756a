"""Random meshes of one's own: bounds from both sides, as they are and refined.

    ./enter python -m benchmarks.rve.mesh_bounds --meshes 20

Each cell has one to four particles, half of the cells round ones and the other half polygons with
corners, in one or two layers of prisms that bend along θ. Phases are crisp, contrasts 0.01 to 100.
Three solutions, on the mesh and with each prism split into 8 and 64, are extrapolated by Aitken.
Printed are the relative distance of the bounds, its ratio at the refinement, whether the
extrapolated stiffness lies inside both pairs in three loads, and the largest work of the stresses
in random displacements of slices, by a quadrature of its own, over that of their magnitudes. Exit
status 1 if a value lies outside, a distance does not fall, or stresses are not in equilibrium to
rounding.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from time import process_time

import numpy as np

from alphacut.base.arrays import Array
from alphacut.rve import MeshModel, Phase
from alphacut.rve.fenicsx import basix
from alphacut.rve.image.bounds import StiffnessBounds
from alphacut.rve.mesh.file import refined, write
from alphacut.rve.mesh.prism_grid import PrismGrid
from alphacut.rve.mesh.square import open_gmsh
from alphacut.rve.prism.stress_functions import solved_fields_of_bounds
from alphacut.rve.prism.theta_means import planar_slopes
from alphacut.rve.solver.krylov import SolverOptions
from alphacut.stochastic import TruncatedNormal
from benchmarks import rows

RESULTS = Path(__file__).parents[1] / "results"
LAW = TruncatedNormal(-3.0, 3.0)
LOADS = np.array([[1.0, 1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 0.0, 1.0]])
ROUNDING = 1e-11


@dataclass(frozen=True)
class Row:
    """One mesh.

    Args:
        particles: Their number.
        corners: Whether they have corners.
        layers: Layers of prisms.
        prisms: Number of prisms of the mesh as it is.
        contrast: Modulus of the particles over that of the matrix.
        width: Relative distance of the bounds of the mesh as it is.
        seconds: Processor time of these bounds.
        ratio: This distance over that of the refined mesh.
        refined_seconds: Processor time of the bounds of the refined mesh.
        inside: Whether the extrapolated stiffness lies inside both pairs of bounds.
        work: Work of the stresses in random displacements over that of their magnitudes.
    """

    particles: int
    corners: bool
    layers: int
    prisms: int
    contrast: float
    width: float
    seconds: float
    ratio: float
    refined_seconds: float
    inside: bool
    work: float

    @property
    def holds(self) -> bool:
        """Whether nothing contradicts the claims."""
        return self.inside and self.ratio > 1 and self.work < ROUNDING


def random_discs(rng: np.random.Generator, count: int) -> Array:
    """Return centres and radii (x, y, r) of discs apart in [−1, 1]², shape (count, 3)."""
    discs: list[Array] = []
    while len(discs) < count:
        disc = np.append(rng.uniform(-0.75, 0.75, 2), rng.uniform(0.15, 0.6 / count**0.5))
        inside = abs(disc[:2]).max() + disc[2] < 0.9
        apart = all(np.hypot(*(disc - other)[:2]) > disc[2] + other[2] + 0.1 for other in discs)
        if inside and apart:
            discs.append(disc)
    return np.array(discs)


def write_mesh(
    path: Path, rng: np.random.Generator, discs: Array, *, corners: bool, layers: int
) -> None:
    """Write prisms around particles in a square, which bend along θ within the square.

    Args:
        path: The file.
        rng: Generator of corners and bends.
        discs: Discs (x, y, r), or the circles that the corners of polygons lie on.
        corners: Whether particles are polygons with 3 to 6 corners.
        layers: Layers of prisms.
    """
    with open_gmsh() as gmsh:
        occ = gmsh.model.occ
        square = occ.addRectangle(-1, -1, -3, 2, 2)
        particles = []
        for x, y, radius in discs:
            if not corners:
                particles.append(occ.addDisk(x, y, -3, radius, radius))
                continue
            count = rng.integers(3, 7)
            angles = 2 * np.pi * (np.arange(count) + rng.uniform(-0.2, 0.2, count)) / count
            places = [(x + radius * np.cos(a), y + radius * np.sin(a)) for a in angles]
            points = [occ.addPoint(*place, -3) for place in places]
            lines = [occ.addLine(points[k - 1], points[k]) for k in range(count)]
            particles.append(occ.addPlaneSurface([occ.addCurveLoop(lines)]))
        tools = [(2, particle) for particle in particles]
        occ.fragment([(2, square)], tools)
        matrix = [tag for _, tag in occ.getEntities(2) if tag not in particles]
        occ.synchronize()
        for axis in (0, 1):
            sides = []
            for end in (-1.0, 1.0):
                low = np.array([-1.01, -1.01, -3.1])
                high = np.array([1.01, 1.01, -2.9])
                low[axis] = end - 0.01
                high[axis] = end + 0.01
                sides.append([tag for _, tag in occ.getEntitiesInBoundingBox(*low, *high, 1)])
            shift = np.eye(4)
            shift[axis, 3] = 2
            gmsh.model.mesh.setPeriodic(1, sides[1], sides[0], shift.ravel().tolist())
        made = occ.extrude([(2, tag) for tag in matrix + particles], 0, 0, 6, [layers], [], True)
        occ.synchronize()
        volumes = [tag for dimension, tag in made if dimension == 3]
        gmsh.model.addPhysicalGroup(3, volumes[: len(matrix)], name="matrix")
        gmsh.model.addPhysicalGroup(3, volumes[len(matrix) :], name="particles")
        gmsh.option.setNumber("Mesh.MeshSizeMax", 0.4)
        gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", 8)
        gmsh.option.setNumber("Mesh.ElementOrder", 2)
        gmsh.option.setNumber("Mesh.SecondOrderIncomplete", 1)
        gmsh.model.mesh.generate(3)
        gmsh.write(str(path))
    bend(path, rng)


def bend(path: Path, rng: np.random.Generator) -> None:
    """Move the nodes of a mesh in a square along x1 and x2, zero on its sides, by θ."""
    grid = MeshModel(path).cached_problem().grid
    assert grid.fixed is not None
    points = grid.fixed.copy()
    x, y, theta = points.T
    bubble = np.cos(np.pi * x / 2) ** 2 * np.cos(np.pi * y / 2) ** 2
    for axis in (0, 1):
        points[:, axis] += 0.1 * bubble * np.sin(rng.uniform(0.2, 0.4) * theta + rng.uniform(0, 6))
    write_grid(path, replace(grid, fixed=points))


def write_grid(path: Path, grid: PrismGrid) -> None:
    """Write the prisms of a file, moved or refined, into a file."""
    assert grid.fixed is not None
    write(path, grid.fixed, grid.cells, grid.phase, grid.names)


def extrapolated(values: Array) -> Array:
    """Return Aitken's limits of three values with rising resolution, shape (3, …)."""
    first, second, third = values
    return np.asarray(third - (second - third) ** 2 / ((first - second) - (second - third)))


def energies(stiffness: Array) -> Array:
    """Return the energies of the three loads, shape (3,)."""
    return np.asarray(np.einsum("ki,ij,kj->k", LOADS, stiffness, LOADS))


def holds(bounds: StiffnessBounds, value: Array) -> bool:
    """Whether energies of the loads lie inside bounds."""
    return bool((energies(bounds.lower) <= value).all() and (value <= energies(bounds.upper)).all())


def work_of_stresses(model: MeshModel, phases: dict[str, Phase], rng: np.random.Generator) -> float:
    """Return the largest work in random displacements over that of magnitudes, at a random θ.

    The quadrature has another degree than that of the bounds, and inverts J by itself.
    """
    problem = model.moved_problem(LAW)
    named = model.named_phases(problem, phases)
    stiffness = [phase.stiffness for phase in named.values()]
    fields = solved_fields_of_bounds(
        problem, stiffness, rotation_factor=1 / stiffness[0][2, 2], options=SolverOptions()
    )
    vector = problem.matrix.createVecRight()
    vector.array[:] = rng.normal(size=vector.local_size)
    random = problem.elimination.displacements(vector)[problem.space.dofmap.list]
    z = float(rng.random())
    triangle, weights = basix.make_quadrature(basix.CellType.triangle, 9)
    slopes = planar_slopes(np.column_stack([triangle, np.full(len(weights), z)]))
    layer = int(rng.integers(problem.grid.layers))
    chosen = problem.layer == layer
    jacobian = np.einsum("apn,cni->cpai", slopes, fields.nodes[chosen])
    inverse = np.linalg.inv(jacobian)
    potential = np.einsum("cpja,apn,cnil->cpijl", inverse, slopes, fields.potential[chosen])
    stress = np.stack([potential[..., 1, :], -potential[..., 0, :]], axis=3)
    s11, s22, s12 = fields.mean_stress_at(z)[layer]
    stress += np.array([[s11, s12], [s12, s22]])
    gradient = np.einsum("cpja,apn,cni->cpij", inverse, slopes, random[chosen])
    areas = weights * np.linalg.det(jacobian)
    work = np.einsum("cp,cpijl,cpij->l", areas, stress, gradient)
    scale = np.einsum("cp,cpijl,cpij->l", areas, abs(stress), abs(gradient))
    return float((abs(work) / scale).max())


def judged(number: int, seed: int, folder: Path) -> Row:
    """Return the row of a mesh by its number."""
    rng = np.random.default_rng([seed, number])
    discs = random_discs(rng, int(rng.integers(1, 5)))
    corners = number % 2 == 1
    layers = int(rng.integers(1, 3))
    path = folder / f"{number}.msh"
    write_mesh(path, rng, discs, corners=corners, layers=layers)
    contrast = float(10 ** rng.uniform(-2, 2))
    ratios = rng.uniform(0, 0.4, 2)
    phases = {
        "matrix": Phase(20e9, float(ratios[0])),
        "particles": Phase(20e9 * contrast, float(ratios[1])),
    }
    model = MeshModel(path)
    grid = model.cached_problem().grid
    finer = folder / f"{number}-finer.msh"
    write_grid(finer, refined(grid))
    models = model, replace(model, refine=True), MeshModel(finer, refine=True)
    solutions = [np.array(one.solve(LAW, phases)[0].stiffness, float) for one in models]
    limit = extrapolated(np.array([energies(stiffness) for stiffness in solutions]))
    timed = []
    for one in models[:2]:
        started = process_time()
        timed.append((one.bounds(LAW, phases), process_time() - started))
    (coarse, seconds), (fine, refined_seconds) = timed
    return Row(
        particles=len(discs),
        corners=corners,
        layers=layers,
        prisms=len(grid.cells),
        contrast=contrast,
        width=coarse.width,
        seconds=seconds,
        ratio=coarse.width / fine.width,
        refined_seconds=refined_seconds,
        inside=holds(coarse, limit) and holds(fine, limit),
        work=work_of_stresses(model, phases, rng),
    )


def table(count: int, seed: int) -> Iterator[Row]:
    """Yield the rows of all meshes."""
    with tempfile.TemporaryDirectory() as folder:
        for number in range(count):
            yield judged(number, seed, Path(folder))


def draw(found: Sequence[Row], path: Path) -> None:
    """Draw the distance of the bounds over time, a line from each mesh to its refined one."""
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(figsize=(7.5, 4.5), layout="constrained")
    for row in found:
        label = "particles with corners" if row.corners else "round particles"
        axes.loglog(
            (row.seconds, row.refined_seconds),
            (row.width, row.width / row.ratio),
            "o-",
            color="C1" if row.corners else "C0",
            label=label,
            ms=4,
            alpha=0.7,
        )
    handles = dict(zip(*reversed(axes.get_legend_handles_labels()), strict=True))
    axes.legend(handles.values(), handles.keys(), frameon=False)
    axes.set(
        xlabel="processor time of both bounds in s",
        ylabel="relative distance of the bounds",
        title=f"{len(found)} random meshes of one's own, as they are and refined once",
    )
    axes.grid(alpha=0.25)
    figure.savefig(path, dpi=150)


def main(arguments: Sequence[str] | None = None) -> int:
    """Print and write the table; exit 1 where a row does not hold."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--meshes", type=int, default=20)
    parser.add_argument(
        "--seed", type=int, default=int(np.random.SeedSequence().generate_state(1)[0])
    )
    parser.add_argument("--out", type=Path, default=RESULTS)
    options = parser.parse_args(arguments)
    print(f"seed {options.seed}")
    found = []
    for row in table(options.meshes, options.seed):
        found.append(row)
        shape = "corners" if row.corners else "round"
        print(
            f"{row.particles} {shape:7} {row.layers} layers {row.prisms:5} prisms"
            f" contrast {row.contrast:8.3g} width {row.width:.1e} ratio {row.ratio:5.1f}"
            f" inside {row.inside} work {row.work:.0e}",
            flush=True,
        )
    rows.write(
        [{"seed": options.seed, **asdict(row)} for row in found], options.out / "mesh_bounds.csv"
    )
    draw(found, options.out / "mesh_bounds.png")
    for corners in (False, True):
        own = [row.ratio for row in found if row.corners == corners]
        if own:
            name = "corners" if corners else "round"
            print(f"{name}: ratio {min(own):.2f} to {max(own):.2f}, median {np.median(own):.2f}")
    return int(not all(row.holds for row in found))


if __name__ == "__main__":
    sys.exit(main())
