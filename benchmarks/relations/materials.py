"""Random cells, images and packings, and the relations of their stiffness and their maps."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import Any

import numpy as np
import xarray as xr
from scipy.ndimage import gaussian_filter

from alphacut.base.arrays import Array
from alphacut.rve import Ellipse, Phase, SeriesModel, SlicesModel
from alphacut.rve.image.model import solve_image
from alphacut.stochastic import HermiteMap
from alphacut.stochastic.microstructure import RadiusLimits, fit_map
from alphacut.stochastic.particles.packing import Packing
from alphacut.stochastic.particles.packings import Packings
from alphacut.stochastic.particles.particles import Particles
from alphacut.stochastic.particles.radius_distributions import LogNormalRadii
from alphacut.stochastic.particles.shapes import DISCS, SPHERES
from alphacut.stochastic.sections import reduced_radii, with_cells
from benchmarks.relations.relation import ROUNDED, Chance, Kind, Problem, Relation
from benchmarks.relations.stated import of_values

EXACT = 1e-8
"""Relative error of what rounding alone tells from the truth, where no error is declared."""


def _power_of_two(chance: Chance) -> float:
    return float(2.0 ** chance.integers(-10, 11))


OTHER_UNITS = Relation(
    "other units", lambda x, chance: {"unit": _power_of_two(chance)}, within=ROUNDED
)


def drawn_cell(chance: Chance) -> Problem:
    """A cell with a disc or an ellipse of a random radius, stiffer or softer than the matrix.

    `radii` are a1 … a4, `moduli` in GPa, `turn` is in degrees, `size` of the mesh of the slices,
    None for the series; `unit` is that of the moduli over GPa.
    """
    a1, a3 = chance.uniform(0.15, 0.3), chance.uniform(0.5, 0.6)
    aspect, turn = 1.0, 0.0
    if chance.random() < 0.5:
        aspect, turn = float(chance.uniform(1.1, 1.5)), float(chance.uniform(0, 90))
    return {
        "radii": (a1, chance.uniform(0, 0.1), a3, chance.uniform(0, 0.1)),
        "moduli": (20.0, float(np.exp(chance.uniform(0, 6)))),
        "poisson": chance.uniform(0.1, 0.35, 2),
        "aspect": aspect,
        "turn": turn,
        "size": None if aspect == 1.0 else 0.4,
        "unit": 1.0,
    }


def stated_of_cell(cell: Problem) -> xr.Dataset:
    """C11 + C12, C11 − C12 and C33 of the square part, in GPa, and their declared errors."""
    model: Any = SeriesModel()
    if cell["size"] is not None:
        outline = Ellipse(cell["aspect"], cell["turn"])
        model = SlicesModel(mesh_size=cell["size"], points=4, outline=outline)
    pascal = 1e9 * cell["unit"]
    pairs = zip(cell["moduli"], cell["poisson"], strict=True)
    matrix, particle = (Phase(modulus * pascal, float(nu)) for modulus, nu in pairs)
    (result,) = model.solve(HermiteMap(*cell["radii"]), matrix, [particle])
    error = sum(result.errors.values()) + EXACT
    C = result.stiffness / pascal
    axes = (C[0, 0] + C[1, 1]) / 2  # which a quarter turn keeps
    square = {"C11 + C12": axes + C[0, 1], "C11 - C12": axes - C[0, 1], "C33": C[2, 2]}
    with_errors = zip(square.items(), error, strict=True)
    return of_values({name: (x, x * e) for (name, x), e in with_errors if np.isfinite(e)})


def drawn_image(chance: Chance) -> Problem:
    """A periodic image of two phases: smooth noise, cut at a random grey value.

    `mask` is where the second phase is, `bulk` and `shear` are of both phases, `quarters` counts
    quarter turns.
    """
    grey = gaussian_filter(chance.normal(size=(12, 12)), 1.5, mode="wrap")
    bulk, shear = chance.uniform(10, 60, 2), chance.uniform(5, 30, 2)
    mask = grey > np.quantile(grey, chance.uniform(0.3, 0.7))
    return {"mask": mask, "bulk": bulk, "shear": shear, "quarters": 0, "unit": 1.0}


def stated_of_image(image: Problem) -> xr.Dataset:
    """The middle and half the width of proved bounds, along the axes of the first image."""
    moduli = [image["unit"] * image[name][image["mask"].astype(int)] for name in ("bulk", "shear")]
    bounds = solve_image(*moduli).bounds
    order = [1, 0, 2] if image["quarters"] % 2 else [0, 1, 2]
    low, high = (np.diag(x)[order] / image["unit"] for x in (bounds.lower, bounds.upper))
    ends = zip((low + high) / 2, (high - low) / 2, strict=True)
    return of_values(dict(zip(("C11", "C22", "C33"), ends, strict=True)))


def of_mask(name: str, change: Callable[[Array, Chance], Array]) -> Relation:
    """The image with its pixels elsewhere."""
    return Relation(name, lambda x, chance: {"mask": change(x["mask"], chance)})


def drawn_packings(chance: Chance) -> Problem:
    """Five periodic packings of discs or spheres, radii over a factor up to three."""
    spheres = chance.random() < 0.3
    radii = LogNormalRadii(1e-3, 1e-3 * float(chance.uniform(1.5, 3)))
    fraction = float(chance.uniform(0.1, 0.2 if spheres else 0.4))
    packing = Packing(40, fraction, radii, SPHERES if spheres else DISCS)
    seed = int(chance.integers(1 << 30))
    return {"packing": packing, "seed": seed, "particles": [*Packings.make(packing, 5, seed=seed)]}


def stated_of_packings(packings: Problem) -> xr.Dataset:
    """Limits, slopes and shares of the radius map of their cells."""
    particles, packing = packings["particles"], packings["packing"]
    sample = reduced_radii([with_cells(x) for x in particles])
    rule = RadiusLimits(packing.shape, packed_fraction=packing.fraction)
    fit = fit_map(rule, sample, seed=0)
    pbox = fit.pbox
    numbers = {"a1": pbox.fit.a1, "a3": pbox.fit.a3, "band": fit.band}
    numbers |= {f"a2[{i}]": x for i, x in enumerate(pbox.a2)}
    numbers |= {f"a4[{i}]": x for i, x in enumerate(pbox.a4)}
    numbers |= {"mean r_n": float(sample.values @ sample.weights / sample.weights.sum())}
    numbers |= {"fraction": float(np.mean([x.fraction for x in particles]))}
    return of_values({name: (x, EXACT) for name, x in numbers.items()})


def by_processes(start: str) -> Relation:
    """The packings made by processes that are forked or spawned."""

    def changed(packings: Problem, chance: Chance) -> Problem:
        with ProcessPoolExecutor(2, get_context(start)) as pool:
            made = Packings.make(packings["packing"], 5, seed=packings["seed"], executor=pool)
        return {"particles": [*made]}

    return Relation(f"{start}ed processes", changed, within=0.0)


def moved(
    name: str, change: Callable[[Array, Array, Array, Chance], tuple[Array, ...]]
) -> Relation:
    """The packings with centres, radii and size changed."""

    def changed(packings: Problem, chance: Chance) -> Problem:
        parts = [(x.centres, x.radii, x.size) for x in packings["particles"]]
        return {"particles": [Particles(*change(*part, chance)) for part in parts]}

    return Relation(name, changed, within=ROUNDED)


CELLS = Kind(
    drawn_cell,
    stated_of_cell,
    (
        OTHER_UNITS,
        Relation("turned by 90°", lambda x, chance: {"turn": x["turn"] + 90}),
        Relation("mirrored", lambda x, chance: {"turn": -x["turn"]}),
        Relation("half the mesh size", lambda x, chance: x["size"] and {"size": x["size"] / 2}),
        Relation("by the slices", lambda x, chance: None if x["size"] else {"size": 0.4}),
    ),
)
IMAGES = Kind(
    drawn_image,
    stated_of_image,
    (
        OTHER_UNITS,
        Relation(
            "turned", lambda x, chance: {"mask": np.rot90(x["mask"]), "quarters": x["quarters"] + 1}
        ),
        of_mask("tiled", lambda mask, chance: np.tile(mask, (1, 2))),
        of_mask("shifted", lambda mask, chance: np.roll(mask, chance.integers(1, 12, 2), (0, 1))),
        of_mask("mirrored", lambda mask, chance: mask[::-1]),
        Relation(
            "phases exchanged",
            lambda x, chance: {
                "mask": ~x["mask"],
                "bulk": x["bulk"][::-1],
                "shear": x["shear"][::-1],
            },
        ),
    ),
)
PACKINGS = Kind(
    drawn_packings,
    stated_of_packings,
    (
        *(by_processes("fork"), by_processes("spawn")),
        moved("scaled", lambda x, r, size, chance: (512 * x, 512 * r, 512 * size)),
        moved("shifted", lambda x, r, size, chance: (x + chance.random(len(size)) * size, r, size)),
        moved("mirrored", lambda x, r, size, chance: (size - x, r, size)),
        moved("axes exchanged", lambda x, r, size, chance: (x[:, ::-1], r, size[::-1])),
        moved("in another order", lambda x, r, size, chance: (x[::-1], r[::-1], size)),
    ),
)
