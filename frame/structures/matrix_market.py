"""Matrices in files of Matrix Market, read without compiled code.

The format (Boisvert, Pozo, Remington 1996): a line with kinds, comments that begin with %, a line
of sizes, and entries, of which a symmetric matrix has only one triangle.
"""

from __future__ import annotations

import re

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import RefusedError, require


def matrix_market(name: str, content: bytes, *, max_rows: int) -> Array:
    """Return the matrix in the text of a Matrix Market file, dense, shape (rows, columns).

    Of a symmetric matrix the file has one triangle, and both are returned. Entries of one place are
    added. Patterns and skew-symmetric matrices are refused: no mass, damping or stiffness is of
    these.

    Args:
        name: Name of the file, for messages.
        content: The text.
        max_rows: Largest number of rows and of columns.

    Raises:
        RefusedError: The text is not of the format, or of complex numbers; it has words that are no
            numbers, an index outside the matrix, or another number of entries than it states; a
            matrix that it calls symmetric is not square, or has entries on both sides of the
            diagonal; or there are no rows, or more rows or columns than allowed.
    """
    # SciPy's reader takes 1.5 for the index 1 and the value .5, and 5.0x for 5: so it is read here.
    lines = [line for line in content.splitlines() if line.strip()]
    head = rb"(?i)%%MatrixMarket\s+matrix\s+(coordinate|array)\s+(?:real|double|integer)\s+"
    match = re.fullmatch(head + rb"(general|symmetric)\s*", lines[0]) if lines else None
    if match is None:
        first = lines[0][:60].decode("latin-1") if lines else "empty"
        allowed = "%%MatrixMarket matrix coordinate or array, real or integer, general or symmetric"
        raise RefusedError(name, first, allowed, "mend or write the first line")
    is_sparse = match[1].lower() == b"coordinate"
    is_symmetric = match[2].lower() == b"symmetric"
    sizes_line, *body = [x for x in lines[1:] if not x.lstrip().startswith(b"%")] or [b""]
    sizes = numbers_in(name, sizes_line)
    n_sizes = 3 if is_sparse else 2
    cure = "the line of sizes has rows, columns, and the entries of a sparse matrix, as 18 18 42"
    are_sizes = len(sizes) == n_sizes and bool(((sizes >= 0) & (sizes == np.floor(sizes))).all())
    require(are_sizes, name, f"sizes {sizes.tolist()}", f"{n_sizes} whole numbers", cure)
    # A size beyond 64 bits stays one that is too large. Numbers were read as floats, and NumPy's
    # integers would wrap around.
    shape = int(min(sizes[0], 1e18)), int(min(sizes[1], 1e18))
    require_size(name, shape, max_rows)
    value = f"symmetric, {shape[0]} × {shape[1]}"
    is_square = shape[0] == shape[1] or not is_symmetric
    require(is_square, name, value, "a square matrix", "mend the line of sizes, as 18 18 42")

    entries = numbers_in(name, b"\n".join(body))
    if not is_sparse:
        return _by_columns(name, entries, shape, is_symmetric=is_symmetric)
    value = f"of {len(entries) / 3:g} entries, where its line of sizes states {sizes[2]:.0f}"
    cure = "mend the last number of the line of sizes, or load the file anew"
    is_complete = len(entries) == 3 * sizes[2]
    require(is_complete, name, value, "entries of 3 numbers, as many as stated", cure)
    rows, columns, values = entries.reshape(-1, 3).T
    matrix = dense_of_entries(name, shape, rows=rows - 1, columns=columns - 1, values=values)
    if is_symmetric:
        # The format asks for the lower triangle; programs that write the upper one are read, too.
        lower = np.tril(matrix, -1)
        upper = np.triu(matrix, 1)
        has_both = bool(((lower != 0) & (upper.T != 0)).any())
        cure = "write general in the first line, or leave one triangle out"
        value = "symmetric, with entries on both sides of the diagonal"
        require(not has_both, name, value, "one triangle of a symmetric matrix", cure)
        matrix += lower.T + upper.T
    return matrix


def require_last_line(name: str, content: bytes) -> None:
    """Raise RefusedError for a text whose last line does not end, as of a file that is cut off.

    Programs end each line with a line feed. A number that is cut off may be read as another one,
    such as 6.0e+0 of 6.0e+06, and nothing else tells that digits are missing. An empty text passes.

    Args:
        name: Name of the file, for the message.
        content: The text.
    """
    is_whole = not content or content.endswith(b"\n")
    cure = "load it anew if it was cut off; if it was written by hand, end it with a line feed"
    allowed = "a last line that ends with a line feed"
    value = f"cut off at {content[-60:].splitlines()[-1].decode('latin-1')!r}" if content else ""
    require(is_whole, name, value, allowed, cure)


def require_size(name: str, shape: tuple[int, ...], max_rows: int) -> None:
    """Raise RefusedError if a side of an array is 0 or above `max_rows`."""
    fits = all(0 < n <= max_rows for n in shape)
    allowed = f"up to {max_rows} rows and columns"
    cure = "a matrix has a row and a column for each unknown, without heads or numbers of rows"
    require(fits, name, " × ".join(map(str, shape)), allowed, cure)


def dense_of_entries(
    name: str, shape: tuple[int, int], *, rows: Array, columns: Array, values: Array
) -> Array:
    """Return the dense matrix of a sparse matrix's entries; entries of the same place are added.

    Args:
        name: Name of the file, for messages.
        shape: Rows and columns.
        rows: Row of each entry, counted from 0, shape (entries,).
        columns: Column of each entry, the same shape.
        values: The entries.

    Raises:
        RefusedError: An index is no whole number inside the shape.
    """
    places = np.stack([rows, columns])
    is_whole = (places >= 0) & (places == np.floor(places))
    is_inside = (is_whole & (places < np.reshape(shape, (2, 1)))).all(axis=0)
    if not is_inside.all():
        row, column = places[:, int(is_inside.argmin())] + 1
        cure = f"the file states {shape[0]} × {shape[1]}: mend the line of sizes, or the entry"
        allowed = "rows and columns inside, counted from 1"
        raise RefusedError(name, f"with an entry at [{row:g}, {column:g}]", allowed, cure)
    # An assignment by indices would keep the last of several entries of one place; finite-element
    # programs write one entry for each element there.
    matrix = np.zeros(shape)
    np.add.at(matrix, (rows.astype(int), columns.astype(int)), values)
    return matrix


def numbers_in(name: str, text: bytes) -> Array:
    """Return the numbers in a text, shape (numbers,), in which blanks separate them.

    A number beyond the range of floats gives infinity.

    Raises:
        RefusedError: A word is no number in plain digits with points and e, such as 1e, 5D3 or nan.
    """
    cure = "mend this word"
    if wrong := re.search(rb"[^-+.0-9eE\s]", text):
        around = text[max(wrong.start() - 20, 0) : wrong.end() + 20].decode("latin-1")
        raise RefusedError(name, f"with {around!r}", "numbers such as 1.25 or 1e-3", cure)
    try:
        return np.array(text.split(), float)
    except ValueError as error:
        raise RefusedError(name, f"with {error}", "numbers such as 1.25 or 1e-3", cure) from None


def _by_columns(name: str, entries: Array, shape: tuple[int, int], *, is_symmetric: bool) -> Array:
    """Return a dense matrix whose entries follow one another column by column, from the top.

    Args:
        name: Name of the file, for the message.
        entries: The entries, shape (entries,); of a symmetric matrix those of its lower triangle
            with the diagonal, whose column k begins in row k.
        shape: Rows and columns; equal ones of a symmetric matrix.
        is_symmetric: Whether it is symmetric; both triangles are then returned.

    Raises:
        RefusedError: There are more or fewer entries than the shape has.
    """
    n_rows, n_columns = shape
    expected = n_rows * n_columns
    if is_symmetric:
        expected = n_rows * (n_rows + 1) // 2
    require(len(entries) == expected, name, f"{len(entries)} numbers", f"{expected}")
    if not is_symmetric:
        return entries.reshape(n_columns, n_rows).T.copy()
    # The lower triangle by columns is the upper one by rows, whose indices NumPy gives in this
    # order.
    columns, rows = np.triu_indices(n_rows)
    matrix = np.zeros(shape)
    matrix[columns, rows] = entries
    matrix[rows, columns] = entries
    return matrix
