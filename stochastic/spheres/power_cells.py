"""Power (Laguerre) cells of spheres in a periodic cube, by Voro++, and their reduced radii.

Voro++ (Rycroft, Chaos 19, 041111, 2009) is run as a program; Debian's package is voro++.
"""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from alphacut.stochastic.errors import RefusedError
from alphacut.stochastic.fit.area_weighted import SPHERES, AreaWeighted
from alphacut.stochastic.spheres.spheres import Spheres
from alphacut.stochastic.theta.truncated_normal import Array


def voro() -> str:
    """Path of the program Voro++.

    Raises:
        RefusedError: It is not installed.
    """
    program = shutil.which("voro++")
    if program is None:
        raise RefusedError("cells of spheres need Voro++: install Debian's package voro++")
    return program


def cell_volumes(spheres: Spheres) -> Array:
    """Volumes of the power cells in m³, shape (n,); they fill the cube.

    Raises:
        RefusedError: Voro++ is not installed or fails, or a sphere has no cell.
    """
    program = voro()
    count = len(spheres.radii)
    inside, radii = spheres.centres / spheres.side, spheres.radii / spheres.side
    with TemporaryDirectory() as folder:
        file = Path(folder) / "spheres"
        np.savetxt(file, np.c_[np.arange(count), inside, radii], fmt="%d %.17g %.17g %.17g %.17g")
        command = [program, "-r", "-p", "-c", "%i %v", *"010101", str(file)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        made = file.with_name("spheres.vol")
        if done.returncode or not made.is_file():
            raise RefusedError(f"Voro++ fails: {done.stderr.strip() or done.stdout.strip()}")
        found = np.loadtxt(made, ndmin=2)
    volumes = np.zeros(count)
    volumes[found[:, 0].astype(int)] = found[:, 1]
    if not (volumes > 0).all() or abs(volumes.sum() - 1) > 1e-6:
        raise RefusedError(
            f"the power cells of {count} spheres fill {volumes.sum():.6f} of the cube, and"
            f" {int((volumes <= 0).sum())} spheres have none: do they overlap?"
        )
    return volumes * spheres.side**3


def reduced_radii(
    packings: Sequence[Spheres], cells: Sequence[Array] | None = None
) -> AreaWeighted:
    """Volume-weighted r_n = r / (V^⅓/2) of all cells, one group a packing.

    The cube of the cell's volume has the side 2 in its own units, so that π/6 Σ w r_n³ is the
    volume fraction.

    Args:
        packings: Spheres in their cubes.
        cells: Volumes of the power cells of each; found if None.
    """
    volumes = np.concatenate([*map(cell_volumes, packings)] if cells is None else cells)
    radii = np.concatenate([packing.radii for packing in packings])
    groups = np.repeat(np.arange(len(packings)), [len(packing.radii) for packing in packings])
    return AreaWeighted.of(2 * radii / np.cbrt(volumes), volumes, groups)


def volume_fraction(sample: AreaWeighted) -> float:
    """Σ w π/6 r_n³ of a volume-weighted sample."""
    return float(sample.weights @ SPHERES.shares(sample.values))
