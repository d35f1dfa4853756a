"""Enclosures of functions that are written in arithmetic and numpy's functions.

The function is called as it stands, with tracers in place of numbers; what comes back holds, for
sure, every value and every slope that its arithmetic takes over a box. A call proves nothing where
something could not be enclosed, whatever the function caught, where the function takes another path
through its lines with numbers than with tracers, or does another arithmetic than in its first call.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import NamedTuple, cast

import numpy as np

from alphacut.fuzzy.knowledge.interval_arithmetic import Pair
from alphacut.fuzzy.knowledge.tracer import KNOWN, Trace, Tracer, asks_for_types, path, same_path
from alphacut.fuzzy.sets.numbers import Array

Function = Callable[..., object]
_CURE = f"write it in arithmetic and numpy's {', '.join(sorted(KNOWN))} and clip, without branches"


class Enclosure(NamedTuple):
    """Values and slopes of one output over n boxes of k inputs.

    Args:
        value: Least and greatest value, two arrays (n,).
        slope: Least and greatest derivative by every input, two arrays (k, n).
    """

    value: Pair
    slope: Pair


class Enclosed:
    """A function under enclosure.

    Args:
        function: Gets the inputs by name and returns a value or a mapping of names to values, by
            arithmetic and numpy's functions.
        names: Names of the inputs.
    """

    def __init__(self, function: Function, names: Sequence[str]) -> None:
        self.function, self.names = function, tuple(names)
        self._steps: list[tuple[object, ...]] | None = None

    def __call__(self, lower: Array, upper: Array) -> dict[str, Enclosure]:
        """Every output over boxes.

        Args:
            lower: Lower corners of the boxes, shape (n, inputs).
            upper: Upper corners, shape (n, inputs).

        Returns:
            The enclosure of each output by name; `y` where it has none, `y[0]`, `y[1]`, … where it
            is a list.

        Raises:
            ValueError: The function does something that has no enclosure.
        """
        if self._steps is None:
            self._require_one_path(lower, upper)
        trace, outputs = self._traced(lower, upper)
        if self._steps is None:
            self._steps = trace.steps
        if trace.steps != self._steps:
            raise _refused("it does other arithmetic than in its first call")
        return outputs

    def _require_one_path(self, lower: Array, upper: Array) -> None:
        """The function runs the same lines with numbers, alone or in arrays, as with tracers."""
        middle = (lower[0] + upper[0]) / 2
        self._traced(lower[:1], upper[:1])  # what it does once only is done
        traced = path(lambda: self._traced(lower[:1], upper[:1]))[1]
        if asking := asks_for_types(traced):
            raise _refused(f"{asking} asks for the type of something")
        for values in (map(float, middle), np.split(middle, len(middle))):
            point = dict(zip(self.names, values, strict=True))
            try:
                numbers = path(partial(self.function, **point))[1]
            except Exception:
                continue  # the model says what is wrong, if it is called in this way
            if not same_path(traced, numbers):
                raise _refused("it runs other lines with numbers than under enclosure")

    def _traced(self, lower: Array, upper: Array) -> tuple[Trace, dict[str, Enclosure]]:
        trace = Trace()
        unit = np.eye(len(self.names))[:, :, None] * np.ones(len(lower))
        inputs = {
            name: Tracer(trace, trace.step(name), (lower[:, i], upper[:, i]), (unit[i], unit[i]))
            for i, name in enumerate(self.names)
        }
        try:
            output = self.function(**inputs)
        except Exception as error:
            raise _refused(trace.reason or f"{type(error).__name__}: {error}") from error
        if trace.reason:
            raise _refused(trace.reason)
        try:
            like = next(iter(inputs.values()))
            outputs = {key: like._operand(one) for key, one in _entries("", output)}
        except TypeError as error:
            raise _refused(str(error)) from error
        trace.step(*((key, one._index) for key, one in outputs.items()))
        return trace, {key: Enclosure(one._value, one._slope) for key, one in outputs.items()}


def _refused(reason: str) -> ValueError:
    return ValueError(f"the function cannot be enclosed ({reason}); {_CURE}")


def _entries(name: str, value: object) -> Iterator[tuple[str, object]]:
    """The entries of an output with their names; the output itself where it is no list.

    Its type is looked at without asking, since a tracer has no answer.
    """
    kind = type(value)
    if issubclass(kind, Mapping) and not name:
        for key, entry in cast("Mapping[object, object]", value).items():
            yield from _entries(str(key), entry)
    elif issubclass(kind, list | tuple) or (
        issubclass(kind, np.ndarray) and np.ndim(cast("Array", value))
    ):
        for i, entry in enumerate(cast("Sequence[object]", value)):
            yield from _entries(f"{name or 'y'}[{i}]", entry)
    else:
        yield name or "y", cast("Array", value)[()] if issubclass(kind, np.ndarray) else value


def gradient_range(
    function: Function, names: Sequence[str]
) -> Callable[[Array, Array], Mapping[str, Pair]]:
    """Range of the gradient for `Known.gradient_range`, proved from the model's own arithmetic."""
    enclosed = Enclosed(function, names)

    def ranges(lower: Array, upper: Array) -> Mapping[str, Pair]:
        found = enclosed(lower[None], upper[None])
        return {name: (one.slope[0][:, 0], one.slope[1][:, 0]) for name, one in found.items()}

    return ranges
