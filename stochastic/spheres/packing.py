"""Periodic packings of spheres without overlap, up to a volume fraction of 0.5.

Up to `SEQUENTIAL_LIMIT` random sequential addition, the largest first; beyond it a random start
whose overlaps are pushed apart. Either is measured before it is handed out.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from alphacut.stochastic.errors import RefusedError, UnfitDataError
from alphacut.stochastic.particles.radius_laws import RadiusLaw, TabulatedRadii
from alphacut.stochastic.spheres.spheres import Spheres, close_pairs
from alphacut.stochastic.spheres.wicksell import RadiiPBox, possible_laws
from alphacut.stochastic.theta.truncated_normal import Array

SEQUENTIAL_LIMIT = 0.25
MOST_VOLUME = 0.5
FEWEST = 5  # packings
MOST_SPHERES = 20_000  # that their number is raised to: about a minute a packing
THIN = 0.01  # share of the volume in spheres too large for as many that is left out
_ATTEMPTS = 20_000  # places tried for one sphere
_ROUNDS = 4000
_MARGIN = 1e-3  # by which radii are enlarged while overlaps are pushed apart


@dataclass(frozen=True)
class SpherePacking:
    """Specification of a random packing of spheres.

    Args:
        spheres: Number of spheres, at least 1.
        volume_fraction: Share of the cube that they fill, in (0, 0.5].
        radii: Law of the radii, by number.

    Raises:
        ValueError: A value lies outside its range.
    """

    spheres: int
    volume_fraction: float
    radii: RadiusLaw

    def __post_init__(self) -> None:
        if not (isinstance(self.spheres, int | np.integer) and self.spheres >= 1):
            raise ValueError(f"a packing of {self.spheres} spheres: take a whole number from 1 on")
        if not 0 < (share := self.volume_fraction) <= MOST_VOLUME:
            raise ValueError(f"the volume fraction is {share:g}; it must lie in (0, 0.5]")

    def raised(self) -> SpherePacking:
        """With twice the spheres that on average fill the cube, four radii wide, of the largest.

        Where these are too many, the law ends at the largest that has such a cube.

        Raises:
            UnfitDataError: More than a thin share of the volume lies above.
        """
        radii, law = np.geomspace(self.radii.smallest, self.radii.largest, 20_001), self.radii
        share, cubes = law.cdf(radii), radii**3
        held = np.cumsum(cubes * np.diff(share, prepend=0.0))
        needed = 2 * (48 / np.pi * self.volume_fraction - 1) * cubes / held[-1]
        most, asked = max(self.spheres, MOST_SPHERES), math.ceil(needed[-1])
        end = int((needed <= most).sum()) - 1
        if (lost := 1 - held[end] / held[-1]) > THIN:
            cure = "ask for as many, " if asked <= 100_000 else ""
            raise UnfitDataError(
                f"{lost:.1%} of the volume is in those too large for cubes of {most}; the largest,"
                f" of radius {radii[-1]:.4g} m, need {asked}: {cure}leave out the smallest sizes,"
                " or lower the volume fraction"
            )
        if end < len(radii) - 1:
            told = f"{law.label} to {radii[end]:.4g} m, without {lost:.1g} of the volume above"
            grade = share[1 : end + 1] / share[end]
            law = TabulatedRadii(tuple(radii[: end + 1]), (0.0, *grade), told)
        return replace(self, spheres=max(self.spheres, math.ceil(needed[end])), radii=law)

    def make(self, generator: np.random.Generator, *, whole: bool = False) -> Spheres:
        """One packing; the cube is as large as the spheres and the fraction make it.

        Args:
            generator: Of the radii and places.
            whole: Draw on while the cube is too small for the largest drawn, which on average keeps
                the law's shares of the volume (Wald's identity), as drawing anew does not.

        Raises:
            RefusedError: A sphere finds no place, or overlaps remain.
        """
        radii: Array = np.empty(0)
        side = 0.0
        while not len(radii) or (whole and 4 * radii[0] > side):
            more = self.radii.sample(self.spheres, generator)
            radii = np.sort(np.append(radii, more))[::-1]
            side = float(np.cbrt(4 / 3 * np.pi * (radii**3).sum() / self.volume_fraction))
        if 4 * radii[0] > side:
            told = f"too large for its periodic cube of {side:g} m: ask for more spheres"
            raise RefusedError(f"a sphere of radius {radii[0]:g} m is {told}")
        place = _added if self.volume_fraction <= SEQUENTIAL_LIMIT else _pushed
        packing = Spheres(place(radii, side, generator), radii, side)
        if packing.smallest_gap() < 0:
            told = f"at the volume fraction {self.volume_fraction:g}: ask for less"
            raise RefusedError(f"spheres overlap after {_ROUNDS} rounds {told}")
        return packing


@dataclass(frozen=True)
class SpherePackings:
    """Independent packings of spheres of one law of radii, or of several that are possible.

    Args:
        packing: What each one is to be.
        packings: How many, at least 5 (the bootstrap draws them as wholes).
        section: Bounds of the law that the circles of a section leave; None where the law is given.
        laws: Packings of the law and of those at the ends of the bounds, `raised`, by name.

    Raises:
        ValueError: Fewer than five packings, or too many spheres are needed.
    """

    packing: SpherePacking
    packings: int = 20
    section: RadiiPBox | None = None
    laws: dict[str, SpherePacking] = field(init=False, compare=False)

    def __post_init__(self) -> None:
        if self.packings < FEWEST:
            told = f"{self.packings} packings were asked for"
            raise ValueError(f"{told}; the bootstrap draws whole packings and needs 5 or more")
        others = possible_laws(self.section) if self.section else {}
        laws = {"the law": self.packing.radii, **others}
        found = {name: replace(self.packing, radii=law).raised() for name, law in laws.items()}
        object.__setattr__(self, "laws", found)

    @property
    def remarks(self) -> Iterator[str]:
        """Where other spheres are packed than those asked for."""
        for name, law in self.laws.items():
            if name == "the law" and law.spheres > self.packing.spheres:
                told = f"of radius {law.radii.largest:.4g} m, needs them"
                yield f"{law.spheres} spheres or more are packed: a cube for the largest, {told}"
            if "of the volume above" in law.radii.label:
                yield f"packed is {law.radii.label}"


def _added(radii: Array, side: float, generator: np.random.Generator) -> Array:
    """Centres by random sequential addition, radii falling, shape (n, 3)."""
    centres = np.empty((len(radii), 3))
    for n, radius in enumerate(radii):
        for _ in range(_ATTEMPTS):
            spot = generator.uniform(0, side, 3)
            apart = np.abs(centres[:n] - spot)
            apart = np.minimum(apart, side - apart)
            if (np.einsum("ij,ij->i", apart, apart) > (radii[:n] + radius) ** 2).all():
                centres[n] = spot
                break
        else:
            told = f"no place for a sphere of radius {radius:g} m after {_ATTEMPTS} attempts"
            raise RefusedError(f"{told}: ask for a smaller volume fraction")
    return centres


def _pushed(radii: Array, side: float, generator: np.random.Generator) -> Array:
    """Centres from a random start by pushing overlapping pairs apart, shape (n, 3)."""
    centres = generator.uniform(0, side, (len(radii), 3))
    enlarged = radii * (1 + _MARGIN)
    for _ in range(_ROUNDS):
        first, second, way = close_pairs(centres, radii, side, reach=2 * _MARGIN * radii[0])
        apart = np.linalg.norm(way, axis=1)
        overlap = enlarged[first] + enlarged[second] - apart
        touching = overlap > 0
        if not (overlap > _MARGIN * (radii[first] + radii[second])).any():
            return np.mod(centres, side)
        first, second, overlap = first[touching], second[touching], overlap[touching]
        way = way[touching] * (overlap / np.maximum(apart[touching], 1e-300))[:, None]
        share = (radii[second] ** 3 / (radii[first] ** 3 + radii[second] ** 3))[:, None]
        np.add.at(centres, first, way * share)
        np.add.at(centres, second, way * (share - 1))
    return np.mod(centres, side)
