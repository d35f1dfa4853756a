"""Periodic packings of non-overlapping discs: random sequential addition, and tested results."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np

from alphacut.stochastic.errors import RefusedError
from alphacut.stochastic.particles.discs import Discs
from alphacut.stochastic.particles.radius_laws import RadiusLaw
from alphacut.stochastic.particles.relaxation import relaxed, smallest_gap
from alphacut.stochastic.theta.truncated_normal import Array

ROUNDS = 1000  # proposals for one disc before the packing is given up


def random_sequential(
    radii: Array, side: float, *, gap: float, generator: np.random.Generator
) -> Array:
    """Centres of non-overlapping discs in a periodic square, shape (n, 2), in m.

    Discs are added from the largest down, in blocks; each one that fails is proposed again at a new
    place, uniform in the square.

    Args:
        radii: shape (n,), in m.
        side: Side of the square, in m.
        gap: Least distance between surfaces, in m.
        generator: Source of chance.

    Raises:
        RefusedError: A disc finds no place in `ROUNDS` proposals.
    """
    order = np.argsort(-radii, kind="stable")
    grown = radii[order] + gap / 2
    centres = np.zeros((0, 2))
    while len(centres) < len(order):
        block = slice(len(centres), min(len(order), max(64, int(1.5 * len(centres)))))
        standing = grown[: len(centres)]
        new = _add(centres, standing, grown[block], side=side, generator=generator)
        centres = np.concatenate([centres, new])
    placed = np.empty_like(centres)
    placed[order] = centres
    return placed


def _add(
    centres: Array, radii: Array, wanted: Array, *, side: float, generator: np.random.Generator
) -> Array:
    """Centres for the discs of radius `wanted` among those placed already."""
    new = np.full((len(wanted), 2), np.nan)
    standing = _Standing(centres, radii, side)
    fresh = _Standing(new[:0], wanted[:0], side)
    for _ in range(ROUNDS):
        pending = np.flatnonzero(np.isnan(new[:, 0]))
        if not len(pending):
            return new
        proposal = side * generator.random((len(pending), 2))
        free = ~standing.hit(proposal, wanted[pending])
        free[free] = ~fresh.hit(proposal[free], wanted[pending[free]])
        chosen = np.flatnonzero(free)
        chosen = chosen[_first_come(proposal[chosen], wanted[pending[chosen]], side)]
        new[pending[chosen]] = proposal[chosen]
        done = ~np.isnan(new[:, 0])
        fresh = _Standing(new[done], wanted[done], side)
    homeless = int(np.isnan(new[:, 0]).sum())
    covered = np.pi * ((radii**2).sum() + (wanted[~np.isnan(new[:, 0])] ** 2).sum()) / side**2
    raise RefusedError(
        f"random sequential addition found no place for {homeless} of {len(wanted)} discs in"
        f" {ROUNDS} proposals each, at area fraction {covered:.3f} (half the gap counted to each"
        " radius): lower the area fraction or take the relaxed method"
    )


class _Standing:
    """Discs in place, ready to be asked which proposals hit them."""

    def __init__(self, centres: Array, radii: Array, side: float) -> None:
        from scipy.spatial import cKDTree

        from alphacut.stochastic.particles.neighbour_search import size_classes

        classes = list(size_classes(radii)) if len(radii) else []
        self.side = side
        self.parts = [
            (cKDTree(centres[k] % side, boxsize=side), centres[k], radii[k]) for k in classes
        ]

    def hit(self, proposal: Array, radii: Array) -> Array:
        """Mask of proposed discs that overlap one in place, shape (n,)."""
        hit = np.zeros(len(proposal), bool)
        for tree, centres, standing in self.parts:
            ask = np.flatnonzero(~hit)
            reach = radii[ask] + standing.max()
            found = tree.query_ball_point(proposal[ask], reach, return_sorted=False)
            counts = np.fromiter(map(len, found), int, len(found))
            which = np.repeat(ask, counts)
            other = np.fromiter((k for one in found for k in one), int, counts.sum())
            apart = proposal[which] - centres[other]
            overlap = _overlap(apart, radii[which] + standing[other], self.side)
            hit[which[overlap]] = True
        return hit


def _first_come(proposal: Array, radii: Array, side: float) -> Array:
    """Mask of proposals that overlap no earlier proposal that stays."""
    from scipy.spatial import cKDTree

    state = np.zeros(len(proposal), int)  # 0 open, 1 stays, -1 goes
    if len(proposal) < 2:
        return np.asarray(state == 0)
    pair = cKDTree(proposal, boxsize=side).query_pairs(2 * radii.max(), output_type="ndarray")
    apart = proposal[pair[:, 0]] - proposal[pair[:, 1]]
    early, late = np.sort(pair[_overlap(apart, radii[pair].sum(axis=1), side)], axis=1).T
    while (state == 0).any():
        waits = np.zeros(len(state), bool)
        waits[late[state[early] == 0]] = True
        state[(state == 0) & ~waits] = 1
        state[late[state[early] == 1]] = -1
    return np.asarray(state == 1)


def _overlap(apart: Array, reach: Array, side: float) -> Array:
    apart = apart - side * np.round(apart / side)
    return np.asarray((apart**2).sum(axis=1) < reach**2)


# area fraction, half the gap counted to each radius, up to which sequential addition is quick
SEQUENTIAL_LIMIT = 0.45
LEVEL = 1e-4  # a packing of the right law is refused with this probability


@dataclass(frozen=True)
class Packing:
    """A wish for a packing.

    Args:
        discs: Number of discs, at least 1.
        area_fraction: Share of the square that they cover, in (0, 0.84): below random close
            packing.
        radii: Law of the radii.
        gap: Least distance between surfaces, in m, not negative.
        method: "sequential" (random sequential addition), "relaxed" (for dense packings), or "auto"
            (the first where it can).
    """

    discs: int
    area_fraction: float
    radii: RadiusLaw
    gap: float = 0.0
    method: str = "auto"

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
