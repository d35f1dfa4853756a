"""Stage modulus of an image: guaranteed bounds of its stiffness, in the units of results."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.kept_files import file_digest
from alphacut.case.material import ImageCell
from alphacut.fuzzy.result import Ends, Nature
from alphacut.rve.image.files import files_of, read_grid
from alphacut.rve.image.study import (
    GUARANTEE,
    SIDES,
    FuzzyImageStiffness,
    GreyImage,
    ImagePhase,
    ImageStudy,
    image_study,
    solve_study,
)
from alphacut.rve.result.engineering_constants import PLANE_STRAIN
from alphacut.rve.spheres.result import HILL
from alphacut.stages.cell import AVERAGES, GPA, References
from alphacut.stages.store import Stage, StageContext, StageResult

SPACE = "along the axes"
"""Definition of the constants of a volume."""


@dataclass(frozen=True, eq=False, kw_only=True)
class ImageResult:
    """Guaranteed bounds of an image or volume, moduli in GPa.

    Bounds that pores or rigid phases leave unknown are null in files.

    Args:
        alpha: Levels, shape (A,).
        E_GPa: α-cuts of Young's modulus of an average of the stiffness.
        lower_GPa: Lower bound of the stiffness on the highest level, in the sense of Loewner, shape
            (3, 3) of the plane or (6, 6) of space.
        upper_GPa: Upper bound, likewise.
        nu: Bounds of Poisson's ratio of the average on the highest level, by side.
        shear_GPa: Bounds of its shear modulus.
        average: Name of the average.
        plane: α-cuts of the constants along the axes, by definition and name.
        nature: Guarantee of all bounds.
        seconds: Time that they took.
        widths_GPa: Width of E at the lowest level by cause.
        fractions: Fractions of the phases by name.
        division: Number of elements along a side of a pixel or voxel.
        references: Hashin–Shtrikman bounds.
        proved_losses: α-cuts of the loss factors at nominal moduli, to first order.
    """

    alpha: Array
    E_GPa: Ends
    lower_GPa: Array
    upper_GPa: Array
    nu: dict[str, float | None]
    shear_GPa: dict[str, float | None]
    average: str
    plane: dict[str, dict[str, Ends]]
    nature: Nature
    seconds: float
    widths_GPa: dict[str, float]
    fractions: dict[str, float]
    division: int
    references: References
    proved_losses: dict[str, Ends]


def stage(
    cell: ImageCell, alpha: tuple[float, ...], average: str, device: str
) -> Stage[ImageResult]:
    """Return the stage that bounds the stiffness of an image or a volume.

    Args:
        cell: Files of the image, and its phases.
        alpha: Rising α-levels.
        average: Average of the plane stiffness whose E and ν are bounded: "isotropic", over all
            directions, or "axes", from C11 + C12 and C33. A volume has one average only.
        device: Where linear systems are solved, "cpu" or "cuda". The bounds are the same, so that
            it is no input of the stage: results of one device are up to date on the other.

    Raises:
        OSError: A file of the image cannot be read.
    """
    # The cell has the names of files alone: their digests make the stage new if a file changes.
    digests = [file_digest(file) for file in files_of(cell.image)]
    inputs = [cell, alpha, average, digests]

    def compute(context: StageContext) -> StageResult[ImageResult]:
        """Compute α-cuts of the stiffness, and by how much each source widens those of E."""
        study = study_of(cell)
        found = solve_study(study, alpha=alpha, average=average, device=device, tick=context.tick)
        return StageResult(image_result(found), found.to_dataset())

    return Stage("image", inputs, ("stochastic", "rve", "fuzzy"), ImageResult, compute)


def study_of(cell: ImageCell) -> ImageStudy[ImagePhase]:
    """Return the study of the image that a case names.

    Args:
        cell: File, sides of a pixel in m, thresholds or labels, and E, ν and loss factor of each
            phase.

    Returns:
        The grey image, and its phases on each α-level.

    Raises:
        RefusedError: The image is not read, or the phases do not fit it.
    """
    image = GreyImage(read_grid(cell.image, cell.lengths, cell.override), cell.lengths)
    # Either all phases have a loss factor or none has.
    losses = cell.losses or (None,) * len(cell.pairs)
    phases = [
        ImagePhase(young, poisson, loss)
        for (young, poisson), loss in zip(cell.pairs, losses, strict=True)
    ]
    return image_study(image, phases, thresholds=cell.threshold or (), labels=cell.labels or ())


def image_result(found: FuzzyImageStiffness) -> ImageResult:
    """Return the numbers of a fuzzy stiffness in the units of results: moduli in GPa.

    Args:
        found: Bounds on α-levels, in Pa. Those that pores or rigid phases leave unknown are 0 or
            infinite, and stay so.

    Returns:
        E and the constants in `plane` have cuts on all levels. The stiffness matrices in Voigt's
        notation, 6×6 of a volume or 3×3 of an image, and the bounds of ν and of the shear modulus
        belong to the highest level alone. `plane` has the constants along the axes, by the key
        "along the axes" for a volume and "plane strain" for an image.
    """
    # On the highest level the phases are crisp or nearly so, and matrices are close bounds of the
    # stiffness. On lower levels their distance would come from the width of the inputs.
    top = found.cuts[-1]
    if len(found.lengths) == 3:  # voxels of a volume have three sides, pixels of an image two
        average = HILL
        definition = SPACE
    else:
        average = AVERAGES[found.average]
        definition = PLANE_STRAIN
    # What is only checked needs no plans of samples, which that module imports.
    from alphacut.stages.modulus import in_units_of_results

    along_axes = in_units_of_results(found.constants)
    references = References()
    if found.references is not None:
        lower, upper = found.references.young
        references = {"hashin_shtrikman_E_GPa": (lower / GPA, upper / GPA)}
    shear = (end / GPA for end in top.bounds.shear(found.average))
    return ImageResult(
        alpha=found.alpha,
        E_GPa=Ends(*(found.young / GPA).T),
        lower_GPa=np.asarray(top.bounds.lower / GPA, float),
        upper_GPa=np.asarray(top.bounds.upper / GPA, float),
        nu=dict(zip(SIDES, top.poisson, strict=True)),
        shear_GPa=dict(zip(SIDES, shear, strict=True)),
        average=average,
        plane={definition: along_axes},
        nature=GUARANTEE,
        seconds=found.seconds,
        widths_GPa={cause: width / GPA for cause, width in found.widths.items()},
        fractions=dict(found.fractions),
        division=found.division,
        references=references,
        proved_losses={name: Ends(*cut.T) for name, cut in found.proved_losses.items()},
    )
