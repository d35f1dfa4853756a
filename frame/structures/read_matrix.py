"""Matrices of a frame program, from files of Matrix Market, NumPy, SciPy or CSV.

What a file states of itself is checked before memory is taken or a library sees it: sizes against
the unknowns and the memory that is free, indices against the shape, text against its alphabet.
"""

from __future__ import annotations

import re
from collections import Counter
from io import StringIO
from pathlib import Path

import numpy as np

from alphacut.base.array_files import ArrayArchive, Numbers, read_npy
from alphacut.base.arrays import Array
from alphacut.base.errors import RefusedError, path_of, printable, require
from alphacut.base.memory import require_free_memory, require_text
from alphacut.frame.structures.matrix_market import dense_of_entries, matrix_market, require_size

ENDINGS = (".mtx", ".npz", ".npy", ".csv")
ALLOWED = "a file .mtx, .npz, .npy or .csv with one array of finite real numbers"
OTHER_ENDINGS = {
    (".txt", ".dat", ".tsv", ".out", ".asc"): "rename a file of numbers alone to NAME.csv",
    (".mat",): "write it by numpy.save of an array of scipy.io.loadmat",
    (".xlsx", ".xls", ".ods"): "save the sheet as CSV, numbers alone",
    (".mm",): "rename a file of Matrix Market to NAME.mtx",
    (".pkl", ".pickle"): "write it by numpy.save",
}
"""What to do with files of other types."""
MAX_ROWS = 5000
"""Rows of the largest matrix where nothing else is said: it is dense here, and takes 200 MB."""
NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?|[-+]?(?:nan|inf)", re.IGNORECASE)
CURES_OF_CELLS = {
    r"[\[\]()]": "write numbers without brackets",
    r"\d,\d+[ \t]+[-+\d]": "write decimal points, or semicolons beside decimal commas",
    r"^\s*%%": "a file of Matrix Market is NAME.mtx",
    r",\s*(,|$)|;\s*(;|$)": "cells are empty: write 0, and nothing behind the last number",
    r"\d['’_]\d{3}": "write thousands without separators",
    r'"': "write numbers without quotes",
    r"\d\.?[dD][-+]?\d": "write 1e3 in place of 1D3",
    r"\d\s*[-+]?\s*\d*\.?\d*[ij]\b": "a matrix is real: damping has a matrix of its own",
    r"\d\s*(?:[kMG]?N|kg|t)\b": "matrices are in SI units: write numbers alone",
}
"""Cure of a row of a CSV file by a pattern in it; the first that fits."""
SPARSE = {"format", "shape", "data"}
"""Arrays in every file of `scipy.sparse.save_npz`."""


def read_matrix(path: str | Path, *, name: str = "", max_rows: int = MAX_ROWS) -> Array:
    """Read a matrix, as of masses or stiffnesses, from a file; a sparse one becomes dense.

    Args:
        path: File of Matrix Market (.mtx), of `scipy.sparse.save_npz` or `numpy.savez` (.npz), of
            `numpy.save` (.npy), or of numbers between commas, semicolons or blanks (.csv).
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
    file = path_of("path", path)
    if file.suffix.lower() not in ENDINGS:
        cures = (cure for kinds, cure in OTHER_ENDINGS.items() if file.suffix.lower() in kinds)
        raise RefusedError(file.name, f"of type {file.suffix or 'none'}", ALLOWED, next(cures, ""))
    try:
        array = _read_by_ending(file, name, max_rows=max_rows)
    except RefusedError:
        raise
    except Exception as error:  # whatever the readers of files, texts and archives raise
        reason = getattr(error, "strerror", None) or printable(error, 80) or type(error).__name__
        raise RefusedError(printable(file.name, 80), reason, ALLOWED) from None
    is_real, shape = array.dtype.kind in "uif", " × ".join(map(str, array.shape))
    require(is_real, file.name, value=f"an array of {array.dtype.name}", allowed=ALLOWED)
    is_matrix = array.ndim in (1, 2) and array.size > 0
    what = f"an array of {shape or 'no'} numbers"
    cure = "save two dimensions, as array[0] of three" if array.ndim > 2 else ""
    require(is_matrix, file.name, what, ALLOWED, cure)
    require_size(file.name, array.shape, max_rows)
    require_free_memory(file.name, 8.0 * array.size, f"{array.size} numbers")
    if not np.isfinite(array).all():
        place = np.argwhere(~np.isfinite(array))[0] + 1
        what = f"{array[tuple(place - 1)]} at " + ", ".join(
            f"{axis} {k}" for axis, k in zip(("row", "column"), place, strict=False)
        )
        raise RefusedError(file.name, what, ALLOWED, "write finite numbers there")
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
    return _read_csv(path.name, path.read_text(encoding="utf-8-sig"))


def _read_csv(name: str, text: str) -> Array:
    """Return the numbers of a text, shape (rows, columns).

    Commas part them, or semicolons, beside which commas are decimal ones, or blanks and tabs.

    Raises:
        RefusedError: A row has another text, or another count of numbers than the first.
    """
    require(bool(text.strip()), name, "", ALLOWED)
    delimiter: str | None = ","
    if ";" in text:
        delimiter, text = ";", text.replace(",", ".")
    elif "," not in text:
        delimiter = None
    try:
        return np.loadtxt(StringIO(text), delimiter=delimiter, ndmin=2)
    except ValueError:
        raise _wrong_row(name, text, delimiter) from None


def _wrong_row(name: str, text: str, delimiter: str | None) -> RefusedError:
    """Error about the first row of a text that is not of as many numbers as the first row is."""
    lines = {k: x for k, x in enumerate(text.splitlines(), 1) if x.partition("#")[0].strip()}
    counts = [len(line.partition("#")[0].split(delimiter)) for line in lines.values()]
    count, n_rows = Counter(counts).most_common(1)[0]
    if n_rows == 1:  # all rows differ
        count = counts[0]
    for number, line in lines.items():
        cells = [cell.strip() for cell in line.partition("#")[0].split(delimiter)]
        others = [cell for cell in cells if not NUMBER.fullmatch(cell)]
        if not others and len(cells) == count:
            continue
        cure = f"it has {len(cells)} numbers, and {n_rows} of {len(lines)} rows have {count}"
        if delimiter == "," and "." not in text:
            cure += "; if commas are decimal ones, part the numbers by semicolons"
        if others:
            fitting = (cure for pattern, cure in CURES_OF_CELLS.items() if re.search(pattern, line))
            cure = next(fitting, "a matrix has no head and no names of rows")
        key, allowed = f"{name}, line {number}", "rows of as many numbers, as 1.5,0,2e6"
        return RefusedError(key, line.strip()[:60], allowed, cure)
    return RefusedError(name, "no matrix", ALLOWED)


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
