"""The slices model: two-dimensional cell problems at the nodes of a rule in θ.

The product-space form has no θ-derivative, so its exact solution at each θ is the plane problem
with radius r(θ).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np

from alphacut.fuzzy.arrays import Array, Rows
from alphacut.fuzzy.refused import RefusedError
from alphacut.rve.cell.cell import STRAIN, AnyPhase, Cell, Interphase, thickness_of
from alphacut.rve.cell.outline import Outline, circle, is_round
from alphacut.rve.cell.settings import (
    require_compressible,
    require_continuous,
    require_interphase,
    require_mesh_size,
    require_parts,
    require_points,
)
from alphacut.rve.result.checks import with_checks
from alphacut.rve.result.moduli import axial_moduli, square_moduli
from alphacut.rve.result.result import HomogenisedStiffness, PhaseEnergies, StressCurve
from alphacut.rve.slices.outline_slice import (
    ACCURATE_ORDER,
    REFERENCE_ORDER,
    OutlineSlice,
    energies_with_errors,
    second_size,
)
from alphacut.rve.slices.theta_error import DIGITS, theta_error
from alphacut.stochastic import RadiusMap, ThetaRule, gauss_rule

if TYPE_CHECKING:
    from alphacut.rve.slices.plane_cell import PlaneCell

_MIN_RATIO = 0.03  # least ratio of the changes by two successive orders in the extrapolation
_ORDERS = 2, 3, 4
_ROUND_OFF = 1e-13
_CANCELLATION = 2e-14  # relative round-off for each unit of radius and contrast
_SAFETY = 3.3
_COARSE, _COARSE_SAFETY = 0.6, 5.5  # mesh size above which errors do not yet fall as they should
_AXES_SAFETY = 1.5  # where the moduli along both axes differ
_MIN_FRACTION = np.array([0.03, 0.5, 0.5])  # least error of each modulus over the largest of them


@dataclass(frozen=True)
class SlicesModel:
    """Plane finite elements with curved sides at the nodes of a Gauss rule in θ.

    Args:
        order: Polynomial degree of the elements, 2 to 4.
        mesh_size: Edge length far from the interface, in halves of the cell's side, in (0, 1].
        points: Nodes in θ, at least 2.
        outline: Distance of the particle's edge from its centre over r(θ), a function of the angle.
        energies: Whether to compute the energies of the phases, for loss factors.

    Raises:
        RefusedError: A value lies outside its range.

    Example:
        >>> from alphacut.rve import Phase
        >>> from alphacut.stochastic import HermiteMap
        >>> model = SlicesModel(order=3, mesh_size=0.5, points=2)
        >>> [result] = model.solve(HermiteMap(0.2, 0.1, 0.6, 0.1), Phase(20e9), [Phase(80e9)])
        >>> 20e9 < result.modulus < 26e9
        True
    """

    order: int = 4
    mesh_size: float = 0.2
    points: int = 10
    outline: Outline = circle
    energies: bool = False
    name = "slices"

    def __post_init__(self) -> None:
        if self.order not in _ORDERS:
            raise RefusedError("order of the elements", self.order, "2, 3, 4")
        require_mesh_size(self.mesh_size)
        require_points(self.points)

    def solve(
        self,
        radius_map: RadiusMap,
        matrix: AnyPhase,
        inclusions: Sequence[AnyPhase],
        interphase: Interphase | None = None,
    ) -> list[HomogenisedStiffness]:
        """Homogenised stiffness for each of `inclusions`, in their order.

        Raises:
            ConvergenceError: A linear system was not solved.
            RefusedError: A Poisson's ratio is above 0.45, or a radius does not fit.
        """
        require_parts(radius_map, matrix, inclusions, isotropic=False)
        require_compressible(matrix, *inclusions)
        require_interphase(interphase, self.outline)
        fine_radii = require_continuous(radius_map)
        start = perf_counter()
        rule = gauss_rule(radius_map.distribution, points=self.points)
        extremes = [fine_radii.min(), fine_radii.max()]  # for the error in θ
        all_radii = np.concatenate([radius_map(rule.nodes), extremes])
        radii, indices = np.unique(np.round(all_radii, DIGITS), return_inverse=True)
        nodes = indices[: rule.nodes.size]  # index among the radii of each node in θ
        slices = [self._slice(radius, matrix, inclusions, interphase) for radius in radii]
        seconds = {"total": perf_counter() - start}
        results = []
        for m, inclusion in enumerate(inclusions):
            cell = Cell(matrix, inclusion, radius_map, self.outline, interphase)
            stiffness = np.array([plane.stiffness(self.order)[m] for plane in slices])
            errors = np.array([plane.error(self.order, square=cell.square)[m] for plane in slices])
            curve = StressCurve.from_stiffness(rule, stiffness[nodes])
            in_theta = _theta_error(cell, rule, radii, square_moduli(stiffness))
            result = HomogenisedStiffness(
                curve=curve,
                method=self.name,
                solver="cholesky",
                unknowns=max(plane.unknowns[self.order] for plane in slices),
                seconds=seconds,
                errors={
                    "space": mean_errors(curve, errors[nodes], square=cell.square),
                    "theta": in_theta,
                },
                cell=cell,
            )
            results.append(with_checks(result))
        if not self.energies:
            return results
        pairs = [energies_with_errors(plane.energies, self.order) for plane in slices]
        energies, energy_errors = (np.array(x) for x in zip(*pairs, strict=True))
        return [
            self._with_energies(result, radii, nodes, energies[:, m], energy_errors[:, m])
            for m, result in enumerate(results)
        ]

    def _with_energies(
        self, result: HomogenisedStiffness, radii: Array, nodes: Rows, values: Array, errors: Array
    ) -> HomogenisedStiffness:
        """Copy of a result with the mean energies of the phases over θ and their declared errors.

        Args:
            result: The result, with its cell.
            radii: Radii solved, rising, shape (n,).
            nodes: Index among `radii` of each node of the rule in θ.
            values: Energies at the radii, shape (n, phases, 2, 3), in Pa.
            errors: Their declared errors.
        """
        cell, rule = result.cell, ThetaRule(result.curve.theta, result.curve.weights)
        assert cell is not None

        def absolute_theta_error(moduli: Array) -> Array:
            """Error of the mean over θ of moduli at the radii, shape (n, 3), in Pa."""
            return _theta_error(cell, rule, radii, moduli) * rule.mean(moduli[nodes])

        # energies X ∂c/∂X may change sign, but c + X ∂c/∂X are moduli with stiffer phases
        moduli = values.sum(axis=(1, 2))
        stiffer_errors = [
            [absolute_theta_error(moduli + values[:, phase, kind]) for kind in range(2)]
            for phase in range(len(cell.phases))
        ]
        error_in_theta = np.array(stiffer_errors) + absolute_theta_error(moduli)
        total_errors = rule.mean(errors[nodes]) + error_in_theta
        return replace(result, energies=PhaseEnergies(rule.mean(values[nodes]), total_errors))

    def _slice(
        self,
        radius: float,
        matrix: AnyPhase,
        inclusions: Sequence[AnyPhase],
        interphase: Interphase | None,
    ) -> Slice | OutlineSlice:
        """Solve the cell of one radius for all inclusions by several orders, for an error estimate.

        A circle without interphase: three orders on one mesh; else two orders and two meshes.
        """
        options: dict[str, Any] = {
            "mesh_size": self.mesh_size,
            "outline": self.outline,
            "energies": self.energies,
        }
        if is_round(self.outline) and interphase is None:
            return solve_slice(radius, matrix, inclusions, **options)
        return solve_outline_slice(
            radius, matrix, inclusions, order=self.order, interphase=interphase, **options
        )


def _theta_error(cell: Cell, rule: ThetaRule, radii: Array, moduli: Array) -> Array:
    """Relative errors of the means by a rule of three moduli at the radii, (n, 3), shape (3,)."""
    thickness = thickness_of(cell.interphase)
    return theta_error(
        cell.radius, rule, radii=radii, moduli=moduli, phases=cell.phases, thickness=thickness
    )


def mean_errors(curve: StressCurve, error: Array, *, square: bool) -> Array:
    """Relative errors of the means over θ of C11 + C12, C11 − C12 and C33, shape (3,).

    Args:
        curve: With its stiffness.
        error: Relative errors at the nodes of θ, shape (n, 3).
        square: Whether the cell has the symmetry of the square.
    """
    moduli = square_moduli(np.asarray(curve.stiffness))
    mean = curve.weights @ moduli
    errors = np.asarray(curve.weights @ (moduli * error) / mean)
    if square:  # C11 and C22 differ by the mesh alone; s11 has C11, the moduli their mean
        errors[0] += abs(STRAIN * mean[0] / curve.mean[0] - 1)
    return errors


@dataclass(frozen=True)
class Slice:
    """A two-dimensional cell solved for m inclusions by elements of orders 2, 3 and 4 on one mesh.

    Args:
        by_order: Stiffness by order, in Pa, shape (3, m, 3, 3).
        unknowns: Number of unknowns of the linear system, by order.
        mesh_size: Edge length of the mesh, in halves of the cell's side.
        cancellation: Relative round-off where forces of a stiff particle cancel, shape (m, 1).
        energies: Parts of the phases in the three moduli by order, shape (m, 2, 2, 3), in Pa; empty
            where they were not asked for.
    """

    by_order: Array
    unknowns: Mapping[int, int]
    mesh_size: float
    cancellation: Array
    energies: Mapping[int, Array] = field(default_factory=dict)

    def stiffness(self, order: int) -> Array:
        """Stiffness by elements of one order, shape (m, 3, 3), in Pa."""
        return np.asarray(self.by_order[_ORDERS.index(order)])

    def error(self, order: int, *, square: bool) -> Array:
        """Declared relative errors of C11 + C12, C11 − C12, C33, shape (m, 3).

        They are the distance of this order's moduli from those of order 4, and the error of order
        4, which is extrapolated from the changes between the orders 2, 3 and 4.

        Args:
            order: Order of the elements of the result.
            square: Whether the stiffness has the symmetry of the square; else the larger error of
                the moduli with C11 and with C22 counts.
        """
        moduli = axial_moduli(self.by_order, square=square)  # (3, m, axes, 3)
        distance = abs(moduli[_ORDERS.index(order)] / moduli[-1] - 1).max(axis=1)
        changes = abs(moduli[:-1] / moduli[1:] - 1).max(axis=2)
        if not square:
            changes = _AXES_SAFETY * changes
        return np.asarray((1 + distance) * (1 + self._error_of_order_4(changes)) - 1)

    def _error_of_order_4(self, changes: Array) -> Array:
        """Declared relative errors by order 4, (m, 3), from the changes to orders 3 and 4.

        The geometric series of the changes by further orders, times a safety factor. One modulus
        may change little by chance: the error of each is at least a fraction of the largest.
        """
        first, second = changes
        ratio = np.clip(second / np.maximum(first, 1e-300), _MIN_RATIO, 0.5)
        safety = _SAFETY if self.mesh_size <= _COARSE else _COARSE_SAFETY
        error = safety * second * ratio / (1 - ratio)
        least = _MIN_FRACTION * error.max(axis=1, keepdims=True)
        return np.asarray(np.maximum(error, least) + _ROUND_OFF + self.cancellation)


def solve_slice(
    radius: float,
    matrix: AnyPhase,
    inclusions: Sequence[AnyPhase],
    *,
    mesh_size: float,
    outline: Outline = circle,
    energies: bool = False,
) -> Slice:
    """Solve a plane cell with one particle by elements of orders 2, 3 and 4 on one mesh.

    Args:
        radius: Radius over half the cell's side.
        matrix: Material of the matrix.
        inclusions: Materials of the particle, m of them, each of which is solved.
        mesh_size: Edge length, in halves of the cell's side.
        outline: Distance of the particle's edge from its centre over the radius.
        energies: Whether to compute the energies of the phases.

    Returns:
        The stiffnesses by order, shape (3, m, 3, 3), in Pa, with what their errors follow from.
    """
    from alphacut.rve.mesh.curved import plane_mesh
    from alphacut.rve.slices.plane_cell import PlaneCell

    mesh = plane_mesh(radius, size=mesh_size, outline=outline)
    cells = {order: PlaneCell(mesh, order) for order in _ORDERS}
    phases = [(matrix, inclusion) for inclusion in inclusions]
    stiffness, phase_energies = _solve_orders(cells, phases, energies=energies)
    return Slice(
        by_order=np.array([*stiffness.values()]),
        unknowns={order: cell.unknowns for order, cell in cells.items()},
        mesh_size=mesh_size,
        cancellation=_cancellation(radius, matrix, inclusions),
        energies=phase_energies,
    )


def solve_outline_slice(
    radius: float,
    matrix: AnyPhase,
    inclusions: Sequence[AnyPhase],
    *,
    mesh_size: float,
    outline: Outline,
    order: int = ACCURATE_ORDER,
    energies: bool = False,
    interphase: Interphase | None = None,
) -> OutlineSlice:
    """Solve a cell with a particle that is not round, or with an interphase, on two meshes.

    Args:
        radius: Radius of the particle.
        matrix: Phase outside it.
        inclusions: Phases of the particle, m of them.
        mesh_size: Edge length of the mesh of the result, in halves of the cell's side.
        outline: Outline of the particle.
        order: Order of the elements of the result.
        energies: Whether to compute the energies of the phases.
        interphase: Ring around a round particle.
    """
    from alphacut.rve.mesh.curved import plane_mesh
    from alphacut.rve.slices.plane_cell import PlaneCell

    thickness = thickness_of(interphase)
    ring = () if interphase is None else (interphase.phase,)
    phases = [(matrix, inclusion, *ring) for inclusion in inclusions]
    first, second = (
        plane_mesh(radius, size=size, outline=outline, thickness=thickness)
        for size in (mesh_size, second_size(mesh_size))
    )
    orders = {order, ACCURATE_ORDER, REFERENCE_ORDER}
    cells = {degree: PlaneCell(first, degree) for degree in orders}
    stiffness, phase_energies = _solve_orders(cells, phases, energies=energies)
    reference = {REFERENCE_ORDER: PlaneCell(second, REFERENCE_ORDER)}
    reference_stiffness, _ = _solve_orders(reference, phases)
    return OutlineSlice(
        by_order=stiffness,
        on_second_mesh=reference_stiffness[REFERENCE_ORDER],
        unknowns={degree: cell.unknowns for degree, cell in cells.items()},
        round_off=_ROUND_OFF + _cancellation(radius, matrix, inclusions),
        energies=phase_energies,
    )


def _solve_orders(
    cells: Mapping[int, PlaneCell], samples: Sequence[Sequence[AnyPhase]], *, energies: bool = False
) -> tuple[dict[int, Array], dict[int, Array]]:
    """Stiffness, (m, 3, 3), and energies of the phases if wanted, (m, phases, 2, 3), by order.

    `cells` are the cells by order of their elements, `samples` the phases of each of m samples.
    """
    stiffness, phase_energies = {}, {}
    for order, cell in cells.items():
        values, parts = [], []
        for phases in samples:
            values.append(cell.stiffness([phase.stiffness for phase in phases]))
            if energies:  # of the fields that were just solved
                parts.append(cell.phase_energies(phases))
        stiffness[order] = np.array(values)
        if energies:
            phase_energies[order] = np.array(parts)
    return stiffness, phase_energies


def _cancellation(radius: float, matrix: AnyPhase, inclusions: Sequence[AnyPhase]) -> Array:
    """Relative round-off where a stiff particle's forces cancel, shape (m, 1)."""
    contrast = [[phase.stiffness[2, 2] / matrix.stiffness[2, 2]] for phase in inclusions]
    return np.asarray(_CANCELLATION * radius * np.array(contrast))
