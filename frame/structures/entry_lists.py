"""Matrices that Abaqus and CalculiX write as lists of entries, with the names of their unknowns.

Each line has a place and a value. Abaqus (*MATRIX OUTPUT) gives the place as row node, direction,
column node, direction (formats MATRIX INPUT and LABELS), or as row and column (COORDINATE), between
commas or blanks. CalculiX (*FREQUENCY, SOLVER=MATRIXSTORAGE) gives row and column, and the node and
direction of each row in a file .dof beside.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from alphacut.base.array_files import Numbers
from alphacut.base.arrays import Array, Ints
from alphacut.base.errors import RefusedError, require
from alphacut.base.memory import require_free_memory, require_text
from alphacut.frame.structures.matrix_market import numbers_in, require_last_line, require_size


class NamedMatrix(NamedTuple):
    """A matrix and the names of its rows, which are empty where a file has none."""

    array: Numbers
    unknowns: tuple[str, ...] = ()


def read_abaqus(name: str, content: bytes, *, max_rows: int) -> NamedMatrix:
    """Return a matrix from the text of a file of Abaqus, with unknowns NODE.DIRECTION.

    Of the symmetric matrix the file has one triangle or both; both are returned. Unknowns are
    sorted by node and direction, which are those of Abaqus: "12.1" is node 12 along 1. Nodes below
    0 are internal ones of Abaqus. A file of format COORDINATE names no unknowns.

    Args:
        name: Name of the file, for messages.
        content: The text.
        max_rows: Largest number of unknowns.

    Raises:
        RefusedError: A line is no list of 3 or 5 numbers as the first one is, or its place is not
            of whole numbers; or the entries make no symmetric matrix (see `matrix_of_entries`).
    """
    # Lines with two asterisks are comments. One asterisk begins the keyword of another file.
    lines = [x for x in content.splitlines() if x.strip() and not x.startswith(b"**")]
    table = _table(name, lines, widths=(3, 5))
    places = whole_numbers(name, table[:, :-1])
    if places.shape[1] == 2:
        array = matrix_of_entries(name, places - 1, table[:, -1], max_rows=max_rows)
        return NamedMatrix(array)
    return named_matrix(name, places.reshape(-1, 2, 2), table[:, -1], max_rows=max_rows)


def read_calculix(path: Path, content: bytes, *, max_rows: int) -> NamedMatrix:
    """Return the matrix in a file .sti or .mas of CalculiX, with unknowns as in the file .dof.

    The file has the upper triangle; both are returned. Without a file of the same name that ends in
    .dof beside it, the unknowns have no names.

    Args:
        path: The file.
        content: Its text.
        max_rows: Largest number of unknowns.

    Raises:
        RefusedError: A line is not of row, column and value; the entries make no symmetric matrix;
            or the file .dof has other lines than NODE.DIRECTION, or not one for each row, or its
            last line does not end.
        OSError: The file .dof cannot be read.
    """
    lines = [line for line in content.splitlines() if line.strip()]
    table = _table(path.name, lines, widths=(3,))
    places = whole_numbers(path.name, table[:, :-1])
    array = matrix_of_entries(path.name, places - 1, table[:, -1], max_rows=max_rows)
    beside = path.with_suffix(".dof")
    if not beside.exists():
        return NamedMatrix(array)
    require_text(beside)
    text = beside.read_bytes()
    require_last_line(beside.name, text)
    unknowns = tuple(text.decode("ascii", "replace").split())
    for line, unknown in enumerate(unknowns, 1):
        is_name = re.fullmatch(r"-?\d+\.\d+", unknown)
        allowed = "NODE.DIRECTION, as 12.1"
        require(is_name is not None, f"{beside.name}, line {line}", unknown, allowed)
    cure = "take the files of one run"
    allowed = f"{len(array)} names, one for each row of {path.name}"
    value = f"of {len(set(unknowns))} names in {len(unknowns)} lines"
    fits = len(set(unknowns)) == len(unknowns) == len(array)
    require(fits, beside.name, value, allowed, cure)
    return NamedMatrix(array, unknowns)


def named_matrix(
    name: str, places: Ints, values: Array, *, max_rows: int, is_mirrored: bool = True
) -> NamedMatrix:
    """Return the matrix of entries that are given by node and direction.

    Args:
        name: Name of the file, for messages.
        places: Node and direction of row and of column, shape (entries, 2, 2).
        values: Shape (entries,).
        max_rows: Largest number of unknowns.
        is_mirrored: Whether entries of one triangle stand for both.

    Returns:
        The matrix; its unknowns NODE.DIRECTION are sorted by node and direction.

    Raises:
        RefusedError: As `matrix_of_entries` does.
    """
    pairs, indices = np.unique(places.reshape(-1, 2), axis=0, return_inverse=True)
    unknowns = tuple(f"{pair[0]}.{pair[1]}" for pair in pairs)
    array = matrix_of_entries(
        name,
        indices.reshape(-1, 2),
        values,
        max_rows=max_rows,
        names=unknowns,
        is_mirrored=is_mirrored,
    )
    return NamedMatrix(array, unknowns)


def chosen_place(file: str, names: Sequence[str], member: str) -> int:
    """Return the place of the matrix of a file that is named, or of the only one without a name.

    Args:
        file: Name of the file, for the message.
        names: Names of its matrices.
        member: The name, in large or small letters; may be empty.

    Raises:
        RefusedError: There is no such matrix, or several of this name or without a name.
    """
    places = [k for k, x in enumerate(names) if not member or x.lower() == member.lower()]
    what = f"with {len(places)} matrices {member}".rstrip()
    require(len(places) == 1, file, what, f"{file}:NAME, one of {', '.join(names)}")
    return places[0]


def matrix_of_entries(
    name: str,
    places: Ints,
    values: Array,
    *,
    max_rows: int,
    names: tuple[str, ...] = (),
    is_mirrored: bool = True,
) -> Array:
    """Return a dense matrix of entries, shape (n, n), where n − 1 is the largest index.

    Args:
        name: Name of the file, for messages.
        places: Row and column of each entry, counted from 0, shape (entries, 2).
        values: Shape (entries,).
        max_rows: Largest number of rows.
        names: Names of the rows, for messages; their numbers, from 1, where empty.
        is_mirrored: Whether entries of one triangle stand for both. Which triangle is told by the
            order of the program's own equations, so that each pair is looked at by itself.

    Raises:
        RefusedError: There are no entries, or more rows than allowed; an index is negative; a place
            has two entries; a row has entries but none on the diagonal, so that the matrix is
            neither of masses nor of stiffnesses; or some pairs of places [i, j] and [j, i] have two
            entries and others one.
    """
    require(len(values) > 0, name, "", "entries, as 3 1 -2.5e6")
    cure = "rows count from 1"
    require(int(places.min()) >= 0, name, f"row or column {places.min() + 1}", "1 or more", cure)
    size = int(places.max()) + 1
    require_size(name, (size, size), max_rows)
    require_free_memory(name, 10.0 * size**2, f"a matrix of {size} rows")

    labels = names or tuple(map(str, range(1, size + 1)))
    rows, columns = places.T
    flat, repeats = np.unique(rows * size + columns, return_counts=True)
    row, column = divmod(int(flat[repeats.argmax()]), size)
    value = f"with {repeats.max()} entries at [{labels[row]}, {labels[column]}]"
    cure = "mend the place of one, or write the matrix anew"
    require(bool(repeats.max() == 1), name, value, "one entry at each place", cure)
    counts = np.zeros((size, size), np.int8)
    counts[rows, columns] = 1
    is_bare = (counts | counts.T).any(axis=0) & (counts.diagonal() == 0)
    label = labels[int(is_bare.argmax())]
    value = f"without [{label}, {label}]"
    require(not is_bare.any(), name, value, "a diagonal entry in each row in use")
    array = np.zeros((size, size))
    array[rows, columns] = values
    n_single = int((counts != counts.T).sum()) // 2
    n_off_diagonal = len(values) - int(counts.diagonal().sum())
    if not is_mirrored or n_single == 0:
        return array
    value = f"with one triangle at {n_single} places, both at others"
    cure = "write a symmetric matrix, by one triangle or both"
    require(n_single == n_off_diagonal, name, value, "one triangle, or two alike", cure)
    return np.where(counts == 1, array, array.T)


def _table(name: str, lines: list[bytes], widths: tuple[int, ...]) -> Array:
    """Return the numbers of lines, between commas or blanks, shape (lines, numbers in each).

    Args:
        name: Name of the file, for messages.
        lines: All of them have as many numbers as the first.
        widths: How many these may be.

    Raises:
        RefusedError: There are no lines, or a line has another count or something else.
    """
    counts = [len(line.replace(b",", b" ").split()) for line in lines]
    require(bool(counts), name, "", "lines of entries, as 12,1, 12,2, -2.5e6")
    width = counts[0] if counts[0] in widths else widths[-1]
    allowed = f"{width} numbers, as the other lines"
    for count, line in zip(counts, lines, strict=True):
        if count != width:
            text = line[:60].strip().decode("latin-1")
            cure = "mend this line, or write the matrix anew"
            if text.startswith("*"):
                cure = "take the file that *MATRIX OUTPUT writes, as JOB_STIF1.mtx"
            raise RefusedError(name, f"with the line {text!r}", allowed, cure)
    return numbers_in(name, b"\n".join(lines).replace(b",", b" ")).reshape(-1, width)


def whole_numbers(name: str, numbers: Array) -> Ints:
    """Return numbers as integers; refuse others than whole ones of up to nine digits."""
    is_whole = (numbers == np.floor(numbers)) & (np.abs(numbers) < 1e9)
    if not is_whole.all():
        wrong = numbers[~is_whole][0]
        cure = "mend this number, or write the matrix anew"
        raise RefusedError(name, f"with row, column or node {wrong:g}", "whole numbers", cure)
    return numbers.astype(np.intp)
