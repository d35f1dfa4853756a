"""Stage modulus of an image: its phases and proved bounds of its stiffness, level by level."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.base.errors import FailedError, require
from alphacut.base.progress_bar import subprogress
from alphacut.case.material import ImageCell
from alphacut.fuzzy import FuzzyNumber
from alphacut.fuzzy.result import Nature
from alphacut.io.provenance import file_digest
from alphacut.rve.cell.cell import Phase
from alphacut.rve.fuzzy_cell import loss_corners, phase_loss_cuts
from alphacut.rve.image.fields.conjugate_gradient import ConjugateGradient
from alphacut.rve.image.files import files_of, needed_memory, read_grid, require_memory
from alphacut.rve.image.losses import energy_shares, loss_of_young, mean_loss
from alphacut.rve.image.model import ImageCut, ImageModel, phase_energies, usual_division
from alphacut.rve.image.phases import (
    ModuliImages,
    ModuliInterval,
    moduli_images,
    require_phases,
    threshold_ranges,
)
from alphacut.rve.result.engineering_constants import NAMES, PLANE_STRAIN
from alphacut.rve.result.loss_factors import CONSTANTS, first_order
from alphacut.rve.result.moduli import plane_constants
from alphacut.rve.result.reference_bounds import reference_bounds
from alphacut.rve.result.result import PhaseEnergies
from alphacut.stages.cell import AVERAGES, GPA, References
from alphacut.stages.modulus import LossResult, constant_cuts
from alphacut.stages.store import CutsResult, Stage, StageContext, StageResult
from alphacut.stochastic.segmentation import segment

if TYPE_CHECKING:
    import xarray

ACCURACY = 1e-5
"""Relative energy that the solver may leave."""
NATURE = Nature.GUARANTEED
"""Nature of all bounds: proved of the image as segmented, if it repeats itself."""
AXES = {2: ["11", "22", "12"], 3: ["11", "22", "33", "23", "13", "12"]}
SPACE = "along the axes"
"""Definition of the constants of a volume."""
CONSTANT_NAMES = {
    2: NAMES,
    3: ("E_x", "E_y", "E_z", "nu_yz", "nu_xz", "nu_xy", "G_yz", "G_xz", "G_xy"),
}
HILL = "Hill's isotropic average"
SIDES = "lower", "upper"
AlphaLevel = float | None
"""α-level, or None for the nominal values alone."""
PhaseRanges = Callable[[AlphaLevel], tuple[Ints, Ints]]
"""Least and greatest phase of each pixel at a level."""


@dataclass(frozen=True, eq=False, kw_only=True)
class ImageResult:
    """Proved bounds of an image or volume, moduli in GPa.

    On the highest level `lower_GPa` and `upper_GPa` bound the stiffness in the sense of Loewner,
    (3, 3) of the plane or (6, 6) of space, `nu` and `shear_GPa` those of its average. As α-cuts
    `plane` has the constants along the axes by definition and name, `proved_losses` loss factors
    at nominal moduli to first order, `loss` estimates beside them of an image; `widths_GPa` has the
    widths of E by cause. Bounds that pores or rigid phases leave unknown are null.
    """

    alpha: Array
    E_GPa: CutsResult
    lower_GPa: Array
    upper_GPa: Array
    nu: dict[str, float | None]
    shear_GPa: dict[str, float | None]
    average: str
    plane: dict[str, dict[str, CutsResult]]
    nature: Nature
    seconds: float
    widths_GPa: dict[str, float]
    fractions: dict[str, float]
    division: int
    references: References
    loss: LossResult | None
    proved_losses: dict[str, CutsResult]


def stage(
    cell: ImageCell, alpha: tuple[float, ...], average: str, device: str
) -> Stage[ImageResult]:
    """The stage of an image, on some levels; E and ν are of an average of its stiffness."""
    digests = [file_digest(file) for file in files_of(cell.image)]
    inputs = [cell, alpha, average, digests]  # bounds are the same on every device
    compute = partial(compute_cuts, cell, alpha, average, device)
    return Stage("image", inputs, ("stochastic", "rve", "fuzzy"), ImageResult, compute)


def compute_cuts(
    cell: ImageCell, alpha: tuple[float, ...], average: str, device: str, context: StageContext
) -> StageResult[ImageResult]:
    """Computes α-cuts of E and of the stiffness of an image, and how its sources widen E."""
    start = perf_counter()
    study = image_study(cell)
    nominal = study.images(None, None)  # at nominal thresholds and moduli
    division, solver = usual_division(nominal), ConjugateGradient(ACCURACY)
    require_memory(nominal.bulk[0].shape, division)
    model = ImageModel(cell.sides, division, solver, average, device)
    crisp = model.solve(nominal)
    n_solutions = len(alpha) + 5  # with the nominal one, two tests, and the widths of two sources
    context.tick(1 / n_solutions)
    images = [study.images(level, level) for level in alpha]
    cuts_progress = subprogress(context.tick, 1 / n_solutions, (len(alpha) + 1) / n_solutions)
    cuts = model.cuts(images, (nominal, crisp), cuts_progress)
    model.require_consistent(images, cuts)
    _require_isotropic(cuts[0])
    context.tick((len(alpha) + 3) / n_solutions)

    def width(threshold: AlphaLevel, phases: AlphaLevel) -> float:
        """Width of E in Pa at levels of the threshold and of the phases."""
        (cut,) = model.cuts([study.images(threshold, phases)], (nominal, crisp))
        return float(cut.modulus[1] - cut.modulus[0])

    widths = dict[str, float]()
    has_both_bounds = np.isfinite(cuts[0].bounds.width)
    if has_both_bounds:
        base, lowest = width(None, None), alpha[0]
        widths["discretisation"] = base
        if study.fuzzy_threshold:
            widths["threshold"] = max(0.0, width(lowest, None) - base)
        if any(number.support.width > 0 for pair in cell.pairs for number in pair):
            widths["phases"] = max(0.0, width(None, lowest) - base)
    phase = study.phase_ranges(None)[0]
    proved, estimates = dict[str, Array](), None
    if cell.losses:
        phase_cuts = phase_loss_cuts(cell.losses, alpha)
        shares = energy_shares(model, crisp, nominal, phase, len(cell.pairs))
        proved = {
            name: np.array([mean_loss(parts, *cut) for cut in phase_cuts])
            for name, parts in shares.items()
        }
        young = loss_of_young(crisp.bounds, proved["K"], proved["G"], average)
        proved = {"E": young, **proved}
        if cell.dimension == 2:
            energies = phase_energies(model, crisp, nominal, phase, len(cell.pairs))
            estimates = estimated_losses(energies, phase_cuts, average)
    top, constants = cuts[-1], np.array([cut.constants for cut in cuts])  # (levels, constants, 2)
    fractions, names = study.fractions, CONSTANT_NAMES[cell.dimension]
    is_space, references = cell.dimension == 3, References()
    if has_both_bounds and all(cell.is_solid):
        shares_of_phases = np.array([*fractions.values()])
        phases = [Phase(young.nominal, nu.nominal) for young, nu in cell.pairs]
        classical = reference_bounds(phases, fractions=shares_of_phases, space=is_space)
        lower, upper = classical.young
        references = {"hashin_shtrikman_E_GPa": (lower / GPA, upper / GPA)}
    along_axes = dict(map(constant_cuts, names, np.moveaxis(constants, 1, 0)))
    result = ImageResult(
        alpha=np.array(alpha),
        E_GPa=CutsResult.of(np.array([cut.modulus for cut in cuts]) / GPA),
        lower_GPa=np.asarray(top.bounds.lower / GPA, float),
        upper_GPa=np.asarray(top.bounds.upper / GPA, float),
        nu=dict(zip(SIDES, top.poisson, strict=True)),
        shear_GPa=dict(zip(SIDES, (x / GPA for x in top.bounds.shear(average)), strict=True)),
        average=HILL if is_space else AVERAGES[average],
        plane={SPACE if is_space else PLANE_STRAIN: along_axes},
        nature=NATURE,
        seconds=perf_counter() - start,
        widths_GPa={x: widths[x] / GPA for x in sorted(widths, key=lambda x: -widths[x])},
        fractions=fractions,
        division=model.division,
        references=references,
        loss=estimates,
        proved_losses={name: CutsResult.of(cut) for name, cut in proved.items()},
    )
    return StageResult(result, _dataset(study, alpha, cuts, proved))


def _require_isotropic(widest: ImageCut) -> None:
    low, high = (end / GPA for end in widest.modulus)
    if low <= 0 and np.isfinite(widest.bounds.width):  # pores and rigid phases have no better
        ends = [(float(x), float(y)) for x, y in widest.constants / GPA]
        along = zip("xyz"[: widest.bounds.dimension], ends, strict=False)
        along_axes = ", ".join(f"E_{name} {x:.4g} … {y:.4g} GPa" for name, (x, y) in along)
        what = f"the bounds of E, {low:.4g} … {high:.4g} GPa, do not tell that it is positive"
        raise FailedError(what, f"take a finer image, or {along_axes}")


def _dataset(
    study: ImageStudy,
    alpha: tuple[float, ...],
    cuts: Sequence[ImageCut],
    losses: Mapping[str, Array],
) -> xarray.Dataset:
    """Dataset of the bounds on each level, in SI, and of the phase of each pixel or voxel.

    `phase` is the one at the nominal threshold, `is_open` says whether the threshold leaves it open
    on the lowest level.
    """
    import xarray

    phase, (first, last) = study.phase_ranges(None)[0], study.phase_ranges(alpha[0])
    young, constants = np.array([x.modulus for x in cuts]), np.array([x.constants for x in cuts])
    stiffness = np.array([[cut.bounds.lower, cut.bounds.upper] for cut in cuts])
    names = CONSTANT_NAMES[phase.ndim]
    variables: dict[str, Any] = {
        "E": (("alpha", "bound"), young, {"units": "Pa"}),
        "stiffness": (("alpha", "bound", "row", "column"), stiffness, {"units": "Pa"}),
        **{name: (("alpha", "bound"), constants[:, k]) for k, name in enumerate(names)},
        **{f"loss_{name}": (("alpha", "bound"), cut) for name, cut in losses.items()},
        "phase": (("z", "y", "x")[-phase.ndim :], phase.astype(np.float32)),
        "is_open": (("z", "y", "x")[-phase.ndim :], (first != last).astype(np.uint8)),
    }
    axes = {"alpha": list(alpha), "bound": [*SIDES]}
    axes |= dict.fromkeys(("row", "column"), AXES[phase.ndim])
    attributes = {
        "nature": str(NATURE),
        "lengths": study.cell.lengths,
        "phases": [*study.fractions],
    }
    return xarray.Dataset(variables, axes, attributes)


def estimated_losses(energies: PhaseEnergies, cuts: Array, average: str) -> LossResult:
    """Loss factors of E, G and K of an image at nominal moduli, from cuts (levels, 2, phases)."""
    constants_of = partial(plane_constants, average=average)
    fractions, _ = energies.energy_fractions(constants_of)
    corners = loss_corners(cuts, fractions)
    # level l, end e, constant c, phase p, K or G x
    bounds = np.einsum("lecpx,pxc->cle", corners, fractions)
    largest = corners[0, 1, 0]
    _, errors = first_order(energies, largest, constants_of)
    # what the first order leaves out is of the order of the squared difference of losses
    errors = errors + np.ptp(largest) ** 2 * bounds[:, 0, 1]
    named = dict[str, Array](zip(CONSTANTS, bounds, strict=True))
    by_name = dict(zip(CONSTANTS, map(float, errors), strict=True))
    return LossResult.of(named, by_name, Nature.ESTIMATED)


def cut_or_nominal(number: FuzzyNumber, level: AlphaLevel) -> tuple[float, float]:
    """The cut of a number at a level, or its nominal value twice."""
    return (number.nominal, number.nominal) if level is None else number.cut(level)


@dataclass(frozen=True)
class ImageStudy:
    """An image ready to be solved: the phases that each pixel may be of, at a level.

    `fuzzy_threshold` says whether they depend on the level.
    """

    cell: ImageCell
    phase_ranges: PhaseRanges
    fuzzy_threshold: bool

    @property
    def extent(self) -> str:
        """Number of pixels or voxels along each axis, and memory of their solution, in words."""
        nominal = self.images(None, None)
        shape = nominal.bulk[0].shape
        sizes = " × ".join(map(str, shape))
        gigabytes = needed_memory(shape, usual_division(nominal)) / 1e9
        axes = "pixels (y, x)" if len(shape) == 2 else "voxels (z, y, x)"
        return f"{sizes} {axes}, about {gigabytes:.1f} GB of memory"

    def images(self, threshold: AlphaLevel, phases: AlphaLevel) -> ModuliImages:
        """Least and greatest moduli of each pixel, at levels of threshold and phases."""
        moduli = [
            ModuliInterval.of_young(
                cut_or_nominal(young, phases), cut_or_nominal(poisson, phases), self.cell.dimension
            )
            for young, poisson in self.cell.pairs
        ]
        return moduli_images(*self.phase_ranges(threshold), moduli)

    @property
    def fractions(self) -> dict[str, float]:
        """Fraction of each phase at the nominal values by the phase's name, dark first."""
        phase = self.phase_ranges(None)[0]
        shares = np.bincount(phase.ravel(), minlength=len(self.cell.pairs)) / phase.size
        if self.cell.labels is not None:
            names = [f"label {label:g}" for label in self.cell.labels]
        else:
            greys = [f"{number.nominal:g}" for number in self.cell.threshold or ()]
            between = (f"grey {a} … {b}" for a, b in pairwise(greys))
            names = [f"grey below {greys[0]}", *between, f"grey above {greys[-1]}"]
        return dict(zip(names, map(float, shares), strict=True))


def image_study(cell: ImageCell) -> ImageStudy:
    """The study of an image cell, by its labels or by thresholds of its greys.

    Raises:
        RefusedError: A threshold or a label does not fit the image.
    """
    ImageModel(cell.sides)  # refuses sides too unlike
    grey = read_grid(cell.image, cell.sides)
    if cell.labels:
        phase = np.full(grey.shape, -1)
        for number, label in enumerate(cell.labels):
            phase[grey == label] = number
        values = {float(x) for x in np.unique(grey)}
        wrong = ", ".join(f"{x:g}" for x in sorted(values ^ set(cell.labels))[:5])
        allowed = "every value of the image, and no other"
        require(not wrong, "cell.labels", value=wrong, allowed=allowed)
        return ImageStudy(cell, lambda level: (phase, phase), False)
    thresholds = cell.threshold or ()
    require_phases(grey, tuple(number.cut(0.0) for number in thresholds))
    is_fuzzy = any(number.support.width > 0 for number in thresholds)
    segmentation = None  # of a volume, whose noise is not judged
    if cell.dimension == 2:
        segmentation = segment(grey, [number.nominal for number in thresholds])
        segmentation.require_certain()

    def phase_ranges(level: AlphaLevel) -> tuple[Ints, Ints]:
        """Least and greatest phase of each pixel at a level."""
        # noise and light leave phases open, unless a fuzzy threshold says all that is not known
        if segmentation is not None and level is not None and not is_fuzzy:
            return segmentation.ranges()
        return threshold_ranges(grey, [cut_or_nominal(number, level) for number in thresholds])

    is_open = segmentation is not None and segmentation.open_fraction > 0
    return ImageStudy(cell, phase_ranges, is_fuzzy or is_open)
