"""From particles to the fuzzy radius map (sections 4.1 and 4.2).

This differs from the paper in: 1. The supports of a2 and a4 are derived: they span the p-box of
least area that contains the sample's distribution save for its own bootstrap band. 2. The bound of
r_n for non-overlapping discs is √(4/π) for any cell and 1 for the square one, not √(π/4). 3. a1 and
a3 are the limits themselves, not the midpoints of the outer two of 100 bins between them (0.13 +
0.0037 and 0.87 − 0.0037 in the paper). 4. Spheres have power cells, and r_n is weighted by volume.
Cells tighter than a cubic cell can be are cut off with their spheres; the packing is made denser
until the map has the volume fraction of the case.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from alphacut.base.errors import require, require_numbers
from alphacut.base.extras import extra_named
from alphacut.fuzzy import Crisp, FuzzyNumber, Triangular
from alphacut.fuzzy.campaign.workers import pool
from alphacut.stochastic.fit.area_weighted import AreaWeighted
from alphacut.stochastic.fit.hermite_fit import (
    HermiteFit,
    PBox,
    SlopeBand,
    SlopeEnds,
    least_pbox,
    slope_band,
)
from alphacut.stochastic.particles.packings import Packings
from alphacut.stochastic.particles.particles import Particles
from alphacut.stochastic.particles.shapes import DISCS, SPHERES, Shape
from alphacut.stochastic.radius_map import HermiteMap
from alphacut.stochastic.sections import ParticleCells, reduced_radii, with_cells
from alphacut.stochastic.tessellation.apollonius import neighbouring_values, neighbours
from alphacut.stochastic.theta.quadrature import gauss_rule

if TYPE_CHECKING:
    import xarray

RESAMPLES = 500
"""Bootstrap samples. The 99 % quantile of a band then rests on the largest five; more samples
steady it and take as much more time."""


@dataclass(frozen=True)
class RadiusLimits:
    """Limits of the reduced radii r_n between which a map is fitted.

    Args:
        shape: Kind of the particles.
        stated: Lower and upper limit; None for limits that cut off equal fractions of area or
            volume at both ends and keep 99.27 % of it (Fig. 12), up to `Shape.reach`.
        packed_fraction: Fraction of packed particles, for a message; None for measured ones.
    """

    shape: Shape
    stated: tuple[float, float] | None = None
    packed_fraction: float | None = None

    def of(self, sample: AreaWeighted) -> tuple[float, float]:
        """Return the lower and the upper limit of r_n for a sample."""
        if self.stated is not None:
            return self.stated
        lower, upper = sample.limits(0.9927)
        # At r_n = 1 the particle would touch the sides of its square or cubic cell.
        return lower, min(upper, self.shape.reach)

    def capped(self, sample: AreaWeighted) -> AreaWeighted:
        """Return a copy of a sample with the reduced radii r_n of discs capped at `Shape.reach`.

        r_n is the radius of a particle over half the side of a square or cube as large as its cell.
        At r_n = 1 particles touch the sides of such a cell, so reach, the largest r_n of a map, is
        0.99 for discs. For spheres, and where limits are stated, the sample itself is returned,
        since its largest r_n are cut off later.

        Args:
            sample: Reduced radii of all cells, weighted by area or volume.

        Raises:
            RefusedError: Limits are not stated, and more than 15 % of the area or volume (of
                spheres as well) is in cells with an r_n above reach.
        """
        if self.stated is not None:
            return sample
        shape = self.shape
        fraction = self.capped_fraction(sample)
        max_fraction = 0.15
        value = f"{fraction:.1%} of the {shape.cells} in cells tighter than r_n = {shape.reach:g}"
        allowed = f"shares up to {max_fraction:.0%}, since particles touch at r_n = 1"
        is_loose = fraction <= max_fraction
        require(is_loose, "particles", value=value, allowed=allowed, cure=self._cure)
        if shape == SPHERES:
            return sample
        return sample.capped(shape.reach)

    def capped_fraction(self, sample: AreaWeighted) -> float:
        """Return the fraction of area or volume in cells that are tighter than a map allows.

        Their reduced radius (of the particle, over half the side of a square or cube as large as
        the cell) is above `Shape.reach`, 0.99 for discs and 0.97 for spheres. The fraction is 0
        with stated limits.

        Args:
            sample: Reduced radii of all cells, weighted by area or volume.
        """
        if self.stated is not None:
            return 0.0
        return 1 - float(sample.cdf(self.shape.reach))

    @property
    def _cure(self) -> str:
        """Advice in the message on particles that are too dense for cells of one particle.

        It names keys of a case file: the fraction (… if it is not known) in place of the particles,
        and for discs also an image of them or stated limits.
        """
        fraction = "…"
        if self.packed_fraction is not None:
            fraction = f"{self.packed_fraction:g}"
        by_fraction = f"set cell.fraction = {fraction} in place of [microstructure]"
        if self.shape == SPHERES:
            return by_fraction
        return f"take an image of them as the cell (cell.image), set limits, or {by_fraction}"


@dataclass(frozen=True, eq=False)
class FittedRadiusMap:
    """Fuzzy radius map of particles, with the statistics that it rests on.

    Args:
        rule: Limits between which it was fitted.
        seed: Seed of the bootstrap.
        sections: Particles and cells.
        sample: r_n of all whole cells, weighted by area or volume.
        truncated: The values of the sample within the limits.
        pbox: Fuzzy radius map.
        slopes: Bootstrap band of the fitted slopes.
        band: Half-width of the bootstrap band of the distribution function, in probability.
    """

    rule: RadiusLimits
    seed: int
    sections: Sequence[ParticleCells]
    sample: AreaWeighted
    truncated: AreaWeighted
    pbox: PBox
    slopes: SlopeBand
    band: float

    @property
    def shape(self) -> Shape:
        """Kind of the particles."""
        return self.rule.shape

    @property
    def map(self) -> HermiteMap:
        """The radius map at the nominal slopes.

        Its limits a1 and a3 are rounded to ten digits and its slopes a2 and a4 to eight, so that
        the map in a printed case file is the same.
        """
        fit = self.pbox.fit
        return HermiteMap(
            a1=float(f"{fit.a1:.10g}"),
            a2=self.triangles["a2"].nominal,
            a3=float(f"{fit.a3:.10g}"),
            a4=self.triangles["a4"].nominal,
            distribution=fit.distribution,
        )

    @property
    def inputs(self) -> dict[str, FuzzyNumber]:
        """The slopes "a2" and "a4" of the map as fuzzy numbers.

        Each is a `Triangular` of the ends and the nominal value of its support, or a `Crisp` where
        both ends are equal.
        """
        inputs: dict[str, FuzzyNumber] = {}
        for name, ends in self.triangles.items():
            # A triangle without width is no fuzzy number but the value itself.
            is_fuzzy = ends.lower < ends.upper
            inputs[name] = Triangular(*ends) if is_fuzzy else Crisp(ends.nominal)
        return inputs

    @property
    def triangles(self) -> dict[str, SlopeEnds]:
        """Ends and nominal values of the slopes "a2" and "a4", rounded to eight digits.

        The slopes are dr/dξ at the lower and at the upper end of θ, ξ from 0 to 1 over its support.
        Ends that differ from the nominal value by at most 1e-6 of a3 − a1, which is rounding of the
        linear program, are that value.

        Returns:
            Lower end, nominal value and upper end by name.
        """
        tolerance = 1e-6 * (self.pbox.fit.a3 - self.pbox.fit.a1)
        triangles = {}
        for name, ends in {"a2": self.pbox.a2, "a4": self.pbox.a4}.items():
            values = np.array(ends)
            # A support without width becomes a crisp number.
            values[abs(values - ends.nominal) <= tolerance] = ends.nominal
            triangles[name] = SlopeEnds(*(float(f"{value:.8g}") for value in values))
        return triangles

    @property
    def fraction(self) -> float:
        """Mean fraction of the cell that the particle fills, at the nominal slopes."""
        return _mean_fraction(self.shape, self.pbox.fit, self.pbox.nominal_slopes)

    @property
    def limits(self) -> tuple[float, float]:
        """Limits of r_n, which are a1 and a3."""
        return self.pbox.fit.a1, self.pbox.fit.a3

    @property
    def fraction_within(self) -> float:
        """Fraction of area or volume within the limits, in capped cells as well."""
        return self.rule.capped(self.sample).fraction_within(*self.limits)

    def __str__(self) -> str:
        """Return one line: the number of cells, the fraction within the limits, and the map.

        Of the map it shows the limits a1 and a3, the fuzzy slopes a2 and a4 as lower … nominal …
        upper, and the mean fraction of the cell that the particle takes.
        """
        cells = f"{len(self.sample.values)} cells of {self.shape.particles}"
        words = f"{self.fraction_within:.2%} of their {self.shape.cells} within the limits"
        triangles = self.triangles.items()
        slopes = ", ".join(
            f"{name} = {x.lower:.4g} … {x.nominal:.4g} … {x.upper:.4g}" for name, x in triangles
        )
        ends = f"a1 = {self.limits[0]:.4g}, a3 = {self.limits[1]:.4g}"
        fraction = f"{self.shape.cells} fraction {self.fraction:.4f}"
        return f"radius map of {cells}, {words}: {ends}, {slopes}; {fraction}"

    __repr__ = __str__

    def to_dataset(self) -> xarray.Dataset:
        """Return distribution functions of the reduced radius r_n between the limits as a dataset.

        Returns:
            Dataset with the coordinate "r_n", 501 even points from a1 to a3, and four probabilities
            over it: "cdf" of the sample within the limits, "pbox_lower" and "pbox_upper" of the
            p-box of the fuzzy slopes, and "fitted" of the map at the nominal slopes.

        Raises:
            MissingLibraryError: xarray is not installed.
        """
        with extra_named():
            import xarray

        fit = self.pbox.fit
        radius = np.linspace(fit.a1, fit.a3, 501)
        distribution = fit.distribution
        # A map has no inverse in closed form, so that a table of θ stands in for it.
        theta = np.asarray(np.linspace(distribution.lower, distribution.upper, 5001), float)
        # The distribution function of a map is F_Θ at the θ of the radius: large radii give a small
        # one.
        smallest_radius, largest_radius = self.pbox.bounds(theta)
        fitted_radius = fit.map(self.pbox.nominal_slopes)(theta)
        probability = distribution.cdf(theta)
        columns = {
            "cdf": self.truncated.cdf(radius),
            "pbox_lower": np.interp(radius, largest_radius, probability),
            "pbox_upper": np.interp(radius, smallest_radius, probability),
            "fitted": np.interp(radius, fitted_radius, probability),
        }
        variables = {name: ("r_n", values, {"units": "1"}) for name, values in columns.items()}
        dataset = xarray.Dataset(variables, {"r_n": radius})
        name = "reduced radius: radius over half the side of a square or cube as large as the cell"
        dataset["r_n"].attrs = {"units": "1", "long_name": name}
        return dataset

    def numbers(self) -> dict[str, object]:
        """Return all numbers of the fit by the keys of its JSON file; lengths are in m.

        r_n is the reduced radius: of a particle, over half the side of a square or cube as large as
        its cell; a1 to a4 are the parameters of the cubic map r(θ): its values a1 and a3 and slopes
        a2 and a4 at the lower and at the upper end of θ.

        Of the particles: their kind and number, the number of packings, the smallest and the
        largest radius, and fractions of area or volume (measured; as the mean over the cells, eq.
        10; as the mean of the map; and, if they were packed, as it was asked for). Of the cells:
        neighbours and the correlation of their r_n (discs alone), the number of cells, mean and
        largest r_n, "share_capped" and "share_kept", the fractions that are tighter than a map may
        be and within the limits. Of the map: limits, a1 and a3; a2 and a4 as [lower, nominal,
        upper], and their bootstrap bands in the same form; the half-width of the "band" of the
        distribution function, and "pbox_breach", the largest distance of the sample from the p-box
        (both probabilities); area of the p-box and root mean square misfit, in units of r_n; seed.
        "radius" is the table of a case file, rounded.
        """
        packings = [section.particles for section in self.sections]
        radii = np.concatenate([packing.radii for packing in packings])
        shape = self.shape
        pbox = self.pbox
        nominal = self.map
        # The weights are fractions of the area, so this is the mean over the plane or space.
        cell_fraction = float(self.sample.weights @ shape.fractions(self.sample.values))  # eq. 10
        return {
            "particles": shape.particles,
            "packings": len(packings),
            shape.particles: len(radii),
            f"{shape.cells}_fraction": float(np.mean([packing.fraction for packing in packings])),
            f"{shape.cells}_fraction_of_cells": cell_fraction,
            f"mean_{shape.cells}_fraction_of_map": self.fraction,
            "fraction_of_case": self.rule.packed_fraction,
            "smallest_radius": float(radii.min()),
            "largest_radius": float(radii.max()),
            "share_capped": self.rule.capped_fraction(self.sample),
            **_neighbour_numbers(self.sections),
            "cells": len(self.sample.values),
            "mean_r_n": self.sample.mean,
            "largest_r_n": float(self.sample.values[-1]),
            "limits": list(self.limits),
            "share_kept": self.fraction_within,
            "a1": pbox.fit.a1,
            "a2": list(pbox.a2),
            "a3": pbox.fit.a3,
            "a4": list(pbox.a4),
            "a2_band": list(self.slopes.a2),
            "a4_band": list(self.slopes.a4),
            "band": self.band,
            "pbox_area": pbox.area,
            "pbox_breach": pbox.excess(self.truncated),
            "misfit": pbox.fit.misfit(self.truncated, pbox.nominal_slopes),
            "seed": self.seed,
            "radius": {
                "theta": [
                    float(f"{nominal.distribution.lower:g}"),
                    float(f"{nominal.distribution.upper:g}"),
                ],
                "a1": nominal.a1,
                "a2": list(self.triangles["a2"]),
                "a3": nominal.a3,
                "a4": list(self.triangles["a4"]),
            },
        }


def fit_radius_map(
    sections: Sequence[Particles],
    *,
    limits: tuple[float, float] | None = None,
    seed: int = 0,
    workers: int = 1,
    progress: Callable[[float], None] | None = None,
) -> FittedRadiusMap:
    """Fit the radius map of the cell to the particles of sections, and make its slopes fuzzy.

    The sections are tessellated. The map is fitted to the reduced radii r_n of all whole cells,
    weighted by area or volume; the bootstrap over sections, or over patches of a single one, gives
    the fuzzy slopes. Packings of spheres are made anew, denser, until the map has their fraction.

    Args:
        sections: Packings as `pack` makes them, or measured sections as of `read_particles`.
        limits: Lower and upper limit of r_n, which are a1 and a3 of the map; None for limits that
            keep 99.27 % of the area.
        seed: Seed of the bootstrap.
        workers: Processes that tessellate; the result does not depend on their number.
        progress: Function that takes the completed fraction.

    Returns:
        FittedRadiusMap: the `map` at the fitted slopes, its fuzzy slopes as `inputs` by name, and
        the `sample` and `pbox` that they rest on.

    Raises:
        RefusedError: Limits do not rise within (0, 1), cells are too tight or all alike, or there
            are too few.
        FailedError: No p-box contains the sample.

    Example:
        >>> from alphacut.stochastic import pack
        >>> sections = pack(100, packings=5, fraction=0.2, radii=(1e-3, 4e-3), seed=1)
        >>> fitted = fit_radius_map(sections, limits=(0.13, 0.87), seed=1)
        >>> fitted.map.a1, sorted(fitted.inputs)
        (0.13, ['a2', 'a4'])
    """
    are_particles = not isinstance(sections, Particles) and all(
        isinstance(section, Particles) for section in sections
    )
    allowed = "a list of one section or more, as `pack` and `read_particles` give them"
    require(are_particles and len(sections) > 0, "sections", sections, allowed)
    if limits is not None:
        require_numbers("limits", limits)
        is_range = len(limits) == 2 and 0 < limits[0] < limits[1] < 1
        require(is_range, "limits", value=limits, allowed="two numbers that rise within (0, 1)")
    report = progress or (lambda fraction: None)
    packed_fraction = None
    if isinstance(sections, Packings):
        packed_fraction = sections.packing.fraction
    rule = RadiusLimits(sections[0].shape, limits, packed_fraction)

    # Particles → tessellation
    with pool(workers) as executor:
        map_function = executor.map if executor else map
        cells = list(map_function(with_cells, sections))
        report(0.5)
        if isinstance(sections, Packings) and rule.shape == SPHERES:
            cells = _repacked(rule, sections, cells, executor=executor, progress=report)

    # → reduced radii → radius map
    sample = reduced_radii(cells)
    fit = fit_map(rule, sample, seed=seed)
    report(1.0)
    return FittedRadiusMap(
        rule=rule,
        seed=seed,
        sections=cells,
        sample=sample,
        truncated=fit.truncated,
        pbox=fit.pbox,
        slopes=fit.slopes,
        band=fit.band,
    )


def _repacked(
    rule: RadiusLimits,
    packings: Packings,
    cells: list[ParticleCells],
    *,
    executor: Executor | None,
    progress: Callable[[float], None],
) -> list[ParticleCells]:
    """Return cells of spheres, packed so that the fitted map has the fraction of the packings.

    The limits of the map cut off the largest reduced radii, so that the map has a lower fraction
    than the spheres. Spheres are packed anew, denser, until the relative error of the fraction is
    below 5e-3, at most five times.

    Args:
        rule: Limits of the map.
        packings: The packings whose fraction the map shall have.
        cells: Their cells, one object for each packing.
        executor: Runs the packings and the tessellations; None for this process.
        progress: Function that takes the completed fraction, from 0.5 to 0.7 here.

    Returns:
        The cells with the smallest error, which may be `cells` itself. The error may be above 5e-3.

    Raises:
        FailedError: Spheres of a denser packing still overlap, or have no cell.
        RefusedError: Fewer than ten reduced radii are within the limits, or a cell is smaller than
            its sphere.
    """
    max_packings = 6
    map_function = executor.map if executor else map
    packing = packings.packing
    target = packing.fraction
    best = cells
    best_error = np.inf
    for number in range(max_packings):
        sample = reduced_radii(cells)
        fit = HermiteFit(*rule.of(sample))
        slopes = fit.slopes(sample.truncated(fit.a1, fit.a3))
        map_fraction = _mean_fraction(rule.shape, fit, slopes)
        error = abs(map_fraction / target - 1)
        if error < best_error:
            best = cells
            best_error = error
        progress(0.5 + 0.2 * (number + 1) / max_packings)
        # The exponent is above 1, since a denser packing loses more to the limit.
        correction = (target / map_fraction) ** 1.5
        fraction = min(packing.fraction * correction, rule.shape.densest)
        # Denser than `densest` spheres do not pack: the fraction then stays as it is.
        is_last = number == max_packings - 1 or fraction == packing.fraction
        if best_error < 5e-3 or is_last:
            break
        packing = replace(packing, fraction=fraction)
        # With the same seed only the fraction changes, and not the choice of radii as well.
        denser = Packings.make(packing, len(packings), seed=packings.seed, executor=executor)
        cells = list(map_function(with_cells, denser))
    return best


@dataclass(frozen=True, eq=False)
class FuzzyFit:
    """Radius map fitted to a sample of r_n, with fuzzy slopes.

    Args:
        truncated: The values of the sample within the limits.
        pbox: Fuzzy radius map.
        slopes: Bootstrap band of the fitted slopes.
        band: Half-width of the bootstrap band of the distribution function, in probability.
    """

    truncated: AreaWeighted
    pbox: PBox
    slopes: SlopeBand
    band: float


def fit_map(rule: RadiusLimits, sample: AreaWeighted, *, seed: int) -> FuzzyFit:
    """Fit the radius map to a sample of reduced radii and make its slopes fuzzy.

    A reduced radius r_n is that of a particle over half the side of a square or cube as large as
    its cell.

    Args:
        rule: Limits of r_n between which it is fitted.
        sample: Reduced radii of all cells, weighted by area or volume, in groups for the bootstrap.
        seed: Seed of the bootstrap, 0 or more.

    Returns:
        The values within the limits; the p-box (bounds of the distribution function) that contains
        their distribution but for its bootstrap band, with the fuzzy slopes; the bootstrap band of
        the slopes; and the half-width of the band of the distribution function.

    Raises:
        RefusedError: All cells have one r_n; without stated limits, more than 15 % of the area or
            volume is in cells too tight for a map; fewer than ten values are within the limits, or
            there are fewer than five groups.
        FailedError: No p-box contains the sample.
    """
    capped = rule.capped(sample)
    lower, upper = rule.of(capped)
    require(
        upper - lower >= 1e-6,  # a smaller range is rounding
        "r_n",
        value=f"{upper:.10g} in all cells",
        allowed="cells of unequal r_n",
        cure=f"set [radius] to a1 = {upper:.10g}, a2 = 0, a3 = {upper:.10g}, a4 = 0",
    )
    truncated = capped.truncated(lower, upper)
    fit = HermiteFit(lower, upper)
    # Two streams, so that more resamples of one band do not change the other.
    band_seed, slope_seed = np.random.SeedSequence(seed, spawn_key=(1,)).spawn(2)
    confidence = 0.99  # of both bands
    band_generator = np.random.default_rng(band_seed)
    band = truncated.band_half_width(confidence, RESAMPLES, band_generator)
    slope_generator = np.random.default_rng(slope_seed)
    slopes = slope_band(
        fit, truncated, level=confidence, resamples=RESAMPLES, generator=slope_generator
    )
    # For discs, but not for spheres, the supports must contain the bootstrap band of the slopes.
    required = slopes if rule.shape == DISCS else None
    pbox = least_pbox(fit, truncated, band, required=required)
    return FuzzyFit(truncated, pbox, slopes, band)


def _neighbour_numbers(sections: Sequence[ParticleCells]) -> dict[str, object]:
    """Return number and distances of direct neighbours, and the correlation of their reduced radii.

    Neighbours are joined by an edge of a Delaunay triangulation of the centres. A reduced radius is
    the radius of a disc over half the side of a square as large as its cell.

    Args:
        sections: Particles and cells; those without a diagram (spheres) are left out.

    Returns:
        "neighbours" with "counted", the number of particles whose neighbours were counted, the
        "mean" number of neighbours and the "mean_distance" of their centres in m, None where there
        are none; and "correlation", the mean over the sections of the correlation of reduced radii
        of cells that share a wall, NaN if any section has no such pairs or equal radii. Empty for
        spheres, whose cells have no diagram.
    """
    diagrams = [section.diagram for section in sections if section.diagram]
    if not diagrams:
        return {}
    direct = [neighbours(diagram.discs) for diagram in diagrams]
    numbers = np.concatenate([found.number for found in direct])
    distances = np.concatenate([found.distances for found in direct])
    # Pairs are counted in both orders, so that it does not matter which cell is called the first.
    correlations = []
    for diagram in diagrams:
        pairs = neighbouring_values(diagram, diagram.reduced_radii)
        correlations.append(np.corrcoef(pairs)[0, 1])
    return {
        "neighbours": {
            "counted": len(numbers),
            "mean": float(numbers.mean()) if len(numbers) else None,
            "mean_distance": float(distances.mean()) if len(distances) else None,
        },
        "correlation": float(np.mean(correlations)),
    }


def _mean_fraction(shape: Shape, fit: HermiteFit, slopes: tuple[float, float]) -> float:
    """Return the mean fraction of the cell that the particle fills, for slopes (a2, a4)."""
    # r is cubic in θ, so that r² has degree 6 and r³ degree 9; eight nodes are exact to degree 15.
    rule = gauss_rule(fit.distribution, points=8)
    return float(rule.mean(shape.fractions(fit.map(slopes)(rule.nodes))))
