"""From particles to the fuzzy radius map (sections 4.1 and 4.2).

This differs from the paper in: 1. The supports of a2 and a4 are derived: they span the p-box of
least area that contains the sample's distribution save for its own bootstrap band. 2. The bound of
r_n for non-overlapping discs is √(4/π) for any cell and 1 for the square one, not √(π/4). 3. a1 and
a3 are the limits themselves, not the middles of the outer two of 100 bins between them (0.13 +
0.0037 and 0.87 − 0.0037 in the paper).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field
from time import perf_counter

import numpy as np

from alphacut.stochastic.errors import RefusedError, UnfitDataError
from alphacut.stochastic.fit.area_weighted import DISCS, SPHERES, AreaWeighted, Shape
from alphacut.stochastic.fit.hermite_fit import HermiteFit, SlopeBand, slope_band
from alphacut.stochastic.fit.pbox import PBox, least_pbox
from alphacut.stochastic.sections import Measured, Section, Simulated, reduced_radii
from alphacut.stochastic.spheres.packing import SpherePackings
from alphacut.stochastic.tessellation.delaunay import (
    Neighbours,
    cell_correlation,
    hexagonal_order,
    neighbours,
)
from alphacut.stochastic.theta.quadrature import gauss_rule
from alphacut.stochastic.theta.truncated_normal import TruncatedNormal

TIGHTEST = 0.99
"""r_n of the tightest square cell: a disc touches its sides at 1. Cells tighter than this, as
between particles that touch, count as cells of this one where no limits are given."""

MOST_CAPPED = 0.15  # share of the area that may lie in cells tighter than that
ORDERED = 0.1  # |⟨e^{6iφ}⟩| above which particles are said to lie in rows
SAME = 1e-6  # differences of r_n up to which it is one value, but for round-off
WIDEST = 0.95  # band, in probability, to which one is widened for several samples


@dataclass(frozen=True)
class Study:
    """Settings of the way from a microstructure to a radius map.

    Args:
        source: Where the discs or spheres come from.
        limits: Lower and upper limit of r_n; None for those that keep `share`, up to `TIGHTEST`.
        share: Share of area to keep, with equal shares cut off at both ends; used without `limits`.
            Of spheres the upper limit goes no further than their `Shape.reach`.
        seed: Seed of everything that is left to chance.
        confidence: Level of the simultaneous bootstrap band, in (0, 1).
        bootstrap: Number of resamples, at least 100.
        band: Half width, in probability, by which the distribution may leave the p-box; None for
            that bootstrap band.
        sampling: Whether the supports of a2 and a4 shall also hold the slopes' own bootstrap band,
            so that fewer data make a fuzzier map; of that band the part whose maps are monotone.
            None: of measured particles, not of simulated ones, whose number is a matter of choice.
        distribution: Law of θ.
    """

    source: Simulated | Measured | SpherePackings
    limits: tuple[float, float] | None = None
    share: float = 0.9927
    seed: int = 0
    confidence: float = 0.99
    bootstrap: int = 500
    band: float | None = None
    sampling: bool | None = None
    distribution: TruncatedNormal = field(default_factory=TruncatedNormal)

    @property
    def holds_slopes(self) -> bool:
        """True if the supports of a2 and a4 hold the slopes' own band."""
        return isinstance(self.source, Measured) if self.sampling is None else self.sampling

    @property
    def shape(self) -> Shape:
        """The kind of the particles."""
        return SPHERES if isinstance(self.source, SpherePackings) else DISCS

    def limits_of(self, sample: AreaWeighted) -> tuple[float, float]:
        """Limits of r_n of a sample."""
        lower, upper = self.limits or sample.limits(self.share)
        if self.limits is None and self.shape.reach is not None:
            upper = min(upper, self.shape.reach)
        return lower, upper

    def used(self, sample: AreaWeighted) -> AreaWeighted:
        """The sample with cells of discs no tighter than `TIGHTEST`, unless limits are given.

        Raises:
            UnfitDataError: More than `MOST_CAPPED` of the area lies in cells tighter than that.
        """
        if self.limits or self.shape is SPHERES:
            return sample
        share = 1 - float(sample.cdf(TIGHTEST))
        if share > MOST_CAPPED:
            raise UnfitDataError(
                f"{share:.1%} of the area lies in cells tighter than r_n = {TIGHTEST:g}, and a disc"
                f" fills its square cell at 1; at area fraction {sample.area_fraction:.4f} no"
                " square cell stands for these particles: take an image of them as the cell"
                " ([cell] image), or give limits"
            )
        return sample.capped(TIGHTEST)


@dataclass(frozen=True, eq=False)
class FittedMap:
    """Fuzzy radius map of reduced radii, with the statistics that it rests on.

    Args:
        study: How it was found.
        sample: Area-weighted r_n of all whole cells.
        kept: The part of it within the limits.
        pbox: Fuzzy radius map.
        slopes: Bootstrap band of the fitted slopes.
        band: Half width of the simultaneous bootstrap band of the distribution function, in
            probability.
        allowed: Half width by which the distribution may leave the p-box: that band, or the one
            asked for.
    """

    study: Study
    sample: AreaWeighted
    kept: AreaWeighted
    pbox: PBox
    slopes: SlopeBand
    band: float
    allowed: float

    @property
    def limits(self) -> tuple[float, float]:
        """Limits of r_n, which are a1 and a3."""
        return self.pbox.fit.a1, self.pbox.fit.a3

    @property
    def share_kept(self) -> float:
        """Share of area within the limits."""
        return self.sample.share_within(*self.limits)

    @property
    def fraction_of_map(self) -> float:
        """Mean share of the cell that the particle takes, for the modal map."""
        slopes = (self.pbox.a2[1], self.pbox.a4[1])
        return fraction_of(self.study.shape, self.pbox.fit, slopes)


def fraction_of(shape: Shape, fit: HermiteFit, slopes: tuple[float, float]) -> float:
    """Mean share of the cell that the particle takes, for the map with these slopes."""
    rule = gauss_rule(fit.distribution, points=8)
    return float(rule.mean(shape.shares(fit.map(slopes)(rule.nodes))))


@dataclass(frozen=True, eq=False)
class Microstructure(FittedMap):
    """Radius map of discs.

    Args:
        sections: Discs and cells.
        direct: Delaunay neighbours of each section.
        seconds: Wall time by stage: pack, fit, neighbours, total.
    """

    sections: list[Section]
    direct: list[Neighbours]
    seconds: dict[str, float]

    @property
    def share_kept(self) -> float:
        """Share of area within the limits, cells of `share_capped` among it."""
        return self.study.used(self.sample).share_within(*self.limits)

    @property
    def hexagonal_order(self) -> float:
        """Root mean square over the sections of |⟨e^{6iφ}⟩| of the bonds between neighbours."""
        return float(np.sqrt(np.mean([hexagonal_order(near) ** 2 for near in self.direct])))

    @property
    def is_crystalline(self) -> bool:
        """True if that order is above `ORDERED` and what chance gives to so few bonds."""
        bonds = float(np.mean([len(near.first) / 2 for near in self.direct]))
        return bool(self.hexagonal_order > max(ORDERED, 3 / np.sqrt(max(bonds, 1.0))))

    @property
    def share_capped(self) -> float:
        """Share of area in cells tighter than `TIGHTEST`, taken as that tight; 0 with limits."""
        return 0.0 if self.study.limits else 1 - float(self.sample.cdf(TIGHTEST))


def study(
    case: Study,
    *,
    executor: Executor | None = None,
    progress: Callable[[float], None] | None = None,
) -> Microstructure:
    """Do all of it for discs: cells, distribution, limits, fit, p-box, neighbours.

    Args:
        case: What to do.
        executor: Runs the packings; one after the other if None. The result is the same.
        progress: Told the share done, 0 to 1.

    Raises:
        ValueError: Measured data make no sense, or the source is one of spheres.
        RefusedError: A packing fails its test, more than `MOST_CAPPED` of the area lies in cells
            too tight, or no p-box contains the sample.
    """
    if isinstance(case.source, SpherePackings):
        raise ValueError("this source packs spheres; sphere_study takes it")
    begin = perf_counter()
    tell = progress or (lambda share: None)
    sections = case.source.sections(
        case.seed, executor=executor, progress=lambda share: tell(0.7 * share)
    )
    packed = perf_counter()
    found = fitted_map(case, reduced_radii(sections))
    tell(0.9)
    fitted = perf_counter()
    direct = [neighbours(section.discs) for section in sections]
    tell(1.0)
    end = perf_counter()
    seconds = {
        "pack": packed - begin,
        "fit": fitted - packed,
        "neighbours": end - fitted,
        "total": end - begin,
    }
    return Microstructure(**vars(found), sections=sections, direct=direct, seconds=seconds)


def fitted_map(case: Study, sample: AreaWeighted, others: Sequence[AreaWeighted] = ()) -> FittedMap:
    """Limits, fit and p-box of reduced radii.

    Args:
        case: The settings.
        sample: r_n of all whole cells.
        others: r_n that are possible besides. The limits and the p-box then take all in, the modal
            map is that of `sample`; a band too narrow for any map of these limits is widened by
            halves until one holds them, and told in `allowed`.

    Raises:
        UnfitDataError: All cells have one r_n, or no p-box contains the samples.
    """
    streams = np.random.SeedSequence(case.seed, spawn_key=(1,)).spawn(2)
    used = case.used(sample)
    every = [case.limits_of(one) for one in (used, *others)]
    lower, upper = min(low for low, _ in every), max(high for _, high in every)
    if case.limits is None and abs(upper - lower) < SAME:
        raise UnfitDataError(
            f"all cells kept have one r_n, {upper:.10g}, and a fit needs unequal ones: take"
            f" [radius] with a1 = {upper:.10g}, a2 = 0, a3 = {upper:.10g}, a4 = 0 in place of"
            " [microstructure] and of its stage"
        )
    kept, fit = used.truncated(lower, upper), HermiteFit(lower, upper, case.distribution)
    band = kept.band(case.confidence, case.bootstrap, np.random.default_rng(streams[0]))
    slopes = slope_band(
        fit,
        kept,
        level=case.confidence,
        resamples=case.bootstrap,
        generator=np.random.default_rng(streams[1]),
    )
    allowed = band if case.band is None else case.band
    more = [one.truncated(lower, upper) for one in others]
    while True:
        try:
            pbox = least_pbox(
                fit, kept, allowed, hold=slopes if case.holds_slopes else None, others=more
            )
            break
        except RefusedError:
            if not more or allowed >= WIDEST:
                raise
            allowed = min(max(1.5 * allowed, 1e-3), WIDEST)
    return FittedMap(case, sample, kept, pbox, slopes, band, allowed)


def mean_correlation(sections: list[Section]) -> float:
    """Mean correlation of r_n between cells that share a wall."""
    return float(
        np.mean(
            [
                cell_correlation(section.diagram, section.diagram.reduced_radii)
                for section in sections
            ]
        )
    )
