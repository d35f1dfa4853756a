"""Product-space model: finite elements on cell × θ (sections 3.1, 4.2, 4.3).

This differs from the paper in: 1. The interface is a set of curved element faces, not the sign of z
at quadrature points (`interface="sign"` is the paper's eq. 13). 2. The fluctuation is fixed on the
whole line of one periodic corner over θ.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial
from importlib import import_module
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from mpi4py import MPI

from alphacut.rve.cell import LOADS, THREE_LOADS, Cell, Phase
from alphacut.rve.certificate import (
    ROUND_OFF,
    WHAT,
    CertificateError,
    Limits,
    load_checks,
    require,
    stiffness_checks,
)
from alphacut.rve.mesh.periodicity import mismatch
from alphacut.rve.mesh.prism_grid import PrismGrid
from alphacut.rve.mesh.triangulation import Triangulation, reference_radius, triangulate
from alphacut.rve.petsc import clean, give_back
from alphacut.rve.prism.error_estimate import judged, mean_moduli, reference_range
from alphacut.rve.prism.mixed_element import NEARLY_INCOMPRESSIBLE
from alphacut.rve.prism.modulus_basis import BasisError, ModulusBasis
from alphacut.rve.prism.system import PrismSystem, SliceMeans
from alphacut.rve.prism.task import Displacements, PrismTask, Stopwatch
from alphacut.rve.ranks import ALONE, Ranks
from alphacut.rve.result import Homogenised, StressCurve
from alphacut.rve.settings import require_mesh_size
from alphacut.rve.solver.krylov import ConvergenceError
from alphacut.rve.solver.options import SolverOptions
from alphacut.rve.table.build import first_cells, keep
from alphacut.stochastic import RadiusMap
from alphacut.stochastic.theta.truncated_normal import Array

INTERFACES = ("conforming", "sign")
_LOCKING = 0.45  # Poisson's ratio above which quadratic elements lock
_GAIN = 7.0  # by which twice the layers lessen their error, at the least, less one


@dataclass(frozen=True)
class PrismModel:
    """Product-space finite elements: quadratic serendipity wedges around the cone.

    Args:
        mesh_size: Edge length of the triangles, in halves of the cell's side, in (0, 1].
        layers: Layers in θ, at least 1 (paper: 12).
        interface: "conforming", or "sign" for a mesh that ignores the interface (first order in h,
            too stiff: for comparison).
        solver: Name in `rve.solver_options.SOLVERS`.
        petsc: PETSc options without their prefix `rve_`; they override the solver's own.
        parallel: Whether all MPI ranks work on one cell together; if not each works on its own.
        stiffness: Whether to solve a third load, for the whole planar stiffness.
        estimate: Whether to declare the errors, measured against planar elements of order 4; costs
            seconds, and a companion of a coarser mesh besides.
        moduli: Least and greatest modulus of the particle, in Pa, between which every sample of a
            map is projected on a few solutions; None: each is solved.
        cache: Folder where meshes and the tables that errors are measured against are kept; None
            keeps them in the process.

    Raises:
        ValueError: An option out of range or unknown.
    """

    mesh_size: float = 0.15
    layers: int = 12
    interface: str = "conforming"
    solver: str = "theta"
    petsc: Mapping[str, str] = field(default_factory=dict)
    parallel: bool = False
    stiffness: bool = False
    estimate: bool = False
    moduli: tuple[float, float] | None = None
    cache: Path | None = None
    name: ClassVar[str] = "prism"

    def __post_init__(self) -> None:
        require_mesh_size(self.mesh_size)
        if self.layers < 1:
            raise ValueError(f"the number of layers is {self.layers}; at least 1 is needed")
        if self.interface not in INTERFACES:
            raise ValueError(
                f"the interface is {self.interface!r}; known are {', '.join(INTERFACES)}"
            )
        SolverOptions(self.solver)

    def solve(
        self, radius_map: RadiusMap, matrix: Phase, inclusions: Sequence[Phase]
    ) -> list[Homogenised]:
        """One result for each of `inclusions`, in their order; one mesh and assembly.

        Raises:
            ConvergenceError: The linear solver that was asked for stopped early; the default gives
                way to a direct one.
            CertificateError: A property that every right result has is violated.
            FoldedMeshError: The map bends more than the layers can follow.
        """
        results = self._results(radius_map, matrix, inclusions)
        clean(self._ranks.comm)
        return self._judged(radius_map, matrix, inclusions, results) if self.estimate else results

    def _results(
        self, radius_map: RadiusMap, matrix: Phase, inclusions: Sequence[Phase]
    ) -> list[Homogenised]:
        """The results without declared errors; matrices and factors do not outlive them."""
        watch = Stopwatch()
        system = self._moved(radius_map, watch)
        task = PrismTask(system, self.options, self._loads, watch, self.moduli is not None)
        bases: dict[float, ModulusBasis | None] = {}
        results = []
        for inclusion in inclusions:
            if inclusion.poisson not in bases:
                bases[inclusion.poisson] = self._basis(task, (matrix, inclusion))
            basis = bases[inclusion.poisson]
            result = (
                self._solved(task, (matrix, inclusion))[0]
                if basis is None
                else self._projected(basis, (matrix, inclusion))
            )
            results.append(replace(result, seconds=watch.report()))
        return results

    def _judged(
        self,
        radius_map: RadiusMap,
        matrix: Phase,
        inclusions: Sequence[Phase],
        results: list[Homogenised],
    ) -> list[Homogenised]:
        """The results with their declared errors, whose cost is booked as `estimate`."""
        watch = Stopwatch()
        with watch("estimate"):
            coarser = self.coarser(radius_map, matrix, inclusions)
            found = [
                self._with_errors(one, radius_map, (matrix, phase), means)
                for one, phase, means in zip(results, inclusions, coarser, strict=True)
            ]
        seconds = watch.seconds["estimate"] / len(results)
        for result in found:
            # once for the moduli and once for the bounds, averaged over the same nodes
            allowed = ROUND_OFF + 2 * result.largest_error
            require(result.checks, Limits(discretisation=allowed))
        return [replace(r, seconds={**r.seconds, "estimate": seconds}) for r in found]

    def _with_errors(
        self, result: Homogenised, radius_map: RadiusMap, phases: tuple[Phase, Phase], means: Array
    ) -> Homogenised:
        """The result against a reference as accurate as its means and `coarser` ones ask for."""
        coarse, thick = means
        layers = error_of_layers(coarse, thick)
        change = np.nan_to_num(abs(coarse / mean_moduli(result.curve) - 1)).max()
        ratio = self._rough / self.mesh_size
        gain = np.clip(0.75 / self.mesh_size, 4, 15) ** np.log2(ratio)
        if self.interface != "conforming":
            gain = max(ratio - 1, 1.0)  # 0 on the roughest mesh
        expected = float(max(change / gain, layers.max(), 0.02 * self.mesh_size**3))
        told = partial(judged, cache=self.cache, ranks=self._ranks)
        return told(result, radius_map, phases, layers=layers, expected=expected)

    def coarser(
        self, radius_map: RadiusMap, matrix: Phase, inclusions: Sequence[Phase]
    ) -> list[Array]:
        """Mean moduli and ratio of a coarser mesh, and of half the layers on it, shape (2, 4).

        Of two ranks each solves one, and the cells that the reference begins with; nan where they
        cannot be solved.
        """
        alone = Ranks(self._ranks.comm if self._ranks.size == 2 else None)
        coarse = replace(self, estimate=False, mesh_size=self._rough)
        coarse = replace(coarse, parallel=self.parallel and alone.size == 1)
        thick = replace(coarse, layers=max(1, self.layers // 2))

        def means(model: PrismModel) -> list[Array]:  # not the results: some maps cannot be sent
            found = [mean_moduli(one.curve) for one in model.solve(radius_map, matrix, inclusions)]
            if self._ranks.rank:  # where the cells that follow stand beside what is left
                give_back()
            return found

        spans = [reference_range(radius_map, (matrix, one)) for one in inclusions]
        first = {k: v for span in spans for k, v in first_cells(span).items() if alone.size > 1}
        try:
            coarse._plane(radius_map, self._ranks)  # made by the first, kept by both
            cells: list[Callable[[], Any]] = [partial(means, coarse), partial(means, thick)]
            one, two, *rest = alone.each(lambda cell: cell(), [*cells, *first.values()])
        except RuntimeError:  # folded, or not solved: the share stays unknown, the sum does not
            return [np.full((2, 4), np.nan) for _ in inclusions]
        keep(dict(zip(first, rest, strict=True)))
        return list(map(np.stack, zip(one, two, strict=True)))

    @property
    def _rough(self) -> float:
        """Mesh size of companions that foretell errors: four times as coarse, or up to 0.4."""
        h = self.mesh_size
        return min(1.0, max(2 * h, min(4 * h, 0.4)))

    def _moved(self, radius_map: RadiusMap, watch: Stopwatch) -> PrismSystem:
        with watch("mesh"):
            plane = self._plane(radius_map, self._ranks, self.estimate)
            system = _system(plane, self.layers, self.parallel)
            system.move(radius_map)
        watch.shift("mesh", "jit", system.take_jit_seconds())
        return system

    def _plane(self, radius_map: RadiusMap, ranks: Ranks, more: bool = False) -> Triangulation:
        """Planar mesh; the first of several ranks makes it, others load Gmsh for `more` meshes."""
        radius = reference_radius(radius_map) if self.interface == "conforming" else 0.0
        load = partial(import_module, "alphacut.rve.mesh.planar") if more else None
        return _plane(self.mesh_size, radius, self.cache, ranks, load)

    @property
    def _loads(self) -> Array:
        return THREE_LOADS if self.stiffness else LOADS

    @property
    def _ranks(self) -> Ranks:
        return Ranks(MPI.COMM_WORLD) if self.parallel else ALONE

    @property
    def options(self) -> SolverOptions:
        """The linear solver with what overrides it."""
        return SolverOptions(self.solver, self.petsc)

    def _basis(self, task: PrismTask, phases: tuple[Phase, Phase]) -> ModulusBasis | None:
        """Solutions to project on, or None where every sample is solved by itself."""
        if self.moduli is None or not self._projects(phases):
            return None
        try:
            return ModulusBasis(task, phases, self.moduli)
        except (ConvergenceError, BasisError):
            return None

    def _projects(self, phases: tuple[Phase, Phase]) -> bool:
        """Whether the solver, the mesh and the phases are those that a basis is made for."""
        ordinary = self.options == SolverOptions() and self.interface == "conforming"
        near = max(phase.poisson for phase in phases) > NEARLY_INCOMPRESSIBLE
        return ordinary and not near and not self.parallel

    def _projected(self, basis: ModulusBasis, phases: tuple[Phase, Phase]) -> Homogenised:
        low, high = self.moduli or (0.0, np.inf)
        if not low * (1 - ROUND_OFF) <= phases[1].modulus <= high * (1 + ROUND_OFF):
            raise ValueError(
                f"a particle has the modulus {phases[1].modulus:g} Pa; the range given is {low:g}"
                f" to {high:g} Pa: widen it"
            )
        certificate = {"residual": basis.error, "periodicity": basis.mismatch}
        means = basis.project(phases[1].modulus)
        result = self._result(basis.task, means, phases, certificate)
        reason = f"projected on solutions at {len(basis.nodes)} moduli of the particle"
        return replace(result, iterations=basis.iterations, reason=reason)

    def _solved(
        self, task: PrismTask, phases: tuple[Phase, Phase]
    ) -> tuple[Homogenised, Displacements]:
        """A result with its certificate; by a direct solver where the default one fails."""
        try:
            return self._certified(task, phases)
        except (ConvergenceError, CertificateError) as failure:
            if self.options != SolverOptions():  # a solver that was asked for is not replaced
                raise
            direct = PrismTask(task.system, SolverOptions("mumps"), self._loads, task.watch)
            result, displacements = self._certified(direct, phases)
            why = str(failure).partition(":")[0]  # without its cure
            told = f"solved by mumps, since by the default solver {why}"
            return replace(result, reason=told), displacements

    def _certified(
        self, task: PrismTask, phases: tuple[Phase, Phase]
    ) -> tuple[Homogenised, Displacements]:
        solved, system = task.solve(phases), task.system
        with task.watch("solve"):
            means = system.means(solved.total, phases, solved.pressure)
            apart = mismatch(system.positions, solved.total - solved.affine)
            certificate = {"residual": solved.residual, "periodicity": max(system.ranks.all(apart))}
            result = self._result(task, means, phases, certificate)
            return replace(result, iterations=solved.iterations), solved

    def _result(
        self,
        task: PrismTask,
        means: SliceMeans,
        phases: tuple[Phase, Phase],
        certificate: dict[str, float],
    ) -> Homogenised:
        loads, system, stress = self._loads, task.system, means.stress
        stiffness = stress @ np.linalg.inv(loads).T if len(loads) == 3 else None
        curve = StressCurve(
            means.rule.nodes, means.rule.weights, stress[:, 0, 0], stress[:, 2, 1], stiffness
        )
        measured = certificate | certify(means, phases, loads)
        checks = {name: measured[name] for name in WHAT if name in measured}
        return Homogenised(
            curve=curve,
            method="prism",
            solver=str(task.options),
            unknowns=system.numbering.size,
            checks=require(checks, self._limits(phases)),
            cell=Cell(*phases, system.map),
        )

    def _limits(self, phases: tuple[Phase, Phase]) -> Limits:
        """Violations that the certificate allows.

        They are round-off, and for bounds the declared error (judged later) or, without one, what
        the mesh adds at most.
        """
        h, algebraic = min(self.mesh_size, 1.0), self.options.residual_limit
        if self.estimate:
            return Limits(algebraic, np.inf)
        if self.interface != "conforming":
            return Limits(algebraic, 0.1 * h)
        locks = max(phase.poisson for phase in phases) > _LOCKING
        return Limits(algebraic, 0.5 * h**2 if locks else 0.1 * h**3)


def error_of_layers(coarse: Array, thick: Array) -> Array:
    """About the relative errors that layers leave, 0 if unknown, from `PrismModel.coarser`."""
    return np.asarray(np.nan_to_num(abs(thick / coarse - 1) / _GAIN))


def certify(means: SliceMeans, phases: tuple[Phase, Phase], loads: Array) -> dict[str, float]:
    """Measures what the means of every right result have; see `rve.certificate`."""
    weights, stress, fraction = means.rule.weights, means.stress, means.fraction
    work = loads @ np.tensordot(weights, stress, axes=1)  # σ̄_b : ε̄_a
    if len(loads) == 3:
        bounds = stiffness_checks(stress @ np.linalg.inv(loads).T, fraction, weights, phases)
    else:
        bounds = load_checks(stress, loads, fraction, weights, phases)
    gap = float(abs(work.T - means.energy).max() / abs(means.energy).max())
    return {"hill_mandel": gap, **bounds}


_PLANES: dict[tuple[float, float, Path | None], Triangulation] = {}
_MOST_PLANES = 4  # that are kept


def _plane(
    size: float, radius: float, cache: Path | None, ranks: Ranks, aside: Callable[[], object] | None
) -> Triangulation:
    """Planar mesh, kept; of several ranks the first alone makes it, others do something else."""
    key = size, radius, cache
    if not all(ranks.all(key in _PLANES)):
        make = partial(triangulate, size=size, radius=radius, cache=cache)
        made = ranks.first(make, aside)
        while len(_PLANES) >= _MOST_PLANES:
            del _PLANES[next(iter(_PLANES))]
        _PLANES[key] = made
    return _PLANES[key]


@lru_cache(maxsize=4)
def _system(plane: Triangulation, layers: int, parallel: bool) -> PrismSystem:
    """Topology, forms and numbering: they do not depend on the map, only on these."""
    communicator = MPI.COMM_WORLD if parallel else MPI.COMM_SELF
    return PrismSystem(PrismGrid(plane, layers, plane.radius > 0), communicator)
