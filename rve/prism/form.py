"""Stiffness of each phase on wedges (eq. 7).

The form has no derivative along θ: div and D act on x alone. So a wedge is integrated slice by
slice, at the Gauss points along θ; a slice is a triangle of six nodes, whose integral FFCx makes. A
loop in C carries slices to wedges and adds them up.
"""

from __future__ import annotations

import ctypes
import hashlib
import os
import platform
import sys
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from alphacut.rve.cell import Phase
from alphacut.rve.interruption import uninterrupted
from alphacut.rve.mesh import wedge
from alphacut.rve.mesh.prism_grid import PrismGrid
from alphacut.rve.petsc import PETSc, block_values
from alphacut.rve.solver.c_loops import WEDGES, c_loops, kernels
from alphacut.rve.table.cache import version_of
from alphacut.stochastic import RadiusMap, ThetaLaw
from alphacut.stochastic.theta.law import Array

_CORNERS = np.array([[0, 0], [1, 0], [0, 1], [0.5, 0.5], [0, 0.5], [0.5, 0]])  # in Basix's order
# twice as fast as the default -O2, equal to round-off
JIT = {"cffi_extra_compile_args": ["-O3", "-ffast-math"], "timeout": 120}  # for other processes


@dataclass
class PrismForm:
    """Integrals over the wedges of one grid; positions and phases are set anew for every map.

    On several ranks each adds up what the wedges around its rows give to these.

    Args:
        grid: Topology of those wedges.
        pairs: Unknown pair of each of their nodes, −1 where fixed, shape (wedges, 15).
        rows: The unknowns of the rank.
        places: Where blocks stand in matrices, shape (wedges, 15, 15); see `LevelNumbering.matrix`.
    """

    grid: PrismGrid
    pairs: NDArray[np.int32]
    rows: range
    places: NDArray[np.int32]

    def __post_init__(self) -> None:
        self.points, self.weights = wedge.slab_rule()
        self.shapes = wedge.tabulate(self.points)
        started = perf_counter()
        self._integral = planar_integral()
        self.jit_seconds = perf_counter() - started
        slices = self.points.reshape(3, -1, 3)[:, 0, 2]
        corners = [np.column_stack([_CORNERS, np.full(6, place)]) for place in slices]
        self._traces = np.array([wedge.tabulate(points) for points in corners])
        self._traces[abs(self._traces) < 1e-14] = 0.0
        self._heights = 2 * self.weights.reshape(3, -1).sum(axis=1)
        first, stop = self.rows.start // 2, self.rows.stop // 2
        own = (self.pairs >= first) & (self.pairs < stop)
        self._pairs = np.where(own, self.pairs - first, -1).astype(np.int32)
        self._giving = np.flatnonzero(own.any(axis=1)).astype(np.int32)
        self._forces: dict[int, Array] = {}

    def place(self, radius: RadiusMap) -> Array:
        """Move the nodes to the cone of `radius`; returns their positions, shape (nodes, 3).

        Raises:
            ValueError: The density of θ is not positive at a quadrature point.
        """
        positions = self.grid.positions(radius)
        self._nodes = positions[self.grid.cells]
        self._weigh(radius.distribution)
        return positions

    def _weigh(self, law: ThetaLaw) -> None:
        """Set the density of θ at the quadrature points, f_Θ of eq. 1."""
        levels = self.grid.levels(law)
        theta = levels[:-1, None] + np.diff(levels)[:, None] * self.points[:, 2]
        density = law.pdf(theta)
        if not (density > 0).all():
            place = theta[~(density > 0)][0]
            raise ValueError(
                f"the density of θ is {law.pdf(place):g} at {place:.4g}, and every layer of the"
                " product space needs probability: shorten the support, or take the series or a"
                " table"
            )
        self._density = density[np.array(self.grid.own) // len(self.grid.plane.triangles)]

    def mark(self, share: Array) -> None:
        """Set the particle's share at the quadrature points, shape (cells, points)."""
        self._share = share

    def set_poisson(self, phases: tuple[Phase, Phase]) -> None:
        """Take the phases' Poisson's ratios; Young's moduli stay 1."""
        units = [Phase(1.0, phase.poisson).stiffness for phase in phases]
        self._constants = [np.array([c[0, 0], c[0, 1], c[2, 2]]) for c in units]

    def add_stiffness(self, phase: int, matrix: PETSc.Mat, modulus: float = 1.0) -> None:
        """Add K_m (phase 0) or K_i (phase 1) of eq. 7, times a modulus, and keep its loads."""
        own, weights = self._giving, modulus * self._density
        if self.grid.conforming:
            own = own[self.grid.inside[own] == bool(phase)]
        else:
            weights = weights * (self._share if phase else 1 - self._share)
        weights, forces = weights[own], np.zeros((len(self.rows), 3))
        c_loops(WEDGES).add_wedges(
            self._integral, self._traces.ctypes, self._heights.ctypes, len(own), own.ctypes,
            weights.ctypes, self._nodes.ctypes, self._constants[phase].ctypes, self._pairs.ctypes,
            self.places.ctypes, *block_values(matrix), forces.ctypes,
        )  # fmt: skip
        self._forces[phase] = forces / modulus

    def load(self, phase: int, strain: Array) -> Array:
        """Forces −⟨Bᵀ E ε̄⟩ of one phase for a unit modulus, on the unknowns of the rank.

        They are what its stiffness, which is added before, makes of the displacements ε̄x.

        Args:
            phase: 0 the matrix, 1 the particle.
            strain: Macroscopic strain (ε11, ε22, 2 ε12).
        """
        return np.asarray(self._forces[phase] @ strain)


def planar_integral() -> Callable[..., None]:
    """FFCx's integral over a triangle of a slice, made once for all runs."""
    names = ("fenics-dolfinx", "fenics-ffcx", "fenics-ufl", "fenics-basix")
    sources = [Path(str(file)).read_text(encoding="utf-8") for file in (__file__, wedge.__file__)]
    parts = [
        *sources,
        *map(version_of, names),
        platform.machine(),
        str(sys.implementation.cache_tag),
    ]
    note = kernels() / f"form-{hashlib.sha256(repr(parts).encode()).hexdigest()[:16]}"
    try:
        return _function(note.read_text(encoding="utf-8"))
    except (OSError, ValueError, AttributeError):
        made = Path(str(_compiled().__file__))
    source = made.with_name(made.name.partition(".")[0] + ".c").read_text(encoding="utf-8")
    name = source.partition("void tabulate_tensor_")[2].partition("(")[0]
    place, partial = f"{made}\ntabulate_tensor_{name}", note.with_suffix(f".{os.getpid()}")
    partial.write_text(place, encoding="utf-8")
    partial.replace(note)
    return _function(place)


def _function(place: str) -> Callable[..., None]:
    """The function that a library's path and a name, one a line, tell."""
    path, name = place.split("\n")
    found: Callable[..., None] = getattr(ctypes.CDLL(path), name)
    return found


def _compiled() -> ModuleType:
    """The form of eq. 7, compiled by FFCx or taken from its cache."""
    with uninterrupted(), warnings.catch_warnings():
        import basix.ufl
        import ufl
        from dolfinx import jit
        from mpi4py import MPI

        # UFL signs a form by the printed quadrature points; they print in full
        warnings.filterwarnings("ignore", message="Applying str")
        points, weights = basix.make_quadrature(basix.CellType.triangle, 4)  # as `slab_rule`
        quadratic = basix.ufl.element("P", "triangle", 2, shape=(2,))
        mesh = ufl.Mesh(quadratic)
        space = ufl.FunctionSpace(mesh, quadratic)
        u, v, c = ufl.TrialFunction(space), ufl.TestFunction(space), ufl.Constant(mesh, shape=(3,))
        at_points = basix.ufl.quadrature_element("triangle", points=points, weights=weights)
        weight = ufl.Coefficient(ufl.FunctionSpace(mesh, at_points))  # f_Θ of eq. 1
        rule = {
            "quadrature_rule": "custom",
            "quadrature_points": points,
            "quadrature_weights": weights,
        }
        # eq. 7: the Galerkin projection (eq. 4) of −div σ (eq. 2, eq. 5) on wedges (eq. 3)
        form = weight * ufl.inner(_stress(c, _strain(u)), _strain(v)) * ufl.dx(mesh, metadata=rule)
        module: ModuleType = jit.ffcx_jit(MPI.COMM_SELF, form, jit_options=JIT)[1]
        return module


def _strain(w: Any) -> Any:
    """In-plane strain (ε11, ε22, 2 ε12) on the product space; θ is not differentiated."""
    import ufl

    gradient = ufl.grad(w)
    return ufl.as_vector([gradient[0, 0], gradient[1, 1], gradient[0, 1] + gradient[1, 0]])


def _stress(c: Any, e: Any) -> Any:
    """In-plane stress of the strain `e` from the three constants C11, C12, C33."""
    import ufl

    return ufl.as_vector([c[0] * e[0] + c[1] * e[1], c[1] * e[0] + c[0] * e[1], c[2] * e[2]])
