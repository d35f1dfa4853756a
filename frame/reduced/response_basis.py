"""Basis from harmonic responses: proper orthogonal decomposition in strain energy.

By Parseval's theorem, responses over frequency hold the same shapes as trajectories over time, at
the price of one sparse factorisation each. Strain energy as the measure favours shapes that matter
for drifts, not only for the roof.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Protocol

import numpy as np

from alphacut.frame.calculus.jet import Array
from alphacut.frame.structures.linear import Accelerogram

if TYPE_CHECKING:
    from scipy.sparse import csc_matrix


class LargeStructure(Protocol):
    """Large linear structure: matrices at a parameter set, damping, loads and start."""

    @property
    def rayleigh(self) -> tuple[str, str]:
        """Names of the parameters that multiply M and K."""
        ...

    @property
    def ratio(self) -> str | None:
        """Name of the damping ratio, or None."""
        ...

    @property
    def ground(self) -> Accelerogram | None:
        """Base excitation, or None."""
        ...

    @property
    def excitation(self) -> Array:
        """Rigid motion of the unknowns with the ground, shape (N,)."""
        ...

    @property
    def q0(self) -> Array | None:
        """Initial displacements, shape (N,), or None."""
        ...

    @property
    def v0(self) -> Array | None:
        """Initial velocities, shape (N,), or None."""
        ...

    def assembled(self, p: Mapping[str, float]) -> tuple[csc_matrix, csc_matrix]:
        """Sparse M and K at one parameter set."""
        ...


def response_shapes(structure: LargeStructure, p: Mapping[str, float], frequencies: Array) -> Array:
    """Displacements under harmonic ground motion and of a free vibration, (N, k).

    Args:
        structure: The large structure.
        p: All parameters, in SI units.
        frequencies: Angular frequencies of the load, in rad/s.
    """
    from scipy.sparse.linalg import splu

    M, K = structure.assembled(p)
    D = float(p[structure.rayleigh[0]]) * M + float(p[structure.rayleigh[1]]) * K
    shapes: list[Array] = []
    # modal damping has no sparse matrix: a loss factor of 2 ζ at resonance
    loss = 2j * float(p[structure.ratio]) if structure.ratio else 0.0
    for omega in frequencies:
        solve = splu((K * (1 + loss) + 1j * omega * D - omega**2 * M).tocsc()).solve
        loads = [] if structure.ground is None else [M @ structure.excitation]
        if structure.q0 is not None and structure.q0.any():
            # Fourier transform of the free vibration
            loads.append(1j * omega * (M @ structure.q0) + D @ structure.q0)
        if structure.v0 is not None and structure.v0.any():
            loads.append(M @ structure.v0)
        for x in (solve(load.astype(complex)) for load in loads):
            shapes += [x.real, x.imag]
    if not shapes:
        raise ValueError(
            "reduction: nothing moves the structure; give an accelerogram or an initial state"
        )
    return np.column_stack(shapes)


def energy_basis(
    shapes: Array, M: csc_matrix, K: csc_matrix, *, keep: float, always: Sequence[Array] = ()
) -> Array:
    """M-orthonormal shapes of strain energy above `keep` of the largest, or `always` kept.

    Args:
        shapes: Displacements, shape (N, k).
        M: Mass matrix (N, N).
        K: Stiffness matrix (N, N).
        keep: Share of strain energy.
        always: Further shapes, each (N,).
    """
    energy, vectors = np.linalg.eigh(shapes.T @ (K @ shapes))
    kept = energy > max(keep, 1e-13) * energy.max()
    chosen = np.column_stack([*(shapes @ (vectors[:, kept] / np.sqrt(energy[kept]))).T, *always])
    for _ in range(2):  # the second time takes out what rounding left
        chosen = chosen / np.sqrt(np.einsum("ij,ij->j", chosen, M @ chosen))
        mass, vectors = np.linalg.eigh(chosen.T @ (M @ chosen))
        apart = mass > 1e-12 * mass.max()
        chosen = chosen @ (vectors[:, apart] / np.sqrt(mass[apart]))
    return chosen
