"""Sections on the material: random radius, phases, mesh, modulus and stress of the cell."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal, get_args

from alphacut.case.key import (
    ALPHA,
    COUNT,
    DEVIATIONS,
    MEMBERSHIP,
    POISSON,
    UNIT,
    Key,
    Range,
    Section,
    keys_of,
    positive,
)
from alphacut.case.sections.picture import Picture
from alphacut.fuzzy import FuzzyNumber
from alphacut.stochastic import Beta, ThetaLaw, TruncatedNormal
from alphacut.stochastic.radius_map import Kind, MapFamily
from alphacut.stochastic.theta.law import LARGEST_EXPONENT

CellMethod = Literal["prism", "slices", "series", "auto"]
PlanName = Literal["general", "reduced", "extended", "signed"]
Particles = Literal["cylinders", "spheres"]
LawName = Literal["normal", "uniform", "beta"]
SPHERE_METHODS = ("series", "auto")
CELL_METHODS: tuple[str, ...] = get_args(CellMethod)
PLANS: tuple[str, ...] = get_args(PlanName)


@dataclass(frozen=True, kw_only=True, slots=True)
class Radius(Section):
    """Random radius of the particle over half the cell's side.

    A map of the random variable θ: the cubic Hermite map of a truncated normal θ (eq. 12), or
    another map or law.
    """

    theta: Annotated[
        tuple[float, ...],
        Key("support of θ, of the normal law in standard deviations", allowed=DEVIATIONS),
    ] = (-3.0, 3.0)
    law: Annotated[
        LawName,
        Key(
            "law of θ: normal, a standard normal cut to the support; uniform; or beta, with the"
            " exponents"
        ),
    ] = "normal"
    exponents: Annotated[
        tuple[float, ...] | None,
        Key(
            "p and q of the beta law, whose density is as ξ^(p-1) (1-ξ)^(q-1), ξ from 0 to 1 over"
            " the support",
            allowed=Range(
                f"from 1 to {LARGEST_EXPONENT:g}", 1.0, upper=LARGEST_EXPONENT, closed=True
            ),
        ),
    ] = None
    map: Annotated[
        Kind,
        Key(
            "radius over ξ: hermite, the cubic with the slopes a2 and a4; linear from a1 to a3; or"
            " exponential, a1 (a3/a1)^ξ"
        ),
    ] = "hermite"
    a1: Annotated[FuzzyNumber, Key("radius at the lower end of θ", allowed=UNIT)]
    a3: Annotated[FuzzyNumber, Key("radius at the upper end of θ", allowed=UNIT)]
    a2: Annotated[
        FuzzyNumber | None,
        Key("slope dr/dξ at the lower end; needed by map hermite", beside=("map", "hermite")),
    ] = None
    a4: Annotated[
        FuzzyNumber | None,
        Key("slope dr/dξ at the upper end; needed by map hermite", beside=("map", "hermite")),
    ] = None

    @property
    def numbers(self) -> dict[str, FuzzyNumber]:
        """Parameters of the map by name: of eq. 12 the factors a1 … a4 of its functions."""
        given = {"a1": self.a1, "a2": self.a2, "a3": self.a3, "a4": self.a4}
        kept = ((name, given[name]) for name in self.family.names)
        return {name: number for name, number in kept if number is not None}

    @property
    def family(self) -> MapFamily:
        """The maps of this kind, under the law of θ."""
        return MapFamily(self.map, self.distribution)

    @property
    def distribution(self) -> ThetaLaw:
        """The law of θ."""
        lower, upper = self.theta[0], self.theta[1]
        if self.law == "normal":
            return TruncatedNormal(lower, upper)
        p, q = (1.0, 1.0) if self.exponents is None else self.exponents
        return Beta(p, q, lower, upper)


@dataclass(frozen=True, kw_only=True, slots=True)
class Cell(Section):
    """The two elastic phases of the periodic cell, and the shape of its particle."""

    particles: Annotated[
        Particles,
        Key(
            "shape of the particle: cylinders in plane strain, as the paper's, or spheres in"
            " a simple cubic array"
        ),
    ] = "cylinders"
    matrix_modulus: Annotated[FuzzyNumber, positive("Young's modulus of the matrix", "Pa")]
    matrix_poisson: Annotated[FuzzyNumber, Key("Poisson's ratio of the matrix", allowed=POISSON)]
    inclusion_modulus: Annotated[FuzzyNumber, positive("Young's modulus of the particle", "Pa")]
    inclusion_poisson: Annotated[
        FuzzyNumber, Key("Poisson's ratio of the particle", allowed=POISSON)
    ]


@dataclass(frozen=True, kw_only=True, slots=True)
class CellTable(Section):
    """The periodic cell: two elastic phases and a round particle, or a picture.

    Of an image of its phases, in plane strain, stage image gives proved bounds.
    """

    parts: ClassVar[tuple[type[Section], ...]] = (Cell, Picture)
    unless: ClassVar[tuple[str, ...]] = tuple(keys_of(Picture))


@dataclass(frozen=True, kw_only=True, slots=True)
class Mesh(Section):
    """Discretisation of the product domain."""

    layers: Annotated[int, Key("element layers in θ", allowed=COUNT)] = 12
    size: Annotated[
        float,
        Key(
            "element size over half the cell's side",
            allowed=Range("from 0.005 to below 1", 0.005, 1.0, closed=True, below=True),
        ),
    ] = 0.15
    interface: Annotated[
        Literal["conforming", "sign"], Key("conforming, or sign(z) at quadrature points (eq. 13)")
    ] = "conforming"


@dataclass(frozen=True, kw_only=True, slots=True)
class Modulus(Section):
    """The fuzzy modulus: how it is computed, or what stands in for it."""

    method: Annotated[CellMethod, Key("model of the cell")] = "prism"
    plan: Annotated[PlanName, Key("samples of the transformation method")] = "general"
    alpha: Annotated[tuple[float, ...], Key("α-levels", allowed=MEMBERSHIP)] = ALPHA
    tolerance: Annotated[
        float,
        Key(
            "relative tolerance on E, for method auto",
            allowed=Range("from 1e-10 to 0.1", 1e-10, 0.1, closed=True),
        ),
    ] = 0.0001
    average: Annotated[
        Literal["axes", "isotropic"],
        Key(
            "what E of cylinders and images is of: the isotropic average of the whole plane"
            " stiffness, or axes, the paper's eq. 16 with the shear along the axes"
        ),
    ] = "isotropic"
    value: Annotated[
        FuzzyNumber | None, positive("a known modulus instead of a computed one", "Pa")
    ] = None
    file: Annotated[
        str | None, Key("α-cuts from a NetCDF file instead of computed ones", file=True)
    ] = None
    measured: Annotated[
        str | None, Key("CSV file of measured moduli instead of computed ones", file=True)
    ] = None
    claim: Annotated[
        str,
        Key(
            "what the cuts of measured moduli hold with probability 1 - α: next value,"
            " mean, median or quantile Q"
        ),
    ] = "next value"
    bounds: Annotated[
        FuzzyNumber | None,
        positive("physically possible moduli, two numbers; needed with measured ones", "Pa"),
    ] = None
    law: Annotated[
        Literal["normal", "log-normal"] | None, Key("law of measured moduli, where it is known")
    ] = None


@dataclass(frozen=True, kw_only=True, slots=True)
class Response(Section):
    """Random stress of the cell beside its mean.

    Its p-box, fuzzy quantiles, and the fuzzy probability of exceeding a limit.
    """

    quantity: Annotated[
        Literal["s11", "s12"],
        Key("homogenised stress 11 under ε11 = ε22 = 0.01, or 12 under ε12 = 0.01"),
    ] = "s11"
    quantiles: Annotated[
        tuple[float, ...], Key("probabilities whose quantiles are wanted", allowed=UNIT)
    ] = (0.05, 0.5, 0.95)
    limit: Annotated[
        float | None, positive("stress whose probability of being exceeded is wanted", "Pa")
    ] = None
