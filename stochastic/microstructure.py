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

from collections.abc import Callable, Mapping
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from alphacut.base.errors import require
from alphacut.stochastic.fit.area_weighted import AreaWeighted
from alphacut.stochastic.fit.hermite_fit import HermiteFit, PBox, SlopeBand, least_pbox, slope_band
from alphacut.stochastic.particles.measured import CircleFile, SectionImage
from alphacut.stochastic.particles.particles import DISCS, SPHERES, Shape
from alphacut.stochastic.sections import ParticleCells, Simulated, reduced_radii, with_cells
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


@dataclass(frozen=True)
class MicrostructureStudy:
    """Settings of a study: from a microstructure to a radius map.

    Args:
        source: Source of the discs or spheres.
        limits: Lower and upper limit of r_n; None for those that cut off equal shares of area at
            both ends and keep `SHARE_WITHIN` of it, up to `Shape.reach`.
        seed: Seed of all random numbers.
    """

    source: Simulated | CircleFile | SectionImage
    limits: tuple[float, float] | None = None
    seed: int = 0

    @property
    def shape(self) -> Shape:
        """Kind of the particles."""
        return self.source.packing.shape if isinstance(self.source, Simulated) else DISCS

    def limits_of(self, sample: AreaWeighted) -> tuple[float, float]:
        """Return lower and upper limit of r_n for a sample."""
        lower, upper = self.limits or sample.limits(SHARE_WITHIN)
        return lower, upper if self.limits else min(upper, self.shape.reach)

    def cap_sample(self, sample: AreaWeighted) -> AreaWeighted:
        """Copy of a sample with r_n of discs capped at `Shape.reach`, unless limits are stated.

        Cells of spheres that are tighter are cut off by the limits instead. More than `MAX_CAPPED`
        of the area or volume in such cells is refused.
        """
        if self.limits:
            return sample
        shape, fraction = self.shape, 1 - float(sample.cdf(self.shape.reach))
        value = f"{fraction:.1%} of the {shape.cells} in cells tighter than r_n = {shape.reach:g}"
        allowed = f"shares up to {MAX_CAPPED:.0%}, since particles touch at r_n = 1"
        require(fraction <= MAX_CAPPED, "particles", value=value, allowed=allowed, cure=self._cure)
        return sample if shape == SPHERES else sample.capped(shape.reach)

    @property
    def _cure(self) -> str:
        """Advice in the message on particles that are too dense for cells of one particle."""
        source = self.source
        fraction = f"{source.packing.fraction:g}" if isinstance(source, Simulated) else "…"
        by_fraction = f"set cell.fraction = {fraction} in place of [microstructure]"
        if self.shape == SPHERES:
            return by_fraction
        return f"take an image of them as the cell (cell.image), set limits, or {by_fraction}"


@dataclass(frozen=True, eq=False)
class Microstructure:
    """Fuzzy radius map of particles, with the statistics that it rests on.

    Args:
        study: Settings of the study.
        sections: Particles and cells.
        sample: r_n of all whole cells, weighted by area or volume.
        truncated: The part of it within the limits.
        pbox: Fuzzy radius map.
        slopes: Bootstrap band of the fitted slopes.
        band: Half width of that of the distribution function, in probability.
    """

    study: MicrostructureStudy
    sections: list[ParticleCells]
    sample: AreaWeighted
    truncated: AreaWeighted
    pbox: PBox
    slopes: SlopeBand
    band: float

    @property
    def limits(self) -> tuple[float, float]:
        """Limits of r_n, which are a1 and a3."""
        return self.pbox.fit.a1, self.pbox.fit.a3

    @property
    def share_within(self) -> float:
        """Share of area or volume within the limits, capped cells among it."""
        return self.study.cap_sample(self.sample).share_within(*self.limits)

    @property
    def share_capped(self) -> float:
        """Share of area or volume in cells tighter than `Shape.reach`, which are capped."""
        return 0.0 if self.study.limits else 1 - float(self.sample.cdf(self.study.shape.reach))


def study(
    case: MicrostructureStudy,
    *,
    executor: Executor | None = None,
    progress: Callable[[float], None] | None = None,
) -> Microstructure:
    """Fuzzy radius map of a microstructure, with the cells, reduced radii r_n and p-box behind it.

    `executor` runs the packings, with the same result; `progress` takes the completed fraction.

    Raises:
        RefusedError: Measured data are not allowed, or cells are too tight.
        FailedError: The packing is too dense, or no p-box contains the sample.
    """
    report = progress or (lambda fraction: None)
    sections = _sections(case, executor, lambda fraction: report(0.7 * fraction))
    sample = reduced_radii(sections)
    truncated, pbox, slopes, band = fit_map(case, sample)
    report(1.0)
    return Microstructure(case, sections, sample, truncated, pbox, slopes, band)


def _sections(
    case: MicrostructureStudy, executor: Executor | None, progress: Callable[[float], None]
) -> list[ParticleCells]:
    # packings of spheres are repeated with a volume fraction that is corrected until the fitted map
    # has the fraction of the case
    source = case.source
    if not isinstance(source, Simulated):
        return [with_cells(source.read())]
    if case.shape != SPHERES:
        return source.sections(case.seed, executor=executor, progress=progress)
    target = source.packing.fraction
    best_sections, least_error, fraction = [], np.inf, target
    for number in range(MAX_PACKINGS):
        packing = replace(source.packing, fraction=fraction)
        sections = replace(source, packing=packing).sections(case.seed, executor=executor)
        sample = reduced_radii(sections)
        fit = HermiteFit(*case.limits_of(sample))
        map_fraction = _fraction(case.shape, fit, fit.slopes(sample.truncated(fit.a1, fit.a3)))
        error = abs(map_fraction / target - 1)
        if error < least_error:
            best_sections, least_error = sections, error
        progress((number + 1) / MAX_PACKINGS)
        correction = (target / map_fraction) ** FRACTION_EXPONENT
        fraction = min(fraction * correction, case.shape.densest)
        if least_error < FRACTION_TOLERANCE or fraction == packing.fraction:
            break
    return best_sections


def fit_map(
    case: MicrostructureStudy, sample: AreaWeighted
) -> tuple[AreaWeighted, PBox, SlopeBand, float]:
    """Fit the radius map to a sample of r_n and make its slopes fuzzy.

    Returns:
        Sample within the limits, p-box, bootstrap band of the slopes, and half width of that of the
        distribution function, in probability.

    Raises:
        RefusedError: All cells have one r_n.
        FailedError: No p-box contains the sample.
    """
    seeds = np.random.SeedSequence(case.seed, spawn_key=(1,)).spawn(2)
    capped = case.cap_sample(sample)
    lower, upper = case.limits_of(capped)
    value, allowed = f"{upper:.10g} in all cells", "cells of unequal r_n"
    cure = f"set [radius] to a1 = {upper:.10g}, a2 = 0, a3 = {upper:.10g}, a4 = 0"
    require(upper - lower >= MIN_RANGE, "r_n", value=value, allowed=allowed, cure=cure)
    truncated, fit = capped.truncated(lower, upper), HermiteFit(lower, upper)
    band_rng, slope_rng = map(np.random.default_rng, seeds)
    band = truncated.band_half_width(CONFIDENCE, RESAMPLES, band_rng)
    slopes = slope_band(fit, truncated, level=CONFIDENCE, resamples=RESAMPLES, generator=slope_rng)
    pbox = least_pbox(fit, truncated, band, required=slopes if case.shape == DISCS else None)
    return truncated, pbox, slopes, band


def _fraction(shape: Shape, fit: HermiteFit, slopes: tuple[float, float]) -> float:
    """Return the mean fraction of the cell that the particle fills, for slopes (a2, a4)."""
    rule = gauss_rule(fit.distribution, points=8)
    return float(rule.mean(shape.fractions(fit.map(slopes)(rule.nodes))))


CRISP_TOLERANCE = 1e-6  # of a3 − a1: an end nearer to the fitted slope differs by round-off


def summary(result: Microstructure) -> dict[str, object]:
    """All numbers of a microstructure study by the keys of its JSON file, lengths in m."""
    packings = [section.particles for section in result.sections]
    radii = np.concatenate([packing.radii for packing in packings])
    shape, source, pbox = result.study.shape, result.study.source, result.pbox
    cell_fraction = float(result.sample.weights @ shape.fractions(result.sample.values))  # eq. 10
    numbers: dict[str, object] = {
        "particles": shape.particles,
        "packings": len(packings),
        shape.particles: len(radii),
        f"{shape.cells}_fraction": float(np.mean([packing.fraction for packing in packings])),
        f"{shape.cells}_fraction_of_cells": cell_fraction,
        f"mean_{shape.cells}_fraction_of_map": _fraction(shape, pbox.fit, (pbox.a2[1], pbox.a4[1])),
        "fraction_of_case": source.packing.fraction if isinstance(source, Simulated) else None,
        "smallest_radius": float(radii.min()),
        "largest_radius": float(radii.max()),
        "share_capped": result.share_capped,
    }
    return {
        **numbers,
        **_neighbour_numbers(result),
        "cells": len(result.sample.values),
        "mean_r_n": result.sample.mean,
        "largest_r_n": float(result.sample.values[-1]),
        "limits": list(result.limits),
        "share_kept": result.share_within,
        "a1": pbox.fit.a1,
        "a2": list(pbox.a2),
        "a3": pbox.fit.a3,
        "a4": list(pbox.a4),
        "a2_band": list(result.slopes.a2),
        "a4_band": list(result.slopes.a4),
        "band": result.band,
        "pbox_area": pbox.area,
        "pbox_breach": pbox.excess(result.truncated),
        "misfit": pbox.fit.misfit(result.truncated, (pbox.a2[1], pbox.a4[1])),
        "seed": result.study.seed,
        "radius": radius_section(result),
    }


def _neighbour_numbers(result: Microstructure) -> dict[str, object]:
    """Number and distances of direct neighbours, and correlation of r_n; empty for spheres."""
    diagrams = [section.diagram for section in result.sections if section.diagram]
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


def radius_section(result: Microstructure) -> dict[str, list[float] | float]:
    """The case section [radius] as a mapping: ends of θ, a1, a3 and fuzzy a2, a4."""
    box, law = result.pbox, result.pbox.fit.distribution
    tolerance = CRISP_TOLERANCE * (box.fit.a3 - box.fit.a1)

    def triangle(ends: tuple[float, float, float]) -> list[float]:
        """Lower end, nominal value, upper end; ends that differ by round-off are that value."""
        snapped = (ends[1] if abs(end - ends[1]) <= tolerance else end for end in ends)
        return [float(f"{end:.8g}") for end in snapped]

    return {
        "theta": [float(f"{end:g}") for end in (law.lower, law.upper)],
        "a1": float(f"{box.fit.a1:.10g}"),
        "a2": triangle(box.a2),
        "a3": float(f"{box.fit.a3:.10g}"),
        "a4": triangle(box.a4),
    }


def fragment(numbers: Mapping[str, Any]) -> str:
    """The case section [radius] as TOML text, with fractions as comments, from a `summary`."""
    measure = "volume" if "mean_volume_fraction_of_map" in numbers else "area"
    stated, map_fraction = numbers["fraction_of_case"], numbers[f"mean_{measure}_fraction_of_map"]
    words = f"; of the particles: {numbers[f'{measure}_fraction']:.4f}"
    words += "" if stated is None else f"; of the case: {stated:g}"
    lines = [
        f"[radius]  # from {numbers['cells']} cells; the limits keep"
        f" {numbers['share_kept']:.4%} of their {measure}",
        f"# {measure} fraction of this map at its nominal values: {map_fraction:.4f}{words}",
    ]
    for name, value in numbers["radius"].items():
        is_fuzzy = isinstance(value, list)
        ends = ", ".join(f"{x:.10g}" for x in (value if is_fuzzy else [value]))
        lines.append(f"{name} = [{ends}]" if is_fuzzy else f"{name} = {ends}")
    return "\n".join(lines) + "\n"


def to_dataset(result: Microstructure) -> xarray.Dataset:
    """Return cdf of the sample, pbox_lower, pbox_upper and fitted over 501 r_n as a dataset."""
    import xarray

    box, fit = result.pbox, result.pbox.fit
    radius = np.linspace(fit.a1, fit.a3, 501)
    law = fit.distribution
    theta = np.asarray(np.linspace(law.lower, law.upper, 5001), float)
    low, high = box.bounds(theta)
    probability = fit.distribution.cdf(theta)
    columns = {
        "cdf": result.truncated.cdf(radius),
        "pbox_lower": np.interp(radius, high, probability),
        "pbox_upper": np.interp(radius, low, probability),
        "fitted": np.interp(radius, fit.map((box.a2[1], box.a4[1]))(theta), probability),
    }
    variables = {name: ("r_n", values, {"units": "1"}) for name, values in columns.items()}
    dataset = xarray.Dataset(variables, {"r_n": radius})
    name = "reduced radius: radius over half the side of a square or cube as large as the cell"
    dataset["r_n"].attrs = {"units": "1", "long_name": name}
    return dataset
