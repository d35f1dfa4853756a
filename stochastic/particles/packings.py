"""Independent packings of particles: the sections from which a radius map is fitted."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from typing import overload

import numpy as np

from alphacut.base.errors import checked_number, require, require_choice, require_numbers
from alphacut.fuzzy.campaign.workers import pool
from alphacut.stochastic.particles.packing import Packing
from alphacut.stochastic.particles.particles import Particles
from alphacut.stochastic.particles.radius_distributions import (
    LogNormalRadii,
    MeasuredRadii,
    RadiusDistribution,
)
from alphacut.stochastic.particles.shapes import DISCS, SPHERES


@dataclass(frozen=True, eq=False)
class Packings(Sequence[Particles]):
    """Independent periodic packings of one kind, a sequence of `Particles`.

    Args:
        packing: Specification of each of them.
        seed: The k-th packing depends on this seed and k only.
        sections: The packings.
    """

    packing: Packing
    seed: int
    sections: tuple[Particles, ...]

    @classmethod
    def make(
        cls,
        packing: Packing,
        count: int,
        *,
        seed: int,
        executor: Executor | None = None,
        progress: Callable[[float], None] | None = None,
    ) -> Packings:
        """Return `count` independent packings.

        Args:
            packing: Specification of each of them: number, fraction, radii and shape of the
                particles.
            count: Number of packings.
            seed: Seed of all packings, 0 or more; the k-th one depends on it and k alone.
            executor: Makes the packings in other processes; None for this process. The packings are
                the same.
            progress: Function that takes the completed fraction after each packing, up to 1.

        Raises:
            RefusedError: A box of too many particles has no room for the largest one.
            FailedError: Particles of a packing still overlap after all steps.
        """
        # Each packing has a stream of its own, so that neither the number of processes nor the
        # number of packings changes it.
        seeds = np.random.SeedSequence(seed).spawn(count)
        map_function = executor.map if executor else map
        sections: list[Particles] = []
        for particles in map_function(_make, [packing] * count, seeds):
            sections.append(particles)
            if progress:
                progress(len(sections) / count)
        return cls(packing, seed, tuple(sections))

    def __len__(self) -> int:
        return len(self.sections)

    @overload
    def __getitem__(self, index: int) -> Particles: ...

    @overload
    def __getitem__(self, index: slice) -> tuple[Particles, ...]: ...

    def __getitem__(self, index: int | slice) -> Particles | tuple[Particles, ...]:
        return self.sections[index]


def _make(packing: Packing, seed: np.random.SeedSequence) -> Particles:
    """Return a random packing; a function of the module, so that processes can be sent it."""
    return packing.make(np.random.default_rng(seed))


def pack(
    particles: int,
    *,
    packings: int = 20,
    fraction: float,
    radii: Sequence[float] | RadiusDistribution,
    shape: str = "discs",
    seed: int = 0,
    workers: int = 1,
    progress: Callable[[float], None] | None = None,
) -> Packings:
    """Pack discs in squares, or spheres in cubes, at random, periodically and without overlap.

    Args:
        particles: Number of particles in each packing, at least 1; there are more where the box
            would not hold the largest one.
        packings: Number of independent packings, at least 1.
        fraction: Fraction of the area or volume that the particles take, above 0 and at most 0.82
            for discs and 0.58 for spheres.
        radii: Smallest and largest radius, in m, of a log-normal distribution (eq. 11); or a
            distribution, as `MeasuredRadii.read` has it from a file.
        shape: "discs" or "spheres".
        seed: Seed of everything left to chance, 0 or more.
        workers: Processes that pack; the packings do not depend on their number.
        progress: Function that takes the completed fraction, up to 1.

    Returns:
        Sequence of the packings; each depends on the seed and its index alone.

    Raises:
        RefusedError: A number is out of range, the fraction is above what packs at random, there is
            no such shape, or `radii` are neither two radii nor a distribution.
        FailedError: The particles still overlap after all steps.

    Example:
        >>> sections = pack(50, packings=3, fraction=0.2, radii=(1e-3, 4e-3), seed=1)
        >>> len(sections), len(sections[0]), round(sections[0].fraction, 3)
        (3, 50, 0.2)
    """
    for key, number in {"particles": particles, "packings": packings, "seed": seed}.items():
        checked_number(key, number, whole=True, positive=key != "seed")
    shapes = {kind.particles: kind for kind in (DISCS, SPHERES)}
    require_choice("shape", shape, shapes)
    if isinstance(radii, LogNormalRadii | MeasuredRadii):
        distribution: RadiusDistribution = radii
    else:
        require_numbers("radii", radii)
        require(len(radii) == 2, "radii", radii, allowed="the smallest and the largest, or a law")
        distribution = LogNormalRadii(smallest=radii[0], largest=radii[1])
    packing = Packing(particles, fraction, distribution, shape=shapes[shape])
    with pool(workers) as executor:
        return Packings.make(packing, packings, seed=seed, executor=executor, progress=progress)
