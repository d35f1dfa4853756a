"""The fuzzy stiffness of an image or a volume: proved bounds on each α-level, by what widens them.

Phases and thresholds of images, and what results of all properties have in common, are here too.

The image is the periodic cell. Each pixel or voxel is of one of the phases that its grey value and
the thresholds allow; each phase has fuzzy moduli and loss factors.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any, Generic, Protocol, TypeVar, cast

import numpy as np

from alphacut.base.array_files import read_npy
from alphacut.base.arrays import Array, Ints, Mask
from alphacut.base.csv_text import csv_text
from alphacut.base.errors import (
    FailedError,
    checked_number,
    is_number,
    require,
    require_choice,
)
from alphacut.base.extras import extra_named
from alphacut.base.progress_bar import Progress, progress_reporter, subprogress
from alphacut.base.stated import require_overrides
from alphacut.fuzzy import Crisp, FuzzyNumber
from alphacut.fuzzy.result import Nature, rounded
from alphacut.fuzzy.sets.claimed import widest_cut
from alphacut.fuzzy.sets.numbers import checked_levels, fuzzy_number
from alphacut.rve.cell.cell import Phase
from alphacut.rve.image.bounds import StiffnessBounds
from alphacut.rve.image.fields.conjugate_gradient import ConjugateGradient
from alphacut.rve.image.fields.forest import Percolation
from alphacut.rve.image.files import read_grid
from alphacut.rve.image.losses import energy_fractions, loss_of_young, mean_loss
from alphacut.rve.image.memory import needed_memory, require_memory
from alphacut.rve.image.model import (
    Bounds,
    GridModel,
    GridSettings,
    ImageCut,
    ImageModel,
    ImageSolution,
    usual_division,
)
from alphacut.rve.image.phases import (
    RIGID,
    ModuliImages,
    ModuliInterval,
    PhaseInterval,
    moduli_images,
    require_phases,
    threshold_ranges,
)
from alphacut.rve.image.raw import HEADS
from alphacut.rve.result.engineering_constants import NAMES
from alphacut.rve.result.loss_factors import phase_loss_cuts
from alphacut.rve.result.moduli import ISOTROPIC
from alphacut.rve.result.reference_bounds import ReferenceBounds, reference_bounds
from alphacut.stochastic.segmentation import segment

if TYPE_CHECKING:
    import xarray

GUARANTEE = Nature.GUARANTEED
"""Guarantee of all bounds: they are proved of the image as segmented, repeated periodically."""
SIDES = "lower", "upper"
"""Names of the two bounds."""
AlphaLevel = float | None
"""α-level, or None for the nominal values alone."""
PhaseRanges = Callable[[AlphaLevel], tuple[Ints, Ints]]
"""Function from a level to the lowest and the highest number of the phase of each pixel."""


@dataclass(frozen=True, eq=False)
class GreyImage:
    """Grey values or labels of pixels or voxels.

    Args:
        values: Shape (y, x) with y pointing up, or (z, y, x).
        lengths: Sides of a pixel or voxel in the order of the axes of `values`, in m.

    Example:
        >>> image = GreyImage(np.zeros((20, 30)), lengths=(2e-6, 2e-6))
        >>> image.values.shape
        (20, 30)
    """

    values: Array
    lengths: tuple[float, ...]

    @property
    def sides(self) -> tuple[float, ...]:
        """The sides over that along x."""
        return tuple(length / self.lengths[-1] for length in self.lengths)


def read_image(
    path: Path | str, *, spacing: float | Sequence[float], override: Sequence[str] = ()
) -> GreyImage:
    """Read an image, or a volume, with the sides of its pixels or voxels.

    Args:
        path: Picture (PNG, TIFF), or an array in .npy; of a volume a TIFF stack, a folder of
            slices, .npy, .mhd or .nhdr.
        spacing: Side of a pixel or voxel in m; or its sides, along (x, y) of a picture or along (x,
            y, z) of a volume. A TIFF file is read as a volume if three sides are given.
        override: `["voxel"]` where a volume states wrong sides, and those given here count.

    Returns:
        `values`, grey values or labels of shape (y, x) with y pointing up, or (z, y, x); and
        `lengths`, the sides in m in the order of these axes.

    Raises:
        RefusedError: The file is missing, none of these, damaged, too large for memory, or states
            other sides of a voxel, or sides of other ratios where it states no unit; or a length of
            `spacing` is no positive, finite number, or there are not as many as axes.

    Example:
        >>> import tempfile
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     np.save(f"{folder}/image.npy", np.zeros((20, 30)))
        ...     image = read_image(f"{folder}/image.npy", spacing=2e-6)
        >>> image.values.shape, image.lengths
        ((20, 30), (2e-06, 2e-06))
    """
    file = Path(path)
    # A TIFF file may be a picture or a stack of slices: three sides say that it is a volume.
    stated = (spacing,) if is_number(spacing) else tuple(cast("Sequence[float]", spacing))
    lengths = tuple(checked_number("spacing", length, positive=True) for length in stated)
    dimension = len(lengths) if len(lengths) > 1 else _dimension_of(file)
    require(len(lengths) in (1, dimension), "spacing", spacing, f"one length, or {dimension}")
    if len(lengths) == 1:
        lengths *= dimension
    image_lengths = lengths[::-1]
    require_overrides(override, ("voxel",))
    return GreyImage(read_grid(file, image_lengths, override), image_lengths)


def _dimension_of(file: Path) -> int:
    """Return 3 for a volume, also in a .npy of three axes, and 2 for all other files.

    It is 2 for a file that does not exist. RefusedError for a damaged .npy.
    """
    if file.suffix.lower() == ".npy" and file.is_file():
        return 3 if np.ndim(read_npy(file, kinds="buifc")) == 3 else 2
    return 3 if file.is_dir() or file.suffix.lower() in HEADS else 2


@dataclass(frozen=True)
class ImagePhase:
    """A phase of an image.

    Args:
        modulus: Young's modulus in Pa; 0 of a pore, `RIGID` or more of a rigid phase.
        poisson: Poisson's ratio.
        loss: Loss factor tan δ of the stiffness; None where it is not asked for.
    """

    modulus: FuzzyNumber
    poisson: FuzzyNumber
    loss: FuzzyNumber | None = None

    @classmethod
    def of(cls, values: Mapping[str, FuzzyNumber | float]) -> ImagePhase:
        """Return the phase of a mapping with modulus, poisson and, if asked for, loss.

        Args:
            values: "modulus", Young's modulus in Pa, 0 of a pore and 1e18 or more of a rigid phase;
                "poisson", Poisson's ratio; and "loss", the loss factor tan δ. Each is a number or a
                fuzzy number.

        Raises:
            RefusedError: The mapping has another key, or lacks modulus or poisson, a value is no
                finite number, or the loss factor may be negative. Whether modulus and poisson are
                allowed is checked when the image is solved.
        """
        numbers = {}
        for name, value in values.items():
            require_choice("key of a phase", name, ("modulus", "poisson", "loss"))
            numbers[name] = as_fuzzy(f"{name} of a phase", value)
        for name in ("modulus", "poisson"):
            require(name in numbers, f"{name} of a phase", None, "a number, or a fuzzy number")
        if "loss" in numbers:
            low = widest_cut(numbers["loss"]).lower
            require(low >= 0, "loss of a phase", f"from {low:g}", "loss factors of 0 or more")
        return cls(**numbers)

    @property
    def is_solid(self) -> bool:
        """Whether the phase is neither a pore nor rigid, throughout its widest known cut."""
        lower, upper = widest_cut(self.modulus)
        return lower > 0 and upper < RIGID

    def is_solid_at(self, level: float) -> bool:
        """Return whether the lower end of an α-cut is neither that of a pore nor rigid."""
        return 0 < self.modulus.cut(level).lower < RIGID

    def interval(self, level: AlphaLevel, dimension: int) -> PhaseInterval:
        """Return the moduli at an α-level, or the nominal ones if it is None, in 2 or 3 dimensions.

        RefusedError for moduli that are not allowed.
        """
        modulus = cut_or_nominal(self.modulus, level)
        poisson = cut_or_nominal(self.poisson, level)
        return ModuliInterval.of_young(modulus, poisson, dimension)


class StudyPhase(Protocol):
    """A phase of an image, with the moduli of the property that is asked for."""

    def is_solid_at(self, level: float) -> bool:
        """Return whether the lower end of an α-cut is above 0 and below infinity."""

    def interval(self, level: AlphaLevel, dimension: int) -> PhaseInterval:
        """Return the moduli at an α-level, or the nominal ones if it is None."""


Phases = TypeVar("Phases", bound=StudyPhase)
"""Class of the phases of an image."""


def as_fuzzy(key: str, value: FuzzyNumber | float) -> FuzzyNumber:
    """Return a number as a fuzzy number; RefusedError, which names `key`, for what is no number."""
    return value if isinstance(value, FuzzyNumber) else Crisp(checked_number(key, value))


@dataclass(frozen=True, eq=False)
class ImageStudy(Generic[Phases]):
    """An image ready to be solved.

    Args:
        image: Its values.
        phases: Its phases, dark first.
        names: Their names.
        phase_ranges: Function to the phases that each pixel may be of, at a level.
        fuzzy_threshold: Whether these depend on the level.
    """

    image: GreyImage
    phases: tuple[Phases, ...]
    names: tuple[str, ...]
    phase_ranges: PhaseRanges
    fuzzy_threshold: bool

    @property
    def dimension(self) -> int:
        """2 of an image, 3 of a volume."""
        return len(self.image.lengths)

    @property
    def extent(self) -> str:
        """Size of the image and memory of its solution, in words.

        They read as "512 × 512 pixels (y, x), about 0.5 GB of memory". The memory is an estimate
        for all α-levels. A volume has "voxels (z, y, x)". RefusedError if a phase has moduli that
        are not allowed.
        """
        nominal = self.images(None, None)
        shape = nominal.shape
        sizes = " × ".join(map(str, shape))
        gigabytes = needed_memory(shape, usual_division(nominal)) / 1e9
        axes = "pixels (y, x)" if len(shape) == 2 else "voxels (z, y, x)"
        return f"{sizes} {axes}, about {gigabytes:.1f} GB of memory"

    @property
    def percolation(self) -> Percolation | None:
        """What the phases outside pores connect at nominal values; None without pores."""
        is_solid = np.asarray((self.images(None, None).lower > 0).all(axis=0))
        return None if is_solid.all() else Percolation.of_mask(is_solid)

    def require_solid(self, alpha: Sequence[float]) -> None:
        """Check that at each level some phase is neither a pore nor rigid by its lower end.

        Args:
            alpha: The α-levels that are solved.

        Raises:
            RefusedError: There is no such phase. Pores and rigid phases alone have no energy that
                could be bounded.
        """
        for level in alpha:
            is_solid = any(phase.is_solid_at(level) for phase in self.phases)
            what = f"0 or infinite at α = {level:g} in every phase"
            allowed = f"a phase whose lower end there is above 0 and below {RIGID:g}"
            require(is_solid, "modulus of the phases", what, allowed)

    def images(self, threshold: AlphaLevel, phases: AlphaLevel) -> ModuliImages:
        """Return the lower and upper moduli of each pixel or voxel at given α-levels.

        Args:
            threshold: α-level of the thresholds; None for their nominal values.
            phases: α-level of the moduli of the phases; None for their nominal values.

        Returns:
            `lower` and `upper`, shape (moduli, y, x) or (moduli, z, y, x): bulk and shear moduli in
            Pa, in the plane the bulk modulus of plane strain, K + G/3; or conductivities.

        Raises:
            RefusedError: A phase has moduli that are not allowed.
        """
        moduli = [phase.interval(phases, self.dimension) for phase in self.phases]
        first, last = self.phase_ranges(threshold)
        return moduli_images(first, last, moduli)

    def settings(self, device: str) -> GridSettings:
        """Return the arguments of a model with the usual number of elements and accuracy.

        Args:
            device: "cpu", or "cuda" by CuPy; whether it is there is found out when the model
                solves.

        Raises:
            RefusedError: The image does not fit into memory.
        """
        nominal = self.images(None, None)
        division = usual_division(nominal)
        require_memory(nominal.shape, division)
        # Bounds are then within 3e-5 of those that fully solved fields would give.
        solver = ConjugateGradient(accuracy=1e-5)
        return {
            "sides": self.image.sides,
            "division": division,
            "solver": solver,
            "device": device,
        }

    def bounds_at_levels(
        self,
        model: GridModel[Bounds],
        nominal: ImageSolution[Bounds],
        alpha: Sequence[float],
        tick: Progress,
    ) -> list[Bounds]:
        """Return proved bounds at each α-level, after a test of the proof itself.

        Args:
            model: Model of the property whose moduli the phases have.
            nominal: Its solution at nominal thresholds and moduli, the first guess.
            alpha: Rising α-levels, one at least.
            tick: Function that is called with the completed fraction.

        Raises:
            RefusedError: The moduli are not allowed, or the device is missing.
            FailedError: The solver does not converge, or the bounds contradict each other.
        """
        images = [self.images(level, level) for level in alpha]
        n_solutions = len(alpha) + 2  # with two tests
        progress = subprogress(tick, 0.0, len(alpha) / n_solutions)
        bounds = model.bounds_at_levels(images, (self.images(None, None), nominal), progress)
        # A test of the proof itself, by solutions that share nothing with those of the cuts.
        model.require_consistent(images, bounds)
        tick(1.0)
        return bounds

    @property
    def nominal_phase(self) -> Ints:
        """Number of the phase of each pixel or voxel at the nominal threshold."""
        first, _ = self.phase_ranges(None)
        return first

    @property
    def fractions(self) -> dict[str, float]:
        """Fraction of each phase at the nominal threshold by the phase's name, dark first."""
        phase = self.nominal_phase
        counts = np.bincount(phase.ravel(), minlength=len(self.phases))
        return dict(zip(self.names, map(float, counts / phase.size), strict=True))


def cut_or_nominal(number: FuzzyNumber, level: AlphaLevel) -> tuple[float, float]:
    """Return the cut of a number at a level, or its nominal value twice where the level is None."""
    return (number.nominal, number.nominal) if level is None else number.cut(level)


def image_study(
    image: GreyImage,
    phases: Sequence[Phases],
    *,
    thresholds: Sequence[FuzzyNumber | float] = (),
    labels: Sequence[float] = (),
) -> ImageStudy[Phases]:
    """Return an image whose phases labels, or thresholds of its grey values, tell apart.

    Where the thresholds are plain numbers, noise and uneven light of a picture leave the phase of
    some pixels open, as its segmentation estimates; that is part of the result. Fuzzy thresholds
    are taken to say all that is not known.

    Args:
        image: Grey values or labels, shape (y, x) or (z, y, x).
        phases: Its phases, dark first.
        thresholds: Grey value from which on a pixel is of the next phase, one fewer than phases.
        labels: Value of each phase in a labelled image, in place of thresholds.

    Returns:
        Study with the phases, their names, and the function `phase_ranges` from an α-level, or None
        for nominal values, to the lowest and highest phase of each pixel.

    Raises:
        RefusedError: Thresholds and labels are both or neither given, one does not fit the image or
            the phases, noise leaves too much of a picture open at the thresholds, or its sides are
            not positive or too unlike.
    """
    require(min(image.lengths) > 0, "lengths", image.lengths, "positive lengths in m")
    ImageModel(image.sides)  # refuses sides too unlike
    count = len(labels) or len(thresholds) + 1
    has_one = bool(labels) != bool(thresholds)
    require(has_one, "cell.threshold", "neither or both", "one of thresholds and labels")
    require(len(phases) == count, "phases", len(phases), f"{count}, one for each")
    if labels:
        return _labelled_study(image, tuple(phases), labels)

    grey = image.values
    numbers = [as_fuzzy("threshold", threshold) for threshold in thresholds]
    require_phases(grey, [number.cut(0.0) for number in numbers])
    is_fuzzy = any(number.support.width > 0 for number in numbers)
    segmentation = None  # the noise of a volume is not judged
    if grey.ndim == 2:
        segmentation = segment(grey, [number.nominal for number in numbers])
        segmentation.require_certain()

    def phase_ranges(level: AlphaLevel) -> tuple[Ints, Ints]:
        """Return the lowest and the highest phase of each pixel at an α-level, two integer arrays.

        The grey values are compared with the α-cuts of the thresholds, at the level None with their
        nominal values. For a picture at a level, if no threshold is fuzzy, its grey values are
        varied by the noise and the uneven light that its segmentation has found.
        """
        # A fuzzy threshold says all that is not known, noise and light included.
        if segmentation is not None and level is not None and not is_fuzzy:
            return segmentation.ranges()
        return threshold_ranges(grey, [cut_or_nominal(number, level) for number in numbers])

    greys = [f"{number.nominal:g}" for number in numbers]
    between = [f"grey {low} … {high}" for low, high in pairwise(greys)]
    names = (f"grey below {greys[0]}", *between, f"grey above {greys[-1]}")
    is_open = segmentation is not None and segmentation.open_fraction > 0
    return ImageStudy(image, tuple(phases), names, phase_ranges, is_fuzzy or is_open)


def _labelled_study(
    image: GreyImage, phases: tuple[Phases, ...], labels: Sequence[float]
) -> ImageStudy[Phases]:
    """Return the study of an image whose values are labels of its phases.

    Args:
        image: Labels, shape (y, x) or (z, y, x).
        phases: Its phases, in the order of `labels`.
        labels: Label of each phase; of equal ones the last phase counts.

    Returns:
        Study in which the phase of each pixel is known at all α-levels.

    Raises:
        RefusedError: A value of the image is no label, or a label does not occur.
    """
    grey = image.values
    # Labels are compared as they are, whatever the order of the numbers.
    phase = np.full(grey.shape, -1)
    for number, label in enumerate(labels):
        phase[grey == label] = number
    values = {float(x) for x in np.unique(grey)}
    # values without a label, and labels that do not occur
    wrong = ", ".join(f"{x:g}" for x in sorted(values ^ set(labels))[:5])
    allowed = "every value of the image, and no other"
    require(not wrong, "cell.labels", value=wrong, allowed=allowed)
    names = tuple(f"label {label:g}" for label in labels)
    return ImageStudy(image, phases, names, lambda level: (phase, phase), False)


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class FuzzyImage(ABC):
    """Proved bounds of a property of an image or volume, repeated periodically, on α-levels.

    Bounds that pores, rigid or perfectly conducting phases leave unknown are 0 or infinite.

    Args:
        alpha: Levels, shape (A,).
        fractions: Fraction of each phase by its name.
        division: Elements along each side of a pixel or voxel.
        seconds: Wall time.
        phase: Phase of each pixel or voxel at the nominal threshold.
        is_open: Whether the threshold leaves it open on the lowest level.
        lengths: As those of `GreyImage`.
    """

    alpha: Array
    fractions: Mapping[str, float]
    division: int
    seconds: float
    phase: Ints
    is_open: Mask
    lengths: tuple[float, ...]

    @property
    @abstractmethod
    def named_bounds(self) -> dict[str, Array]:
        """Bounds of each constant by its name, the mean over directions first, shape (A, 2)."""

    @abstractmethod
    def _variables(self) -> dict[str, Any]:
        """Return further variables of the dataset, with the names of their axes and their unit."""

    def __str__(self) -> str:
        """Return a text of some lines without a newline at the end.

        The first line has the guarantee and the wall time; then follow the bounds of each constant
        on the first and the last α-level, in SI and rounded outwards, and the fractions of the
        phases.
        """
        kind = "image" if len(self.lengths) == 2 else "volume"
        lines = [f"bounds {GUARANTEE} of the {kind}, repeated periodically; {self.seconds:.2g} s"]
        for name, bounds in self.named_bounds.items():
            texts = [f"α = {self.alpha[row]:g}: {_range_text(bounds[row])}" for row in (0, -1)]
            lines.append(f"{name}: {'; '.join(texts)}")
        fractions = (f"{name} {fraction:.1%}" for name, fraction in self.fractions.items())
        lines.append(f"phases: {', '.join(fractions)}")
        return "\n".join(lines)

    __repr__ = __str__

    def to_csv(self, path: str) -> None:
        """Write a CSV file with a row for each constant and each α-level.

        The columns are constant, alpha, lower, upper (bounds in Pa, of Poisson's ratios without a
        unit, of conductivities in that of the phases) and guarantee.

        Args:
            path: Name of the file, which is replaced; an OSError if it cannot be written.
        """
        rows = []
        for name, bounds in self.named_bounds.items():
            for row, alpha in enumerate(self.alpha):
                lower = float(bounds[row, 0])
                upper = float(bounds[row, 1])
                rows.append((name, f"{alpha:g}", f"{lower!r}", f"{upper!r}", str(GUARANTEE)))
        text = csv_text(("constant", "alpha", *SIDES, "guarantee"), rows)
        Path(path).write_text(text, encoding="utf-8")

    def to_dataset(self) -> xarray.Dataset:
        """Return a dataset of the bounds on each α-level, in SI, and of each pixel's phase.

        Returns:
            Dataset with a variable for each constant, of shape (alpha, bound), where bound is
            "lower" or "upper" ("E", those along the axes, "loss_E" and so on where phases have loss
            factors; or those of the conductivity); the bounds of the tensor, "stiffness" in Voigt's
            order or "conductivity", shape (alpha, bound, row, column); and, on the axes (y, x) or
            (z, y, x), "phase", the number of the phase at the nominal threshold, and "is_open", 1
            where the threshold leaves it open on the lowest level. Attributes are "nature" (the
            guarantee), "lengths" (sides of a pixel in m along its axes) and "phases" (their names).

        Raises:
            MissingLibraryError: xarray is not installed.
        """
        with extra_named():
            import xarray

        grid = ("z", "y", "x")[-self.phase.ndim :]
        variables: dict[str, Any] = {
            **{name: (("alpha", "bound"), bounds) for name, bounds in self.named_bounds.items()},
            **self._variables(),
            "phase": (grid, self.phase.astype(np.float32)),
            "is_open": (grid, self.is_open.astype(np.uint8)),
        }
        axes = {"alpha": self.alpha, "bound": list(SIDES)}
        attributes = {
            "nature": str(GUARANTEE),
            "lengths": self.lengths,
            "phases": list(self.fractions),
        }
        return xarray.Dataset(variables, axes, attributes)


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class FuzzyImageStiffness(FuzzyImage):
    """Proved bounds of the stiffness of an image or volume, repeated periodically, on α-levels.

    Moduli are in Pa.

    Args:
        cuts: Bounds at each level.
        average: Average that E and ν of the plane are of; of a volume it is Hill's.
        widths: Width of E at the lowest level by its cause, in Pa, the largest first; empty where
            E has one bound alone.
        proved_losses: Loss factors at nominal moduli, to first order, by the name of the constant,
            shape (A, 2) each; empty where phases have none.
        references: Classical bounds of isotropic composites; None beside pores or rigid phases.
    """

    cuts: Sequence[ImageCut]
    average: str
    widths: Mapping[str, float]
    proved_losses: Mapping[str, Array]
    references: ReferenceBounds | None

    @property
    def modulus(self) -> FuzzyNumber:
        """Fuzzy Young's modulus of the average in Pa; between two levels the wider α-cut holds.

        RefusedError where a bound is infinite: beside rigid phases, and in the plane where the
        solid does not percolate in all directions.
        """
        return fuzzy_number(self.alpha, self.young)

    @property
    def loss_factor(self) -> FuzzyNumber | None:
        """Fuzzy loss factor of E, proved to first order; None where phases have none."""
        if not self.proved_losses:
            return None
        return fuzzy_number(self.alpha, self.proved_losses["E"])

    @property
    def young(self) -> Array:
        """Bounds of Young's modulus of the average, shape (A, 2), in Pa."""
        return np.array([cut.modulus for cut in self.cuts])

    @property
    def constants(self) -> dict[str, Array]:
        """Bounds of the constants along the axes by name, shape (A, 2) each, moduli in Pa."""
        values = np.moveaxis(np.array([cut.constants for cut in self.cuts]), 1, 0)
        names: tuple[str, ...] = NAMES  # of an image in plane strain
        if len(self.lengths) == 3:
            names = ("E_x", "E_y", "E_z", "nu_yz", "nu_xz", "nu_xy", "G_yz", "G_xz", "G_xy")
        return dict(zip(names, values, strict=True))

    @property
    def named_bounds(self) -> dict[str, Array]:
        """Bounds of E and of the constants along the axes by name, shape (A, 2) each."""
        return {"E": self.young, **self.constants}

    def _variables(self) -> dict[str, Any]:
        """Return the stiffness and the loss factors as variables of the dataset."""
        stiffness = np.array([[cut.bounds.lower, cut.bounds.upper] for cut in self.cuts])
        voigt = (
            ["11", "22", "33", "23", "13", "12"] if len(self.lengths) == 3 else ["11", "22", "12"]
        )
        cut = ("alpha", "bound")
        losses = {f"loss_{name}": (cut, bounds) for name, bounds in self.proved_losses.items()}
        return {
            "E": (cut, self.young, {"units": "Pa"}),
            "stiffness": ((*cut, "row", "column"), stiffness, {"units": "Pa"}),
            "row": ("row", voigt),
            "column": ("column", voigt),
            **losses,
        }


def _range_text(ends: Array) -> str:
    """Return a range of two ends, rounded outwards to six digits."""
    lower = rounded(float(ends[0]), "lower", GUARANTEE, 6)
    upper = rounded(float(ends[1]), "upper", GUARANTEE, 6)
    return f"{lower:.6g} … {upper:.6g}"


def fuzzy_image_stiffness(
    image: GreyImage,
    phases: Sequence[Mapping[str, FuzzyNumber | float]],
    *,
    thresholds: Sequence[FuzzyNumber | float] = (),
    labels: Sequence[float] = (),
    alpha: Sequence[float] = (0.0, 0.5, 1.0),
    average: str = ISOTROPIC,
    device: str = "cpu",
    progress: Progress | bool | None = None,
) -> FuzzyImageStiffness:
    """Return proved bounds of the stiffness of an image or volume on α-levels.

    The image is one cell of a periodic medium, in plane strain where it is a picture.

    Args:
        image: The cell; see `read_image`.
        phases: For each phase, dark first (by rising grey value), its modulus E (Pa), poisson ν
            and, if asked for, loss tan δ, each a number or a fuzzy number; modulus 0 is a pore,
            1e18 and more is rigid.
        thresholds: Grey value from which on a pixel is of the next phase, one fewer than phases.
        labels: Value of each phase in a labelled image, in place of thresholds.
        alpha: Rising levels from 0 to 1, one at least.
        average: Average over directions that E and ν of the plane are of: "isotropic" for Hill's
            mean, or "axes". Of a volume it is Hill's.
        device: "cpu", or "cuda" by CuPy.
        progress: Function called with the completed fraction; False for none; a bar on a terminal
            by default.

    Returns:
        FuzzyImageStiffness: bounds at each level of `alpha` in `cuts` (E, ν and the constants along
        the axes by name), E as the fuzzy number `modulus`, what widens them in `widths`, the
        phases' `fractions`, and the loss factors where phases have some.

    Raises:
        RefusedError: A value is not allowed, or the image does not fit into memory.
        FailedError: The bounds do not tell that E is positive, or contradict each other; or the
            solver does not converge.

    Example:
        >>> from alphacut.fuzzy import Triangular
        >>> image = GreyImage(np.kron([[0, 1], [0, 0]], np.ones((4, 4))), lengths=(1e-6, 1e-6))
        >>> phases = [{"modulus": Triangular(19e9, 20e9, 21e9), "poisson": 0.3}]
        >>> phases += [{"modulus": 80e9, "poisson": 0.2}]
        >>> found = fuzzy_image_stiffness(image, phases, labels=[0, 1], progress=False)
        >>> [f"{end / 1e9:.1f} GPa" for end in found.modulus.cut(0)]
        ['25.2 GPa', '27.5 GPa']
    """
    listed = [ImagePhase.of(phase) for phase in phases]
    study = image_study(image, listed, thresholds=thresholds, labels=labels)
    with progress_reporter(progress) as tick:
        return solve_study(
            study, alpha=alpha, average=average, device=device, tick=tick or (lambda done: None)
        )


def solve_study(
    study: ImageStudy[ImagePhase],
    *,
    alpha: Sequence[float],
    average: str,
    device: str,
    tick: Progress,
) -> FuzzyImageStiffness:
    """Return proved bounds of the stiffness of an image on α-levels, and what widens them.

    Args:
        study: The image with its phases and thresholds.
        alpha: Rising levels from 0 to 1, one at least.
        average: "isotropic" or "axes": the average over directions that E and ν of the plane are
            of.
        device: "cpu", or "cuda" by CuPy.
        tick: Function that is called with the completed fraction, which rises; after the last call,
            of less than 1, come the widths and the loss factors.

    Returns:
        Bounds at each level, widths of E by cause at the lowest level where both bounds exist, loss
        factors at nominal moduli where phases have some, classical bounds, and the phase of each
        pixel.

    Raises:
        RefusedError: The levels do not rise within [0, 1], a value is not allowed, all phases are
            pores or rigid at a level, only some have loss factors, all have them where the
            solid does not percolate in all directions or a phase is rigid, or the image does not
            fit into memory.
        FailedError: The bounds do not tell that E is positive, or contradict each other; or the
            solver does not converge.
    """
    start = perf_counter()
    alpha = checked_levels(alpha)
    model = ImageModel(**study.settings(device), average=average)
    study.require_solid(alpha)
    solution = model.solve(study.images(None, None))  # at nominal thresholds and moduli
    _require_losses(study.phases, solution.bounds)
    # Progress is counted by solutions, which take about the same time.
    n_solutions = len(alpha) + 5  # with the nominal one, two tests, and the widths by two causes
    tick(1 / n_solutions)
    progress = subprogress(tick, 1 / n_solutions, (len(alpha) + 3) / n_solutions)
    cuts = model.cuts(study.bounds_at_levels(model, solution, alpha, progress))
    _require_positive(cuts[0])

    widths = dict[str, float]()
    references = None
    if cuts[0].bounds.has_both:
        widths = _widths_by_cause(study, model, solution, lowest=alpha[0])
        # Classical bounds are of phases with positive and finite moduli.
        if all(phase.is_solid for phase in study.phases):
            references = _reference_bounds(study)
    first, last = study.phase_ranges(alpha[0])
    return FuzzyImageStiffness(
        alpha=np.array(alpha, float),
        cuts=cuts,
        average=average,
        widths=widths,
        fractions=study.fractions,
        proved_losses=_proved_losses(study, model, solution, alpha),
        references=references,
        division=model.division,
        seconds=perf_counter() - start,
        phase=study.nominal_phase,
        is_open=first != last,
        lengths=study.image.lengths,
    )


def _widths_by_cause(
    study: ImageStudy[ImagePhase],
    model: ImageModel,
    solution: ImageSolution[StiffnessBounds],
    *,
    lowest: float,
) -> dict[str, float]:
    """Return the width of the bounds of E by its cause, in Pa, the largest first.

    The width at nominal values is that of the discretisation. The threshold's width is what the
    fuzzy thresholds alone add to it at the lowest level, and the phases' likewise.

    Args:
        study: The image with its phases and thresholds.
        model: Model by which it is solved.
        solution: Solution at nominal values, the first guess.
        lowest: The lowest α-level.

    Returns:
        Widths by "discretisation" and, where thresholds or phases are fuzzy, "threshold" and
        "phases". They need not add up to that of the cut.

    Raises:
        FailedError: The solver does not converge.
    """

    def width(threshold: AlphaLevel, phases: AlphaLevel) -> float:
        """Return the width of E in Pa at α-levels of threshold and phases; None is nominal."""
        nominal = study.images(None, None)
        images = [study.images(threshold, phases)]
        (cut,) = model.cuts(model.bounds_at_levels(images, (nominal, solution)))
        return float(cut.modulus.upper - cut.modulus.lower)

    # Causes are varied one at a time: their widths need not add up to that of the cut.
    at_nominal = width(None, None)
    widths = {"discretisation": at_nominal}
    if study.fuzzy_threshold:
        widths["threshold"] = max(0.0, width(lowest, None) - at_nominal)
    numbers = [x for phase in study.phases for x in (phase.modulus, phase.poisson)]
    if any(widest_cut(number).width > 0 for number in numbers):
        widths["phases"] = max(0.0, width(None, lowest) - at_nominal)
    return dict(sorted(widths.items(), key=lambda item: -item[1]))


def _require_losses(phases: Sequence[ImagePhase], bounds: StiffnessBounds) -> None:
    """Refuse loss factors of some phases only, or where a bound of the stiffness is missing.

    Args:
        phases: The phases of the image. Without loss factors all are allowed.
        bounds: Bounds of the stiffness at nominal moduli, for which loss factors are computed.

    Raises:
        RefusedError: Some phases have a loss factor and others none, or all have one and the
            solid does not percolate in all directions or a phase is rigid.
    """
    count = sum(phase.loss is not None for phase in phases)
    require(count in (0, len(phases)), "loss", f"of {count} phases", "each, 0 for none")
    cure = "pores in one material leave its loss factor; else take a small modulus for pores"
    allowed = "none beside a rigid phase, or pores that part the solid in some direction"
    require(count == 0 or bounds.has_both, "loss", "there", allowed, cure)


def _proved_losses(
    study: ImageStudy[ImagePhase],
    model: ImageModel,
    solution: ImageSolution[StiffnessBounds],
    alpha: Sequence[float],
) -> dict[str, Array]:
    """Return bounds of the loss factors of an image at nominal moduli, to first order.

    Args:
        study: The image. All phases have loss factors, fuzzy or not, or none has one.
        model: Model of `solution`.
        solution: Solution at the nominal values, with both bounds of the stiffness.
        alpha: α-levels of the loss factors of the phases.

    Returns:
        Lower and upper bound at each level, shape (levels, 2), of "E" and "G" of the average, "K",
        "E_x", "E_y" and, of a volume, "E_z". Empty where no phase has a loss factor.

    Raises:
        FailedError: The solver does not converge.
    """
    losses = [phase.loss for phase in study.phases if phase.loss is not None]
    if not losses:
        return {}
    fractions = energy_fractions(
        model, solution, study.images(None, None), study.nominal_phase, len(losses)
    )
    # each cut holds the lowest and the highest loss factor of each phase
    loss_cuts = phase_loss_cuts(losses, alpha)
    proved = {}
    for name, of_constant in fractions.items():
        proved[name] = np.array([mean_loss(of_constant, low, high) for low, high in loss_cuts])
    return {"E": loss_of_young(solution.bounds, proved, model.average), **proved}


def _reference_bounds(study: ImageStudy[ImagePhase]) -> ReferenceBounds:
    """Return the classical bounds of an isotropic composite of the nominal phases."""
    phases = [Phase(phase.modulus.nominal, phase.poisson.nominal) for phase in study.phases]
    fractions = list(study.fractions.values())
    return reference_bounds(phases, fractions=fractions, space=study.dimension == 3)


def _require_positive(widest: ImageCut) -> None:
    """Refuse bounds of E that do not tell that it is positive, where both bounds exist.

    Without a lower or an upper bound (a solid in pieces, rigid phases) there are no better ones,
    and nothing is refused.

    Args:
        widest: Bounds at the lowest α-level: `modulus`, E of the average in Pa, and `constants`
            along the axes, of which the first ones are E_x, E_y and, of a volume, E_z.

    Raises:
        FailedError: The lower bound of E is not above 0; the message has the bounds along the axes.
    """
    if widest.modulus.lower > 0 or not widest.bounds.has_both:
        return  # beside pores and rigid phases there are no better ones
    low, high = (end / 1e9 for end in widest.modulus)
    texts = []
    for axis, constant in zip("xyz", range(widest.bounds.dimension), strict=False):
        lower, upper = widest.constants[constant] / 1e9
        texts.append(f"E_{axis} {lower:.4g} … {upper:.4g} GPa")
    what = f"the bounds of E, {low:.4g} … {high:.4g} GPa, do not tell that it is positive"
    raise FailedError(what, f"take a finer image, or {', '.join(texts)}")
