"""Which modes form blocks: those that meet or come near in the box, and a basis smooth there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from alphacut.base.arrays import Array, Ints, Mask
from alphacut.frame.calculus.taylor_model import TaylorModel
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.modes.blocks import (
    Block,
    CentredMatrices,
    max_eigenvalue_decrease,
    narrowest_block,
)
from alphacut.frame.structures.linear import undamped_modes


@dataclass(frozen=True, eq=False)
class Subspaces:
    """Enclosed blocks of a structure over its box."""

    blocks: list[Block]  # functions of the inputs at `used`
    used: Ints  # inputs that mass and stiffness depend on
    centre: CentredMatrices  # mass and stiffness in the coordinates of the blocks
    # range of the eigenvalue of every mode, by number from below, (modes,), in 1/s²
    eigenvalue_low: Array
    eigenvalue_high: Array
    # bounds μ and κ of M ≥ (1 − μ) M(0) and K ≥ (1 − κ) K(0) over the box
    mass_decrease: float
    stiffness_decrease: float
    # input whose bisection separates the closest pair that is not enclosed; None if all are
    bisection_input: int | None

    @property
    def truncated_modes(self) -> Ints:
        """Numbers of the modes that are not enclosed, rising."""
        enclosed = [block.modes for block in self.blocks]
        return np.setdiff1d(np.arange(self.centre.mode_count), np.concatenate([[], *enclosed]))


def enclose_subspaces(
    centre: CentredMatrices, used: Ints, count: int, tolerances: Array | None = None
) -> Subspaces:
    """Enclose the lowest modes over the box, in blocks, from below until one is not enclosed.

    A block that cannot be enclosed is joined by the mode nearest to it, and tried again.

    Args:
        centre: Mass and stiffness as functions of the inputs that they depend on.
        used: Which of all inputs these are.
        count: Number of modes to enclose.
        tolerances: Relative errors of the eigenvalue of each mode that suffice, shape (modes,); 0
            unless given.

    Raises:
        UnprovedError: The box is so wide that the structure may lose its mass or stiffness.
    """
    tolerances = np.zeros(centre.mode_count) if tolerances is None else tolerances
    couplings = _couplings(centre, np.arange(centre.mode_count))
    slopes = np.diagonal(couplings, axis1=1, axis2=2).T  # ∂λ_j/∂u_i at the midpoint, (modes, d)
    relative_slopes = np.abs(slopes) / centre.eigenvalues[:, np.newaxis]
    steepest_input = int(used[relative_slopes.max(axis=0).argmax()])
    mass_decrease, stiffness_decrease = _decreases(centre, steepest_input)
    # Rayleigh quotients φᵀKφ / φᵀMφ, with K between (1 ± κ) K(0) and M between (1 ± μ) M(0), and
    # Courant's minimum principle.
    low_factor = (1 - stiffness_decrease) / (1 + mass_decrease)
    high_factor = (1 + stiffness_decrease) / (1 - mass_decrease)

    nearness = _nearness(centre, couplings)
    # From a nearness of 2 on modes are one block without an attempt to enclose them alone, which
    # fails at some number between 1 and 2.
    is_linked = nearness > 2.0
    blocks = list[Block]()
    bisection_input = None
    free: Ints = np.arange(centre.mode_count)
    while len(free) and free[0] < count and bisection_input is None:
        modes = _linked(is_linked, free[:1], free)
        block = None
        while block is None:
            tolerance = float(tolerances[modes].min())
            block = narrowest_block(modes, rotation(centre, modes), centre, tolerance)
            if block is not None:
                blocks.append(block)
                free = np.setdiff1d(free, modes)
                break
            outside = np.where(np.isin(free, modes), 0.0, nearness[np.ix_(modes, free)])
            inner, outer = np.unravel_index(int(outside.argmax()), outside.shape)
            # Both limits are tuned: the nearness from which a mode may be what hinders the
            # enclosure, and the number of modes of a block, with which the effort grows.
            if outside[inner, outer] < 0.4 or len(modes) >= 12:
                drift = slopes[modes[inner]] - slopes[free[outer]]
                bisection_input = int(used[np.abs(drift).argmax()])
                break
            modes = _linked(is_linked, np.append(modes, free[outer]), free)
    return Subspaces(
        blocks=blocks,
        used=used,
        centre=centre,
        eigenvalue_low=low_factor * centre.eigenvalues,
        eigenvalue_high=high_factor * centre.eigenvalues,
        mass_decrease=mass_decrease,
        stiffness_decrease=stiffness_decrease,
        bisection_input=bisection_input,
    )


def _decreases(centre: CentredMatrices, steepest_input: int) -> tuple[float, float]:
    """Return μ and κ with |M − M(0)| ≤ μ M(0) and |K − K(0)| ≤ κ K(0) over the box.

    The inequalities are those of quadratic forms.

    Args:
        centre: Mass M and stiffness K as Taylor models that are diagonal at the midpoint.
        steepest_input: Index of the input that changes eigenvalues most, for the error.

    Raises:
        UnprovedError: μ or κ is not below 1. Its attribute `along` is `steepest_input`, as the
            input to bisect.
    """
    # S M(0) S and S K(0) S are the identity, but for coordinates without mass
    mass_scale = centre.has_mass
    stiffness_scale = np.diag(centre.stiffness.value) ** -0.5
    mass = max(
        max_eigenvalue_decrease(centre.mass, mass_scale, sign=1.0),
        max_eigenvalue_decrease(centre.mass, mass_scale, sign=-1.0),
    )
    stiffness = max(
        max_eigenvalue_decrease(centre.stiffness, stiffness_scale, sign=1.0),
        max_eigenvalue_decrease(centre.stiffness, stiffness_scale, sign=-1.0),
    )
    if not (mass < 1 and stiffness < 1):
        what = "the structure may lose its stiffness"
        raise UnprovedError(what, "take narrower inputs", steepest_input)
    return mass, stiffness


def centred_matrices(mass: TaylorModel, stiffness: TaylorModel) -> tuple[CentredMatrices, Ints]:
    """Return M and K in coordinates that make both diagonal at the midpoint of the box.

    Unknowns b without mass follow the others a there, x_b = −K_bb⁻¹ K_ba x_a, and have coordinates
    of their own, in which K is as large as the largest eigenvalue. The first coordinates are the
    modes with mass, by rising eigenvalues.

    Args:
        mass: M, a Taylor model of shape (n, n). Its rows are zero where unknowns have no mass.
        stiffness: K, shape (n, n), in the same inputs.

    Returns:
        The matrices as functions of the inputs that M or K depends on, or of the first input if
        they depend on none; and the indices of these inputs, rising.

    Raises:
        UnprovedError: The structure can move rigidly, or is unstable, at the midpoint.
    """
    is_massive = np.asarray(mass.magnitude().any(axis=1))
    M = mass.value
    K = stiffness.value
    n = len(is_massive)
    a = np.flatnonzero(is_massive)
    b = np.flatnonzero(~is_massive)
    massless_values, massless_vectors = np.linalg.eigh(K[np.ix_(b, b)])
    _require_stiff(massless_values, K)
    follow = -(massless_vectors / massless_values) @ massless_vectors.T @ K[np.ix_(b, a)]
    condensed_stiffness = K[np.ix_(a, a)] + K[np.ix_(a, b)] @ follow
    eigenvalues, shapes = undamped_modes(M[np.ix_(a, a)], condensed_stiffness)
    _require_stiff(eigenvalues, eigenvalues)
    basis: Array = np.zeros((n, n))
    basis[a, : len(a)] = shapes
    basis[b, : len(a)] = follow @ shapes
    basis[b, len(a) :] = massless_vectors * np.sqrt(eigenvalues[-1] / massless_values)

    used = np.union1d(mass.active_inputs(), stiffness.active_inputs())
    if not len(used):
        used = np.arange(1)
    modal_mass = basis.T @ mass.restricted_to(used) @ basis
    modal_stiffness = basis.T @ stiffness.restricted_to(used) @ basis
    has_mass = (np.arange(n) < len(a)).astype(float)
    centre = CentredMatrices(
        mass=_with_midpoint(modal_mass, has_mass),
        stiffness=_with_midpoint(modal_stiffness, np.diag(modal_stiffness.value)),
        basis=basis,
        mode_count=len(a),
    )
    return centre, used


def _with_midpoint(matrix: TaylorModel, diagonal: Array) -> TaylorModel:
    """Return a matrix that is exactly diagonal at the midpoint, where it was so but for rounding.

    The difference is added to the remainder, so that the Taylor model contains the same matrices.

    Args:
        matrix: Taylor model of shape (n, n).
        diagonal: The diagonal at the midpoint, shape (n,).
    """
    midpoint = np.diag(diagonal)
    remainder = matrix.remainder + np.abs(matrix.value - midpoint)
    return TaylorModel((midpoint[None], *matrix.parts[1:]), remainder, matrix.inputs, matrix.order)


def _require_stiff(eigenvalues: Array, scale: Array) -> None:
    """Raise UnprovedError unless all eigenvalues are positive by more than rounding of `scale`."""
    if len(eigenvalues) and eigenvalues.min() <= 1e-12 * np.abs(scale).max():
        what = "the structure may move rigidly or lose its stiffness"
        raise UnprovedError(what, "take the method improved-graph-follower")


def _couplings(centre: CentredMatrices, modes: Ints) -> Array:
    """Return first-order changes over the box of K − λ M between some modes, shape (d, p, p).

    λ is the mean of the eigenvalues of both modes. Entry (i, j, k) is the change from the midpoint
    to the end u_i = 1 of input i, in 1/s²; for j = k it is that of the eigenvalue of mode j.

    Args:
        centre: M and K as Taylor models of d inputs, diagonal at the midpoint of the box.
        modes: Indices of p modes, shape (p,).
    """
    rows = modes[:, np.newaxis]
    stiffness = centre.stiffness.homogeneous_part(1)[:, rows, modes]
    mass = centre.mass.homogeneous_part(1)[:, rows, modes]
    eigenvalues = centre.eigenvalues[modes]
    mean = (eigenvalues[:, np.newaxis] + eigenvalues) / 2
    return np.asarray(stiffness - mean * mass)


def _nearness(centre: CentredMatrices, couplings: Array) -> Array:
    """Return how near any two modes come over the box, shape (modes, modes); 0 on the diagonal.

    It is the first-order change of λ_j − λ_k over the box, with their coupling, divided by the
    distance of both at the midpoint. From 1 on two modes may meet at complex inputs of magnitude up
    to 1, and their series diverge. It is infinite for modes of equal frequencies, which have no
    shapes of their own, whether their frequencies separate in the box or not.

    Args:
        centre: The eigenvalues λ at the midpoint, rising, shape (modes,).
        couplings: First-order changes of K − λ M between the modes by each input, shape (d, modes,
            modes).
    """
    slopes = np.diagonal(couplings, axis1=1, axis2=2).T
    of_slopes = np.abs(slopes[:, np.newaxis] - slopes).sum(axis=-1)
    change = of_slopes + 2 * np.abs(couplings).sum(axis=0)
    eigenvalues = centre.eigenvalues
    distance = np.abs(eigenvalues[:, np.newaxis] - eigenvalues)
    # A relative distance of 1e-9 is that of their rounding and some more.
    is_equal = distance <= 1e-9 * np.maximum(eigenvalues[:, np.newaxis], eigenvalues)
    nearness = np.where(is_equal, np.inf, change / np.where(is_equal, 1.0, distance))
    nearness[np.diag_indices_from(nearness)] = 0.0
    return nearness


def _linked(pairs: Mask, modes: Ints, free: Ints) -> Ints:
    """Return the free modes that are linked to some modes, directly or through others, rising.

    The given modes are among them, whether free or not.

    Args:
        pairs: Which modes are linked to which, shape (modes, modes), symmetric.
        modes: Indices of the modes to begin with, shape (begun,), without repetitions.
        free: Indices of the modes that may be added, shape (free,).

    Returns:
        Indices of the modes, rising, shape (linked,).
    """
    while True:
        neighbours = np.intersect1d(free, np.flatnonzero(pairs[modes].any(axis=0)))
        extended = np.union1d(modes, neighbours)
        if len(extended) == len(modes):
            return np.sort(modes)
        modes = extended


def rotation(centre: CentredMatrices, modes: Ints) -> Array:
    """Return a rotation R of p modes after which K − λ M is nearly diagonal over the box, (p, p).

    It is the joint diagonalisation of K − λ M at the midpoint and of its derivatives by all inputs,
    by Jacobi rotations (Cardoso, Souloumiac 1996). So modes that cross keep their shapes at the
    crossing. Any rotation gives valid enclosures: nothing rests on the convergence of at most 12
    sweeps. For p = 1 it is [[1]].

    Args:
        centre: M and K as Taylor models, diagonal at the midpoint of the box.
        modes: Indices of the modes, shape (p,).

    Returns:
        Orthogonal matrix; its column j is the j-th new mode in the present ones.
    """
    p = len(modes)
    at_midpoint = np.diag(centre.eigenvalues[modes])
    matrices = np.concatenate([at_midpoint[None], _couplings(centre, modes)])
    total = np.eye(p)
    for _ in range(12):  # sweeps; Jacobi's method converges quadratically
        largest_angle = 0.0
        for i in range(p):
            for j in range(i):
                # A rotation by φ turns the vector (A_ii − A_jj, 2 A_ij) of each matrix by 2 φ. The
                # sum of its squared second entries is smallest at this angle.
                difference = matrices[:, i, i] - matrices[:, j, j]
                coupling = 2 * matrices[:, i, j]
                on = float(difference @ difference - coupling @ coupling)
                off = float(2 * difference @ coupling)
                angle = np.arctan2(off, on + np.hypot(on, off)) / 2
                step = np.eye(p)
                step[i, i] = step[j, j] = np.cos(angle)
                step[j, i] = np.sin(angle)
                step[i, j] = -np.sin(angle)
                matrices = step.T @ matrices @ step
                total = total @ step
                largest_angle = max(largest_angle, abs(angle))
        if largest_angle < 1e-12:
            break
    return total
