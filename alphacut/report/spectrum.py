"""Response spectrum of a record, from the files that `alphacut spectrum --out` has written."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
from markupsafe import Markup

from alphacut.figures.captions import caption
from alphacut.io.problem import BadInput, Problem
from alphacut.io.provenance import door
from alphacut.io.units import engineering
from alphacut.report.figures import picture
from alphacut.report.tables import paragraphs, section, table

COLUMNS = ("damping", "period [s]", "displacement [m]", "pseudo-acceleration [m/s^2]")
ROWS = 8
"""Periods in the table, at most."""


def spectrum(folder: Path) -> Markup:
    """Figure, and a table of some periods with the largest values of each damping ratio.

    Raises:
        BadInput: The file is no spectrum.
    """
    path = folder / "spectrum.csv"
    try:
        with path.open(encoding="utf-8", newline="") as stream:
            rows = [[float(row[name]) for name in COLUMNS] for row in csv.DictReader(stream)]
        values = np.array(rows).reshape(-1, len(np.unique(np.array(rows)[:, 1])), len(COLUMNS))
    except (OSError, ValueError, KeyError, TypeError, IndexError):
        cure = f"the file of `{door('spectrum', 'RECORD.csv', '--out', folder)}`, or none"
        raise BadInput(Problem("FOLDER", "this is no response spectrum", str(path), cure)) from None
    ratios = [f"{100 * one[0, 0]:.3g} %" for one in values]
    periods = values[0, :, 1]
    places = np.unique(np.linspace(0, len(periods) - 1, ROWS).round().astype(int))
    cells = [
        (
            f"{periods[k]:.3g} s",
            *(engineering(one[k, 2], "m") for one in values),
            *(engineering(one[k, 3], "m/s^2") for one in values),
        )
        for k in places
    ]
    head = ["period", *(f"displacement, {x}" for x in ratios)]
    head += [f"pseudo-acceleration, {x}" for x in ratios]
    words = [
        f"With damping {ratio}: largest displacement {engineering(one[:, 2].max(), 'm')}, largest"
        f" pseudo-acceleration {engineering(one[:, 3].max(), 'm/s^2')} at"
        f" {one[one[:, 3].argmax(), 1]:.3g} s."
        for ratio, one in zip(ratios, values, strict=True)
    ]
    drawn = picture(folder / "spectrum.svg", caption("spectrum", paper=False))
    return section("Response spectrum", paragraphs(*words), drawn, table(tuple(head), cells))
