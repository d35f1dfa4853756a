"""Unidirectional stiff fibres, square array.

Round fibres (E = 50, ν = .3) stand in a matrix (E = 1, ν = .45), with a volume fraction of .6, and
axis 3 along the fibres. The source's numbers are of finite elements. Its C3333, which hardly
depends on the arrangement, is that of a fraction of .5990: chords of a mesh cut off a part of the
circle. At that fraction the other four constants are the source's as well, as the last rows show.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.optimize import brentq

from alphacut.rve import Phase, SeriesModel, constants
from alphacut.stochastic import HermiteMap
from benchmarks.public.row import Row

NAME = "Square array of stiff fibres (HomoLib)"
SOURCE = (
    "HomoLib.jl, `test/homogenization_test.jl` in Ngbosando/HomoLib.jl at e9fd05a, lines 130–131"
    " (input) and 505–511 (“PER”); the problem is that of J. Yvonnet, Computational homogenization"
    " of heterogeneous materials with finite elements (2019), section 4.7 with its erratum"
)
PUBLISHED = {
    "C1111": "10.961",
    "C1122": "5.606",
    "C1212": "0.955",
    "C3333": "34.554",
    "C1133": "5.893",
}
FRACTION = 0.6


def rows() -> Iterator[Row]:
    """At the fraction of the source's input, and at that of its mesh."""
    remark = "theirs is of a smaller fraction, as C3333 says"
    for name, value in stiffness(FRACTION).items():
        yield Row(name, PUBLISHED[name], value, digits=5, tolerance=0.004, remark=remark)
    axial = float(PUBLISHED["C3333"])
    of_mesh = brentq(lambda fraction: stiffness(fraction)["C3333"] - axial, 0.59, 0.61)
    remark = f"fraction {of_mesh:.4f}, of their C3333; they have finite elements"
    for name, value in stiffness(of_mesh).items():
        if name != "C3333":
            yield Row(
                f"{name} of their mesh",
                PUBLISHED[name],
                value,
                digits=5,
                tolerance=0.0004,
                remark=remark,
            )


def stiffness(fraction: float) -> dict[str, float]:
    """Constants of the cell by name, in the source's unit."""
    unit = 1e9  # a phase is in Pa
    radius = float(np.sqrt(4 * fraction / np.pi))  # over half the cell's side
    model = SeriesModel(points=2)
    [cell] = model.solve(
        HermiteMap(radius, 0.0, radius, 0.0), Phase(unit, 0.45), [Phase(50 * unit, 0.3)]
    )
    of_fibres = constants(cell).values
    plane = cell.stiffness / unit
    bulk = (plane[0, 0] + plane[0, 1]) / 2
    poisson = of_fibres["nu_LT"]
    return {
        "C1111": plane[0, 0],
        "C1122": plane[0, 1],
        "C1212": plane[2, 2],
        "C3333": of_fibres["E_L"] / unit + 4 * poisson**2 * bulk,
        "C1133": 2 * poisson * bulk,
    }
