"""From particles to the fuzzy radius map (sections 4.1 and 4.2).

This differs from the paper in: 1. The supports of a2 and a4 are derived: they span the p-box of
least area that contains the sample's distribution save for its own bootstrap band. 2. The bound of
r_n for non-overlapping discs is √(4/π) for any cell and 1 for the square one, not √(π/4). 3. a1 and
a3 are the limits themselves, not the middles of the outer two of 100 bins between them (0.13 +
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
from alphacut.fuzzy import Crisp, FuzzyNumber, Triangular
from alphacut.fuzzy.campaign.workers import pool
from alphacut.stochastic.fit.area_weighted import AreaWeighted
from alphacut.stochastic.fit.hermite_fit import HermiteFit, PBox, SlopeBand, least_pbox, slope_band
from alphacut.stochastic.particles.packings import Packings
from alphacut.stochastic.particles.particles import Particles
from alphacut.stochastic.particles.shapes import DISCS, SPHERES, Shape
from alphacut.stochastic.radius_map import HermiteMap
from alphacut.stochastic.sections import ParticleCells, reduced_radii, with_cells
from alphacut.stochastic.tessellation.apollonius import neighbouring_values, neighbours
from alphacut.stochastic.theta.quadrature import gauss_rule

if TYPE_CHECKING:
    import xarray

SHARE_WITHIN = 0.9927  # share of the area between the limits where none are set (Fig. 12)
CONFIDENCE = 0.99  # of both bootstrap bands
RESAMPLES = 500
MAX_CAPPED = 0.15  # share of the area that may lie in cells tighter than `Shape.reach`
MIN_RANGE = 1e-6  # of r_n: a smaller one is round-off
MAX_PACKINGS = 6  # of spheres, to find the fraction at which the map has that of the case
FRACTION_TOLERANCE = 5e-3  # relative difference of the fractions that ends the search
FRACTION_EXPONENT = 1.5  # above 1, since the limit cuts off more than in proportion
CRISP_TOLERANCE = 1e-6  # of a3 − a1: an end nearer to the fitted slope differs by round-off


@dataclass(frozen=True)
class RadiusLimits:
    """Between which reduced radii r_n a map is fitted.

    Args:
        shape: Kind of the particles.
        stated: Lower and upper limit; None for those that cut off equal fractions of area or volume
            at both ends and keep `SHARE_WITHIN` of it, up to `Shape.reach`.
        packed_fraction: Fraction of packed particles, for a message; None of measured ones.
    """

    shape: Shape
    stated: tuple[float, float] | None = None
    packed_fraction: float | None = None

    def of(self, sample: AreaWeighted) -> tuple[float, float]:
        """Return lower and upper limit of r_n for a sample."""
        if self.stated is not None:
            return self.stated
        lower, upper = sample.limits(SHARE_WITHIN)
        return lower, min(upper, self.shape.reach)

    def capped(self, sample: AreaWeighted) -> AreaWeighted:
        """Copy of a sample with r_n of discs capped at `Shape.reach`, unless limits are stated.

        Cells of spheres that are tighter are cut off by the limits instead. More than `MAX_CAPPED`
        of the area or volume in such cells is refused.
        """
        if self.stated is not None:
            return sample
        shape, fraction = self.shape, self.capped_fraction(sample)
        value = f"{fraction:.1%} of the {shape.cells} in cells tighter than r_n = {shape.reach:g}"
        allowed = f"shares up to {MAX_CAPPED:.0%}, since particles touch at r_n = 1"
        require(fraction <= MAX_CAPPED, "particles", value=value, allowed=allowed, cure=self._cure)
        return sample if shape == SPHERES else sample.capped(shape.reach)

    def capped_fraction(self, sample: AreaWeighted) -> float:
        """Fraction of area or volume in cells tighter than `Shape.reach`; 0 of stated limits."""
        return 0.0 if self.stated is not None else 1 - float(sample.cdf(self.shape.reach))

    @property
    def _cure(self) -> str:
        """Advice in the message on particles that are too dense for cells of one particle."""
        fraction = "…" if self.packed_fraction is None else f"{self.packed_fraction:g}"
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
        truncated: The part of it within the limits.
        pbox: Fuzzy radius map.
        slopes: Bootstrap band of the fitted slopes.
        band: Half width of that of the distribution function, in probability.
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
        """The radius map at the nominal slopes."""
        fit = self.pbox.fit
        ends = [float(f"{end:.10g}") for end in (fit.a1, fit.a3)]
        a2, a4 = self.triangles.values()
        return HermiteMap(ends[0], a2[1], ends[1], a4[1], fit.distribution)

    @property
    def inputs(self) -> dict[str, FuzzyNumber]:
        """The slopes "a2" and "a4" of the map as fuzzy numbers."""
        return {
            name: Triangular(*ends) if ends[0] < ends[2] else Crisp(ends[1])
            for name, ends in self.triangles.items()
        }

    @property
    def triangles(self) -> dict[str, tuple[float, float, float]]:
        """Lower end, nominal value and upper end of each slope, in eight digits.

        Ends that differ from the nominal value by round-off are that value.
        """
        fit = self.pbox.fit
        tolerance = CRISP_TOLERANCE * (fit.a3 - fit.a1)
        triangles = {}
        for name, (lower, nominal, upper) in {"a2": self.pbox.a2, "a4": self.pbox.a4}.items():
            low = nominal if abs(lower - nominal) <= tolerance else lower
            high = nominal if abs(upper - nominal) <= tolerance else upper
            triangles[name] = float(f"{low:.8g}"), float(f"{nominal:.8g}"), float(f"{high:.8g}")
        return triangles

    @property
    def fraction(self) -> float:
        """Mean fraction of the cell that the particle fills, at the nominal slopes."""
        return _fraction(self.shape, self.pbox.fit, (self.pbox.a2[1], self.pbox.a4[1]))

    @property
    def limits(self) -> tuple[float, float]:
        """Limits of r_n, which are a1 and a3."""
        return self.pbox.fit.a1, self.pbox.fit.a3

    @property
    def share_within(self) -> float:
        """Fraction of area or volume within the limits, capped cells among it."""
        return self.rule.capped(self.sample).share_within(*self.limits)

    def __str__(self) -> str:
        """Return the map and its fuzzy slopes, and how many cells they rest on."""
        cells = f"{len(self.sample.values)} cells of {self.shape.particles}"
        words = f"{self.share_within:.2%} of their {self.shape.cells} within the limits"
        a2, a4 = self.triangles.values()
        slopes = f"a2 = {a2[0]:.4g} … {a2[1]:.4g} … {a2[2]:.4g}"
        slopes += f", a4 = {a4[0]:.4g} … {a4[1]:.4g} … {a4[2]:.4g}"
        ends = f"a1 = {self.limits[0]:.4g}, a3 = {self.limits[1]:.4g}"
        fraction = f"{self.shape.cells} fraction {self.fraction:.4f}"
        return f"radius map of {cells}, {words}: {ends}, {slopes}; {fraction}"

    __repr__ = __str__

    def to_dataset(self) -> xarray.Dataset:
        """Return cdf of the sample, pbox_lower, pbox_upper and fitted over 501 r_n as a dataset."""
        import xarray

        box, fit = self.pbox, self.pbox.fit
        radius = np.linspace(fit.a1, fit.a3, 501)
        law = fit.distribution
        theta = np.asarray(np.linspace(law.lower, law.upper, 5001), float)
        low, high = box.bounds(theta)
        probability = fit.distribution.cdf(theta)
        columns = {
            "cdf": self.truncated.cdf(radius),
            "pbox_lower": np.interp(radius, high, probability),
            "pbox_upper": np.interp(radius, low, probability),
            "fitted": np.interp(radius, fit.map((box.a2[1], box.a4[1]))(theta), probability),
        }
        variables = {name: ("r_n", values, {"units": "1"}) for name, values in columns.items()}
        dataset = xarray.Dataset(variables, {"r_n": radius})
        name = "reduced radius: radius over half the side of a square or cube as large as the cell"
        dataset["r_n"].attrs = {"units": "1", "long_name": name}
        return dataset

    def numbers(self) -> dict[str, object]:
        """All numbers by the keys of the JSON file, lengths in m."""
        packings = [section.particles for section in self.sections]
        radii = np.concatenate([packing.radii for packing in packings])
        shape, pbox, triangles = self.shape, self.pbox, self.triangles
        nominal = self.map
        law = nominal.distribution
        cell_fraction = float(self.sample.weights @ shape.fractions(self.sample.values))  # eq. 10
        numbers: dict[str, object] = {
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
        }
        return {
            **numbers,
            **_neighbour_numbers(self.sections),
            "cells": len(self.sample.values),
            "mean_r_n": self.sample.mean,
            "largest_r_n": float(self.sample.values[-1]),
            "limits": list(self.limits),
            "share_kept": self.share_within,
            "a1": pbox.fit.a1,
            "a2": list(pbox.a2),
            "a3": pbox.fit.a3,
            "a4": list(pbox.a4),
            "a2_band": list(self.slopes.a2),
            "a4_band": list(self.slopes.a4),
            "band": self.band,
            "pbox_area": pbox.area,
            "pbox_breach": pbox.excess(self.truncated),
            "misfit": pbox.fit.misfit(self.truncated, (pbox.a2[1], pbox.a4[1])),
            "seed": self.seed,
            "radius": {
                "theta": [float(f"{end:g}") for end in (law.lower, law.upper)],
                "a1": nominal.a1,
                "a2": list(triangles["a2"]),
                "a3": nominal.a3,
                "a4": list(triangles["a4"]),
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
        limits: Lower and upper limit of r_n, which are a1 and a3 of the map; None for those that
            keep 99.27 % of the area.
        seed: Seed of the bootstrap.
        workers: Processes that tessellate; the result does not depend on their number.
        progress: Function that takes the completed fraction.

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
    packed_fraction = sections.packing.fraction if isinstance(sections, Packings) else None
    rule = RadiusLimits(sections[0].shape, limits, packed_fraction)
    with pool(workers) as executor:
        map_function = executor.map if executor else map
        cells = list(map_function(with_cells, sections))
        report(0.5)
        if isinstance(sections, Packings) and rule.shape == SPHERES:
            cells = _repacked(rule, sections, cells, executor=executor, progress=report)
    sample = reduced_radii(cells)
    truncated, pbox, slopes, band = fit_map(rule, sample, seed=seed)
    report(1.0)
    return FittedRadiusMap(rule, seed, cells, sample, truncated, pbox, slopes, band)


def _repacked(
    rule: RadiusLimits,
    packings: Packings,
    cells: list[ParticleCells],
    *,
    executor: Executor | None,
    progress: Callable[[float], None],
) -> list[ParticleCells]:
    """Cells of spheres packed to the fraction at which the fitted map has that of the packings.

    `cells` are those of the packings themselves. The fraction is corrected until the error is below
    `FRACTION_TOLERANCE`, at most `MAX_PACKINGS` times; the cells of the least error are returned.
    """
    map_function = executor.map if executor else map
    packing = packings.packing
    target, best, least_error = packing.fraction, cells, np.inf
    for number in range(MAX_PACKINGS):
        sample = reduced_radii(cells)
        fit = HermiteFit(*rule.of(sample))
        map_fraction = _fraction(rule.shape, fit, fit.slopes(sample.truncated(fit.a1, fit.a3)))
        error = abs(map_fraction / target - 1)
        if error < least_error:
            best, least_error = cells, error
        progress(0.5 + 0.2 * (number + 1) / MAX_PACKINGS)
        correction = (target / map_fraction) ** FRACTION_EXPONENT
        fraction = min(packing.fraction * correction, rule.shape.densest)
        is_last = number == MAX_PACKINGS - 1 or fraction == packing.fraction
        if least_error < FRACTION_TOLERANCE or is_last:
            break
        packing = replace(packing, fraction=fraction)
        denser = Packings.make(packing, len(packings), seed=packings.seed, executor=executor)
        cells = list(map_function(with_cells, denser))
    return best


def fit_map(
    rule: RadiusLimits, sample: AreaWeighted, *, seed: int
) -> tuple[AreaWeighted, PBox, SlopeBand, float]:
    """Fit the radius map to a sample of r_n and make its slopes fuzzy.

    Returns:
        Sample within the limits, p-box, bootstrap band of the slopes, and half width of that of the
        distribution function, in probability.

    Raises:
        RefusedError: All cells have one r_n.
        FailedError: No p-box contains the sample.
    """
    seeds = np.random.SeedSequence(seed, spawn_key=(1,)).spawn(2)
    capped = rule.capped(sample)
    lower, upper = rule.of(capped)
    value, allowed = f"{upper:.10g} in all cells", "cells of unequal r_n"
    cure = f"set [radius] to a1 = {upper:.10g}, a2 = 0, a3 = {upper:.10g}, a4 = 0"
    require(upper - lower >= MIN_RANGE, "r_n", value=value, allowed=allowed, cure=cure)
    truncated, fit = capped.truncated(lower, upper), HermiteFit(lower, upper)
    band_rng, slope_rng = map(np.random.default_rng, seeds)
    band = truncated.band_half_width(CONFIDENCE, RESAMPLES, band_rng)
    slopes = slope_band(fit, truncated, level=CONFIDENCE, resamples=RESAMPLES, generator=slope_rng)
    pbox = least_pbox(fit, truncated, band, required=slopes if rule.shape == DISCS else None)
    return truncated, pbox, slopes, band


def _neighbour_numbers(sections: Sequence[ParticleCells]) -> dict[str, object]:
    """Number and distances of direct neighbours, and correlation of r_n; empty for spheres."""
    diagrams = [section.diagram for section in sections if section.diagram]
    if not diagrams:
        return {}
    direct = [neighbours(diagram.discs) for diagram in diagrams]
    number = np.concatenate([found.number for found in direct])
    distance = np.concatenate([found.distances for found in direct])
    sharing = [neighbouring_values(diagram, diagram.reduced_radii) for diagram in diagrams]
    return {
        "neighbours": {
            "counted": len(number),
            "mean": float(number.mean()) if len(number) else None,
            "mean_distance": float(distance.mean()) if len(distance) else None,
        },
        "correlation": float(np.mean([np.corrcoef(pairs)[0, 1] for pairs in sharing])),
    }


def _fraction(shape: Shape, fit: HermiteFit, slopes: tuple[float, float]) -> float:
    """Return the mean fraction of the cell that the particle fills, for slopes (a2, a4)."""
    rule = gauss_rule(fit.distribution, points=8)
    return float(rule.mean(shape.fractions(fit.map(slopes)(rule.nodes))))
