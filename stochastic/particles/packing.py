"""Periodic packings of non-overlapping discs, tested before they are handed out."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np

from alphacut.stochastic.errors import RefusedError
from alphacut.stochastic.particles.discs import Discs
from alphacut.stochastic.particles.radius_laws import RadiusLaw
from alphacut.stochastic.particles.random_sequential import random_sequential
from alphacut.stochastic.particles.relaxation import relaxed, smallest_gap
from alphacut.stochastic.theta.truncated_normal import Array

METHODS = ("auto", "sequential", "relaxed")
# area fraction, half the gap counted to each radius, up to which sequential addition is quick
SEQUENTIAL_LIMIT = 0.45
LEVEL = 1e-4  # a packing of the right law is refused with this probability


@dataclass(frozen=True)
class Packing:
    """A wish for a packing.

    Args:
        discs: Number of discs, at least 1.
        area_fraction: Share of the square that they cover, in (0, 0.84).
        radii: Law of the radii.
        gap: Least distance between surfaces, in m, not negative.
        method: "sequential" (random sequential addition), "relaxed" (for dense packings), or "auto"
            (the first where it can).

    Raises:
        ValueError: A value lies outside its range.
    """

    discs: int
    area_fraction: float
    radii: RadiusLaw
    gap: float = 0.0
    method: str = "auto"

    def __post_init__(self) -> None:
        if not (isinstance(self.discs, int | np.integer) and self.discs >= 1):
            raise ValueError(
                f"a packing of {self.discs} discs was asked for; it needs a whole number, at"
                " least 1"
            )
        if not 0 < self.area_fraction < 0.84:
            raise ValueError(
                f"the area fraction is {self.area_fraction:g}; it must lie in (0, 0.84), below"
                " random close packing"
            )
        if not 0 <= self.gap < np.inf:
            raise ValueError(f"the gap is {self.gap:g} m; it must be finite and not negative")
        if self.method not in METHODS:
            raise ValueError(
                f"the packing method is {self.method!r}; take one of {', '.join(METHODS)}"
            )

    def make(self, generator: np.random.Generator) -> Discs:
        """One packing. The square is as large as the discs and the area fraction make it.

        Raises:
            RefusedError: The discs find no place, or the packing fails `check`.
        """
        radii = self.radii.sample(self.discs, generator)
        side = float(np.sqrt(np.pi * (radii**2).sum() / self.area_fraction))
        if 2 * radii.max() + self.gap > side:
            raise RefusedError(
                f"a disc of radius {radii.max():g} m with the gap {self.gap:g} m does not fit into"
                f" its periodic square of {side:g} m: ask for"
                f" {'a smaller gap' if 2 * radii.max() <= side else 'more discs'}"
            )
        packing = Discs(self._place(radii, side, generator), radii, np.array([side, side]))
        self.check(packing)
        return packing

    def _place(self, radii: Array, side: float, generator: np.random.Generator) -> Array:
        grown = np.pi * ((radii + self.gap / 2) ** 2).sum() / side**2
        place: Callable[..., Array] = relaxed if self.method == "relaxed" else random_sequential
        if self.method == "auto" and grown > SEQUENTIAL_LIMIT:
            place = relaxed
        try:
            return place(radii, side, gap=self.gap, generator=generator)
        except RefusedError:
            if self.method != "auto" or place is relaxed:
                raise
            return relaxed(radii, side, gap=self.gap, generator=generator)

    def check(self, packing: Discs) -> None:
        """Compare number, area fraction, gaps and law of the radii with the specification.

        Raises:
            RefusedError: One of them differs; the message gives both numbers.
        """
        if len(packing) != self.discs:
            raise RefusedError(
                f"the packing has {len(packing)} discs where {self.discs} were asked for"
            )
        if abs(packing.area_fraction - self.area_fraction) > 1e-9:
            raise RefusedError(
                f"the packing has area fraction {packing.area_fraction:.6g} where"
                f" {self.area_fraction:g} was asked for"
            )
        gap, round_off = smallest_gap(packing), 1e-12 * float(packing.size.max())
        if gap < self.gap - round_off:
            raise RefusedError(
                f"the packing has a gap of {gap:.3g} m where {self.gap:g} m or more was asked for"
            )
        distance, probability = _law_test(packing.radii, self.radii)
        if probability < LEVEL:
            raise RefusedError(
                f"the radii differ from their law by {distance:.3g} in the distribution function;"
                f" for {self.discs} discs this happens with probability {probability:.1e}, less"
                f" than {LEVEL:g}: take another seed, or more discs"
            )


def packings(
    wish: Packing, number: int, *, seed: int, executor: Executor | None = None
) -> Iterator[Discs]:
    """`number` independent packings; the k-th depends on `seed` and k only."""
    return (executor.map if executor else map)(_one, [wish] * number, packing_seeds(seed, number))


def packing_seeds(seed: int, number: int) -> list[np.random.SeedSequence]:
    """Independent random streams; the k-th depends on `seed` and k only."""
    return np.random.SeedSequence(seed).spawn(number)


def _one(wish: Packing, seed: np.random.SeedSequence) -> Discs:
    return wish.make(np.random.default_rng(seed))


def _law_test(radii: Array, law: RadiusLaw) -> tuple[float, float]:
    """Kolmogorov–Smirnov distance and the probability of a greater one.

    Between neighbouring radii the difference of the distribution functions is greatest at one end:
    both are compared at each radius and just below it, so that a radius of positive probability is
    no misfit (Conover, 1972).
    """
    from scipy.stats import kstwo

    if law.smallest == law.largest:
        same = bool((np.abs(radii - law.smallest) <= 1e-12 * law.smallest).all())
        return float(not same), float(same)
    values, count = np.unique(radii, return_counts=True)
    at = np.cumsum(count) / len(radii)
    below = np.concatenate([[0.0], at[:-1]])
    above_step = np.abs(law.cdf(values) - at).max()
    below_step = np.abs(law.cdf(np.nextafter(values, 0)) - below).max()
    distance = float(max(above_step, below_step))
    return distance, float(kstwo.sf(distance, len(radii)))
