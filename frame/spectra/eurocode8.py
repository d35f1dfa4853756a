"""Spectra of EN 1998-1:2004, with the recommended values where national annexes may differ."""

from __future__ import annotations

from math import sqrt

import numpy as np

from alphacut.base.errors import checked_number, require, require_choice
from alphacut.frame.spectra.target import MeanRule, TargetSpectrum

SHAPES = {
    1: {
        "A": (1.0, 0.15, 0.4, 2.0),
        "B": (1.2, 0.15, 0.5, 2.0),
        "C": (1.15, 0.2, 0.6, 2.0),
        "D": (1.35, 0.2, 0.8, 2.0),
        "E": (1.4, 0.15, 0.5, 2.0),
    },
    2: {
        "A": (1.0, 0.05, 0.25, 1.2),
        "B": (1.35, 0.05, 0.25, 1.2),
        "C": (1.5, 0.1, 0.25, 1.2),
        "D": (1.8, 0.1, 0.3, 1.2),
        "E": (1.6, 0.05, 0.25, 1.2),
    },
}
"""Tables 3.2 (type 1) and 3.3 (type 2), by ground type: the soil factor S, and the periods T_B, T_C
and T_D in s, from which on the spectrum is constant, falls as 1/T, and falls as 1/T²."""
DESIGN_DAMPING = 0.05
"""Damping ratio of the design spectrum, whose behaviour factor takes account of others."""
MEAN_RULE = MeanRule("EN 1998-1:2004, 3.2.3.1.2(4)", floor_at_start=1.0)


def eurocode8_spectrum(
    ag: float,
    ground_type: str,
    *,
    spectrum_type: int = 1,
    damping: float = 0.05,
    q: float | None = None,
    beta: float = 0.2,
) -> TargetSpectrum:
    """Return the horizontal elastic spectrum or the design spectrum of EN 1998-1:2004.

    Args:
        ag: Design ground acceleration a_g = γ_I a_gR on ground type A, in m/s².
        ground_type: "A" to "E".
        spectrum_type: 1, or 2 for surface-wave magnitudes up to 5.5.
        damping: Viscous damping ratio of the elastic spectrum; that of the design one is 5 %.
        q: Behaviour factor, from 1 on, of the design spectrum; None for the elastic spectrum.
        beta: Lower bound of the design spectrum over a_g, at most 2.5/q.

    Returns:
        The elastic spectrum of 3.2.2.2, up to 4 s; or, with q, the design spectrum of 3.2.2.5.

    Raises:
        RefusedError: An argument is not as said.

    Example:
        >>> from alphacut.frame import eurocode8_spectrum
        >>> spectrum = eurocode8_spectrum(2.5, "C")
        >>> spectrum.clause, spectrum([0.0, 0.3, 1.2]).round(3).tolist()
        ('EN 1998-1:2004, 3.2.2.2', [2.875, 7.188, 3.594])
    """
    require(spectrum_type in SHAPES, "spectrum_type", spectrum_type, "1 or 2")
    require_choice("ground_type", ground_type, SHAPES[spectrum_type])
    soil_factor, constant_from, *falls_from = SHAPES[spectrum_type][ground_type]
    size = soil_factor * checked_number("ag", ag, positive=True)
    shape = f"spectrum of type {spectrum_type}, ground type {ground_type}"
    if q is None:
        ratio = checked_number("damping", damping, least=0, most=0.999)
        plateau = 2.5 * max(sqrt(10 / (5 + 100 * ratio)), 0.55)  # formula (3.6)
        return TargetSpectrum(
            np.array([0.0, constant_from, 4.0]),
            size * np.array([1.0, plateau, plateau]),
            name=f"elastic {shape}",
            clause="EN 1998-1:2004, 3.2.2.2",
            damping=ratio,
            falls_from=tuple(falls_from),
            rule=MEAN_RULE,
        )
    allowed = "0.05, the ratio of the design spectrum"
    require(damping == DESIGN_DAMPING, "damping", f"{damping:g} beside q", allowed)
    plateau = 2.5 / checked_number("q", q, least=1)
    checked_number("beta", beta, least=0, most=plateau)
    return TargetSpectrum(
        # Formula (3.16) has no upper end. No building has a period of 1000 s.
        np.array([0.0, constant_from, 1000.0]),
        size * np.array([2 / 3, plateau, plateau]),
        name=f"design {shape}, q = {q:g}",
        clause="EN 1998-1:2004, 3.2.2.5",
        falls_from=tuple(falls_from),
        minimum=beta * ag,
    )
