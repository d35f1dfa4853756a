"""What every analysis asks of a structure; the kinds of structures derive from it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from enum import Enum
from typing import TYPE_CHECKING, NamedTuple, Self

from alphacut.base.errors import RefusedError, require_choice
from alphacut.frame.records.history import Accelerogram, History
from alphacut.frame.structures.loads import Force
from alphacut.frame.structures.quantities import Output, Parameter


class Dynamics(Enum):
    """How the response follows from the equations of motion, which says what can be asked."""

    LINEAR = "linear"
    """M q̈ + D q̇ + K q = loads: solved exactly between the samples of loads, with proofs."""
    YIELDING = "linear until columns yield"
    """Solved exactly from one event to the next; peaks are searched for, not proved."""
    SMOOTH = "nonlinear and smooth"
    """Integrated by midpoint steps, with estimated errors."""


class PlacedForce(NamedTuple):
    """A force of a case on one degree of freedom.

    Args:
        place: Index of the degree of freedom, from 0: a floor, or an unknown of matrices.
        amplitude: Nominal amplitude, in N, or in N s of an impulse.
        history: Its course over time; None for an impulse at t = 0.
    """

    place: int
    amplitude: float
    history: History | None


class StructureModel:
    """Base of all structures: a frozen dataclass of nominal values, all in SI units.

    A kind of structure gives `dynamics`, `parameters` and `outputs`, and what its dynamics need. It
    overrides the other members where it knows more than is said here.
    """

    if TYPE_CHECKING:  # else dataclasses would take a property for the default of their field

        @property
        def parameters(self) -> Mapping[str, float]:
            """All parameters with their nominal values."""

        @property
        def outputs(self) -> tuple[str, ...]:
            """Names of the observed quantities, an `Output` where the unit is known."""

    @property
    def dynamics(self) -> Dynamics:
        """How the response follows from the equations of motion."""
        raise NotImplementedError

    @property
    def floors(self) -> int:
        """Number of floors of a storey frame, 0 of other structures."""
        return 0

    @property
    def ground(self) -> Accelerogram | None:
        """Base excitation, if any; the displacements are then relative to the ground."""
        return None

    @property
    def loads(self) -> Sequence[Force]:
        """Forces on the structure."""
        return ()

    def parameter(self, name: str) -> Parameter:
        """Return a parameter with the unit and the range that are known of it."""
        return Parameter(name)

    def group(self, name: str) -> tuple[str, ...]:
        """Return the names of the parameters that a short name stands for, as "m" for all masses.

        Structures in general have no short names, so that this is the name itself, alone. Kinds of
        structures with short names override it.

        Raises:
            RefusedError: There is no such parameter.
        """
        require_choice("parameter", name, self.parameters)
        return (name,)

    def require_quantity(self, name: str) -> None:
        """Raise RefusedError if the structure cannot have such an output, observed or not."""
        require_choice("output", name, self.outputs)

    def with_outputs(self, names: Sequence[str]) -> Self:
        """Return the structure for an analysis of some of its outputs.

        Structures in general cannot leave out the other outputs, so that this is the structure
        itself, unchanged. Kinds that can override it.

        Args:
            names: Names of the outputs that are needed.

        Raises:
            RefusedError: The structure has no such output.
        """
        for name in names:
            self.require_quantity(name)
        return self

    def unit_of(self, output: str) -> str:
        """Return the SI unit of an output, observed or of the kind of a storey frame's."""
        return Output(next((name for name in self.outputs if name == output), output)).unit

    def with_forces(self, forces: Sequence[PlacedForce]) -> tuple[Self, tuple[str, ...]]:
        """Return the structure under forces, and the names of their amplitudes.

        Structures in general take no forces, so that this always raises. Kinds that do override it:
        the amplitudes become parameters, whose names are returned in the order of `forces`.

        Raises:
            RefusedError: The structure takes no forces.
        """
        value = f"on a {type(self).__name__}"
        raise RefusedError("force", value, "structures that have forces, [frame] and [matrices]")

    def require_standing(self, ends: Mapping[str, tuple[float, float]]) -> None:
        """Refuse a box of parameters somewhere in which the structure cannot stand.

        Args:
            ends: Lower and upper end of parameters by name; others are nominal.
        """
