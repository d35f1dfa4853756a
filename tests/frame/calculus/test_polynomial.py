"""Polynomials on as many points as they have terms."""

from __future__ import annotations

import weakref

import numpy as np
import pytest
from numpy.polynomial.chebyshev import chebvander

from alphacut.frame.calculus import polynomial
from alphacut.frame.calculus.polynomial import ChebyshevGrid, LowerGrid, Polynomial, exponents


@pytest.mark.parametrize(("degrees", "excess"), [((1,), 4), ((1, 0, 2), 3), ((1,) * 6, 4)])
def test_a_lower_set_gives_back_the_coefficients_of_its_polynomials(
    degrees: tuple[int, ...], excess: int
) -> None:
    grid = LowerGrid(degrees, excess)
    over = np.maximum(grid.index - degrees, 0).sum(1)
    assert len(grid) == len(np.unique(grid.index, axis=0)) == len(grid.points)
    assert over.max() == excess
    wanted = np.random.default_rng().standard_normal((len(grid), 2)) * [1, 1j]
    terms = np.ones((len(grid), len(grid)))
    for axis in range(len(degrees)):
        terms *= chebvander(grid.points[:, axis], grid.index.max())[:, grid.index[:, axis]]
    assert grid.coefficients(terms @ wanted) == pytest.approx(wanted, abs=1e-10)


def test_both_grids_give_one_bound() -> None:
    few, whole = LowerGrid((1, 2), 3), ChebyshevGrid((4, 5))
    sums = [
        np.abs(grid.coefficients((1 + x) * (2 + y**2) * (x + y) ** 3)).sum()
        for grid in (few, whole)
        for x, y in [grid.points.T]
    ]
    assert sums[0] == pytest.approx(sums[1], rel=1e-12)


@pytest.mark.parametrize("count", [1, 16, 37])
@pytest.mark.parametrize(("d", "degree", "columns"), [(1, 0, 1), (2, 5, 4), (4, 7, 3), (6, 2, 8)])
def test_compiled_sums_are_those_of_numpy(
    d: int, degree: int, columns: int, count: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    if polynomial.c_library(polynomial.SOURCE, polynomial.FUSED) is None:
        pytest.skip("no compiler")
    rng, index = np.random.default_rng(count), exponents(d, degree)
    real = rng.standard_normal((2, len(index), columns))
    u, found = rng.uniform(-1, 1, (count, d)), []
    for _ in range(2):
        given = Polynomial(index, real[0] + 1j * real[1]), Polynomial(index, real[0])
        found.append([*given[0].derivatives(u), given[1](u)])
        monkeypatch.setattr(polynomial, "c_library", lambda *_: None)
    for one, other in zip(*found, strict=True):
        assert one.shape == other.shape
        assert np.abs(one - other).max(initial=0) <= 1e-13 * np.abs(other).max(initial=1)


def test_coefficients_live_while_compiled_code_reads_them(monkeypatch: pytest.MonkeyPatch) -> None:
    """Another thread may put its own in the place of those that are kept."""
    made: list[weakref.ref[np.ndarray]] = []  # type: ignore[type-arg]

    def fresh(part: polynomial.Columns) -> np.ndarray:  # type: ignore[type-arg]
        array = np.zeros((1, len(part.own), polynomial.WIDE))
        made.append(weakref.ref(array))
        return array

    class Library:
        def monomial_sums(self, *_: object) -> None:
            assert all(one() is not None for one in made)

    monkeypatch.setattr(polynomial.Columns, "blocks", property(fresh))
    monkeypatch.setattr(polynomial, "c_library", lambda *_: Library())
    Polynomial(exponents(2, 3), np.ones((10, 2))).jets(np.zeros((4, 2)))
    assert len(made) == 3
