"""What every solver of the fields has in common: the energy that it may leave."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import ClassVar, Self

from alphacut.rve.image.fields.system import System
from alphacut.stochastic.theta.truncated_normal import Array

LEAST_ACCURATE = 0.1


class ConvergenceError(RuntimeError):
    """The energy asked for is not reached."""


@dataclass(frozen=True)
class Solution:
    """Fields and what they cost.

    Args:
        fields: Shape (tiles, loads, types, rows, columns).
        iterations: Of the slowest system.
    """

    fields: Array
    iterations: int


@dataclass(frozen=True)
class Solver(ABC):
    """A way to fields of little energy.

    Args:
        accuracy: Energy that the fields may lack, relative to the system's scale, in (0, 0.1]; a
            bound of the stiffness is then within three times that of the one of solved fields.
        watch: Called before every iteration of this program's own solver; what it raises ends it.

    Raises:
        ValueError: The accuracy lies outside its range.
    """

    accuracy: float = 3e-6
    watch: Callable[[], None] = field(default=lambda: None, compare=False, repr=False, kw_only=True)
    threads: ClassVar[int] = 1
    """Systems that may be solved at once."""

    def __post_init__(self) -> None:
        if not 0 < self.accuracy <= LEAST_ACCURATE:
            raise ValueError(
                f"the accuracy of the energy is {self.accuracy:g}; it must lie in (0, 0.1]"
            )

    def coarser(self, factor: float) -> Self:
        """The same way with less accuracy, for a start."""
        return replace(self, accuracy=min(LEAST_ACCURATE, factor * self.accuracy))

    @abstractmethod
    def solve(self, system: System) -> Solution:
        """Fields that lack no more than the accuracy says; the system's load is overwritten.

        Raises:
            ConvergenceError: They are not found.
        """
