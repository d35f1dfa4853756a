"""Periodic packings of spheres without overlap, up to a volume fraction of 0.5.

Up to `SEQUENTIAL_LIMIT` random sequential addition, the largest first; beyond it a random start
whose overlaps are pushed apart. Either is measured before it is handed out.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from alphacut.stochastic.errors import RefusedError
from alphacut.stochastic.particles.radius_laws import RadiusLaw
from alphacut.stochastic.spheres.spheres import Spheres, close_pairs
from alphacut.stochastic.spheres.wicksell import RadiiPBox, possible_laws
from alphacut.stochastic.theta.truncated_normal import Array

SEQUENTIAL_LIMIT = 0.25
MOST_VOLUME = 0.5
FEWEST = 5  # packings
MOST_SPHERES = 20_000  # in a packing of a law that is only possible
_ROOM = 30  # twice the mean number of spheres of one size in a cube four radii wide, over fraction
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

    def make(self, generator: np.random.Generator) -> Spheres:
        """One packing; the cube is as large as the spheres and the fraction make it.

        Raises:
            RefusedError: A sphere finds no place, or overlaps remain.
        """
        radii = np.sort(self.radii.sample(self.spheres, generator))[::-1]
        side = float(np.cbrt(4 / 3 * np.pi * (radii**3).sum() / self.volume_fraction))
        if 4 * radii[0] > side:
            raise RefusedError(
                f"a sphere of radius {radii[0]:g} m is too large for its periodic cube of"
                f" {side:g} m: ask for more spheres"
            )
        place = _added if self.volume_fraction <= SEQUENTIAL_LIMIT else _pushed
        packing = Spheres(place(radii, side, generator), radii, side)
        if packing.smallest_gap() < 0:
            raise RefusedError(
                f"spheres overlap after {_ROUNDS} rounds at the volume fraction"
                f" {self.volume_fraction:g}: ask for less"
            )
        return packing


@dataclass(frozen=True)
class SpherePackings:
    """Independent packings of spheres of one law of radii, or of several that are possible.

    Args:
        packing: What each one is to be.
        packings: How many, at least 5 (the bootstrap draws them as wholes).
        section: Bounds of the law that the circles of a section leave; None where the law is given.

    Raises:
        ValueError: Fewer than five packings.
    """

    packing: SpherePacking
    packings: int = 20
    section: RadiiPBox | None = None

    def __post_init__(self) -> None:
        if self.packings < FEWEST:
            raise ValueError(
                f"{self.packings} packings were asked for; the bootstrap draws whole packings and"
                " needs 5 or more"
            )

    def possible(self) -> dict[str, SpherePacking]:
        """Packings of the laws at the ends of the section's bounds, by name; none without.

        Their number of spheres is raised to what a cube that holds the largest needs.
        """
        if self.section is None:
            return {}
        found = {}
        for name, law in possible_laws(self.section).items():
            least = _ROOM * self.packing.volume_fraction * law.largest**3 / law.mean_cube
            count = int(min(max(self.packing.spheres, least), MOST_SPHERES))
            found[name] = replace(self.packing, radii=law, spheres=count)
        return found


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
            raise RefusedError(
                f"no place for a sphere of radius {radius:g} m after {_ATTEMPTS} attempts: ask for"
                " a smaller volume fraction"
            )
    return centres


def _pushed(radii: Array, side: float, generator: np.random.Generator) -> Array:
    """Centres from a random start by pushing overlapping pairs apart, shape (n, 3)."""
    centres = generator.uniform(0, side, (len(radii), 3))
    enlarged = radii * (1 + _MARGIN)
    for _ in range(_ROUNDS):
        first, second, apart = close_pairs(centres, radii, side, reach=2 * _MARGIN * radii[0])
        overlap = enlarged[first] + enlarged[second] - apart
        touching = overlap > 0
        if not (overlap > _MARGIN * (radii[first] + radii[second])).any():
            return np.mod(centres, side)
        first, second, overlap = first[touching], second[touching], overlap[touching]
        way = centres[first] - centres[second]
        way -= side * np.round(way / side)
        way *= (overlap / np.maximum(apart[touching], 1e-300))[:, None]
        share = (radii[second] ** 3 / (radii[first] ** 3 + radii[second] ** 3))[:, None]
        np.add.at(centres, first, way * share)
        np.add.at(centres, second, way * (share - 1))
    return np.mod(centres, side)
