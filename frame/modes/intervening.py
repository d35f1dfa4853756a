"""Intervening variables of the modes (section 7) as Taylor models with proved remainders.

Functions of the inputs of which the motion is made (Barthelemy, Haftka 1993).

An output is Σ_k Σ_s c_ks e_s(ω_k, g_k; t) over modes k and sources s (loads, velocity, start), with
few numbers a mode: its frequency ω_k, its decay g_k and its shares c_ks = (r·x)(x·M v_s)/(x·M x), r
the output's row and v_s the pattern of the ground or the start. They bend little over the box,
however many inputs it has.

A block of p modes answers a e(L) β with a = r X, β = N⁻¹ Xᵀ M v. Each diagonal entry of L is an
oscillator with the share a_j β_j, as if it were a mode; what couples them is bounded (`rest`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import comb

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.frame.calculus.taylor_model import TaylorModel, concatenate, solve
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.modes.blocks import Block
from alphacut.frame.modes.clusters import Subspaces
from alphacut.frame.modes.structure import Classical
from alphacut.frame.records.history import History
from alphacut.frame.response.oscillators import Grid

MAX_PAIRS = 100_000
"""Pairs of coefficients in a product of two polynomials at most; a pair takes 3 ns."""
DEGREES = (4, 6)
"""Least and greatest degree of shares, before what is above the third is left to the rest."""
Ends = tuple[float, float]
Excitation = tuple[Mapping[str, History], Array, Sequence[str]]
"""The loads by name, the nodes, and the names of what moves the structure."""


@dataclass(frozen=True, eq=False)
class Oscillator:
    """Intervening variables of one mode, or of one diagonal entry of a block."""

    omega: TaylorModel  # ω, a scalar, in rad/s
    decay: TaylorModel  # g, a scalar, in 1/s
    quotient: TaylorModel  # g/ω, a scalar
    share: TaylorModel  # c, (sources, m)
    omega_range: Ends  # least and greatest ω
    quotient_range: Ends  # least and greatest g/ω

    @property
    def models(self) -> list[TaylorModel]:
        """All its models: ω, g, g/ω, c."""
        return [self.omega, self.decay, self.quotient, self.share]

    def on_part(self, models: Sequence[TaylorModel]) -> Oscillator:
        """The same over a part of the box, with its models there."""
        omega, decay, quotient, share = models
        ends = _overlap(_ends(omega), self.omega_range)
        quotients = _overlap(_ends(quotient), self.quotient_range)
        return Oscillator(omega, decay, quotient, share, ends, quotients)

    def places(self, grid: Grid) -> tuple[int, ...]:
        """First and last points of a grid that enclose ω, and those that enclose g/ω."""
        return _places(grid.omega, self.omega_range) + _places(grid.quotient, self.quotient_range)


@dataclass(frozen=True, eq=False)
class BlockShares:
    """What a block takes from sources and gives to outputs, without the outputs' factors."""

    block: Block  # in the inputs of the shares
    read: TaylorModel  # a, (p, m)
    source_forces: TaylorModel  # Xᵀ M v, (p, sources)
    participation: TaylorModel  # β = N⁻¹ Xᵀ M v, (p, sources)

    @classmethod
    def from_block(
        cls, block: Block, rows: TaylorModel, excited: TaylorModel, used: Ints
    ) -> BlockShares:
        """Shares of a block: r X, Xᵀ M v and N⁻¹ Xᵀ M v, of outputs r and sources v, N = Xᵀ M X.

        In the block's coordinates, `rows` r (m, n) are constant but for rounding; `excited` v
        (sources, n) are functions of all inputs, of which the block's are at `used`.
        """
        degree, d = DEGREES[0], block.norm.inputs
        while degree < DEGREES[1] and comb(2 * d + degree + 1, degree + 1) <= MAX_PAIRS:
            degree += 1
        block = block.truncated(min(degree, block.norm.order))
        if len(excited.active_inputs()):
            block = block.truncated(excited.order).embedded(used, excited.inputs)
        else:
            excited = block.norm.like(excited.value).widened(excited.remainder)
        read = (block.shape @ rows.value.T).widened(block.shape.magnitude() @ rows.remainder.T)
        source_forces = block.mass_shape @ excited.T
        return cls(block, read, source_forces, solve(block.norm, source_forces))

    @property
    def share(self) -> TaylorModel:
        """a_j β_j of each column, shape (p, sources, m)."""
        return self.participation[:, :, None] * self.read[:, None, :]

    @property
    def of_outputs(self) -> TaylorModel:
        """Sums a N⁻¹ aᵀ of each output, shape (m,)."""
        return column_products(self.read, solve(self.block.norm, self.read))

    @property
    def of_sources(self) -> TaylorModel:
        """β·N β of each source, shape (sources,)."""
        return column_products(self.source_forces, self.participation)


def oscillators(structure: Classical, of_block: BlockShares, found: Subspaces) -> list[Oscillator]:
    """Intervening variables of the oscillators of a block's columns, with proved ranges.

    With λ = L_jj they are g = a/2 + b λ/2 + ζ √λ, a and b Rayleigh's factors, ω = √(λ − g²), g/ω
    and the shares a_j β_j times the outputs' factors.

    Raises:
        UnprovedError: They have different damping ratios.
    """
    modes, d, order = of_block.block.modes, structure.start.inputs, structure.start.order
    share, rate = (
        x.truncated(order).embedded(found.used, d) for x in (of_block.share, of_block.block.rate)
    )
    ratio = structure.ratio[modes]
    if any((part[:, 1:] != part[:, :-1]).any() for part in ratio.parts):
        raise UnprovedError(
            "modes of different damping ratios may cross", "take one ratio for all modes"
        )
    low, high = 0.0, np.inf  # of √λ
    if len(modes) == 1:
        low, high = (float(np.sqrt(x[modes[0]])) for x in (found.low, found.high))
    a, b = structure.rayleigh[0], structure.rayleigh[1]
    oscillators = list[Oscillator]()
    for j in range(len(modes)):
        squared = rate[j, j]
        decay = a * 0.5 + b * squared * 0.5 + ratio[j] * squared**0.5
        omega = (squared - decay * decay) ** 0.5
        quotient = decay * omega**-1.0
        q_low, q_high = _ends(quotient)
        # ω² = λ / (1 + (g/ω)²)
        omega_range = _overlap(_ends(omega), (float(low / np.sqrt(1 + q_high**2)), high))
        quotient_range = max(q_low, 0.0), q_high
        shares = share[j] * structure.factor
        oscillator = Oscillator(omega, decay, quotient, shares, omega_range, quotient_range)
        oscillators.append(oscillator)
    return oscillators


def damped_range(structure: Classical, low: float, high: float, modes: Ints) -> tuple[Ends, Ends]:
    """Ranges of ω = √(λ − g²) and of g/ω for modes whose λ lie in [low, high], g their decay.

    Raises:
        UnprovedError: One may not oscillate.
    """
    (a_low, b_low), (a, b) = (np.maximum(x, 0.0) for x in structure.rayleigh.bounds())
    zeta_low, zeta = (np.maximum(x, 0.0) for x in structure.ratio[modes].bounds())
    slow, fast = np.sqrt(low), np.sqrt(high)
    # of g/√λ, which is the ratio of damping
    greatest = float(a / (2 * slow) + b * fast / 2 + zeta.max())
    least = float(a_low / (2 * fast) + b_low * slow / 2 + zeta_low.min())
    if greatest >= 1:
        raise UnprovedError("a mode may not oscillate", "take less damping")
    shrinkage = np.sqrt(1 - greatest**2)  # least ω/√λ
    return (float(slow * shrinkage), float(fast)), (least, float(greatest / shrinkage))


def source_patterns(structure: Classical, sources: Sequence[str]) -> TaylorModel:
    """Patterns of the sources on the unknowns, shape (sources, n), in their order."""
    vectors = {
        "load": structure.start[0] * 0.0 + structure.pattern,
        "velocity": structure.start[1],
        "start": structure.start[0],
        **structure.forced,
    }
    return concatenate([vectors[name][None] for name in sources], -2)


def column_products(a: TaylorModel, b: TaylorModel) -> TaylorModel:
    """Σ_j a_js b_js, shape (s,)."""
    return (a * b).T @ np.ones(a.shape[0])


def _ends(x: TaylorModel) -> Ends:
    low, high = x.bounds()
    return float(low), float(high)


def _overlap(first: Ends, second: Ends) -> Ends:
    return max(first[0], second[0]), min(first[1], second[1])


def _places(points: Array, ends: Ends) -> tuple[int, int]:
    """The last point that is no more than a range's lower end, the first no less than its upper."""
    first = int(np.searchsorted(points, ends[0], side="right")) - 1
    last = int(np.searchsorted(points, ends[1]))
    return max(first, 0), min(last, len(points) - 1)
