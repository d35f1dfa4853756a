"""Means over θ of cells that a multipole series solves, to a declared error.

Terms of the series at each radius, and nodes of the rule in θ, are as many as the error asks.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product
from typing import NamedTuple

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.base.errors import FailedError, RefusedError
from alphacut.rve.cell.cell import Cell, Phase, continuous_radii
from alphacut.rve.result.result import STEP, PhaseEnergies, StressCurve
from alphacut.stochastic import RadiusMap, ThetaRule, gauss_rule

_BATCH = 2_000_000  # entries of one batch of matrices
_MAX_POINTS = 1200
SAFETY = 1.6  # of the distance of a rule in θ from two finer ones
_NOISE = 1e-13  # of a declared error: what rounding leaves
_ENERGY_NOISE = 1e-12  # of energies, over the modulus


class SeriesError(FailedError):
    """The multipole series does not reach its tolerance."""


class RuleError(FailedError):
    """No rule in θ reaches the wanted accuracy."""


class ComplexMaterial(NamedTuple):
    """K of three dimensions and G, in Pa, of an isotropic material, complex where it has losses."""

    bulk_and_shear: tuple[complex, complex]

    @property
    def poisson(self) -> complex:
        """Poisson's ratio."""
        bulk, shear = self.bulk_and_shear
        return (3 * bulk - 2 * shear) / (6 * bulk + 2 * shear)


Material = Phase | ComplexMaterial


@dataclass(frozen=True, eq=False)
class CellModuli:
    """Moduli of n cells times m inclusions.

    Args:
        moduli: In Pa, shape (n, m, 3): of the plane C11 + C12, C11 − C12 and C33, of space K,
            (C11 − C12)/2 and C44.
        errors: Their declared relative truncation errors, same shape.
        terms: Number of terms that reached it, shape (n, m).
        voigt: Stiffness from the three moduli.
    """

    moduli: Array
    errors: Array
    terms: Ints
    voigt: Callable[[Array, Array, Array], Array]

    @property
    def matrix(self) -> Array:
        """Voigt matrices, shape (n, m, 3, 3) of the plane and (n, m, 6, 6) of space, in Pa."""
        return self.voigt(*np.moveaxis(self.moduli, -1, 0))


def _error_terms(terms: int) -> tuple[int, int]:
    """Two larger numbers of terms: a distance from one alone may be small by chance."""
    return terms + max(2, terms // 4), terms + max(4, terms // 2)


@dataclass(frozen=True)
class Series:
    """A multipole series of one kind of cell, its error estimate, and its numbers of terms.

    Args:
        moduli: Three moduli in Pa of n cells times m inclusions, shape (n, m, 3), from radii (n,),
            the materials of the matrix and of the m inclusions, and a number of terms.
        voigt: Stiffness from the three moduli.
        steps: Numbers of terms to try, rising.
        decay: d in: error ~ exp(−d · terms · arccosh(1/r)).
        start: Part of the terms by this decay to begin with; mild contrasts need fewer than all.
        unknowns: Of one linear system with so many terms.
        safety: Factor of the estimated error.
        round_off: Relative, of a modulus.
        tolerance: Relative truncation error allowed by default.
    """

    moduli: Callable[[Array, Sequence[Material], int], Array]
    voigt: Callable[[Array, Array, Array], Array]
    steps: tuple[int, ...]
    decay: float
    start: float
    unknowns: Callable[[int], int]
    safety: float
    round_off: float
    tolerance: float

    def converged_moduli(
        self,
        radius: Array,
        matrix: Phase,
        inclusions: Sequence[Phase],
        *,
        tolerance: float | None = None,
    ) -> CellModuli:
        """Moduli of n cells times m inclusions, each with as many terms as its error asks.

        The error is the distance from moduli by a quarter and by half more terms, times `safety`.

        Args:
            radius: Radii over half the cell's side, shape (n,), each in [0, 1).
            matrix: Material outside the particle.
            inclusions: Materials of the particle, m of them; moduli of 1e-12 and 1e12 of the
                matrix's are a pore and a rigid particle to as many digits.
            tolerance: Relative truncation error allowed, of each modulus.

        Raises:
            SeriesError: The largest number of terms does not suffice: particles nearly touch.
            RefusedError: A radius is outside [0, 1).
        """
        radius = np.atleast_1d(radius)
        tolerance = max(self.tolerance if tolerance is None else tolerance, 2 * self.round_off)
        if not ((radius >= 0) & (radius < 1)).all():
            worst = float(radius[np.argmax(np.abs(radius - 0.5))])
            raise RefusedError("radius", worst, "values in [0, 1) halves of the cell's side")
        steps, shape = np.array(self.steps), (radius.size, len(inclusions))
        moduli, errors = np.zeros((*shape, 3)), np.full((*shape, 3), np.inf)
        terms, is_open = np.zeros(shape, int), np.full(shape, True)
        rate = np.empty(shape)
        rate[:] = self.decay * np.arccosh(1 / np.maximum(radius, 1e-3))[:, None]
        # from exp(−4) on, half more terms leave under a seventh of the error to tell
        first = np.searchsorted(steps, np.maximum(4, np.log(1 / tolerance) * self.start) / rate)
        step_index = np.minimum(first, steps.size - 1)
        while is_open.any():
            for step in np.unique(step_index[is_open]):
                # a pair of radius and inclusion has its number of terms, whatever the others need
                chosen, count = is_open & (step_index == step), int(steps[step])
                rows, columns = (np.flatnonzero(chosen.any(axis=axis)) for axis in (1, 0))
                materials = [matrix, *(inclusions[column] for column in columns)]
                coarse, finer, finest = (
                    self.solve(radius[rows], materials, n) for n in (count, *_error_terms(count))
                )
                i, j = np.nonzero(chosen[np.ix_(rows, columns)])
                pairs, distance = (rows[i], columns[j]), _largest_distance(coarse, finer, finest)
                moduli[pairs], terms[pairs] = coarse[i, j], count
                errors[pairs] = self.safety * distance[i, j] + self.round_off
            is_open = errors.max(axis=2) > tolerance
            failed = is_open & (step_index == steps.size - 1)
            if failed.any():
                raise SeriesError(
                    f"the series at r = {radius[failed.any(axis=1)].max():.6g} reaches a relative"
                    f" error of {errors[failed].max():.1e} with terms up to {self.steps[-1]},"
                    f" {tolerance:.1e} is allowed: particles nearly touch",
                    "lower the radius or raise the tolerance",
                )
            excess = np.log(errors.max(axis=2)[is_open] / tolerance)
            enough = np.searchsorted(steps, steps[step_index[is_open]] + excess / rate[is_open])
            step_index[is_open] = np.clip(enough, step_index[is_open] + 1, steps.size - 1)
        return CellModuli(moduli, errors, terms, self.voigt)

    def solve(self, radius: Array, materials: Sequence[Material], terms: int) -> Array:
        """Moduli (n, m, 3) by so many terms, solved in so many batches that matrices stay small."""
        entries = radius.size * (len(materials) - 1) * self.unknowns(terms) ** 2
        batches = np.array_split(radius, min(radius.size, -(-entries // _BATCH)))
        return np.concatenate([self.moduli(batch, materials, terms) for batch in batches])


def _largest_distance(coarse: Array, finer: Array, finest: Array) -> Array:
    """Relative distance from the farther of two better values."""
    return np.asarray(np.maximum(np.abs(coarse / finer - 1), np.abs(coarse / finest - 1)))


class Mean(NamedTuple):
    """One inclusion's cell over θ: its stiffness, and terms of the series at each node, (n,).

    `errors` are the declared relative ones of the three mean moduli by source: space, theta.
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
    """Means over θ for each inclusion, by Gauss rules refined until the mean moduli converge.

    The declared error of a rule is its distance from two finer rules, times a safety factor.

    Args:
        radius_map: Radius of the particle over θ.
        cells: Moduli at n radii for m inclusions.
        points: Nodes of the rule, or None for as many as the accuracy asks.
        accuracy: Relative error allowed for every mean modulus.

    Raises:
        RuleError: No rule of up to `_MAX_POINTS` nodes converges.
    """
    continuous_radii(radius_map)  # refuses a jump
    count = points or max(6, int(np.ceil(1 - 0.75 * np.log10(accuracy))))
    law = radius_map.distribution
    solved: dict[int, tuple[ThetaRule, CellModuli]] = {}
    means: dict[int, Mean] = {}
    while True:
        counts = [count, finer_count(count), finer_count(finer_count(count))]
        for n in counts:
            if n not in solved:
                rule = gauss_rule(law, points=n)
                solved[n] = rule, cells(radius_map(rule.nodes))
        three = [solved[n] for n in counts]
        moduli = [rule.mean(x.moduli) for rule, x in three]  # (inclusions, 3) each
        truncation = [rule.mean(x.moduli * x.errors) / rule.mean(x.moduli) for rule, x in three]
        errors = SAFETY * _largest_distance(*moduli) + _NOISE
        rule, coarse = three[0]
        for k in range(len(errors)):
            if k not in means and (points or errors[k].max() <= accuracy):
                # each inclusion by itself, whatever the others need
                in_space = np.maximum(truncation[0][k], truncation[-1][k])
                curve = StressCurve.from_stiffness(rule, coarse.matrix[:, k])
                means[k] = Mean(curve, {"space": in_space, "theta": errors[k]}, coarse.terms[:, k])
        if len(means) == len(errors):
            return [means[k] for k in range(len(errors))]
        if counts[-1] >= _MAX_POINTS:
            raise RuleError(
                f"the rule of {count} nodes in θ leaves a relative error of {errors.max():.1e};"
                f" {accuracy:.1e} is allowed: the radius map is not smooth",
                "allow a larger error, or give the number of nodes",
            )
        count = counts[1]


def finer_count(count: int) -> int:
    """Nodes of the next finer rule: a third more."""
    return count + max(2, count // 3)


def mean_energies(series: Series, cell: Cell, mean: Mean) -> PhaseEnergies:
    """Mean parts X ∂c/∂X of K and G of both phases over θ, by complex steps of the series.

    Their error is the distance from means by two finer rules with more terms.
    """
    rule, terms = ThetaRule(mean.curve.theta, mean.curve.weights), mean.terms
    node_radii = cell.radius_map(rule.nodes)
    values, distances = _rule_energies(series, cell, rule, terms), []
    order = np.argsort(node_radii)
    rising_terms = np.maximum.accumulate(terms[order])
    finer = rule
    for k in range(2):
        finer = gauss_rule(cell.radius_map.distribution, points=finer_count(finer.nodes.size))
        coarse_terms = np.interp(cell.radius_map(finer.nodes), node_radii[order], rising_terms)
        finer_terms = np.array([_error_terms(int(np.ceil(n)))[k] for n in coarse_terms])
        distances.append(abs(values - _rule_energies(series, cell, finer, finer_terms)))
    errors = SAFETY * np.max(distances, axis=0) + _ENERGY_NOISE * values.sum(axis=(0, 1))
    moduli_at = partial(_mean_moduli, series, cell, rule, terms)
    return PhaseEnergies(values, errors, moduli_at)


def _rule_energies(series: Series, cell: Cell, rule: ThetaRule, terms: Ints) -> Array:
    """Mean energies X ∂c/∂X, shape (2 phases, K and G, 3 moduli), in Pa."""
    moduli = np.array([phase.bulk_and_shear for phase in cell.phases if isinstance(phase, Phase)])
    energies = np.zeros((2, 2, 3))
    for phase, kind in product(range(2), repeat=2):
        stepped = moduli.astype(complex)
        stepped[phase, kind] *= 1 + 1j * STEP
        means = _mean_moduli(series, cell, rule, terms, *stepped.T)
        energies[phase, kind] = means.imag / STEP
    return energies


def _mean_moduli(
    series: Series, cell: Cell, rule: ThetaRule, terms: Ints, bulk: Array, shear: Array
) -> Array:
    """Mean moduli over θ, (3,), with complex K and G of matrix and particle, (2,) each."""
    radii, total = cell.radius_map(rule.nodes), np.zeros(3, complex)
    materials = [ComplexMaterial(x) for x in zip(bulk, shear, strict=True)]
    for count in np.unique(terms):
        nodes = np.flatnonzero(terms == count)
        total += rule.weights[nodes] @ series.solve(radii[nodes], materials, int(count))[:, 0]
    return total
