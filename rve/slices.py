"""The slices model: planar cell problems at the nodes of a rule in θ.

The product-space form has no θ-derivative, so its exact solution at each θ is the planar problem with radius r(θ).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from time import perf_counter

import numpy as np

from rve.cell import STRAIN, Phase
from rve.result import Homogenised, StressCurve, effective_modulus
from rve.slices_rule import DIGITS, extreme_radii, theta_error, theta_rule
from stochastic import RadiusMap, ThetaRule
from stochastic.truncated_normal import Array

_GAIN = 4.0  # one order more divides the error by at least this and one; 7 to 50 were met


@dataclass(frozen=True)
class SlicesModel:
    """Planar DOLFINx solves with curved elements at the nodes of a Gauss rule in θ.

    Args:
        order: Polynomial degree of the elements, 2 to 4.
        mesh_size: Edge length far from the interface, in halves of the cell's side, in (0, 1].
        points: Nodes in θ, of each smooth piece where the map jumps; at least 2.
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
        if self.order not in (2, 3, 4):
            raise ValueError(f"the order of the planar elements is {self.order}; it must be 2, 3 or 4")
        if not 0 < self.mesh_size <= 1:
            raise ValueError(f"the mesh size is {self.mesh_size:g}; it must lie in (0, 1], in halves of the cell's side")
        if self.points < 2:
            raise ValueError(f"the rule in θ has {self.points} points; it needs at least 2")

    def solve(self, radius_map: RadiusMap, matrix: Phase, inclusions: Sequence[Phase]) -> list[Homogenised]:
        """One result for each of `inclusions`, in their order.

        Raises:
            PlanarError: A linear system was not solved.
        """
        start = perf_counter()
        rule = theta_rule(radius_map, points=self.points)
        at_nodes = np.round(radius_map(rule.nodes), DIGITS)
        radii = np.unique(np.concatenate([at_nodes, np.round(extreme_radii(radius_map), DIGITS)]))
        slices = []
        for radius in radii:
            slices.append(
                solve_slice(radius, matrix, inclusions, orders=(self.order - 1, self.order), mesh_size=self.mesh_size, centre=self.centre)
            )
            if self.progress:
                self.progress(len(slices) / radii.size)
        seconds = {stage: sum(s.seconds[stage] for s in slices) for stage in slices[0].seconds}
        seconds["total"] = perf_counter() - start - seconds["jit"]
        nodes = np.searchsorted(radii, at_nodes)
        results = []
        for m in range(len(inclusions)):
            stiffness, gap = np.array([s.stiffness[m] for s in slices]), np.array([s.gaps[-1, m] for s in slices])
            curve = curve_of(rule, stiffness[nodes])
            error = {
                "space": space_error(curve, gap[nodes]),
                "theta": theta_error(radius_map, rule, radii=radii, stress=np.stack(stresses(stiffness), axis=1)),
            }
            reason = f"{rule.nodes.size} nodes in θ, elements of order {self.order}, mesh size {self.mesh_size:g}"
            results.append(Homogenised(curve, self.name, slices[0].solver, max(s.unknowns for s in slices), (), seconds, error, reason))
        return results


@dataclass(frozen=True)
class Slice:
    """A planar cell solved for m inclusions by elements of several orders on one mesh.

    Args:
        by_order: Stiffness by order, in Pa, shape (orders, m, 3, 3).
        unknowns: Of the largest linear system.
        solver: Its solver.
        seconds: Wall time: mesh, jit, assemble, solve.
    """

    by_order: Array
    unknowns: int
    solver: str
    seconds: dict[str, float]

    @property
    def stiffness(self) -> Array:
        """By the highest order, shape (m, 3, 3), in Pa."""
        return np.asarray(self.by_order[-1])

    @property
    def gaps(self) -> Array:
        """Relative change of C11 + C12 and C33 by each rise of the order, shape (orders − 1, m, 2)."""
        moduli = np.stack([self.by_order[..., 0, 0] + self.by_order[..., 0, 1], self.by_order[..., 2, 2]], axis=-1)
        return np.asarray(np.abs(moduli[:-1] / moduli[1:] - 1))


def solve_slice(
    radius: float,
    matrix: Phase,
    inclusions: Sequence[Phase],
    *,
    orders: Sequence[int],
    mesh_size: float,
    centre: tuple[float, float] = (0.0, 0.0),
) -> Slice:
    """Solve one planar cell by each of `orders`, rising, on one mesh."""
    from rve.planar import PlanarCell
    from rve.planar_mesh import planar_mesh
    from rve.planar_system import SOLVER

    started = perf_counter()
    mesh = planar_mesh(radius, size=mesh_size, centre=centre)
    seconds = {"mesh": perf_counter() - started}
    cells = [PlanarCell(mesh, order) for order in orders]
    stiffness = np.array([cell.solve(matrix, inclusions)[0] for cell in cells])
    for name in ("mesh", "jit", "assemble", "solve"):
        seconds[name] = seconds.get(name, 0.0) + sum(cell.seconds[name] for cell in cells)
    return Slice(stiffness, cells[-1].unknowns, SOLVER, seconds)


def stresses(stiffness: Array) -> tuple[Array, Array]:
    """σ11 under load 1 and σ12 under load 2 of eq. 15 from stiffnesses (n, 3, 3)."""
    return STRAIN * (stiffness[:, 0, 0] + stiffness[:, 0, 1]), 2 * STRAIN * stiffness[:, 2, 2]


def curve_of(rule: ThetaRule, stiffness: Array) -> StressCurve:
    """Stress over θ from the stiffness (n, 3, 3) at the nodes."""
    return StressCurve(rule.nodes, rule.weights, *stresses(stiffness), stiffness)


def space_error(curve: StressCurve, gap: Array) -> float:
    """Estimated relative error of E by the elements: what one order less changes in E, over the gain of one order more."""
    s11, s12 = (float(curve.weights @ (stress * (1 + g))) for stress, g in zip((curve.s11, curve.s12), gap.T, strict=True))
    return abs(effective_modulus(s11, s12)[0] / effective_modulus(*curve.mean)[0] - 1) / _GAIN
