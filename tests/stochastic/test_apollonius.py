"""Cells of the Apollonius diagram: against quadrature, rasters, SciPy's Voronoi cells and
properties that hold for any discs.
"""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import integrate
from scipy.spatial import Voronoi

from alphacut.stochastic.particles.particles import Particles
from alphacut.stochastic.tessellation.apollonius import apollonius
from alphacut.stochastic.tessellation.circle_envelope import upper_envelopes


def quadrature_area(discs: Particles, i: int) -> float:
    """Cell area by adaptive quadrature over the angle, straight from the definition of the diagram,
    window edges included.
    """
    x, y = discs.centres[i]
    others = np.delete(np.arange(len(discs)), i)
    if discs.periodic:
        shifts = [(a, b) for a in range(-3, 4) for b in range(-3, 4)]
        apart = np.array(
            [
                discs.centres[j] + discs.size * s - (x, y)
                for j in range(len(discs))
                for s in shifts
                if j != i or any(s)
            ]
        )
        radii = np.array(
            [discs.radii[j] for j in range(len(discs)) for s in shifts if j != i or any(s)]
        )
    else:
        apart, radii = discs.centres[others] - (x, y), discs.radii[others]
    d2, delta = (apart**2).sum(axis=1), discs.radii[i] - radii

    def boundary(phi: float) -> float:
        with np.errstate(divide="ignore", invalid="ignore"):
            towards = apart @ (np.cos(phi), np.sin(phi)) - delta
            rho = np.where(towards > 0, (d2 - delta**2) / (2 * towards), np.inf)
            edges = np.array(
                [
                    (discs.size[0] - x) / np.cos(phi),
                    -x / np.cos(phi),
                    (discs.size[1] - y) / np.sin(phi),
                    -y / np.sin(phi),
                ]
            )
        return min(rho.min(), np.inf if discs.periodic else edges[edges > 0].min())

    diagram = apollonius(discs)
    corners = np.unique(np.mod(diagram.start[diagram.cell == i], 2 * np.pi))
    pieces = np.concatenate([corners, [corners[0] + 2 * np.pi]])
    return sum(
        integrate.quad(lambda p: boundary(p) ** 2 / 2, a, b, epsabs=1e-14, epsrel=1e-13)[0]
        for a, b in pairwise(pieces)
    )


def raster_shares(discs: Particles, pixels: int) -> np.ndarray:
    """Area of each cell by counting pixel centres."""
    u = (np.arange(pixels) + 0.5) / pixels
    points = np.stack(np.meshgrid(u * discs.size[0], u * discs.size[1]), axis=-1).reshape(-1, 1, 2)
    apart = points - discs.centres
    if discs.periodic:
        apart -= discs.size * np.round(apart / discs.size)
    owner = np.argmin(np.hypot(apart[..., 0], apart[..., 1]) - discs.radii, axis=1)
    return np.bincount(owner, minlength=len(discs)) / pixels**2 * discs.measure


def perimeter(diagram) -> np.ndarray:
    """Length of each cell's boundary, to about a percent."""
    angle, rho = diagram.walls(17)
    x, y = rho * np.cos(angle), rho * np.sin(angle)
    return np.bincount(
        diagram.cell,
        np.hypot(np.diff(x, axis=0), np.diff(y, axis=0)).sum(axis=0),
        minlength=len(diagram.discs),
    )


def configuration(seed: int) -> Particles:
    """2 to 50 discs, far apart, overlapping or touching, none inside another; periodic or open."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 51))
    centres = rng.random((n, 2))
    radii = rng.choice([0.02, 0.1, 0.3]) * np.exp(rng.choice([0.0, 0.4, 1.5]) * rng.normal(size=n))
    radii = radii.clip(1e-5, 0.6)
    for k in range(1, n, 3):
        j, angle, apart = rng.integers(k), rng.random() * 2 * np.pi, rng.choice([1.0, 0.8])
        way = apart * (radii[j] + radii[k]) * np.array([np.cos(angle), np.sin(angle)])
        centres[k] = np.clip(centres[j] + way, 0, 1)
    keep = np.ones(n, bool)
    for k in range(n):
        apart = centres[k] - centres[keep]
        apart -= np.round(apart) * (seed % 2)
        deep = np.hypot(*apart.T) <= np.abs(radii[k] - radii[keep]) + 1e-9
        keep[k] = not deep[np.flatnonzero(keep) != k].any()
    return Particles(centres[keep], radii[keep], (1, 1), periodic=bool(seed % 2))


@pytest.mark.parametrize("periodic", [True, False])
@pytest.mark.parametrize(
    "radii",
    [(0.05, 0.15, 0.25), (0.2, 0.2, 0.2), (0.01, 0.3, 0.02), (0.0, 0.22, 0.1)],
    ids=["mixed", "equal", "contrast", "point"],
)
def test_three_discs_against_adaptive_quadrature(radii, periodic):
    discs = Particles([(0.2, 0.3), (0.75, 0.45), (0.4, 0.8)], radii, (1.0, 1.1), periodic)
    areas = apollonius(discs).areas
    assert areas == pytest.approx([quadrature_area(discs, i) for i in range(3)], rel=1e-12)


@pytest.mark.parametrize(
    "seeds",
    [range(100), pytest.param(range(100, 1000), marks=pytest.mark.slow)],
    ids=["few", "thousand"],
)
def test_configurations_tile_their_rectangle_and_match_a_raster(seeds):
    pixels = 60
    for seed in seeds:
        discs = configuration(seed)
        diagram = apollonius(discs)
        assert diagram.areas.sum() == pytest.approx(1, abs=1e-12), seed
        error = np.abs(diagram.areas - raster_shares(discs, pixels))
        assert (error <= 0.75 * perimeter(diagram) / pixels + 4 / pixels**2).all(), seed
        assert (diagram.areas >= 0).all()


def test_raster_check_rejects_a_wrong_diagram():
    discs = configuration(12)
    shrunk = apollonius(
        Particles(
            discs.centres, discs.radii * np.linspace(0.5, 1, len(discs)), discs.size, discs.periodic
        )
    )
    error = np.abs(shrunk.areas - raster_shares(discs, 60))
    assert (error > 0.75 * perimeter(shrunk) / 60 + 4 / 60**2).any()


@pytest.mark.parametrize("seed", range(3))
def test_equal_radii_give_scipys_voronoi_cells(seed):
    rng = np.random.default_rng(seed)
    centres = rng.random((200, 2))
    tiled = np.concatenate(
        [
            centres + np.array([i, j])
            for i, j in [(0, 0), *((a, b) for a in (-1, 0, 1) for b in (-1, 0, 1) if a or b)]
        ]
    )
    voronoi = Voronoi(tiled)

    def polygon_area(region: int) -> float:
        x, y = (
            voronoi.vertices[voronoi.regions[region]]
            - voronoi.points[list(voronoi.point_region).index(region)]
        ).T
        order = np.argsort(np.arctan2(y, x))
        x, y = x[order], y[order]
        return abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2

    exact = [polygon_area(voronoi.point_region[i]) for i in range(200)]
    for radius in (0.0, 0.01):
        assert apollonius(Particles(centres, np.full(200, radius), (1, 1))).areas == pytest.approx(
            exact, rel=1e-10
        )


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10**6), st.floats(-0.01, 0.2), st.floats(0.01, 1e6))
def test_areas_do_not_change_with_a_common_growth_and_scale_with_the_length(seed, growth, scale):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 40))
    centres, radii = rng.random((n, 2)), 0.01 + 0.1 * rng.random(n)
    areas = apollonius(Particles(centres, radii, (1, 1))).areas
    assert apollonius(Particles(centres, radii + growth, (1, 1))).areas == pytest.approx(
        areas, rel=1e-9, abs=1e-12
    )
    assert apollonius(
        Particles(scale * centres, scale * radii, (scale, scale))
    ).areas == pytest.approx(areas * scale**2, rel=1e-9)


def test_shifting_a_periodic_box_changes_nothing():
    discs = configuration(101)
    moved = Particles(discs.centres + np.array([0.37, 0.81]), discs.radii, discs.size)
    assert apollonius(moved).areas == pytest.approx(apollonius(discs).areas, rel=1e-9, abs=1e-13)


def test_disc_in_front_of_a_giant():
    rng = np.random.default_rng(3)
    angle = rng.random(100) * 2 * np.pi
    centres = np.concatenate(
        [[(5, 5)], 5 + 3.01 * np.stack([np.cos(angle), np.sin(angle)], axis=1)]
    )
    radii = np.concatenate([[3.0], np.full(100, 1e-3)])
    diagram = apollonius(Particles(centres, radii, (10, 10)))
    assert diagram.areas.sum() == pytest.approx(100, rel=1e-13)
    assert diagram.areas[:4] == pytest.approx(
        [quadrature_area(diagram.discs, i) for i in range(4)], rel=1e-8
    )


def test_arcs_close_and_meet():
    diagram = apollonius(configuration(33))
    for cell in np.unique(diagram.cell):
        arc = np.flatnonzero(diagram.cell == cell)
        assert diagram.end[arc[:-1]] == pytest.approx(diagram.start[arc[1:]], abs=1e-12)
        assert diagram.end[arc[-1]] == pytest.approx(diagram.start[arc[0]] + 2 * np.pi, abs=1e-12)
        incoming, outgoing = diagram.walls(2)[1][:, arc]
        assert outgoing == pytest.approx(np.roll(incoming, -1), rel=1e-6)


def test_walls_are_equally_far_from_both_discs():
    discs = Particles(np.random.default_rng(2).random((40, 2)), np.linspace(0.01, 0.06, 40), (1, 1))
    diagram = apollonius(discs)
    angle, rho = (middle[1] for middle in diagram.walls(3))
    beyond = rho[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1) - diagram.offset
    towards = np.hypot(beyond[:, 0], beyond[:, 1]) - discs.radii[diagram.neighbour]
    assert towards == pytest.approx(rho - discs.radii[diagram.cell], abs=1e-12)


def test_envelope_against_dense_sampling():
    rng = np.random.default_rng(5)
    counts = rng.integers(2, 30, 40)
    a, b, c = rng.normal(size=(3, counts.sum()))
    arcs = upper_envelopes(a, b, c, counts)
    inside = arcs.start + (arcs.end - arcs.start) * rng.random(len(arcs.start))
    value = (a * np.cos(inside[:, None]) + b * np.sin(inside[:, None]) + c)[
        np.arange(len(inside)), arcs.function
    ]
    first = np.concatenate([[0], np.cumsum(counts)])
    for k, owner in enumerate(arcs.owner):
        group = slice(first[owner], first[owner + 1])
        assert (
            value[k]
            >= (a[group] * np.cos(inside[k]) + b[group] * np.sin(inside[k]) + c[group]).max()
            - 1e-12
        )


def test_clusters_with_voids_between_them():
    rng = np.random.default_rng(0)
    centres = np.mod(
        rng.random((8, 2))[rng.integers(0, 8, 400)] + 0.01 * rng.standard_normal((400, 2)), 1
    )
    discs = Particles(centres, np.full(400, 1e-4), (1, 1))
    diagram = apollonius(discs)
    assert diagram.areas.sum() == pytest.approx(1, abs=1e-12)
    widest = np.argsort(diagram.areas)[-3:]
    assert diagram.areas[widest] == pytest.approx(
        [quadrature_area(discs, i) for i in widest], rel=1e-9
    )
