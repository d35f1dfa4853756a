"""The memory that the solution of a grid takes, against which sizes are held that files promise."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence

from alphacut.base.errors import RefusedError

IN_FILES = 150**3
"""Voxels from which on finished fields wait in files of the folder of temporary files."""


def is_large(shape: Sequence[int], division: int = 1) -> bool:
    """Return whether finished fields of a volume wait in files, and its sides for each other."""
    return len(shape) == 3 and math.prod(shape) * division**3 >= IN_FILES


def _bytes_per_element(shape: Sequence[int], division: int) -> float:
    """Return the memory of an element in the solutions of all cuts with their first guess."""
    # Measured within 1.25 of peaks at 128² … 512² pixels of two elements a side, 512² and 1024² of
    # one, and 64³ … 128³ voxels. With files 460 of solids, and 1040 beside pores.
    if is_large(shape, division):
        return 1050.0
    return {2: 1450.0, 3: 1600.0}[len(shape)]


def needed_memory(shape: Sequence[int], division: int = 1) -> float:
    """Return the estimated bytes of memory that the bounds of an image take, at all α-levels.

    Args:
        shape: Number of pixels along y and x, or of voxels along z, y and x; a KeyError for any
            other number of axes.
        division: Number of finite elements along each side of a pixel or voxel.
    """
    program = 1e8  # of Python and its libraries, which are small beside any grid that matters
    elements = math.prod([n * division for n in shape])
    return program + _bytes_per_element(shape, division) * elements


def require_memory(shape: Sequence[int], division: int = 1) -> None:
    """Refuse a grid whose solution needs more memory than this machine has.

    Args:
        shape: Number of pixels along y and x, or of voxels along z, y and x.
        division: Number of finite elements along each side of a pixel or voxel.

    Raises:
        RefusedError: The grid is too large; the message names a size that fits.
    """
    available = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    needed = needed_memory(shape, division)
    # The memory of the machine counts, so that the answer is the same at every run. What is free
    # now counts where a file is read.
    if needed > available:
        n = len(shape)
        side = int((available / _bytes_per_element(shape, division)) ** (1 / n) / division)
        cells = {2: "pixels", 3: "voxels"}[n]
        what = f"{' × '.join(map(str, shape))} {cells}"
        allowed = f"up to {available / 1e9:.0f} GB of memory"
        cure = f"crop a piece of {' × '.join([str(side)] * n)}"
        raise RefusedError("image", f"{what}, about {needed / 1e9:.0f} GB", allowed, cure)
