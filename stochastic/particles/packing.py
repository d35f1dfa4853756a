"""Periodic packings of discs or spheres without overlap.

Loose packings are made by random sequential addition. For dense ones overlapping particles repel
each other: the energy ½ Σ overlap² is minimised by the fast inertial relaxation engine (Bitzek et
al. 2006), with radii a little larger than the particles', so that none touch in the end. Then the
particles move at random in small steps that cause no overlap, so that their arrangement does not
depend on the relaxation.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from alphacut.base.arrays import Array, Ints, Mask
from alphacut.base.errors import FailedError, checked_number, require
from alphacut.stochastic.particles.particles import (
    Particles,
    close_pairs,
    nearest_image,
    points_in_balls,
    size_classes,
)
from alphacut.stochastic.particles.radius_distributions import RadiusDistribution
from alphacut.stochastic.particles.shapes import DISCS, Shape

MAX_PROPOSALS = 1000  # for a particle, before random sequential addition ends without a packing
MAX_NUMBER = 100_000  # particles to which their number is raised where the largest needs more room
HEADROOM = 0.3  # growth of the fraction while particles repel, over that up to the densest packing
MAX_STEPS = 4000  # of the relaxation
MOVES, MOVES_PER_SEARCH = 60, 5  # random moves of a particle, and between searches of neighbours


@dataclass(frozen=True)
class Packing:
    """Specification of a random packing.

    Args:
        number: Number of particles; more are drawn until the box holds the largest.
        fraction: Share of the square or cube that they take, above 0 and below `Shape.densest`.
        radii: Law of the radii, by number.
        shape: Discs or spheres.
    """

    number: int
    fraction: float
    radii: RadiusDistribution
    shape: Shape = DISCS

    def __post_init__(self) -> None:
        key = f"packing.{self.shape.cells}_fraction"
        checked_number(key, self.fraction, positive=True, most=self.shape.densest)

    def make(self, generator: np.random.Generator) -> Particles:
        """Return a random packing in a square or cube that it fills to `fraction`, if it can."""
        radii, side = self._radii(generator)
        box, is_loose = np.full(self.shape.dimensions, side), self.fraction <= self.shape.sequential
        centres = random_sequential(radii, box, generator) if is_loose else None
        if centres is None:
            centres = relax_random_centres(radii, box, generator)
        return Particles(centres, radii, box)

    def _radii(self, generator: np.random.Generator) -> tuple[Array, float]:
        """Draw radii until their box has room for the largest: radii (n,) and side, in m."""
        # on average this keeps the frequencies of the law (Wald's identity), as drawing all anew
        # does not
        radii: Array = np.empty(0)
        side = -np.inf
        # a diameter of a disc, and two of a sphere, so that its cell is apart from its own images
        radii_in_side = 2.0 * (self.shape.dimensions - 1)
        while not len(radii) or radii_in_side * radii.max() > side:
            largest, key = radii.max(initial=0.0), f"packing.{self.shape.particles}"
            allowed = f"more than {MAX_NUMBER}, where the largest radius is {largest:.3g} m"
            cure = "leave out the smallest sizes, or lower the fraction"
            is_within_limit = len(radii) < max(MAX_NUMBER, self.number)
            require(is_within_limit, key, value=self.number, allowed=allowed, cure=cure)
            radii = np.append(radii, self.radii.sample(self.number, generator))
            measure = float(self.shape.measure(radii).sum()) / self.fraction
            side = float(np.sqrt(measure) if self.shape == DISCS else np.cbrt(measure))
        return radii, side


def random_sequential(radii: Array, box: Array, generator: np.random.Generator) -> Array | None:
    """Centres (n, d) of particles without overlap, by random sequential addition; None if it fails.

    Particles are added from the largest down, in blocks, to a periodic box with sides (d,); each
    one that overlaps is proposed again at a new centre, at most `MAX_PROPOSALS` times.
    """
    order = np.argsort(-radii, kind="stable")
    sorted_radii = radii[order]
    placed: Array = np.zeros((0, len(box)))
    while len(placed) < len(order):
        block = slice(len(placed), min(len(order), max(64, int(1.5 * len(placed)))))
        obstacles = _Obstacles(placed, sorted_radii[: len(placed)], box)
        added = _add_block(obstacles, sorted_radii[block], generator)
        if added is None:
            return None
        placed = np.concatenate([placed, added])
    centres = np.empty_like(placed)
    centres[order] = placed
    return centres


class _Obstacles:
    """Particles with centres (n, d) and radii (n,) in a periodic box, for tests of overlap."""

    def __init__(self, centres: Array, radii: Array, box: Array) -> None:
        classes = list(size_classes(radii)) if len(radii) else []
        self.box = box
        self.size_classes = [
            (KDTree(centres[k] % box, boxsize=box), centres[k], radii[k]) for k in classes
        ]

    def overlapped_by(self, proposal: Array, radii: Array) -> Mask:
        """Mask of the proposed particles, centres (n, d), radii (n,), that overlap a placed one."""
        overlaps = np.zeros(len(proposal), bool)
        for tree, centres, placed_radii in self.size_classes:
            candidates = np.flatnonzero(~overlaps)
            reach = radii[candidates] + placed_radii.max()
            counts, placed = points_in_balls(tree, proposal[candidates], reach)
            proposed = np.repeat(candidates, counts)
            offset = nearest_image(proposal[proposed] - centres[placed], self.box)
            distance = np.linalg.norm(offset, axis=1)
            overlaps[proposed[distance < radii[proposed] + placed_radii[placed]]] = True
        return overlaps


def _add_block(obstacles: _Obstacles, radii: Array, generator: np.random.Generator) -> Array | None:
    """Centres (n, d) of further particles without overlap; None if `MAX_PROPOSALS` fail for one."""
    box = obstacles.box
    centres = np.full((len(radii), len(box)), np.nan)
    new_obstacles = _Obstacles(centres[:0], radii[:0], box)
    for _ in range(MAX_PROPOSALS):
        pending = np.flatnonzero(np.isnan(centres[:, 0]))
        if not len(pending):
            return centres
        proposal = box * generator.random((len(pending), len(box)))
        is_free = ~obstacles.overlapped_by(proposal, radii[pending])
        is_free[is_free] = ~new_obstacles.overlapped_by(proposal[is_free], radii[pending[is_free]])
        free = np.flatnonzero(is_free)
        accepted = free[_accepted_in_order(proposal[free], radii[pending[free]], box)]
        centres[pending[accepted]] = proposal[accepted]
        is_placed = ~np.isnan(centres[:, 0])
        new_obstacles = _Obstacles(centres[is_placed], radii[is_placed], box)
    return None


def _accepted_in_order(proposal: Array, radii: Array, box: Array) -> Mask:
    """Mask of the proposals that overlap no earlier accepted one, shape (n,)."""
    OPEN, ACCEPTED, REJECTED = 0, 1, -1
    state = np.full(len(proposal), OPEN)
    if len(proposal) < 2:
        return np.asarray(state == OPEN)
    earlier, later = np.sort(close_pairs(Particles(proposal, radii, box), 0.0), axis=0)
    while (state == OPEN).any():
        is_waiting = np.zeros(len(state), bool)  # for an earlier one that it overlaps
        is_waiting[later[state[earlier] == OPEN]] = True
        state[(state == OPEN) & ~is_waiting] = ACCEPTED
        state[later[state[earlier] == ACCEPTED]] = REJECTED
    return np.asarray(state == ACCEPTED)


def relax_random_centres(radii: Array, box: Array, generator: np.random.Generator) -> Array:
    """Centres (n, d), in m, of particles in a periodic box, by relaxation of random ones.

    They are pushed apart (`_push`) and then moved at random (`_shake`). The arguments are as of
    `random_sequential`.

    Raises:
        FailedError: The particles still overlap after all steps.
    """
    start = box * generator.random((len(radii), len(box)))
    particles = Particles(start, radii, box)
    fraction = particles.fraction
    grown_fraction = fraction + HEADROOM * (particles.shape.densest - fraction)
    growth = max(1 + 1e-4, float((grown_fraction / fraction) ** (1 / len(box))))
    return _shake(_push(particles, growth), generator)


def _push(particles: Particles, growth: float) -> Particles:
    """Move particles apart until none overlap, by fast inertial relaxation (Bitzek et al. 2006)."""
    centres, box, radii = particles.centres, particles.size, particles.radii * growth
    velocity, step, mixing, n_downhill = np.zeros_like(centres), 0.1, 0.1, 0
    # pairs within the skin are searched anew when a particle has moved half of it
    skin, overlap = 0.6 * float(particles.radii.mean()), 0.0
    pairs, searched_at = None, centres
    for _ in range(MAX_STEPS):
        path = float(np.linalg.norm(nearest_image(centres - searched_at, box), axis=1).max())
        if pairs is None or 2 * path > skin:
            pairs, searched_at = close_pairs(Particles(centres, radii, box), skin), centres
        force, overlap = _repulsion(centres, radii, pairs, box)
        if overlap < (growth - 1) * 2 * float(particles.radii.min()):
            return Particles(centres, particles.radii, box)
        if float((force * velocity).sum()) > 0:
            n_downhill += 1
            speed_per_force = np.sqrt((velocity**2).sum() / max((force**2).sum(), 1e-300))
            velocity = (1 - mixing) * velocity + mixing * speed_per_force * force
            if n_downhill > 5:
                step, mixing = min(1.1 * step, 0.6), 0.99 * mixing
        else:
            velocity, mixing, n_downhill = np.zeros_like(velocity), 0.1, 0
            step = max(0.5 * step, 0.02)
        velocity = velocity + step * force
        centres = centres + step * velocity
    kind = f"{particles.shape.particles} on a share {particles.fraction:.3f} of the box"
    what = f"{kind} still overlap by {overlap:.3g} m after {MAX_STEPS} steps"
    raise FailedError(what, "lower the fraction")


def _repulsion(
    centres: Array, radii: Array, pairs: tuple[Ints, Ints], box: Array
) -> tuple[Array, float]:
    """Force on each particle, (n, d), equal to its overlaps, and the greatest overlap, in m."""
    first, second = pairs
    offset = nearest_image(centres[second] - centres[first], box)
    distance = np.maximum(np.linalg.norm(offset, axis=1), 1e-300)
    overlap = np.maximum(radii[first] + radii[second] - distance, 0)
    pair_force = (overlap / distance)[:, None] * offset  # on the second of each pair
    count = len(centres)
    force = [np.bincount(second, x, count) - np.bincount(first, x, count) for x in pair_force.T]
    return np.stack(force, axis=1), float(overlap.max(initial=0.0))


def _shake(particles: Particles, generator: np.random.Generator) -> Array:
    """Centres (n, d), in m, after `MOVES` random moves of each particle without overlap."""
    # a move is made if it keeps clear of both old and new positions of the neighbours
    box, dimensions, radii = particles.size, len(particles.size), particles.radii
    # longest move: a quarter of the mean gap between particles
    reach = 0.25 * particles.spacing * (1 - particles.fraction ** (1 / dimensions))
    centres = particles.centres
    for _ in range(0, MOVES, MOVES_PER_SEARCH):
        first, second = close_pairs(Particles(centres, radii, box), 4 * MOVES_PER_SEARCH * reach)
        contact = radii[first] + radii[second]  # distance of centres that touch
        for _ in range(MOVES_PER_SEARCH):
            direction = generator.standard_normal(centres.shape)
            direction /= np.linalg.norm(direction, axis=1)[:, None]
            length = reach * generator.random(len(radii)) ** (1 / dimensions)
            proposal = centres + length[:, None] * direction
            is_rejected = np.zeros(len(radii), bool)
            for mover, neighbour in ((first, second), (second, first)):
                for positions in (centres, proposal):
                    offset = nearest_image(positions[neighbour] - proposal[mover], box)
                    is_rejected[mover[np.linalg.norm(offset, axis=1) < contact]] = True
            centres = np.where(is_rejected[:, None], centres, proposal)
    return centres
