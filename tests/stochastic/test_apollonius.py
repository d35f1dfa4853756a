"""Cells of the Apollonius diagram: against quadrature, rasters, SciPy's Voronoi cells and
properties that hold for any discs.
"""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import integrate

from alphacut.stochastic import Particles, pack
from alphacut.stochastic.tessellation.apollonius import apollonius, counted_cells, neighbours


def quadrature_area(discs: Particles, i: int) -> float:
    """Cell area by adaptive quadrature over the angle, from the definition, edges included."""
    x, y = discs.centres[i]
    tiles = range(-3, 4) if discs.periodic else [0]
    shifts = [discs.size * (a, b) for a in tiles for b in tiles]
    images = [(j, shift) for j in range(len(discs)) for shift in shifts if j != i or any(shift)]
    apart = np.array([discs.centres[j] + shift - (x, y) for j, shift in images])
    delta = discs.radii[i] - discs.radii[[j for j, _ in images]]
    d2, (width, height) = (apart**2).sum(axis=1), discs.size

    def boundary(phi: float) -> float:
        with np.errstate(divide="ignore", invalid="ignore"):
            towards = apart @ (np.cos(phi), np.sin(phi)) - delta
            rho = np.where(towards > 0, (d2 - delta**2) / (2 * towards), np.inf)
            edges = np.array([width - x, -x, height - y, -y])
            edges /= np.cos([phi, phi, phi - np.pi / 2, phi - np.pi / 2])
        return min(rho.min(), np.inf if discs.periodic else edges[edges > 0].min())

    diagram = apollonius(discs)
    corners = np.unique(np.mod(diagram.start[diagram.cell == i], 2 * np.pi))
    return sum(
        integrate.quad(lambda p: boundary(p) ** 2 / 2, a, b, epsabs=1e-14, epsrel=1e-13)[0]
        for a, b in pairwise([*corners, corners[0] + 2 * np.pi])
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
    length = np.hypot(np.diff(x, axis=0), np.diff(y, axis=0)).sum(axis=0)
    return np.bincount(diagram.cell, length, minlength=len(diagram.discs))


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
    [range(30), pytest.param(range(30, 1000), marks=pytest.mark.slow)],
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


@settings(max_examples=8, deadline=None)
@given(st.integers(0, 10**6), st.floats(-0.01, 0.2), st.floats(0.01, 1e6))
def test_areas_do_not_change_with_a_common_growth_and_scale_with_the_length(seed, growth, scale):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 40))
    centres, radii = rng.random((n, 2)), 0.01 + 0.1 * rng.random(n)
    areas = apollonius(Particles(centres, radii, (1, 1))).areas
    grown = Particles(centres, radii + growth, (1, 1))
    shifted = Particles(centres + np.array([0.37, 0.81]), radii, (1, 1))
    for other in (grown, shifted):
        assert apollonius(other).areas == pytest.approx(areas, rel=1e-9, abs=1e-12)
    scaled = apollonius(Particles(scale * centres, scale * radii, (scale, scale)))
    assert scaled.areas == pytest.approx(areas * scale**2, rel=1e-9)


@pytest.mark.parametrize("discs", [12, 1500])
def test_neighbours_on_the_torus_are_those_of_the_cells(discs):
    (packing,) = pack(discs, packings=1, fraction=0.3, radii=(1e-3, 1e-3), seed=discs)
    direct = neighbours(packing)
    assert direct.number.sum() == len(direct.first) == 6 * discs  # Euler: six on average
    assert direct.distances.min() >= 2e-3
    walls = np.bincount(apollonius(packing).cell, minlength=discs)
    assert direct.number.tolist() == walls.tolist()


def windows(number: int):
    """Windows on a section of 2000 discs, with the true areas of the cells inside."""
    (large,) = pack(2000, packings=1, fraction=0.25, radii=(1e-3, 1e-2), seed=4)
    areas = apollonius(large).areas
    for origin in np.random.default_rng(5).random((number, 2)) * large.size:
        centres, size = np.mod(large.centres - origin, large.size), 0.3 * large.size
        inside = (centres < size).all(axis=1)
        yield Particles(centres[inside], large.radii[inside], size, False), areas[inside]


def test_whole_cells_are_those_of_the_larger_section_and_weights_remove_their_bias():
    plain, weighted, truth, estimates, counts = [], [], [], [], []
    for window, areas in windows(25):
        diagram = apollonius(window)
        whole, weight = counted_cells(diagram)
        area = diagram.areas[whole]
        assert area == pytest.approx(areas[whole], rel=1e-10)
        assert len(whole) > 0.4 * len(window)
        plain.append(area.mean())
        weighted.append((area @ weight) / weight.sum())
        truth.extend(areas)
        estimates.append(weight.sum())  # of the number of cells in the window
        counts.append(len(window))
    assert abs(np.mean(weighted) / np.mean(truth) - 1) < 0.03
    assert np.mean(plain) / np.mean(truth) - 1 < -0.03
    assert abs(np.mean(estimates) / np.mean(counts) - 1) < 0.05
