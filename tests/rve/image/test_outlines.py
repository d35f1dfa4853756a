"""Pixels that an outline fills, misses or cuts, and the brackets of curved and inclined shapes."""

from itertools import pairwise

import numpy as np
import pytest

from alphacut.rve.cell import Phase
from alphacut.rve.image.moduli import ModuliInterval, PlaneModuli
from alphacut.rve.image.outlines.equation import Equation
from alphacut.rve.image.outlines.interval import Interval
from alphacut.rve.image.outlines.outline import CUT, INSIDE, OUTSIDE, Grid, phase_ranges
from alphacut.rve.image.outlines.polygon import Polygons
from alphacut.rve.image.phase_images import moduli_images
from alphacut.rve.image.solve import solve_between
from alphacut.rve.series.stiffness import square_stiffness


def bracket(outline, grid, phases):
    """Proved bounds of a cell with this outline."""
    intervals = [ModuliInterval.crisp(PlaneModuli.of_young(p.modulus, p.poisson)) for p in phases]
    images = moduli_images(*phase_ranges(outline.classify(grid)), intervals)
    return solve_between(images, aspect=grid.aspect).bounds


def random_phases(rng):
    return [Phase(10 ** rng.uniform(9, 11), rng.uniform(-0.2, 0.45)) for _ in range(2)]


@pytest.mark.parametrize("seed", range(8))
def test_a_disc_is_bracketed_at_first_order(seed):
    rng = np.random.default_rng(seed)
    phases, radius = random_phases(rng), rng.uniform(0.15, 0.95)
    exact = square_stiffness(np.array([radius]), phases[0], phases[1:]).matrix[0, 0]
    disc = Equation(f"(x - 1)**2 + (y - 1)**2 <= {radius!r}**2")
    found = [bracket(disc, Grid(n, n, 2.0, 2.0), phases) for n in (24, 48)]
    assert all(b.contains(exact) for b in found)
    assert all(1.4 < a.width / b.width < 2.8 for a, b in pairwise(found))


@pytest.mark.parametrize("seed", range(8))
def test_an_inclined_laminate_is_bracketed(seed):
    """Layers normal to (m, n) in a cell of whole periods; the exact tensor is the turned one of layers along an axis."""
    rng = np.random.default_rng(seed)
    waves = rng.integers(1, 4, 2)
    share, phases = rng.uniform(0.2, 0.8), random_phases(rng)
    stripes = Equation(
        f"cos(2*pi*({waves[0]}*x + {waves[1]}*y)) >= {float(np.cos(np.pi * share))!r}"
    )
    angle = np.arctan2(waves[1], waves[0])
    exact = inclined(share, phases, angle)
    found = bracket(stripes, Grid(48, 48), phases)
    assert found.contains(exact)


def inclined(share, phases, angle):
    """Exact stiffness of layers whose normal has this angle to x."""
    first, second = (p.stiffness for p in phases[::-1])
    across = [0, 2]
    mean = share * first + (1 - share) * second
    jump = first - second
    acoustic = (1 - share) * first + share * second
    inverse = np.linalg.inv(acoustic[np.ix_(across, across)])
    layers = mean - share * (1 - share) * jump[:, across] @ inverse @ jump[across]
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array(
        [[c * c, s * s, c * s], [s * s, c * c, -c * s], [-2 * c * s, 2 * c * s, c * c - s * s]]
    )
    return turn.T @ layers @ turn


@pytest.mark.parametrize("place", [(1.0, 0.7), (1.9, 0.1)])
def test_a_many_sided_polygon_is_the_disc_even_across_the_edge(place):
    grid = Grid(60, 80, 2.0, 1.5)
    angles = np.linspace(0, 2 * np.pi, 4001)[:-1]
    corners = np.array(place) + 0.4 * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    x, y = (
        f"({v} - {c} - {w}*{k})"
        for v, c, w, k in (("x", place[0], 2.0, "i"), ("y", place[1], 1.5, "j"))
    )
    found = Polygons([corners]).classify(grid)
    discs = [
        Equation(
            f"{x}**2 + {y}**2 <= 0.16".replace("i)", f"({i}))").replace("j)", f"({j}))")
        ).classify(grid)
        for i in ("0", "1", "-1")
        for j in ("0", "1", "-1")
    ]
    assert np.array_equal(found, np.maximum.reduce(discs))


@pytest.mark.parametrize("seed", range(5))
def test_random_polygons_agree_with_points_inside_them(seed):
    rng = np.random.default_rng(seed)
    angles = np.sort(rng.uniform(0, 2 * np.pi, 9))
    corners = 0.5 + (rng.uniform(0.1, 0.45, 9) * np.array([np.cos(angles), np.sin(angles)])).T
    classes = Polygons([corners]).classify(Grid(40, 40))
    points = rng.random((20000, 2))
    inside = np.zeros(len(points), bool)
    for (x0, y0), (x1, y1) in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        crosses = (y0 <= points[:, 1]) != (y1 <= points[:, 1])
        inside ^= crosses & (points[:, 0] < x0 + (points[:, 1] - y0) * (x1 - x0) / (y1 - y0))
    here = classes[tuple((points[:, ::-1] * 40).astype(int).T)]
    assert (inside[here == INSIDE]).all()
    assert not inside[here == OUTSIDE].any()
    assert (here == CUT).mean() < 0.2


@pytest.mark.parametrize("seed", range(5))
def test_interval_values_enclose_the_values_of_points(seed):
    text = "sqrt(abs(x)) + exp(-y)*sin(3*x) - cos(x*y)/(2 + x**2) + max(x, y, 0.1)**3 + min(x, y)"
    rng = np.random.default_rng(seed)
    low = rng.uniform(-3, 3, (2, 500))
    high = low + rng.exponential(0.5, (2, 500))
    found = Equation(f"{text} <= 0")._excess(
        *(Interval(a, b) for a, b in zip(low, high, strict=True))
    )
    names = {"sqrt": np.sqrt, "abs": np.abs, "exp": np.exp, "sin": np.sin, "cos": np.cos}
    names |= {"max": lambda *a: np.maximum.reduce(np.broadcast_arrays(*a)), "min": np.minimum}
    for _ in range(50):
        x, y = low + rng.random((2, 500)) * (high - low)
        value = eval(text, names | {"x": x, "y": y})
        assert (found.low <= value).all()
        assert (value <= found.high).all()


def test_roots_of_negative_values_are_refused():
    grid = Grid(8, 8, 2.0, 2.0)
    with pytest.raises(ValueError, match=r"sqrt of a negative value; write sqrt\(max"):
        Equation("sqrt(x - 1) <= 0.5").classify(grid)
    beyond = Equation("sqrt(0.5 - x) <= 0.9")
    with pytest.raises(ValueError, match="negative value"):
        beyond.classify(grid)
    clipped = Equation("sqrt(max(x - 1, 0)) <= 0.5").classify(grid)
    assert (clipped[:, :4] == INSIDE).all()
    assert (clipped[:, 6:] == OUTSIDE).all()
    round_ = Equation("sqrt((x - 1)**2 + (y - 1)**2) <= 0.5").classify(grid)
    assert round_[4, 4] == INSIDE
    assert (Equation("exp(1000*x) <= exp(1000)").classify(grid)[0, -1]) != INSIDE


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("x + ", "cannot be read"),
        ("x + y", "is no inequality"),
        ("0 <= x <= 1", "is no inequality"),
        ("x == 1", "needs <= or >="),
        ("__import__('os') <= 1", 'contains "__import__'),
        ("x**y <= 1", "contains 'x . y'".replace(" . ", r" \*\* ")),
        ("z <= 1", "contains 'z'"),
    ],
)
def test_bad_equations_are_refused(text, told):
    with pytest.raises(ValueError, match=told):
        Equation(text)


@pytest.mark.parametrize(
    ("polygons", "told"),
    [
        ([], "no polygon"),
        ([np.zeros((2, 2))], "three corners"),
        ([np.array([[0, 0], [1, 0], [np.nan, 1]])], "not finite"),
    ],
)
def test_bad_polygons_are_refused(polygons, told):
    with pytest.raises(ValueError, match=told):
        Polygons(polygons)
