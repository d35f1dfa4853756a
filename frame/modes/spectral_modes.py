"""Modes of a linear structure as the response-spectrum method takes them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import require
from alphacut.frame.spectra.modal_combination import SpectralModes
from alphacut.frame.structures.linear import LinearSystem, evaluate, undamped_modes


def spectral_modes(
    system: LinearSystem, names: Sequence[str], points: Array, count: int | None = None
) -> SpectralModes:
    """Return the lowest modes of a structure at S parameter sets.

    Args:
        system: The structure.
        names: Names of d parameters; others keep their nominal values.
        points: Their values in SI units, shape (S, d).
        count: Number of modes; None for all.

    Raises:
        RefusedError: An output takes velocities or accelerations, or a stiffness is not positive
            definite.
    """
    matrices, rows = evaluate(system, names, points, derivatives=False)
    mass = matrices.mass.value
    squares, shapes = undamped_modes(mass, matrices.stiffness.value)
    what = "one that lets the structure drift"
    require(bool((squares > 0).all()), "stiffness", what, "a positive definite one")
    n = squares.shape[1]
    of_motion = [np.abs(matrices.accelerated), np.abs(rows.value[..., n:]).max(axis=0)]
    moving = np.flatnonzero(np.hstack(of_motion).any(axis=1))
    wrong = ", ".join(system.outputs[k] for k in moving)
    allowed = "displacements, drifts and forces, which a spectrum of displacements gives"
    require(not wrong, "output", wrong, allowed)

    omega = np.sqrt(squares)
    influence = matrices.rigid[:, 0]
    moved = mass @ influence
    participation = (shapes.swapaxes(1, 2) @ moved[..., np.newaxis])[..., 0]
    of_shapes = (rows.value[..., :n] @ shapes).swapaxes(1, 2)
    damping = np.sum(shapes * (matrices.damping.value @ shapes), axis=1)
    # The mass that moves with the ground is positive, unless the ground moves nothing.
    total = np.maximum(moved @ influence, 1e-300)
    kept = slice(count)
    return SpectralModes(
        omega=omega[:, kept],
        ratios=(damping / (2 * omega))[:, kept],
        mass_fractions=(participation**2 / total[:, np.newaxis])[:, kept],
        factors=(participation[..., np.newaxis] * of_shapes)[:, kept],
    )
