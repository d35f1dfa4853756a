"""Task of one map with several moduli; mesh, matrices, preconditioner are shared."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from time import perf_counter

import numpy as np

from alphacut.rve.cell import Phase
from alphacut.rve.petsc import PETSc
from alphacut.rve.prism.system import PrismSystem
from alphacut.rve.solver.krylov import LinearSolver
from alphacut.rve.solver.operators import Saddle, SideBySide
from alphacut.rve.solver.options import SolverOptions
from alphacut.rve.solver.theta_preconditioner import ThetaPreconditioner
from alphacut.stochastic.theta.truncated_normal import Array

CONTRAST_GRID = 1.25
NO_LOAD = 1e-12  # relative size of a load that is nothing but round-off
STAGES = ("mesh", "assemble", "setup", "solve", "total", "jit")


class Stopwatch:
    """Adds up wall time by stage."""

    def __init__(self) -> None:
        self.seconds = dict.fromkeys(STAGES, 0.0)

    @contextmanager
    def __call__(self, stage: str) -> Iterator[None]:
        """Add the time of the block to `stage`."""
        started = perf_counter()
        try:
            yield
        finally:
            self.seconds[stage] = self.seconds.get(stage, 0.0) + perf_counter() - started

    def shift(self, source: str, target: str, seconds: float) -> None:
        """Book `seconds` under another stage."""
        self.seconds[source] -= seconds
        self.seconds[target] += seconds

    def report(self) -> dict[str, float]:
        """Seconds by stage, just-in-time compilation left out."""
        self.seconds["total"] = sum(self.seconds[s] for s in ("mesh", "assemble", "setup", "solve"))
        report, self.seconds = self.seconds, dict.fromkeys(STAGES, 0.0)
        return report


@dataclass(frozen=True)
class Displacements:
    """Solution of the cell for all loads.

    Args:
        total: Displacements of the nodes, ε̄x and fluctuation, shape (nodes, 2, loads); those
            of this rank.
        affine: ε̄x alone, same shape.
        iterations: Of the linear solver, for each load.
        residual: Largest relative residual.
        pressure: Mean pressure of nearly incompressible triangles, shape (levels, triangles,
            loads), in Pa, tension positive.
    """

    total: Array
    affine: Array
    iterations: tuple[int, ...]
    residual: float
    pressure: Array | None = None


@dataclass(eq=False)
class PrismTask:
    """Reduced matrices and loads of one map, K = E_m K_m + E_i K_i.

    Args:
        system: Mesh and forms, already moved to the map.
        options: Linear solver.
        strains: Macroscopic strains (ε11, ε22, 2 ε12), shape (loads, 3).
        watch: Takes the times.
        units: Whether matrices for unit moduli are kept, for `fluctuations`; they take most of the
            memory.
    """

    system: PrismSystem
    options: SolverOptions
    strains: Array
    watch: Stopwatch
    units: bool = False

    def __post_init__(self) -> None:
        self.affine = self.system.affine(self.strains)
        self.assembled: tuple[Phase, Phase] | None = None
        self.poissons: tuple[float, float] | None = None
        self.whole: PETSc.Mat | None = None

    def solve(self, phases: tuple[Phase, Phase]) -> Displacements:
        """Solution for a matrix and an inclusion; earlier work serves again where it can.

        Raises:
            ConvergenceError: The linear solver stopped early.
        """
        with self.watch("assemble"):
            self._assemble(phases)
        with self.watch("setup"):
            solver = self._solver(phases)
        with self.watch("solve"):
            return self._solve_loads(solver, phases)

    def fluctuations(self, samples: Sequence[tuple[Phase, Phase]]) -> tuple[Array, tuple[int, ...]]:
        """Solutions of samples of one map side by side, shape (size, samples · loads).

        Raises:
            ConvergenceError: The linear solver stopped early.
        """
        with self.watch("assemble"):
            self._assemble(samples[0])
        with self.watch("setup"):
            matrices = [self._stiffness(phases) for phases in samples]
            loads = [load for phases in samples for load in self._forces(phases)]
            operator = SideBySide(matrices, len(self.strains))
            together = LinearSolver(
                operator, self.options.loose, self._theta(samples[0]), together=len(loads)
            )
        with self.watch("solve"):
            solved = together.solve(loads, measured=False)  # the basis measures its own
        return solved.values, solved.iterations

    def preconditioned(self, residual: Array, phases: tuple[Phase, Phase]) -> Array:
        """Preconditioner times vectors of the reduced system, shape (size, k)."""
        return self._theta(phases).solve(residual)

    def _stiffness(self, phases: tuple[Phase, Phase]) -> PETSc.Mat:
        return self._combined(self.matrices[0].copy(), self.matrices[1], phases)

    def _forces(self, phases: tuple[Phase, Phase]) -> list[PETSc.Vec]:
        return [
            self._combined(soft.copy(), hard, phases)
            for soft, hard in zip(*self.loads, strict=True)
        ]

    def _assemble(self, phases: tuple[Phase, Phase]) -> None:
        system, poissons = self.system, (phases[0].poisson, phases[1].poisson)
        if poissons != self.poissons:
            self.theta: tuple[int, ThetaPreconditioner] | None = None
        elif self.whole is None or phases == self.assembled:
            return
        self.poissons, self.assembled = poissons, phases
        system.set_poisson(phases)
        self.whole = None if self.units or system.mixed else system.stiffness_of(phases)
        self.matrices = [] if self.whole else [system.stiffness(k) for k in range(2)]
        self.loads = [[system.load(k, strain) for strain in self.strains] for k in range(2)]

    @staticmethod
    def _combined(
        soft: PETSc.Object, hard: PETSc.Object, phases: tuple[Phase, Phase]
    ) -> PETSc.Object:
        """`soft` turned into E_m soft + E_i hard; matrices of one pattern, or vectors."""
        soft.scale(phases[0].modulus)
        structure = (
            (PETSc.Mat.Structure.SAME_NONZERO_PATTERN,) if isinstance(soft, PETSc.Mat) else ()
        )
        soft.axpy(phases[1].modulus, hard, *structure)
        return soft

    def _solver(self, phases: tuple[Phase, Phase]) -> LinearSolver:
        operator = self.whole or self._stiffness(phases)
        if self.options.all["pc_type"] == "python":
            whole = operator if self.system.mixed is None else self._saddle(operator, phases)
            options = self.options if self.system.mixed is None else self.options.indefinite
            return LinearSolver(whole, options, self._theta(phases), together=len(self.strains))
        if self.system.mixed is not None:
            return LinearSolver(self._saddle(operator, phases), self.options, None)
        operator = operator.convert("aij", PETSc.Mat())  # PETSc's own preconditioners want it
        operator.setOption(PETSc.Mat.Option.SPD, True)
        return LinearSolver(operator, self.options, None)

    def _saddle(self, operator: PETSc.Mat, phases: tuple[Phase, Phase]) -> Saddle:
        """Stiffness and mean pressures, these in units of the matrix's modulus."""
        mixed, unit = self.system.mixed, phases[0].modulus
        assert mixed is not None
        compliance, overlap = unit**2 * mixed.compliance(phases), self.system.overlap
        return Saddle(operator, unit * mixed.flux, compliance, overlap, mixed.pressures)

    def _solve_loads(self, solver: LinearSolver, phases: tuple[Phase, Phase]) -> Displacements:
        size = max(phases[k].modulus * load.norm() for k in range(2) for load in self.loads[k])
        loads = self._forces(phases)
        mixed, unit = self.system.mixed, phases[0].modulus
        if mixed is not None and solver.saddle is not None:
            uniform = mixed.uniform_pressure(phases).reshape(-1, 3) @ self.strains.T
            forces = mixed.pressure_loads.reshape(-1, 3) @ self.strains.T
            forces = unit * (forces + mixed.compliance(phases) @ uniform)
            given = mixed.pressures.give(np.asarray(forces), len(loads))
            pairs = zip(loads, given.T, strict=True)
            loads = [solver.saddle.vector(load, force) for load, force in pairs]
        # equal phases: the affine field is the solution
        elif all(load.norm() <= NO_LOAD * size for load in loads):
            return Displacements(self.affine, self.affine, (0,) * len(loads), 0.0)
        solutions = solver.solve(loads)
        fluctuation = self.system.at_nodes(solutions.values)
        pressure = None
        if mixed is not None and solutions.pressures is not None:
            pressure = unit * mixed.pressures.fetch(solutions.pressures) + uniform
            pressure = pressure.reshape(-1, mixed.count, len(loads))
        return Displacements(
            self.affine + fluctuation,
            self.affine,
            solutions.iterations,
            solutions.residual,
            pressure,
        )

    def _theta(self, phases: tuple[Phase, Phase]) -> ThetaPreconditioner:
        """Preconditioner of a contrast on a grid, independent of the other samples.

        Raises:
            RuntimeError: A level of some rank has no factors.
        """
        step = round(np.log(phases[1].modulus / phases[0].modulus) / np.log(CONTRAST_GRID))
        if self.theta is None or self.theta[0] != step:
            near = replace(phases[1], modulus=phases[0].modulus * CONTRAST_GRID**step)
            with self.system.ranks.together():
                self.theta = step, self.system.preconditioner((phases[0], near))
        assert self.theta is not None
        return self.theta[1]
