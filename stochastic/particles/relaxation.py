"""Dense packings: overlapping discs pushed apart, then shaken.

Discs thrown at random repel each other while they overlap; the energy ½ Σ overlap² falls to zero by
the fast inertial relaxation engine (Bitzek et al. 2006). They repel with radii a little larger than
their own, so that none touches in the end, and are then moved at random, one small step after the
other, wherever no overlap arises: the memory of the pushing fades.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from alphacut.stochastic.errors import RefusedError
from alphacut.stochastic.particles.discs import Discs
from alphacut.stochastic.particles.neighbour_search import size_classes
from alphacut.stochastic.theta.truncated_normal import Array


def close_pairs(discs: Discs, gap: float) -> tuple[Array, Array]:
    """Unordered pairs (first, second), each of shape (m,), whose surfaces are within `gap` (m)."""
    from scipy.spatial import cKDTree

    box = discs.size if discs.periodic else None
    classes = list(size_classes(discs.radii))
    trees = [cKDTree(discs.centres[members], boxsize=box) for members in classes]
    largest = [discs.radii[members].max() for members in classes]
    found = []
    for k, members in enumerate(classes):
        found.append(members[trees[k].query_pairs(2 * largest[k] + gap, output_type="ndarray")])
        for m in range(k):
            reach = largest[k] + largest[m] + gap
            near = trees[k].sparse_distance_matrix(trees[m], reach, output_type="ndarray")
            found.append(np.stack([members[near["i"]], classes[m][near["j"]]], axis=1))
    first, second = np.concatenate(found).T
    close = surface_distance(discs, first, second) < gap
    return first[close], second[close]


def surface_distance(discs: Discs, first: Array, second: Array) -> Array:
    """Distance between the surfaces of pairs (nearest image), negative where they overlap, in m."""
    apart = discs.separation(first, second)
    distance = np.hypot(apart[..., 0], apart[..., 1])
    return np.asarray(distance - discs.radii[first] - discs.radii[second])


def smallest_gap(discs: Discs) -> float:
    """Least distance between two surfaces, periodic images included, in m."""
    own = float(discs.size.min() - 2 * discs.radii.max()) if discs.periodic else np.inf
    probe = 0.1 * float(discs.radii.mean() + np.sqrt(discs.area / len(discs)))
    while True:
        first, second = close_pairs(discs, probe)
        if len(first):
            return min(own, float(surface_distance(discs, first, second).min()))
        if probe > 2 * discs.size.sum():
            return own
        probe *= 2


@dataclass(frozen=True)
class Relaxation:
    """Settings of the pushing and shaking of discs.

    Args:
        headroom: Growth of the radii while they repel, as a share of what the area fraction leaves
            up to `densest`.
        densest: Area fraction that the grown discs may not pass, below random close packing (0.84).
        steps: Steps of the relaxation before it is given up.
        sweeps: Random moves per disc after it.
    """

    headroom: float = 0.3
    densest: float = 0.82
    steps: int = 4000
    sweeps: int = 60


def relaxed(
    radii: Array,
    side: float,
    *,
    gap: float,
    generator: np.random.Generator,
    rule: Relaxation | None = None,
) -> Array:
    """Centres of non-overlapping discs in a periodic square, shape (n, 2), in m.

    Args:
        radii: shape (n,), in m.
        side: Side of the square, in m.
        gap: Least distance between surfaces, in m.
        generator: Source of chance.
        rule: How they are moved.

    Raises:
        RefusedError: The discs still overlap after all steps.
    """
    rule = rule or Relaxation()
    own = radii + gap / 2
    fraction = np.pi * (own**2).sum() / side**2
    grown = fraction + rule.headroom * (rule.densest - fraction)
    growth = max(1 + 1e-4, float(np.sqrt(grown / fraction)))
    centres = _push(side * generator.random((len(radii), 2)), own, growth, side=side, rule=rule)
    return _shake(centres, own, side, generator=generator, sweeps=rule.sweeps)


def _push(centres: Array, own: Array, growth: float, *, side: float, rule: Relaxation) -> Array:
    """Relax until no two discs of radius `own` overlap (they repel as if grown)."""
    velocity, step, mixing, downhill = np.zeros_like(centres), 0.1, 0.1, 0
    skin = 0.6 * float(own.mean())
    pairs, anchor = None, centres
    for _ in range(rule.steps):
        if pairs is None or 2 * np.abs(_wrapped(centres - anchor, side)).max() * np.sqrt(2) > skin:
            pairs = close_pairs(Discs(centres, own * growth, np.array([side, side])), skin)
            anchor = centres
        force, overlap = _repulsion(centres, own * growth, pairs, side)
        if overlap < (growth - 1) * 2 * float(own.min()):
            return centres
        power = float((force * velocity).sum())
        if power > 0:
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
    raise RefusedError(
        f"discs at area fraction {np.pi * (own**2).sum() / side**2:.3f} (half the gap counted to"
        f" each radius) still overlap by {overlap:.3g} m after {rule.steps} steps: lower the area"
        " fraction or the gap"
    )


def _repulsion(
    centres: Array, radii: Array, pairs: tuple[Array, Array], side: float
) -> tuple[Array, float]:
    """Forces, shape (n, 2), and the greatest overlap, in m."""
    first, second = pairs
    apart = _wrapped(centres[second] - centres[first], side)
    distance = np.maximum(np.hypot(apart[:, 0], apart[:, 1]), 1e-300)
    overlap = np.maximum(radii[first] + radii[second] - distance, 0)
    push = (overlap / distance)[:, None] * apart
    force = [
        np.bincount(second, push[:, k], len(centres)) - np.bincount(first, push[:, k], len(centres))
        for k in (0, 1)
    ]
    return np.stack(force, axis=1), float(overlap.max(initial=0.0))


def _shake(
    centres: Array, own: Array, side: float, *, generator: np.random.Generator, sweeps: int
) -> Array:
    """Random moves that keep clear of the neighbours' old and new places."""
    reach = 0.25 * (np.sqrt(side**2 / len(own)) - np.sqrt(np.pi) * float(np.sqrt((own**2).mean())))
    each = 5
    for _ in range(0, sweeps, each):
        first, second = close_pairs(Discs(centres, own, np.array([side, side])), 4 * each * reach)
        limit = own[first] + own[second]
        for _ in range(each):
            angle = 2 * np.pi * generator.random(len(own))
            length = reach * np.sqrt(generator.random(len(own)))
            moved = centres + length[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
            stays = np.zeros(len(own), bool)
            for mine, other in ((first, second), (second, first)):
                for place in (centres, moved):
                    apart = _wrapped(place[other] - moved[mine], side)
                    stays[mine[np.hypot(apart[:, 0], apart[:, 1]) < limit]] = True
            centres = np.where(stays[:, None], centres, moved)
    return centres


def _wrapped(apart: Array, side: float) -> Array:
    return np.asarray(apart - side * np.round(apart / side))
