"""From spheres to the fuzzy radius map: packings, power cells and the plane's fit, in space.

A cubic cell holds no sphere of r_n ≥ 1, and cells of a packing may be tighter: what lies above the
upper limit is cut off, and with it some of the spheres' volume. So the spheres are packed more
densely, by as much as makes the volume fraction of the fitted map the one that is asked for.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from time import perf_counter

import numpy as np

from alphacut.stochastic.fit.area_weighted import AreaWeighted
from alphacut.stochastic.fit.hermite_fit import HermiteFit
from alphacut.stochastic.microstructure import FittedMap, Study, fitted_map, fraction_of
from alphacut.stochastic.spheres.packing import FEWEST, MOST_VOLUME, SpherePacking, SpherePackings
from alphacut.stochastic.spheres.power_cells import cell_volumes, reduced_radii
from alphacut.stochastic.spheres.spheres import Spheres
from alphacut.stochastic.theta.truncated_normal import Array

ROUNDS = 6  # at the packings of one law; the nearest counts
NEAR = 5e-3  # relative difference of volume fractions that ends them
STEEPER = 1.5  # the limit cuts off more than in proportion
OFF = 5e-3  # relative difference of the final map's that is told
TOLD = 0.25  # share of the volume beyond the limits that is told; E was 4 % high at 0.38


@dataclass(frozen=True, eq=False)
class Packed:
    """Packings of one law of radii, with their cells.

    Args:
        name: The law.
        packings: The spheres.
        volumes: Volumes of the power cells of each, in m³.
        sample: Their volume-weighted r_n.
        fraction: Volume fraction of the packings.
    """

    name: str
    packings: list[Spheres]
    volumes: list[Array]
    sample: AreaWeighted
    fraction: float


@dataclass(frozen=True, eq=False)
class SphereMicrostructure(FittedMap):
    """Radius map of spheres.

    Args:
        source: Where the spheres come from.
        packed: The packings of the law, and of each one that is possible besides.
        seconds: Wall time by stage: pack, fit, total.
    """

    source: SpherePackings
    packed: list[Packed]
    seconds: dict[str, float]

    @property
    def share_beyond(self) -> float:
        """Share of the volume in cells too tight for the upper limit."""
        return 1 - float(self.sample.cdf(self.limits[1]))

    @property
    def remarks(self) -> Iterator[str]:
        """What the map does not hold, and what the section cannot tell."""
        asked, own = self.source.packing.volume_fraction, self.fraction_of_map
        yield from self.source.remarks
        if self.share_beyond > TOLD:
            yield (
                f"{self.share_beyond:.1%} of the volume lies in cells tighter than r_n ="
                f" {self.limits[1]:.3g}, as no cubic cell is; the map, and E, are of the other"
                f" {1 - self.share_beyond:.1%} alone"
            )
        if abs(own / asked - 1) > OFF:
            why = "more spheres come nearer"
            if abs(own / asked - 1) > 0.02:
                why = f"cells may be tighter than cubic ones, and r_n ends at {self.limits[1]:.3g}"
            yield f"the map has the volume fraction {own:.4f}, {asked:.4f} is asked for: {why}"
        if self.source.section is not None:
            yield (
                f"the radii are known only within bounds that hold with"
                f" {100 * self.source.section.level:g} %: {self.source.section.unknown}"
            )
            if self.allowed > self.band and self.study.band is None:
                yield (
                    f"no map of these limits holds every possible law within the band"
                    f" {self.band:.2g}; it is widened to {self.allowed:.2g}"
                )


def sphere_study(
    case: Study,
    *,
    executor: Executor | None = None,
    progress: Callable[[float], None] | None = None,
) -> SphereMicrostructure:
    """As `study`, for spheres: packings, power cells, distribution, limits, fit, p-box.

    Raises:
        ValueError: The source is not one of spheres.
        RefusedError: Spheres find no place, Voro++ is missing, or no p-box contains the sample.
    """
    source = case.source
    if not isinstance(source, SpherePackings):
        raise ValueError("this source is one of discs; study takes it")
    begin, tell = perf_counter(), progress or (lambda share: None)
    packed = []
    for number, (name, packing) in enumerate(source.laws.items()):
        count = FEWEST if number else source.packings
        packed.append(_packed(case, (number, name), packing, count, executor))
        tell(0.9 * (number + 1) / len(source.laws))
    filled = perf_counter()
    first, *others = (one.sample for one in packed)
    found, end = fitted_map(case, first, others), perf_counter()
    tell(1.0)
    seconds = {"pack": filled - begin, "fit": end - filled, "total": end - begin}
    return SphereMicrostructure(**vars(found), source=source, packed=packed, seconds=seconds)


def _packed(
    case: Study, law: tuple[int, str], packing: SpherePacking, count: int, executor: Executor | None
) -> Packed:
    """Packings of one law, as dense as makes its own map's volume fraction that of `packing`."""
    number, name = law
    asked = wanted = packing.volume_fraction
    best, off = None, np.inf
    for _ in range(ROUNDS):
        tried = replace(packing, volume_fraction=wanted)
        spheres, volumes = _cells(tried, count, (case.seed, number), executor)
        sample = reduced_radii(spheres, volumes)
        mapped = map_fraction(case, sample)
        if abs(mapped / asked - 1) < off:
            off = abs(mapped / asked - 1)
            best = Packed(name, spheres, volumes, sample, wanted)
        if off < NEAR or (wanted == MOST_VOLUME and mapped < asked):
            break
        wanted = min(wanted * (asked / mapped) ** STEEPER, MOST_VOLUME)
    assert best is not None
    return best


def map_fraction(case: Study, sample: AreaWeighted) -> float:
    """Volume fraction of the map fitted to a sample within its own limits."""
    lower, upper = case.limits_of(sample)
    fit = HermiteFit(lower, upper, case.distribution)
    return fraction_of(case.shape, fit, fit.slopes(sample.truncated(lower, upper)))


def _cells(
    packing: SpherePacking, count: int, key: tuple[int, ...], executor: Executor | None
) -> tuple[list[Spheres], list[Array]]:
    """Packings and the volumes of their cells; the k-th depends on `key` and k only."""
    seeds = np.random.SeedSequence(key[0], spawn_key=(2, *key[1:])).spawn(count)
    made = list((executor.map if executor else map)(_one, [packing] * count, seeds))
    return [spheres for spheres, _ in made], [volumes for _, volumes in made]


def _one(packing: SpherePacking, seed: np.random.SeedSequence) -> tuple[Spheres, Array]:
    """One packing with the volumes of its cells."""
    spheres = packing.make(np.random.default_rng(seed), whole=True)
    return spheres, cell_volumes(spheres)
