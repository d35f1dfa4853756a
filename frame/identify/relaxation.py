"""Linear inequalities that every chain with the measured modes fulfils over a box of parameters.

A mode with a measured shape r obeys T_z = k_z (r_z − r_(z−1)) and T_z − T_(z+1) = λ m_z r_z. Each
product is replaced by its four bounding planes (McCormick, Mathematical Programming 10, 1976), each
exponential of a log parameter by tangents and a secant. A frequency alone gives two rows by the
Rayleigh quotient of a fixed shape and its distance from the eigenvalue (Kato and Temple).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from scipy.sparse import csr_array

from alphacut.frame.identify.chain import Chain, chain_modes, eigenvalue_ranges
from alphacut.frame.identify.linear_bounds import LinearProgram
from alphacut.frame.identify.measured import MeasuredMode, ModeCut
from alphacut.fuzzy.arrays import Array

Linear = dict[int, float]
"""Coefficients by variable; that of CONSTANT stands alone."""
CONSTANT = -1


@dataclass(eq=False)
class Rows:
    """Variables with their ends, and inequalities between them."""

    lower: list[float] = field(default_factory=list)
    upper: list[float] = field(default_factory=list)
    entries: list[tuple[int, int, float]] = field(default_factory=list)
    right: list[float] = field(default_factory=list)

    def variable(self, low: float, high: float) -> Linear:
        """A new variable; one without width is a constant."""
        if low == high:
            return {CONSTANT: low}
        self.lower.append(low)
        self.upper.append(high)
        return {len(self.lower) - 1: 1.0}

    def range(self, expression: Linear) -> tuple[float, float]:
        """Ends of an expression over the variables' ends."""
        low = high = expression.get(CONSTANT, 0.0)
        for at, a in expression.items():
            if at != CONSTANT:
                ends = (a * self.lower[at], a * self.upper[at])
                low, high = low + min(ends), high + max(ends)
        return low, high

    def at_most(self, expression: Linear, limit: float = 0.0) -> None:
        """Require an expression to be at most a limit."""
        row = len(self.right)
        self.right.append(limit - expression.get(CONSTANT, 0.0))
        self.entries += [(row, at, a) for at, a in expression.items() if at != CONSTANT]

    def equal(self, one: Linear, other: Linear) -> None:
        """Require two expressions to be equal."""
        self.at_most(total(one, other, -1.0))
        self.at_most(total(other, one, -1.0))

    def product(self, x: Linear, y: Linear) -> Linear:
        """Variable that stands for a product, between its four planes."""
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
        """Variable that stands for exp(y), between three tangents and the secant."""
        low, high = self.range(y)
        if low == high:
            return {CONSTANT: float(np.exp(low))}
        x = self.variable(float(np.exp(low)) * (1 - 1e-15), float(np.exp(high)) * (1 + 1e-15))
        for at in (low, (low + high) / 2, high):
            value = float(np.exp(at))
            self.at_most(total(scaled(y, value), x, -1.0), value * (at - 1))
        slope = float(np.exp(low) * np.expm1(high - low) / (high - low))
        self.at_most(total(x, scaled(y, slope), -1.0), float(np.exp(low)) - slope * low + 1e-15)
        return x

    def program(self) -> LinearProgram:
        """The linear program of all rows."""
        row, column, value = np.array(self.entries, float).reshape(-1, 3).T
        shape, places = (len(self.right), len(self.lower)), (row.astype(int), column.astype(int))
        rows = csr_array((value, places), shape=shape)
        return LinearProgram(rows, np.array(self.right), np.array(self.lower), np.array(self.upper))


def scaled(x: Linear, factor: float) -> Linear:
    """An expression times a number."""
    return {at: factor * a for at, a in x.items()}


def total(x: Linear, y: Linear, factor: float = 1.0) -> Linear:
    """Sum x + factor · y."""
    result = dict(x)
    for at, a in y.items():
        result[at] = result.get(at, 0.0) + factor * a
    return result


@dataclass(frozen=True, eq=False)
class Relaxation:
    """The linear program over a box, with the expressions to bound.

    Args:
        program: The program.
        parameters: Expression of each log parameter, over its nominal value.
        shapes: Expression of each amplitude that was not measured, by mode and floor.
    """

    program: LinearProgram
    parameters: tuple[Linear, ...]
    shapes: Mapping[tuple[int, int], Linear]

    def least(self, expression: Linear, sign: float = 1.0) -> float:
        """Proved lower bound of sign · expression, without its constant."""
        objective = np.zeros(len(self.program.lower))
        for at, a in expression.items():
            if at != CONSTANT:
                objective[at] = sign * a
        return self.program.least(objective)


def relaxation(
    chain: Chain,
    lower: Array,
    upper: Array,
    modes: list[tuple[MeasuredMode, ModeCut]],
    amplitudes: Mapping[tuple[int, int], tuple[float, float]],
) -> Relaxation | None:
    """The linear program over a box of log parameters (d,); None where it proves it empty.

    Args:
        chain: The frame.
        lower: Lower ends of the log parameters over their nominal values.
        upper: Upper ends.
        modes: Measured modes and their cuts at a level.
        amplitudes: Known ends of amplitudes that were not measured, by mode and floor.
    """
    rows = Rows()
    logs = [rows.variable(low, high) for low, high in zip(lower, upper, strict=True)]
    stiffness = [rows.exponential(_sum(logs, powers)) for powers in chain.stiffness_powers]
    mass = [rows.exponential(_sum(logs, powers)) for powers in chain.mass_powers]
    least, most = eigenvalue_ranges(chain, lower, upper)
    shapes: dict[tuple[int, int], Linear] = {}
    for mode, cut in modes:
        low, high = max(cut.low, least[mode.mode - 1]), min(cut.high, most[mode.mode - 1])
        if low > high:
            return None
        _frequency_rows(rows, chain, stiffness, mass, (lower, upper), (least, most), mode, cut)
        if mode.reference:
            ends = _all_amplitudes(rows, chain, stiffness, mass, high, cut)
            if ends is None:
                continue
            known = {f: amplitudes.get((mode.mode, f), end) for f, end in ends.items()}
            shape = {f: rows.variable(*known[f]) for f in sorted(known)}
            shapes |= {(mode.mode, f): shape[f] for f in shape if f not in cut.shape}
            _shape_rows(rows, chain, stiffness, mass, shape, rows.variable(low / high, 1.0), high)
    return Relaxation(rows.program(), tuple(logs), shapes)


def _sum(logs: list[Linear], powers: Array) -> Linear:
    result: Linear = {}
    for log, power in zip(logs, powers, strict=True):
        if power:
            result = total(result, log, float(power))
    return result or {CONSTANT: 0.0}


def _shape_rows(
    rows: Rows,
    chain: Chain,
    stiffness: list[Linear],
    mass: list[Linear],
    shape: Mapping[int, Linear],
    share: Linear,
    eigenvalue: float,
) -> None:
    """Balance of forces at each floor; λ is `share` of its greatest value `eigenvalue`."""
    n, unit = len(mass), float(chain.stiffness.mean())
    below: Linear = {CONSTANT: 0.0}
    shears = []
    for z in range(n):
        drift = total(shape[z + 1], below, -1.0)
        shears.append(scaled(rows.product(stiffness[z], drift), chain.stiffness[z] / unit))
        below = shape[z + 1]
    for z in range(n):
        inertia = rows.product(share, rows.product(mass[z], shape[z + 1]))
        force = scaled(inertia, eigenvalue * chain.mass[z] / unit)
        rows.equal(total(shears[z], shears[z + 1], -1.0) if z + 1 < n else shears[z], force)


def _all_amplitudes(
    rows: Rows,
    chain: Chain,
    stiffness: list[Linear],
    mass: list[Linear],
    eigenvalue: float,
    cut: ModeCut,
) -> dict[int, tuple[float, float]] | None:
    """Ends of all amplitudes; None where those of floors between measured ones cannot be bounded.

    Floors between two measured ones are a chain between moved supports, whose matrix K − λ M is
    positive definite while λ stays below its own least frequency.
    """
    n, amplitudes = len(mass), dict(cut.shape)
    k = np.array([rows.range(x) for x in stiffness]) * chain.stiffness[:, None]
    m = np.array([rows.range(x) for x in mass]) * chain.mass[:, None]
    pins = [0, *sorted(cut.shape)]
    ends = {0: 0.0} | {floor: float(np.abs(cut.shape[floor]).max()) for floor in cut.shape}
    for pin, following in zip(pins, [*pins[1:], n + 1], strict=True):
        floors = list(range(pin + 1, min(following, n + 1)))
        if not floors:
            continue
        size = len(floors)
        A = np.zeros((size, size))
        for i, floor in enumerate(floors):
            A[i, i] = k[floor - 1, 0] - eigenvalue * m[floor - 1, 1]
            A[i, i] += k[floor, 0] if floor < n else 0.0
            if i + 1 < size:
                A[i, i + 1] = A[i + 1, i] = -k[floor, 0]
        least = float(np.linalg.eigvalsh(A)[0]) * (1 - 1e-12)
        if least <= 0:
            return None
        right = k[pin, 1] * ends[pin]
        if following <= n:
            right = float(np.hypot(right, k[following - 1, 1] * ends[following]))
            if size == 1:
                right = k[pin, 1] * ends[pin] + k[following - 1, 1] * ends[following]
        amplitudes |= {floor: (-right / least, right / least) for floor in floors}
    return amplitudes


def _frequency_rows(
    rows: Rows,
    chain: Chain,
    stiffness: list[Linear],
    mass: list[Linear],
    box: tuple[Array, Array],
    spectrum: tuple[Array, Array],
    mode: MeasuredMode,
    cut: ModeCut,
) -> None:
    """Two rows by the Rayleigh quotient of the shape at the middle of the box."""
    (least, most), k = spectrum, mode.mode - 1
    below = most[k - 1] if k else -np.inf
    above = least[k + 1] if k + 1 < len(least) else np.inf
    low, high = chain.ranges(*box)
    centre = (np.exp(low) + np.exp(high)) / 2
    values, vectors = chain_modes(chain.stiffness * centre[0], chain.mass * centre[1])
    shape, value = vectors[:, k], values[k]
    drift = np.diff(shape, prepend=0.0)
    strain, inertia = chain.stiffness * drift**2, chain.mass * shape**2
    quotient = (
        float(strain @ np.exp(low[0]) / (inertia @ np.exp(high[1]))),
        float(strain @ np.exp(high[0]) / (inertia @ np.exp(low[1]))),
    )
    if not below < min(least[k], quotient[0]) or not max(most[k], quotient[1]) < above:
        return
    half = (np.exp(high) - np.exp(low)) / 2
    shears = half[0] * np.abs(chain.stiffness * drift)
    residual = shears + np.append(shears[1:], 0.0) + value * half[1] * np.abs(chain.mass * shape)
    residual += 1e-12 * value * np.abs(chain.mass * shape) + 1e-13 * np.abs(chain.stiffness).max()
    size = residual**2 @ (1 / (chain.mass * np.exp(low[1]))) / (inertia @ np.exp(low[1]))
    over = size / (quotient[0] - below) if k else 0.0
    under = size / (above - quotient[1])
    unit = float(inertia.sum() * value)
    for end, sign in ((cut.low - over, -1.0), (cut.high + under, 1.0)):
        row: Linear = {}
        for z in range(len(mass)):
            row = total(row, stiffness[z], sign * float(strain[z]) / unit)
            row = total(row, mass[z], -sign * end * float(inertia[z]) / unit)
        rows.at_most(row, 1e-12)
