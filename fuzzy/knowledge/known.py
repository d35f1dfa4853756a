"""Facts about a model that its caller states, and samples that contradict them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from alphacut.fuzzy.sets.numbers import Array, Mask

Signs = NDArray[np.int8]
GradientRange = Callable[[Array, Array], Mapping[str, tuple[Array, Array]]]


@dataclass(frozen=True)
class Known:
    """Facts about a model over the supports of its inputs, taken as proved.

    Args:
        signs: +1 for an input with which every output rises, −1 where every output falls; or such a
            mapping by output, `{"load": {"deflection": 1}}`.
        monotone: Inputs in which every output is monotone while the others are fixed, in whatever
            direction: an output linear in each input alone is, for one. Inputs with a sign need not
            be named again.
        derivatives: For an output, the names of the outputs that hold its derivatives by the
            inputs: `{"E": {"a2": "dE_da2"}}`. They let a plan verify signs at the samples that it
            runs anyway.
        gradient_range: Function of the corners (lower, upper) of a box, two arrays (inputs,), that
            returns for each output (`y` where it has no name) a lower and an upper bound of its
            gradient over the box, two arrays (inputs,): it proves signs box by box.
        source: Where the facts come from, named beside every guarantee that rests on them.
    """

    signs: Mapping[str, int | Mapping[str, int]] = field(default_factory=dict)
    monotone: tuple[str, ...] = ()
    derivatives: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    gradient_range: GradientRange | None = None
    source: str = "as stated by the caller"

    @property
    def words(self) -> tuple[str, ...]:
        """Facts that proofs take as given, one sentence each."""
        told = {
            f"the signs of {', '.join(self.signs)} hold": self.signs,
            f"the outputs are monotone in {', '.join(self.monotone)}": self.monotone,
            "the range of the gradient holds": self.gradient_range,
        }
        return tuple(f"{fact}, {self.source}" for fact, there in told.items() if there)

    def check(self, inputs: Sequence[str]) -> None:
        """Refuse names that are no input and signs that are none.

        Raises:
            ValueError: As said.
        """
        if not isinstance(self.signs, Mapping) or not isinstance(self.derivatives, Mapping):
            raise ValueError(
                f"the signs are {self.signs!r} and the derivatives {self.derivatives!r}; both must"
                " be mappings, as {'x': 1}"
            )
        if not (self.gradient_range is None or callable(self.gradient_range)):
            raise ValueError(
                f"the range of the gradient is {self.gradient_range!r}; it must be a function of"
                " the corners of a box"
            )
        if isinstance(self.monotone, str):
            raise ValueError(
                f"the monotone inputs are {self.monotone!r}; they must be a row of names, as"
                f" ({self.monotone!r},)"
            )
        named = [
            *self.signs,
            *self.monotone,
            *(name for row in self.derivatives.values() for name in row),
        ]
        unknown = sorted(set(named) - set(inputs))
        if unknown:
            swapped = next((x for x in unknown if isinstance(self.signs.get(x), Mapping)), "")
            cure = f"; signs go by input first, as {{'{inputs[0]}': {{'{swapped}': 1}}}}"
            raise ValueError(
                f"what is known of the model names {', '.join(unknown)}; the fuzzy inputs are"
                f" {', '.join(inputs)}{cure if swapped else ''}"
            )
        for name, sign in self.signs.items():
            for value in sign.values() if isinstance(sign, Mapping) else (sign,):
                if value not in (-1, 1):
                    raise ValueError(
                        f"the sign of {name} is {value!r}; it must be 1 (outputs rise with it) or"
                        " -1 (they fall)"
                    )

    def check_outputs(self, outputs: Sequence[str]) -> None:
        """Refuse names that are no output.

        Raises:
            ValueError: As said.
        """
        by_output = [sign for sign in self.signs.values() if isinstance(sign, Mapping)]
        held = [name for row in self.derivatives.values() for name in row.values()]
        unknown = sorted(
            {name for sign in by_output for name in sign}.union(self.derivatives, held)
            - set(outputs)
        )
        if unknown:
            raise ValueError(
                f"what is known of the model names {', '.join(unknown)}; its outputs are"
                f" {', '.join(outputs)}"
            )

    def stated(self, inputs: Sequence[str], outputs: Sequence[str]) -> Signs:
        """Stated signs, 0 where none is, shape (outputs, inputs)."""
        table = np.zeros((len(outputs), len(inputs)), np.int8)
        for name, sign in self.signs.items():
            column = inputs.index(name)
            for row, output in enumerate(outputs):
                table[row, column] = sign.get(output, 0) if isinstance(sign, Mapping) else sign
        return table

    def monotone_in(self, inputs: Sequence[str], outputs: Sequence[str]) -> Mask:
        """Stated monotonicity of each output in each input, shape (outputs, inputs)."""
        named = np.array([name in self.monotone for name in inputs])
        return np.asarray((self.stated(inputs, outputs) != 0) | named)


ROUND_OFF = 1e-11  # of the range and of the largest value: less is no contradiction
_COMPARED = 400  # samples of an output that are compared pair by pair at most
_PAIRS = 2e7  # pairs that are compared over all outputs, about


class Contradiction(NamedTuple):
    """Two samples, (inputs,) each; the second should have the larger output and has not."""

    lesser: Array
    greater: Array
    values: tuple[float, float]

    def told(self, output: str, names: Sequence[str]) -> str:
        """The contradiction in one sentence."""
        places = [
            ", ".join(f"{name} = {x:.6g}" for name, x in zip(names, point, strict=True))
            for point in (self.lesser, self.greater)
        ]
        seen = (
            f"it falls from {self.values[0]:.6g} at {places[0]} to {self.values[1]:.6g} at"
            f" {places[1]}"
        )
        return f"the samples contradict the signs stated of output {output}: {seen}"


def negligible(values: Array) -> Array:
    """Differences of outputs, shape (outputs,), that round-off explains."""
    return np.asarray(ROUND_OFF * (np.ptp(values, axis=0) + np.abs(values).max(axis=0)))


def contradictions(points: Array, values: Array, signs: Signs) -> dict[int, Contradiction]:
    """The two samples that contradict stated signs the most, for each output with some.

    Args:
        points: Samples, shape (n, inputs); of more than 400 some that are spread over the values
            are compared.
        values: Outputs at the samples, shape (n, outputs).
        signs: +1, −1, or 0 where nothing is stated, shape (outputs, inputs); inputs without a sign
            must be equal in both samples.
    """
    stated = np.flatnonzero((signs != 0).any(axis=1)) if len(points) > 1 else np.empty(0, int)
    most = min(_COMPARED, max(16, int((_PAIRS / max(len(stated), 1)) ** 0.5)))
    found = {
        int(column): _contradiction(points, values[:, column], signs[column], most)
        for column in stated
    }
    return {column: against for column, against in found.items() if against}


def _contradiction(points: Array, values: Array, signs: Signs, most: int) -> Contradiction | None:
    rows = np.argsort(values)
    rows = rows[np.unique(np.linspace(0, len(rows) - 1, min(len(rows), most)).astype(int))]
    signed = points[rows][:, signs != 0] * signs[signs != 0]
    ordered = values[rows]
    free = points[rows][:, signs == 0]
    below = np.ones((len(rows),) * 2, bool)
    for column in signed.T:
        below &= column[:, None] <= column[None]
    for column in free.T:
        below &= column[:, None] == column[None]
    fall = np.where(below, ordered[:, None] - ordered[None], 0.0)
    worst = np.unravel_index(fall.argmax(), fall.shape)
    if fall[worst] <= negligible(values[:, None])[0]:
        return None
    one, other = rows[worst[0]], rows[worst[1]]
    return Contradiction(points[one], points[other], (float(values[one]), float(values[other])))
