"""Particles of a section or a packing with their cells, and the reduced radii of all."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.base.errors import FailedError, require
from alphacut.stochastic.fit.area_weighted import AreaWeighted
from alphacut.stochastic.particles.particles import Particles
from alphacut.stochastic.particles.shapes import DISCS
from alphacut.stochastic.tessellation.apollonius import Apollonius, apollonius, counted_cells

PATCHES = 5  # a single section is cut into 5 × 5 patches, which the bootstrap draws


@dataclass(frozen=True, eq=False)
class ParticleCells:
    """Particles of one section or packing with their cells.

    Args:
        particles: All particles.
        counted: Indices of the particles whose cells count, shape (k,).
        cells: Area in m² or volume in m³ of these cells, shape (k,).
        weight: Cells that each stands for, shape (k,); 1 in a periodic box.
        diagram: Apollonius cells of discs; None of spheres.
    """

    particles: Particles
    counted: Ints
    cells: Array
    weight: Array
    diagram: Apollonius | None = None

    @property
    def reduced_radii(self) -> Array:
        """Values r_n = r/a of the counted cells, 2a the side of a square or cube as large."""
        sides = self.cells ** (1 / self.particles.shape.dimensions)
        return np.asarray(2 * self.particles.radii[self.counted] / sides)


def with_cells(particles: Particles) -> ParticleCells:
    """Return particles with their cells: Apollonius cells of discs, power cells of spheres.

    Cells near the edge of a window are left out and others weighted instead (`counted_cells`).
    """
    if particles.shape != DISCS:
        indices = np.arange(len(particles), dtype=np.intp)
        return ParticleCells(particles, indices, cell_volumes(particles), np.ones(len(particles)))
    diagram = apollonius(particles)
    counted, weight = counted_cells(diagram)
    return ParticleCells(particles, counted, diagram.areas[counted], weight, diagram)


def reduced_radii(sections: Sequence[ParticleCells]) -> AreaWeighted:
    """Sample of r_n of all counted cells, weighted by area or volume, grouped for the bootstrap.

    A group is a section, or one of 5 × 5 patches if there is a single section. A cell smaller than
    its particle is refused.
    """
    if len(sections) == 1:
        particles, counted = sections[0].particles, sections[0].counted
        patch = (PATCHES * particles.centres[counted] / particles.size).astype(int)
        base = PATCHES ** np.arange(len(particles.size))[::-1]
        groups = [np.minimum(patch, PATCHES - 1) @ base]
    else:
        groups = [np.full(len(section.counted), k) for k, section in enumerate(sections)]
    sample = AreaWeighted.from_values(
        np.concatenate([section.reduced_radii for section in sections]),
        np.concatenate([section.cells * section.weight for section in sections]),
        np.concatenate(groups),
    )
    full, largest = sections[0].particles.shape.largest, sample.values[-1]
    allowed, cure = f"values up to {full:.4g}", "mend the overlaps in the data"
    require(largest <= full, "r_n of a cell", value=largest, allowed=allowed, cure=cure)
    return sample


def cell_volumes(spheres: Particles) -> Array:
    """Volumes of the power (Laguerre) cells of spheres in a periodic cube, in m³, shape (n,).

    Voro++ (Rycroft, Chaos 19, 041111, 2009) is run as a program; Debian's package is voro++.

    Raises:
        FailedError: Voro++ is not installed or fails, or a sphere has no cell.
    """
    program = shutil.which("voro++")
    if program is None:
        raise FailedError("cells of spheres need Voro++", "install Debian's package voro++")
    side, count = float(spheres.size[0]), len(spheres)
    table = np.c_[np.arange(count), spheres.centres / side, spheres.radii / side]
    with TemporaryDirectory() as folder:
        file = Path(folder) / "spheres"
        np.savetxt(file, table, fmt="%d %.17g %.17g %.17g %.17g")
        command = [program, "-r", "-p", "-c", "%i %v", *"010101", str(file)]
        subprocess.run(command, capture_output=True, check=False)
        output = file.with_suffix(".vol")
        cells = np.loadtxt(output, ndmin=2) if output.is_file() else np.zeros((0, 2))
    volumes = np.zeros(count)
    volumes[cells[:, 0].astype(int)] = cells[:, 1]
    if not (volumes > 0).all() or abs(volumes.sum() - 1) > 1e-5:  # Voro++ prints six digits
        what = f"the power cells of {count} spheres fill {volumes.sum():.6f} of the cube"
        what += f", and {int((volumes <= 0).sum())} spheres have none"
        raise FailedError(what, "take spheres that do not overlap")
    return volumes * side**3
