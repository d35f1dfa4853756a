"""Sections on the material: its random radius, phases, mesh and modulus."""

from __future__ import annotations

import itertools
import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Annotated, ClassVar, Literal, cast

import numpy as np
from pydantic import BeforeValidator, Discriminator, Field, PlainValidator, Tag

from alphacut.base.errors import RefusedError, require
from alphacut.case.types import (
    ALPHA,
    AtFirstUse,
    CaseFile,
    CasePath,
    Length,
    Levels,
    Loss,
    Modulus,
    ModulusOrStiffness,
    OneOrMany,
    Quantity,
    Ratio,
    Section,
    after,
    rising,
)
from alphacut.fuzzy import FuzzyNumber
from alphacut.rve.cell.cell import AnyPhase, Phase, VoigtPhase
from alphacut.rve.cell.lattice import Arrangement, lattice_of
from alphacut.rve.cell.outline import Ellipse, circle, reach
from alphacut.rve.image.phases import RIGID
from alphacut.rve.models import ModelEntry, fitting_models, known_names
from alphacut.stochastic import FractionMap, HermiteMap, TruncatedNormal
from alphacut.stochastic.particles.shapes import DISCS, SPHERES, Shape

Radius = Annotated[FuzzyNumber, Quantity(above=0, below=1, fuzzy=True)]

Number = Annotated[FuzzyNumber, Quantity(fuzzy=True)]

PhasesByName = dict[str, AnyPhase]

# θ is normal before it is cut off: beyond 10 standard deviations there is a probability of 1e-23.
Theta = Annotated[float, Quantity(minimum=-10, maximum=10)]


class ThetaSection(Section):
    """Distribution of θ alone, where a mesh from a file has the geometry.

    Args:
        theta: support of θ.
    """

    theta: Annotated[tuple[Theta, Theta], after(rising)] = (-3.0, 3.0)

    @property
    def distribution(self) -> TruncatedNormal:
        """Distribution of θ, a normal one that is cut off at both ends."""
        lower, upper = self.theta
        return TruncatedNormal(lower, upper)

    @property
    def nominal(self) -> HermiteMap | TruncatedNormal:
        """The distribution of θ, as that of a mesh from a file."""
        return self.distribution


class RadiusMapSection(ThetaSection):
    """Random radius of the particle over half the cell's side, a map of θ (the paper's eq. 12).

    Args:
        a1: radius at the lower end of θ.
        a3: radius at the upper end of θ.
        a2: slope dr/dξ at the lower end.
        a4: slope dr/dξ at the upper end.
    """

    a1: Radius
    a3: Radius
    a2: Number
    a4: Number

    @property
    def numbers(self) -> dict[str, FuzzyNumber]:
        """Parameters of the map by name: the factors a1 … a4 of the functions of eq. 12."""
        return {"a1": self.a1, "a2": self.a2, "a3": self.a3, "a4": self.a4}

    @property
    def nominal(self) -> HermiteMap:
        """The map at the nominal values of its parameters."""
        return self.at({name: number.nominal for name, number in self.numbers.items()})

    def at(self, values: Mapping[str, float]) -> HermiteMap:
        """Return the map at crisp values of its parameters, by their names."""
        # eq. 12: r = Σ a_i H_i(ξ) with the four Hermite functions on 0 ≤ ξ ≤ 1
        a1, a2, a3, a4 = [values[name] for name in self.numbers]
        return HermiteMap(a1, a2, a3, a4, self.distribution)

    def require_consistent(self) -> None:
        """Refuse supports of a1 … a4 for which the radius leaves (0, 1) at some θ.

        The radius is divided by half the side of the cell: a particle with radius 1 touches its
        periodic images.

        Raises:
            RefusedError: With the first corner of the supports at which the radius leaves (0, 1).
        """
        # r(θ) is linear in a1 … a4, so that its extremes over the box of their supports are at
        # corners: the map stays in (0, 1) if it does at the 2⁴ corners.
        for ends in itertools.product(*(set(x.support) for x in self.numbers.values())):
            corner = dict(zip(self.numbers, ends, strict=True))
            try:
                self.at(corner)  # refuses such a map
            except RefusedError as error:
                raise RefusedError("radius", corner, error.allowed, error.cure) from None


class PhaseSection(Section):
    """Elastic phase of a mesh.

    Args:
        modulus: Young's modulus, or three rows of the plane-strain stiffness.
        poisson: Poisson's ratio, beside Young's modulus.
        loss: loss factor tan δ of the stiffness.
    """

    modulus: ModulusOrStiffness
    poisson: Annotated[float, Quantity(above=-1, below=0.5)] | None = None
    loss: Loss | None = None

    def require_consistent(self) -> None:
        """Refuse a Poisson's ratio beside a stiffness, and Young's modulus without one."""
        is_isotropic = isinstance(self.modulus, FuzzyNumber)
        has_ratio = self.poisson is not None
        allowed = "poisson beside Young's modulus, none beside a stiffness"
        value = "with poisson" if has_ratio else "without poisson"
        require(has_ratio == is_isotropic, "", value, allowed)

    @property
    def nominal(self) -> AnyPhase:
        """The material at its nominal Young's modulus, if it is isotropic."""
        return self.extremes(None)[0]

    def extremes(self, level: float | None) -> tuple[AnyPhase, AnyPhase]:
        """Return the softest and the stiffest material of an α-cut, or the nominal one twice."""
        if isinstance(self.modulus, VoigtPhase):
            return self.modulus, self.modulus
        assert self.poisson is not None
        low = high = self.modulus.nominal
        if level is not None:
            low, high = self.modulus.cut(level)
        return Phase(low, self.poisson), Phase(high, self.poisson)


class MeshedCell(Section):
    """Phases of a mesh from a file, `mesh.file`, by the names of its physical groups.

    Args:
        phases: phase of each physical group.
    """

    methods: ClassVar = ("auto", "prism")
    particles: ClassVar = "mesh"  # in results

    phases: dict[str, PhaseSection]

    @property
    def constants(self) -> dict[str, FuzzyNumber]:
        """Young's moduli of isotropic phases by input, as steel_modulus."""
        return {
            f"{name}_modulus": phase.modulus
            for name, phase in self.phases.items()
            if isinstance(phase.modulus, FuzzyNumber)
        }

    @property
    def nominal_phases(self) -> PhasesByName:
        """Phases by name at the nominal values."""
        return {name: phase.nominal for name, phase in self.phases.items()}

    def extreme_phases(self, level: float | None) -> tuple[PhasesByName, PhasesByName]:
        """Return the softest and the stiffest phases of an α-cut by name, or the nominal twice."""
        extremes = {name: phase.extremes(level) for name, phase in self.phases.items()}
        soft = {name: ends[0] for name, ends in extremes.items()}
        return soft, {name: ends[1] for name, ends in extremes.items()}

    @property
    def loss_names(self) -> tuple[str, ...]:
        """Names of the loss factors as inputs, in the order of `losses`."""
        return tuple(f"{name}_loss" for name in self.phases)[: len(self.losses)]

    @property
    def losses(self) -> tuple[FuzzyNumber, ...]:
        """Loss factor of the stiffness of each phase; empty for none."""
        losses = [phase.loss for phase in self.phases.values()]
        return tuple(loss for loss in losses if loss is not None)

    def require_consistent(self) -> None:
        """Refuse losses of some phases alone."""
        for name, phase in self.phases.items():
            is_complete = phase.loss is not None or not self.losses
            key = f"cell.phases.{name}.loss"
            require(is_complete, key, None, "a loss factor of each phase, 0 for none")


SHAPES = (
    'cylinders, spheres or ellipses(ratio of axes from 1/4 to 4, degrees), as "ellipses(2, 30)"'
)


LOSSES = "matrix_loss", "inclusion_loss"


def known_lattice(value: object) -> Arrangement:
    """Return an arrangement of fibres that there is, an array as tuple, or refuse another one."""
    arrangement = cast("Arrangement", tuple(value) if isinstance(value, list) else value)
    try:
        lattice_of(arrangement)
    except RefusedError as error:
        raise RefusedError("", value, error.allowed, error.cure) from None
    return arrangement


class RoundCell(Section):
    """The two elastic phases of the periodic cell, and the shape of its particle.

    Args:
        particles: cylinders, spheres or ellipses(ratio of axes from 1/4 to 4, degrees), as
            "ellipses(2, 30)"; cylinders and ellipses in plane strain, spheres in a cubic array.
        lattice: arrangement of fibres: "square", "hexagonal" (two neighbours along x), or the sides
            [a, b] of a rectangle along x and y, whose ratio counts. Radii are over half the
            distance of the nearest fibres.
        matrix_modulus: Young's modulus of the matrix.
        matrix_poisson: Poisson's ratio of the matrix.
        inclusion_modulus: Young's modulus of the particle, or three rows of its plane-strain
            stiffness (11, 22, 12 with 2 ε12).
        inclusion_poisson: Poisson's ratio of the particle, beside its modulus.
        matrix_loss: loss factor tan δ of the matrix's stiffness, as 2 %.
        inclusion_loss: loss factor of the particle's stiffness.
        fraction: area fraction, below π/4 (in a hexagonal array π/√12), or volume fraction of
            spheres, below π/6, of particles of one size; in place of [radius].
    """

    particles: str = "cylinders"
    lattice: Annotated[Arrangement, PlainValidator(known_lattice)] = "square"
    matrix_modulus: Modulus
    matrix_poisson: Ratio
    inclusion_modulus: ModulusOrStiffness
    inclusion_poisson: Ratio | None = None
    matrix_loss: Loss | None = None
    inclusion_loss: Loss | None = None
    fraction: Radius | None = None

    @property
    def constants(self) -> dict[str, FuzzyNumber]:
        """Return the fuzzy elastic constants of matrix and particle by their keys.

        Young's moduli are in Pa. A particle that is given by a stiffness matrix has neither
        inclusion_modulus nor inclusion_poisson.
        """
        names = ("matrix_modulus", "matrix_poisson", "inclusion_modulus", "inclusion_poisson")
        numbers = {name: getattr(self, name) for name in names}
        # a stiffness of three rows is none
        return {name: x for name, x in numbers.items() if isinstance(x, FuzzyNumber)}

    @property
    def outline(self) -> Ellipse | None:
        """Return the outline of an elliptic particle in the plane; None for cylinders and spheres.

        `particles` of an ellipse is "ellipses(ASPECT, DEGREES)": the ratio of the axes, and the
        angle between the first axis and x.

        Raises:
            RefusedError: The text has another form, the ratio of the axes is not from 1/4 to 4, or
                the angle is not finite.
        """
        if self.particles in ("cylinders", "spheres"):
            return None
        number = r"\s*([-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?)\s*"
        match = re.fullmatch(rf"ellipses\({number},{number}\)", self.particles)
        if match is None:
            raise RefusedError("cell.particles", self.particles, SHAPES)
        return Ellipse(*map(float, match.groups()))

    @property
    def stiffness(self) -> VoigtPhase | None:
        """The particle where it is not isotropic."""
        modulus = self.inclusion_modulus
        return modulus if isinstance(modulus, VoigtPhase) else None

    @property
    def models(self) -> dict[str, ModelEntry]:
        """Models that can solve it by their names, the preferred one first."""
        kind = self.particles.partition("(")[0]  # without the measures of an ellipse
        return fitting_models(kind, is_isotropic=self.stiffness is None)

    @property
    def methods(self) -> tuple[str, ...]:
        """Words for the models that can solve it."""
        return "auto", *self.models

    @property
    def nominal_phases(self) -> tuple[Phase, AnyPhase]:
        """Matrix and particle at the nominal values."""
        matrix = Phase(self.matrix_modulus.nominal, self.matrix_poisson.nominal)
        if isinstance(self.inclusion_modulus, VoigtPhase):
            return matrix, self.inclusion_modulus
        assert self.inclusion_poisson is not None
        return matrix, Phase(self.inclusion_modulus.nominal, self.inclusion_poisson.nominal)

    @property
    def shape(self) -> Shape:
        """Kind of the particles, discs across fibres, and how much of the cell they fill."""
        if self.particles == "spheres":
            return SPHERES
        return replace(DISCS, factor=np.pi / lattice_of(self.lattice).area)

    @property
    def fraction_map(self) -> FractionMap | None:
        """The radius map of particles of one size; None where `fraction` is missing."""
        if self.fraction is None:
            return None
        return FractionMap(self.fraction.nominal, self.shape)

    @property
    def losses(self) -> tuple[FuzzyNumber, ...]:
        """Loss factors of the stiffness of matrix and particle; empty for none."""
        if self.matrix_loss is None or self.inclusion_loss is None:
            return ()
        return self.matrix_loss, self.inclusion_loss

    @property
    def loss_names(self) -> tuple[str, ...]:
        """Names of the loss factors as inputs, in the order of `losses`."""
        return LOSSES[: len(self.losses)]  # both, or none

    def require_consistent(self) -> None:
        """Refuse keys of the particle and of the losses that do not fit each other.

        A particle has either Young's modulus and Poisson's ratio or a plane stiffness alone;
        spheres have no stiffness of a plane. All values of `fraction` must be below the fraction at
        which particles touch their periodic images. Loss factors are given of both phases or of
        none.

        Raises:
            RefusedError: With the key that does not fit, or the shape of the particles is unknown.
        """
        outline = self.outline or circle  # `outline` refuses unknown shapes
        has_ratio = self.inclusion_poisson is not None
        is_isotropic = self.stiffness is None
        require(
            has_ratio == is_isotropic,
            "cell.inclusion_poisson",
            "there" if has_ratio else "missing",
            "a number beside Young's modulus, none beside a stiffness",
        )
        if self.particles == "spheres":
            allowed = "Young's modulus of spheres"
            require(is_isotropic, "cell.inclusion_modulus", "a plane stiffness", allowed)
            is_cubic = self.lattice == "square"
            require(is_cubic, "cell.lattice", self.lattice, '"square", the cubic array of spheres')
        # Let r be the radius divided by half the side of the cell. The largest side coordinate on
        # the outline, which is 1 at the sides, is R r, with R = reach(outline). The particle
        # touches the next cell at R r = 1, and would overlap its image beyond.
        if self.fraction is not None:
            largest = self.fraction.support.upper
            widest = 1 / reach(outline, lattice_of(self.lattice))
            touching = float(self.shape.fractions(widest))
            allowed = f"values below {touching:.6g}, where particles touch"
            require(largest < touching, "cell.fraction", f"{largest:g}", allowed)
        # A missing loss is not taken as 0: the loss of the cell would be too small unnoticed.
        has_losses = self.matrix_loss is not None or self.inclusion_loss is not None
        for name in LOSSES:
            is_complete = getattr(self, name) is not None or not has_losses
            require(is_complete, f"cell.{name}", None, "a loss of either phase, 0 for none")


PhaseModulus = Annotated[
    FuzzyNumber,
    Quantity("Pa", minimum=0, fuzzy=True, cure='"0 GPa" of a pore, or "rigid"'),
    BeforeValidator(lambda value: f"{RIGID} Pa" if value == "rigid" else value),
]


class ImageCell(Section):
    """An image of the phases of a periodic cell that is the same in depth, or its whole volume.

    Args:
        image: grey or labelled image, PNG, TIFF or .npy; of a volume a TIFF stack, a folder of
            slices, .npy, .mhd or .nhdr.
        pixel: side of a pixel, or its width and height.
        voxel: side of a voxel, or those along x, y and z, in place of pixel: the image is a volume.
        override: what a volume states wrongly: that of the case is taken.
        threshold: grey value from which on a pixel is of the next phase.
        labels: value of each phase in a labelled image, instead of threshold.
        modulus: Young's modulus of each phase, dark first: 0 of a pore, or rigid.
        poisson: Poisson's ratio of each phase.
        loss: loss factor tan δ of each phase's Young's modulus at real ν.
    """

    methods: ClassVar = ("auto",)
    particles: ClassVar = "image"

    image: CasePath
    pixel: OneOrMany[Length] | None = None
    voxel: OneOrMany[Length] | None = None
    override: list[Literal["voxel"]] = Field([])
    threshold: tuple[Number, ...] | None = None
    labels: tuple[Annotated[float, Quantity()], ...] | None = None
    modulus: tuple[PhaseModulus, ...]
    poisson: OneOrMany[Ratio]
    loss: OneOrMany[Loss] | None = None

    @property
    def pairs(self) -> tuple[tuple[FuzzyNumber, FuzzyNumber], ...]:
        """E and ν of each phase."""
        return tuple(zip(self.modulus, self._of_phases(self.poisson), strict=True))

    def _of_phases(self, values: tuple[FuzzyNumber, ...]) -> tuple[FuzzyNumber, ...]:
        """Return one value for each phase; a single one holds for all of them."""
        if len(values) == 1:
            return values * len(self.modulus)
        return values

    @property
    def is_solid(self) -> list[bool]:
        """Whether each phase is neither a pore nor rigid, throughout its support."""
        # a phase that may be a pore at some level has no lower bound of its own
        return [young.support.lower > 0 and young.support.upper < RIGID for young in self.modulus]

    @property
    def losses(self) -> tuple[FuzzyNumber, ...]:
        """Loss factors of the stiffness of each phase; empty for none."""
        return self._of_phases(self.loss or ())

    def require_consistent(self) -> None:
        """Refuse keys that exclude each other, and wrong numbers of values for the phases.

        The phases come either from `labels`, one phase for each label, or from `threshold`, one
        phase more than thresholds. Young's modulus has a value for each phase. Poisson's ratio has
        one for each or one for all, and so has the loss factor, which may also be missing. An image
        has `pixel`: one side, or width and height. A volume has `voxel`: one side, or the sides
        along x, y and z.

        Raises:
            RefusedError: With the key that does not fit; no phase is solid; or there are loss
                factors beside a pore or a rigid phase.
        """
        self._require_one("threshold", "labels")
        n_phases = len(self.labels or ())
        if self.threshold:
            n_phases = len(self.threshold) + 1
        counts = {"modulus": (n_phases,), "poisson": (1, n_phases), "loss": (0, 1, n_phases)}
        for key, fitting in counts.items():
            n_values = len(getattr(self, key) or ())
            allowed = f"one for each of {n_phases} phases"
            require(n_values in fitting, f"cell.{key}", f"{n_values} values", allowed)
        # Bounds of E follow from the moduli of the phases. A pore gives no lower bound and a rigid
        # phase no upper one, so that without any other phase nothing is bounded.
        allowed = "a phase that is neither a pore nor rigid"
        require(any(self.is_solid), "cell.modulus", "none between 0 and rigid", allowed)
        # A pore and a rigid phase store no energy, so that their loss factors would mean nothing.
        is_possible = all(self.is_solid) or not self.loss
        cure = "pores in one material leave its loss factor; else take a small modulus for pores"
        require(is_possible, "cell.loss", "there", "none beside a pore or a rigid phase", cure)
        self._require_one("pixel", "voxel")
        n_sides = len(self.pixel or ())
        require(n_sides <= 2, "cell.pixel", n_sides, "a side, or a width and a height")
        n_sides = len(self.voxel or ())
        require(n_sides in (0, 1, 3), "cell.voxel", n_sides, "a side, or those along x, y and z")

    def _require_one(self, key: str, other: str) -> None:
        """Refuse both of two keys, and neither."""
        is_there = bool(getattr(self, key))
        has_other = bool(getattr(self, other))
        allowed = f"one of cell.{key} and cell.{other}"
        require(is_there or has_other, f"cell.{key}", None, allowed)
        require(not (is_there and has_other), f"cell.{key}", f"beside cell.{other}", allowed)

    @property
    def dimension(self) -> int:
        """2 of an image, 3 of a volume."""
        return 3 if self.voxel else 2

    @property
    def lengths(self) -> tuple[float, ...]:
        """Sides of a pixel along (y, x) or of a voxel along (z, y, x), in m."""
        lengths: tuple[float, ...] = self.voxel or self.pixel or ()
        if len(lengths) == 1:
            return lengths * self.dimension
        return lengths[::-1]  # as the axes of arrays


def _cell_kind(table: Mapping[str, object]) -> str:
    """Kind of a cell by a key that it alone has."""
    # Without a tag Pydantic would try all kinds, and tell the errors of each.
    if "image" in table:
        return "<image>"
    return "<mesh>" if "phases" in table else "<round>"


Cell = Annotated[
    Annotated[AtFirstUse[RoundCell], Tag("<round>")]
    | Annotated[AtFirstUse[ImageCell], Tag("<image>")]
    | Annotated[AtFirstUse[MeshedCell], Tag("<mesh>")],
    Discriminator(_cell_kind),
]

AnyLaw = Annotated[
    Annotated[AtFirstUse[RadiusMapSection], Tag("<map>")]
    | Annotated[AtFirstUse[ThetaSection], Tag("<law>")],
    Discriminator(lambda table: "<law>" if set(table) <= {"theta"} else "<map>"),
]


class Mesh(Section):
    """Discretisation of the product domain.

    Args:
        file: mesh of Gmsh in place of size and layers: prisms of 15 nodes over a parallelogram or
            hexagon and θ, or its triangles alone; its physical groups are the phases of
            [cell.phases].
        refine: whether to refine the mesh of a file once, for a declared error.
        bounds: whether to prove bounds of the constants of a mesh from a file, for its geometry.
        layers: element layers in θ, of method prism.
        size: element size over half the cell's side.
    """

    file: CaseFile | None = None
    refine: bool = False
    bounds: bool = False
    layers: Annotated[int, Quantity(minimum=1, maximum=10_000, is_integer=True)] = 12
    size: Annotated[float, Quantity(minimum=0.005, below=1)] = 0.15


def known_method(name: str) -> str:
    """Return a word for a model of the cell, or refuse another one."""
    is_known = name == "auto" or name in known_names(name)
    require(is_known, "", name, ", ".join(["auto", *known_names()]))
    return name


class ModulusSection(Section):
    """Computation of the fuzzy modulus.

    Args:
        method: model of the cell; auto is the first that fits, which is the series.
        plan: samples of the transformation method.
        alpha: α-levels.
        tolerance: relative error of E that is allowed.
        average: E of a plane: isotropic, of the average over all directions; axes, of the paper's
            eq. 16.
    """

    method: Annotated[str, after(known_method)] = "auto"
    plan: Literal["general", "reduced", "signed"] = "general"
    alpha: Levels = ALPHA
    tolerance: Annotated[float, Quantity(minimum=1e-10, maximum=0.1)] | None = None
    average: Literal["axes", "isotropic"] = "isotropic"
