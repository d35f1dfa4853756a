"""Equal shear moduli: a cube, and a checkerboard.

Where both phases have the same shear modulus G, the bulk modulus K is known for every arrangement
(Hill 1964): 1/(K + 4 G/3), in the plane 1/(K + G), is the mean of that of the phases. There are no
units.

- A cube of 22³ voxels in the middle of a periodic cell of 30³: G = 1, K = 20 in the cube, else 1.
- A periodic checkerboard of L × L pixels with four checks, in the plane: G = 2, K = 1 and 10. Bulk
  moduli are those of plane strain.

The manual's finite elements are trilinear, and bilinear in the plane. Their numbers are upper
bounds, which the voxels of this program reach, as they have the same elements.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from alphacut.base.arrays import Array
from alphacut.rve import solve_image
from alphacut.rve.image.fields.conjugate_gradient import ConjugateGradient
from benchmarks.public.row import Row

NAME = "Equal shear moduli (NIST)"
SOURCE = (
    "E. J. Garboczi, Finite element and finite difference programs for computing the linear"
    " electric and elastic properties of digital images of random materials, NISTIR 6269 (1998),"
    " section on exact results for equal shear moduli, and Table 9"
    " (ciks.cbt.nist.gov/garbocz/manual/node29.html)"
)
SOLVED = ConjugateGradient(accuracy=1e-9)
"""To more digits than the manual prints."""
TABLE = {2: "5.500", 4: "3.271", 8: "2.937", 16: "2.841", 32: "2.812", 64: "2.804", 128: "2.8012"}
"""K of the checkerboard in Table 9 by L; the manual's exact value is 2.8."""
UNSOLVED = "no displacements of these elements have less energy: the manual's are not fully solved"


def rows() -> Iterator[Row]:
    """Solve the cube, and the checkerboard at each size."""
    is_cube = np.zeros((30, 30, 30), bool)
    is_cube[4:26, 4:26, 4:26] = True
    cube = solve_image(np.where(is_cube, 20.0, 1.0), np.ones(is_cube.shape), solver=SOLVED).bounds
    yield Row("K of the cube, exact", "2.263250", tuple(cube.bulk), digits=7)
    yield Row("K of the cube, trilinear elements", "2.269684", cube.bulk.upper, digits=7)
    plane = solve_image(_checks(64, 1.0, 10.0), _checks(64, 2.0, 2.0)).bounds
    yield Row("K of the checkerboard, exact", "2.8", tuple(plane.bulk), remark="64 × 64 pixels")
    for size, published in TABLE.items():
        # One layer of voxels has bilinear displacements in the plane. The bulk modulus of space is
        # less than that of plane strain by G/3.
        bulk = _checks(size, 1.0, 10.0)[np.newaxis] - 2 / 3
        upper = solve_image(bulk, np.full_like(bulk, 2.0), solver=SOLVED).bounds.upper
        is_solved = size < 128
        yield Row(
            f"K of the checkerboard, bilinear elements, L = {size}",
            published,
            upper[:2, :2].mean(),
            digits=5,
            tolerance=0.0 if is_solved else 1e-4,
            remark="" if is_solved else UNSOLVED,
        )


def _checks(size: int, first: float, second: float) -> Array:
    """Two values in four checks, shape (size, size)."""
    return np.kron([[second, first], [first, second]], np.ones((size // 2, size // 2)))
