"""What every solver of the fields has in common: the energy that it may leave."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field, replace
from hashlib import sha256
from pathlib import Path
from typing import ClassVar, Self
from zipfile import BadZipFile

import numpy as np

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
        kept: Folder where fields are kept for the same systems solved again; None keeps none.

    Raises:
        ValueError: The accuracy lies outside its range.
    """

    accuracy: float = 3e-6
    watch: Callable[[], None] = field(default=lambda: None, compare=False, repr=False, kw_only=True)
    kept: Path | None = field(default=None, compare=False, repr=False, kw_only=True)
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

    def found(self, system: System) -> Solution:
        """As `solve`, whose fields are kept; those kept before are taken."""
        if self.kept is None:
            return self.solve(system)
        file = self.kept / f"{self._name(system)}.npz"
        try:
            with np.load(file, allow_pickle=False) as stored:
                return Solution(stored["fields"], int(stored["iterations"]))
        except (OSError, ValueError, KeyError, EOFError, BadZipFile):
            solution = self.solve(system)
        partial = file.with_suffix(".begun")
        try:
            self.kept.mkdir(parents=True, exist_ok=True)
            with partial.open("wb") as stream:
                np.savez(stream, fields=solution.fields, iterations=np.array(solution.iterations))
            partial.replace(file)
        except OSError:  # a full disk does not end what goes on without it
            with suppress(OSError):
                partial.unlink()
        return solution

    def _name(self, system: System) -> str:
        digest = sha256(repr((self, type(system.operator))).encode())
        start = () if system.start is None else (system.start,)
        for array in (*system.origin, system.load, system.scale, system.least, *start):
            digest.update(repr(array.shape).encode() + array.tobytes())
        return digest.hexdigest()[:24]

    @abstractmethod
    def solve(self, system: System) -> Solution:
        """Fields that lack no more than the accuracy says; the system's load is overwritten.

        Raises:
            ConvergenceError: They are not found.
        """
