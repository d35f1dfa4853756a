"""Columns of numbers as CSV for other programs."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from alphacut.fuzzy.arrays import Array


def columns_text(columns: Mapping[str, Array]) -> str:
    """CSV of columns of one length by their titles, which state units; numbers in full."""
    lines = [",".join(f'"{title}"' if "," in title else title for title in columns)]
    rows = np.column_stack([np.asarray(column, float) for column in columns.values()])
    lines += [",".join(map(repr, row)) for row in rows.tolist()]
    return "\n".join(lines) + "\n"
