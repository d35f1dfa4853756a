"""Enclosures: interval arithmetic with gradients, rounded outwards.

The function is called as it stands, with enclosures instead of arrays; what comes back holds, for
sure, every value and every slope that the function takes over a box. Each operation is widened by
the round-off that it can make.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from alphacut.fuzzy.sets.numbers import Array

Pair = tuple[Array, Array]
_LARGE = 1e5  # arguments of sine and cosine whose phase is still known to _CLOSE
_CLOSE = 1e-9
_ULPS = 4  # by which the library's sine, exponential … may be off


@dataclass(frozen=True, eq=False)
class Enclosure:
    """Values and slopes of one quantity over n boxes of k inputs.

    Args:
        value: Least and greatest value, two arrays (n,).
        slope: Least and greatest derivative by every input, two arrays (k, n).
    """

    value: Pair
    slope: Pair

    __array_priority__ = 1000

    @classmethod
    def constant(cls, value: float, like: Enclosure) -> Enclosure:
        """A number as an enclosure."""
        number = np.full_like(like.value[0], float(value))
        flat = np.zeros_like(like.slope[0])
        return cls((number, number), (flat, flat))

    def __add__(self, other: Any) -> Enclosure:
        right = _enclosed(other, self)
        return Enclosure(_sum(self.value, right.value), _sum(self.slope, right.slope))

    def __neg__(self) -> Enclosure:
        return Enclosure((-self.value[1], -self.value[0]), (-self.slope[1], -self.slope[0]))

    def __sub__(self, other: Any) -> Enclosure:
        return self + (-_enclosed(other, self))

    def __rsub__(self, other: Any) -> Enclosure:
        return (-self).__add__(other)

    def __mul__(self, other: Any) -> Enclosure:
        if other is self:
            return self**2
        right = _enclosed(other, self)
        slope = _sum(
            _product(_wide(self.value), right.slope), _product(_wide(right.value), self.slope)
        )
        return Enclosure(_product(self.value, right.value), slope)

    __radd__, __rmul__ = __add__, __mul__

    def __truediv__(self, other: Any) -> Enclosure:
        return self * _chain(
            _enclosed(other, self),
            _reciprocal,
            lambda v: _negative(_product(_reciprocal(v), _reciprocal(v))),
        )

    def __rtruediv__(self, other: Any) -> Enclosure:
        return _enclosed(other, self) / self

    def __pow__(self, exponent: float) -> Enclosure:
        if float(exponent) != int(exponent):
            return _KNOWN["exp"](_KNOWN["log"](self) * exponent)
        if exponent < 0:
            return 1.0 / self ** (-exponent)
        whole = int(exponent)
        return _chain(
            self,
            lambda v: _power(v, whole),
            lambda v: _product((np.array(float(whole)),) * 2, _power(v, max(whole - 1, 0))),
        )

    def __bool__(self) -> bool:
        raise TypeError("a comparison has no enclosure")

    def __eq__(self, other: object) -> bool:
        raise TypeError("a comparison has no enclosure")

    __hash__ = None  # type: ignore[assignment]

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **options: Any) -> Any:
        """Let numpy's functions take enclosures."""
        left = inputs[0] if isinstance(inputs[0], Enclosure) else _enclosed(inputs[0], self)
        if method != "__call__" or options or ufunc.__name__ not in _KNOWN:
            raise TypeError(
                f"numpy.{ufunc.__name__} has no enclosure; there are {', '.join(sorted(_KNOWN))}"
            )
        return _KNOWN[ufunc.__name__](left, *inputs[1:])


def _enclosed(other: Any, like: Enclosure) -> Enclosure:
    return other if isinstance(other, Enclosure) else Enclosure.constant(other, like)


def _out(lower: Array, upper: Array, ulps: int = 1) -> Pair:
    """The interval widened by round-off."""
    for _ in range(ulps):
        lower, upper = np.nextafter(lower, -np.inf), np.nextafter(upper, np.inf)
    return lower, upper


def _sum(a: Pair, b: Pair) -> Pair:
    return _out(a[0] + b[0], a[1] + b[1])


def _negative(a: Pair) -> Pair:
    return -a[1], -a[0]


def _product(a: Pair, b: Pair) -> Pair:
    with np.errstate(invalid="ignore"):
        products = np.nan_to_num(
            np.array([a[0] * b[0], a[0] * b[1], a[1] * b[0], a[1] * b[1]]),
            nan=0.0,
            posinf=np.inf,
            neginf=-np.inf,
        )
    return _out(products.min(axis=0), products.max(axis=0))


def _wide(value: Pair) -> Pair:
    """Values (n,) beside slopes (k, n)."""
    return value[0][None], value[1][None]


def _reciprocal(v: Pair) -> Pair:
    with np.errstate(divide="ignore", over="ignore"):
        clear = (v[0] > 0) | (v[1] < 0)
        return _out(np.where(clear, 1 / v[1], -np.inf), np.where(clear, 1 / v[0], np.inf))


def _power(v: Pair, exponent: int) -> Pair:
    ends = v[0] ** exponent, v[1] ** exponent
    if exponent % 2 or exponent == 0:
        return _out(*ends, _ULPS)
    lower = np.where((v[0] < 0) & (v[1] > 0), 0.0, np.minimum(*ends))
    return _out(lower, np.maximum(*ends), _ULPS)


def _chain(
    x: Enclosure, function: Callable[[Pair], Pair], derivative: Callable[[Pair], Pair]
) -> Enclosure:
    return Enclosure(function(x.value), _product(_wide(derivative(x.value)), x.slope))


def _rising(function: Callable[[Array], Array]) -> Callable[[Pair], Pair]:
    def apply(v: Pair) -> Pair:
        with np.errstate(invalid="ignore", divide="ignore"):
            lower, upper = function(v[0]), function(v[1])
        return _out(
            np.nan_to_num(lower, nan=-np.inf, posinf=np.inf, neginf=-np.inf),
            np.nan_to_num(upper, nan=np.inf, posinf=np.inf),
            _ULPS,
        )

    return apply


def _cosine(v: Pair) -> Pair:
    """Range of the cosine, ±1 included where a multiple of π may lie between."""
    small = (np.abs(v[0]) < _LARGE) & (np.abs(v[1]) < _LARGE)
    # beyond, round-off hides the phase: anything goes
    v = (
        np.where(small, v[0], 0.0),
        np.where(small, v[1], 2 * np.pi),
    )
    turns = np.ceil(v[0] / np.pi - _CLOSE), np.floor(v[1] / np.pi + _CLOSE)
    some, both = turns[0] <= turns[1], turns[0] < turns[1]
    even = some & (turns[0] % 2 == 0)
    ends = _out(
        np.minimum(np.cos(v[0]), np.cos(v[1])), np.maximum(np.cos(v[0]), np.cos(v[1])), _ULPS
    )
    lower = np.where(both | (some & ~even), -1.0, ends[0])
    return lower, np.where(both | (some & even), 1.0, ends[1])


def _sine(v: Pair) -> Pair:
    return _cosine(_sum(v, (np.full_like(v[0], -np.pi / 2),) * 2))


_exp, _log, _sqrt, _tanh = _rising(np.exp), _rising(np.log), _rising(np.sqrt), _rising(np.tanh)
_ONE: Pair = (np.array(1.0), np.array(1.0))
_KNOWN: dict[str, Callable[..., Enclosure]] = {
    "add": lambda a, b: a + b,
    "subtract": lambda a, b: a - b,
    "multiply": lambda a, b: a * b,
    "divide": lambda a, b: a / b,
    "power": lambda a, b: a**b,
    "negative": lambda a: -a,
    "square": lambda a: a**2,
    "exp": lambda a: _chain(a, _exp, _exp),
    "log": lambda a: _chain(a, _log, _reciprocal),
    "sqrt": lambda a: _chain(
        a, _sqrt, lambda v: _product((np.array(0.5),) * 2, _reciprocal(_sqrt(v)))
    ),
    "sin": lambda a: _chain(a, _sine, _cosine),
    "cos": lambda a: _chain(a, _cosine, lambda v: _negative(_sine(v))),
    "tanh": lambda a: _chain(a, _tanh, lambda v: _sum(_ONE, _negative(_power(_tanh(v), 2)))),
}


def enclose(
    function: Callable[..., Any], names: Sequence[str], lower: Array, upper: Array
) -> dict[str, Enclosure]:
    """Every output of a function over boxes.

    Args:
        function: Gets the inputs by name and returns a value or a mapping of names to values, by
            arithmetic and numpy's functions.
        names: Names of the inputs.
        lower: Lower corners of the boxes, shape (n, inputs).
        upper: Upper corners, shape (n, inputs).

    Returns:
        The enclosure of each output by name; `y` where it has none, `y[0]`, `y[1]`, … where it is a
        list.

    Raises:
        ValueError: The function does something that has no enclosure.
    """
    unit = np.eye(len(names))[:, :, None] * np.ones(len(lower))
    inputs = {
        name: Enclosure((lower[:, i], upper[:, i]), (unit[i], unit[i]))
        for i, name in enumerate(names)
    }
    try:
        output = function(**inputs)
        outputs = dict(output) if isinstance(output, Mapping) else {"y": output}
        like = next(iter(inputs.values()))
        return {
            key: _enclosed(one, like)
            for name, value in outputs.items()
            for key, one in _entries(str(name), value)
        }
    except (TypeError, AttributeError) as error:
        raise ValueError(
            f"the function cannot be enclosed ({error}); write it in arithmetic and numpy's"
            " functions"
        ) from error


def _entries(name: str, value: Any) -> Iterator[tuple[str, Any]]:
    """The entries of an output with their names; the output itself where it is no list."""
    if not isinstance(value, list | tuple | np.ndarray) or np.ndim(value) == 0:
        yield name, value
        return
    for i, entry in enumerate(value):
        yield from _entries(f"{name}[{i}]", entry)


def gradient_range(
    function: Callable[..., Any], names: Sequence[str]
) -> Callable[[Array, Array], Mapping[str, Pair]]:
    """Gradient range for `Known.gradient_range`, proved from the function itself."""

    def ranges(lower: Array, upper: Array) -> Mapping[str, Pair]:
        found = enclose(function, names, lower[None], upper[None])
        return {name: (one.slope[0][:, 0], one.slope[1][:, 0]) for name, one in found.items()}

    return ranges
