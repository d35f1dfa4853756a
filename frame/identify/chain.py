"""Storey frame as a chain whose stiffnesses and masses are products of powers of parameters.

Logarithms of stiffnesses and masses are linear in those of the parameters: k_z = 12 c_z E I / l_z³,
or k_z itself is one. Natural frequencies rise with every stiffness and fall with every mass
(Courant and Fischer), so their ranges over a box are exact.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from alphacut.frame.calculus.jet import Jet
from alphacut.frame.structures.storey import StoreyFrame, chain_matrix
from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.refused import RefusedError, require

ROUND_OFF = 1e-13
"""Share of the largest eigenvalue by which a computed one may be wrong, at most."""


class Chain:
    """Chain of n masses on springs: a frame of which d parameters are uncertain.

    Args:
        frame: The frame.
        names: The parameters, of "E", "I" or "I1" …, "c1" …, "l1" …, "k1" …, "m1" ….

    Attributes:
        nominal: Their nominal values, shape (d,).
        stiffness: Nominal stiffnesses, shape (n,), in N/m.
        mass: Nominal masses, shape (n,), in kg.
        powers: Exponents of the parameters in stiffnesses and masses, shape (2, n, d).

    Raises:
        RefusedError: A name is no parameter of stiffness or mass, or weights soften the storeys, so
            that stiffnesses are no products.
    """

    def __init__(self, frame: StoreyFrame, names: Sequence[str]) -> None:
        n, values = frame.floors, frame.parameters
        allowed = "none: a storey softened by weight has no stiffness of such a product"
        require(not frame.gravity, "frame.gravity", value=frame.gravity, allowed=allowed)
        self.powers = np.zeros((2, n, len(names)))
        for column, name in enumerate(names):
            part = re.fullmatch(r"([clmkI])(\d+)", name)
            if name in ("E", "I") and name in values:
                self.powers[0, :, column] = 1
            elif part and name in values:
                row = int(part[2]) - 1
                self.powers[int(part[1] == "m"), row, column] = -3 if part[1] == "l" else 1
            else:
                allowed = f"E, I, c1 … c{n} (columns), l1 …, m1 …, or k1 … k{n} (stiffnesses)"
                raise RefusedError("identify.parameters", name, allowed)
        modal = {name: Jet.constant([value], 0) for name, value in values.items()}
        self.names, self.nominal = tuple(names), np.array([values[name] for name in names])
        self.stiffness, self.mass = frame.springs(modal).value[0], np.asarray(frame.masses, float)

    def modes(self, points: Array) -> tuple[Array, Array]:
        """Return squared angular frequencies (S, n), rising, and mode shapes (S, floor, mode).

        Args:
            points: Parameters, shape (S, d), in SI units.
        """
        stiffness, mass = np.exp(np.log(points / self.nominal) @ self.powers.swapaxes(1, 2))
        return chain_modes(self.stiffness * stiffness, self.mass * mass)

    def ranges(self, lower: Array, upper: Array) -> tuple[Array, Array]:
        """Return lower and upper bounds of the logarithms of stiffness and mass factors over a box.

        Factors are ratios to nominal stiffnesses and masses.

        Args:
            lower: Lower corner of the box, logarithms of parameters over nominal values, shape
                (d,).
            upper: Upper corner.

        Returns:
            Two arrays of shape (2, n), stiffness first.
        """
        increases = self.powers > 0
        lower_bound = np.where(increases, self.powers * lower, self.powers * upper).sum(-1)
        upper_bound = np.where(increases, self.powers * upper, self.powers * lower).sum(-1)
        return lower_bound, upper_bound


def chain_modes(stiffness: Array, mass: Array) -> tuple[Array, Array]:
    """Return squared angular frequencies and mass-normalised shapes of chains of n masses.

    Args:
        stiffness: Spring stiffnesses, shape (S, n), in N/m.
        mass: Masses, shape (S, n), in kg.

    Returns:
        Frequencies (S, n), rising, in 1/s², and shapes (S, floor, mode).
    """
    root = np.sqrt(mass)
    values, vectors = np.linalg.eigh(
        chain_matrix(stiffness) / root[..., :, None] / root[..., None, :]
    )
    return values, vectors / root[..., None]


def eigenvalue_ranges(model: Chain, lower: Array, upper: Array) -> tuple[Array, Array]:
    """Return proved bounds of squared angular frequencies over a box, lower and upper, (n,) each.

    They rise with every stiffness and fall with every mass, so that two corners give them.

    Args:
        model: The chain.
        lower: Logarithms of the parameters over nominal values, lower ends, shape (d,).
        upper: Upper ends.
    """
    low, high = model.ranges(lower, upper)
    stiffness = model.stiffness * np.exp(np.stack([low[0], high[0]]))
    mass = model.mass * np.exp(np.stack([high[1], low[1]]))
    values, _ = chain_modes(stiffness, mass)
    rounding = ROUND_OFF * values[:, -1:] * values.shape[1]
    return (values - rounding)[0], (values + rounding)[1]
