"""Tracers: what a function gets instead of numbers, so that it says which arithmetic it does.

A tracer holds every value and slope of one quantity over many boxes. What it cannot enclose (a
comparison, a branch, a conversion to a number, a look at its type) it refuses by an error *and* by
a flag that all tracers of one call share: whatever the function catches, the call proves nothing.
"""

from __future__ import annotations

import dis
import sys
from collections.abc import Callable, Mapping
from types import CodeType, FrameType
from typing import TYPE_CHECKING, Any, NoReturn, TypeVar, cast

import numpy as np

from alphacut.fuzzy.knowledge import interval_arithmetic as interval
from alphacut.fuzzy.knowledge.interval_arithmetic import Map, Pair

if TYPE_CHECKING:
    from _typeshed import TraceFunction


Result = TypeVar("Result")
Path = dict[CodeType, set[object]]
_APART = {  # code that goes other ways with tracers and may
    f"{__package__}.{name}" for name in ("trace", "tracer", "enclosure", "interval_arithmetic")
}


class Trace:
    """One call of a function: the operations it did, in their order, and why it proves nothing.

    Args:
        reason: What could not be enclosed; empty if all could.
        steps: Each operation with the numbers of its operands, or their values.
    """

    def __init__(self) -> None:
        self.reason = ""
        self.steps: list[tuple[object, ...]] = []

    def refuse(self, what: str) -> NoReturn:
        """Note what has no enclosure.

        Raises:
            TypeError: Always.
        """
        self.reason = self.reason or what
        raise TypeError(what)

    def step(self, *what: object) -> int:
        """Note an operation; the number of its result."""
        self.steps.append(what)
        return len(self.steps) - 1


def path(call: Callable[[], Result]) -> tuple[Result, Path]:
    """The result of a call, with its path.

    A path holds for all code that runs in Python its lines and the kinds of its exceptions, caught
    ones included. Two calls of a function that does the same arithmetic with numbers and with
    tracers take one path through the code that both run.
    """
    found: Path = {}

    def inside(frame: FrameType, event: str, argument: object) -> TraceFunction:
        if event in ("line", "exception"):
            kind = argument[0] if isinstance(argument, tuple) else frame.f_lineno
            found[frame.f_code].add(kind)
        return inside

    def enter(frame: FrameType, event: str, argument: object) -> TraceFunction | None:
        if frame.f_code.co_filename.startswith("<frozen") or _apart(frame.f_globals):
            return None
        found.setdefault(frame.f_code, set())
        return inside

    before = sys.gettrace()
    sys.settrace(enter)
    try:
        return call(), found
    finally:
        sys.settrace(before)


def _apart(names: Mapping[str, object]) -> bool:
    """Whether code with these global names is numpy's or this arithmetic's own."""
    module = str(names.get("__name__", ""))
    return module in _APART or module.partition(".")[0] == "numpy"


def same_path(one: Path, other: Path) -> bool:
    """Whether two calls took one path through the code that both ran."""
    return all(one[code] == other[code] for code in one.keys() & other.keys())


def asks_for_types(calls: Path) -> str:
    """The first function on a path that asks for the type of something by `type`; empty if none."""
    for code in calls:
        for step in dis.get_instructions(code):
            if step.argval == "type" and step.opname.startswith(("LOAD_GLOBAL", "LOAD_NAME")):
                return code.co_name
    return ""


class Tracer:
    """Values and slopes of one quantity over n boxes of k inputs.

    Args:
        trace: The call that it belongs to.
        index: Number of the operation that made it.
        value: Least and greatest value, two arrays (n,).
        slope: Least and greatest derivative by every input, two arrays (k, n).
    """

    __slots__ = ("_index", "_slope", "_trace", "_value")
    __array_priority__ = 1000

    def __init__(self, trace: Trace, index: int, value: Pair, slope: Pair) -> None:
        self._trace, self._index, self._value, self._slope = trace, index, value, slope

    def __add__(self, other: object) -> Tracer:
        right = self._operand(other)
        return self._made(
            ("add", right._index),
            interval.total(self._value, right._value),
            interval.total(self._slope, right._slope),
        )

    def __neg__(self) -> Tracer:
        return self._made(
            ("negative",), interval.negative(self._value), interval.negative(self._slope)
        )

    def __pos__(self) -> Tracer:
        return self

    def __sub__(self, other: object) -> Tracer:
        return self + (-self._operand(other))

    def __rsub__(self, other: object) -> Tracer:
        return (-self).__add__(other)

    def __mul__(self, other: object) -> Tracer:
        if other is self:
            return self**2
        right = self._operand(other)
        slope = interval.total(
            interval.product(_wide(self._value), right._slope),
            interval.product(_wide(right._value), self._slope),
        )
        return self._made(
            ("multiply", right._index), interval.product(self._value, right._value), slope
        )

    __radd__, __rmul__ = __add__, __mul__

    def __truediv__(self, other: object) -> Tracer:
        return self * self._operand(other)._chain("reciprocal", interval.reciprocal, _steepness)

    def __rtruediv__(self, other: object) -> Tracer:
        return self._operand(other) / self

    def __pow__(self, exponent: object, modulo: object = None) -> Tracer:
        if modulo is not None:
            self._trace.refuse("a remainder has no enclosure")
        if type(exponent) is Tracer or self._number(exponent) != int(self._number(exponent)):
            return self._positive_power(self._operand(exponent))
        whole = int(self._number(exponent))
        if whole < 0:
            return 1.0 / self**-whole
        return self._chain(
            f"power {whole}",
            lambda v: interval.power(v, whole),
            lambda v: interval.product(
                interval.number(whole), interval.power(v, max(whole - 1, 0))
            ),
        )

    def __rpow__(self, base: object) -> Tracer:
        return self._operand(base) ** self

    def _positive_power(self, exponent: Tracer) -> Tracer:
        """Self ** exponent by logarithms; without bounds where self may be negative."""
        found = KNOWN["exp"](KNOWN["log"](self) * exponent)
        sound = self._value[0] >= 0
        return self._made(
            ("where positive", found._index),
            (np.where(sound, found._value[0], -np.inf), np.where(sound, found._value[1], np.inf)),
            (np.where(sound, found._slope[0], -np.inf), np.where(sound, found._slope[1], np.inf)),
        )

    def __abs__(self) -> Tracer:
        return self._chain("absolute", interval.magnitude, interval.sign)

    def greatest(self, other: object) -> Tracer:
        """The larger of two."""
        right = self._operand(other)
        a, b = self._value, right._value
        only = a[0] > b[1], b[0] > a[1]
        value = np.maximum(a[0], b[0]), np.maximum(a[1], b[1])
        return self._made(
            ("maximum", right._index), value, interval.chosen(*only, self._slope, right._slope)
        )

    def _chain(self, name: str, function: Map, derivative: Map) -> Tracer:
        """A function of this quantity alone."""
        slope = interval.product(_wide(derivative(self._value)), self._slope)
        return self._made((name,), function(self._value), slope)

    def _made(self, how: tuple[object, ...], value: Pair, slope: Pair) -> Tracer:
        return Tracer(self._trace, self._trace.step(self._index, *how), value, slope)

    def _number(self, other: object) -> float:
        """A finite constant."""
        try:
            value = float(cast("float", other))
        except (TypeError, ValueError, OverflowError):
            value = np.nan
        if not np.isfinite(value):
            self._trace.refuse(f"{other!r} beside a quantity has no enclosure")
        return value

    def _operand(self, other: object) -> Tracer:
        """Another quantity, or a constant as one."""
        if type(other) is Tracer:
            if other._trace is not self._trace:
                self._trace.reason = "the function keeps inputs of one call for another"
                self._trace.refuse(self._trace.reason)
            return other
        number = np.full_like(self._value[0], self._number(other))
        flat = np.zeros_like(self._slope[0])
        return Tracer(self._trace, self._trace.step(float(number[0])), (number,) * 2, (flat,) * 2)

    def __array__(self, dtype: object = None, copy: object = None) -> np.ndarray[Any, Any]:
        """The tracer in an array of objects, whose arithmetic is the tracer's."""
        if dtype is not None and dtype is not object and dtype != np.dtype(object):
            self._trace.refuse(f"a conversion to {dtype} has no enclosure")
        held = np.empty((), object)
        held[()] = self
        return held

    def __array_ufunc__(
        self, ufunc: np.ufunc, method: str, *inputs: object, **options: object
    ) -> Any:
        """Let numpy's functions take tracers, alone or beside arrays, entry by entry."""
        if method != "__call__" or options or ufunc.__name__ not in KNOWN:
            self._trace.refuse(f"numpy.{ufunc.__name__} has no enclosure")
        function = KNOWN[ufunc.__name__]
        if any(map(_is_array, inputs)):
            return np.frompyfunc(function, ufunc.nin, 1)(
                *(np.asarray(one, object) for one in inputs)
            )
        left = inputs[0] if type(inputs[0]) is Tracer else self._operand(inputs[0])
        return function(left, *inputs[1:])

    def __array_function__(
        self, function: Callable[..., Any], types: object, inputs: Any, options: object
    ) -> Tracer:
        """numpy.clip; nothing else has an enclosure."""
        if function is np.clip and not options and len(inputs) == 3:
            return KNOWN["minimum"](
                KNOWN["maximum"](self._operand(inputs[0]), inputs[1]), inputs[2]
            )
        return self._trace.refuse(f"numpy.{function.__name__} has no enclosure")

    def __getattr__(self, name: str) -> NoReturn:
        if name.startswith("__array_"):  # numpy asks for these of everything
            raise AttributeError(name)
        self._trace.reason = self._trace.reason or f"a look at .{name} has no enclosure"
        raise AttributeError(f"a quantity under enclosure has no {name}")

    def __setattr__(self, name: str, value: object) -> None:
        if name not in Tracer.__slots__:
            self._trace.refuse(f"a change of .{name} has no enclosure")
        object.__setattr__(self, name, value)

    @property  # type: ignore[misc]
    def __class__(self) -> type:
        self._trace.refuse("a look at the type of an input (isinstance) has no enclosure")


def _refusal(what: str) -> Callable[..., NoReturn]:
    def refuse(self: Tracer, *_: object) -> NoReturn:
        self._trace.refuse(f"{what} has no enclosure")

    return refuse


_REFUSED = {
    "a comparison": "lt le gt ge eq ne",
    "a branch or membership": "bool contains",
    "a conversion to a number": "float int complex index round trunc floor ceil",
    "a use as a key": "hash",
    "a use as text": "str repr format bytes",
    "a use as a list": "len iter next reversed getitem setitem delitem",
    "a copy or a way to another process": "copy deepcopy reduce reduce_ex getstate",
    "a remainder or whole quotient": "mod rmod floordiv rfloordiv divmod rdivmod",
    "an operation on bits or matrices": (
        "matmul rmatmul and rand or ror xor rxor lshift rlshift rshift rrshift invert"
    ),
    "a call": "call enter exit",
}
for _what, _names in _REFUSED.items():
    for _name in _names.split():
        setattr(Tracer, f"__{_name}__", _refusal(_what))


def _left_to_arrays(operation: Callable[[Tracer, object], Tracer]) -> Callable[..., Any]:
    def guarded(self: Tracer, other: object, *more: object) -> object:
        return NotImplemented if _is_array(other) else operation(self, other, *more)

    return guarded


for _name in ["add", "radd", "sub", "rsub", "mul", "rmul", "truediv", "rtruediv", "pow", "rpow"]:
    setattr(Tracer, f"__{_name}__", _left_to_arrays(getattr(Tracer, f"__{_name}__")))


def _is_array(one: object) -> bool:
    """Whether something is a list of numpy; `isinstance` would ask a tracer for its class."""
    return issubclass(type(one), np.ndarray) and np.ndim(cast("Any", one)) > 0


def _wide(value: Pair) -> Pair:
    """Values (n,) beside slopes (k, n)."""
    return value[0][None], value[1][None]


def _steepness(v: Pair) -> Pair:
    """Derivative of 1 / v."""
    once = interval.reciprocal(v)
    return interval.negative(interval.product(once, once))


def _scaled(function: Callable[[Tracer], Tracer], base: float) -> Callable[[Tracer], Tracer]:
    """A logarithm to another base."""
    return lambda a: function(a) / function(a._operand(base))


_ONE, _HALF = interval.number(1.0), interval.number(0.5)
KNOWN: dict[str, Callable[..., Tracer]] = {
    "add": lambda a, b: a + b,
    "subtract": lambda a, b: a - b,
    "multiply": lambda a, b: a * b,
    "divide": lambda a, b: a / b,
    "power": lambda a, b: a**b,
    "float_power": lambda a, b: a**b,
    "negative": lambda a: -a,
    "positive": lambda a: a,
    "square": lambda a: a**2,
    "reciprocal": lambda a: 1.0 / a,
    "absolute": abs,
    "fabs": abs,
    "maximum": lambda a, b: a.greatest(b),
    "minimum": lambda a, b: -(-a).greatest(-a._operand(b)),
    "exp": lambda a: a._chain("exp", interval.exponential, interval.exponential),
    "exp2": lambda a: 2.0**a,
    "log": lambda a: a._chain("log", interval.logarithm, interval.reciprocal),
    "hypot": lambda a, b: KNOWN["sqrt"](a**2 + a._operand(b) ** 2).greatest(abs(a)),
    "sqrt": lambda a: a._chain(
        "sqrt",
        interval.root,
        lambda v: interval.product(_HALF, interval.reciprocal(interval.root(v))),
    ),
    "sin": lambda a: a._chain("sin", interval.sine, interval.cosine),
    "cos": lambda a: a._chain(
        "cos", interval.cosine, lambda v: interval.negative(interval.sine(v))
    ),
    "tanh": lambda a: a._chain(
        "tanh",
        interval.hyperbolic_tangent,
        lambda v: interval.total(
            _ONE, interval.negative(interval.power(interval.hyperbolic_tangent(v), 2))
        ),
    ),
    "arctan": lambda a: a._chain(
        "arctan",
        interval.arctangent,
        lambda v: interval.reciprocal(interval.total(_ONE, interval.power(v, 2))),
    ),
}
KNOWN["log10"] = _scaled(KNOWN["log"], 10.0)
KNOWN["log2"] = _scaled(KNOWN["log"], 2.0)
