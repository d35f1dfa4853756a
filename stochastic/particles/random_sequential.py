"""Random sequential addition, largest discs first."""

from __future__ import annotations

import numpy as np

from alphacut.stochastic.errors import RefusedError
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
        centres = np.concatenate(
            [
                centres,
                _add(centres, grown[: len(centres)], grown[block], side=side, generator=generator),
            ]
        )
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
            found = tree.query_ball_point(
                proposal[ask], radii[ask] + standing.max(), return_sorted=False
            )
            counts = np.fromiter(map(len, found), int, len(found))
            which = np.repeat(ask, counts)
            other = np.fromiter((k for one in found for k in one), int, counts.sum())
            overlap = _overlap(
                proposal[which] - centres[other], radii[which] + standing[other], self.side
            )
            hit[which[overlap]] = True
        return hit


def _first_come(proposal: Array, radii: Array, side: float) -> Array:
    """Mask of proposals that overlap no earlier proposal that stays."""
    from scipy.spatial import cKDTree

    state = np.zeros(len(proposal), int)  # 0 open, 1 stays, -1 goes
    if len(proposal) < 2:
        return np.asarray(state == 0)
    pair = cKDTree(proposal, boxsize=side).query_pairs(2 * radii.max(), output_type="ndarray")
    early, late = np.sort(
        pair[_overlap(proposal[pair[:, 0]] - proposal[pair[:, 1]], radii[pair].sum(axis=1), side)],
        axis=1,
    ).T
    while (state == 0).any():
        waits = np.zeros(len(state), bool)
        waits[late[state[early] == 0]] = True
        state[(state == 0) & ~waits] = 1
        state[late[state[early] == 1]] = -1
    return np.asarray(state == 1)


def _overlap(apart: Array, reach: Array, side: float) -> Array:
    apart = apart - side * np.round(apart / side)
    return np.asarray((apart**2).sum(axis=1) < reach**2)
