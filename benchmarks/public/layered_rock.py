"""Layered rock: velocities and anisotropy of Thomsen.

A periodic stack has 21 isotropic layers of equal thickness. Of each are given the velocities of
waves of compression and of shear, and the density, which make its moduli. Sought are the velocities
across the layers of waves much longer than the stack, and Thomsen's (1986) ε, γ and δ, from the
stiffness of the stack (Backus 1962). Axis 3 is across the layers.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from alphacut.base.arrays import Array
from alphacut.rve import solve_image
from alphacut.rve.image.fields.conjugate_gradient import ConjugateGradient
from benchmarks.public.row import Row

NAME = "Layered rock (MSAT)"
SOURCE = (
    "A. Walker and J. Wookey, MSAT, `tests/test_MS_effective_medium.m` in andreww/MSAT at 5f76754,"
    " test_MS_effective_medium_Backus and example_layering"
)
LAYERS = """
2659.99 1319.64 2265.49
2666.03 1551.17 2120.92
4666.90 2059.59 2551.36
3718.53 2130.02 2483.37
5169.32 2793.55 2732.48
3328.20 1937.93 2435.49
3183.62 1650.54 2282.05
5193.23 2718.97 2788.21
5447.86 2881.82 2823.21
2931.93 1490.97 2282.22
3017.37 1681.12 2217.13
3115.85 1517.10 2393.99
3451.60 1794.47 2390.58
3083.05 1561.44 2216.66
3317.40 1733.62 2283.42
4734.10 2578.15 2588.18
4238.52 1963.57 2662.89
2484.67 1302.08 2247.81
3642.96 2261.31 2387.66
4385.17 2107.17 2693.91
3234.26 1545.98 2380.38
"""
"""Velocity of compression and of shear (m/s), and density (kg/m³)."""


INPUT_ROUNDING = 1e-6
"""Relative, of a velocity: half of .01 m/s is 1e-6 … 4e-6 of each layer's velocities."""
LONG_WAVES = {
    "velocity of compression": ("3360.728", "m/s"),
    "velocity of shear": ("1754.414", "m/s"),
    "ε": ("0.122594", ""),
    "γ": ("0.165415", ""),
    "δ": ("-0.007099", ""),
}


def rows() -> Iterator[Row]:
    """One column of voxels, one for each layer; its bounds meet to rounding."""
    compression, shear, density = np.array(LAYERS.split(), float).reshape(-1, 3).T
    g = density * shear**2
    k = density * compression**2 - 4 / 3 * g
    column = -1, 1, 1
    exact = ConjugateGradient(accuracy=1e-12)
    bounds = solve_image(k.reshape(column), g.reshape(column), solver=exact).bounds
    for name, here in thomsen(bounds.upper, density.mean()).items():
        published, unit = LONG_WAVES[name]
        is_velocity = unit == "m/s"
        yield Row(
            name,
            published,
            here,
            digits=7,
            unit=unit,
            tolerance=INPUT_ROUNDING if is_velocity else 0.0,
            remark="the layers have two decimals" if is_velocity else "",
        )


def thomsen(stiffness: Array, density: float) -> dict[str, float]:
    """Velocities across the layers, and Thomsen's three numbers, by name.

    Args:
        stiffness: In Voigt order, shape (6, 6), with axis 3 across the layers, in Pa.
        density: In kg/m³.
    """
    c11 = stiffness[0, 0]
    c33 = stiffness[2, 2]
    c44 = stiffness[3, 3]
    of_both = (stiffness[0, 2] + c44) ** 2 - (c33 - c44) ** 2
    return {
        "velocity of compression": float(np.sqrt(c33 / density)),
        "velocity of shear": float(np.sqrt(c44 / density)),
        "ε": (c11 - c33) / (2 * c33),
        "γ": (stiffness[5, 5] - c44) / (2 * c44),
        "δ": of_both / (2 * c33 * (c33 - c44)),
    }
