"""Sizes from a sieve curve: the share of the volume that passes each size.

Of particles of one length, as the discs of a plane are, the volume goes with r², of spheres with
r³: a size's share of their number is its share of the volume over that. Between two sizes the
volume is spread evenly over ln r, as grading curves are drawn and read.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from alphacut.stochastic.particles.csv_columns import length_columns, share_column
from alphacut.stochastic.particles.radius_laws import MeasuredRadii, RadiusLaw, refuse_slip
from alphacut.stochastic.theta.truncated_normal import Array

PASSING, RETAINED = "passing", "retained"
SIEVES = (
    *(0.063, 0.075, 0.125, 0.15, 0.18, 0.212, 0.25, 0.3, 0.355, 0.425, 0.5, 0.6, 0.71, 0.85, 1.0),
    *(1.18, 1.4, 1.7, 2.0, 2.36, 2.8, 3.35, 4.0, 4.75, 5.6, 6.3, 6.7, 8.0, 9.5, 10.0, 11.2, 12.5),
    *(13.2, 14.0, 16.0, 19.0, 20.0, 22.4, 25.0, 26.5, 31.5, 37.5, 40.0, 45.0, 50.0, 53.0, 63.0),
    *(75.0, 80.0, 90.0, 100.0, 106.0, 125.0),
)
"""Openings of standard sieves, in mm: ISO 3310, EN 933-2, ASTM E11."""
FEWEST = 4  # sizes that make a list one of sieves


@dataclass(frozen=True)
class SieveRadii:
    """Radii by number of particles whose share of the volume is known up to some sizes.

    Args:
        radii: Half the openings, in m, rising, two or more.
        passing: Share of the volume in smaller particles, from 0 to 1, rising, shape of `radii`.
        power: Power of the radius that the volume goes with: 2 of discs, 3 of spheres.
        source: What to call it.

    Raises:
        ValueError: The sizes do not rise, or the shares do not rise from 0 to 1.
    """

    radii: tuple[float, ...]
    passing: tuple[float, ...]
    power: int = 2
    source: str = "a sieve curve"

    def __post_init__(self) -> None:
        sizes, shares = np.array(self.radii), np.array(self.passing)
        if not (len(sizes) > 1 and sizes[0] > 0 and (np.diff(sizes) > 0).all()):
            raise ValueError("the sizes of a sieve curve must be two or more, positive, all unlike")
        if not (np.diff(shares) >= 0).all():
            at = int(np.argmax(np.diff(shares) < 0))
            raise ValueError(
                f"{shares[at + 1]:.4g} of the volume passes {2 * sizes[at + 1]:.4g} m and"
                f" {shares[at]:.4g} the smaller {2 * sizes[at]:.4g} m; a share that passes cannot"
                " fall as the size rises"
            )
        if not (shares[0] == 0 and abs(shares[-1] - 1) < 1e-9):
            raise ValueError(
                f"the share that passes goes from {shares[0]:.4g} to {shares[-1]:.4g}; it must go"
                " from 0, at the size below which grains count as matrix, to 1 (100 %)"
            )

    @property
    def smallest(self) -> float:
        """Least radius, in m."""
        return float(self._ends[0][0])

    @property
    def largest(self) -> float:
        """Greatest radius, in m."""
        return float(self._ends[1][-1])

    @property
    def label(self) -> str:
        """The law in words."""
        return f"sieve curve of {self.source}"

    @cached_property
    def _ends(self) -> tuple[Array, Array, Array, Array]:
        """Classes that hold something: lower and upper radius, number up to each end (0 … 1)."""
        radii, volume = np.array(self.radii), np.diff(self.passing)
        held = volume > 0
        low, high = radii[:-1][held], radii[1:][held]
        inverse = self._inverse(low) - self._inverse(high)
        per_volume = inverse / (self.power * np.log(high / low))  # mean of r^-power over ln r
        number = np.cumsum(volume[held] * per_volume)
        number /= number[-1]
        return low, high, np.concatenate([[0.0], number[:-1]]), number

    def _inverse(self, radius: Array) -> Array:
        return np.asarray(radius ** float(-self.power))

    def cdf(self, radius: ArrayLike) -> Array:
        """Share of the number of particles with r ≤ radius, any shape, `radius` in m."""
        low, high, below, above = self._ends
        radius = np.asarray(radius, float)
        place = np.clip(np.searchsorted(low, radius, side="right") - 1, 0, len(low) - 1)
        least, most = low[place], high[place]
        inside = np.clip(radius, least, most)
        first, last = self._inverse(least), self._inverse(most)
        part = (first - self._inverse(inside)) / (first - last)
        return np.asarray(below[place] + part * (above[place] - below[place]))

    def sample(self, number: int, generator: np.random.Generator) -> Array:
        """`number` independent radii, shape (number,), in m."""
        low, high, below, above = self._ends
        share = generator.random(number)
        place = np.minimum(np.searchsorted(above, share, side="right"), len(low) - 1)
        part = (share - below[place]) / (above[place] - below[place])
        first, last = self._inverse(low[place]), self._inverse(high[place])
        return np.asarray((first - part * (first - last)) ** (-1 / self.power))


def read_radii(path: Path, power: int = 2) -> RadiusLaw:
    """The law of the radii in a CSV file: a list of them, or a sieve curve.

    A list has a column r or d with its unit, a sieve curve a column ``passing [%]`` beside it. What
    each sieve retains, alone or with those above, may stand there too if it says the same.

    Args:
        path: The file.
        power: Power of the radius that the volume goes with: 2 of discs, 3 of spheres.

    Raises:
        ValueError: The file cannot be read, holds what makes no sense, or bare sizes of sieves.
    """
    passing = share_column(path, PASSING)
    if passing is None:
        law = MeasuredRadii.read(path)
        _refuse_sieves(path, law)
        return law
    retained = share_column(path, RETAINED)
    also = (PASSING,) if retained is None else (PASSING, RETAINED)
    sizes = length_columns(path, ("r",), also=also)
    radii, shares = sizes.values[:, 0], passing
    known = np.isfinite(radii) & np.isfinite(shares) & (radii > 0)
    if not known.all():
        row = int(sizes.rows[np.argmin(known)])
        raise ValueError(f"{path}: row {row} holds no positive size and share that passes it")
    refuse_slip(path, sizes)
    order = np.argsort(radii, kind="stable")
    if retained is not None:
        _refuse_contradiction(path, 2e3 * radii[order], shares[order], retained[order])
    try:
        return SieveRadii(tuple(radii[order]), tuple(shares[order]), power, path.name)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def _refuse_contradiction(path: Path, sizes: Array, passing: Array, retained: Array) -> None:
    """Refuse shares retained that do not follow from those that pass rising sizes in mm, (n,)."""
    digits = min(_digits(passing), _digits(retained))
    either = np.array([np.append(passing[1:], 1.0) - passing, 1.0 - passing])
    apart = np.where(np.isfinite(retained), np.abs(either - retained), 0.0)
    nearer = int(apart.max(1).argmin())
    row = int(apart[nearer].argmax())
    if apart[nearer, row] > 0.0151 / 10**digits:  # half a digit each of three that are rounded
        raise ValueError(
            f"{path}: column 'retained' has {retained[row]:.4%} at {sizes[row]:g} mm, where passing"
            f" leaves {either[nearer, row]:.4%}; correct one of the two, or remove the column"
        )


def _digits(shares: Array) -> int:
    """Digits behind the point that shares have as percentages."""
    known = shares[np.isfinite(shares)]
    return next((k for k in range(6) if np.allclose(known, known.round(k + 2))), 6)


def _refuse_sieves(path: Path, law: MeasuredRadii) -> None:
    """Refuse a list that is nothing but unlike openings of standard sieves."""
    sizes = 2e3 * np.array(law.values)
    sieves = np.array(SIEVES)
    nearest = np.abs(sieves - sizes[:, None]).min(1)
    if len(set(law.values)) < max(FEWEST, len(sizes)) or (nearest > 1e-3 * sizes).any():
        return
    raise ValueError(
        f"{path}: its {len(sizes)} sizes, {sizes[0]:g} to {sizes[-1]:g} mm, are openings of"
        " sieves, each once, and would count as diameters of equally many particles; add a column"
        " passing [%], the share of the volume that passes each, or list measured diameters as"
        " often as they occur"
    )
