"""Dense packings: overlapping particles pushed apart, then shaken.

Particles placed at random repel each other while they overlap; the energy ½ Σ overlap² falls to
zero by the fast inertial relaxation engine (Bitzek et al. 2006). They repel with radii a little
larger than their own, so that none touches in the end. Then they move at random in small steps
wherever no overlap arises: the memory of the pushing fades.
"""

from __future__ import annotations

import numpy as np

from alphacut.fuzzy.arrays import Array, Rows
from alphacut.fuzzy.refused import FailedError
from alphacut.stochastic.particles.neighbour_search import close_pairs
from alphacut.stochastic.particles.particles import Particles, nearest_image

HEADROOM = 0.3  # growth of the share of the box while they repel, of what is left to the densest
STEPS = 4000  # of the relaxation before it is given up
SWEEPS, EACH = 60, 5  # random moves per particle after it, and between two searches of neighbours


def relaxed(radii: Array, box: Array, generator: np.random.Generator) -> Array:
    """Centres of particles without overlap in a periodic box, shape (n, d), in m.

    Args:
        radii: shape (n,), in m.
        box: Sides of the box, shape (d,), in m.
        generator: Source of chance.

    Raises:
        FailedError: The particles still overlap after all steps.
    """
    start = box * generator.random((len(radii), len(box)))
    own = Particles(start, radii, box)
    grown = own.fraction + HEADROOM * (own.shape.densest - own.fraction)
    growth = max(1 + 1e-4, float((grown / own.fraction) ** (1 / len(box))))
    return _shake(_push(own, growth), generator)


def _push(own: Particles, growth: float) -> Particles:
    """Relaxes until no two particles overlap; they repel as if grown."""
    centres, box, radii = own.centres, own.size, own.radii * growth
    velocity, step, mixing, downhill = np.zeros_like(centres), 0.1, 0.1, 0
    skin, overlap = 0.6 * float(own.radii.mean()), 0.0
    pairs, anchor = None, centres
    for _ in range(STEPS):
        moved = float(np.linalg.norm(nearest_image(centres - anchor, box), axis=1).max())
        if pairs is None or 2 * moved > skin:
            pairs, anchor = close_pairs(Particles(centres, radii, box), skin), centres
        force, overlap = _repulsion(centres, radii, pairs, box)
        if overlap < (growth - 1) * 2 * float(own.radii.min()):
            return Particles(centres, own.radii, box)
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
        f"{own.shape.particles} on a share {own.fraction:.3f} of the box still overlap by"
        f" {overlap:.3g} m after {STEPS} steps",
        "lower the fraction",
    )


def _repulsion(
    centres: Array, radii: Array, pairs: tuple[Rows, Rows], box: Array
) -> tuple[Array, float]:
    """Forces, shape (n, d), and the greatest overlap, in m."""
    first, second = pairs
    apart = nearest_image(centres[second] - centres[first], box)
    distance = np.maximum(np.linalg.norm(apart, axis=1), 1e-300)
    overlap = np.maximum(radii[first] + radii[second] - distance, 0)
    push = (overlap / distance)[:, None] * apart
    count = len(centres)
    force = [
        np.bincount(second, along, count) - np.bincount(first, along, count) for along in push.T
    ]
    return np.stack(force, axis=1), float(overlap.max(initial=0.0))


def _shake(own: Particles, generator: np.random.Generator) -> Array:
    """Random moves that keep clear of the neighbours' old and new places; the centres."""
    box, dimensions, radii = own.size, len(own.size), own.radii
    reach = 0.25 * own.spacing * (1 - own.fraction ** (1 / dimensions))
    centres = own.centres
    for _ in range(0, SWEEPS, EACH):
        first, second = close_pairs(Particles(centres, radii, box), 4 * EACH * reach)
        limit = radii[first] + radii[second]
        for _ in range(EACH):
            way = generator.standard_normal(centres.shape)
            way /= np.linalg.norm(way, axis=1)[:, None]
            length = reach * generator.random(len(radii)) ** (1 / dimensions)
            moved = centres + length[:, None] * way
            stays = np.zeros(len(radii), bool)
            for mine, other in ((first, second), (second, first)):
                for place in (centres, moved):
                    apart = nearest_image(place[other] - moved[mine], box)
                    stays[mine[np.linalg.norm(apart, axis=1) < limit]] = True
            centres = np.where(stays[:, None], centres, moved)
    return centres
