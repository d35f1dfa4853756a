"""Matrices that Nastran writes: DMIG cards of punch and bulk files, and OUTPUT4 files (OP4).

pyYeti reads both. What it trusts of a file is checked here, before or behind its reading: it would
pass over cards whose names are damaged, end at the wrong column, and drop numbers in silence.
"""

from __future__ import annotations

import re
import warnings
from io import StringIO
from pathlib import Path
from typing import Literal

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import printable, require
from alphacut.base.extras import extra_named
from alphacut.frame.structures.entry_lists import (
    NamedMatrix,
    chosen_place,
    named_matrix,
    whole_numbers,
)
from alphacut.frame.structures.matrix_market import require_size

CURE = "let the program write the file anew"


def read_dmig(name: str, content: bytes, *, member: str, max_rows: int) -> NamedMatrix:
    """Return a matrix from the DMIG cards of a file, with unknowns GRID.COMPONENT, as "12.1".

    A symmetric matrix (form 6) has each entry once; a square one (form 1) has all. The component of
    a scalar point is 0. INCLUDE statements are not followed.

    Args:
        name: Name of the file, for messages.
        content: The text.
        member: Name of the matrix, as KAAX; may be empty where the file has one.
        max_rows: Largest number of unknowns.

    Raises:
        RefusedError: pyYeti is not installed; the file has no such matrix or several without a name
            to choose by; the matrix is rectangular or complex; the cards do not stand together, or
            are damaged; or the entries make no matrix (see `matrix_of_entries`).
        ValueError: A field of a card is no number.
    """
    with extra_named(name):
        from pyyeti.nastran.bulk import rdcards
    # A reader of cards passes over a card whose name is damaged, over continuations behind it, and
    # over the end of a cut number: the cards stand together, and what follows is another card. It
    # also leaves out what stands behind column 80, and reads 1_0 as 10.
    text = content.upper()
    found = re.search(rb"^DMIG[ ,*].*\n(?:(?:DMIG[ ,*]|[*+ ,$]).*\n)*", text, re.MULTILINE)
    cards_text = found[0] if found else b""
    behind = text[found.end() :] if found else b""
    cards = rdcards(StringIO(cards_text.decode("ascii", "replace")), "dmig", return_var="list")
    heads = [card for card in cards or () if card[1:2] == [0]]
    names = [str(head[0]) for head in heads]
    is_whole = re.match(rb"[A-Z]{3}|$", behind.lstrip()) is not None
    is_whole = is_whole and not re.search(rb"_|[^\s -~]|.{81}", cards_text)
    is_whole = is_whole and not any(x.encode() in behind for x in ("DMIG", *names))
    value = f"damaged at {printable(behind.decode('latin-1'), 40)!r}"
    require(is_whole, name, value, "DMIG cards one behind the other", CURE)
    head = heads[chosen_place(name, names, member)]
    is_real_square = head[2] in (1, 6) and head[3] in (1, 2)
    value = f"{head[0]} of form {head[2]}, type {head[3]}"
    require(is_real_square, name, value, "form 1 (square) or 6 (symmetric) and type 1 or 2 (real)")
    # Behind the column (G, C) and an empty field stand groups of four: row G, row C, the real part,
    # and the imaginary part, which real matrices leave empty.
    entries = [
        (*card[1:3], *card[k : k + 3])
        for card in cards
        if card[0] == head[0] and card is not head
        for k in range(4, max(len(card), 5), 4)
    ]
    table = np.array(entries, float).reshape(-1, 5)
    places = whole_numbers(name, table[:, :4]).reshape(-1, 2, 2)[:, ::-1]
    return named_matrix(name, places, table[:, 4], max_rows=max_rows, is_mirrored=head[2] == 6)


def read_op4(path: Path, content: bytes, *, member: str, max_rows: int) -> Array:
    """Return a matrix from a file of OUTPUT4, in text or binary, dense, shape (rows, columns).

    Args:
        path: The file.
        content: What it holds.
        member: Name of the matrix, as KAA; may be empty where the file has one.
        max_rows: Largest number of rows and of columns.

    Raises:
        RefusedError: pyYeti is not installed; the file has no such matrix or several without a name
            to choose by; the matrix is complex or too large; or numbers or records of the file are
            not those that were read.
        Exception: Whatever pyYeti raises for a damaged file.
    """
    name = path.name
    with extra_named(name):
        from pyyeti.nastran.op4 import OP4
    numbers: list[float] = []
    n_records = 0
    is_text = b"\0" not in content[:4]
    if is_text:
        # Numbers as -1.250000000000000E+01, whose digits take all the room that the head states.
        found = re.findall(rb"[-+]?\d\.\d+[DE][-+]\d+", content)
        numbers = [float(x.replace(b"D", b"E")) for x in found]
    else:
        n_records = _count_records(name, content)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # names that Python could not have are read all the same
        # Sparse ones take no memory for sizes that a damaged head states.
        names, matrices, _, types = OP4().listload(path, sparse=True)
    # Behind its last column a matrix has one more, in text with a number that is not returned. In
    # binary there are records of the sizes, of each column in use, and of the one more.
    read: list[float] = []
    for each in matrices:
        read.extend(each.data.view(float))  # of complex ones real and imaginary parts
        read.extend(numbers[len(read) : len(read) + 1])
        n_records -= 2 + len(np.unique(each.col))
    is_whole = read == numbers if is_text else n_records == 0
    require(is_whole, name, "of other numbers than its heads state", "a whole file", CURE)
    place = chosen_place(name, names, member)
    matrix = matrices[place]
    require(types[place] in (1, 2), name, f"with a complex {names[place]}", "real matrices")
    require_size(name, matrix.shape, max_rows)
    places = np.stack([matrix.row, matrix.col])
    is_once = np.unique(places, axis=1).size == places.size
    require(is_once, name, "with two entries at one place", "one entry at each place", CURE)
    return np.asarray(matrix.toarray())


def _count_records(name: str, content: bytes) -> int:
    """Return the number of records of a binary file, each between two words of its length.

    Args:
        name: Name of the file, for the message.
        content: The file. Its first record has 24 or 48 bytes, which tells the order of bytes.

    Raises:
        RefusedError: A record is cut off, or the words before and behind it differ.
    """
    order: Literal["little", "big"] = "little"
    if int.from_bytes(content[:4], "little") not in (24, 48):
        order = "big"
    place = 0
    n_records = 0
    while place < len(content):
        word = content[place : place + 4]
        place += 8 + int.from_bytes(word, order)
        is_whole = place <= len(content) and content[place - 4 : place] == word
        require(is_whole, name, f"cut off or damaged in record {n_records + 1}", "whole", CURE)
        n_records += 1
    return n_records
