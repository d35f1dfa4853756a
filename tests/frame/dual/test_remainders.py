"""Expansions, eigenpairs and tables hold their bounds, and half of a bound would not do."""

import numpy as np
import pytest
from scipy.linalg import eigh

from alphacut.frame import StoreyFrame
from alphacut.frame.dual import homogeneous
from alphacut.frame.dual.eigenpairs import modes
from alphacut.frame.dual.expansion import Expansion
from alphacut.frame.dual.homogeneous import Series, packed, tensor
from alphacut.frame.dual.intervening import oscillators
from alphacut.frame.dual.proof import over_box
from alphacut.frame.dual.waves import Grid, Oscillators
from alphacut.frame.structures.linear import Accelerogram
from alphacut.frame.structures.matrix import MatrixStructure
from alphacut.frame.structures.polynomial_dependence import UnprovedError

TIGHT = 0.5
"""Share of a bound that something reaches: half the bound would be passed."""


def points(d, count=400, seed=0):
    rng = np.random.default_rng(seed)
    return np.vstack([np.sign(rng.normal(size=(count, d))), rng.uniform(-1, 1, (count, d))])


def inputs(d, seed=0, radius=0.1):
    rng = np.random.default_rng(seed)
    return Expansion.inputs(rng.uniform(1, 2, d), radius * rng.uniform(0.5, 1, d))


@pytest.mark.parametrize(
    ("law", "expected"),
    [
        (lambda x: x[0] * x[1] * x[2], lambda v: v[0] * v[1] * v[2]),
        (lambda x: x[0] ** -3.0 * x[1], lambda v: v[1] / v[0] ** 3),
        (lambda x: (x[0] * x[2]) ** 0.5 - x[1], lambda v: np.sqrt(v[0] * v[2]) - v[1]),
        (lambda x: (x[0] + x[1] * 2.0 + 1.0) ** -1.0, lambda v: 1 / (v[0] + 2 * v[1] + 1)),
    ],
)
def test_an_expansion_is_off_by_its_rest_at_most(law, expected):
    own, u = inputs(3), points(3)
    f = law(own)
    off = np.abs(f.at(u) - expected(own.at(u).T))
    assert off.max() <= f.rest + 1e-12


def test_a_matrix_product_of_expansions_contains_the_product():
    own, u = inputs(4, 1, 0.3), points(4)
    a = Expansion(tuple(x.reshape(2, 2, *x.shape[1:]) for x in own.parts), own.rest.reshape(2, 2))
    cube = a @ a @ (a @ a)
    values = own.at(u).reshape(-1, 2, 2)
    assert (
        np.abs(cube.at(u) - values @ values @ values @ values).max(0) <= cube.rest * (1 + 1e-9)
    ).all()
    assert cube.rest.min() > 0


def test_a_power_of_what_may_be_zero_is_refused():
    with pytest.raises(UnprovedError, match="take narrower inputs"):
        Expansion.inputs(np.ones(1), np.full(1, 1.1)) ** 0.5


def test_packed_products_are_those_of_tensors():
    rng = np.random.default_rng(0)
    a, b = rng.normal(size=(2, 5, 3)), rng.normal(size=(2, 5, 3))
    one = [packed((x + x.swapaxes(0, 1)) / 2, 2) for x in (a[:, :, 0].T @ a[:, :, 0], np.eye(5))]
    both = homogeneous.product(one[0][:, None, None], one[1][:, None], (2, 2), 5)
    u = rng.uniform(-1, 1, 5)
    whole = np.einsum("ijkl,i,j,k,l", tensor(both, 5, 4)[0], u, u, u, u)
    parts = [np.einsum("ij,i,j", tensor(x, 5, 2), u, u) for x in one]
    assert whole == pytest.approx(parts[0] * parts[1], rel=1e-12)
    assert b.size


def test_a_quotient_of_series_contains_the_quotient():
    rng = np.random.default_rng(3)
    d, N = 3, 5
    parts = [
        [
            0.2**m * rng.normal(size=(len(homogeneous.monomials(d, m)), 2)) / (1 + m) ** 2
            for m in range(N + 1)
        ]
        for _ in range(2)
    ]
    parts[1][0] = np.array([[2.0, 2.0]])
    top = Series(parts[0], np.zeros(2), np.arange(d))
    below = Series([x[:, :1] for x in parts[1]], np.zeros(1), np.arange(d))
    quotient, u = top.over(below), points(d)

    def value(series):
        return sum(
            part[homogeneous.places(homogeneous.monomials(d, m), d)].T
            @ np.prod(u[:, homogeneous.monomials(d, m)], axis=2).T
            for m, part in enumerate(series.parts)
        )

    off = np.abs(value(quotient) - value(top) / value(below)).max(1)
    assert (off <= quotient.rest).all()
    assert off.max() > 0


def frame(storeys=4, width=0.05, **values):
    """A frame with a stiffness and a mass a storey, and its structure over the box."""
    own = StoreyFrame(
        masses=(2e4,) * storeys,
        stiffness=(3e7,) * storeys,
        v0=(1.0,) * storeys,
        damping_ratio=0.03,
        **values,
    )
    names = tuple(f"{kind}{z + 1}" for kind in "km" for z in range(storeys))
    centre = np.array([own.parameters[name] for name in names])
    radius = width * centre
    return own, names, centre, radius, over_box(own, names, centre, radius, np.arange(len(names)))


def exact_modes(own, names, centre, radius, u):
    """λ and shapes, those with 1 in their own coordinate of the middle, at points u."""
    n = own.floors
    below = np.eye(n) - np.eye(n, k=-1)

    def pencil(values):
        k, m = values[:n], values[n:]
        return below.T @ np.diag(k) @ below, np.diag(m)

    basis = eigh(*pencil(centre))[1]
    for row in centre + radius * u:
        K, M = pencil(row)
        squared, shape = eigh(K, M)
        seen = np.linalg.solve(basis, shape)
        yield squared, seen / np.diag(seen)


def test_eigenpairs_stay_within_their_remainders():
    own, names, centre, radius, structure = frame()
    found, u = modes(structure), points(8, 100)
    assert sorted(found.single) == [0, 1, 2, 3]
    exact = list(exact_modes(own, names, centre, radius, u))
    for k, mode in found.single.items():
        squared, shape = mode.squared.expansion(8)[0], mode.shape.expansion(8)
        off = np.abs(squared.at(u) - [x[0][k] for x in exact])
        assert off.max() <= squared.rest
        off = np.abs(shape.at(u) - [x[1][:, k] for x in exact])
        assert (off.max(0) <= shape.rest + 1e-12).all()
        assert all(found.low[k] <= x[0][k] <= found.high[k] for x in exact)


def test_half_of_a_remainder_of_eigenvalues_would_not_do():
    own = StoreyFrame(masses=(2e4, 1e4), stiffness=(3e7, 3e7), v0=(1.0, 1.0))
    structure = over_box(own, ("k1",), np.array([3e7]), np.array([6e6]), np.arange(1))
    found, u = modes(structure), np.array([[-1.0], [1.0]])
    below = np.eye(2) - np.eye(2, k=-1)
    exact = np.array(
        [
            eigh(
                below.T @ np.diag([3e7 + 6e6 * x, 3e7]) @ below,
                np.diag([2e4, 1e4]),
                eigvals_only=True,
            )
            for x in u[:, 0]
        ]
    )
    for k, mode in found.single.items():
        squared = mode.squared.expansion(1)[0]
        cubic = squared.sizes()[3]
        quadratic = Expansion((*squared.parts[:3], 0 * squared.parts[3]), squared.rest + cubic)
        off = np.abs(quadratic.at(u) - exact[:, k]).max()
        assert TIGHT * quadratic.rest < off <= quadratic.rest


def test_modes_that_may_cross_are_left_in_the_group():
    arrays = [np.diag(row) for row in np.eye(3)]
    own = MatrixStructure(
        {"a": 1.0, "b": 1.05, "c": 3.0},
        mass=[(1.0, np.eye(3))],
        stiffness=list(zip("abc", arrays, strict=True)),
        observed={"sum": np.ones(3)},
        v0=np.ones(3),
    )
    centre = np.array([1.0, 1.05, 3.0])
    structure = over_box(own, tuple("abc"), centre, 0.1 * centre, np.arange(3))
    found = modes(structure)
    assert sorted(found.single) == [2]
    _, group = oscillators(structure, found, ("velocity",))
    assert group.share.parts[0] == pytest.approx(2)
    assert group.doubt >= 2


RECORD = Accelerogram(0.02, np.sin(np.arange(200) * 0.11) * np.sin(np.arange(200) * 0.47))


@pytest.mark.parametrize("source", ["load", "velocity", "start"])
@pytest.mark.parametrize("order", [0, 1, 2])
def test_tables_miss_what_they_state_and_no_less_than_half(source, order):
    time = np.arange(0, 6, 0.05)
    fine = Grid(np.linspace(9, 11, 81), np.linspace(0.02, 0.05, 81))
    for omega, quotient in ((16, 80), (80, 8), (16, 8)):
        coarse = Grid(fine.omega[:: 80 // omega], fine.quotient[:: 80 // quotient])
        table = Oscillators(coarse, RECORD, time).waves(source, order)
        exact = Oscillators(fine, RECORD, time).waves(source, order).value
        at = table.value
        for axis, (own, grid) in enumerate(
            ((fine.quotient, coarse.quotient), (fine.omega, coarse.omega)), 1
        ):
            weights = np.array([np.interp(own, grid, row) for row in np.eye(len(grid))])
            at = np.moveaxis(np.tensordot(at, weights, (axis, 0)), -1, axis)
        off = np.abs(at - exact).max((1, 2))
        assert (off <= table.error + 1e-14).all()
        if (omega, quotient) != (16, 8):
            assert (off[1:] / table.error[1:]).max() > TIGHT


def test_responses_are_those_of_a_fine_march_and_stray_no_more_than_stated():
    coarse, parts = np.arange(0, 4, 0.05), 8
    time = np.arange(0, 3.95 + 1e-9, 0.05 / parts)
    grid = Grid(np.linspace(9, 11, 3), np.linspace(0.02, 0.05, 2))
    for source in ("load", "velocity", "start"):
        for order in (0, 1, 2):
            wide = Oscillators(grid, RECORD, coarse).waves(source, order)
            fine = Oscillators(grid, RECORD, time).waves(source, order).value
            assert np.allclose(fine[::parts], wide.value, atol=1e-12 * np.abs(fine).max())
            line = np.array([np.interp(time, coarse, x) for x in wide.value.reshape(80, -1).T]).T
            off = np.abs(fine.reshape(len(time), -1) - line)[1:].reshape(79, parts, -1).max((1, 2))
            assert (off <= wide.stray[1:] + 1e-13).all()
