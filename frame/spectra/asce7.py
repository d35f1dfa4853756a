"""Design response spectra of ASCE/SEI 7-22, from the values that the standard's database gives."""

from __future__ import annotations

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import checked_number
from alphacut.frame.spectra.target import MeanRule, TargetSpectrum

PERIODS = [
    0.0, 0.01, 0.02, 0.03, 0.05, 0.075, 0.1, 0.15, 0.2, 0.25, 0.3,
    0.4, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 7.5, 10.0,
]  # fmt: skip
"""Periods of 11.4.5.1, in s."""
MEAN_RULE = MeanRule("ASCE 7-22, 16.2.2 and 16.2.3.2", records=11)


def asce7_multi_period(accelerations: Array) -> TargetSpectrum:
    """Return the multi-period response spectrum of ASCE 7-22, 11.4.5.1, up to 10 s.

    Args:
        accelerations: The site's spectral accelerations for 5 % damping, in m/s², at the periods 0,
            0.01, 0.02, 0.03, 0.05, 0.075, 0.1, 0.15, 0.2, 0.25, 0.3, 0.4, 0.5, 0.75, 1, 1.5, 2, 3,
            4, 5, 7.5 and 10 s. Between them the spectrum is linear. Chapter 16 scales records to
            the risk-targeted maximum considered earthquake, 1.5 times the design spectrum.

    Raises:
        RefusedError: There are not 22 positive values.
    """
    return TargetSpectrum(
        np.array(PERIODS),
        accelerations,
        name="multi-period spectrum",
        clause="ASCE 7-22, 11.4.5.1",
        rule=MEAN_RULE,
    )


def asce7_two_period(sds: float, sd1: float, long_period: float) -> TargetSpectrum:
    """Return the two-period design response spectrum of ASCE 7-22, 11.4.5.2.

    The standard permits it for the equivalent lateral force procedure only.

    Args:
        sds: Design spectral acceleration S_DS at short periods, in m/s².
        sd1: Design spectral acceleration S_D1 at 1 s, in m/s².
        long_period: Transition period T_L, in s, longer than S_D1/S_DS.

    Raises:
        RefusedError: A value is not positive, or T_L is too short.
    """
    checked_number("sds", sds, positive=True)
    corner = checked_number("sd1", sd1, positive=True) / sds
    checked_number("long_period", long_period, least=corner)
    return TargetSpectrum(
        # The last branch has no upper end. No building has a period of 1000 s.
        np.array([0.0, 0.2 * corner, 1000.0]),
        np.array([0.4 * sds, sds, sds]),
        name="two-period design spectrum, for the equivalent lateral force procedure only",
        clause="ASCE 7-22, 11.4.5.2",
        falls_from=(corner, long_period),
    )
