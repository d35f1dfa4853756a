"""Enclosure of all parameters of a storey frame that agree with ranges of its natural modes.

A mode with the eigenvalue λ and the shape r obeys T_z = k_z (r_z - r_(z-1)) for the shear force of
each storey and T_z - T_(z+1) = λ m_z r_z for each floor. Each product of two variables is enclosed
by its four bounding planes (McCormick, Mathematical Programming 10, 147, 1976), and each
exponential of a logarithm of a parameter by tangents and a secant. A frequency alone gives two
inequalities by the Rayleigh quotient of a fixed shape and its distance from the eigenvalue (Kato
and Temple). The result is a linear relaxation: every frame with such modes is one of its solutions.
Linear programs bound each parameter in turn.

The optimal value of a linear program is computed with rounding and tolerances. It is made a proved
bound as follows. For any multipliers y ≤ 0, the minimum of cᵀx over A x ≤ 0 and l ≤ x ≤ u is at
least the minimum of (c - Aᵀy)ᵀx over l ≤ x ≤ u alone, because yᵀA x ≥ 0. The multipliers of the
solver make this bound sharp (Neumaier and Shcherbina, Mathematical Programming 99, 283, 2004).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from alphacut.base.arrays import Array
from alphacut.frame.identification.modes import Chain, ModeCut, chain_modes, eigenvalue_ranges
from alphacut.frame.structures.storey import chain_matrix

if TYPE_CHECKING:
    from scipy.sparse import csr_array


def enclosure(
    chain: Chain, lower: Array, upper: Array, modes: Sequence[ModeCut]
) -> tuple[Array, Array] | None:
    """Return a box that contains all parameters that agree with ranges of measured modes.

    Linear programs with proved bounds narrow each side in up to six passes over ever smaller boxes.
    That the box contains all such parameters is proved; it may contain others, too.

    Args:
        chain: The frame as a chain of masses on springs, and its uncertain parameters.
        lower: Lower ends of the first box, shape (parameters,): logarithms of the parameters over
            their nominal values.
        upper: Upper ends of the first box.
        modes: Ranges of the eigenvalue, and of the measured amplitudes, of each mode.

    Returns:
        Lower and upper ends of the box in the same logarithms, within the first box; or None if it
        is proved that no parameters agree with the modes.
    """
    lower = lower.copy()
    upper = upper.copy()
    # Ranges of amplitudes that were not measured, by mode and floor.
    amplitudes: dict[tuple[int, int], tuple[float, float]] = {}
    for _ in range(6):  # passes (tuned: later ones hardly narrow a box)
        relaxation = ChainRelaxation(chain, lower, upper, modes, amplitudes)
        if relaxation.unmeasured and not relaxation.is_empty:
            for key, expression in relaxation.unmeasured.items():
                amplitudes[key] = relaxation.bounds(expression)
            # An empty range proves that no parameters agree with the modes.
            if any(low > high for low, high in amplitudes.values()):
                return None
            relaxation = ChainRelaxation(chain, lower, upper, modes, amplitudes)
        if relaxation.is_empty:
            return None

        width = upper - lower
        has_width = width > 0
        for k in np.flatnonzero(has_width):
            low, high = relaxation.bounds(relaxation.logs[k])
            # Each program uses the box with which the pass began; its bounds are intersected with
            # the box.
            lower[k] = max(low, lower[k])
            upper[k] = min(high, upper[k])
        if (lower > upper).any():
            return None
        narrowed_by = 1 - (upper - lower)[has_width] / width[has_width]
        if narrowed_by.max(initial=0.0) < 0.03:  # tuned: another pass is not worth its time
            break
    return lower, upper


class LinearRelaxation:
    """Linear program A x ≤ 0, l ≤ x ≤ u, with products and exponentials between planes.

    An expression is a linear function of the variables, given by its coefficients, shape (size,).
    The first variable is the constant 1, so that its coefficient is a constant term.

    Args:
        size: Largest number of variables.

    Attributes:
        lower: Lower ends l of the variables, shape (size,).
        upper: Upper ends u of the variables, shape (size,).
        one: The expression 1.
        count: Number of variables so far.
        rows: Rows of A: expressions that are at most 0.
    """

    def __init__(self, size: int) -> None:
        """Begin a program with the constant 1 as its only variable, and without rows."""
        self.lower = np.zeros(size)
        self.upper = np.zeros(size)
        self.lower[0] = self.upper[0] = 1.0
        self.one: Array = np.eye(1, size)[0]
        self.count = 1
        self.rows: list[Array] = []

    def variable(self, low: float, high: float) -> Array:
        """Add a variable of the linear program between two ends, and return it as an expression.

        An expression is the array of its coefficients by all variables, of which the first one is
        the constant 1. If the ends agree, no variable is added, and a constant is returned.

        Args:
            low: Lower end.
            high: Upper end.

        Raises:
            IndexError: The program has as many variables as it was made for.
        """
        if low == high:
            return low * self.one
        k = self.count
        self.lower[k] = low
        self.upper[k] = high
        self.count += 1
        return np.asarray(np.eye(1, len(self.one), k)[0])

    def range(self, expression: Array) -> tuple[float, float]:
        """Return the smallest and largest value of an expression for l ≤ x ≤ u alone."""
        ends = np.sort([expression * self.lower, expression * self.upper], axis=0).sum(axis=1)
        return float(ends[0]), float(ends[1])

    def product(self, x: Array, y: Array) -> Array:
        """Return an expression for the product of two expressions, and enclose it by inequalities.

        A variable z is added to the linear program for x y, and rows, which are expressions that
        must not exceed 0. With x in [a, b] and y in [c, d], the nonnegative products
        (x - a)(y - c), (b - x)(d - y), (b - x)(y - c) and (x - a)(d - y) give four rows that are
        linear in x, y and z (McCormick, Mathematical Programming 10, 147, 1976). If an expression
        is constant, the product is exact and nothing is added.

        Args:
            x: Coefficients by all variables, shape (size,).
            y: Coefficients of the other expression.
        """
        a, b = self.range(x)
        c, d = self.range(y)
        if a == b:
            return y * a
        if c == d:
            return x * c
        # A bilinear function has its extremes over a rectangle at the corners.
        corners = (a * c, a * d, b * c, b * d)
        z = self.variable(min(corners), max(corners))
        for p, q, sign in ((a, c, -1), (b, d, -1), (b, c, 1), (a, d, 1)):
            self.rows.append(sign * (z - p * y - q * x + p * q * self.one))
        return z

    def exponential(self, y: Array) -> Array:
        """Return an expression for exp(y), and enclose it by inequalities.

        A variable is added to the linear program, and rows, which are expressions that must not
        exceed 0. Since the exponential is convex, it lies above its tangents at both ends and at
        the midpoint of the range of y, and below the secant of this range. Ends, tangents and
        secant are widened by more than their rounding. If y is constant, nothing is added.

        Args:
            y: Expression, given by its coefficients by all variables, shape (size,).
        """
        low, high = self.range(y)
        if low == high:
            return float(np.exp(low)) * self.one
        x = self.variable(float(np.exp(low)) * (1 - 1e-15), float(np.exp(high)) * (1 + 1e-15))
        # Each line is a slope of at most e^high, off by 6 units of rounding u = 1.1e-16, times y,
        # and a constant of at most e^high (1 + |y|), off by 10 u: 2e-15 is some 18 u.
        rounding = 2e-15 * float(np.exp(high)) * (1 + max(abs(low), abs(high)))
        for point in (low, (low + high) / 2, high):
            self.rows.append(np.exp(point) * (y + (1 - point) * self.one) - x - rounding * self.one)
        # expm1 keeps the digits of a secant over a short interval.
        slope = np.exp(low) * np.expm1(high - low) / (high - low)
        self.rows.append(x - slope * y - (np.exp(low) - slope * low + rounding) * self.one)
        return x

    def bounds(self, expression: Array) -> tuple[float, float]:
        """Return a proved lower and upper bound of an expression over the linear program."""
        from scipy.sparse import csr_array  # takes time to import

        rows = csr_array(np.reshape(self.rows, (-1, len(self.one))))
        low = proved_minimum(expression, rows, self.lower, self.upper)
        high = -proved_minimum(-expression, rows, self.lower, self.upper)
        return low, high


def proved_minimum(objective: Array, rows: csr_array, lower: Array, upper: Array) -> float:
    """Return a proved lower bound of cᵀx over A x ≤ 0, l ≤ x ≤ u.

    For any multipliers y ≤ 0, yᵀA x ≥ 0 and hence cᵀx ≥ (c - Aᵀy)ᵀx, whose minimum over the box
    l ≤ x ≤ u alone is exact but for rounding. The multipliers of a solver make this bound sharp;
    that they are inaccurate does not matter (Neumaier and Shcherbina, Mathematical Programming 99,
    283, 2004). If the solver fails, the minimum over the box alone is returned.

    Args:
        objective: c, shape (variables,).
        rows: A, shape (rows, variables).
        lower: l, shape (variables,), finite.
        upper: u, shape (variables,), finite.

    Returns:
        The bound; +∞ if it is proved that no x exists.
    """
    from scipy.optimize import linprog  # takes time to import
    from scipy.sparse import csr_array, hstack

    no_multipliers = np.zeros(rows.shape[0])
    ends = np.column_stack([lower, upper])
    result = linprog(objective, A_ub=rows, b_ub=no_multipliers, bounds=ends, method="highs")
    is_infeasible = result.status == 2  # as the solver finds, within its tolerances
    if is_infeasible:
        # The set is empty if the smallest t with A x - t ≤ 0 for some x is proved positive.
        relaxed = csr_array(hstack([rows, csr_array(-np.ones((rows.shape[0], 1)))]))
        slack = np.append(np.zeros(len(lower)), 1.0)
        if proved_minimum(slack, relaxed, np.append(lower, 0.0), np.append(upper, 1e3)) > 0:
            return np.inf
    # Multipliers of zero give the minimum over the box alone.
    multipliers = no_multipliers
    if result.status == 0:
        # The solver violates the sign by its tolerance at most.
        multipliers = np.minimum(result.ineqlin.marginals, 0.0)

    # The minimum of (c - Aᵀy)ᵀx over the box is attained at an end of each variable, by the sign of
    # its reduced cost. Rounding is in proportion to the sum of the magnitudes of all terms.
    reduced_costs = objective - rows.T @ multipliers
    terms = np.where(reduced_costs > 0, reduced_costs * lower, reduced_costs * upper)
    magnitudes = np.abs(objective) + abs(rows).T @ np.abs(multipliers)
    rounding = 1e-13 * magnitudes @ np.maximum(np.abs(lower), np.abs(upper))
    return float(terms.sum() - rounding)


class ChainRelaxation(LinearRelaxation):
    """Linear relaxation of all chains of a box whose modes lie in measured ranges.

    The first four arguments are those of `enclosure`.

    Args:
        chain: The frame.
        lower: Lower ends of the box.
        upper: Upper ends of the box.
        modes: Ranges of the measured modes.
        known: Known ranges of amplitudes that were not measured, by mode and floor.

    Attributes:
        logs: Logarithm of each parameter over its nominal value, as an expression.
        stiffness: Stiffness of each storey over its nominal value, as an expression.
        mass: Mass of each floor over its nominal value, as an expression.
        unmeasured: Amplitudes at floors without a sensor, as expressions, by mode and floor.
        eigenvalue_lower: Lower bounds of all eigenvalues, shape (floors,), in 1/s².
        eigenvalue_upper: Upper bounds of all eigenvalues.
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
        """Add the variables of the chain, and the inequalities of all modes unless it is empty."""
        n = len(chain.mass)
        # Variables: parameters, stiffnesses and masses; for each mode the amplitudes, λ and three
        # products at each floor.
        super().__init__(1 + len(lower) + 2 * n + len(modes) * (4 * n + 1))
        self.chain = chain
        ends = zip(lower, upper, strict=True)
        self.logs = [self.variable(low, high) for low, high in ends]
        logs = np.array(self.logs)
        stiffness_powers, mass_powers = chain.powers
        self.stiffness = [self.exponential(row @ logs) for row in stiffness_powers]
        self.mass = [self.exponential(row @ logs) for row in mass_powers]
        self.eigenvalue_lower, self.eigenvalue_upper = eigenvalue_ranges(chain, lower, upper)
        self.unmeasured: dict[tuple[int, int], Array] = {}

        # The range of each measured eigenvalue within its bounds.
        ranges = []
        for cut in modes:
            low = max(cut.low, self.eigenvalue_lower[cut.mode - 1])
            high = min(cut.high, float(self.eigenvalue_upper[cut.mode - 1]))
            ranges.append((low, high))
        self.is_empty = any(low > high for low, high in ranges)
        if self.is_empty:
            return
        low_logs, high_logs = chain.ranges(lower, upper)
        smallest_factors = np.exp(low_logs)
        largest_factors = np.exp(high_logs)
        for cut, (low, high) in zip(modes, ranges, strict=True):
            self._add_frequency(cut, smallest_factors, largest_factors)
            if cut.shape:
                self._add_shape(cut, low, high, known)

    def _add_shape(
        self,
        cut: ModeCut,
        low: float,
        high: float,
        known: Mapping[tuple[int, int], tuple[float, float]],
    ) -> None:
        """Add the variables and the equations of motion of a mode with a measured shape.

        The variables of amplitudes that were not measured are kept in `self.unmeasured`, by the
        numbers of mode and floor. Nothing is added if such an amplitude is not bounded.

        Args:
            cut: Ranges of the amplitudes of the measured floors.
            low: Smallest eigenvalue λ of the mode, in 1/s².
            high: Largest eigenvalue, positive.
            known: Ranges of amplitudes that were not measured, as far as earlier programs have
                found them, by the numbers of mode and floor, from 1.
        """
        ends = self._amplitude_ranges(high, cut)
        if ends is None:
            return
        shape: dict[int, Array] = {}
        for floor in sorted(ends):
            smallest, largest = known.get((cut.mode, floor), ends[floor])
            shape[floor] = self.variable(smallest, largest)
            if floor not in cut.shape:
                self.unmeasured[cut.mode, floor] = shape[floor]
        relative_eigenvalue = self.variable(low / high, 1.0)
        self._add_balance(shape, relative_eigenvalue, high)

    def _add_balance(
        self, shape: Mapping[int, Array], relative_eigenvalue: Array, eigenvalue: float
    ) -> None:
        """Add the equation of motion T_z - T_(z+1) = λ m_z r_z at each floor z, as two rows each.

        T_z = k_z (r_z - r_(z-1)) is the shear force of the storey below the floor z with the
        stiffness k_z, m_z the mass and r_z the amplitude of the floor. Products are enclosed by
        linear inequalities.

        Args:
            shape: Amplitude of each floor as an expression, by its number from 1.
            relative_eigenvalue: λ over its largest value, as an expression.
            eigenvalue: Largest value of λ, in 1/s².
        """
        chain = self.chain
        n = len(self.mass)
        unit = float(chain.stiffness.mean())  # scale of the forces
        nothing = 0.0 * self.one
        shears = []
        below = nothing  # amplitude of the ground
        for z in range(n):
            # `self.stiffness` and `self.mass` are expressions of the values over the nominal ones,
            # which `chain` has. The shear force is that over the mean nominal stiffness, since
            # programs with numbers near 1 are solved best.
            shear = self.product(self.stiffness[z], shape[z + 1] - below)
            shears.append(shear * (chain.stiffness[z] / unit))
            below = shape[z + 1]
        shears.append(nothing)  # above the uppermost floor
        for z in range(n):
            inertia = self.product(relative_eigenvalue, self.product(self.mass[z], shape[z + 1]))
            force = inertia * (eigenvalue * chain.mass[z] / unit)
            imbalance = shears[z] - shears[z + 1] - force
            self.rows.append(imbalance)
            # An equation is a pair of inequalities.
            self.rows.append(-imbalance)

    def _amplitude_ranges(
        self, eigenvalue: float, cut: ModeCut
    ) -> dict[int, tuple[float, float]] | None:
        """Return the range of the amplitude of each floor, or None if one is not bounded.

        The floors between two measured ones are a chain between moving supports. While λ is below
        the smallest eigenvalue of this chain, K - λ M is positive definite, and the amplitudes are
        at most the norm of the forces of the supports over the smallest eigenvalue of K - λ M. If
        this eigenvalue is not positive for all parameters of the box, there is no bound.

        Args:
            eigenvalue: Largest eigenvalue λ of the mode, in 1/s².
            cut: Ranges of the mode with the amplitudes of the measured floors, at least one.

        Returns:
            Lower and upper end of the amplitude by the number of the floor, from 1: the measured
            ranges, and ±bound for the other floors.
        """
        n = len(self.mass)
        amplitudes = dict(cut.shape)
        k = np.array([self.range(x) for x in self.stiffness]) * self.chain.stiffness[:, np.newaxis]
        m = np.array([self.range(x) for x in self.mass]) * self.chain.mass[:, np.newaxis]
        measured = sorted(cut.shape)
        support_amplitudes = {0: 0.0}
        for floor, ends in cut.shape.items():
            support_amplitudes[floor] = float(np.abs(ends).max())
        # Each support, first the ground, and the next one; above the last floor there is none.
        for support, following in pairwise([0, *measured, n + 1]):
            floors = np.arange(support, min(following, n + 1) - 1)  # indices from 0
            if not len(floors):
                continue
            # A lower bound of K - λ M has the smallest springs, including the one above the chain,
            # and the largest masses. Above the uppermost floor there is no spring.
            springs = np.append(k[:, 0], 0.0)[np.append(floors, floors[-1] + 1)]
            difference = chain_matrix(springs[:-1]) - eigenvalue * np.diag(m[floors, 1])
            difference[-1, -1] += springs[-1]
            # A computed eigenvalue is reduced by its rounding.
            smallest = float(np.linalg.eigvalsh(difference)[0]) * (1 - 1e-12)
            if smallest <= 0:
                return None
            force_below = k[support, 1] * support_amplitudes[support]
            force_above = 0.0
            if following <= n:
                force_above = k[following - 1, 1] * support_amplitudes[following]
            # Both forces act on the same floor if the chain has only one.
            force = force_below + force_above
            if len(floors) > 1:
                force = float(np.hypot(force_below, force_above))
            largest = float(force) / smallest
            amplitudes |= {int(floor) + 1: (-largest, largest) for floor in floors}
        return amplitudes

    def _add_frequency(self, cut: ModeCut, low: Array, high: Array) -> None:
        """Add two inequalities that hold if an eigenvalue lies within a measured range.

        Let x be a fixed vector, here the mode shape at the midpoint of the box. Its Rayleigh
        quotient q = xᵀK x / xᵀM x is a quotient of linear functions of stiffnesses and masses. If
        λ_(k-1) < q < λ_(k+1), the theorem of Kato and Temple bounds its distance from λ_k:

            λ_k - ε² / (q - λ_(k-1)) ≤ q ≤ λ_k + ε² / (λ_(k+1) - q),

        where ε² is (K x - q M x)ᵀ M⁻¹ (K x - q M x) / xᵀM x. With any other number in place of q
        this expression is larger, and still gives a bound. For the measured range [low, high] of
        λ_k the inequalities are q ≥ low - e₁ and q ≤ high + e₂, where e₁ and e₂ bound the fractions
        over the box. Nothing is added if the neighbouring eigenvalues are not known to lie apart
        from q and λ_k over all the box.

        Args:
            cut: Number of the mode, from 1, and range of its eigenvalue, in 1/s².
            low: Smallest factors of nominal stiffnesses (first row) and masses (second row) over
                the box, shape (2, floors).
            high: Largest factors, same shape.
        """
        chain = self.chain
        k = cut.mode - 1
        # Bounds of the neighbouring eigenvalues, infinite where there is none.
        below = np.append(-np.inf, self.eigenvalue_upper)[k]
        above = np.append(self.eigenvalue_lower, np.inf)[k + 1]
        midpoint = (low + high) / 2
        radius = (high - low) / 2
        values, vectors = chain_modes(chain.stiffness * midpoint[0], chain.mass * midpoint[1])
        shape = vectors[:, k]
        value = values[k]
        drift = np.diff(shape, prepend=0.0)
        # xᵀK x and xᵀM x are linear functions of the factors with these coefficients.
        strain = chain.stiffness * drift**2
        inertia = chain.mass * shape**2
        smallest_quotient = float(strain @ low[0] / (inertia @ high[1]))
        largest_quotient = float(strain @ high[0] / (inertia @ low[1]))
        is_above_last = below < min(self.eigenvalue_lower[k], smallest_quotient)
        is_below_next = max(self.eigenvalue_upper[k], largest_quotient) < above
        if not (is_above_last and is_below_next):
            return

        # Bound of |K x - μ M x| over the box at each floor, with the eigenvalue μ of the midpoint,
        # and rounding.
        # The change of K x is the change of each storey shear, which acts on the floors above and
        # below it.
        shears = radius[0] * np.abs(chain.stiffness * drift)
        force = np.abs(chain.mass * shape)
        residual = shears + np.append(shears[1:], 0.0) + value * radius[1] * force
        residual += 1e-12 * value * force + 1e-13 * np.abs(chain.stiffness).max()
        squared_residual = residual**2 @ (1 / (chain.mass * low[1])) / (inertia @ low[1])
        error_below = squared_residual / (smallest_quotient - below)  # 0 for the first mode
        error_above = squared_residual / (above - largest_quotient)

        unit = float(inertia.sum() * value)
        strains = strain @ np.array(self.stiffness)
        inertias = inertia @ np.array(self.mass)
        for end, sign in ((cut.low - error_below, -1.0), (cut.high + error_above, 1.0)):
            # Both sides are divided by their size, and the row is relaxed by rounding.
            row = sign * (strains - end * inertias) / unit
            self.rows.append(row - 1e-12 * self.one)
