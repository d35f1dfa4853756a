"""Storey frame whose columns or masses are alike but not equal: a fuzzy field over its height."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from alphacut.frame.calculus.jet import Array, Jet
from alphacut.frame.structures.linear import Matrices
from alphacut.frame.structures.storey import StoreyFrame
from alphacut.frame.structures.storey_springs import Ends
from alphacut.fuzzy.field import FuzzyField


@dataclass(frozen=True, kw_only=True)
class FieldFrame(StoreyFrame):
    """A frame with the directions of a field, each in [-1, 1], in place of some parameters.

    Args:
        field: Values of the storeys, named "c" (columns), "k" (stiffness, where it is given) or "m"
            (masses of the floors); its places are as many as floors.

    Raises:
        ValueError: As `StoreyFrame`; or the field is no such one, or reaches 0.
    """

    field: FuzzyField

    def __post_init__(self) -> None:
        known = ("k" if len(self.stiffness) else "c", "m")
        if self.field.name not in known or len(self.field.places) != self.floors:
            raise ValueError(
                f"field {self.field.name}: it has {len(self.field.places)} places; it must be"
                f" named {' or '.join(known)} and have {self.floors}, one for each floor"
            )
        if not self.field.centre > self.field.half_width:
            raise ValueError(f"field {self.field.name}: its values must be positive; narrow it")
        super().__post_init__()

    @property
    def parameters(self) -> dict[str, float]:
        """All parameters with their modal values; the directions stand for those of the field."""
        own = {k: x for k, x in super().parameters.items() if k not in self._replaced}
        return {**own, **dict.fromkeys(self.field.names, 0.0)}

    def group(self, name: str) -> tuple[str, ...]:
        """Parameters of a short name, as of a `StoreyFrame`; the field's are its directions."""
        return self.field.names if name == self.field.name else super().group(name)

    def ranges(self, ends: Ends) -> dict[str, tuple[float, float]]:
        """Lower and upper end of the values of floors and storeys over a box of parameters."""
        along = np.array([ends.get(name, (0.0, 0.0)) for name in self.field.names])
        parts = self._parts
        middle = self.field.centre + parts @ along.mean(1)
        reach = np.abs(parts) @ (np.diff(along)[:, 0] / 2)
        both = zip(
            self._replaced, (middle - reach).tolist(), (middle + reach).tolist(), strict=True
        )
        return super().ranges(ends) | {name: (low, high) for name, low, high in both}

    def matrices(self, p: Mapping[str, Jet]) -> Matrices:
        """M, D, K and the initial state, at S parameter sets."""
        return super().matrices(self._with_places(p))

    def observation(self, p: Mapping[str, Jet]) -> Jet:
        """Rows C(p) with output = C(p) [q; v], shape (S, outputs, 2n)."""
        return super().observation(self._with_places(p))

    @property
    def _replaced(self) -> Sequence[str]:
        return [f"{self.field.name}{z + 1}" for z in range(self.floors)]

    @property
    def _parts(self) -> Array:
        """What each direction adds to each place, shape (places, directions)."""
        return np.asarray(self.field.half_width * self.field.free_shapes)

    def _with_places(self, p: Mapping[str, Jet]) -> dict[str, Jet]:
        """The parameters with the field's value at each floor."""
        if self._replaced[0] in p:  # from `observation`, which asks for matrices
            return dict(p)
        along = [p[name] for name in self.field.names]
        found = dict(p)
        parts = self._parts
        for floor, name in enumerate(self._replaced):
            value = self.field.centre + 0.0 * along[0]
            for k, direction in enumerate(along):
                value = value + float(parts[floor, k]) * direction
            found[name] = value
        return found
