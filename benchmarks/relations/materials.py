"""Random cells, images and packings, and the relations of their stiffness and their maps."""

from __future__ import annotations

from concurrent.futures import Executor, ProcessPoolExecutor
from dataclasses import dataclass, replace
from multiprocessing import get_context
from typing import Any, Self

import numpy as np
from scipy.ndimage import gaussian_filter

from alphacut.fuzzy.arrays import Array
from alphacut.rve import Ellipse, Phase, SeriesModel, SlicesModel
from alphacut.rve.image.solve import solve_image
from alphacut.rve.outline import circle
from alphacut.stochastic import HermiteMap
from alphacut.stochastic.microstructure import MicrostructureStudy, fitted_map
from alphacut.stochastic.particles.packing import Packing
from alphacut.stochastic.particles.particles import DISCS, SPHERES, Particles
from alphacut.stochastic.particles.radius_laws import LogNormalRadii
from alphacut.stochastic.sections import Simulated, reduced_radii, with_cells
from benchmarks.relations.relation import ROUNDED, Chance, Relation
from benchmarks.relations.stated import Stated

EXACT = 1e-8
"""Relative error of what rounding alone tells from the truth, where no error is declared."""


def _unit(chance: Chance) -> float:
    """A power of two."""
    return float(2.0 ** chance.integers(-10, 11))


@dataclass(frozen=True, eq=False)
class RoundCell:
    """A cell with one particle of a random radius.

    Args:
        radii: a1 … a4 of the map.
        moduli: Of matrix and inclusion, in GPa.
        poisson: Their Poisson's ratios.
        aspect: Of the ellipse; 1 for a disc.
        turn: Of its first axis, in degrees.
        size: Mesh size of the slices; None for the series.
        unit: Unit of the moduli over GPa.
    """

    radii: tuple[float, float, float, float]
    moduli: tuple[float, float]
    poisson: tuple[float, float]
    aspect: float = 1.0
    turn: float = 0.0
    size: float | None = None
    unit: float = 1.0

    @classmethod
    def drawn(cls, chance: Chance) -> Self:
        """A disc or an ellipse, stiffer or softer than the matrix."""
        a1, a3 = chance.uniform(0.15, 0.3), chance.uniform(0.5, 0.6)
        aspect, turn = 1.0, 0.0
        if chance.random() < 0.5:
            aspect, turn = float(chance.uniform(1.1, 1.5)), float(chance.uniform(0, 90))
        return cls(
            (float(a1), float(chance.uniform(0, 0.1)), float(a3), float(chance.uniform(0, 0.1))),
            (20.0, float(np.exp(chance.uniform(0, 6)))),
            (float(chance.uniform(0.1, 0.35)), float(chance.uniform(0.1, 0.35))),
            aspect,
            turn,
            None if aspect == 1.0 else 0.4,
        )

    def stated(self) -> Stated:
        """C11 + C12, C11 − C12 and C33 of the square part, in GPa, and their declared errors."""
        outline = circle if self.aspect == 1 else Ellipse(self.aspect, self.turn)
        model: Any = SeriesModel()
        if self.size is not None:
            model = SlicesModel(mesh_size=self.size, points=4, outline=outline)
        phases = [
            Phase(modulus * self.unit * 1e9, poisson)
            for modulus, poisson in zip(self.moduli, self.poisson, strict=True)
        ]
        (result,) = model.solve(HermiteMap(*self.radii), phases[0], phases[1:])
        error = sum(result.errors.values()) + EXACT  # of C11 + C12, C11 − C12 and C33
        C = result.stiffness / (self.unit * 1e9)
        axes = (C[0, 0] + C[1, 1]) / 2  # which a quarter turn keeps
        square = {"C11 + C12": axes + C[0, 1], "C11 - C12": axes - C[0, 1], "C33": C[2, 2]}
        pairs = zip(square.items(), error, strict=True)
        return Stated.of_values({name: (x, x * e) for (name, x), e in pairs if np.isfinite(e)})


@dataclass(frozen=True, eq=False)
class Image:
    """A periodic image of two phases.

    Args:
        mask: Where the second phase is, shape (rows, columns).
        bulk: Plane-strain bulk moduli of both phases.
        shear: Their shear moduli.
        quarters: Quarter turns from the first image, an even number of them leaves its axes.
        unit: Unit of the moduli.
    """

    mask: Array
    bulk: tuple[float, float]
    shear: tuple[float, float]
    quarters: int = 0
    unit: float = 1.0

    @classmethod
    def drawn(cls, chance: Chance) -> Self:
        """Smooth noise, cut at a random grey value."""
        grey = gaussian_filter(chance.normal(size=(12, 12)), 1.5, mode="wrap")
        bulk, shear = chance.uniform(10, 60, 2), chance.uniform(5, 30, 2)
        mask = grey > np.quantile(grey, chance.uniform(0.3, 0.7))
        return cls(mask, tuple(map(float, bulk)), tuple(map(float, shear)))  # type: ignore[arg-type]

    def stated(self) -> Stated:
        """Proved bounds of the moduli, along the axes of the first image."""
        moduli = [np.where(self.mask, x[1], x[0]) * self.unit for x in (self.bulk, self.shear)]
        bounds = solve_image(*moduli).bounds
        order = [1, 0, 2] if self.quarters % 2 else [0, 1, 2]
        ends = [np.diag(x)[order] / self.unit for x in (bounds.lower, bounds.upper)]
        return Stated.of_ends(
            dict(zip(("C11", "C22", "C33"), zip(*ends, strict=True), strict=True))
        )


def _turned(image: Image, chance: Chance) -> Image:
    return replace(image, mask=np.rot90(image.mask), quarters=image.quarters + 1)


def _tiled(image: Image, chance: Chance) -> Image:
    return replace(image, mask=np.tile(image.mask, (1, 2)))


def _exchanged(image: Image, chance: Chance) -> Image:
    return replace(image, mask=~image.mask, bulk=image.bulk[::-1], shear=image.shear[::-1])


def _rolled(image: Image, chance: Chance) -> Image:
    return replace(image, mask=np.roll(image.mask, chance.integers(1, 12, 2), (0, 1)))


@dataclass(frozen=True, eq=False)
class Sections:
    """Periodic packings, and the radius map of their cells.

    Args:
        source: What five packings are made by.
        seed: Of them.
        packings: Their particles.
    """

    source: Simulated
    seed: int
    packings: tuple[Particles, ...]

    @classmethod
    def drawn(cls, chance: Chance) -> Self:
        """Discs or spheres, radii over a factor up to three."""
        spheres = chance.random() < 0.3
        radii = LogNormalRadii(1e-3, 1e-3 * float(chance.uniform(1.5, 3)))
        fraction = float(chance.uniform(0.1, 0.2 if spheres else 0.4))
        packing = Packing(40, fraction, radii, SPHERES if spheres else DISCS)
        return cls._packed(Simulated(packing, 5), int(chance.integers(1 << 30)), None)

    @classmethod
    def _packed(cls, source: Simulated, seed: int, executor: Executor | None) -> Self:
        sections = source.sections(seed, executor=executor)
        return cls(source, seed, tuple(section.particles for section in sections))

    def by_processes(self, start: str) -> Self:
        """The packings made by processes that are forked or spawned."""
        with ProcessPoolExecutor(2, get_context(start)) as pool:
            return self._packed(self.source, self.seed, pool)

    def stated(self) -> Stated:
        """Limits, slopes and shares of the map."""
        sample = reduced_radii([with_cells(particles) for particles in self.packings])
        _, pbox, _, band = fitted_map(MicrostructureStudy(self.source), sample)
        numbers = {"a1": pbox.fit.a1, "a3": pbox.fit.a3, "band": band}
        numbers |= {f"a2[{i}]": x for i, x in enumerate(pbox.a2)}
        numbers |= {f"a4[{i}]": x for i, x in enumerate(pbox.a4)}
        numbers |= {"mean r_n": float(sample.values @ sample.weights / sample.weights.sum())}
        numbers |= {"fraction": float(np.mean([x.fraction for x in self.packings]))}
        return Stated.of_values({name: (x, EXACT) for name, x in numbers.items()})

    def moved(self, change: Any) -> Sections:
        """The packings with centres, radii and size changed."""
        made = [Particles(*change(x.centres, x.radii, x.size)) for x in self.packings]
        return replace(self, packings=tuple(made))


def _scaled(sections: Sections, chance: Chance) -> Sections:
    unit = 1e3 * _unit(chance)
    return sections.moved(lambda x, r, size: (x * unit, r * unit, size * unit))


def _shifted(sections: Sections, chance: Chance) -> Sections:
    return sections.moved(lambda x, r, size: (x + chance.random(len(size)) * size, r, size))


CELLS = (
    Relation("other units", lambda x, chance: replace(x, unit=_unit(chance)), within=ROUNDED),
    Relation("turned by 90°", lambda x, chance: replace(x, turn=x.turn + 90)),
    Relation("mirrored", lambda x, chance: replace(x, turn=-x.turn)),
    Relation("half the mesh size", lambda x, chance: x.size and replace(x, size=x.size / 2)),
    Relation("by the slices", lambda x, chance: replace(x, size=0.4) if x.size is None else None),
)
IMAGES = (
    Relation("other units", lambda x, chance: replace(x, unit=_unit(chance)), within=ROUNDED),
    Relation("turned", _turned),
    Relation("tiled", _tiled),
    Relation("shifted", _rolled),
    Relation("mirrored", lambda x, chance: replace(x, mask=x.mask[::-1])),
    Relation("phases exchanged", _exchanged),
)
PACKINGS = (
    Relation("forked processes", lambda x, chance: x.by_processes("fork"), within=0.0),
    Relation("spawned processes", lambda x, chance: x.by_processes("spawn"), within=0.0),
    Relation("scaled", _scaled, within=ROUNDED),
    Relation("shifted", _shifted, within=ROUNDED),
    Relation("mirrored", lambda x, c: x.moved(lambda p, r, s: (s - p, r, s)), within=ROUNDED),
    Relation(
        "axes exchanged",
        lambda x, c: x.moved(lambda p, r, s: (p[:, ::-1], r, s[::-1])),
        within=ROUNDED,
    ),
    Relation(
        "in another order",
        lambda x, c: x.moved(lambda p, r, s: (p[::-1], r[::-1], s)),
        within=ROUNDED,
    ),
)
