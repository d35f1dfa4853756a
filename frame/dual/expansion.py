"""Taylor expansions of third degree over the unit box, with a proved bound of all that is left out.

An expansion stands for functions f(u) of inputs u in [−1, 1]^d: |f(u) − (c₀ + c₁·u + u·c₂ u +
c₃[u, u, u])| ≤ rest for all u of the box. Sums, products and real powers of expansions are
expansions: what a product has of fourth degree and more is bounded by the sums of magnitudes of
its factors' coefficients, a power's by its fourth derivative. Round-off of the coefficients is
not counted here; `ROUND_OFF` of every size is added where a bound is drawn from them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from alphacut.frame.structures.polynomial_dependence import UnprovedError
from alphacut.fuzzy.arrays import Array, Rows

Key = int | slice | Rows | tuple[int | slice | Rows | None, ...]
ROUND_OFF = 1e-11
"""Share of a function's size that covers the round-off of its coefficients."""


@dataclass(frozen=True, eq=False)
class Expansion:
    """Functions of the unit box, an array of shape V of them.

    Args:
        parts: Coefficients of degree 0 to 3, shapes V, V + (d,), V + (d, d), V + (d, d, d), each
            symmetric in its last axes.
        rest: Bound of what they leave out, shape V.
    """

    __array_priority__ = 100

    parts: tuple[Array, ...]
    rest: Array

    @classmethod
    def constant(cls, value: Array | float, d: int) -> Expansion:
        """Functions that are constant, values of shape V."""
        value = np.asarray(value, float)
        parts = tuple(np.zeros(value.shape + (d,) * k) for k in range(1, 4))
        return cls((value, *parts), np.zeros(value.shape))

    @classmethod
    def inputs(cls, centre: Array, radius: Array) -> Expansion:
        """The inputs themselves, centre + radius u, V = (d,)."""
        alone = cls.constant(centre, len(centre))
        return cls((alone.parts[0], np.diag(radius), *alone.parts[2:]), alone.rest)

    @property
    def inner(self) -> int:
        """Number of inputs d."""
        return self.parts[1].shape[-1]

    def sizes(self) -> list[Array]:
        """Bounds of the parts over the box, four of shape V."""
        axes = [tuple(range(-k, 0)) for k in range(4)]
        return [np.abs(part).sum(axis) for part, axis in zip(self.parts, axes, strict=True)]

    def size(self) -> Array:
        """Bound of |f| over the box, shape V."""
        return np.asarray(sum(self.sizes()) + self.rest)

    def spread(self) -> Array:
        """Bound of |f − c₀|, shape V."""
        return np.asarray(sum(self.sizes()[1:]) + self.rest)

    def loosened(self, more: Array | float) -> Expansion:
        """Functions that may be off by `more`, shape V."""
        return Expansion(self.parts, self.rest + more)

    def at(self, u: Array) -> Array:
        """The polynomials' values at points u (S, d), shape (S,) + V."""
        total = self.parts[0] + np.tensordot(u, self.parts[1], (1, -1))
        for part, letters in ((self.parts[2], "xy"), (self.parts[3], "xyz")):
            if part.any():
                total = total + np.einsum(
                    f"...{letters},{','.join('s' + x for x in letters)}->s...",
                    part,
                    *[u] * len(letters),
                )
        return np.asarray(total)

    def present(self) -> Rows:
        """Inputs that the functions depend on."""
        return np.flatnonzero(
            [any(np.take(part, i, -1).any() for part in self.parts[1:]) for i in range(self.inner)]
        )

    def on(self, inputs: Rows) -> Expansion:
        """The same as functions of some inputs alone; they depend on no others."""
        parts = list(self.parts)
        for m in range(1, 4):
            for axis in range(1, m + 1):
                parts[m] = np.take(parts[m], inputs, -axis)
        return Expansion(tuple(parts), self.rest)

    def within(self, low: Array, high: Array) -> Expansion:
        """The same over a part of the box, low ≤ u ≤ high, as functions of its own unit box."""
        middle, half = (low + high) / 2, (high - low) / 2
        value, slope, bend, twist = self.parts
        bent, twisted = bend @ middle, twist @ middle
        twice = twisted @ middle
        parts = (
            value + (slope + bent + twice) @ middle,
            (slope + 2 * bent + 3 * twice) * half,
            (bend + 3 * twisted) * half[:, None] * half,
            twist * half[:, None, None] * half[:, None] * half,
        )
        return Expansion(parts, self.rest)

    def __getitem__(self, key: Key) -> Expansion:
        """Some of the functions; `key` acts on V."""
        return Expansion(tuple(part[key] for part in self.parts), self.rest[key])

    def __add__(self, other: Expansion | Array | float) -> Expansion:
        """Their sum."""
        if not isinstance(other, Expansion):
            return Expansion((self.parts[0] + other, *self.parts[1:]), self.rest)
        parts = tuple(a + b for a, b in zip(self.parts, other.parts, strict=True))
        return Expansion(parts, self.rest + other.rest)

    __radd__ = __add__

    def __neg__(self) -> Expansion:
        """Their opposite."""
        return self * -1.0

    def __sub__(self, other: Expansion | Array | float) -> Expansion:
        """Their difference."""
        return self + -other

    def __rsub__(self, other: Array | float) -> Expansion:
        """The difference of numbers and these."""
        return -self + other

    def __truediv__(self, other: Expansion | Array | float) -> Expansion:
        """Their quotient."""
        return self * (other**-1.0 if isinstance(other, Expansion) else 1.0 / np.asarray(other))

    def __rtruediv__(self, other: Array | float) -> Expansion:
        """The quotient of numbers and these."""
        return self**-1.0 * other

    def __mul__(self, other: Expansion | Array | float) -> Expansion:
        """Their product, entry by entry."""
        if not isinstance(other, Expansion):
            factor = np.asarray(other, float)
            parts = tuple(part * factor[(..., *[None] * k)] for k, part in enumerate(self.parts))
            return Expansion(parts, self.rest * np.abs(factor))
        return product(self, other, "...,...->...")

    __rmul__ = __mul__

    def __matmul__(self, other: Expansion) -> Expansion:
        """Product of matrices of functions, V = (n, m) and (m, k)."""
        return product(self, other, "ij,jk->ik")

    def __pow__(self, power: float) -> Expansion:
        """A real power of positive functions.

        Raises:
            UnprovedError: A function is not known to be positive.
        """
        middle, spread = self.parts[0], self.spread()
        least = middle - spread
        if not (least > 0).all():
            raise UnprovedError(
                "a quantity that must be positive is not known to be so over the box",
                "take narrower inputs",
            )
        step = Expansion((np.zeros_like(middle), *self.parts[1:]), self.rest)
        factor, out = np.ones_like(middle), Expansion.constant(middle**power, self.inner)
        term = Expansion.constant(np.ones_like(middle), self.inner)
        for k in range(1, 4):
            factor = factor * (power - k + 1) / k
            term = term * step
            out = out + term * (factor * middle ** (power - k))
        fourth = np.abs(factor * (power - 3) / 4)
        steep = np.maximum(least ** (power - 4), (middle + spread) ** (power - 4))
        return out.loosened(fourth * steep * spread**4)


def product(a: Expansion, b: Expansion, law: str) -> Expansion:
    """A bilinear product of functions, as `numpy.einsum` names it on their arrays V."""
    left, out = law.split("->")
    one, two = left.split(",")
    names = ("", "x", "xy", "xyz")
    later = ("", "u", "uv", "uvw")

    def times(i: int, j: int) -> Array:
        rule = f"{one}{names[i]},{two}{later[j]}->{out}{names[i]}{later[j]}"
        return np.asarray(np.einsum(rule, a.parts[i], b.parts[j], optimize=True))

    def bound(x: Array, y: Array) -> Array:
        return np.asarray(np.einsum(law, x, y))

    parts = [sum((times(i, k - i) for i in range(k + 1)), np.zeros(())) for k in range(4)]
    s, t = a.sizes(), b.sizes()
    high = sum(bound(s[i], t[j]) for i in range(1, 4) for j in range(1, 4) if i + j > 3)
    rest = high + bound(a.rest, sum(t) + b.rest) + bound(np.asarray(sum(s)), b.rest)
    return Expansion((parts[0], parts[1], *map(symmetric, parts[2:], (2, 3))), np.asarray(rest))


def symmetric(array: Array, degree: int) -> Array:
    """Mean over all orders of the last `degree` axes."""
    if degree < 2:
        return array
    if degree == 2:
        return np.asarray((array + array.swapaxes(-1, -2)) / 2)
    first = array + array.swapaxes(-1, -2)
    turned = first + np.moveaxis(first, -1, -3) + np.moveaxis(first, -3, -1)
    return np.asarray(turned / 6)


def stacked(items: Sequence[Expansion]) -> Expansion:
    """Several as one, V with a new first axis."""
    columns = zip(*(item.parts for item in items), strict=True)
    parts = tuple(np.stack(column) for column in columns)
    return Expansion(parts, np.stack([item.rest for item in items]))
