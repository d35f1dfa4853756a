"""FFCx's integrals of the stiffness over a triangle, made once for all runs."""

from __future__ import annotations

import ctypes
import hashlib
import os
import platform
import sys
import warnings
from collections.abc import Callable
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

from alphacut.rve.interruption import uninterrupted
from alphacut.rve.solver.c_loops import kernels

_FAST = ["-O3", "-ffast-math"]  # twice as fast as the default -O2, equal to round-off
# FFCx's own: a file of the caller's folder could ask for single precision, and stay in the cache
_TABLES = {"epsilon": 1e-14, "table_rtol": 1e-6, "table_atol": 1e-9}
_FFCX = {"scalar_type": "float64", "sum_factorization": False, **_TABLES}
MADE_BY = "fenics-dolfinx", "fenics-ffcx", "fenics-ufl", "fenics-basix"


@cache
def triangle_integral(order: int, *, weighted: bool = False) -> Callable[..., None]:
    """Stiffness matrix of a triangle, straight or curved, for three constants C11, C12, C33.

    Args:
        order: Of its Lagrange functions and of its geometry, 1 to 4.
        weighted: Whether a weight is given at each of the points of degree 4, of order 2.
    """
    source = Path(__file__).read_text(encoding="utf-8")
    machine = platform.machine(), str(sys.implementation.cache_tag)
    parts = [source, *map(version_of, MADE_BY), *machine, order, weighted]
    note = kernels() / f"form-{hashlib.sha256(repr(parts).encode()).hexdigest()[:16]}"
    try:
        return _function(note.read_text(encoding="utf-8"))
    except (OSError, ValueError, AttributeError):
        place, partial = _made(order, weighted), note.with_suffix(f".{os.getpid()}")
    partial.write_text(place, encoding="utf-8")
    partial.replace(note)
    return _function(place)


def _made(order: int, weighted: bool) -> str:
    """Path of a library that is new, and the name of its function."""
    from tempfile import TemporaryDirectory

    # no other process's folder: what a killed one leaves in FEniCS's cache would be waited for
    with TemporaryDirectory(dir=kernels()) as work:
        library = Path(str(_compiled(order, weighted, work).__file__))
        code = library.with_name(library.name.partition(".")[0] + ".c").read_text(encoding="utf-8")
        made = library.replace(kernels() / library.name)
    name = code.partition("void tabulate_tensor_")[2].partition("(")[0]
    return f"{made}\ntabulate_tensor_{name}"


def version_of(package: str) -> str:
    """Name of the folder that tells an installed package's version, or "none"; no file is read."""
    start = f"{package}-".replace("-", "_")
    told = (name for name in _metadata() if name.replace("-", "_").startswith(start))
    return next(told, "none")


@cache
def _metadata() -> list[str]:
    folders = [path for path in map(Path, sys.path) if path.is_dir() and os.access(path, os.R_OK)]
    found = [path.name for one in folders for path in one.iterdir()]
    return [name for name in found if name.endswith((".dist-info", ".egg-info"))]


def _function(place: str) -> Callable[..., None]:
    """The function that a library's path and a name, one a line, tell."""
    path, name = place.split("\n")
    found: Callable[..., None] = getattr(ctypes.CDLL(path), name)
    return found


def _compiled(order: int, weighted: bool, work: str) -> ModuleType:
    """The form of eq. 7 without its weight, compiled by FFCx in a folder."""
    with uninterrupted(), warnings.catch_warnings():
        import basix.ufl
        import ufl
        from dolfinx import jit
        from mpi4py import MPI

        # UFL signs a form by the printed quadrature points; they print in full
        warnings.filterwarnings("ignore", message="Applying str")
        element = basix.ufl.element("P", "triangle", order, shape=(2,))
        mesh = ufl.Mesh(element)
        space = ufl.FunctionSpace(mesh, element)
        u, v, c = ufl.TrialFunction(space), ufl.TestFunction(space), ufl.Constant(mesh, shape=(3,))
        # eq. 7: the Galerkin projection (eq. 4) of −div σ (eq. 2, eq. 5) on wedges (eq. 3)
        density = ufl.inner(_stress(c, _strain(u)), _strain(v))
        rule: dict[str, Any] = {"quadrature_degree": max(2 * order - (order == 1), 1)}
        if weighted:
            points, weights = basix.make_quadrature(basix.CellType.triangle, 4)  # as `slab_rule`
            at = basix.ufl.quadrature_element("triangle", points=points, weights=weights)
            density *= ufl.Coefficient(ufl.FunctionSpace(mesh, at))  # f_Θ of eq. 1
            rule = {
                "quadrature_rule": "custom",
                "quadrature_points": points,
                "quadrature_weights": weights,
            }
        form = density * ufl.dx(mesh, metadata=rule)
        how = {"cffi_extra_compile_args": _FAST, "cache_dir": work}
        module: ModuleType = jit.ffcx_jit(MPI.COMM_SELF, form, _FFCX, how)[1]
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
