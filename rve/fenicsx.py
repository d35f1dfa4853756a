"""DOLFINx and PETSc, and the places where DOLFINx 0.9, 0.10 and 0.11 differ.

PETSc reads ``~/.petscrc`` when it is first imported, DOLFINx imports it too: whatever needs either
takes it from here. Signals stay the program's.
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from importlib.util import find_spec
from typing import Any

import numpy as np
import scipy.sparse as sp

from alphacut.base.arrays import Array, Ints
from alphacut.base.errors import RefusedError
from alphacut.base.extras import extra_named
from alphacut.rve.interruption import uninterrupted

if find_spec("dolfinx_solver"):  # where Numba is, this wheel hides the HDF5 of others after it
    with suppress(ImportError):
        import h5py  # noqa: F401
    with suppress(ImportError):
        import netCDF4  # noqa: F401


@contextmanager
def _without_numba() -> Iterator[None]:
    """Hide Numba within a block in which DOLFINx is imported.

    DOLFINx imports Numba for helpers that are not used here. Hiding it saves .3 s of each command
    and of each worker (``python -m benchmarks.start_up``). An import of Numba in the block raises
    ImportError, with which DOLFINx copes; its ImportWarning is silenced. If Numba has been imported
    before, it stays visible. Whoever wants `dolfinx.utils.numba_utils` imports Numba or DOLFINx
    first.
    """
    if is_hidden := "numba" not in sys.modules:
        # Python's way to say that a module cannot be imported: an entry of None.
        sys.modules["numba"] = None  # type: ignore[assignment]
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ImportWarning)  # by which DOLFINx says so
            yield
    finally:
        if is_hidden:
            del sys.modules["numba"]


with uninterrupted(), _without_numba(), extra_named():
    import cffi
    import petsc4py  # after MPI, and before DOLFINx: its wheels need that
    from mpi4py import MPI

    petsc4py.init(["alphacut", "-skip_petscrc", "-no_signal_handler"])
    from petsc4py import PETSc

    if np.issubdtype(PETSc.ScalarType, np.complexfloating):  # for which DOLFINx has no module
        cure = "install DOLFINx with real numbers, such as python3-dolfinx-real"
        raise RefusedError("PETSc", "built for complex numbers", "a build for real numbers", cure)
    import basix
    import basix.ufl
    import dolfinx
    import ufl
    from dolfinx import fem
    from dolfinx.fem import petsc

__all__ = [
    "MPI",
    "PETSc",
    "basix",
    "dolfinx",
    "fem",
    "petsc",
    "ufl",
]  # imported from here by others


JIT = {"cffi_extra_compile_args": ["-O3", "-ffast-math"], "timeout": 120}
"""Options of DOLFINx's compiler. The code is twice as fast as by its default -O2, and equal to
round-off. It waits as long, in s, for another process that compiles the same."""


@contextmanager
def _quiet() -> Iterator[None]:
    """Without the warning that UFL signs a form by its quadrature points, which print in full."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Applying str")
        yield


@_quiet()
def compiled(form: ufl.Form) -> fem.Form:
    """The form, compiled or from DOLFINx's cache."""
    return fem.form(form, jit_options=JIT)


@_quiet()
def at_points(value: Any, points: Array) -> fem.Expression:
    """A UFL expression, compiled, at `points` of the reference cell."""
    return fem.Expression(value, points, jit_options=JIT)


def mesh_of(comm: MPI.Intracomm, cells: Ints, nodes: int, element: Any) -> dolfinx.mesh.Mesh:
    """Return a DOLFINx mesh with all coordinates 0, to be set later.

    The cells are divided evenly among the ranks: rank r keeps the r-th part of them, in their
    order. All ranks call the function together.

    Args:
        comm: Communicator.
        cells: Nodes of all cells, the same on all ranks, in Basix's order, shape (cells, nodes of a
            cell).
        nodes: Number of nodes of the whole mesh.
        element: Coordinate element of UFL or Basix, whose reference value has the geometric
            dimension.
    """
    coordinates = np.zeros((nodes, element.reference_value_shape[0]))
    # Every rank knows the whole mesh and makes its own part, so that the partitioner sends no cell.
    rank_cells = np.array_split(cells, comm.size)[comm.rank]
    rank_coordinates = np.array_split(coordinates, comm.size)[comm.rank]

    def keep_on_rank(*_: object) -> object:
        """Return the graph that sends each cell of this rank to the rank itself.

        DOLFINx calls it with the communicator, the number of parts and the cells, which are not
        needed.
        """
        destinations = np.full((len(rank_cells), 1), comm.rank, np.int32)
        graph = dolfinx.graph.adjacencylist(destinations)
        return getattr(graph, "_cpp_object", graph)  # DOLFINx 0.9 has no Python class

    options = {"partitioner": keep_on_rank} if comm.size > 1 else {}
    return dolfinx.mesh.create_mesh(
        comm, cells=rank_cells, x=rank_coordinates, e=element, **options
    )


def option_is_used(name: str) -> bool:
    """Return whether PETSc has asked for an option since it was set.

    It is asked by PETSc's C library, since petsc4py 3.22 has no call for it.

    Args:
        name: Name of the option without its dash, such as "rve_ksp_type". Of one that is not set
            the answer is False.
    """
    interface = cffi.FFI()
    interface.cdef("int PetscOptionsUsed(void *options, const char *name, char *used);")
    # PetscBool is an enumeration or a C bool, by the version: 8 bytes hold either, and any byte
    # that is not 0 says true.
    used = interface.new("char[8]")
    library: Any = interface.dlopen(PETSc.__file__)
    library.PetscOptionsUsed(interface.NULL, name.encode(), used)
    return any(byte != b"\0" for byte in used)


def aij(matrix: sp.csr_matrix) -> PETSc.Mat:
    """Return a sparse PETSc matrix of this rank alone that shares the values of a SciPy one.

    Args:
        matrix: Matrix in compressed rows, whose column indices are sorted in each row. The result
            follows changes of its values in place.
    """
    # PETSc may be built for indices of 32 or of 64 bits; SciPy chooses by the size.
    indptr = np.asarray(matrix.indptr, PETSc.IntType)
    indices = np.asarray(matrix.indices, PETSc.IntType)
    csr = indptr, indices, matrix.data
    result = PETSc.Mat().createAIJWithArrays(matrix.shape, csr, comm=PETSc.COMM_SELF)
    result.assemble()
    return result


def columns(vectors: Array) -> PETSc.Mat:
    """Return a dense PETSc matrix of this rank alone whose columns are the rows of an array.

    PETSc stores a dense matrix column by column, which is the layout of the transpose of a
    C-contiguous array. The matrix of such an array has its values in the array itself, so that what
    PETSc writes appears there; of another array it has a copy.

    Args:
        vectors: Array of floats, shape (n, size).

    Returns:
        Assembled matrix of shape (size, n).
    """
    vectors = np.ascontiguousarray(vectors)
    result = PETSc.Mat().createDense(vectors.T.shape, array=vectors.T, comm=PETSc.COMM_SELF)
    result.assemble()
    return result


def cholesky(matrix: PETSc.Mat, prefix: str) -> PETSc.KSP:
    """Return a solver by the Cholesky factors of a matrix.

    The factors are by CHOLMOD, or by MUMPS where PETSc has been built without it; they are computed
    at the first solution.

    Args:
        matrix: Symmetric positive definite matrix; it is marked as such.
        prefix: Prefix of the PETSc options that override these settings.
    """
    # Positive definite matrices alone have a Cholesky factor: PETSc is told that this one is.
    matrix.setOption(PETSc.Mat.Option.SPD, True)
    ksp = PETSc.KSP().create(matrix.comm)
    ksp.setOptionsPrefix(prefix)
    ksp.setOperators(matrix)
    # The factors are the whole solution: no iteration follows them.
    ksp.setType("preonly")
    ksp.pc.setType("cholesky")
    library = "cholmod" if PETSc.Sys.hasExternalPackage("cholmod") else "mumps"
    ksp.pc.setFactorSolverType(library)
    # Last, so that options of the user override all of the above.
    ksp.setFromOptions()
    return ksp
