"""Product-space model: finite elements on cell × θ (sections 3.1, 4.2, 4.3).

This differs from the paper in: 1. The interface is a set of curved element faces, not the sign of z
at quadrature points (`interface="sign"` is the paper's eq. 13). 2. The fluctuation is fixed on the
whole line of one periodic corner over θ.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import lru_cache
from time import perf_counter
from typing import ClassVar

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.refused import RefusedError
from alphacut.rve.cell import LOADS, THREE_LOADS, AnyPhase, Cell, Phase
from alphacut.rve.certificate import ROUND_OFF, WHAT, Limits, certify, require
from alphacut.rve.fenicsx import MPI
from alphacut.rve.mesh.outline import Outline, circle, is_round
from alphacut.rve.mesh.prism_grid import PrismGrid
from alphacut.rve.mesh.triangulation import reference_radius, triangulate
from alphacut.rve.prism.error_estimate import judged
from alphacut.rve.prism.modulus_basis import TOLERANCE, ModulusBasis, modulus_basis
from alphacut.rve.prism.problem import PrismProblem, SliceStrains
from alphacut.rve.result import Homogenised, StressCurve
from alphacut.rve.settings import require_compressible, require_mesh_size, require_parts
from alphacut.rve.solver.krylov import Solutions
from alphacut.rve.solver.options import SolverOptions
from alphacut.stochastic import RadiusMap

INTERFACES = ("conforming", "sign")
STAGES = ("mesh", "assemble", "setup", "solve")


@dataclass(frozen=True)
class PrismModel:
    """Product-space finite elements: quadratic serendipity wedges around the cone.

    Args:
        mesh_size: Edge length of the triangles, in halves of the cell's side, in (0, 1].
        layers: Layers in θ, at least 1 (paper: 12).
        interface: "conforming", or "sign" for a mesh that ignores the interface (first order in h,
            too stiff: for comparison).
        solver: Name in `rve.solver.options.SOLVERS`.
        petsc: PETSc options without their prefix `rve_`; they override the solver's own.
        parallel: Whether all MPI ranks work on one cell together; if not each works on its own.
        stiffness: Whether to solve a third load, for the whole planar stiffness.
        estimate: Whether to declare the errors, measured against the series, or the slices where
            that has no formula.
        moduli: Least and greatest modulus of the particle, in Pa, between which every sample of a
            map is projected on two solutions; None: each is solved.
        outline: Distance of the particle's edge from its centre over r(θ), a function of the angle.

    Raises:
        RefusedError: An option out of range or unknown.
    """

    mesh_size: float = 0.15
    layers: int = 12
    interface: str = "conforming"
    solver: str = "theta"
    petsc: Mapping[str, str] = field(default_factory=dict)
    parallel: bool = False
    stiffness: bool = False
    estimate: bool = True
    moduli: tuple[float, float] | None = None
    outline: Outline = circle
    name: ClassVar[str] = "prism"

    def __post_init__(self) -> None:
        require_mesh_size(self.mesh_size)
        if self.layers < 1:
            raise RefusedError("the number of layers", self.layers, "1 or more")
        if self.interface not in INTERFACES:
            raise RefusedError("the interface", repr(self.interface), ", ".join(INTERFACES))
        SolverOptions(self.solver)

    def solve(
        self, radius_map: RadiusMap, matrix: AnyPhase, inclusions: Sequence[AnyPhase]
    ) -> list[Homogenised]:
        """One result for each of `inclusions`, in their order, on one mesh.

        Raises:
            ConvergenceError: The linear solver stopped early.
            CertificateError: A property that every right result has is violated.
            FoldedMeshError: The map bends more than the layers can follow.
            RefusedError: A Poisson's ratio is above 0.45, or a radius does not fit.
        """
        require_parts(radius_map, matrix, inclusions, isotropic=False)
        require_compressible(matrix, *inclusions)
        watch = Stopwatch()
        with watch("mesh"):
            problem = self.problem(radius_map)
        bases: dict[float, ModulusBasis | None] = {}
        results = []
        for inclusion in inclusions:
            result = None
            if isinstance(matrix, Phase) and isinstance(inclusion, Phase) and self._projects:
                ratio = inclusion.poisson
                if ratio not in bases:
                    bases[ratio] = self._basis(problem, matrix, ratio, watch)
                result = self._projected(problem, bases[ratio], (matrix, inclusion), watch)
            result = result or self._solved(problem, (matrix, inclusion), watch)
            results.append(replace(result, seconds=watch.report()))
        return results

    def problem(self, radius_map: RadiusMap) -> PrismProblem:
        """The mesh and the form, moved to a map; kept for the next map.

        Raises:
            FoldedMeshError: The map bends more than the layers can follow.
            RefusedError: A radius does not fit into the cell.
        """
        radius = reference_radius(radius_map, self.outline)
        conforming = self.interface == "conforming"
        problem = _problem(
            self.mesh_size, radius if conforming else 0.0, self.outline, self.layers, self.parallel
        )
        problem.move(radius_map)
        return problem

    @property
    def options(self) -> SolverOptions:
        """The linear solver with what overrides it."""
        return SolverOptions(self.solver, self.petsc)

    def loads(self, matrix: AnyPhase, inclusion: AnyPhase) -> Array:
        """Macroscopic strains (ε11, ε22, 2 ε12), shape (loads, 3) (eq. 15).

        Two tell all moduli of a cell with the symmetry of the square, of others three.
        """
        round_ = is_round(self.outline)
        square = round_ and isinstance(matrix, Phase) and isinstance(inclusion, Phase)
        return LOADS if square and not self.stiffness else THREE_LOADS

    @property
    def _projects(self) -> bool:
        """True where samples are projected: ordinary solver and mesh, and a range of moduli."""
        ordinary = self.options == SolverOptions() and self.interface == "conforming"
        return ordinary and self.moduli is not None and self.moduli[1] > self.moduli[0]

    def _basis(
        self, problem: PrismProblem, matrix: Phase, poisson: float, watch: Stopwatch
    ) -> ModulusBasis | None:
        """Solutions to project on, or None where two of them do not carry the others."""
        assert self.moduli is not None
        with watch("solve"):
            loads = self.loads(matrix, Phase(self.moduli[0], poisson))
            basis = modulus_basis(problem, matrix, poisson, self.moduli, loads)
        return basis if basis.error <= TOLERANCE else None

    def _projected(
        self,
        problem: PrismProblem,
        basis: ModulusBasis | None,
        phases: tuple[Phase, Phase],
        watch: Stopwatch,
    ) -> Homogenised | None:
        low, high = self.moduli or (0.0, np.inf)
        modulus = phases[1].modulus
        if not low * (1 - ROUND_OFF) <= modulus <= high * (1 + ROUND_OFF):
            value, allowed = f"{modulus:g} Pa", f"values in [{low:g}, {high:g}] Pa"
            raise RefusedError("modulus of the particle", value, allowed, "widen `moduli`")
        if basis is None:
            return None
        with watch("solve"):
            strains = basis.project(modulus)
        result = self._result(problem, strains, phases, basis.error, watch)
        reason = "projected on solutions at two moduli of the particle"
        return replace(result, iterations=basis.iterations, reason=reason)

    def _solved(
        self, problem: PrismProblem, phases: tuple[AnyPhase, AnyPhase], watch: Stopwatch
    ) -> Homogenised:
        stiffness = (phases[0].stiffness, phases[1].stiffness)
        with watch("assemble"):
            problem.assemble(stiffness)
            strained = self.loads(*phases)
            loads = problem.loads(strained)
        if np.array_equal(*stiffness):  # the affine field is the solution
            solved = Solutions([load.duplicate() for load in loads], (0,) * len(loads), 0.0)
        else:
            with watch("setup"):
                solver = problem.solver(self.options)
            with watch("solve"):
                solved = solver.solve(loads)
        with watch("solve"):
            fluctuations = [problem.field(vector) for vector in solved.vectors]
            strains = problem.slice_strains(list(zip(strained, fluctuations, strict=True)))
        result = self._result(problem, strains, phases, solved.residual, watch)
        return replace(result, iterations=solved.iterations)

    def _result(
        self,
        problem: PrismProblem,
        strains: SliceStrains,
        phases: tuple[AnyPhase, AnyPhase],
        residual: float,
        watch: Stopwatch,
    ) -> Homogenised:
        """The result with its certificate and its declared errors."""
        pair = (phases[0].stiffness, phases[1].stiffness)
        stress, loads = strains.stress(pair), self.loads(*phases)
        whole = stress @ np.linalg.inv(loads).T if len(loads) == 3 else None
        curve = StressCurve(strains.theta, strains.weights, stress[:, 0, 0], stress[:, 2, 1], whole)
        outline = None if is_round(self.outline) else self.outline
        result = Homogenised(
            curve=curve,
            method=self.name,
            solver=str(self.options),
            unknowns=problem.numbering.size,
            cell=Cell(*phases, problem.map, outline),
        )
        if self.estimate:
            with watch("estimate"):
                result = judged(result)
        allowed = 2 * result.largest_error if result.errors else self._roughly
        limits = Limits(self.options.residual_limit, ROUND_OFF + allowed)
        share = strains.fraction, strains.weights
        checks = certify(stress, strains.energy(pair), loads, share, phases)
        checks["residual"] = residual
        ordered = {name: checks[name] for name in WHAT if name in checks}
        return replace(result, checks=require(ordered, limits))

    @property
    def _roughly(self) -> float:
        """Most that a mesh adds to the stiffness, where no error is declared."""
        return 0.1 * self.mesh_size ** (3 if self.interface == "conforming" else 1)


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

    def report(self) -> dict[str, float]:
        """Seconds by stage since the last report, their total without the estimate's."""
        seconds, self.seconds = self.seconds, dict.fromkeys(STAGES, 0.0)
        return {**seconds, "total": sum(seconds[stage] for stage in STAGES)}


@lru_cache(maxsize=2)
def _problem(
    size: float, radius: float, outline: Outline, layers: int, parallel: bool
) -> PrismProblem:
    """Mesh, form and numbering: they do not depend on the map, only on these."""
    plane = triangulate(size=size, radius=radius, outline=outline)
    comm = MPI.COMM_WORLD if parallel else MPI.COMM_SELF
    return PrismProblem(PrismGrid(plane, layers, radius > 0), comm)
