"""Enclosure of all parameters of a storey frame that agree with ranges of its natural modes.

A mode with a measured shape r obeys T_z = k_z (r_z − r_(z−1)) and T_z − T_(z+1) = λ m_z r_z. Each
product is replaced by its four bounding planes (McCormick, Mathematical Programming 10, 1976), each
exponential of a log parameter by tangents and a secant. A frequency alone gives two rows by the
Rayleigh quotient of a fixed shape and its distance from the eigenvalue (Kato and Temple). The
linear program that results bounds each parameter in turn.

Any multipliers y ≤ 0 give a lower bound of the least cᵀx over A x ≤ 0, l ≤ x ≤ u: that of
(c − Aᵀy)ᵀx over the box alone. The solver's own multipliers make it sharp, and its tolerances do
not matter (Neumaier and Shcherbina, Mathematical Programming 99, 2004).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.sparse import csr_array, hstack

from alphacut.base.arrays import Array
from alphacut.frame.identify.modes import Chain, ModeCut, chain_modes, eigenvalue_ranges
from alphacut.frame.structures.storey import chain_matrix

MAX_PASSES = 6  # over all ends
MIN_PROGRESS = 0.03  # fraction of the widths that a pass must take off to be worth another one
ROUND_OFF = 1e-13  # fraction of the sums' sizes by which bounds are widened for rounding


def enclosure(
    chain: Chain, lower: Array, upper: Array, modes: Sequence[ModeCut]
) -> tuple[Array, Array] | None:
    """Return the corners of a box proved to contain all parameters that agree with the modes.

    Each side is bounded by linear programs, in at most `MAX_PASSES` passes over ever smaller boxes.
    `modes` are ranges of the measured modes at a level, `lower` and `upper` corners (d,) of the
    first box: logarithms of parameters over nominal values. None where no parameters agree.
    """
    lower, upper = lower.copy(), upper.copy()
    amplitudes: dict[tuple[int, int], tuple[float, float]] = {}  # not measured, by mode and floor
    for _ in range(MAX_PASSES):
        relaxation = ChainRelaxation(chain, lower, upper, modes, amplitudes)
        if relaxation.unmeasured and not relaxation.is_empty:
            amplitudes |= {key: relaxation.bounds(x) for key, x in relaxation.unmeasured.items()}
            if any(low > high for low, high in amplitudes.values()):
                return None
            relaxation = ChainRelaxation(chain, lower, upper, modes, amplitudes)
        if relaxation.is_empty:
            return None
        has_width, width = upper > lower, upper - lower
        for k in np.flatnonzero(has_width):
            low, high = relaxation.bounds(relaxation.logs[k])
            lower[k], upper[k] = max(low, lower[k]), min(high, upper[k])
        if (lower > upper).any():
            return None
        if (1 - (upper - lower)[has_width] / width[has_width]).max(initial=0.0) < MIN_PROGRESS:
            break
    return lower, upper


class LinearRelaxation:
    """Linear program A x ≤ 0, l ≤ x ≤ u, with products and exponentials between planes.

    An expression is an array of the coefficients of at most `size` variables, shape (size,). The
    first variable is 1, so that its coefficient is the constant.
    """

    def __init__(self, size: int) -> None:
        self.lower, self.upper = np.zeros((2, size))
        self.lower[0] = self.upper[0] = 1.0
        self.one: Array = np.eye(1, size)[0]
        self.count, self.rows = 1, list[Array]()  # rows are expressions that are 0 at most

    def variable(self, low: float, high: float) -> Array:
        """Add a variable between two ends and return it; without width it is a constant."""
        if low == high:
            return low * self.one
        self.lower[self.count], self.upper[self.count] = low, high
        self.count += 1
        return np.asarray(np.eye(1, len(self.one), self.count - 1)[0])

    def range(self, expression: Array) -> tuple[float, float]:
        """Return least and greatest value of an expression over the ranges of its variables."""
        ends = np.sort([expression * self.lower, expression * self.upper], axis=0).sum(1)
        return float(ends[0]), float(ends[1])

    def product(self, x: Array, y: Array) -> Array:
        """Add and return a variable for the product x y, between four planes (McCormick 1976)."""
        (a, b), (c, d) = self.range(x), self.range(y)
        if a == b or c == d:
            return y * a if a == b else x * c
        corners = (a * c, a * d, b * c, b * d)
        z = self.variable(min(corners), max(corners))
        for p, q, sign in ((a, c, -1), (b, d, -1), (b, c, 1), (a, d, 1)):
            self.rows.append(sign * (z - p * y - q * x + p * q * self.one))
        return z

    def exponential(self, y: Array) -> Array:
        """Add and return a variable for exp(y), between three tangents and the secant."""
        low, high = self.range(y)
        if low == high:
            return float(np.exp(low)) * self.one
        x = self.variable(float(np.exp(low)) * (1 - 1e-15), float(np.exp(high)) * (1 + 1e-15))
        for point in (low, (low + high) / 2, high):
            self.rows.append(np.exp(point) * (y + (1 - point) * self.one) - x)
        slope = np.exp(low) * np.expm1(high - low) / (high - low)
        self.rows.append(x - slope * y - (np.exp(low) - slope * low + 1e-15) * self.one)
        return x

    def bounds(self, expression: Array) -> tuple[float, float]:
        """Return proved least and greatest value of an expression."""
        program = csr_array(np.reshape(self.rows, (-1, len(self.one)))), self.lower, self.upper
        return proved_minimum(expression, *program), -proved_minimum(-expression, *program)


def proved_minimum(objective: Array, rows: csr_array, lower: Array, upper: Array) -> float:
    """Return a lower bound of cᵀx over A x ≤ 0, l ≤ x ≤ u; infinite if the set is proved empty."""
    from scipy.optimize import linprog  # which takes time to import

    right, ends = np.zeros(rows.shape[0]), np.column_stack([lower, upper])
    result = linprog(objective, A_ub=rows, b_ub=right, bounds=ends, method="highs")
    if result.status == 2:  # phase one: the least t with A x − t ≤ 0 for some x is proved positive
        relaxed = csr_array(hstack([rows, csr_array(-np.ones((rows.shape[0], 1)))]))
        slack = np.append(np.zeros(len(lower)), 1.0)
        if proved_minimum(slack, relaxed, np.append(lower, 0.0), np.append(upper, 1e3)) > 0:
            return np.inf
    multipliers = right  # zero, which leaves the bound over the box
    if result.status == 0:
        multipliers = np.minimum(result.ineqlin.marginals, 0.0)
    # min (c − Aᵀy)ᵀx over the box, by the sign of each reduced cost
    reduced_costs = objective - rows.T @ multipliers
    terms = np.where(reduced_costs > 0, reduced_costs * lower, reduced_costs * upper)
    # sum of the absolute values of all terms, in proportion to which they are rounded
    sizes = np.abs(objective) + abs(rows).T @ np.abs(multipliers)
    return float(terms.sum() - ROUND_OFF * sizes @ np.maximum(np.abs(lower), np.abs(upper)))


class ChainRelaxation(LinearRelaxation):
    """Linear relaxation of all chains of a box whose modes lie in measured ranges.

    Args are those of `enclosure`; `known` are ends of amplitudes that were not measured, by mode
    and floor.

    Attributes:
        logs: Logarithm of each parameter over its nominal value, as an expression.
        stiffness: Stiffness of each storey over its nominal value, as an expression.
        mass: Mass of each floor over its nominal value, as an expression.
        unmeasured: Amplitudes at floors without a sensor, as expressions, by mode and floor.
        lowest: Lower bounds of all eigenvalues, shape (n,), in 1/s².
        highest: Upper bounds of them.
        is_empty: Whether no chain of the box has such eigenvalues.
    """

    def __init__(
        self,
        chain: Chain,
        lower: Array,
        upper: Array,
        modes: Sequence[ModeCut],
        known: Mapping[tuple[int, int], tuple[float, float]],
    ) -> None:
        n = len(chain.mass)
        # parameters, stiffnesses and masses; of each mode amplitudes, λ and three products a floor
        super().__init__(1 + len(lower) + 2 * n + len(modes) * (4 * n + 1))
        self.chain = chain
        self.logs = [self.variable(*ends) for ends in zip(lower, upper, strict=True)]
        self.stiffness, self.mass = (
            [self.exponential(row @ np.array(self.logs)) for row in rows] for rows in chain.powers
        )
        self.lowest, self.highest = eigenvalue_ranges(chain, lower, upper)
        low, high = chain.ranges(lower, upper)
        self.low, self.high = np.exp(low), np.exp(high)  # factors of stiffness and mass, (2, n)
        self.unmeasured: dict[tuple[int, int], Array] = {}
        least = {cut.mode: max(cut.low, self.lowest[cut.mode - 1]) for cut in modes}
        greatest = {cut.mode: min(cut.high, float(self.highest[cut.mode - 1])) for cut in modes}
        self.is_empty = any(least[mode] > greatest[mode] for mode in least)
        for cut in () if self.is_empty else modes:
            self.add_frequency(cut)
            eigenvalue = greatest[cut.mode]
            if cut.shape and (ends := self.amplitude_ranges(eigenvalue, cut)) is not None:
                ends |= {z: known[cut.mode, z] for z in ends if (cut.mode, z) in known}
                shape = {floor: self.variable(*ends[floor]) for floor in sorted(ends)}
                unmeasured = shape.keys() - cut.shape.keys()
                self.unmeasured |= {(cut.mode, floor): shape[floor] for floor in unmeasured}
                relative = self.variable(least[cut.mode] / eigenvalue, 1.0)
                self.add_balance(shape, relative, eigenvalue)

    def add_balance(
        self, shape: Mapping[int, Array], relative_eigenvalue: Array, eigenvalue: float
    ) -> None:
        """Add the balance at floors, T_z − T_(z+1) = λ m_z r_z, with λ over its greatest value."""
        chain, n = self.chain, len(self.mass)
        unit = float(chain.stiffness.mean())  # of all forces
        shears, below = [], 0.0 * self.one  # the ground's amplitude
        for z in range(n):
            shear = self.product(self.stiffness[z], shape[z + 1] - below)
            shears.append(shear * (chain.stiffness[z] / unit))
            below = shape[z + 1]
        for z, above in enumerate([*shears[1:], 0.0 * self.one]):
            inertia = self.product(relative_eigenvalue, self.product(self.mass[z], shape[z + 1]))
            imbalance = shears[z] - above - inertia * (eigenvalue * chain.mass[z] / unit)
            self.rows.append(imbalance)
            self.rows.append(-imbalance)

    def amplitude_ranges(
        self, eigenvalue: float, cut: ModeCut
    ) -> dict[int, tuple[float, float]] | None:
        """Range of the amplitude of each floor for λ ≤ `eigenvalue`; None if one is not bounded."""
        # Floors between two measured ones are a chain between moving supports. While λ is below its
        # least eigenvalue, K − λ M is positive definite and bounds its amplitudes by the supports'.
        n, amplitudes = len(self.mass), dict(cut.shape)
        k = np.array([self.range(x) for x in self.stiffness]) * self.chain.stiffness[:, None]
        m = np.array([self.range(x) for x in self.mass]) * self.chain.mass[:, None]
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

    def add_frequency(self, cut: ModeCut) -> None:
        """Add two inequalities, necessary for an eigenvalue to lie within a measured cut."""
        # low − e₁ ≤ xᵀK x / xᵀM x ≤ high + e₂ in the factors of stiffnesses and masses, x the mode
        # shape at the middle of the box. e₁ and e₂ bound the distance of quotient and eigenvalue by
        # the residual (Kato and Temple), where no neighbouring eigenvalue reaches the quotient.
        chain, low, high, k = self.chain, self.low, self.high, cut.mode - 1
        below = self.highest[k - 1] if k else -np.inf
        above = self.lowest[k + 1] if k + 1 < len(self.lowest) else np.inf
        centre, half = (low + high) / 2, (high - low) / 2
        values, vectors = chain_modes(chain.stiffness * centre[0], chain.mass * centre[1])
        shape, value = vectors[:, k], values[k]
        drift = np.diff(shape, prepend=0.0)
        strain, inertia = chain.stiffness * drift**2, chain.mass * shape**2
        least_quotient = float(strain @ low[0] / (inertia @ high[1]))
        greatest_quotient = float(strain @ high[0] / (inertia @ low[1]))
        is_above_last = below < min(self.lowest[k], least_quotient)
        if not (is_above_last and max(self.highest[k], greatest_quotient) < above):
            return
        shears, force = half[0] * np.abs(chain.stiffness * drift), np.abs(chain.mass * shape)
        # of K x − λ M x over the box
        residual = shears + np.append(shears[1:], 0.0) + value * half[1] * force
        # rounding
        residual += 1e-12 * value * force + 1e-13 * np.abs(chain.stiffness).max()
        squared_residual = residual**2 @ (1 / (chain.mass * low[1])) / (inertia @ low[1])
        error_below = squared_residual / (least_quotient - below) if k else 0.0
        error_above = squared_residual / (above - greatest_quotient)
        unit = float(inertia.sum() * value)
        strains, inertias = strain @ np.array(self.stiffness), inertia @ np.array(self.mass)
        for end, sign in ((cut.low - error_below, -1.0), (cut.high + error_above, 1.0)):
            row = sign * (strains - end * inertias) / unit
            self.rows.append(row - 1e-12 * self.one)
