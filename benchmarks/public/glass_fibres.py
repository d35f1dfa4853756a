"""Unidirectional glass fibres in resin, hexagonal array.

Round fibres (E = 70,000 MPa, ν = .22) in a matrix (E = 3,500 MPa, ν = .35), with a volume fraction
of .2, .4 and .6. The rectangular cell of 1 × √3 has two fibres. Index N is along the fibres, T and
L are across. The source's test takes these numbers from another source, and asks for 1 %.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from alphacut.rve import Phase
from benchmarks.balls import moduli_between, stiffness_between
from benchmarks.public.row import Row

NAME = "Hexagonal glass fibres (code_aster)"
SOURCE = (
    "EDF, code_aster, test cases HPLV106 a, b, c: `astest/hplv106a.comm`, `hplv106b.comm`,"
    " `hplv106c.comm` (VALE_REFE) in ZOHAIUB/code_aster at 764b3a6; manual V7.03.106"
)
PUBLISHED = {
    0.2: {"E_N": "16813", "E_T": "5216", "G_TN": "1876", "NU_TL": "0.466"},
    0.4: {"E_N": "30118", "E_T": "7531", "G_TN": "2790", "NU_TL": "0.452"},
    0.6: {"E_N": "43418", "E_T": "12123", "G_TN": "4468", "NU_TL": "0.401"},
}
"""Numbers of the source by fraction of the fibres, moduli in MPa."""
PLACES = {"E_N": 2, "E_T": 0, "G_TN": 6, "NU_TL": 5}
"""Row of each constant among those along the axes of a volume (z along the fibres)."""
PIXELS = 291, 168
"""Along y and x: 97/56 is nearly √3, so that pixels are nearly square."""


def rows() -> Iterator[Row]:
    """One layer of voxels for each fraction."""
    unit = 1e6
    matrix = Phase(3500 * unit, 0.35).bulk_and_shear
    fibre = Phase(70_000 * unit, 0.22).bulk_and_shear
    height = np.sqrt(3)
    centres = np.array([[0.0, 0.0], [height / 2, 0.5]])
    for fraction, published in PUBLISHED.items():
        radius = np.sqrt(fraction * height / (2 * np.pi))
        lower, upper = moduli_between(
            PIXELS, (height, 1.0), centres, matrix=matrix, balls=[(radius, fibre)]
        )
        side = height / PIXELS[0] * PIXELS[1]  # over that along x
        bounds = stiffness_between(lower[:, None], upper[:, None], sides=(1.0, side, 1.0))
        constants = bounds.constants()
        for name, number in published.items():
            is_modulus = name != "NU_TL"
            low, high = constants[PLACES[name]] / (unit if is_modulus else 1.0)
            yield Row(
                f"{name}, fraction {fraction:g}",
                number,
                (low, high),
                digits=4,
                unit="MPa" if is_modulus else "",
            )
