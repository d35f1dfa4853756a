"""Interval arithmetic, rounded outwards: each operation is widened by the round-off it can make."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from alphacut.fuzzy.sets.numbers import Array, Mask

Pair = tuple[Array, Array]  # least and greatest value, of one shape
Map = Callable[[Pair], Pair]
_LARGE = 1e5  # arguments of sine and cosine whose phase is still known to _CLOSE
_CLOSE = 1e-9
_ULPS = 4  # by which the library's sine, exponential … may be off


def outward(lower: Array, upper: Array, ulps: int = 1) -> Pair:
    """The interval widened by so many units in the last place."""
    for _ in range(ulps):
        lower, upper = np.nextafter(lower, -np.inf), np.nextafter(upper, np.inf)
    return lower, upper


def number(value: float) -> Pair:
    """A number as an interval."""
    return (np.array(float(value)),) * 2


def total(a: Pair, b: Pair) -> Pair:
    """A + b."""
    return outward(a[0] + b[0], a[1] + b[1])


def negative(a: Pair) -> Pair:
    """−a."""
    return -a[1], -a[0]


def product(a: Pair, b: Pair) -> Pair:
    """A b; nothing times what has no bound is nothing."""
    with np.errstate(invalid="ignore"):
        products = np.nan_to_num(
            np.array([a[0] * b[0], a[0] * b[1], a[1] * b[0], a[1] * b[1]]),
            nan=0.0,
            posinf=np.inf,
            neginf=-np.inf,
        )
    return outward(products.min(axis=0), products.max(axis=0))


def reciprocal(v: Pair) -> Pair:
    """1 / v, without bounds where v holds 0."""
    with np.errstate(divide="ignore", over="ignore"):
        clear = (v[0] > 0) | (v[1] < 0)
        return outward(np.where(clear, 1 / v[1], -np.inf), np.where(clear, 1 / v[0], np.inf))


def power(v: Pair, exponent: int) -> Pair:
    """V to a whole exponent >= 0."""
    with np.errstate(over="ignore"):
        ends = v[0] ** exponent, v[1] ** exponent
    if exponent % 2 or exponent == 0:
        return outward(*ends, _ULPS)
    lower = np.where((v[0] < 0) & (v[1] > 0), 0.0, np.minimum(*ends))
    return outward(lower, np.maximum(*ends), _ULPS)


def rising(function: Callable[[Array], Array]) -> Map:
    """A function of the library that rises wherever it is defined."""

    def apply(v: Pair) -> Pair:
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            lower, upper = function(v[0]), function(v[1])
        return outward(
            np.nan_to_num(lower, nan=-np.inf, posinf=np.inf, neginf=-np.inf),
            np.nan_to_num(upper, nan=np.inf, posinf=np.inf, neginf=-np.inf),
            _ULPS,
        )

    return apply


def cosine(v: Pair) -> Pair:
    """Range of the cosine: its ends, and ±1 where a multiple of π may lie between."""
    small = (np.abs(v[0]) < _LARGE) & (np.abs(v[1]) < _LARGE)
    v = (
        np.where(small, v[0], 0.0),
        np.where(small, v[1], 2 * np.pi),
    )  # beyond, round-off hides the phase: anything goes
    turns = np.ceil(v[0] / np.pi - _CLOSE), np.floor(v[1] / np.pi + _CLOSE)
    some, both = turns[0] <= turns[1], turns[0] < turns[1]
    even = some & (turns[0] % 2 == 0)
    ends = outward(
        np.minimum(np.cos(v[0]), np.cos(v[1])), np.maximum(np.cos(v[0]), np.cos(v[1])), _ULPS
    )
    lower = np.where(both | (some & ~even), -1.0, ends[0])
    return lower, np.where(both | (some & even), 1.0, ends[1])


def sine(v: Pair) -> Pair:
    """Range of the sine."""
    return cosine(total(v, (np.full_like(v[0], -np.pi / 2),) * 2))


def magnitude(v: Pair) -> Pair:
    """|v|."""
    least = np.where((v[0] < 0) & (v[1] > 0), 0.0, np.minimum(np.abs(v[0]), np.abs(v[1])))
    return least, np.maximum(np.abs(v[0]), np.abs(v[1]))


def sign(v: Pair) -> Pair:
    """Slopes of |v|: −1, 1, and all between where v may be 0."""
    return np.where(v[0] > 0, 1.0, -1.0), np.where(v[1] < 0, -1.0, 1.0)


def chosen(first: Mask, second: Mask, a: Pair, b: Pair) -> Pair:
    """A where only it can be the one, b likewise, and the hull of both elsewhere."""
    return (
        np.where(first, a[0], np.where(second, b[0], np.minimum(a[0], b[0]))),
        np.where(first, a[1], np.where(second, b[1], np.maximum(a[1], b[1]))),
    )


exponential, logarithm = rising(np.exp), rising(np.log)
root, hyperbolic_tangent, arctangent = rising(np.sqrt), rising(np.tanh), rising(np.arctan)
