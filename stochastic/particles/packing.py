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

from alphacut.fuzzy.arrays import Array, Mask, Rows
from alphacut.fuzzy.refused import FailedError, checked_number, require
from alphacut.stochastic.particles.neighbour_search import balls, close_pairs, size_classes
from alphacut.stochastic.particles.particles import DISCS, Particles, Shape, nearest_image
from alphacut.stochastic.particles.radius_laws import RadiusLaw

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

    Raises:
        RefusedError: A value lies outside its range.
    """

    number: int
    fraction: float
    radii: RadiusLaw
    shape: Shape = DISCS

    def __post_init__(self) -> None:
        key = f"packing.{self.shape.cells}_fraction"
        checked_number(key, self.fraction, positive=True, most=self.shape.densest)

    def make(self, generator: np.random.Generator) -> Particles:
        """Return a random packing, in a square or cube that the particles fill to `fraction`.

        Raises:
            FailedError: The packing is too dense.
        """
        radii, side = self._radii(generator)
        box = np.full(self.shape.dimensions, side)
        return Particles(self._centres(radii, box, generator), radii, box)

    def _radii(self, generator: np.random.Generator) -> tuple[Array, float]:
        """Draw radii until their box has room for the largest; return them and its side, in m.

        On average this keeps the frequencies of the law (Wald's identity), as drawing all of them
        anew does not.
        """
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

    def _centres(self, radii: Array, box: Array, generator: np.random.Generator) -> Array:
        """Return centres (n, d), in m: of a loose packing placed one by one, else relaxed."""
        loose = self.fraction <= self.shape.sequential
        placed = random_sequential(radii, box, generator) if loose else None
        return relaxed(radii, box, generator) if placed is None else placed


def random_sequential(radii: Array, box: Array, generator: np.random.Generator) -> Array | None:
    """Return centres (n, d), in m, of particles without overlap, by random sequential addition.

    Particles are added from the largest down, in blocks; each one that overlaps is proposed again
    at a new place, uniform in the periodic box.

    Args:
        radii: shape (n,), in m.
        box: Sides of the box, shape (d,), in m.
        generator: Random number generator.

    Returns:
        The centres; None if `MAX_PROPOSALS` proposals for a particle all overlap.
    """
    order = np.argsort(-radii, kind="stable")
    falling = radii[order]
    centres: Array = np.zeros((0, len(box)))
    while len(centres) < len(order):
        block = slice(len(centres), min(len(order), max(64, int(1.5 * len(centres)))))
        placed_so_far = _Placed(centres, falling[: len(centres)], box)
        added = _added(placed_so_far, falling[block], generator)
        if added is None:
            return None
        centres = np.concatenate([centres, added])
    placed = np.empty_like(centres)
    placed[order] = centres
    return placed


class _Placed:
    """Particles that have their places, for tests whether proposed ones overlap them.

    Args:
        centres: shape (n, d), in m.
        radii: shape (n,), in m.
        box: Sides of the periodic box, shape (d,), in m.
    """

    def __init__(self, centres: Array, radii: Array, box: Array) -> None:
        classes = list(size_classes(radii)) if len(radii) else []
        self.box = box
        self.size_classes = [
            (KDTree(centres[k] % box, boxsize=box), centres[k], radii[k]) for k in classes
        ]

    def hit(self, proposal: Array, radii: Array) -> Mask:
        """Return which proposed particles overlap a placed one, a mask (n,).

        Args:
            proposal: Proposed centres, shape (n, d), in m.
            radii: Their radii, shape (n,), in m.
        """
        hit = np.zeros(len(proposal), bool)
        for tree, centres, placed_radii in self.size_classes:
            candidates = np.flatnonzero(~hit)
            reach = radii[candidates] + placed_radii.max()
            counts, placed = balls(tree, proposal[candidates], reach)
            proposed = np.repeat(candidates, counts)
            offset = nearest_image(proposal[proposed] - centres[placed], self.box)
            distance = np.linalg.norm(offset, axis=1)
            hit[proposed[distance < radii[proposed] + placed_radii[placed]]] = True
        return hit


def _added(placed_so_far: _Placed, radii: Array, generator: np.random.Generator) -> Array | None:
    """Return centres (n, d) of further particles that overlap neither placed ones nor each other.

    None if a particle found no place in `MAX_PROPOSALS` proposals.
    """
    box = placed_so_far.box
    new = np.full((len(radii), len(box)), np.nan)
    fresh = _Placed(new[:0], radii[:0], box)
    for _ in range(MAX_PROPOSALS):
        pending = np.flatnonzero(np.isnan(new[:, 0]))
        if not len(pending):
            return new
        proposal = box * generator.random((len(pending), len(box)))
        free = ~placed_so_far.hit(proposal, radii[pending])
        free[free] = ~fresh.hit(proposal[free], radii[pending[free]])
        chosen = np.flatnonzero(free)
        chosen = chosen[_first_come(proposal[chosen], radii[pending[chosen]], box)]
        new[pending[chosen]] = proposal[chosen]
        done = ~np.isnan(new[:, 0])
        fresh = _Placed(new[done], radii[done], box)
    return None


def _first_come(proposal: Array, radii: Array, box: Array) -> Mask:
    """Return which proposals are accepted, a mask (n,): they overlap no earlier accepted one."""
    state = np.zeros(len(proposal), int)  # 0 open, 1 stays, -1 goes
    if len(proposal) < 2:
        return np.asarray(state == 0)
    early, late = np.sort(close_pairs(Particles(proposal, radii, box), 0.0), axis=0)
    while (state == 0).any():
        waits = np.zeros(len(state), bool)
        waits[late[state[early] == 0]] = True
        state[(state == 0) & ~waits] = 1
        state[late[state[early] == 1]] = -1
    return np.asarray(state == 1)


def relaxed(radii: Array, box: Array, generator: np.random.Generator) -> Array:
    """Return centres (n, d), in m, of particles without overlap in a periodic box, by relaxation.

    Random centres are pushed apart (`_push`) and then moved at random (`_shake`).

    Args:
        radii: shape (n,), in m.
        box: Sides of the box, shape (d,), in m.
        generator: Random number generator.

    Raises:
        FailedError: The particles still overlap after all steps.
    """
    start = box * generator.random((len(radii), len(box)))
    overlapping = Particles(start, radii, box)
    fraction = overlapping.fraction
    grown = fraction + HEADROOM * (overlapping.shape.densest - fraction)
    growth = max(1 + 1e-4, float((grown / fraction) ** (1 / len(box))))
    return _shake(_push(overlapping, growth), generator)


def _push(particles: Particles, growth: float) -> Particles:
    """Return the particles moved apart until none overlap, by FIRE (Bitzek et al. 2006).

    The energy ½ Σ overlap² of particles with radii grown by the factor `growth` is minimised.

    Raises:
        FailedError: Particles overlap after `MAX_STEPS` steps.
    """
    centres, box, radii = particles.centres, particles.size, particles.radii * growth
    velocity, step, mixing, downhill = np.zeros_like(centres), 0.1, 0.1, 0
    skin, overlap = 0.6 * float(particles.radii.mean()), 0.0
    pairs, anchor = None, centres
    for _ in range(MAX_STEPS):
        moved = float(np.linalg.norm(nearest_image(centres - anchor, box), axis=1).max())
        if pairs is None or 2 * moved > skin:
            pairs, anchor = close_pairs(Particles(centres, radii, box), skin), centres
        force, overlap = _repulsion(centres, radii, pairs, box)
        if overlap < (growth - 1) * 2 * float(particles.radii.min()):
            return Particles(centres, particles.radii, box)
        if float((force * velocity).sum()) > 0:
            downhill += 1
            pull = np.sqrt((velocity**2).sum() / max((force**2).sum(), 1e-300))
            velocity = (1 - mixing) * velocity + mixing * pull * force
            if downhill > 5:
                step, mixing = min(1.1 * step, 0.6), 0.99 * mixing
        else:
            velocity, mixing, downhill = np.zeros_like(velocity), 0.1, 0
            step = max(0.5 * step, 0.02)
        velocity = velocity + step * force
        centres = centres + step * velocity
    raise FailedError(
        f"{particles.shape.particles} on a share {particles.fraction:.3f} of the box still overlap"
        f" by {overlap:.3g} m after {MAX_STEPS} steps",
        "lower the fraction",
    )


def _repulsion(
    centres: Array, radii: Array, pairs: tuple[Rows, Rows], box: Array
) -> tuple[Array, float]:
    """Return the force on each particle, shape (n, d), and the greatest overlap, in m.

    Each pair repels along the line of centres with a force equal to its overlap.
    """
    first, second = pairs
    offset = nearest_image(centres[second] - centres[first], box)
    distance = np.maximum(np.linalg.norm(offset, axis=1), 1e-300)
    overlap = np.maximum(radii[first] + radii[second] - distance, 0)
    push = (overlap / distance)[:, None] * offset
    count = len(centres)
    force = [
        np.bincount(second, along, count) - np.bincount(first, along, count) for along in push.T
    ]
    return np.stack(force, axis=1), float(overlap.max(initial=0.0))


def _shake(particles: Particles, generator: np.random.Generator) -> Array:
    """Return centres (n, d) after `MOVES` random moves of each particle without overlap.

    A move is made if it keeps clear of both old and new places of the neighbours.
    """
    box, dimensions, radii = particles.size, len(particles.size), particles.radii
    reach = 0.25 * particles.spacing * (1 - particles.fraction ** (1 / dimensions))
    centres = particles.centres
    for _ in range(0, MOVES, MOVES_PER_SEARCH):
        first, second = close_pairs(Particles(centres, radii, box), 4 * MOVES_PER_SEARCH * reach)
        limit = radii[first] + radii[second]
        for _ in range(MOVES_PER_SEARCH):
            direction = generator.standard_normal(centres.shape)
            direction /= np.linalg.norm(direction, axis=1)[:, None]
            length = reach * generator.random(len(radii)) ** (1 / dimensions)
            moved = centres + length[:, None] * direction
            stays = np.zeros(len(radii), bool)
            for mover, neighbour in ((first, second), (second, first)):
                for positions in (centres, moved):
                    offset = nearest_image(positions[neighbour] - moved[mover], box)
                    stays[mover[np.linalg.norm(offset, axis=1) < limit]] = True
            centres = np.where(stays[:, None], centres, moved)
    return centres
