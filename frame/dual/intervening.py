"""Intervening variables of the modes (section 7) as quadratic models with proved remainders.

An output is Σ_k Σ_s c_ks e_s(ω_k, g_k; t) over modes k and sources s (load, velocity, start):
few numbers a mode, its frequency ω_k = √(λ − g²), its decay g_k = (a + b λ)/2 + ζ √λ and its
shares c_ks = (r·x)(x·M v_s)/(x·M x), r the output's row and v_s the pattern of the ground or the
start. They bend little over the box, however many inputs it has.

Modes that are not enclosed one by one stay together. All modes' shares sum to r·v_s, so that of
the group is known, C; and by Cauchy and Schwarz the motion of the group is within C e ± √(A B)
Δe, where e ± Δe holds all responses in the group's range of ω and g/ω, A and B are what the
single modes leave of r M⁻¹ r and v·M v. For √(A B) stands (A t + B/t)/2, t a number, which is no
less and an expansion: at inputs where A is large B is often small.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from alphacut.frame.dual.eigenpairs import Mode, Modes
from alphacut.frame.dual.expansion import ROUND_OFF, Expansion, product, stacked
from alphacut.frame.dual.homogeneous import Series
from alphacut.frame.dual.structure import Classical, spread
from alphacut.frame.dual.waves import Grid
from alphacut.frame.structures.polynomial_dependence import UnprovedError
from alphacut.fuzzy.arrays import Array, Rows

DEGREE = 6
"""Degree to which shares are expanded, before those above the third are left to the rest."""


@dataclass(frozen=True, eq=False)
class Oscillator:
    """One mode's intervening variables.

    Args:
        omega: ω, V = (), in rad/s.
        decay: g, V = (), in 1/s.
        quotient: g/ω, V = ().
        share: c, V = (sources, m).
        omega_range: Least and greatest ω.
        quotient_range: Least and greatest g/ω.
    """

    omega: Expansion
    decay: Expansion
    quotient: Expansion
    share: Expansion
    omega_range: tuple[float, float]
    quotient_range: tuple[float, float]

    def within(self, low: Array, high: Array) -> Oscillator:
        """The same over a part of the box, low ≤ u ≤ high."""
        every = (self.omega, self.decay, self.quotient, self.share)
        omega, decay, quotient, share = (x.within(low, high) for x in every)
        ends = _overlap(_range(omega), self.omega_range)
        quotients = _overlap(_range(quotient), self.quotient_range)
        return Oscillator(omega, decay, quotient, share, ends, quotients)

    def places(self, grid: Grid) -> tuple[int, ...]:
        """First and last points of a grid that enclose ω, and those that enclose g/ω."""
        return _places(grid.omega, self.omega_range) + _places(grid.quotient, self.quotient_range)


@dataclass(frozen=True, eq=False)
class Group:
    """Modes that stay together.

    Args:
        share: C, V = (sources, m).
        doubt: Bound of √(A B), V = (sources, m).
        omega_range: As of `Oscillator`, of all of them.
        quotient_range: The same.
    """

    share: Expansion
    doubt: Expansion
    omega_range: tuple[float, float]
    quotient_range: tuple[float, float]

    def within(self, low: Array, high: Array) -> Group:
        """The same over a part of the box, low ≤ u ≤ high."""
        share, doubt = (x.within(low, high) for x in (self.share, self.doubt))
        return replace(self, share=share, doubt=doubt)


def oscillators(
    structure: Classical, modes: Modes, sources: tuple[str, ...]
) -> tuple[list[Oscillator], Group | None]:
    """Intervening variables of the single modes, and the group of all others."""
    n, zero = len(modes.basis), structure.start * 0.0
    rows = structure.rows @ modes.basis
    d = zero.inner
    back = Expansion.constant(np.asarray(np.linalg.inv(modes.basis).T, float), d)
    vectors = {
        "load": zero[0] + structure.pattern,
        "velocity": structure.start[1],
        "start": structure.start[0],
    }
    excited = product(stacked([vectors[name] for name in sources]), back, "si,ij->sj")
    single, shares, read, driven = [], [], [], []
    for k, mode in modes.single.items():
        a, mode = mode.shape.through(rows).cut(DEGREE), mode.cut(DEGREE)
        shares.append(_shares(excited, mode, a))
        read.append((a * a).over(mode.norm).expansion(d))
        driven.append(_driven(excited, mode))
        seen = product(shares[-1], structure.factor, "so,o->so")
        single.append(_oscillator(structure, modes, k, mode, seen))
    left = sorted(set(range(n)) - set(modes.single))
    if not left:
        return single, None
    constant = Expansion.constant(rows, d)
    share = product(excited, constant, "sj,oj->so") - sum(shares)
    of_rows = product(product(constant, inverse(modes.mass), "oi,ij->oj"), constant, "oj,oj->o")
    of_start = product(product(excited, modes.mass, "si,ij->sj"), excited, "sj,sj->s")
    omega, quotient = _group_range(structure, modes, np.array(left))
    A = (of_rows - sum(read)).loosened(ROUND_OFF * of_rows.size())
    B = (of_start - sum(driven)).loosened(ROUND_OFF * of_start.size())
    each = [_doubt(A, B[s]) for s in range(len(sources))]
    share, doubt = (product(x, structure.factor, "so,o->so") for x in (share, stacked(each)))
    return single, Group(share, doubt, omega, quotient)


def _doubt(rows: Expansion, start: Expansion) -> Expansion:
    """Bound of √(A B) for A, V = (m,), and B, V = ()."""
    A, B = (np.maximum(x.parts[0] + x.spread(), 1e-300) for x in (rows, start))
    t = np.sqrt(B / A)
    each: Expansion = rows * (t / 2)
    return each + spread(start, 0.5 / t)


def _shares(excited: Expansion, mode: Mode, a: Series) -> Expansion:
    """C = (r·x)(x·M v)/(x·M x) of all sources and outputs, V = (sources, m)."""
    fixed = mode.moved.through(excited.parts[0])
    series = [(a * fixed[s : s + 1]).over(mode.norm) for s in range(len(fixed.rest))]
    share = stacked([one.expansion(excited.inner) for one in series])
    varying = excited + excited.parts[0] * -1.0
    if not varying.size().any():
        return share
    every = a.over(mode.norm).expansion(excited.inner)
    moved = mode.moved.expansion(excited.inner)
    return share + product(product(varying, moved, "sj,j->s"), every, "s,o->so")


def _driven(excited: Expansion, mode: Mode) -> Expansion:
    """(v·M x)²/(x·M x) of all sources, V = (sources,)."""
    d, varying = excited.inner, excited + excited.parts[0] * -1.0
    fixed = mode.moved.through(excited.parts[0])
    if not varying.size().any():
        return (fixed * fixed).over(mode.norm).expansion(d)
    both = fixed.expansion(d) + product(varying, mode.moved.expansion(d), "sj,j->s")
    return product(both * both, mode.norm.expansion(d)[0] ** -1.0, "s,->s")


def _oscillator(
    structure: Classical, modes: Modes, k: int, mode: Mode, share: Expansion
) -> Oscillator:
    squared = mode.squared.expansion(share.inner)[0]
    root = squared**0.5
    a, b = structure.rayleigh[0], structure.rayleigh[1]
    decay = a * 0.5 + b * squared * 0.5 + structure.ratio[k] * root
    omega = (squared - decay * decay) ** 0.5
    quotient = decay * omega**-1.0
    low, high = _range(omega)
    q = _range(quotient)
    top = np.sqrt(modes.high[k])
    least = np.sqrt(modes.low[k] / (1 + q[1] ** 2))
    return Oscillator(
        omega, decay, quotient, share, (max(low, least), min(high, top)), (max(q[0], 0.0), q[1])
    )


def _group_range(
    structure: Classical, modes: Modes, left: Rows
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Ranges of ω and g/ω of modes that are known by their least and greatest λ alone."""
    low, high = modes.low[left].min(), modes.high[left].max()
    a, b = (max(0.0, _range(structure.rayleigh[i])[1]) for i in range(2))
    below = [max(0.0, _range(structure.rayleigh[i])[0]) for i in range(2)]
    ratio = structure.ratio[left]
    zeta = (ratio.parts[0] + ratio.spread()).max(), (ratio.parts[0] - ratio.spread()).min()

    def damping(a: float, b: float, zeta: float, at: float) -> float:
        return float(a / (2 * np.sqrt(at)) + b * np.sqrt(at) / 2 + zeta)

    most = max(damping(a, 0, zeta[0], low) + b * np.sqrt(high) / 2, 0.0)
    least = max(damping(below[0], 0, zeta[1], high) + below[1] * np.sqrt(low) / 2, 0.0)
    if most >= 1:
        raise UnprovedError("a mode may not oscillate", "take less damping")
    steep = np.sqrt(1 - most**2)
    return (float(np.sqrt(low) * steep), float(np.sqrt(high))), (least, float(most / steep))


def _range(x: Expansion) -> tuple[float, float]:
    return float(x.parts[0] - x.spread()), float(x.parts[0] + x.spread())


def _overlap(one: tuple[float, float], other: tuple[float, float]) -> tuple[float, float]:
    return max(one[0], other[0]), min(one[1], other[1])


def _places(points: Array, ends: tuple[float, float]) -> tuple[int, int]:
    """The last point that is no more than a range's lower end, the first no less than its upper."""
    first = int(np.searchsorted(points, ends[0], side="right")) - 1
    last = int(np.searchsorted(points, ends[1]))
    return max(first, 0), min(last, len(points) - 1)


def inverse(mass: Expansion) -> Expansion:
    """M⁻¹ of a matrix near the identity, by Neumann's series."""
    one = np.eye(len(mass.rest))
    step = mass * -1.0 + one
    out = step * 0.0 + one
    for _ in range(3):
        out = step @ out + one
    size = step.size()
    tail = np.linalg.matrix_power(size, 4) @ np.linalg.inv(one - size)
    if np.abs(np.linalg.eigvals(size)).max() >= 1:
        raise UnprovedError("masses vary too much", "take narrower inputs")
    return out.loosened(tail)
