"""The slices model: planar cell problems at the nodes of a rule in θ.

The product-space form has no θ-derivative, so its exact solution at each θ is the planar problem
with radius r(θ).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from time import perf_counter

import numpy as np

from alphacut.rve.cell import Phase, square_moduli, with_ratio
from alphacut.rve.result import Homogenised
from alphacut.rve.settings import require_mesh_size, require_parts, require_points
from alphacut.rve.slices.curve import certified, curve_of, mean_errors, with_errors
from alphacut.rve.slices.theta_rule import DIGITS, extreme_radii, theta_error, theta_rule
from alphacut.stochastic import RadiusMap
from alphacut.stochastic.theta.truncated_normal import Array

# least share of the last change that is taken to be left: by order 4, the same where order 2 locks
# and so changes by much, and by lower orders, which are not yet regular
_FADE, _LOCKED_FADE, _IRREGULAR_FADE = 0.03, 0.05, 0.08
_LOCKING = 0.45  # Poisson's ratio above which order 2 locks
_ORDERS = 2, 3, 4
_ROUND_OFF = 1e-13
_CANCELLED = 2e-14  # relative round-off for each unit of radius and contrast
_SAFETY = 3.3
_COARSE, _COARSE_SAFETY = 0.6, 5.5  # mesh size above which orders do not yet leave what they should
_POINTWISE = 1.5  # safety of a single θ, where errors do not average
_SHARED = np.array([0.03, 0.5, 0.5, 0.5])  # C11 + C12 is the easiest by far


@dataclass(frozen=True)
class SlicesModel:
    """Planar finite elements with curved sides at the nodes of a Gauss rule in θ.

    Args:
        order: Polynomial degree of the elements, 2 to 4.
        mesh_size: Edge length far from the interface, in halves of the cell's side, in (0, 1].
        points: Nodes in θ, of each smooth piece where the map jumps or bends; at least 2.
        centre: Centre of the particle in the cell [−1, 1]²; the moduli do not depend on it.
        progress: Called with the fraction done.

    Raises:
        ValueError: A value lies outside its range.
    """

    order: int = 4
    mesh_size: float = 0.2
    points: int = 10
    centre: tuple[float, float] = (0.0, 0.0)
    progress: Callable[[float], None] | None = None
    name = "slices"

    def __post_init__(self) -> None:
        if self.order not in _ORDERS:
            raise ValueError(
                f"the order of the planar elements is {self.order}; it must be 2, 3 or 4"
            )
        require_mesh_size(self.mesh_size)
        require_points(self.points)

    def solve(
        self, radius_map: RadiusMap, matrix: Phase, inclusions: Sequence[Phase]
    ) -> list[Homogenised]:
        """One result for each of `inclusions`, in their order.

        Raises:
            PlanarError: A linear system was not solved.
        """
        require_parts(radius_map, matrix, inclusions)
        start = perf_counter()
        rule = theta_rule(radius_map, points=self.points)
        at_nodes = np.round(radius_map(rule.nodes), DIGITS)
        radii = np.unique(np.concatenate([at_nodes, np.round(extreme_radii(radius_map), DIGITS)]))
        slices = self._slices(radii, matrix, inclusions)
        seconds = {stage: sum(s.seconds[stage] for s in slices) for stage in slices[0].seconds}
        seconds["total"] = perf_counter() - start - seconds["jit"]
        results = []
        for m, inclusion in enumerate(inclusions):
            stiffness = np.array([s.stiffness[m] for s in slices])
            in_theta = theta_error(
                radius_map,
                rule,
                radii=radii,
                moduli=square_moduli(stiffness),
                phases=(matrix, inclusion),
            )
            nodes = np.searchsorted(radii, at_nodes)
            error = np.array([s.error[m] for s in slices])[nodes]
            curve = curve_of(rule, stiffness[nodes])
            result = Homogenised(
                with_errors(curve, _POINTWISE * error),
                self.name,
                slices[0].solver,
                max(s.unknowns for s in slices),
                (),
                seconds,
                {"space": mean_errors(curve, error), "theta": in_theta},
                f"{rule.nodes.size} nodes in θ, elements of order {self.order}, mesh size"
                f" {self.mesh_size:g}",
            )
            results.append(certified(result, radius_map, matrix, inclusion))
        return results

    def _slices(self, radii: Array, matrix: Phase, inclusions: Sequence[Phase]) -> list[Slice]:
        """The cells solved, one for each radius; orders below 4 are judged by the next."""
        slices = []
        for radius in radii:
            slices.append(
                solve_slice(
                    radius,
                    matrix,
                    inclusions,
                    orders=_ORDERS,  # whichever the result is taken from: the rest judge it
                    order=self.order,
                    mesh_size=self.mesh_size,
                    centre=self.centre,
                )
            )
            if self.progress:
                self.progress(len(slices) / radii.size)
        return slices


@dataclass(frozen=True)
class Slice:
    """A planar cell solved for m inclusions by elements of several orders on one mesh.

    Args:
        orders: Rising.
        order: That of the result.
        by_order: Stiffness by order, in Pa, shape (orders, m, 3, 3).
        unknowns: Of the result's linear system.
        solver: Its solver.
        factorisations: How many were made.
        seconds: Wall time: mesh, jit, assemble, solve.
        locks: Whether a phase is nearly incompressible.
        mesh_size: Edge length of the mesh, in halves of the cell's side.
        cancelled: Relative round-off that a stiff particle's forces leave of each inclusion where
            they cancel, shape (m, 1).
    """

    orders: tuple[int, ...]
    order: int
    by_order: Array
    unknowns: int
    solver: str
    factorisations: int
    seconds: dict[str, float]
    locks: bool
    mesh_size: float
    cancelled: Array

    @property
    def stiffness(self) -> Array:
        """By the result's order, shape (m, 3, 3), in Pa."""
        return np.asarray(self.by_order[self.orders.index(self.order)])

    @property
    def gaps(self) -> Array:
        """Relative change of the moduli and the ratio by each rise of order, (orders − 1, m, 4)."""
        moduli = with_ratio(square_moduli(self.by_order))
        return np.asarray(np.abs(moduli[:-1] / moduli[1:] - 1))

    @property
    def error(self) -> Array:
        """Declared relative errors of C11 + C12, C11 − C12, C33 and the ratio, shape (m, 4).

        The distance from the highest order, and the declared error of that one.
        """
        both = self.stiffness, self.by_order[-1]
        own, highest = (with_ratio(square_moduli(one)) for one in both)
        return np.asarray((1 + np.abs(own / highest - 1)) * (1 + self._error_of_highest) - 1)

    @property
    def _error_of_highest(self) -> Array:
        """Declared errors by the highest order, shape (m, 4).

        The geometric series of further orders, times a safety factor. What one order more leaves
        of the last change is what the last rise left of the one before; where order 2 locks, of
        the modulus where it left most. One modulus may change little by chance: each counts a share
        of the largest error.
        """
        gaps, least = self.gaps, _LOCKED_FADE if self.locks else _FADE
        fade = np.full(gaps.shape[1:], least if self.orders[-1] == 4 else _IRREGULAR_FADE)
        if len(gaps) > 1:
            fade = np.clip(gaps[-1] / np.maximum(gaps[-2], 1e-300), fade, 0.5)
        if self.locks:
            fade = fade.max(axis=1, keepdims=True)
        safety = _SAFETY if self.mesh_size <= _COARSE else _COARSE_SAFETY
        found = safety * gaps[-1] * fade / (1 - fade)
        shared = _SHARED * found[:, :3].max(axis=1, keepdims=True)
        return np.asarray(np.maximum(found, shared) + _ROUND_OFF + self.cancelled)


def solve_slice(
    radius: float,
    matrix: Phase,
    inclusions: Sequence[Phase],
    *,
    orders: Sequence[int],
    order: int | None = None,
    mesh_size: float,
    centre: tuple[float, float] = (0.0, 0.0),
    share: bool = False,
) -> Slice:
    """Solve one planar cell by each of the rising `orders` on one mesh.

    The result is that of `order`, by default the highest.
    """
    from alphacut.rve.mesh.planar import planar_mesh
    from alphacut.rve.planar.problem import PlanarCell
    from alphacut.rve.planar.system import SOLVER

    started = perf_counter()
    mesh = planar_mesh(radius, size=mesh_size, centre=centre)
    seconds = {"mesh": perf_counter() - started}
    cells = [PlanarCell(mesh, order) for order in orders]
    started = perf_counter()
    stiffness = np.array([cell.stiffness(matrix, inclusions, share=share) for cell in cells])
    seconds["solve"] = perf_counter() - started - sum(cell.seconds["assemble"] for cell in cells)
    for name in ("mesh", "jit", "assemble"):
        seconds[name] = seconds.get(name, 0.0) + sum(cell.seconds[name] for cell in cells)
    chosen = orders[-1] if order is None else order
    return Slice(
        tuple(orders),
        chosen,
        stiffness,
        cells[list(orders).index(chosen)].unknowns,
        SOLVER,
        sum(cell.factorisations for cell in cells),
        seconds,
        max(phase.poisson for phase in (matrix, *inclusions)) > _LOCKING,
        mesh_size,
        _CANCELLED * radius * np.array([[one.modulus / matrix.modulus] for one in inclusions]),
    )
