"""Section on the phases of a mesh of the user's own."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import Field, model_validator

from alphacut.case.types import Loss, ModulusOrStiffness, Quantity, Section
from alphacut.fuzzy import Crisp, FuzzyNumber
from alphacut.fuzzy.refused import require
from alphacut.rve.cell import Phase, VoigtPhase


class PhaseSection(Section):
    """Elastic phase of a mesh."""

    modulus: ModulusOrStiffness = Field(
        description="Young's modulus, or three rows of the plane-strain stiffness"
    )
    poisson: Annotated[float, Quantity(above=-1, below=0.5)] | None = Field(
        default=None, description="Poisson's ratio, beside Young's modulus"
    )
    loss: Loss | None = Field(default=None, description="loss factor tan δ of the stiffness")

    @model_validator(mode="after")
    def _check_ratio(self) -> Self:
        """Refuses a Poisson's ratio beside a stiffness, and Young's modulus without one."""
        isotropic = isinstance(self.modulus, FuzzyNumber)
        value = "without poisson" if self.poisson is None else "with poisson"
        allowed = "poisson beside Young's modulus, none beside a stiffness"
        require(isotropic == (self.poisson is not None), "", value=value, allowed=allowed)
        return self

    def phase(self, modulus: float | None) -> Phase | VoigtPhase:
        """The material, with its Young's modulus in Pa where it is isotropic."""
        if isinstance(self.modulus, VoigtPhase):
            return self.modulus
        assert modulus is not None
        assert self.poisson is not None
        return Phase(modulus, self.poisson)


class MeshedCell(Section):
    """Phases of a mesh from a file, `mesh.file`, by the names of its physical groups."""

    phases: dict[str, PhaseSection] = Field(description="phase of each physical group of volumes")

    @property
    def constants(self) -> dict[str, FuzzyNumber]:
        """Young's moduli by input, as steel_modulus; "scale" = 1 where no phase is isotropic."""
        moduli = {
            f"{name}_modulus": phase.modulus
            for name, phase in self.phases.items()
            if isinstance(phase.modulus, FuzzyNumber)
        }
        return moduli or {"scale": Crisp(1.0)}  # a campaign needs an input

    @property
    def losses(self) -> tuple[tuple[FuzzyNumber, FuzzyNumber | None], ...]:
        """Loss factor of each phase, whose bulk modulus has the same; empty for none."""
        losses = (phase.loss for phase in self.phases.values())
        return tuple((loss, None) for loss in losses if loss is not None)

    @model_validator(mode="after")
    def _check_losses(self) -> Self:
        """Refuses losses of some phases alone."""
        missing = [name for name, phase in self.phases.items() if phase.loss is None]
        complete = len(missing) in (0, len(self.phases))
        key = f"cell.phases.{missing[0]}.loss" if missing else ""
        require(complete, key, value=None, allowed="a loss factor of each phase, 0 for none")
        return self

    @property
    def methods(self) -> tuple[str, ...]:
        """Models that can solve it."""
        return "auto", "prism"

    @property
    def particles(self) -> str:
        """Kind of its particles, in results."""
        return "mesh"

    @property
    def is_fibre(self) -> bool:
        """False: constants along fibres need one round particle."""
        return False

    @property
    def has_series(self) -> bool:
        """False: a file may hold any phases."""
        return False
