"""Polynomial dependence on parameters, and energy that never grows.

They follow from how a structure is written, not from samples of it.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import ceil, log, sqrt

import numpy as np

from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.structures.linear import LinearSystem
from alphacut.frame.structures.matrix import MatrixStructure
from alphacut.frame.structures.storey import StoreyFrame
from alphacut.fuzzy.arrays import Array

Box = Mapping[str, tuple[float, float]]
ROUND_OFF = 1e-17
"""Relative size from which on a Chebyshev coefficient counts as none: a hundredth of the precision
that everything is computed in.
"""


def degrees(system: LinearSystem, box: Box) -> dict[str, int]:
    """Return the polynomial degree of a linear structure in each uncertain parameter, by name.

    It is the highest one in M, K, D, initial state and observation rows, to round-off. Modal
    damping is no polynomial: a parameter that is a damping ratio has the degree of the ratio
    itself, 1.

    Args:
        system: The structure.
        box: Lower and upper end of each uncertain parameter, in SI units.

    Raises:
        UnprovedError: A quantity is no polynomial, a parameter leaves its range, or the damping may
            feed energy into the structure somewhere in the box.
    """
    if not isinstance(system, StoreyFrame | MatrixStructure):
        raise UnprovedError(f"nothing is known about the parameters of a {type(system).__name__}")
    for name, ends in box.items():
        if not (parameter := system.parameter(name)).admits(*ends):
            what = f"{name} reaches from {ends[0]:g} to {ends[1]:g}"
            raise UnprovedError(f"{what}, and is known to be {parameter.range or 'finite'}")
    if isinstance(system, StoreyFrame):
        return _storey_frame_degrees(system, box)
    if len(system.massless):
        raise UnprovedError(
            "unknowns without mass are condensed, which no polynomial is", "take the method dual"
        )
    if any(map(callable, system.row_factors.values())):
        raise UnprovedError("an output has a factor that is a function of the parameters")
    if any(callable(force.amplitude) for force in system.loads):
        raise UnprovedError("a force has an amplitude that is a function of the parameters")
    for kind in ("mass", "damping", "stiffness"):
        for factor, array in getattr(system, kind):
            if callable(factor):
                raise UnprovedError(
                    f"{kind} has a factor that is a function; only numbers and names of parameters"
                    " are known polynomials"
                )
            if kind == "damping":
                lowest = system.parameters[factor] if isinstance(factor, str) else factor
                _require_dissipation(box.get(str(factor), (lowest,))[0], array)
    return dict.fromkeys(box, 1)


def _storey_frame_degrees(system: StoreyFrame, box: Box) -> dict[str, int]:
    """Return a storey frame's polynomial degree in each uncertain parameter, by name.

    It is 1, but for lengths, of which stiffnesses hold l⁻³, and for masses where accelerations are
    observed, which hold m⁻¹.
    """
    degree = dict.fromkeys(box, 1)
    degree |= {name: inverse_cube_degree(*ends) for name, ends in box.items() if name[0] == "l"}
    if accelerations(system):  # forces over masses; with gravity the forces hold masses as well
        gravity_degree = 1 if system.gravity else 0
        masses = {name: ends for name, ends in box.items() if name[0] == "m"}
        degree |= {
            name: gravity_degree + inverse_cube_degree(*ends) for name, ends in masses.items()
        }
    return degree


def accelerations(system: LinearSystem) -> dict[int, int]:
    """Outputs that are accelerations of a storey frame's floors, with the floors, from 0."""
    named = enumerate(system.outputs) if isinstance(system, StoreyFrame) else ()
    return {row: int(name[1:]) - 1 for row, name in named if name[0] == "a"}


def _require_dissipation(factor: float, array: Array) -> None:
    """Refuse a damping term factor · array that is not positive semidefinite."""
    eigenvalues = np.linalg.eigvalsh(array)
    if factor < 0 or eigenvalues[0] < -1e-14 * np.abs(eigenvalues).max():
        raise UnprovedError(
            "a term of the damping has a negative factor or an indefinite array: it may feed energy"
            " into the structure"
        )


def inverse_cube_degree(lower: float, upper: float) -> int:
    """Return the degree after which Chebyshev series of x⁻³, x⁻¹ on [lower, upper] are round-off.

    Inside the Bernstein ellipse with semi-axes sum ρ > 1 the function stays below M, and what
    follows after degree N is at most 2 M ρ^−N / (ρ − 1) (Trefethen, Approximation Theory and
    Approximation Practice, theorem 8.2).
    """
    radius = (upper - lower) / (upper + lower)  # of the interval, over its middle
    if radius == 0:
        return 0

    def degree(reach: float) -> int:
        # by the ellipse that reaches from the middle x to x (1 − reach) on the axis
        axis = reach / radius
        rho = axis + sqrt(axis * axis - 1)
        return ceil(log(2 / ((1 - reach) ** 3 * ROUND_OFF * (rho - 1))) / log(rho))

    return max(1, min(degree(radius + (1 - radius) * k / 20) for k in range(1, 20)))
