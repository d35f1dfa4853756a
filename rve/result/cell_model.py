"""What every model of a cell with one particle says of itself, and how finely it is to solve."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import ClassVar, Protocol, Self

from alphacut.rve.cell.cell import AnyPhase
from alphacut.rve.cell.lattice import Arrangement
from alphacut.rve.cell.outline import Outline, circle
from alphacut.rve.result.result import HomogenisedStiffness
from alphacut.stochastic import RadiusMap, ThetaDistribution


@dataclass(frozen=True)
class Resolution:
    """How finely a cell is solved, and what beside its stiffness is wanted.

    A model takes what concerns it.

    Args:
        tolerance: Relative error of E that is allowed; None for the default of the model.
        mesh_size: Edge length of elements, in halves of the cell's side.
        layers: Layers of prisms along θ.
        outline: Distance of the particle's edge from its centre over r(θ), by the angle.
        lattice: Arrangement of the particles, "square", "hexagonal" or the sides of a rectangle.
        whole_stiffness: Whether C11 − C12 is needed beside C11 + C12 and C33.
        energies: Whether the strain energies of the phases are needed, for loss factors.
        petsc: PETSc options without their prefix `rve_`.
        parallel: Whether all MPI ranks work on one cell together.
        estimate: Whether to declare errors that take a reference solution.
    """

    tolerance: float | None = None
    mesh_size: float = 0.15
    layers: int = 12
    outline: Outline = circle
    lattice: Arrangement = "square"
    whole_stiffness: bool = False
    energies: bool = False
    petsc: Mapping[str, str] = field(default_factory=dict)
    parallel: bool = False
    estimate: bool = True


class AnyModel(Protocol):
    """What every model of a cell says of itself: a frozen dataclass of its resolution.

    A model inherits from one of the two protocols below, and with it what most models say.

    Attributes:
        name: Word for the model in results and cases.
        convention: Words for the average of the stiffness that its E and ν are of.
    """

    name: ClassVar[str]
    convention: ClassVar[str]

    @property
    def errors_by_reference(self) -> bool:
        """Whether declared errors take a reference solution.

        A campaign takes such errors at the nominal inputs alone.
        """
        return False

    @property
    def is_exact(self) -> bool:
        """Whether errors are so small that signs hold which mechanics proves of exact cells."""
        return False

    @property
    def solver_text(self) -> str:
        """How finite elements are assembled and solved, in words; empty where there are none."""
        return ""

    def for_samples(self, moduli: tuple[float, float] | None, *, energies: bool) -> Self:
        """Return the model for many samples of one cell.

        It declares no error that takes a reference solution. This default returns the model itself;
        models that can save work return another one.

        Args:
            moduli: Smallest and largest Young's modulus of the particle in Pa, if samples differ in
                it; else None. A model may solve for a few moduli in this range and interpolate.
            energies: Whether the strain energies of the phases are needed, for loss factors.
        """
        return self

    def coarser(self) -> Self:
        """Return a model that is cheaper and less accurate, to test bounds by."""
        return self


class CellModel(AnyModel, Protocol):
    """A model of the cell with one particle, whose phases are matrix and inclusion."""

    @classmethod
    def with_resolution(cls, resolution: Resolution) -> Self:
        """Return the model that a resolution asks for."""

    def solve(
        self, radius_map: RadiusMap, matrix: AnyPhase, inclusions: Sequence[AnyPhase]
    ) -> list[HomogenisedStiffness]:
        """Return the homogenised stiffness for each of `inclusions`, in their order."""


class NamedPhasesModel(AnyModel, Protocol):
    """A model of a mesh or level set of the user's own, whose phases have names."""

    def solve(
        self, law: ThetaDistribution, phases: Mapping[str, AnyPhase]
    ) -> list[HomogenisedStiffness]:
        """Return the homogenised stiffness, one result in a list."""
