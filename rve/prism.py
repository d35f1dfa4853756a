"""The paper's model of the cell: finite elements on the product of the cell and the random variable (sections 3.1, 4.2, 4.3).

This differs from the paper in: 1. The interface is a set of curved element faces, not the sign of z at quadrature points
(`interface="sign"` is the paper's eq. 13). 2. The fluctuation is fixed on the whole line of one periodic corner over θ.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import ClassVar

import numpy as np
from mpi4py import MPI

from rve.cell import Phase
from rve.prism_grid import PrismGrid
from rve.prism_system import PrismSystem, Stopwatch
from rve.result import Homogenised
from rve.solver_options import SOLVERS
from rve.triangulation import triangulate
from stochastic import RadiusMap

INTERFACES = ("conforming", "sign")


@dataclass(frozen=True)
class PrismModel:
    """Product-space finite elements: quadratic serendipity wedges around the cone of the random radius.

    Args:
        mesh_size: Edge length of the triangles, in halves of the cell's side, in (0, 1].
        layers: Layers in θ, at least 1 (paper: 12).
        interface: "conforming", or "sign" for a mesh that ignores the interface (first order in h, too stiff: for comparison).
        solver: Name in `rve.solver_options.SOLVERS`.
        petsc: PETSc options without their prefix `rve_`; they override the solver's own.
        parallel: Whether all MPI ranks work on one cell together; if not each works on its own.

    Raises:
        ValueError: An option out of range or unknown.
    """

    mesh_size: float = 0.15
    layers: int = 12
    interface: str = "conforming"
    solver: str = "theta"
    petsc: Mapping[str, str] = field(default_factory=dict)
    parallel: bool = False
    name: ClassVar[str] = "prism"

    def __post_init__(self) -> None:
        if not 0 < self.mesh_size <= 1:
            raise ValueError(f"the mesh size is {self.mesh_size:g}; it must lie in (0, 1], in halves of the cell's side")
        if self.layers < 1:
            raise ValueError(f"the number of layers is {self.layers}; at least 1 is needed")
        for what, value, known in (("interface", self.interface, INTERFACES), ("solver", self.solver, SOLVERS)):
            if value not in known:
                raise ValueError(f"the {what} is {value!r}; known are {', '.join(known)}")

    def solve(self, radius_map: RadiusMap, matrix: Phase, inclusions: Sequence[Phase]) -> list[Homogenised]:
        """One result for each of `inclusions`, in their order: mesh and assembly once, one solve for each load.

        Raises:
            ConvergenceError: The linear solver stopped early.
            RuntimeError: An element is inverted.
        """
        watch = Stopwatch()
        with watch("mesh"):
            radius = reference_radius(radius_map) if self.interface == "conforming" else 0.0
            system = _system(self.mesh_size, self.layers, radius, self.parallel)
            system.move(radius_map)
        watch.shift("mesh", "jit", system.take_jit_seconds())
        return system.homogenise(matrix, inclusions, options={**SOLVERS[self.solver], **self.petsc}, watch=watch, name=self.solver)


def reference_radius(radius_map: RadiusMap) -> float:
    """Radius at which the planar mesh is made: the middle of the map's range, to the nearest twentieth, in [0.1, 0.9]."""
    law = radius_map.distribution
    radii = radius_map(np.linspace(law.lower, law.upper, 65))
    return float(np.clip(np.round((radii.min() + radii.max()) * 10) / 20, 0.1, 0.9))


@lru_cache(maxsize=4)
def _system(mesh_size: float, layers: int, radius: float, parallel: bool) -> PrismSystem:
    """Topology, forms and numbering: they do not depend on the map, only on these numbers."""
    return PrismSystem(
        PrismGrid(triangulate(size=mesh_size, radius=radius), layers, radius > 0), MPI.COMM_WORLD if parallel else MPI.COMM_SELF
    )
