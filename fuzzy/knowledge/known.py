"""Knowledge about a model, stated by its caller, and samples that contradict it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from alphacut.base.arrays import Array
from alphacut.base.errors import checked_number, require, require_choice

Signs = NDArray[np.int8]


@dataclass(frozen=True)
class Knowledge:
    """Facts about a model over the supports of its inputs, which proofs take as given.

    Args:
        signs: +1 for an input with which all outputs rise, −1 where all fall; or such a mapping by
            output, `{"load": {"deflection": 1}}`.
        source: Where the facts come from, named beside the guarantees that rest on them.
        tests: Points of each cut at which a guarantee is tested, as far as the budget goes.

    Raises:
        RefusedError: A sign is neither 1 nor −1, or the number of tests no whole number.

    Example:
        >>> Knowledge(signs={"load": 1}, source="by statics").words
        'the signs of load hold, by statics'
    """

    signs: Mapping[str, int | Mapping[str, int]] = field(default_factory=dict)
    source: str = "as stated by the caller"
    tests: int = 16

    def __post_init__(self) -> None:
        checked_number("tests", self.tests, whole=True)
        for name, sign in self.signs.items():
            by_output = sign if isinstance(sign, Mapping) else {"all": sign}
            for value in by_output.values():
                allowed = "1 (rises), -1 (falls)"
                require(value in (-1, 1), f"sign of {name}", value=value, allowed=allowed)

    @property
    def words(self) -> str:
        """The facts as a sentence."""
        return f"the signs of {', '.join(self.signs)} hold, {self.source}"

    def check_inputs(self, inputs: Iterable[str]) -> None:
        """Refuse names that are no input."""
        for name in self.signs:
            require_choice("input of knowledge", name, inputs)

    def check_outputs(self, outputs: Iterable[str]) -> None:
        """Refuse names that are no output."""
        for sign in self.signs.values():
            if isinstance(sign, Mapping):
                for name in sign:
                    require_choice("output of knowledge", name, outputs)

    def stated_signs(self, inputs: Sequence[str], outputs: Sequence[str]) -> Signs:
        """Return the stated signs as an array of shape (outputs, inputs).

        An entry is +1 where the output rises with the input, −1 where it falls, and 0 where the
        field `signs` states nothing. A sign that is stated for an input without naming an output
        holds for all outputs.

        Args:
            inputs: Names of all inputs, in the order of the columns.
            outputs: Names of the outputs, in the order of the rows. Signs of other outputs are left
                out.

        Raises:
            ValueError: A sign is stated for an input that is not among `inputs`.
        """
        table = np.zeros((len(outputs), len(inputs)), np.int8)
        for name, sign in self.signs.items():
            column = inputs.index(name)
            if isinstance(sign, Mapping):
                table[:, column] = [sign.get(output, 0) for output in outputs]
            else:
                table[:, column] = sign
        return table


def negligible(values: Array) -> Array:
    """Return the largest difference of each output that rounding explains, shape (outputs,).

    The output's range over the samples and its largest magnitude there are added, and multiplied by
    1e-11: models add up thousands of rounding errors of 1e-16.

    Args:
        values: Values of samples, shape (n, outputs), n ≥ 1.
    """
    return np.asarray(1e-11 * (np.ptp(values, axis=0) + np.abs(values).max(axis=0)))


def contradiction(points: Array, values: Array, signs: Signs) -> tuple[Array, Array] | None:
    """Return the pair of samples that contradicts the signs of an output most, None without one.

    By the signs the output cannot be smaller at the second point than at the first one, but it is,
    by more than rounding. Only pairs count in which all inputs without a sign are equal.

    Args:
        points: Samples, shape (n, inputs), n ≥ 1. Of more than 400 only 400 are compared, which are
            spread evenly over the values in their rising order.
        values: Values of the output at the samples, shape (n,).
        signs: For each input +1 if the output rises with it, −1 if it falls, 0 if nothing is known,
            shape (inputs,).

    Returns:
        Inputs of the first and of the second sample, two arrays of shape (inputs,).
    """
    # All pairs of 400 samples are 160,000 rows of inputs; more samples would take much memory.
    max_samples = 400
    rows = np.argsort(values)
    evenly = np.linspace(0, len(rows) - 1, min(len(rows), max_samples)).astype(int)
    rows = rows[np.unique(evenly)]

    # If no input steps against its sign on the way from sample i to sample j, the output may not
    # fall: the inputs can be changed one after another, and none of these steps lets it fall. Entry
    # (i, j) of the arrays below is for the way from i to j.
    point_steps = points[rows][None] - points[rows][:, None]
    signed_steps = point_steps * np.where(signs, signs, 1)
    is_allowed_step = (signed_steps >= 0) & ((signs != 0) | (signed_steps == 0))
    may_not_fall = is_allowed_step.all(axis=2)
    falls = values[rows][:, None] - values[rows][None]
    forbidden_falls = np.where(may_not_fall, falls, 0.0)
    first, second = np.unravel_index(forbidden_falls.argmax(), forbidden_falls.shape)
    if forbidden_falls[first, second] <= negligible(values[:, None])[0]:
        return None
    return points[rows[first]], points[rows[second]]
