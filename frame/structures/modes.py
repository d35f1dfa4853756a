"""Modes with derivatives, q(t; p) = 2 Re Σ C_k(p) exp(λ_k(p) t), and damping that follows them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from alphacut.frame.calculus.jet import Array, Jet, concatenate, inverse
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


@dataclass(frozen=True, eq=False)
class Modes:
    """Intervening variables of a structure (section 7), smooth in the parameters.

    Args:
        eigenvalue: λ_k with Im λ_k > 0, by rising |λ_k|, complex jet, shape (S, n), in 1/s.
        coefficient: C_k, what the initial state puts into the outputs, shape (S, n, m).
        loads: The same for a unit impulse of each load, shape (S, n, m) each.
    """

    eigenvalue: Jet
    coefficient: Jet
    loads: tuple[Jet, ...]

    def map(self, change: Callable[[Jet], Jet]) -> Modes:
        """Modes with `change` applied to each jet."""
        loads = tuple(change(load) for load in self.loads)
        return Modes(change(self.eigenvalue), change(self.coefficient), loads)


def joined(parts: Sequence[Modes]) -> Modes:
    """Return the modes of several groups of parameter sets as those of one group, in order."""
    return Modes(
        concatenate([part.eigenvalue for part in parts], -2),
        concatenate([part.coefficient for part in parts], -3),
        tuple(concatenate(columns, -3) for columns in zip(*(x.loads for x in parts), strict=True)),
    )


def modes(matrices: Matrices, rows: Jet, pushes: Jet, chosen: Array | None = None) -> Modes:
    """Return eigenvalues and amplitudes of chosen modes at S parameter sets.

    Args:
        matrices: The structure.
        rows: Observation rows, shape (S, m, 2n).
        pushes: Accelerations by a unit of each load, shape (S, n, L).
        chosen: Indices of k modes by rising |λ|; all modes when None.

    Returns:
        Eigenvalues λ, one of each conjugate pair, shape (S, k), and amplitudes of exp(λ t) in each
        output by the start and by a unit impulse of each load, shape (S, k, m).

    Raises:
        ModalError: A chosen mode does not oscillate (overdamped or free to drift).
    """
    values, X, Y = eigenvectors(state_matrix(matrices))
    kept = np.arange(values.value.shape[-1] // 2) if chosen is None else chosen
    values = values[..., kept]
    if not oscillating(values.value).all():
        raise ModalError(
            "a mode does not oscillate: modal intervening variables need damping below critical in"
            " every mode; use graph-follower"
        )
    observed_shapes = rows @ X[..., kept]  # shape (S, m, k)

    def amplitudes(excitation: Jet) -> Jet:
        participation = (Y @ excitation)[..., kept, 0][..., None, :]
        return (observed_shapes * participation).map(lambda x: x.swapaxes(-1, -2))

    states = concatenate([pushes * 0.0, pushes], -2)
    columns = range(pushes.value.shape[-1])
    loads = tuple(amplitudes(states[..., i : i + 1]) for i in columns)
    return Modes(values, amplitudes(matrices.start), loads)


def require_single(matrices: Matrices, chosen: Array) -> None:
    """Refuse a chosen mode that has the eigenvalue of another one at each of S parameter sets.

    Args:
        matrices: The structure.
        chosen: Indices of the modes, by rising |λ|.

    Raises:
        ModalError: There is such a pair.
    """
    eigenvalue = eigenvectors(state_matrix(matrices))[0].value
    size = eigenvalue.shape[-1] // 2
    gaps = np.abs(eigenvalue[:, :size, None] - eigenvalue[:, None, :size]) / np.maximum(
        np.abs(eigenvalue[:, :size, None]), 1e-300
    )
    for first, second in np.argwhere((gaps < DOUBLE).all(0)):
        if first < second and np.isin([first, second], chosen).any():
            raise ModalError(
                f"modal: modes {first + 1} and {second + 1} have the same frequency,"
                f" {np.abs(eigenvalue[0, first]):.4g} rad/s, and so no smooth shapes; take the"
                " method auto or improved-graph-follower"
            )


def oscillating(rate: Array) -> Array:
    """Mask of eigenvalues in the upper of a conjugate pair."""
    return rate.imag > 1e-9 * np.abs(rate)


def eigenvectors(A: Jet) -> tuple[Jet, Jet, Jet]:
    """Return eigenvalues shape (S, 2n), right and left eigenvectors shape (S, 2n, 2n) of A.

    Eigenvalues with Im λ > 0 come first, then real ones, then those with Im λ < 0, each by |λ|.

    With X(p) = X(p0) Z(p), Z(p0) = I and diag Z = I, second-order perturbation in the eigenbasis
    gives all derivatives.
    """
    values, X = np.linalg.eig(A.value)
    group = np.where(oscillating(values), 0, np.where(oscillating(values.conj()), 2, 1))
    order = np.lexsort((np.abs(values), group), axis=-1)
    values, X = np.take_along_axis(values, order, -1), np.take_along_axis(X, order[:, None, :], -1)
    Y = np.linalg.inv(X)
    gap = values[:, None, :] - values[:, :, None]
    size = values.shape[-1]
    off = ~np.eye(size, dtype=bool)
    weight = np.where(off, 1 / np.where(off & (gap != 0), gap, 1.0), 0.0)
    G1, eye = Y @ A.first @ X, np.broadcast_to(np.eye(size), X.shape)
    slope = np.einsum("...kk->...k", G1)
    Z1 = G1 * weight
    if not len(A.second):
        none = np.zeros((0, 0, *X.shape))
        right = X @ Jet(eye, Z1, none)
        return Jet(values, slope, none[..., 0]), right, inverse(right)
    G2 = Y @ A.second @ X
    pair = G1[:, None] @ Z1[None, :] - Z1[:, None] * slope[None, :, :, None, :]
    second = G2 + pair + pair.swapaxes(0, 1)
    Z2 = second * weight
    right = X @ Jet(eye, Z1, Z2)
    return Jet(values, slope, np.einsum("...kk->...k", second)), right, inverse(right)


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
