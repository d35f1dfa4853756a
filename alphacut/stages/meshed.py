"""A mesh of the user's own as the cell: its phases at crisp values, and its model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from alphacut.case.material import Mesh, MeshedCell
from alphacut.case.radius import ThetaSection
from alphacut.fuzzy.refused import RefusedError
from alphacut.io.problem import missing
from alphacut.rve.cell.cell import Phase, VoigtPhase
from alphacut.stochastic import TruncatedNormal

if TYPE_CHECKING:
    from alphacut.rve.prism.own_mesh import MeshModel
    from alphacut.rve.result.result import HomogenisedStiffness


@dataclass(frozen=True)
class MeshedSample:
    """Law of θ and phase of each physical group."""

    law: TruncatedNormal
    phases: Mapping[str, Phase | VoigtPhase]


def sample_at(values: Mapping[str, float], law: ThetaSection, cell: MeshedCell) -> MeshedSample:
    """The sample at crisp values of the inputs, in SI."""
    phases = {
        name: phase.phase(values.get(f"{name}_modulus")) for name, phase in cell.phases.items()
    }
    return MeshedSample(law.law, phases)


def modal_sample(law: ThetaSection, cell: MeshedCell) -> MeshedSample:
    """The sample at the modal values."""
    return sample_at({name: x.modal for name, x in cell.constants.items()}, law, cell)


def solve_samples(model: MeshModel, samples: Sequence[MeshedSample]) -> list[HomogenisedStiffness]:
    """One result for each sample, in their order."""
    return [model.solve(sample.law, sample.phases)[0] for sample in samples]


def require_mesh(mesh: Mesh, law: ThetaSection, cell: MeshedCell) -> None:
    """Refuses a mesh file that is no periodic cell of prisms, or does not fit [cell.phases]."""
    try:
        from alphacut.rve.mesh.file import read_grid
        from alphacut.rve.mesh.periodicity import MeshError
        from alphacut.rve.prism.own_mesh import mesh_phases
    except ImportError as error:
        raise RefusedError("mesh.file", mesh.file, "no mesh", missing(error)) from None
    assert mesh.file is not None
    try:
        grid = read_grid(mesh.file)
    except MeshError as error:
        raise RefusedError("mesh.file", Path(mesh.file).name, error.what, error.cure) from None
    sample = modal_sample(law, cell)
    mesh_phases(grid, sample.law, sample.phases)  # refuses what does not fit
