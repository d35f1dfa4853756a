"""Which modes form blocks: those that meet or come near in the box, and a basis smooth there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from alphacut.base.arrays import Array, Ints, Mask
from alphacut.frame.calculus.rounding import gamma
from alphacut.frame.calculus.taylor_model import TaylorModel
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.modes.blocks import Block, CentredMatrices, eigenvalue_drop, narrowest_block
from alphacut.frame.structures.linear import undamped_modes

NEAR = 2.0
"""First-order change of the distance of two λ over the box, as a share of that distance, from which
they are a block without an attempt to enclose them alone, which fails at some number between 1 and
2."""
LEAST_NEAR = 0.4
"""The same from which a mode joins a block that is not enclosed without it."""
MAX_BLOCK = 12
"""Most modes of a block."""
EQUAL = 1e-9
"""Relative distance up to which two λ count as equal: that of their rounding and some more."""
SWEEPS = 12
"""Sweeps of Jacobi rotations at most."""


@dataclass(frozen=True, eq=False)
class Subspaces:
    """Enclosed blocks of a structure over its box."""

    blocks: list[Block]  # functions of the inputs at `used`
    used: Ints  # inputs that mass and stiffness depend on
    centre: CentredMatrices  # mass and stiffness in the coordinates of the blocks
    low: Array  # least λ of all modes by number from below, (modes,), in 1/s²
    high: Array  # greatest
    # bounds of how far M and K fall below M(0) and K(0), as shares of these
    variation: tuple[float, float]
    # input whose bisection parts the closest pair that is not enclosed; None if all are
    along: int | None

    @property
    def others(self) -> Ints:
        """Numbers of the modes that are not enclosed, rising."""
        taken = [block.modes for block in self.blocks]
        return np.setdiff1d(np.arange(self.centre.modes), np.concatenate([[], *taken]))


def enclose_subspaces(
    centre: CentredMatrices, used: Ints, wanted: int, tolerances: Array | None = None
) -> Subspaces:
    """Enclose the lowest modes over the box, in blocks, from below until one is not enclosed.

    A block that cannot be enclosed is joined by the mode nearest to it, and tried again.

    `wanted` is the number of modes to enclose, `used` are the inputs of M and K among all, and
    `tolerances` relative errors of each mode's λ that suffice; 0 unless given.

    Raises:
        UnprovedError: The box is so wide that the structure may lose its mass or stiffness.
    """
    tolerances = np.zeros(centre.modes) if tolerances is None else tolerances
    couplings = _couplings(centre, np.arange(centre.modes))
    slopes = np.diagonal(couplings, axis1=1, axis2=2).T  # ∂λ_j/∂u_i in the middle, (modes, d)
    steepest = int((np.abs(slopes) / centre.squared[:, None]).max(0).argmax())  # input, of λ
    low, high, variation = _ranges(centre, int(used[steepest]))
    near, blocks, along = _nearness(centre, couplings), list[Block](), None
    free: Ints = np.arange(centre.modes)
    while len(free) and free[0] < wanted and along is None:
        modes, block = _linked(near > NEAR, free[:1], free), None
        while block is None:
            tolerance = float(tolerances[modes].min())
            block = narrowest_block(modes, rotation(centre, modes), centre, tolerance)
            if block is not None:
                blocks.append(block)
                free = np.setdiff1d(free, modes)
                break
            outside = near[np.ix_(modes, free)] * ~np.isin(free, modes)
            inner, outer = np.unravel_index(int(outside.argmax()), outside.shape)
            if outside[inner, outer] < LEAST_NEAR or len(modes) >= MAX_BLOCK:
                drift = slopes[modes[inner]] - slopes[free[outer]]
                along = int(used[np.abs(drift).argmax()])
                break
            modes = _linked(near > NEAR, np.append(modes, free[outer]), free)
    return Subspaces(blocks, used, centre, low, high, variation, along)


def _ranges(centre: CentredMatrices, along: int) -> tuple[Array, Array, tuple[float, float]]:
    """Bounds of all λ over the box from M ≥ (1 − μ) M(0), K ≥ (1 − κ) K(0) and such, with μ, κ."""
    scales = centre.has_mass, np.diag(centre.stiffness.value) ** -0.5
    mass, stiffness = (
        max(eigenvalue_drop(matrix, scale, sign) for sign in (1.0, -1.0))
        for matrix, scale in zip((centre.mass, centre.stiffness), scales, strict=True)
    )
    if not (mass < 1 and stiffness < 1):
        what = "the structure may lose its stiffness"
        raise UnprovedError(what, "take narrower inputs", along)
    # Rayleigh quotients φᵀKφ / φᵀMφ and Courant's minima and maxima
    low = (1 - gamma(4)) * (1 - stiffness) / (1 + mass) * centre.squared
    high = (1 + gamma(4)) * (1 + stiffness) / (1 - mass) * centre.squared
    return low, high, (mass, stiffness)


def centred_matrices(mass: TaylorModel, stiffness: TaylorModel) -> tuple[CentredMatrices, Ints]:
    """M and K in coordinates that make both diagonal in the middle of the box.

    Unknowns b without mass follow the others a there, x_b = −K_bb⁻¹ K_ba x_a, and have coordinates
    of their own, in which K is as large as the greatest λ.

    Rows of M, shape (n, n), are zero where unknowns have no mass.

    Returns:
        The matrices as functions of the inputs that M or K depends on, and the numbers of these.

    Raises:
        UnprovedError: The structure can move rigidly, or is unstable, in the middle.
    """
    massive = np.asarray(mass.magnitude().any(1))
    M, K, n = mass.value, stiffness.value, len(massive)
    a, b = np.flatnonzero(massive), np.flatnonzero(~massive)
    massless_values, massless_vectors = np.linalg.eigh(K[np.ix_(b, b)])
    _require_stiff(massless_values, K)
    follow = -(massless_vectors / massless_values) @ massless_vectors.T @ K[np.ix_(b, a)]
    squared, shapes = undamped_modes(M[np.ix_(a, a)], K[np.ix_(a, a)] + K[np.ix_(a, b)] @ follow)
    _require_stiff(squared, squared)
    basis: Array = np.zeros((n, n))
    basis[a, : len(a)] = shapes
    basis[b, : len(a)] = follow @ shapes
    basis[b, len(a) :] = massless_vectors * np.sqrt(squared[-1] / massless_values)
    used = np.union1d(mass.active_inputs(), stiffness.active_inputs())
    used = used if len(used) else np.arange(1)
    heavy, stiff = (basis.T @ matrix.restricted_to(used) @ basis for matrix in (mass, stiffness))
    weight = (np.arange(n) < len(a)).astype(float)
    diagonals = _diagonal(heavy, weight), _diagonal(stiff, np.diag(stiff.value))
    return CentredMatrices(*diagonals, basis, len(a)), used


def _diagonal(matrix: TaylorModel, diagonal: Array) -> TaylorModel:
    """The same with a diagonal in the middle, which it has but for rounding, put into the rest."""
    middle = np.diag(diagonal)
    remainder = matrix.remainder + np.abs(matrix.value - middle)
    return TaylorModel((middle[None], *matrix.parts[1:]), remainder, matrix.inputs, matrix.order)


def _require_stiff(values: Array, like: Array) -> None:
    if len(values) and values.min() <= 1e-12 * np.abs(like).max():
        what = "the structure may move rigidly or lose its stiffness"
        raise UnprovedError(what, "take the method improved-graph-follower")


def _couplings(centre: CentredMatrices, some: Ints) -> Array:
    """First-order change of K − λ M between modes, λ the mean of both, shape (d, p, p)."""
    stiff, heavy = (
        x.homogeneous_part(1)[:, some[:, None], some] for x in (centre.stiffness, centre.mass)
    )
    mean = (centre.squared[some, None] + centre.squared[some]) / 2
    return np.asarray(stiff - mean * heavy)


def _nearness(centre: CentredMatrices, couplings: Array) -> Array:
    """First-order change of λ_j − λ_k over the box, over that distance in its middle, a matrix."""
    # from 1 on two modes may meet at complex inputs of sizes up to 1, where their series diverge
    slopes = np.diagonal(couplings, axis1=1, axis2=2).T
    change = np.abs(slopes[:, None] - slopes).sum(-1) + 2 * np.abs(couplings).sum(0)
    distance = np.abs(centre.squared[:, None] - centre.squared)
    # modes of equal frequencies have no shapes of their own, whether they part in the box or not
    equal = distance <= EQUAL * np.maximum(centre.squared[:, None], centre.squared)
    near = np.where(equal, np.inf, change / np.where(equal, 1.0, distance))
    near[np.diag_indices_from(near)] = 0.0
    return near


def _linked(pairs: Mask, modes: Ints, free: Ints) -> Ints:
    """Numbers of the free modes that `pairs` link to `modes`, directly or through others."""
    while True:
        neighbours = np.intersect1d(free, np.flatnonzero(pairs[modes].any(0)))
        extended = np.union1d(modes, neighbours)
        if len(extended) == len(modes):
            return np.sort(modes)
        modes = extended


def rotation(centre: CentredMatrices, modes: Ints) -> Array:
    """Rotation R of p modes after which K − λ M is nearly diagonal over the box, shape (p, p).

    Joint diagonalisation of K − λ M in the middle and of its derivatives by all inputs, by Jacobi
    rotations (Cardoso, Souloumiac 1996). So modes that cross keep their shapes at the crossing.
    """
    p = len(modes)
    matrices = np.concatenate([np.diag(centre.squared[modes])[None], _couplings(centre, modes)])
    total, pairs = np.eye(p), [(i, j) for i in range(p) for j in range(i)]
    for _ in range(SWEEPS):
        largest = 0.0
        for i, j in pairs:
            # matrices' parts on which a rotation by 2 × angle acts
            h = np.stack([matrices[:, i, i] - matrices[:, j, j], 2 * matrices[:, i, j]])
            on, off = float(h[0] @ h[0] - h[1] @ h[1]), float(2 * h[0] @ h[1])
            angle = np.arctan2(off, on + np.hypot(on, off)) / 2
            step = np.eye(p)
            step[i, i] = step[j, j] = np.cos(angle)
            step[j, i], step[i, j] = np.sin(angle), -np.sin(angle)
            matrices, total = step.T @ matrices @ step, total @ step
            largest = max(largest, abs(angle))
        if largest < 1e-12:
            break
    return total
