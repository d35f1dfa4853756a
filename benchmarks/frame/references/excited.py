"""The part of a structure from matrices that its start and the ground excite.

Of a symmetric structure that is pushed symmetrically half of the shapes never move, and their
frequencies may coincide with those of the others, which no proof over modes can take. In modal
coordinates of a random combination of all matrices the invariant subspaces are blocks.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from alphacut.frame.structures.matrix import MatrixStructure, Terms
from alphacut.fuzzy.arrays import Array

ZERO = 1e-9
"""Share of a matrix's norm, or of a start's, that counts as round-off of zero."""


def excited(system: MatrixStructure) -> MatrixStructure:
    """The structure on the least blocks that its start and the ground excite: the same motion.

    The matrices of all parameters leave these blocks invariant, to `ZERO` of their norms. Copies
    of one structure that nothing couples are not told apart, and stay.

    Args:
        system: The structure; its outputs, parameters and motion stay what they are.
    """
    kinds = ("mass", "stiffness", "damping")
    total: Array = np.sum([array for _, array in system.mass], axis=0)
    below = np.linalg.inv(np.linalg.cholesky(total))
    arrays = [a for kind in kinds for _, a in getattr(system, kind)]
    scaled = [below @ array @ below.T for array in arrays]
    scaled = [one / max(float(np.linalg.norm(one, 2)), 1e-300) for one in scaled]
    weight = np.random.default_rng(0).uniform(1, 2, len(scaled))
    shapes = np.linalg.eigh(np.tensordot(weight, scaled, 1))[1]
    coupled = np.max([np.abs(shapes.T @ one @ shapes) for one in scaled], axis=0) > ZERO
    kept = shapes[:, _reached(coupled, _started(system, shapes.T @ np.linalg.inv(below).T))]
    basis = below.T @ kept  # q = basis y
    onto = kept.T @ np.linalg.inv(below).T

    def part(terms: Terms) -> Terms:
        return [(f, _symmetric(basis.T @ a @ basis)) for f, a in terms]

    pattern = np.ones(system.size) if system.pattern is None else np.asarray(system.pattern)
    whole = {
        name: np.split(np.asarray(row), len(row) // system.size)
        for name, row in system.observed.items()
    }
    return replace(
        system,
        mass=part(system.mass),
        stiffness=part(system.stiffness),
        damping=part(system.damping),
        q0=None if system.q0 is None else onto @ system.q0,
        v0=None if system.v0 is None else onto @ system.v0,
        observed={name: np.concatenate([x @ basis for x in row]) for name, row in whole.items()},
        pattern=onto @ pattern,
    )


def _started(system: MatrixStructure, onto: Array) -> Array:
    """Which shapes the start and the ground move, shape (n,)."""
    given = [x for x in (system.q0, system.v0) if x is not None]
    if system.ground is not None:
        given.append(np.ones(system.size) if system.pattern is None else system.pattern)
    moved = np.zeros(len(onto), bool)
    for vector in given:
        share = np.abs(onto @ vector)
        moved |= share > ZERO * max(float(share.max()), 1e-300)
    return moved


def _reached(coupled: Array, moved: Array) -> Array:
    """All shapes that are coupled, over others too, to those moved."""
    while (more := moved | coupled[:, moved].any(1)).sum() > moved.sum():
        moved = more
    return moved if moved.any() else ~moved


def _symmetric(array: Array) -> Array:
    return (array + array.T) / 2
