"""Volumes of power (Laguerre) cells of spheres in a periodic cube, by Voro++.

Voro++ (Rycroft, Chaos 19, 041111, 2009) is run as a program; Debian's package is voro++.
"""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.refused import FailedError
from alphacut.stochastic.particles.particles import Particles


def cell_volumes(spheres: Particles) -> Array:
    """Volumes of the power (Laguerre) cells of spheres in a periodic cube, in m³, shape (n,).

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
        raise FailedError(
            f"the power cells of {count} spheres fill {volumes.sum():.6f} of the cube, and"
            f" {int((volumes <= 0).sum())} spheres have none",
            "take spheres that do not overlap",
        )
    return volumes * side**3
