"""Matrices of a frame program, from files of Matrix Market, NumPy, SciPy or CSV.

What a file states of itself is checked before memory is taken or a library sees it: sizes against
the unknowns and the memory that is free, indices against the shape, text against its alphabet.
"""

from __future__ import annotations

from io import StringIO
from pathlib import Path

import numpy as np

from alphacut.base.array_files import ArrayArchive, Numbers, read_npy
from alphacut.base.arrays import Array
from alphacut.base.errors import RefusedError, printable, require
from alphacut.base.memory import require_free_memory, require_text
from alphacut.frame.structures.matrix_market import dense_of_entries, matrix_market, require_size

ENDINGS = (".mtx", ".npz", ".npy", ".csv")
ALLOWED = "a file .mtx, .npz, .npy or .csv with one array of finite real numbers"
MAX_ROWS = 5000
"""Rows of the largest matrix where nothing else is said: it is dense here, and takes 200 MB."""
SPARSE = {"format", "shape", "data"}
"""Arrays in every file of `scipy.sparse.save_npz`."""


def read_matrix(path: str | Path, *, name: str = "", max_rows: int = MAX_ROWS) -> Array:
    """Read a matrix, as of masses or stiffnesses, from a file; a sparse one becomes dense.

    Args:
        path: File of Matrix Market (.mtx), of `scipy.sparse.save_npz` or `numpy.savez` (.npz), of
            `numpy.save` (.npy), or of numbers between commas (.csv).
        name: Name of the array in a .npz file of several.
        max_rows: Largest number of rows and of columns, as the number of unknowns.

    Returns:
        The matrix, shape (n, m); or a vector, shape (n,), where the file has one.

    Raises:
        RefusedError: The file cannot be read, holds something else, or more than allowed.

    Example:
        >>> read_matrix("cases/plane-frame/stiffness1.mtx").shape
        (18, 18)
    """
    file = Path(path)
    if file.suffix.lower() not in ENDINGS:
        raise RefusedError(file.name, f"of type {file.suffix or 'none'}", ALLOWED)
    try:
        array = _read_by_ending(file, name, max_rows=max_rows)
    except RefusedError:
        raise
    except Exception as error:  # whatever the readers of files, texts and archives raise
        reason = printable(error, 80) or type(error).__name__
        raise RefusedError(file.name, reason, ALLOWED) from None
    is_real = array.dtype.kind in "uif" and array.ndim in (1, 2) and array.size > 0
    require(is_real, file.name, value="no such array", allowed=ALLOWED)
    require_size(file.name, array.shape, max_rows)
    require_free_memory(file.name, 8.0 * array.size, f"{array.size} numbers")
    require(np.isfinite(array).all(), file.name, value="no such array", allowed=ALLOWED)
    return np.array(array, float)


def _read_by_ending(path: Path, name: str, *, max_rows: int) -> Numbers:
    """Return the array in a file; `name` chooses one of several in a .npz file."""
    kind = path.suffix.lower()
    if kind == ".npy":
        return read_npy(path)
    if kind == ".npz":
        return _read_archive(ArrayArchive(path), name, max_rows=max_rows)
    require_text(path)
    if kind == ".mtx":
        return matrix_market(path.name, path.read_bytes(), max_rows=max_rows)
    text = path.read_text(encoding="utf-8-sig")
    return np.loadtxt(StringIO(text), delimiter=",", ndmin=2)


def _read_archive(archive: ArrayArchive, name: str, *, max_rows: int) -> Numbers:
    """Return the sparse matrix of a .npz file, dense; else its array of that name, or the only."""
    names = archive.names
    if set(names) >= SPARSE:
        return _read_sparse(archive, max_rows=max_rows)
    chosen = [x for x in names if not name or x == name]
    if len(chosen) != 1:
        what, file_name = f"array {name or 'not named'}", archive.path.name
        raise RefusedError(file_name, what, f"{file_name}:NAME, one of {', '.join(names)}")
    return archive.read(chosen[0])


def _read_sparse(archive: ArrayArchive, *, max_rows: int) -> Array:
    """Return the matrix of a file of `scipy.sparse.save_npz` by the indices of its entries."""
    name = archive.path.name
    letters = archive.read("format", kinds="SU").item()
    form = letters.decode("latin-1") if isinstance(letters, bytes) else str(letters)
    shape = tuple(int(n) for n in archive.read("shape", kinds="iu"))
    require(len(shape) == 2, name, f"of shape {shape}", "rows and columns")
    require_size(name, shape, max_rows)
    data = np.asarray(archive.read("data", kinds="iuf"), float)

    def indices(key: str) -> Array:
        return np.asarray(archive.read(key, kinds="iu"), float)

    def entries(rows: Array, columns: Array, values: Array) -> Array:
        n_rows, n_columns = shape
        return dense_of_entries(
            name, (n_rows, n_columns), rows=rows, columns=columns, values=values
        )

    if form == "coo":
        rows, columns = indices("row"), indices("col")
        fit = rows.shape == columns.shape == data.shape and data.ndim == 1
        require(fit, name, "of arrays of different lengths", ALLOWED)
        return entries(rows, columns, data)
    if form == "dia":
        offsets = indices("offsets")
        fit = data.ndim == 2 and offsets.shape == (len(data),)
        require(fit, name, "of arrays of different lengths", ALLOWED)
        # the diagonal of offset k has entry j of its data in row j − k and column j
        columns = np.broadcast_to(np.arange(data.shape[1], dtype=float), data.shape)
        rows = columns - offsets[:, None]
        is_inside = (rows >= 0) & (rows < shape[0]) & (columns < shape[1])
        return entries(rows[is_inside], columns[is_inside], data[is_inside])
    require(
        form in ("csr", "csc", "bsr"), name, f"sparse of form {form}", "csr, csc, coo, bsr, dia"
    )
    first, second = _compressed_indices(name, indices("indptr"), indices("indices"), len(data))
    if form == "csc":
        first, second = second, first
    if form != "bsr":
        require(data.ndim == 1, name, "of arrays of different lengths", ALLOWED)
        return entries(first, second, data)
    require(data.ndim == 3, name, "of blocks without two sides", ALLOWED)
    _, n_rows, n_columns = data.shape
    rows = first[:, None, None] * n_rows + np.arange(n_rows)[:, None]
    columns = second[:, None, None] * n_columns + np.arange(n_columns)
    rows, columns = np.broadcast_to(rows, data.shape), np.broadcast_to(columns, data.shape)
    return entries(rows.ravel(), columns.ravel(), data.ravel())


def _compressed_indices(
    name: str, pointers: Array, indices: Array, n_entries: int
) -> tuple[Array, Array]:
    """Return compressed and stored index of each entry of a compressed sparse matrix.

    Row k of a matrix by rows has the entries from pointers[k] up to pointers[k + 1].

    Raises:
        RefusedError: The pointers do not rise from 0 to the number of entries.
    """
    fit = pointers.ndim == indices.ndim == 1 and len(indices) == n_entries and len(pointers) > 0
    counts = np.diff(pointers) if fit else np.empty(0)
    fit = fit and pointers[0] == 0 and pointers[-1] == n_entries and bool((counts >= 0).all())
    require(fit, name, "of pointers that do not rise from 0 to the entries", ALLOWED)
    compressed = np.repeat(np.arange(len(counts), dtype=float), counts.astype(int))
    return compressed, indices
