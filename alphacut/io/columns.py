"""Columns of numbers as CSV for other programs, and tables of texts for people."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from alphacut.fuzzy.arrays import Array

ISOTROPIC = "Hashin–Shtrikman bounds of an isotropic E"


def columns_text(columns: Mapping[str, Array]) -> str:
    """CSV of columns of one length by their titles, which state units; numbers in full."""
    lines = [",".join(f'"{title}"' if "," in title else title for title in columns)]
    rows = np.column_stack([np.asarray(column, float) for column in columns.values()])
    lines += [",".join(map(repr, row)) for row in rows.tolist()]
    return "\n".join(lines) + "\n"


def text_table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Lines of a table: the first column to the left, the others to the right.

    Args:
        head: Titles of the n columns.
        rows: Each of n cells.
    """
    lines = [[*head], *map(list, rows)]
    first, *further_widths = (max(len(line[k]) for line in lines) for k in range(len(head)))
    aligned = ([line[0].ljust(first), *map(str.rjust, line[1:], further_widths)] for line in lines)
    return "".join(f"{'  '.join(line).rstrip()}\n" for line in aligned)


def fibre_label(key: str) -> str:
    """Label of a constant of fibres: nu_LT as ν_LT, E_T_GPa as E_T, GPa."""
    return key.replace("nu", "ν").replace("_GPa", ", GPa")
