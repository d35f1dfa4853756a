"""Fields of an image or volume in its pixels, and their file in VTK's format of images, .vti."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.base.errors import require
from alphacut.fuzzy import FuzzyNumber
from alphacut.rve.image.fields.element import Element, element_of
from alphacut.rve.image.fields.energy import modes_of
from alphacut.rve.image.fields.grid import on_host
from alphacut.rve.image.fields.split import SideSolution
from alphacut.rve.image.model import ImageModel
from alphacut.rve.image.study import GreyImage, ImagePhase, image_study


@dataclass(frozen=True, eq=False)
class ImageFields:
    """Means over each pixel or voxel of the strains and stresses of an image at nominal values.

    Components and loads are in Voigt's order: 11, 22, 12 of the plane, and 11, 22, 33, 23, 13, 12
    of space. Shear components of strains are twice those of the tensor.

    Args:
        lengths: Sides of a pixel or voxel in m, along the axes of `phase`.
        phase: Number of the phase of each pixel, dark first, shape (y, x) or (z, y, x).
        strain: Strains under each unit mean strain, of displacements that bound the stiffness from
            above, shape (loads, components, ...grid); None where a phase is rigid.
        stress: Stresses under each unit mean stress, in equilibrium exactly, which bound the
            stiffness from below, shape (loads, components, ...grid); None where pores percolate.
    """

    lengths: tuple[float, ...]
    phase: Ints
    strain: Array | None
    stress: Array | None

    def write(self, path: Path | str) -> None:
        """Write phases, strains and stresses as values of cells into a file NAME.vti, for ParaView.

        Arrays are named as strain_22_under_12: the component 22 under the unit mean strain 12. A
        strain or stress that is None is left out.

        Args:
            path: Name of the file, which is replaced.

        Raises:
            RefusedError: The name does not end in .vti.
            OSError: The file cannot be written.
        """
        named: dict[str, Array | Ints] = {"phase": self.phase}
        axes = {2: ("11", "22", "12"), 3: ("11", "22", "33", "23", "13", "12")}[self.phase.ndim]
        for quantity, fields in (("strain", self.strain), ("stress", self.stress)):
            if fields is None:
                continue
            for row, load in enumerate(axes):
                for column, component in enumerate(axes):
                    named[f"{quantity}_{component}_under_{load}"] = fields[row, column]
        write_vti(path, named, lengths=self.lengths)


def image_fields(
    image: GreyImage,
    phases: Sequence[Mapping[str, FuzzyNumber | float]],
    *,
    thresholds: Sequence[FuzzyNumber | float] = (),
    labels: Sequence[float] = (),
) -> ImageFields:
    """Return the strains and stresses in each pixel or voxel of an image at nominal values.

    Args:
        image: One cell of a periodic medium; see `read_image`.
        phases: Of each phase, dark first, its modulus E (Pa) and poisson ν. The nominal values of
            fuzzy numbers are used.
        thresholds: Grey value from which on a pixel is of the next phase, one fewer than phases.
        labels: Value of each phase in a labelled image, in place of thresholds.

    Returns:
        Means over each pixel or voxel of the strain under each unit mean strain, and of the stress
        under each unit mean stress, shape (loads, components, ...grid) in Voigt's order. The strain
        is None beside rigid phases, the stress 0 where nothing carries its mean. And the phases,
        shape (y, x) or (z, y, x).

    Raises:
        RefusedError: A value is not allowed, noise leaves too much of a picture open at the
            thresholds, or the image does not fit into memory.
        FailedError: The solver does not converge.
    """
    listed = [ImagePhase.of(phase) for phase in phases]
    study = image_study(image, listed, thresholds=thresholds, labels=labels)
    model = ImageModel(**study.settings("cpu"))
    solution = model.solve(study.images(None, None))  # at nominal thresholds and moduli
    return ImageFields(
        lengths=image.lengths,
        phase=study.nominal_phase,
        strain=_pixel_means(element_of(image.sides, dual=False), solution.upper, model.division),
        stress=_pixel_means(element_of(image.sides, dual=True), solution.lower, model.division),
    )


def _pixel_means(element: Element, side: SideSolution | None, division: int) -> Array | None:
    """Return the means of a field over each pixel or voxel, shape (loads, components, ...grid).

    Loads and components are in Voigt's order; the grid is (y, x) or (z, y, x).

    Args:
        element: Element of displacements, for strains, or of stresses.
        side: The periodic fluctuations under each unit load, on a grid with `division` cells along
            each side of a pixel; None for no field, which gives None.
        division: Number of these cells.
    """
    if side is None:
        return None
    packed = side.fields
    fields = packed
    if side.split is not None:
        fields = side.split.on_grid(packed)
    n_loads = fields.shape[0]
    fine_grid = fields.shape[2:]
    # Each axis of the fine grid becomes two: of pixels, and of the cells in a pixel.
    pairs = [size for length in fine_grid for size in (length // division, division)]
    axes_in_pixel = tuple(range(3, 3 + 2 * len(fine_grid), 2))
    if side.beside_pores and side.split is None:  # these fields are the means over cells
        return np.asarray(fields.reshape(n_loads, -1, *pairs).mean(axis=axes_in_pixel))
    uniform_modes = element.mean_modes(np.eye(n_loads))
    # The modes are coefficients of orthonormal polynomials, and those of a uniform field belong to
    # the constant polynomial alone. So the least squares that give the uniform field nearest to the
    # modes, by the pseudo-inverse, give the mean of the field over the cell.
    to_means = np.linalg.pinv(element.of_voigt)
    means = np.empty((n_loads, len(to_means), *fine_grid))
    groups = [modes_of(element, fields, uniform_modes)]
    if side.split is not None:  # cells at split nodes have other unknowns than those of the grid
        groups.append(side.split.modes(packed, uniform_modes))
    for found in chain(*groups):
        of_cells = np.tensordot(to_means, on_host(found.modes), axes=1)
        for component, load in np.ndindex(of_cells.shape[:2]):
            grid = means[load, component]
            grid[found.slab] = of_cells[component, load].reshape(grid[found.slab].shape)
    return np.asarray(means.reshape(n_loads, -1, *pairs).mean(axis=axes_in_pixel))


def write_vti(
    path: Path | str, named: Mapping[str, Array | Ints], *, lengths: Sequence[float]
) -> None:
    """Write values of pixels or voxels as VTK's image, which ParaView and PyVista read.

    Args:
        path: Name of the file, which ends in .vti; it is replaced.
        named: Arrays of one shape, (y, x) or (z, y, x), one at least, by the names that they get.
            They are written as doubles; shapes are not checked.
        lengths: Sides of a pixel or voxel in m, along the axes of the arrays. A picture becomes a
            layer that is as thick as a pixel is long along x.

    Raises:
        RefusedError: The name has another ending.
        OSError: The file cannot be written.
    """
    require(Path(path).suffix == ".vti", "file", str(path), "a name that ends in .vti")
    shape = next(iter(named.values())).shape
    # VTK orders axes as x, y, z, with x the fastest, as NumPy's last axis is.
    sizes = list(shape[::-1])
    sides = [float(length) for length in lengths[::-1]]
    if len(sizes) == 2:  # a picture is one voxel thick
        sizes.append(1)
        sides.append(sides[0])
    spacing = " ".join(map(repr, sides))
    extent = " ".join(f"0 {size}" for size in sizes)
    rows = [
        '<?xml version="1.0"?>',
        '<VTKFile type="ImageData" version="1.0" byte_order="LittleEndian" header_type="UInt64">',
        f'<ImageData WholeExtent="{extent}" Origin="0 0 0" Spacing="{spacing}">',
        f'<Piece Extent="{extent}"><CellData>',
    ]
    for name, values in named.items():
        content = np.ascontiguousarray(values, "<f8").tobytes()
        data = len(content).to_bytes(8, "little") + content  # the number of bytes comes first
        attributes = f'type="Float64" Name={quoteattr(name)} format="binary"'
        rows.append(f"<DataArray {attributes}>{base64.b64encode(data).decode()}</DataArray>")
    rows.append("</CellData></Piece></ImageData></VTKFile>")
    Path(path).write_text("\n".join(rows) + "\n", encoding="utf-8")
