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


@dataclass(frozen=True)
class Packing:
    """Specification of a random packing.

    Args:
        number: Number of particles; more are drawn until the box holds the largest.
        fraction: Fraction of the square or cube that they take, above 0 and below `Shape.densest`.
        radii: Distribution of the radii, by number.
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
        """Return a random packing in a periodic square or cube that it fills to `fraction`.

        Loose packings are made by random sequential addition, and others, or those for which it
        fails, by pushing overlapping particles apart.

        Args:
            generator: Source of radii and places; its state moves on.

        Returns:
            `number` particles without overlap, or a multiple of it where the box would not hold the
            largest one. The side of the box follows from the radii.

        Raises:
            RefusedError: The box of too many particles has no room for the largest one.
            FailedError: The particles still overlap after all steps.
        """
        radii, side = self._radii(generator)
        box = np.full(self.shape.dimensions, side)
        centres = None
        if self.fraction <= self.shape.sequential:
            centres = random_sequential(radii, box, generator)
        if centres is None:
            centres = relax_random_centres(radii, box, generator)
        return Particles(centres, radii, box)

    def _radii(self, generator: np.random.Generator) -> tuple[Array, float]:
        """Draw radii until their box has room for the largest particle.

        Further radii are added to the ones that have been drawn, `number` at a time. On average
        this keeps the frequencies of the distribution (Wald's identity), as drawing all radii anew
        does not.

        Args:
            generator: Source of the radii; its state moves on.

        Returns:
            Radii in m, shape (n,), with n a multiple of `number`, and the side of the square or
            cube that they fill to `fraction`, in m.

        Raises:
            RefusedError: There is no room with 100,000 particles, or with `number` if that is more.
        """
        radii: Array = np.empty(0)
        side = -np.inf
        # The side must hold a diameter of a disc, and two diameters of a sphere, so that the cell
        # of a sphere does not touch the cells of its own images.
        radii_in_side = 2.0 * (self.shape.dimensions - 1)
        max_number = 100_000
        while not len(radii) or radii_in_side * radii.max() > side:
            largest = radii.max(initial=0.0)
            require(
                len(radii) < max(max_number, self.number),
                f"packing.{self.shape.particles}",
                value=self.number,
                allowed=f"more than {max_number}, where the largest radius is {largest:.3g} m",
                cure="leave out the smallest sizes, or lower the fraction",
            )
            radii = np.append(radii, self.radii.sample(self.number, generator))
            measure = float(self.shape.measure(radii).sum()) / self.fraction
            root = np.sqrt if self.shape == DISCS else np.cbrt
            side = float(root(measure))
        return radii, side


def random_sequential(radii: Array, box: Array, generator: np.random.Generator) -> Array | None:
    """Place particles in a periodic box by random sequential addition.

    Particles are added from the largest down, in blocks. Each one that overlaps is proposed again
    at a new random centre.

    Args:
        radii: Radii in m, in any order, shape (n,), n at least 1, each up to half of a side: that a
            particle overlaps its own images is not noticed.
        box: Sides of the box in m, shape (d,).
        generator: Source of the centres; its state moves on.

    Returns:
        Centres in m in the order of `radii`, shape (n, d), of particles without overlap; None if
        one of them was proposed 1,000 times in vain.
    """
    # Small particles still find gaps when the large ones are placed; the reverse would fail early.
    order = np.argsort(-radii, kind="stable")
    sorted_radii = radii[order]
    placed: Array = np.zeros((0, len(box)))
    while len(placed) < len(order):
        # Blocks of one and a half times the placed number keep the count of blocks logarithmic.
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
    """Particles in a periodic box, for tests of overlap.

    They are searched by classes of similar size: in one tree of all sizes the largest particle
    would decide how far to look for the smallest ones.

    Args:
        centres: Centres in m, shape (n, d).
        radii: Radii in m, shape (n,).
        box: Sides of the box in m, shape (d,).
    """

    def __init__(self, centres: Array, radii: Array, box: Array) -> None:
        from scipy.spatial import KDTree  # takes time to import

        classes = list(size_classes(radii)) if len(radii) else []
        self.box = box
        self.size_classes = [
            (KDTree(centres[k] % box, boxsize=box), centres[k], radii[k]) for k in classes
        ]

    def overlapped_by(self, proposal: Array, radii: Array) -> Mask:
        """Return which of some proposed particles overlap an obstacle, shape (n,).

        Particles that just touch do not overlap.

        Args:
            proposal: Centres in the box, in m, shape (n, d).
            radii: Radii in m, shape (n,).
        """
        overlaps = np.zeros(len(proposal), bool)
        # Obstacles of one class, with radii within a factor of two, have a periodic tree of their
        # own.
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
    """Place a block of particles beside obstacles and without overlap among each other.

    Args:
        obstacles: Particles that are placed already, perhaps none, with the box.
        radii: Radii of the block in m, shape (n,).
        generator: Source of the centres; its state moves on.

    Returns:
        Centres in m in the order of `radii`, shape (n, d); None if a particle was proposed 1,000
        times in vain.
    """
    box = obstacles.box
    centres = np.full((len(radii), len(box)), np.nan)  # of pending particles
    new_obstacles = _Obstacles(centres[:0], radii[:0], box)
    for _ in range(1000):
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
    """Return which proposed particles overlap no earlier accepted one, shape (n,).

    This is what a loop over the proposals would accept, for all proposals at once: a round accepts
    each open proposal that overlaps no earlier open one, and then rejects the later ones that
    overlap it. Each round settles at least the first open proposal.

    Args:
        proposal: Centres in m, shape (n, d), the earliest first.
        radii: Radii in m, shape (n,).
        box: Sides of the periodic box in m, shape (d,).
    """
    is_accepted = np.zeros(len(proposal), bool)
    if len(proposal) < 2:
        return ~is_accepted
    earlier, later = np.sort(close_pairs(Particles(proposal, radii, box), 0.0), axis=0)
    is_open = np.ones(len(proposal), bool)
    while is_open.any():
        is_waiting = np.zeros(len(proposal), bool)
        is_waiting[later[is_open[earlier]]] = True
        is_accepted |= is_open & ~is_waiting
        is_open &= is_waiting
        is_open[later[is_accepted[earlier]]] = False
    return is_accepted


def relax_random_centres(radii: Array, box: Array, generator: np.random.Generator) -> Array:
    """Place particles in a periodic box at random, push them apart, and move them at random.

    Args:
        radii: Radii in m, shape (n,), n at least 1.
        box: Sides of the box in m, shape (d,): 2 for discs, 3 for spheres.
        generator: Source of the centres and of the moves; its state moves on.

    Returns:
        Centres in m in the order of `radii`, shape (n, d), of particles without overlap. Some may
        lie outside the box: they are to be taken back by its sides.

    Raises:
        FailedError: The particles still overlap after all steps.
    """
    start = box * generator.random((len(radii), len(box)))
    particles = Particles(start, radii, box)
    fraction = particles.fraction
    # While they repel, the particles are larger, so that none touch in the end: their fraction is
    # three tenths nearer to the densest packing. With more headroom the relaxation takes longer.
    grown_fraction = fraction + 0.3 * (particles.shape.densest - fraction)
    # The radii grow by the root of the fraction, and by 1e-4 at least, so that a gap is left.
    growth = max(1 + 1e-4, float((grown_fraction / fraction) ** (1 / len(box))))
    return _shake(_push(particles, growth), generator)


def _push(particles: Particles, growth: float) -> Particles:
    """Move particles apart until none overlap, by fast inertial relaxation (Bitzek et al. 2006).

    The energy is half the sum of the squared overlaps. The constants of the method are those of its
    authors, but for the time steps.

    Args:
        particles: Particles in a periodic box, at least one, which may overlap.
        growth: Factor of the radii, above 1, with which they repel each other. At the end they may
            still overlap with the grown radii, but not with their own.

    Returns:
        New particles with the same radii at new places.

    Raises:
        FailedError: The particles still overlap after 4,000 steps.
    """
    max_steps = 4000
    box = particles.size
    radii = particles.radii * growth
    centres = particles.centres
    # Two particles do not touch with their own radii if their grown radii overlap by less than the
    # growth of both, (growth − 1) (r_i + r_j). This is the smallest such growth.
    allowed_overlap = (growth - 1) * 2 * float(particles.radii.min())
    velocity = np.zeros_like(centres)
    time_step = 0.1
    mixing = 0.1
    n_downhill = 0
    # Pairs closer than the skin are searched anew when a particle has moved half of it.
    skin = 0.6 * float(particles.radii.mean())
    pairs = None
    searched_at = centres
    overlap = 0.0
    for _ in range(max_steps):
        path = float(np.linalg.norm(nearest_image(centres - searched_at, box), axis=1).max())
        if pairs is None or 2 * path > skin:
            pairs = close_pairs(Particles(centres, radii, box), skin)
            searched_at = centres
        force, overlap = _repulsion(centres, radii, pairs=pairs, box=box)
        if overlap < allowed_overlap:
            return Particles(centres, particles.radii, box)
        if float((force * velocity).sum()) > 0:
            # Downhill the velocity is turned towards the force, and later the steps grow.
            n_downhill += 1
            speed_per_force = np.sqrt((velocity**2).sum() / max((force**2).sum(), 1e-300))
            velocity = (1 - mixing) * velocity + mixing * speed_per_force * force
            if n_downhill > 5:
                time_step = min(1.1 * time_step, 0.6)
                mixing = 0.99 * mixing
        else:
            velocity = np.zeros_like(velocity)
            mixing = 0.1
            n_downhill = 0
            time_step = max(0.5 * time_step, 0.02)
        velocity = velocity + time_step * force
        centres = centres + time_step * velocity
    kind = f"{particles.shape.particles} on a share {particles.fraction:.3f} of the box"
    what = f"{kind} still overlap by {overlap:.3g} m after {max_steps} steps"
    raise FailedError(what, "lower the fraction")


def _repulsion(
    centres: Array, radii: Array, *, pairs: tuple[Ints, Ints], box: Array
) -> tuple[Array, float]:
    """Return the force on each particle, which is the sum of its overlaps as vectors.

    Args:
        centres: Centres in m, shape (n, d).
        radii: Radii in m, shape (n,).
        pairs: First and second particle of each pair that may overlap, shape (m,) each.
        box: Sides of the periodic box in m, shape (d,).

    Returns:
        Forces in m, shape (n, d), and the largest overlap of a pair, in m, 0 if none overlaps. Two
        particles at one place do not repel each other.
    """
    first, second = pairs
    offset = nearest_image(centres[second] - centres[first], box)
    distance = np.maximum(np.linalg.norm(offset, axis=1), 1e-300)
    overlap = np.maximum(radii[first] + radii[second] - distance, 0)
    pair_force = (overlap / distance)[:, None] * offset  # on the second of each pair
    count = len(centres)
    force = np.empty_like(centres)
    for axis, component in enumerate(pair_force.T):
        on_second = np.bincount(second, component, count)
        force[:, axis] = on_second - np.bincount(first, component, count)
    return force, float(overlap.max(initial=0.0))


def _shake(particles: Particles, generator: np.random.Generator) -> Array:
    """Move each particle at random, 12 × 5 times, and return the new centres.

    All particles move at once. A move is made only if it overlaps neither the old nor the new
    position of a neighbour, since that may move or not. Neighbours are searched before each five
    moves.

    Args:
        particles: Particles without overlap in a periodic box.
        generator: Source of the moves; its state moves on.

    Returns:
        New centres in m, shape (n, d), of particles without overlap, some of them outside the box:
        they are to be taken back by its sides.
    """
    n_searches = 12
    moves_per_search = 5
    box = particles.size
    radii = particles.radii
    dimensions = len(box)
    # The longest move is a quarter of the mean gap between particles.
    reach = 0.25 * particles.spacing * (1 - particles.fraction ** (1 / dimensions))
    centres = particles.centres
    for _ in range(n_searches):
        # In each move a pair comes closer by twice the reach at most; twice that distance is
        # searched.
        gap = 4 * moves_per_search * reach
        first, second = close_pairs(Particles(centres, radii, box), gap)
        contact = radii[first] + radii[second]  # distance of centres that touch
        for _ in range(moves_per_search):
            # A normal vector over its length is uniform on the circle or sphere, and the root of a
            # uniform number makes the end of the move uniform in the disc or ball.
            direction = generator.standard_normal(centres.shape)
            direction /= np.linalg.norm(direction, axis=1)[:, None]
            length = reach * generator.random(len(radii)) ** (1 / dimensions)
            proposal = centres + length[:, None] * direction
            is_rejected = np.zeros(len(radii), bool)
            # Each pair is seen from either side.
            for mover, neighbour in ((first, second), (second, first)):
                for positions in (centres, proposal):
                    offset = nearest_image(positions[neighbour] - proposal[mover], box)
                    is_rejected[mover[np.linalg.norm(offset, axis=1) < contact]] = True
            centres = np.where(is_rejected[:, None], centres, proposal)
    return centres
