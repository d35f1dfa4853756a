"""Sources of discs: simulated packings, a list of circles, or an image."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np

from alphacut.stochastic.errors import UnfitDataError
from alphacut.stochastic.fit.area_weighted import AreaWeighted
from alphacut.stochastic.particles.circles_csv import CircleFile, MeasuredCircles
from alphacut.stochastic.particles.discs import Discs
from alphacut.stochastic.particles.image import SectionImage
from alphacut.stochastic.particles.packing import Packing, packing_seeds
from alphacut.stochastic.tessellation.apollonius import Apollonius, apollonius
from alphacut.stochastic.tessellation.edge_correction import WholeCells, whole_cells

Progress = Callable[[float], None]
PATCHES = 5  # a single section is cut into 5 × 5 patches, drawn as wholes in the bootstrap


@dataclass(frozen=True, eq=False)
class Section:
    """Discs of one section with their cells.

    Args:
        diagram: Apollonius cells.
        whole: Cells that count, and their weights.
        read: What was read of a file; nothing of a packing.
    """

    diagram: Apollonius
    whole: WholeCells
    read: MeasuredCircles

    @property
    def discs(self) -> Discs:
        """The discs."""
        return self.diagram.discs


@dataclass(frozen=True)
class Simulated:
    """Independent packings of one kind.

    Args:
        packing: What each one is to be.
        packings: How many, at least 5 (the bootstrap draws them as wholes).

    Raises:
        ValueError: Fewer than five packings.
    """

    packing: Packing
    packings: int = 20

    def __post_init__(self) -> None:
        if self.packings < 5:
            raise ValueError(
                f"{self.packings} packings were asked for; the bootstrap draws whole packings and"
                " needs 5 or more"
            )

    def sections(
        self, seed: int, *, executor: Executor | None = None, progress: Progress | None = None
    ) -> list[Section]:
        """Every packing with its cells."""
        made: list[Section] = []
        seeds = packing_seeds(seed, self.packings)
        for section in (executor.map if executor else map)(
            _packed, [self.packing] * self.packings, seeds
        ):
            made.append(section)
            if progress:
                progress(len(made) / self.packings)
        return made


@dataclass(frozen=True)
class Measured:
    """One section read from a file of circles or an image.

    Args:
        file: The file.
    """

    file: CircleFile | SectionImage

    def sections(
        self, seed: int, *, executor: Executor | None = None, progress: Progress | None = None
    ) -> list[Section]:
        """The section with its cells; `seed` and `executor` do nothing here."""
        section = _section(self.file.read())
        if progress:
            progress(1.0)
        return [section]


def reduced_radii(sections: list[Section]) -> AreaWeighted:
    """Area-weighted r_n of all whole cells, grouped by section or patch.

    Raises:
        UnfitDataError: A cell is smaller than its disc, so that discs overlap.
    """
    values, weights, groups = [], [], []
    for number, section in enumerate(sections):
        disc, discs = section.whole.disc, section.discs
        values.append(section.diagram.reduced_radii[disc])
        weights.append(section.diagram.areas[disc] * section.whole.weight)
        patch = np.minimum(
            (PATCHES * discs.centres[disc] / discs.size).astype(int), PATCHES - 1
        ) @ (PATCHES, 1)
        groups.append(np.full(len(disc), number) if len(sections) > 1 else patch)
    sample = AreaWeighted.of(
        np.concatenate(values), np.concatenate(weights), np.concatenate(groups)
    )
    if sample.values[-1] > np.sqrt(4 / np.pi):
        raise UnfitDataError(
            f"a cell has r_n = {sample.values[-1]:.4g}, more area of disc than of cell: discs"
            " overlap; mend the data"
        )
    return sample


def _packed(packing: Packing, seed: np.random.SeedSequence) -> Section:
    return _section(MeasuredCircles(packing.make(np.random.default_rng(seed))))


def _section(read: MeasuredCircles) -> Section:
    diagram = apollonius(read.discs)
    return Section(diagram, whole_cells(diagram), read)
