"""Thick plates with a triangular pattern of holes: the constants of the pressure vessel code.

Holes of diameter d stand in equilateral triangles of pitch p, in a plate of ν = .3 that is thicker
than 2 p. The effective E*/E and ν* without stress along the holes are polynomials of the ligament
efficiency μ = (p − d)/p in the code, for μ from .1 to .6. At .1 that of E* is .8 % off.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator

import numpy as np

from alphacut.rve import Phase, SeriesModel, constants
from alphacut.stochastic import HermiteMap
from benchmarks.public.row import Row

NAME = "Triangular pattern of holes (ASME VIII-1, UHX-11.5.2)"
SOURCE = (
    "ASME Boiler and Pressure Vessel Code VIII-1, UHX-11.5.2, triangular pattern of h/p ≥ 2, as"
    " `src/Tubesheet/UHX/UHX_11.py` in thepvguy/calctoys at 1ed95bf has its coefficients"
)
MODULUS = (-0.0029, 0.2126, 3.9906, -6.1730, 3.4307)
"""Coefficients of E*/E, from μ⁰ on."""
POISSON = (0.9966, -4.1978, 9.0478, -7.9955, 2.2398)


def rows() -> Iterator[Row]:
    """E*/E and ν* at five ligament efficiencies."""
    for efficiency in (0.2, 0.3, 0.4, 0.5, 0.6):
        radius = 1 - efficiency  # d/p, over half the distance of the holes
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # the hole is a very soft phase
            hole = Phase(1e-3, 0.0)
        model = SeriesModel(points=2, lattice="hexagonal")
        [cell] = model.solve(HermiteMap(radius, 0.0, radius, 0.0), Phase(1e9, 0.3), [hole])
        found = constants(cell).values
        remark = "the code fits a polynomial"
        for name, coefficients, value in (
            ("E*/E", MODULUS, found["E_T"] / 1e9),
            ("ν*", POISSON, found["nu_xy_free"]),
        ):
            published = f"{np.polynomial.polynomial.polyval(efficiency, coefficients):.4f}"
            quantity = f"{name}, μ = {efficiency:g}"
            yield Row(quantity, published, value, digits=4, tolerance=0.006, remark=remark)
