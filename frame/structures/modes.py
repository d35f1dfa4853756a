"""State matrix, oscillating eigenvalues, and modes that keep their damping ratios."""

from __future__ import annotations

import numpy as np

from alphacut.frame.calculus.jet import Array, Jet, concatenate
from alphacut.frame.structures.linear import Matrices, undamped_modes
from alphacut.fuzzy.refused import FailedError, require


def state_matrix(m: Matrices) -> Jet:
    """Return the state matrix A of [q; v]˙ = A [q; v], shape (S, 2n, 2n) (eq. 17, eq. 23)."""
    inverse_mass = m.inverse_mass
    lower = concatenate([-(inverse_mass @ m.stiffness), -(inverse_mass @ m.damping)], -1)
    n = m.mass.value.shape[-1]
    upper = lower.like(np.broadcast_to(np.hstack([np.zeros((n, n)), np.eye(n)]), lower.value.shape))
    return concatenate([upper, lower], -2)


DOUBLE = 1e-6
"""Relative distance of two eigenvalues below which they count as equal."""


class ModalError(FailedError):
    """The structure has no smooth set of oscillating modes over the box."""


def oscillating(rate: Array) -> Array:
    """Mask of eigenvalues in the upper of a conjugate pair."""
    return rate.imag > 1e-9 * np.abs(rate)


def require_modal_order(mass: Array, stiffness: Array, ratios: Array) -> None:
    """Refuse modes of unequal damping ratio that change places between parameter sets.

    Args:
        mass: M at S parameter sets, the nominal ones first, shape (S, n, n).
        stiffness: K there.
        ratios: ζ of the modes by rising frequency, shape (n,).

    Raises:
        RefusedError: Shapes of one set are those of the nominal set in another order.
    """
    shapes = undamped_modes(mass, stiffness)[1]
    similarity = np.abs(shapes[0].T @ mass[0] @ shapes)  # of nominal shapes (rows) and others
    nominal = similarity.argmax(1)  # the nominal mode that each mode is most like, (S, n)
    for _, k in np.argwhere(ratios[nominal] != ratios):
        pair = f"modes {min(k, nominal[:, k].min()) + 1} and {max(k, nominal[:, k].max()) + 1}"
        cure = "give both the same ratio, or take narrower inputs"
        require(
            False,
            "damping ratios",
            value=f"unequal where {pair} may cross",
            allowed="modes apart",
            cure=cure,
        )
