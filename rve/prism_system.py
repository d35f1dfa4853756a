"""One product-space system: its mesh, constraints, matrices, and the solves for several inclusions."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from time import perf_counter

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from rve.cell import LOADS, Phase
from rve.level_blocks import LevelBlocks
from rve.linear_solver import LinearSolver, Preconditioner
from rve.periodic import identify
from rve.prism_form import PrismForm
from rve.prism_grid import PrismGrid
from rve.reduction import LevelNumbering
from rve.result import Homogenised, StressCurve
from rve.slice_stress import SliceStress
from rve.solver_options import describe
from rve.theta_preconditioner import ThetaPreconditioner
from stochastic import RadiusMap, layered_rule
from stochastic.truncated_normal import Array

NO_LOAD = 1e-12  # relative size of a load that is nothing but round-off
STAGES = ("mesh", "assemble", "setup", "solve", "total", "jit")


class Stopwatch:
    """Wall time by stage."""

    def __init__(self) -> None:
        self.seconds = dict.fromkeys(STAGES, 0.0)

    @contextmanager
    def __call__(self, stage: str) -> Iterator[None]:
        """Add the time of the block to `stage`."""
        started = perf_counter()
        try:
            yield
        finally:
            self.seconds[stage] += perf_counter() - started

    def shift(self, source: str, target: str, seconds: float) -> None:
        """Book `seconds` under another stage."""
        self.seconds[source] -= seconds
        self.seconds[target] += seconds

    def report(self) -> dict[str, float]:
        """Seconds by stage; the total leaves just-in-time compilation out. What is shared is booked once, to the first to ask."""
        self.seconds["total"] = sum(self.seconds[s] for s in ("mesh", "assemble", "setup", "solve"))
        report, self.seconds = self.seconds, dict.fromkeys(STAGES, 0.0)
        return report


class PrismSystem:
    """The product-space system of one grid; positions and materials are set anew for each map.

    Args:
        grid: Topology.
        comm: Communicator.
    """

    def __init__(self, grid: PrismGrid, comm: MPI.Comm) -> None:
        self.grid, self.comm = grid, comm
        self.form = PrismForm(grid, comm)
        self.numbering = LevelNumbering(grid, identify(grid.plane))
        self.nodes = self.form.node_of_dof()
        self.local_map = self.numbering.local_map(self.nodes, comm)
        self.pattern = self.numbering.matrix(self.local_map, comm)
        self._jit = self.form.jit_seconds

    def take_jit_seconds(self) -> float:
        """Seconds of just-in-time compilation, reported once."""
        seconds, self._jit = self._jit, 0.0
        return seconds

    def move(self, radius_map: RadiusMap) -> None:
        """Move the nodes to the cone of a map and mark the particle at the quadrature points."""
        self.map = radius_map
        self.positions = self.form.place(radius_map)
        self.share = self._share()
        if not self.grid.conforming:
            self.form.mark(self.share)

    def _share(self) -> Array:
        """Share of the particle, shape (cells, 1) on a conforming mesh, else (cells, points) from the sign of z (eq. 13)."""
        if self.grid.conforming:
            return np.tile(self.grid.plane.inside, self.grid.layers)[:, None].astype(float)
        x = np.einsum("qn,cnd->cqd", self.form.shapes, self.positions[self.grid.cells])
        return (np.hypot(x[..., 0], x[..., 1]) < self.map(x[..., 2])).astype(float)  # z < 0 in eq. 14

    def homogenise(
        self, matrix: Phase, inclusions: Sequence[Phase], *, options: Mapping[str, str], watch: Stopwatch, name: str, loads: Array = LOADS
    ) -> list[Homogenised]:
        """Solve for every inclusion in turn; K = E_m K_m + E_i K_i is assembled once for each Poisson's ratio."""
        results: list[Homogenised] = []
        assembled: tuple[float, _Assembled] | None = None
        for inclusion in inclusions:
            if assembled is None or assembled[0] != inclusion.poisson:
                with watch("assemble"):
                    assembled = inclusion.poisson, _Assembled(self, (matrix, inclusion), loads, name)
            displacement, iterations = assembled[1].solve(matrix, inclusion, options, watch)
            with watch("solve"):
                curve = self.curve(displacement, (matrix, inclusion))
            results.append(
                Homogenised(
                    curve=curve,
                    method="prism",
                    solver=describe(name, options),
                    unknowns=self.numbering.size,
                    iterations=iterations,
                    seconds=watch.report(),
                )
            )
        return results

    def curve(self, displacement: Array, phases: tuple[Phase, Phase]) -> StressCurve:
        """Homogenised stress at the Gauss points of the layers from total displacements, shape (nodes, 2, loads)."""
        slices = SliceStress(self.grid, self.positions, self.form.points, self.form.weights)
        share = self.share[:, :, None, None]
        stiffness = (1 - share) * phases[0].stiffness + share * phases[1].stiffness
        mean = np.concatenate([layer.mean for layer in slices.layers(displacement, stiffness)])
        rule = layered_rule(self.map.distribution, layers=self.grid.layers, points=slices.slices)
        return StressCurve(rule.nodes, rule.weights / rule.weights.sum(), mean[:, 0, 0], mean[:, 2, 1])

    def affine(self, loads: Array) -> Array:
        """Displacements ε̄·x of the nodes, shape (nodes, 2, loads)."""
        x = self.positions[:, :2]
        tensors = np.array([[[e[0], e[2] / 2], [e[2] / 2, e[1]]] for e in loads])
        return np.einsum("lij,nj->nil", tensors, x)

    def preconditioner(self, phases: tuple[Phase, Phase]) -> ThetaPreconditioner:
        """The θ-preconditioner for these phases."""
        planes = self.grid.planes(self.map)
        levels = self.grid.levels(self.map.distribution)
        stiffness = tuple(
            self._plane_stiffness(xy, t, phases) for xy, t in zip(planes, (levels, (levels[1:] + levels[:-1]) / 2), strict=True)
        )
        return ThetaPreconditioner(self.numbering, planes, (stiffness[0], stiffness[1]), self.map.distribution, self.comm)

    def _plane_stiffness(self, plane: Array, theta: Array, phases: tuple[Phase, Phase]) -> Array:
        """Voigt stiffness of each triangle at each θ, shape (θ, m, 3, 3); by the triangle's centre where the mesh does not conform."""
        inside = np.broadcast_to(self.grid.plane.inside, (len(theta), len(self.grid.plane.triangles)))
        if not self.grid.conforming:
            centre = plane[:, self.grid.plane.triangles[:, :3]].mean(axis=2)
            inside = np.linalg.norm(centre, axis=-1) < self.map(theta)[:, None]
        return np.where(inside[..., None, None], phases[1].stiffness, phases[0].stiffness)


class _Assembled:
    """Reduced matrices and loads of one map for one pair of Poisson's ratios, for unit Young's moduli."""

    def __init__(self, system: PrismSystem, phases: tuple[Phase, Phase], loads: Array, name: str) -> None:
        self.system, self.name, self.affine = system, name, system.affine(loads)
        system.form.set_poisson(phases)
        self.matrices = [self._matrix(k) for k in range(2)]
        self.loads = [[system.numbering.vector(system.local_map, system.form.load(k, e), system.comm) for e in loads] for k in range(2)]
        self.theta: tuple[float, ThetaPreconditioner] | None = None

    def _matrix(self, phase: int) -> PETSc.Mat:
        matrix = self.system.pattern.duplicate(copy=False)
        matrix.setLGMap(self.system.local_map, self.system.local_map)
        self.system.form.add_stiffness(phase, matrix)
        matrix.assemble()
        return matrix

    def solve(self, matrix: Phase, inclusion: Phase, options: Mapping[str, str], watch: Stopwatch) -> tuple[Array, tuple[int, ...]]:
        """Total displacements of the nodes, shape (nodes, 2, loads), and iterations for each load."""
        with watch("setup"):
            operator = self.matrices[0].copy()
            operator.scale(matrix.modulus)
            operator.axpy(inclusion.modulus, self.matrices[1], PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
            solver = LinearSolver(operator, options, self._context(operator, matrix, inclusion, options))
        total, iterations = self.affine.copy(), []
        with watch("solve"):
            for n, (soft, hard) in enumerate(zip(*self.loads, strict=True)):
                size = matrix.modulus * soft.norm() + inclusion.modulus * hard.norm()
                load = soft.copy()
                load.scale(matrix.modulus)
                load.axpy(inclusion.modulus, hard)
                if load.norm() <= NO_LOAD * size:  # equal phases: the affine field is the solution
                    iterations.append(0)
                    continue
                solution, count = solver.solve(load)
                total[:, :, n] += self.system.numbering.to_nodes(solution)
                iterations.append(count)
        return total, tuple(iterations)

    def _context(self, operator: PETSc.Mat, matrix: Phase, inclusion: Phase, options: Mapping[str, str]) -> Preconditioner | None:
        if options["pc_type"] != "python":
            return None
        return LevelBlocks(self.system.numbering, operator) if self.name == "blocks" else self._theta(matrix, inclusion)

    def _theta(self, matrix: Phase, inclusion: Phase) -> ThetaPreconditioner:
        """Made once and kept while the contrast stays within a factor 1.25."""
        contrast = inclusion.modulus / matrix.modulus
        if self.theta is None or not 0.8 <= contrast / self.theta[0] <= 1.25:
            self.theta = contrast, self.system.preconditioner((matrix, inclusion))
        return self.theta[1]
