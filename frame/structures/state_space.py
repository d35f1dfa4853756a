"""State space of linear structures: [q; v]˙ = A [q; v] (eq. 23)."""

from __future__ import annotations

import numpy as np

from alphacut.frame.calculus.jet import Jet, concatenate, inverse
from alphacut.frame.structures.linear import Matrices


def state_matrix(m: Matrices) -> Jet:
    """A with [q; v]˙ = A [q; v], shape (S, 2n, 2n) (eq. 17, 23)."""
    light = inverse(m.mass)
    lower = concatenate([-(light @ m.stiffness), -(light @ m.damping)], -1)
    n = m.mass.value.shape[-1]
    upper = Jet.constant(
        np.broadcast_to(np.hstack([np.zeros((n, n)), np.eye(n)]), lower.value.shape),
        lower.directions,
    )
    return concatenate([upper, lower], -2)
