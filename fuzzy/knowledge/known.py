"""Facts about a model that its caller states, on which guaranteed bounds rest."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

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
