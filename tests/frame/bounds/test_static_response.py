"""Bounds of a structure at rest hold over its box, and each part of them is needed."""

from fractions import Fraction
from itertools import product

import numpy as np
import pytest

from alphacut.base.errors import RefusedError
from alphacut.frame import (
    Force,
    History,
    Limit,
    MatrixStructure,
    StoreyFrame,
    envelope,
    static_bounds,
)
from alphacut.frame.bounds.static_response import StaticProof, StaticSearch, affine_model
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.fuzzy import Crisp, Interval, Triangular

AT_REST = History.constant(0, is_static=True)
NODES = np.array([(0, 0), (1, 1), (2, 0), (3, 1), (4, 0)], float)
BARS = ((0, 1), (0, 2), (1, 2), (1, 3), (2, 3), (2, 4), (3, 4))
FREE = [0, 2, 3, 4, 5, 6, 7]


def truss(groups, rows=None, *, push=-10e3, **given):
    """Skalna's truss (Reliable Computing 12, 2006, example 4.1), bars in groups with one factor."""
    terms = []
    for number, group in enumerate(groups, start=1):
        total = np.zeros((10, 10))
        for a, b in (BARS[bar] for bar in group):
            row = np.zeros((5, 2))
            row[b] = NODES[b] - NODES[a]
            row[a] = -row[b]
            total += 200e9 * 0.005 / np.linalg.norm(row[b]) ** 3 * np.outer(row, row)
        terms.append((f"s{number}", total[np.ix_(FREE, FREE)]))
    rows = rows or {f"u{k}": np.eye(7)[k] for k in range(7)}
    parameters = {name: 1.0 for name, _ in terms} | {"F": push}
    load = Force(np.eye(7)[2], "F", AT_REST)
    return MatrixStructure(parameters, (), terms, rows, **{"loads": [load], **given})


def spring(**terms):
    """A spring with the stiffness p, or springs side by side, under a unit force."""
    terms = terms or {"p": 1.0}
    load = Force([1.0], "F", AT_REST)
    stiffness = [(name, np.eye(1)) for name in terms]
    return MatrixStructure({**terms, "F": 1.0}, (), stiffness, {"u": [1.0]}, loads=[load])


def over_one_box(structure, names, low, high):
    return StaticProof(StaticSearch(structure, tuple(names), low, high).model)


def around(names, radius):
    return {name: Interval(1 - radius, 1 + radius) for name in names}


def require_within(found, values):
    """Requires that values (S, m) lie within bounds of the lowest level."""
    assert (found.bounds[0, :, 0] <= values.min(0)).all()
    assert (values.max(0) <= found.bounds[0, :, 1]).all()


EACH = [(bar,) for bar in range(7)]
ALL = [f"s{k}" for k in range(1, 8)]


def exact(structure, points):
    """Return the outputs at parameters, without any code of the proof."""
    names = list(structure.parameters)
    found = []
    for point in points:
        p = dict(zip(names, point, strict=True))
        stiffness = sum(p[name] * array for name, array in structure.stiffness)
        rows = np.array(list(structure.observed.values()))
        load = p["F"] * np.asarray(structure.loads[0].at)
        found.append(rows @ np.linalg.solve(stiffness, load))
    return np.array(found)


def test_a_published_truss_has_its_exact_bounds():
    found = static_bounds(truss(EACH), {"s3": Interval(0.9, 1.1)}, alpha=[0])
    published = [
        [-20, -20], [-2.661, -2.304], [-38.910, -38.553], [-5, -5],
        [-34.464, -33.749], [-12.661, -12.304], [-19.732, -19.375],
    ]  # fmt: skip
    assert np.abs(found.bounds[0] * 1e6 - published).max() < 6e-4
    assert np.abs(found.bounds - found.attained).max() < 1e-12 * 4e-5


def test_bars_have_their_extremes_at_corners(rng):
    radius = rng.uniform(0.02, 0.3)
    structure = truss(EACH)
    found = static_bounds(structure, around(ALL, radius), alpha=[0], gap=1e-9)
    corners = [(*end, -10e3) for end in product((1 - radius, 1 + radius), repeat=7)]
    values = exact(structure, corners)
    scale = np.abs(values).max()
    assert np.abs(found.bounds[0, :, 0] - values.min(0)).max() < 1e-8 * scale
    assert np.abs(found.bounds[0, :, 1] - values.max(0)).max() < 1e-8 * scale
    at_corner = exact(structure, [(*x, -10e3) for x in found.attained_at[:, 1]])
    assert np.diag(at_corner) == pytest.approx(found.attained[0, :, 1], abs=1e-10 * scale)


@pytest.mark.parametrize("groups", [EACH, [(0, 1, 2), (3, 4), (5, 6)], [(0, 3, 6), (1, 2, 4, 5)]])
def test_values_lie_within_the_bounds_of_one_box(rng, groups):
    structure = truss(groups)
    names = [name for name, _ in structure.stiffness]
    low = rng.uniform(0.6, 0.9, len(names))
    high = low + rng.uniform(0.1, 0.5, len(names))
    proof = over_one_box(structure, names, low, high)
    points = low + (high - low) * rng.uniform(0, 1, (300, len(names)))
    ends = np.where(rng.uniform(0, 1, (300, len(names))) < 0.5, low, high)
    values = exact(structure, [(*x, -10e3) for x in np.vstack([points, ends])])
    for j in range(7):
        known = proof.enclosure(j)
        assert known.lower <= values[:, j].min()
        assert values[:, j].max() <= known.upper


def test_derivatives_lie_within_their_radii(rng):
    structure = truss([(0, 1, 2), (3, 4), (5, 6)])
    low, high = np.full(3, 0.7), np.full(3, 1.3)
    proof = over_one_box(structure, ALL[:3], low, high)
    step = 1e-5
    for point in rng.uniform(low, high, (40, 3)):
        for axis in range(3):
            ends = np.tile(point, (2, 1)) + step * np.outer([-1, 1], np.eye(3)[axis])
            below, above = exact(structure, [(*x, -10e3) for x in ends])
            slope = (above - below) / (2 * step) * 0.3
            for j in range(7):
                known = proof.enclosure(j)
                slack = 1e-6 * np.abs(slope).max()
                assert abs(slope[j] - known.slopes[axis]) <= known.slope_radii[axis] + slack


def test_the_error_of_one_box_is_of_fourth_order():
    structure = truss([(0, 3, 6), (1, 2, 4, 5)])
    widths = []
    for radius in (0.2, 0.1):
        proof = over_one_box(structure, ALL[:2], np.full(2, 1 - radius), np.full(2, 1 + radius))
        u = proof.displacements
        z = proof._solve(proof.model.row(2), proof.model.blocks.remainder[:, 7 + 1 + 2])
        widths.append(u.norm * z.norm)
    assert 8 < widths[0] / widths[1] < 40  # 16 in the limit


@pytest.mark.parametrize("radius", [0.05, 0.2])
def test_an_extreme_inside_of_a_group_is_bounded(rng, radius):
    structure = truss([(0, 1, 2), (3, 4), (5, 6)])
    box = {**around(ALL[:3], radius), "F": Interval(-12e3, -8e3)}
    found = static_bounds(structure, box, alpha=[0])
    points = 1 + radius * rng.uniform(-1, 1, (2000, 3))
    values = exact(structure, np.column_stack([points, rng.uniform(-12e3, -8e3, 2000)]))
    require_within(found, values)
    assert found.gaps.max() <= 0.0101


def test_the_force_in_a_bar_is_an_output(rng):
    row = {"force": truss(EACH).stiffness[2][1][1] / -0.5}
    structure = truss(EACH, row, row_factors={"force": "s3"})
    found = static_bounds(structure, around(ALL, 0.2), alpha=[0], gap=1e-9)
    points = [(*x, -10e3) for x in rng.uniform(0.8, 1.2, (200, 7))]
    require_within(found, exact(structure, points) * [[x[2]] for x in points])


def test_a_frame_with_members_of_one_modulus_and_their_lengths(rng):
    frame = StoreyFrame(
        masses=[5e3, 5e3], lengths=[3.0, 3.0], modulus=30e9, second_moment=1e-5,
        loads=[Force(2, 20e3, AT_REST)], outputs=("q2", "drift1"),
    )  # fmt: skip
    box = {"E": Interval(28e9, 32e9), "l1": Interval(2.9, 3.1), "F2": Interval(15e3, 25e3)}
    found = static_bounds(frame, box, alpha=[0])
    E, length, push = (rng.uniform(x.lower, x.upper, 500) for x in box.values())
    first, second = push * np.array([length**3, 3.0**3 + 0 * length]) / (24 * E * 1e-5)
    require_within(found, np.stack([first + second, first], axis=1))
    assert found.gaps.max() <= 0.0101
    # of the length alone, over one box
    known = over_one_box(frame, ("l1",), np.array([2.95]), np.array([3.05])).enclosure(1)
    at_ends = 20e3 * np.array([2.95, 3.05]) ** 3 / (24 * 30e9 * 1e-5)
    assert known.lower <= at_ends[0] <= at_ends[1] <= known.upper
    assert known.slope_radii[0] == np.inf


def test_cuts_are_nested_and_crisp_inputs_give_one_value():
    box = {"s1": Triangular(0.9, 1.0, 1.2), "F": Crisp(-10e3)}
    found = static_bounds(truss(EACH), box, alpha=[0, 0.5, 1])
    assert (np.diff(found.bounds[..., 0], axis=0) >= 0).all()
    assert (np.diff(found.bounds[..., 1], axis=0) <= 0).all()
    assert found.bounds[-1, :, 0] == pytest.approx(found.nominal, rel=1e-9)


def test_limits_get_verdicts():
    limits = [Limit("u2", 40e-6), Limit("u2", 38.8e-6), Limit("u2", 30e-6), Limit("u0", (-3e-5, 0))]
    found = static_bounds(truss(EACH), {"s3": Interval(0.9, 1.1)}, alpha=[0], limits=limits)
    assert list(found.verdicts.values()) == [
        "not exceeded", "can be exceeded", "exceeded", "not exceeded", "not exceeded",
    ]  # fmt: skip
    assert "not exceeded" in str(found)


@pytest.mark.parametrize(
    ("changes", "box", "key"),
    [
        ({}, {"s9": Interval(1, 2)}, "inputs"),
        ({}, {"s3": Interval(0, 1)}, "stiffness"),
        ({"push": 0.0}, {"s3": Interval(1, 2)}, "loads"),
    ],
)
def test_what_has_no_rest_is_refused(changes, box, key):
    with pytest.raises(RefusedError) as refused:
        static_bounds(truss(EACH, **changes), box, alpha=[0])
    assert refused.value.key == key


def test_a_load_that_moves_and_a_structure_without_mass_that_moves_are_refused():
    moving = truss(EACH, loads=[Force(np.eye(7)[2], "F", History.constant(0))])
    with pytest.raises(RefusedError) as refused:
        static_bounds(moving, around(["s3"], 0.1))
    assert refused.value.key == "loads"
    with pytest.raises(RefusedError) as refused:
        envelope(truss(EACH), around(["s3"], 0.1), duration=1.0, step=0.1)
    assert refused.value.key == "mass"


def test_a_range_that_holds_a_singular_stiffness_is_no_bound():
    # two springs in parallel between a support and the unknown, one of them may be negative
    box = {"a": Interval(0.5, 1.5), "b": Interval(-1.5, 2.0)}
    with pytest.raises((RefusedError, UnprovedError)):
        static_bounds(spring(a=1.0, b=1.0), box, alpha=[0])


@pytest.mark.parametrize("radius", [0.1, 0.3])
def test_the_slopes_of_a_spring_lie_just_within_their_radii(radius):
    known = over_one_box(spring(), "p", np.array([1 - radius]), np.array([1 + radius])).enclosure(0)
    steepest = -radius / (1 - radius) ** 2  # of 1/p by x, p = 1 + radius x
    assert known.slopes[0] == pytest.approx(-radius)
    excess = known.slope_radii[0] - (known.slopes[0] - steepest)
    assert 0 <= excess <= 2 * radius**3


def test_the_extreme_of_a_group_may_lie_inside():
    # 1/(1 + p) − f/(1/2 + 4 p) is largest at p = 1, where both terms fall equally fast
    f = 4.5**2 / 16
    terms = [("one", np.diag([1.0, 0.5])), ("p", np.diag([1.0, 4.0]))]
    structure = MatrixStructure(
        {"one": 1.0, "p": 1.0}, (), terms, {"u": [1.0, -1.0]}, loads=[Force([1.0, f], 1.0, AT_REST)]
    )
    found = static_bounds(structure, {"p": Interval(0.4, 1.7)}, alpha=[0], gap=1e-4)
    largest = 0.5 - f / 4.5
    assert largest <= found.bounds[0, 0, 1] <= largest + 1e-4 * 0.5
    assert found.attained_at[0, 1, 0] == pytest.approx(1.0, abs=0.1)


def test_two_loads_on_one_spring_add_up_only_at_one_corner():
    radius = 0.04
    known = over_one_box(spring(), "pF", np.full(2, 1 - radius), np.full(2, 1 + radius)).enclosure(
        0
    )
    assert known.upper >= (1 + radius) / (1 - radius)  # the mixed term adds at this corner
    assert known.lower <= (1 - radius) / (1 + radius)
    assert known.upper <= (1 + radius) / (1 - radius) + 2 * radius**2


def test_entries_of_the_stiffness_hold_without_rounding_at_the_corners(rng):
    exact = np.vectorize(Fraction, otypes=[object])
    load = Force([1.0, 0.0, 0.0], 1.0, AT_REST)
    for _ in range(20):
        halves = rng.normal(size=(2, 3, 3))
        terms = [(f"p{i}", half @ half.T) for i, half in enumerate(halves)]
        parameters, row = {"p0": 1.0, "p1": 1.0}, {"u": np.eye(3)[0]}
        structure = MatrixStructure(parameters, (), terms, row, loads=[load])
        low = rng.uniform(0.5, 1.0, 2)
        high = low * rng.uniform(1.0, 1.5, 2)
        blocks = affine_model(structure, tuple(parameters), low, high).blocks
        constant, linear = (exact(blocks.homogeneous_part(k))[:, :3, :3] for k in (0, 1))
        for signs in product((-1, 1), repeat=2):
            p = exact(np.where(np.array(signs) > 0, high, low))
            true = sum(x * exact(array) for x, (_, array) in zip(p, terms, strict=True))
            found = constant[0] + signs[0] * linear[0] + signs[1] * linear[1]
            assert (abs(true - found) <= exact(blocks.remainder[:3, :3])).all()
