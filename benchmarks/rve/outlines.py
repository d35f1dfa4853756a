"""Ellipses and stars by slices and prisms: declared against true errors of the three moduli.

    ./enter python -m benchmarks.rve.outlines --shapes 150

Each shape has a random size and random phases and is solved at mesh sizes 0.15, 0.3 and 0.6. The
truth is by elements of order 8 on two finer meshes, which must agree to a tenth of what is
declared. Prints the seed, the values that lie outside and the median of declared over true; exit
status 1 if more than 0.5 % lie outside or the median is above 10.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.refused import FailedError, RefusedError
from alphacut.rve.cell.cell import Phase
from alphacut.rve.cell.outline import Ellipse, Outline, reach
from alphacut.rve.mesh.curved import plane_mesh
from alphacut.rve.prism.model import PrismModel
from alphacut.rve.result.moduli import square_moduli
from alphacut.rve.slices.model import SlicesModel
from alphacut.rve.slices.plane_cell import PlaneCell
from alphacut.stochastic import HermiteMap

SIZES = 0.15, 0.3, 0.6
FINER = 0.12, 0.17
ROUNDING = 1e-12  # of the truth, relative
MOST_OUTSIDE, MOST_MEDIAN = 0.005, 10.0


@dataclass(frozen=True)
class Star:
    """Outline with lobes.

    Args:
        lobes: Their number.
        height: Amplitude over the mean radius.
        turn: Angle of the first lobe, in rad.
    """

    lobes: int
    height: float
    turn: float

    def __call__(self, angle: Array) -> Array:
        """Distances over ρ at angles."""
        return np.asarray(1 + self.height * np.cos(self.lobes * (angle - self.turn)))


@dataclass(frozen=True)
class Shape:
    """A particle of constant radius with its phases."""

    outline: Outline
    radius: float
    matrix: Phase
    inclusion: Phase

    def truth(self, size: float) -> Array:
        """The three moduli by elements of order 8, shape (3,), in Pa."""
        cell = PlaneCell(plane_mesh(self.radius, size=size, outline=self.outline), 8)
        return square_moduli(cell.stiffness((self.matrix.stiffness, self.inclusion.stiffness)))


def draw(rng: np.random.Generator) -> Shape:
    """An ellipse or a star, contrasts from 1e-3 to 1e3."""
    if rng.random() < 0.5:
        outline: Outline = Ellipse(float(np.exp(rng.uniform(-1.38, 1.38))), rng.uniform(0, 180))
    else:
        star = int(rng.integers(3, 9)), float(rng.uniform(0.03, 0.3))
        outline = Star(*star, float(rng.uniform(0, 2 * np.pi)))
    radius = float(rng.uniform(0.05, 0.95)) / reach(outline)
    ratios = rng.uniform(0, 0.45, 2)
    inclusion = Phase(20e9 * 10 ** rng.uniform(-3, 3), float(ratios[1]))
    return Shape(outline, radius, Phase(20e9, float(ratios[0])), inclusion)


def judged(shape: Shape) -> Iterator[tuple[str, float, Array, Array]]:
    """Model, mesh size, declared and true errors of the moduli that the truth can judge."""
    parts = HermiteMap(shape.radius, 0, shape.radius, 0), shape.matrix, [shape.inclusion]
    first, second = (shape.truth(size) for size in FINER)
    doubt = abs(first / second - 1)
    for size in SIZES:
        models = [
            SlicesModel(mesh_size=size, points=2, outline=shape.outline),
            PrismModel(size, 2, stiffness=True, outline=shape.outline),
        ]
        for model in models:
            try:
                result = model.solve(*parts)[0]
            except (FailedError, RefusedError) as refusal:
                print(f"{model.name} at {size}: refused: {refusal}", flush=True)
                continue
            declared = result.modulus_errors
            clear = doubt <= declared / 10
            yield model.name, size, declared[clear], abs(result.moduli / first - 1)[clear]


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table; exit 1 if errors do not cover or are far too large."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--shapes", type=int, default=150)
    parser.add_argument("--seed", type=int, default=int(np.random.default_rng().integers(10**9)))
    options = parser.parse_args(arguments)
    print(f"seed {options.seed}")
    rows: dict[tuple[str, float], list[Array]] = {}
    for number in range(options.shapes):
        shape = draw(np.random.default_rng([options.seed, number]))
        for name, size, declared, true in judged(shape):
            ratios = declared / np.maximum(true, ROUNDING)
            rows.setdefault((name, size), []).append(ratios)
            if (ratios < 1).any():
                print(f"shape {number}, {name} at {size}: declared / true {ratios}, {shape}")
    print(f"{'model':8} {'size':>5} {'values':>7} {'outside':>8} {'declared/true':>14}")
    for (name, size), parts in rows.items():
        ratios = np.concatenate(parts)
        print(f"{name:8} {size:5} {len(ratios):7} {(ratios < 1).sum():8} {np.median(ratios):14.2f}")
    every = np.concatenate([one for parts in rows.values() for one in parts])
    share, median = float((every < 1).mean()), float(np.median(every))
    print(f"{len(every)} values, {share:.2%} outside, median {median:.2f}")
    return int(share > MOST_OUTSIDE or median > MOST_MEDIAN)


if __name__ == "__main__":
    sys.exit(main())
