"""What a block's off-diagonal entries add to the motion of its oscillators, bounded.

A block answers a e(L) β with a = r X, β = N⁻¹ Xᵀ M v, of which the diagonal of L gives Σ_j a_j β_j
e(L_jj). With V the eigenvectors of L, N^½ V orthogonal, and F = L off its diagonal, V⁻¹ (e(L) −
e(diag L)) has the entries e[λ_i, L_jj] (V⁻¹ F)_ij (Daleckii, Krein 1965). So the rest is no more
than |a N^-½| Σ_j |β_j| |N^½ F_j| sup |de/dλ|, nor than twice |a N^-½| |N^½ β| times half the range
of e, |β| and |a| with the norm of N; λ_i lie in the discs of Gershgorin about L_jj.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from alphacut.frame.modes.clusters import Subspaces
from alphacut.frame.modes.intervening import BlockShares, Ends, damped_range
from alphacut.frame.modes.rest import Excitation
from alphacut.frame.modes.structure import Classical
from alphacut.frame.response.oscillators import Grid, ModalResponses, Oscillators, grid_over
from alphacut.fuzzy.arrays import Array, Rows

STEP = 0.2
"""Distance of a table's points, as a share of the decay and of the inverse duration."""
MAX_POINTS = 120
"""Points along ω and along g/ω at most."""


@dataclass(frozen=True, eq=False)
class Coupling:
    """What a block's motion has besides that of its oscillators.

    Args:
        slope: Bound of the coupling over sup |de/dλ|, shape (sources, m), in 1/s².
        size: Bound of |a| |β| and of |a N^-½| |N^½ β|, shape (sources, m).
        omega_range: Least and greatest ω of all modes of the block.
        quotient_range: The same of g/ω.
        decay_slope: Bound of |dg/dλ|, in s.
    """

    slope: Array
    size: Array
    omega_range: Ends
    quotient_range: Ends
    decay_slope: float

    def bounds(self, orders: Rows, excitation: Excitation) -> tuple[Array, Array]:
        """Bounds of what the coupling adds to outputs at nodes, and between nodes, (T, m) each.

        The second is of how far a block's motion strays from a straight line in the step to a node.
        `orders` (m,) are the derivatives of the motion that the outputs take.
        """
        loads, time, sources = excitation
        table = Oscillators(self._grid(float(time[-1])), loads, time)
        added, deviation = (np.zeros((len(time), len(orders))) for _ in range(2))
        for order in np.unique(orders):
            o = np.flatnonzero(orders == order)
            for s, source in enumerate(sources):
                wave = table.responses(source, int(order))
                half = np.ptp(wave.value, axis=(1, 2)) / 2 + wave.error
                by_slope = np.outer(self._slope(wave, source), self.slope[s, o])
                added[:, o] += np.minimum(by_slope, 2 * np.outer(half, self.size[s, o]))
                deviation[:, o] += np.outer(wave.line_deviation, self.size[s, o])
        return added, deviation

    def _grid(self, duration: float) -> Grid:
        """Points over the block's ranges."""
        (low, high), (least, most) = self.omega_range, self.quotient_range
        reach = STEP * (least * low + 2 / max(duration, 1e-300))
        points = (high - low) / reach, (most - least) * high / reach
        across, along = (int(np.clip(x, 1, MAX_POINTS)) + 1 for x in points[::-1])
        return grid_over(self.omega_range, self.quotient_range, (along, across))

    def _slope(self, wave: ModalResponses, source: str) -> Array:
        """Bound of |de/dλ| over the block's ranges of ω and g/ω, shape (T,).

        e is Re G + (g/ω) Im G for a start and ± Im G/ω else, with G(σ; t), σ = −g + iω.
        """
        (low, high), q = self.omega_range, self.quotient_range[1]
        decay_slope = self.decay_slope
        omega_slope = (1 + 2 * q * high * decay_slope) / (2 * low)  # ω² = λ − g²
        G, G_slope = wave.largest
        if source == "start":
            by_sigma = (1 + q) * G_slope * (decay_slope + omega_slope)
            return np.asarray(by_sigma + G * (decay_slope + q * omega_slope) / low)
        by_sigma = G_slope * (decay_slope + omega_slope) / low
        return np.asarray(by_sigma + G * omega_slope / low**2)


def coupling_of(structure: Classical, shares: BlockShares, found: Subspaces) -> Coupling:
    """Bounds of how the modes of a block couple, by L of K X = M X L off its diagonal."""
    block = shares.block
    off = block.rate.size() * (1.0 - np.eye(len(block.modes)))
    norm = 1 + float(np.linalg.norm(block.norm.spread(), 2))
    read = np.sqrt(shares.of_outputs.size()) * structure.factor.size()
    of_columns = np.sqrt(norm) * np.linalg.norm(off, axis=1)
    slope = (shares.participation.size().T @ of_columns)[:, None] * read
    size = norm * np.sqrt(shares.of_sources.size())[:, None] * read
    j = np.arange(len(off))
    low, high = block.rate[j, j].bounds()  # the λ lie in Gershgorin's discs about L_jj
    lambda_low = max(float((low - off.sum(1)).min()), float(found.low[block.modes[0]]))
    lambda_high = min(float((high + off.sum(1)).max()), float(found.high[block.modes[-1]]))
    omega, quotient = damped_range(structure, lambda_low, lambda_high, block.modes)
    zeta, b = structure.ratio[block.modes].size().max(), structure.rayleigh[1].size()
    decay_slope = float(b / 2 + zeta / (2 * np.sqrt(lambda_low)))
    return Coupling(
        slope=slope, size=size, omega_range=omega, quotient_range=quotient, decay_slope=decay_slope
    )
