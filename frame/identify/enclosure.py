"""Enclosure of all parameters of a storey frame that agree with ranges of its natural modes.

A mode with a measured shape r obeys T_z = k_z (r_z − r_(z−1)) and T_z − T_(z+1) = λ m_z r_z. Each
product is replaced by its four bounding planes (McCormick, Mathematical Programming 10, 1976), each
exponential of a log parameter by tangents and a secant. A frequency alone gives two rows by the
Rayleigh quotient of a fixed shape and its distance from the eigenvalue (Kato and Temple). The
linear program that results bounds each parameter in turn.

Any multipliers y give a lower bound of the least cᵀx over A x <= b, l <= x <= u: that of yᵀb +
(c − Aᵀy)ᵀx over the box alone. The solver's own multipliers make it sharp, and its tolerances do
not matter (Neumaier and Shcherbina, Mathematical Programming 99, 2004).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from scipy.optimize import linprog
from scipy.sparse import csr_array, hstack

from alphacut.frame.identify.modes import Chain, ModeCut, chain_modes, eigenvalue_ranges
from alphacut.frame.structures.storey import chain_matrix
from alphacut.fuzzy.arrays import Array

Linear = dict[int, float]
"""Linear expression: coefficients by variable; that of CONSTANT stands alone."""
CONSTANT = -1
MAX_PASSES = 6
"""Most passes over all ends."""
MIN_PROGRESS = 0.03
"""Share of the widths that a further pass must take off to be worth another one."""
ROUND_OFF = 1e-13
"""Share of the sums' sizes by which bounds are widened for rounding."""


def enclosure(
    chain: Chain, lower: Array, upper: Array, modes: list[ModeCut]
) -> tuple[Array, Array] | None:
    """Return the corners of a box proved to contain all parameters that agree with the modes.

    Each side is bounded by linear programs, in at most `MAX_PASSES` passes over ever smaller boxes.
    `modes` are ranges of the measured modes at a level, `lower` and `upper` corners (d,) of the
    first box: logarithms of parameters over nominal values.

    Returns:
        Lower and upper corner, shape (d,) each; None where no parameters agree.
    """
    amplitudes: dict[tuple[int, int], tuple[float, float]] = {}
    for _ in range(MAX_PASSES):
        relaxed = relaxation(chain, lower, upper, modes, amplitudes)
        if relaxed is not None and relaxed.shapes:
            amplitudes |= {key: relaxed.ends(shape) for key, shape in relaxed.shapes.items()}
            if any(low > high for low, high in amplitudes.values()):
                return None
            relaxed = relaxation(chain, lower, upper, modes, amplitudes)
        if relaxed is None:
            return None
        width, ends = upper - lower, np.stack([lower, upper])
        for k in np.flatnonzero(width > 0):
            low, high = relaxed.ends(relaxed.parameters[k])
            ends[:, k] = max(low, lower[k]), min(high, upper[k])
        lower, upper = ends
        if (lower > upper).any():
            return None
        has_width = width > 0
        if (1 - (upper - lower)[has_width] / width[has_width]).max(initial=0.0) < MIN_PROGRESS:
            break
    return lower, upper


class Relaxation(NamedTuple):
    """The linear program over a box, with the expressions to bound.

    They are each log parameter, over its nominal value, and the amplitudes that were not measured,
    by mode and floor.
    """

    program: LinearProgram
    parameters: list[Linear]
    shapes: Mapping[tuple[int, int], Linear]

    def ends(self, expression: Linear) -> tuple[float, float]:
        """Return proved least and greatest value of an expression that is not constant."""
        objective = np.zeros(len(self.program.lower))
        for variable, factor in expression.items():
            if variable != CONSTANT:
                objective[variable] = factor
        return self.program.least(objective), -self.program.least(-objective)


def relaxation(
    chain: Chain,
    lower: Array,
    upper: Array,
    modes: list[ModeCut],
    amplitudes: Mapping[tuple[int, int], tuple[float, float]],
) -> Relaxation | None:
    """Return the linear relaxation of all chains over a box; None if their set is proved empty.

    Arguments are those of `enclosure`, with known ends of amplitudes that were not measured, by
    mode and floor.
    """
    chains = _Chains(chain, lower, upper)
    shapes: dict[tuple[int, int], Linear] = {}
    for cut in modes:
        k = cut.mode - 1
        low, high = max(cut.low, chains.lowest[k]), min(cut.high, chains.highest[k])
        if low > high:
            return None
        chains.require_frequency(cut)
        ends = chains.amplitudes(high, cut) if cut.shape else None
        if ends is not None:
            amplitude_ends = {f: amplitudes.get((cut.mode, f), end) for f, end in ends.items()}
            shape = {f: chains.rows.variable(*amplitude_ends[f]) for f in sorted(amplitude_ends)}
            shapes |= {(cut.mode, f): shape[f] for f in shape if f not in cut.shape}
            chains.require_balance(shape, chains.rows.variable(low / high, 1.0), high)
    return Relaxation(chains.rows.program(), chains.logs, shapes)


class _Chains:
    """All chains of a box: variables of their stiffnesses and masses, ends of their spectrum."""

    def __init__(self, chain: Chain, lower: Array, upper: Array) -> None:
        self.chain, self.rows = chain, Rows()
        self.logs = [self.rows.variable(*ends) for ends in zip(lower, upper, strict=True)]
        self.stiffness, self.mass = ([self._factor(x) for x in rows] for rows in chain.powers)
        self.lowest, self.highest = eigenvalue_ranges(chain, lower, upper)
        low, high = chain.ranges(lower, upper)
        self.low, self.high = np.exp(low), np.exp(high)  # factors of stiffness and mass, (2, n)

    def _factor(self, powers: Array) -> Linear:
        """A stiffness or mass over its nominal value: exp of powers times log parameters."""
        exponent: Linear = {CONSTANT: 0.0}
        for log, power in zip(self.logs, powers, strict=True):
            if power:
                exponent = total(exponent, log, float(power))
        return self.rows.exponential(exponent)

    def require_balance(
        self, shape: Mapping[int, Linear], share: Linear, eigenvalue: float
    ) -> None:
        """Add the balance of shears and inertia forces at floors, T_z − T_(z+1) = λ m_z r_z.

        `shape` are amplitudes r by floor, `share` is λ over its greatest value `eigenvalue`.
        """
        rows, chain, n = self.rows, self.chain, len(self.mass)
        unit = float(chain.stiffness.mean())  # of all forces
        shears, below = [], {CONSTANT: 0.0}  # the ground's amplitude
        for z in range(n):
            drift = total(shape[z + 1], below, -1.0)
            shear = rows.product(self.stiffness[z], drift)
            shears.append(scaled(shear, chain.stiffness[z] / unit))
            below = shape[z + 1]
        for z in range(n):
            inertia = rows.product(share, rows.product(self.mass[z], shape[z + 1]))
            force = scaled(inertia, eigenvalue * chain.mass[z] / unit)
            net_force = total(shears[z], shears[z + 1], -1.0) if z + 1 < n else shears[z]
            rows.at_most(total(net_force, force, -1.0))
            rows.at_most(total(force, net_force, -1.0))

    def amplitudes(self, eigenvalue: float, cut: ModeCut) -> dict[int, tuple[float, float]] | None:
        """Range of the amplitude of each floor for λ ≤ `eigenvalue`; None if one is not bounded."""
        # Floors between two measured ones are a chain between moving supports. While λ is below its
        # least eigenvalue, K − λ M is positive definite and bounds its amplitudes by the supports'.
        n, amplitudes = len(self.mass), dict(cut.shape)
        k = np.array([self.rows.range(x) for x in self.stiffness]) * self.chain.stiffness[:, None]
        m = np.array([self.rows.range(x) for x in self.mass]) * self.chain.mass[:, None]
        supports = [0, *sorted(cut.shape)]
        ends = {0: 0.0} | {floor: float(np.abs(cut.shape[floor]).max()) for floor in cut.shape}
        for support, following in zip(supports, [*supports[1:], n + 1], strict=True):
            floors = np.arange(support, min(following, n + 1) - 1)  # from 0
            if not len(floors):
                continue
            # lower bound of K − λ M: least springs, that above included, and greatest masses
            springs = np.append(k[:, 0], 0.0)[np.append(floors, floors[-1] + 1)]
            A = chain_matrix(springs[:-1]) - eigenvalue * np.diag(m[floors, 1])
            A[-1, -1] += springs[-1]
            least = float(np.linalg.eigvalsh(A)[0]) * (1 - 1e-12)
            if least <= 0:
                return None
            force_above = k[following - 1, 1] * ends[following] if following <= n else 0.0
            forces = k[support, 1] * ends[support], force_above  # of both moving supports
            largest = float(sum(forces) if len(floors) == 1 else np.hypot(*forces)) / least
            amplitudes |= {int(floor) + 1: (-largest, largest) for floor in floors}
        return amplitudes

    def require_frequency(self, cut: ModeCut) -> None:
        """Add two inequalities, necessary for an eigenvalue λ to lie within a measured cut.

        They are low − e₁ ≤ xᵀK x / xᵀM x ≤ high + e₂ in the factors of stiffnesses and masses, x
        the mode shape at the middle of the box. e₁ and e₂ bound the distance of quotient and
        eigenvalue by the residual (Kato and Temple). Nothing is added if bounds of the neighbouring
        eigenvalues overlap the quotient.
        """
        chain, low, high, k = self.chain, self.low, self.high, cut.mode - 1
        below = self.highest[k - 1] if k else -np.inf
        above = self.lowest[k + 1] if k + 1 < len(self.lowest) else np.inf
        centre, half = (low + high) / 2, (high - low) / 2
        values, vectors = chain_modes(chain.stiffness * centre[0], chain.mass * centre[1])
        shape, value = vectors[:, k], values[k]
        drift = np.diff(shape, prepend=0.0)
        strain, inertia = chain.stiffness * drift**2, chain.mass * shape**2
        quotient = (
            float(strain @ low[0] / (inertia @ high[1])),
            float(strain @ high[0] / (inertia @ low[1])),
        )
        is_apart = below < min(self.lowest[k], quotient[0])
        if not (is_apart and max(self.highest[k], quotient[1]) < above):
            return
        shears, force = half[0] * np.abs(chain.stiffness * drift), np.abs(chain.mass * shape)
        # of K x − λ M x over the box
        residual = shears + np.append(shears[1:], 0.0) + value * half[1] * force
        # rounding
        residual += 1e-12 * value * force + 1e-13 * np.abs(chain.stiffness).max()
        squared_residual = residual**2 @ (1 / (chain.mass * low[1])) / (inertia @ low[1])
        error_below = squared_residual / (quotient[0] - below) if k else 0.0
        error_above = squared_residual / (above - quotient[1])
        unit = float(inertia.sum() * value)
        for end, sign in ((cut.low - error_below, -1.0), (cut.high + error_above, 1.0)):
            row: Linear = {}
            for z in range(len(self.mass)):
                row = total(row, self.stiffness[z], sign * float(strain[z]) / unit)
                row = total(row, self.mass[z], -sign * end * float(inertia[z]) / unit)
            self.rows.at_most(row, 1e-12)


@dataclass(frozen=True, eq=False)
class LinearProgram:
    """A x <= b, A of shape (r, v), with finite ends l <= x <= u."""

    rows: csr_array
    right: Array
    lower: Array
    upper: Array

    def least(self, objective: Array) -> float:
        """Return a proved lower bound of cᵀx over the set; infinite if the set is proved empty."""
        ends = np.column_stack([self.lower, self.upper])
        result = linprog(objective, A_ub=self.rows, b_ub=self.right, bounds=ends, method="highs")
        if result.status == 2 and self.empty():
            return np.inf
        multipliers = np.zeros(len(self.right))  # which leave the bound over the box
        if result.status == 0:
            multipliers = np.minimum(result.ineqlin.marginals, 0.0)
        # yᵀb + min (c − Aᵀy)ᵀx over the box, the latter by the sign of each reduced cost
        reduced_costs = objective - self.rows.T @ multipliers
        terms = np.where(reduced_costs > 0, reduced_costs * self.lower, reduced_costs * self.upper)
        largest_x = np.maximum(np.abs(self.lower), np.abs(self.upper))
        # sum of the absolute values of all terms, in proportion to which they are rounded
        size = np.abs(multipliers) @ np.abs(self.right) + np.abs(objective) @ largest_x
        size += (abs(self.rows).T @ np.abs(multipliers)) @ largest_x
        return float(multipliers @ self.right + terms.sum() - ROUND_OFF * size)

    def empty(self) -> bool:
        """Return True if it is proved that no x in the box satisfies A x <= b."""
        # phase one: the least t with A x − t <= b for some x is proved to be positive
        rows = csr_array(hstack([self.rows, csr_array(-np.ones((self.rows.shape[0], 1)))]))
        lower, upper = np.append(self.lower, 0.0), np.append(self.upper, 1e3)
        cost = np.append(np.zeros(len(self.lower)), 1.0)
        return LinearProgram(rows, self.right, lower, upper).least(cost) > 0


@dataclass(eq=False)
class Rows:
    """Rows of a linear program: variables with their ends, and inequalities between them."""

    lower: list[float] = field(default_factory=list)
    upper: list[float] = field(default_factory=list)
    entries: list[tuple[int, int, float]] = field(default_factory=list)
    right: list[float] = field(default_factory=list)

    def variable(self, low: float, high: float) -> Linear:
        """Add a variable between two ends and return it; without width it is a constant."""
        if low == high:
            return {CONSTANT: low}
        self.lower.append(low)
        self.upper.append(high)
        return {len(self.lower) - 1: 1.0}

    def range(self, expression: Linear) -> tuple[float, float]:
        """Return least and greatest value of an expression over the ranges of its variables."""
        low = high = expression.get(CONSTANT, 0.0)
        for variable, factor in expression.items():
            if variable != CONSTANT:
                ends = (factor * self.lower[variable], factor * self.upper[variable])
                low, high = low + min(ends), high + max(ends)
        return low, high

    def at_most(self, expression: Linear, limit: float = 0.0) -> None:
        """Add the inequality expression ≤ limit."""
        row = len(self.right)
        self.right.append(limit - expression.get(CONSTANT, 0.0))
        self.entries += [(row, x, factor) for x, factor in expression.items() if x != CONSTANT]

    def product(self, x: Linear, y: Linear) -> Linear:
        """Add and return a variable for the product x y, between four planes (McCormick 1976)."""
        (a, b), (c, d) = self.range(x), self.range(y)
        if a == b or c == d:
            return scaled(y, a) if a == b else scaled(x, c)
        corners = (a * c, a * d, b * c, b * d)
        z = self.variable(min(corners), max(corners))
        for (p, q), sign in (((a, c), -1), ((b, d), -1), ((b, c), 1), ((a, d), 1)):
            plane = total(scaled(y, p), scaled(x, q))
            self.at_most(total(scaled(z, sign), plane, -sign), -sign * p * q)
        return z

    def exponential(self, y: Linear) -> Linear:
        """Add and return a variable for exp(y), between three tangents and the secant."""
        low, high = self.range(y)
        if low == high:
            return {CONSTANT: float(np.exp(low))}
        x = self.variable(float(np.exp(low)) * (1 - 1e-15), float(np.exp(high)) * (1 + 1e-15))
        for point in (low, (low + high) / 2, high):
            value = float(np.exp(point))
            self.at_most(total(scaled(y, value), x, -1.0), value * (point - 1))
        slope = float(np.exp(low) * np.expm1(high - low) / (high - low))
        self.at_most(total(x, scaled(y, slope), -1.0), float(np.exp(low)) - slope * low + 1e-15)
        return x

    def program(self) -> LinearProgram:
        """Return the linear program of all variables and inequalities."""
        row, column, value = np.array(self.entries, float).reshape(-1, 3).T
        shape, indices = (len(self.right), len(self.lower)), (row.astype(int), column.astype(int))
        rows = csr_array((value, indices), shape=shape)
        return LinearProgram(rows, np.array(self.right), np.array(self.lower), np.array(self.upper))


def scaled(x: Linear, factor: float) -> Linear:
    """Return an expression times a number."""
    return {variable: factor * a for variable, a in x.items()}


def total(x: Linear, y: Linear, factor: float = 1.0) -> Linear:
    """Return x + factor · y."""
    result = dict(x)
    for variable, a in y.items():
        result[variable] = result.get(variable, 0.0) + factor * a
    return result
