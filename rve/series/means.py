"""Means over θ of cells that a multipole series solves, with a declared error.

The number of terms of the series at each radius, and that of the quadrature nodes in θ, are raised
until the error is below a tolerance.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.base.errors import FailedError, RefusedError
from alphacut.rve.cell.cell import Cell, Phase, continuous_radii
from alphacut.rve.result.result import STEP, PhaseEnergies, StressCurve
from alphacut.stochastic import RadiusMap, ThetaRule, gauss_rule

SAFETY = 1.6
"""Factor of the distance between a quadrature rule in θ and two finer ones; proved by no theorem,
but held by random cells of the calibration tests."""


class SeriesError(FailedError):
    """The multipole series did not reach its tolerance."""


class RuleError(FailedError):
    """No quadrature rule in θ reached the wanted accuracy."""


class ComplexMaterial(NamedTuple):
    """An isotropic material with complex moduli, such as one with losses.

    `bulk_and_shear` are K, of three dimensions, and G, in Pa.
    """

    bulk_and_shear: tuple[complex, complex]

    @property
    def poisson(self) -> complex:
        """Poisson's ratio."""
        bulk, shear = self.bulk_and_shear
        return (3 * bulk - 2 * shear) / (6 * bulk + 2 * shear)


Material = Phase | ComplexMaterial


@dataclass(frozen=True, eq=False)
class CellModuli:
    """Moduli of cells with n radii and m inclusion materials.

    Args:
        moduli: Moduli of each cell in Pa, shape (n, m, 3). Of plane cells these are C11 + C12, C11
            − C12 and C33, of cells in space K, (C11 − C12)/2 and C44. Cells without the symmetry of
            the square have the mean of C11 and C22 in place of C11, and C11 and C22 as fourth and
            fifth moduli.
        errors: Declared relative truncation errors of the moduli, in their shape.
        terms: Number of terms of the series, shape (n, m).
        voigt: Function that returns the stiffness matrix for the moduli.
    """

    moduli: Array
    errors: Array
    terms: Ints
    voigt: Callable[..., Array]

    @property
    def matrix(self) -> Array:
        """Stiffness matrices in Pa, shape (n, m, 3, 3) of plane cells, else (n, m, 6, 6)."""
        return self.voigt(*np.moveaxis(self.moduli, -1, 0))


def _error_terms(terms: int) -> tuple[int, int]:
    """Return the two larger numbers of terms from which the truncation error is estimated.

    The distance from one alone may be small by chance.
    """
    return terms + max(2, terms // 4), terms + max(4, terms // 2)


@dataclass(frozen=True)
class Series:
    """A multipole series for one kind of cell, and how its truncation error is controlled.

    Args:
        moduli: Function of n radii, the materials of the matrix and of m inclusions, and a number
            of terms. It returns the moduli of each cell in Pa, shape (n, m, size), as those of
            `CellModuli`.
        voigt: Function that returns the stiffness matrix for the moduli.
        steps: Numbers of terms to try, rising.
        decay: The constant d in: error ~ exp(−d · terms · arccosh(1/r)) at the reduced radius r.
        start: Fraction of the terms that this decay demands, with which to begin; cells of mild
            contrast need fewer terms.
        unknowns: Function that returns the size of one linear system for a number of terms.
        safety: Factor of the estimated error.
        round_off: Relative rounding error of a modulus.
        tolerance: Relative truncation error allowed by default.
        size: Number of the moduli, 3, or 5 of cells without the symmetry of the square.
    """

    moduli: Callable[[Array, Sequence[Material], int], Array]
    voigt: Callable[..., Array]
    steps: tuple[int, ...]
    decay: float
    start: float
    unknowns: Callable[[int], int]
    safety: float
    round_off: float
    tolerance: float
    size: int = 3

    def converged_moduli(
        self,
        radius: Array,
        matrix: Phase,
        inclusions: Sequence[Phase],
        *,
        tolerance: float | None = None,
    ) -> CellModuli:
        """Return the moduli of cells with n radii and m inclusions, to a relative error.

        The error of a modulus is its distance from those by a quarter and by half more terms, times
        `safety`. Each cell gets as many terms as its own error demands, so that its moduli do not
        depend on the other cells.

        Args:
            radius: Radii over half the cell's shorter side, in [0, 1), shape (n,).
            matrix: Material around the particle.
            inclusions: Materials of the particle, m of them. Moduli of 1e-12 and of 1e12 times
                those of the matrix give a pore and a rigid particle to as many digits.
            tolerance: Relative truncation error allowed for each modulus.

        Raises:
            SeriesError: The largest number of terms is not enough: particles nearly touch.
            RefusedError: A radius is outside [0, 1).
        """
        radius = np.atleast_1d(radius)
        if tolerance is None:
            tolerance = self.tolerance
        tolerance = max(tolerance, 2 * self.round_off)
        if not ((radius >= 0) & (radius < 1)).all():
            worst = float(radius[np.argmax(np.abs(radius - 0.5))])
            raise RefusedError("radius", worst, "values in [0, 1) halves of the cell's side")
        steps = np.array(self.steps)
        shape = (radius.size, len(inclusions))
        moduli = np.zeros((*shape, self.size))
        errors = np.full((*shape, self.size), np.inf)
        terms = np.zeros(shape, int)
        rate = np.empty(shape)
        rate[:] = self.decay * np.arccosh(1 / np.maximum(radius, 1e-3))[:, None]
        # Begin where the decay promises exp(−4) at least: from there on, half more terms leave less
        # than a seventh of the error, so that their distance tells the error.
        first_terms = np.maximum(4, np.log(1 / tolerance) * self.start) / rate
        step_index = np.minimum(np.searchsorted(steps, first_terms), steps.size - 1)
        is_open = np.full(shape, True)
        while is_open.any():
            for step in np.unique(step_index[is_open]):
                chosen = is_open & (step_index == step)
                count = int(steps[step])
                rows = np.flatnonzero(chosen.any(axis=1))
                columns = np.flatnonzero(chosen.any(axis=0))
                materials = [matrix, *(inclusions[column] for column in columns)]
                coarse = self.solve(radius[rows], materials, count)
                finer, finest = (
                    self.solve(radius[rows], materials, n) for n in _error_terms(count)
                )
                # Two better values: the distance from one alone may be small by chance.
                distance = _largest_distance(coarse, finer, finest)
                i, j = np.nonzero(chosen[np.ix_(rows, columns)])
                cells = (rows[i], columns[j])
                moduli[cells] = coarse[i, j]
                terms[cells] = count
                errors[cells] = self.safety * distance[i, j] + self.round_off
            is_open = errors.max(axis=2) > tolerance
            has_failed = is_open & (step_index == steps.size - 1)
            if has_failed.any():
                largest = radius[has_failed.any(axis=1)].max()
                raise SeriesError(
                    f"the series at r = {largest:.6g} reaches a relative"
                    f" error of {errors[has_failed].max():.1e} with terms up to {self.steps[-1]},"
                    f" {tolerance:.1e} is allowed: particles nearly touch",
                    "lower the radius or raise the tolerance",
                )
            # the next number of terms by the decay, but at least the next step
            excess = np.log(errors.max(axis=2)[is_open] / tolerance)
            enough = np.searchsorted(steps, steps[step_index[is_open]] + excess / rate[is_open])
            step_index[is_open] = np.clip(enough, step_index[is_open] + 1, steps.size - 1)
        return CellModuli(moduli, errors, terms, self.voigt)

    def solve(self, radius: Array, materials: Sequence[Material], terms: int) -> Array:
        """Return the moduli of cells by a number of terms, in batches that keep the matrices small.

        Args:
            radius: Radii over half the cell's side, shape (n,), one at least.
            materials: Matrix, then m inclusions, one at least.
            terms: Number of terms of the series.

        Returns:
            Moduli of each cell in Pa, shape (n, m, size), as those of `CellModuli`. They are
            complex if a material is.
        """
        entries_of_batch = 2_000_000  # 16 MB of real numbers
        entries = radius.size * (len(materials) - 1) * self.unknowns(terms) ** 2
        # The quotient is rounded up. No batch is empty, since there are at most as many as radii.
        batches = np.array_split(radius, min(radius.size, -(-entries // entries_of_batch)))
        return np.concatenate([self.moduli(batch, materials, terms) for batch in batches])


def _largest_distance(coarse: Array, finer: Array, finest: Array) -> Array:
    """Return the relative distance from the farther one of two better values."""
    return np.asarray(np.maximum(np.abs(coarse / finer - 1), np.abs(coarse / finest - 1)))


class Mean(NamedTuple):
    """The cell of one inclusion material over θ.

    `curve` is its stiffness at the n quadrature nodes; `errors` are declared relative errors of the
    three mean moduli by source, "space" and "theta"; `terms` are those of the series at each node,
    shape (n,).
    """

    curve: StressCurve
    errors: dict[str, Array]
    terms: Ints


def converged_means(
    radius_map: RadiusMap,
    cells: Callable[[Array], CellModuli],
    *,
    points: int | None,
    accuracy: float,
) -> list[Mean]:
    """Return means over θ for each inclusion, by Gauss rules that are refined until they converge.

    The declared error of a rule is its distance from two finer rules, times 1.6. Each inclusion has
    the first rule that is accurate enough for it, whatever the others need.

    Args:
        radius_map: Radius of the particle over θ, in halves of the cell's side.
        cells: Function that returns the moduli of cells at n radii for m inclusions, with their
            errors and numbers of terms.
        points: Number of nodes of the rule, whatever its error; None for as many as the accuracy
            demands.
        accuracy: Relative error allowed for every mean modulus.

    Returns:
        For each inclusion `curve`, its stiffness at the nodes; `errors`, the declared relative
        errors of the mean moduli by "space" (the series) and "theta" (the rule), shape (3,) each;
        and `terms`, those of the series at the nodes.

    Raises:
        RuleError: No rule of up to 1200 nodes converges.
        RefusedError: The map jumps, or a radius is outside (0, 1).
        SeriesError: The series does not converge at some radius, since particles nearly touch.
    """
    most_points = 1200
    rounding = 1e-13  # of a mean over θ
    continuous_radii(radius_map)
    count = points or max(6, int(np.ceil(1 - 0.75 * np.log10(accuracy))))
    distribution = radius_map.distribution
    solved: dict[int, tuple[ThetaRule, CellModuli]] = {}
    means: dict[int, Mean] = {}
    while True:
        counts = [count, finer_count(count), finer_count(finer_count(count))]
        # Each finer rule is the first one of the next round, so that none is solved twice.
        for n in counts:
            if n not in solved:
                rule = gauss_rule(distribution, points=n)
                solved[n] = (rule, cells(radius_map(rule.nodes)))
        mean_moduli = []  # shape (inclusions, 3) of each rule
        truncation_errors = []
        for n in counts:
            rule, of_rule = solved[n]
            mean_modulus = rule.mean(of_rule.moduli)
            mean_moduli.append(mean_modulus)
            truncation_errors.append(rule.mean(of_rule.moduli * of_rule.errors) / mean_modulus)
        coarse_mean, finer_mean, finest_mean = mean_moduli
        distance = _largest_distance(coarse_mean, finer_mean, finest_mean)
        errors = SAFETY * distance + rounding
        rule, coarse = solved[count]
        for k in range(len(errors)):
            if k not in means and (points or errors[k].max() <= accuracy):
                in_space = np.maximum(truncation_errors[0][k], truncation_errors[-1][k])
                curve = StressCurve.from_stiffness(rule, coarse.matrix[:, k])
                by_source = {"space": _of_three(in_space), "theta": _of_three(errors[k])}
                means[k] = Mean(curve, by_source, coarse.terms[:, k])
        if len(means) == len(errors):
            return [means[k] for k in range(len(errors))]
        if counts[-1] >= most_points:
            raise RuleError(
                f"the rule of {count} nodes in θ leaves a relative error of {errors.max():.1e};"
                f" {accuracy:.1e} is allowed: the radius map is not smooth",
                "allow a larger error, or give the number of nodes",
            )
        count = counts[1]


def _of_three(errors: Array) -> Array:
    """Return the errors of C11 + C12, C11 − C12 and C33 that hold with C11 and with C22 alone.

    Args:
        errors: Relative errors of the moduli of `CellModuli`, shape (3,) or (5,).
    """
    axial = errors[3:].max(initial=0.0)
    return np.maximum(errors[:3], [axial, axial, 0.0])


def finer_count(count: int) -> int:
    """Return the number of nodes of the next finer rule: a third more."""
    return count + max(2, count // 3)


def mean_energies(series: Series, cell: Cell, mean: Mean) -> PhaseEnergies:
    """Return the parts of the mean moduli over θ that belong to K and G of each phase.

    The part of a modulus c that belongs to a phase modulus X is X ∂c/∂X (Euler's theorem: c is
    homogeneous of degree 1 in all X). Derivatives are by complex steps of the series. Errors are
    the distances from the means by two finer rules with more terms, times 1.6.

    Args:
        series: The multipole series of the kind of cell.
        cell: Isotropic matrix and particle, and radius map.
        mean: What `converged_means` returned for this particle: nodes, weights and numbers of
            terms.

    Returns:
        `values` and their absolute `errors` in Pa, shape (phases, K and G, 3 moduli), matrix first;
        and `moduli_at`, the function from complex K and G of the phases, shape (2,) each, to the
        three mean moduli: C11 + C12, C11 − C12 and C33 of plane cells, K, (C11 − C12)/2 and C44 in
        space.
    """
    rule = ThetaRule(mean.curve.theta, mean.curve.weights)
    values = _rule_energies(series, cell, rule, mean.terms)
    node_radii = cell.radius_map(rule.nodes)
    order = np.argsort(node_radii)
    # Larger radii never need fewer terms, whatever single nodes happened to need.
    rising_terms = np.maximum.accumulate(mean.terms[order])
    distances = []
    finer = rule
    for k in range(2):
        finer = gauss_rule(cell.radius_map.distribution, points=finer_count(finer.nodes.size))
        needed_terms = np.interp(cell.radius_map(finer.nodes), node_radii[order], rising_terms)
        # `_error_terms` gives two larger numbers of terms; the first rule takes the smaller.
        finer_terms = np.array([_error_terms(int(np.ceil(n)))[k] for n in needed_terms])
        distances.append(abs(values - _rule_energies(series, cell, finer, finer_terms)))
    rounding = 1e-12 * values.sum(axis=(0, 1))  # a fraction of the modulus
    errors = SAFETY * np.max(distances, axis=0) + rounding
    moduli_at = partial(_mean_moduli, series, cell, rule, mean.terms)
    return PhaseEnergies(values, errors, moduli_at)


def _rule_energies(series: Series, cell: Cell, rule: ThetaRule, terms: Ints) -> Array:
    """Return the parts X ∂c/∂X of mean moduli c by one quadrature rule.

    Args:
        series: The multipole series of the kind of cell.
        cell: Isotropic matrix and particle, and radius map.
        rule: The rule, with n nodes.
        terms: Number of terms of the series at each node, shape (n,).

    Returns:
        Parts in Pa for X = K and G of each phase, matrix first, shape (phases, K and G, 3 moduli).
        The moduli are C11 + C12, C11 − C12 and C33 of plane cells, and K, (C11 − C12)/2 and C44 in
        space.
    """
    moduli = np.array([phase.bulk_and_shear for phase in cell.phases if isinstance(phase, Phase)])
    energies = np.zeros((2, 2, 3))
    for phase in range(2):
        for kind in range(2):
            # Im c(X (1 + i h)) / h is X ∂c/∂X to rounding for a small h: the series takes complex
            # moduli, and no difference of nearly equal numbers cancels.
            stepped = moduli.astype(complex)
            stepped[phase, kind] *= 1 + 1j * STEP
            bulk, shear = stepped.T
            means = _mean_moduli(series, cell, rule, terms, bulk, shear)
            energies[phase, kind] = means.imag / STEP
    return energies


def _mean_moduli(
    series: Series, cell: Cell, rule: ThetaRule, terms: Ints, bulk: Array, shear: Array
) -> Array:
    """Return mean moduli over θ by one quadrature rule, for complex moduli of the phases.

    Args:
        series: The multipole series of the kind of cell.
        cell: Cell whose radius map is used.
        rule: The rule, with n nodes.
        terms: Number of terms of the series at each node, shape (n,).
        bulk: Complex bulk modulus K, of three dimensions, of matrix and particle in Pa, shape (2,).
        shear: Complex shear modulus G of both in Pa, shape (2,).

    Returns:
        Complex means in Pa, shape (3,): C11 + C12, C11 − C12 and C33 of plane cells, and K, (C11 −
        C12)/2 and C44 in space.
    """
    radii = cell.radius_map(rule.nodes)
    total = np.zeros(3, complex)
    materials = [ComplexMaterial(moduli) for moduli in zip(bulk, shear, strict=True)]
    # Nodes with equally many terms are solved as one batch.
    for count in np.unique(terms):
        nodes = np.flatnonzero(terms == count)
        moduli = series.solve(radii[nodes], materials, int(count))[:, 0, :3]
        total += rule.weights[nodes] @ moduli
    return total
