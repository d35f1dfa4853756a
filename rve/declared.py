"""Declared errors of what follows from a result, in the unit of each quantity.

A declared error covers everything between a number and the exact answer of the stated model: mesh,
orders of elements and series, quadrature in θ, interpolation.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from alphacut.rve.result import Homogenised, effective_modulus, spread
from alphacut.rve.square import square_moduli, square_voigt
from alphacut.stochastic.theta.truncated_normal import Array


def error_of_means(result: Homogenised) -> Array:
    """Absolute errors of E (Pa), ν and the mean stresses s11 and s12 (Pa), shape (4,).

    They are nan where none were made.
    """
    means = np.array(result.curve.mean)

    def printed(stresses: Array) -> Array:
        return np.array([*effective_modulus(*stresses), *stresses])

    found = spread(printed, means, result.modulus_errors[[0, 2]])
    found[0] = max(found[0], result.estimated_error * result.modulus)
    return found


def error_of_stiffness(result: Homogenised, function: Callable[[Array], Array | float]) -> Array:
    """Absolute error of a function of the plane stiffness.

    The exact stiffness has the symmetry of the square; what a mesh lacks of it is known and counts
    besides the declared errors of the three moduli.

    Args:
        result: With its whole plane stiffness.
        function: Takes a Voigt matrix, shape (3, 3), in Pa.

    Returns:
        Of the function's shape, nan where no error was made.
    """
    stiffness = np.asarray(result.stiffness)
    moduli = square_moduli(stiffness)

    def of_moduli(values: Array) -> Array:
        return np.asarray(function(square_voigt(*values)))

    uneven = abs(np.asarray(function(stiffness)) - of_moduli(moduli))
    return np.asarray(uneven + spread(of_moduli, moduli, result.modulus_errors))
