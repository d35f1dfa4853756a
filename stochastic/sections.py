"""Particles of a section or a packing with their cells, and the reduced radii of all cells."""

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


@dataclass(frozen=True, eq=False)
class ParticleCells:
    """Particles of one section or packing with their cells.

    Args:
        particles: All particles.
        counted: Indices of the particles whose cells count, shape (k,).
        cells: Area in m² or volume in m³ of the counted cells, shape (k,).
        weight: Number of cells that each counted cell stands for, shape (k,); 1 in a periodic box.
        diagram: Apollonius cells of discs; None of spheres.
    """

    particles: Particles
    counted: Ints
    cells: Array
    weight: Array
    diagram: Apollonius | None = None

    @property
    def reduced_radii(self) -> Array:
        """Reduced radii r_n = r/a of the counted cells, shape (k,).

        2a is the side of a square or cube as large as the cell.
        """
        sides = self.cells ** (1 / self.particles.shape.dimensions)
        return np.asarray(2 * self.particles.radii[self.counted] / sides)


def with_cells(particles: Particles) -> ParticleCells:
    """Return particles with their cells: Apollonius cells of discs, power cells of spheres.

    In a periodic box all cells count, with the weight 1. In a window cells of discs near the edge
    are left out, large ones more often than small ones. The weight of each counted cell, above 1,
    makes up for that. Spheres must be in a periodic cube.

    Args:
        particles: Discs or spheres, of which none lies inside another one.

    Raises:
        RefusedError: In a window no cell is whole.
        FailedError: Voro++, which makes the cells of spheres, is not installed or fails, a sphere
            has no cell, or the envelope of a disc's walls does not close.
    """
    if particles.shape != DISCS:
        # All cells of a periodic box are whole.
        indices = np.arange(len(particles), dtype=np.intp)
        return ParticleCells(particles, indices, cell_volumes(particles), np.ones(len(particles)))
    # Beyond the edge of a window there are discs that are not known.
    diagram = apollonius(particles)
    counted, weight = counted_cells(diagram)
    return ParticleCells(particles, counted, diagram.areas[counted], weight, diagram)


def reduced_radii(sections: Sequence[ParticleCells]) -> AreaWeighted:
    """Return the reduced radii of all counted cells, weighted by area or volume.

    A reduced radius is the radius of a particle over half the side of a square or cube as large as
    its cell. For the bootstrap the radii are grouped by section, or by 5 × 5 patches (5 × 5 × 5 of
    a cube) if there is a single section.

    Args:
        sections: Particles of one kind with their cells, at least one section.

    Raises:
        RefusedError: A cell is smaller than its particle, which overlaps of particles bring about.
    """
    # Cells of one packing depend on one another, so that the bootstrap must draw packings. Patches
    # of a single section depend on one another along their edges alone.
    if len(sections) == 1:
        groups = [_patches(sections[0])]
    else:
        groups = [np.full(len(section.counted), k) for k, section in enumerate(sections)]
    sample = AreaWeighted.from_values(
        np.concatenate([section.reduced_radii for section in sections]),
        np.concatenate([section.cells * section.weight for section in sections]),
        np.concatenate(groups),
    )
    # The reduced radius of a particle that fills its cell: √(4/π) of discs, (6/π)^(1/3) of spheres
    filled = sections[0].particles.shape.largest
    largest = sample.values[-1]
    cure = "mend the overlaps in the data"
    is_possible = largest <= filled
    require(is_possible, "r_n of a cell", largest, allowed=f"values up to {filled:.4g}", cure=cure)
    return sample


def _patches(section: ParticleCells) -> Ints:
    """Return the patch in which the particle of each counted cell lies, shape (k,).

    A section is divided into 5 × 5 equal patches, a cube into 5 × 5 × 5.

    Args:
        section: Particles with the indices of those whose cells count.

    Returns:
        Numbers from 0 to 24, or to 124; the last coordinate counts fastest.
    """
    per_side = 5
    particles = section.particles
    place = (per_side * particles.centres[section.counted] / particles.size).astype(int)
    # The number of a patch has one digit in base 5 for each axis. A centre on the upper side, as
    # windows may have, belongs to the last patch.
    digits = per_side ** np.arange(len(particles.size))[::-1]
    return np.asarray(np.minimum(place, per_side - 1) @ digits)


def cell_volumes(spheres: Particles) -> Array:
    """Return the volumes of the power (Laguerre) cells of spheres in a periodic cube, in m³, (n,).

    Voro++ (Rycroft, Chaos 19, 041111, 2009) is run as a program; Debian's package is voro++. Its
    volumes have six digits.

    Args:
        spheres: Spheres in a cube; the first side of the box is taken for all.

    Raises:
        FailedError: Voro++ is not installed, the volumes do not add up to that of the cube, or a
            sphere has no cell.
    """
    program = shutil.which("voro++")
    if program is None:
        raise FailedError("cells of spheres need Voro++", "install Debian's package voro++")
    side = float(spheres.size[0])
    count = len(spheres)
    table = np.c_[np.arange(count), spheres.centres / side, spheres.radii / side]
    with TemporaryDirectory() as folder:
        file = Path(folder) / "spheres"
        # In units of the side, with all digits of a double
        np.savetxt(file, table, fmt="%d %.17g %.17g %.17g %.17g")
        # -r: radii follow the centres; -p: periodic; -c: print index and volume; box [0, 1]³
        command = [program, "-r", "-p", "-c", "%i %v", "0", "1", "0", "1", "0", "1", str(file)]
        subprocess.run(command, capture_output=True, check=False)
        output = file.with_suffix(".vol")
        cells = np.loadtxt(output, ndmin=2) if output.is_file() else np.zeros((0, 2))
    volumes = np.zeros(count)
    # Voro++ writes cells in its own order, and none for a sphere that its neighbours cut off.
    volumes[cells[:, 0].astype(int)] = cells[:, 1]
    # Voro++ prints six digits.
    if not (volumes > 0).all() or abs(volumes.sum() - 1) > 1e-5:
        what = f"the power cells of {count} spheres fill {volumes.sum():.6f} of the cube"
        what += f", and {int((volumes <= 0).sum())} spheres have none"
        raise FailedError(what, "take spheres that do not overlap")
    return volumes * side**3
