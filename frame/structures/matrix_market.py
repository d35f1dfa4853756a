"""Matrices in files of Matrix Market, read without compiled code.

The format (Boisvert, Pozo, Remington 1996): a line with kinds, comments that begin with %, a line
of sizes, and entries, of which a symmetric matrix has only one triangle.
"""

from __future__ import annotations

import re

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import RefusedError, require

ALLOWED = (
    "%%MatrixMarket matrix coordinate or array, real, integer or pattern, general or symmetric"
)
HEAD = re.compile(
    rb"%%MatrixMarket\s+matrix\s+(coordinate|array)\s+(real|double|integer|pattern)\s+"
    rb"(general|symmetric|skew-symmetric)\s*",
    re.IGNORECASE,
)
NO_NUMBER = re.compile(rb"[^-+.0-9eE\s]")
"""A letter that numbers and blanks do not have."""
MIRRORED = {"general": 0.0, "symmetric": 1.0, "skew-symmetric": -1.0}
"""Factor of an entry below the diagonal that the entry across the diagonal is."""


def matrix_market(name: str, content: bytes, *, max_rows: int) -> Array:
    """Return the matrix in the text of a Matrix Market file, dense, shape (rows, columns).

    Args:
        name: Name of the file, for messages.
        content: The text.
        max_rows: Largest number of rows and of columns.

    Raises:
        RefusedError: The text is not of the format, of complex numbers, has an index outside the
            matrix, another number of entries than it states, or more rows or columns than allowed.
    """
    lines = [line for line in content.splitlines() if line.strip()]
    match = HEAD.fullmatch(lines[0]) if lines else None
    if match is None:
        first = lines[0][:60].decode("latin-1") if lines else "empty"
        cure = "mend or write the first line, as %%MatrixMarket matrix coordinate real symmetric"
        raise RefusedError(name, first, ALLOWED, cure)
    layout, kind, symmetry = (word.decode().lower() for word in match.groups())
    body = [line for line in lines[1:] if not line.lstrip().startswith(b"%")]
    text = b"\n".join(body)
    if found := NO_NUMBER.search(text):
        row = text[: found.start()].count(b"\n")
        value = f"with {body[row][:40].decode('latin-1')!r}"
        cures = {b",": "write decimal points", b"d": "write 1e3 in place of 1D3"}
        cure = cures.get(found[0].lower(), "mend this line, or load the file anew")
        raise RefusedError(name, value, "numbers such as 1.25 or 1e-3", cure)
    sizes = _numbers(name, body[0]) if body else np.empty(0)
    entries = _numbers(name, b" ".join(body[1:]))
    is_sparse = layout == "coordinate"
    n_sizes = 3 if is_sparse else 2
    are_sizes = len(sizes) == n_sizes and bool(((sizes >= 0) & (sizes == np.floor(sizes))).all())
    cure = "the line of sizes is as 18 18 42 for 18 rows, 18 columns and 42 entries"
    if not is_sparse:
        cure = "the line of sizes of an array is as 18 18 for 18 rows and 18 columns"
    require(are_sizes, name, f"sizes {sizes.tolist()}", f"{n_sizes} whole numbers", cure)
    require_size(name, (int(min(sizes[0], 1e18)), int(min(sizes[1], 1e18))), max_rows)
    shape = int(sizes[0]), int(sizes[1])
    mirrored = MIRRORED[symmetry]
    is_square = shape[0] == shape[1] or not mirrored
    value = f"{symmetry}, {shape[0]} × {shape[1]}"
    require(is_square, name, value, "a square matrix", "mend the line of sizes, as 18 18 42")
    if not is_sparse:
        require(kind != "pattern", name, "an array of a pattern", ALLOWED)
        return _dense(name, entries, shape, symmetry=symmetry)
    columns = 2 if kind == "pattern" else 3
    value = f"of {len(entries) / columns:g} entries, where its line of sizes states {sizes[2]:.0f}"
    cure = "mend the last number of the line of sizes, or load the file anew"
    is_complete = len(entries) == columns * sizes[2]
    require(is_complete, name, value, f"entries of {columns} numbers, as many as stated", cure)
    table = entries.reshape(-1, columns)
    values = table[:, 2] if columns == 3 else np.ones(len(table))
    rows, cols = table[:, 0] - 1, table[:, 1] - 1
    matrix = dense_of_entries(name, shape, rows=rows, columns=cols, values=values)
    if mirrored:
        is_beside = rows != cols
        both = np.intersect1d(
            rows[is_beside] * shape[0] + cols[is_beside],
            cols[is_beside] * shape[0] + rows[is_beside],
        )
        value = f"{symmetry}, with entries on both sides of the diagonal"
        cure = "write general in the first line, or leave one triangle out"
        require(both.size == 0, name, value, "one triangle of a symmetric matrix", cure)
        matrix += dense_of_entries(
            name,
            shape,
            rows=cols[is_beside],
            columns=rows[is_beside],
            values=mirrored * values[is_beside],
        )
    return matrix


def require_size(name: str, shape: tuple[int, ...], max_rows: int) -> None:
    """Refuse a matrix with a side of 0 or of more than `max_rows`."""
    fits = all(0 < n <= max_rows for n in shape)
    allowed = f"up to {max_rows} rows and columns"
    cure = "a matrix has a row and a column for each unknown, without heads or numbers of rows"
    require(fits, name, " × ".join(map(str, shape)), allowed, cure)


def dense_of_entries(
    name: str, shape: tuple[int, int], *, rows: Array, columns: Array, values: Array
) -> Array:
    """Return the dense matrix of a sparse one's entries; those of one place are added.

    Args:
        name: Name of the file, for messages.
        shape: Rows and columns.
        rows: Row of each entry, counted from 0, shape (entries,).
        columns: Column of each entry, the same shape.
        values: The entries.

    Raises:
        RefusedError: An index is no whole number inside the shape.
    """
    for axis, indices in enumerate((rows, columns)):
        is_inside = (indices >= 0) & (indices < shape[axis]) & (indices == np.floor(indices))
        if not is_inside.all():
            wrong = indices[int(np.argmin(is_inside))]
            value = f"index {wrong + 1:g} of {'rows' if axis == 0 else 'columns'}, counted from 1"
            cure = f"the file states {shape[0]} × {shape[1]}: mend the line of sizes, or the index"
            if wrong == -1:
                cure = "indices that count from 0 need 1 added to each"
            raise RefusedError(name, value, f"whole numbers from 1 to {shape[axis]}", cure)
    matrix = np.zeros(shape)
    np.add.at(matrix, (rows.astype(int), columns.astype(int)), values)
    return matrix


def _numbers(name: str, text: bytes) -> Array:
    """The numbers in a text whose letters are those of numbers; refuses words such as 1e or 1-2."""
    try:
        return np.array(text.split(), float)
    except ValueError as error:
        raise RefusedError(name, f"with {error}", "numbers such as 1.25 or 1e-3") from None


def _dense(name: str, entries: Array, shape: tuple[int, int], *, symmetry: str) -> Array:
    """The matrix whose entries follow one another by columns, of one triangle if symmetric."""
    n_rows, n_columns = shape
    if symmetry == "general":
        value = f"{len(entries)} numbers"
        require(len(entries) == n_rows * n_columns, name, value, f"{n_rows * n_columns}")
        return entries.reshape(n_columns, n_rows).T.copy()
    diagonal = 0 if symmetry == "symmetric" else 1
    # the lower triangle by columns is the upper one by rows
    columns, rows = np.triu_indices(n_rows, diagonal)
    require(len(entries) == len(rows), name, f"{len(entries)} numbers", f"{len(rows)}")
    matrix = np.zeros(shape)
    matrix[columns, rows] = MIRRORED[symmetry] * entries
    matrix[rows, columns] = entries
    return matrix
