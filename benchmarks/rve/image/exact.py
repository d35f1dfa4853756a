"""Proved bounds against what is known exactly: laminates, Hill's mixtures, chequerboards, discs.

Draws are random over contrast, ν and geometry; ``--seed`` takes new ones.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np

from alphacut.rve.cell import Phase
from alphacut.rve.image.bounds import StiffnessBounds, inverse_below
from alphacut.rve.image.fields.conjugate_gradient import ConjugateGradient
from alphacut.rve.image.fields.energy import energy
from alphacut.rve.image.fields.side import UNIT_LOADS
from alphacut.rve.image.moduli import ModuliInterval, PlaneModuli
from alphacut.rve.image.outlines.equation import Equation
from alphacut.rve.image.outlines.outline import Grid, phase_ranges
from alphacut.rve.image.phase_images import moduli_images
from alphacut.rve.image.solve import CrispBounds, solve_between, solve_image
from alphacut.rve.series.stiffness import square_stiffness
from benchmarks.rve.image.cases import Array, discs, moduli_of

ACCURACY = 1e-5  # the default of the command
Draw = Callable[[np.random.Generator], tuple[bool, float]]  # → exact value inside, width


def isotropic(bulk: float, shear: float) -> Array:
    """Plane-strain stiffness, shape (3, 3)."""
    return np.array(
        [[bulk + shear, bulk - shear, 0], [bulk - shear, bulk + shear, 0], [0, 0, shear]]
    )


def layered(share: float, first: Array, second: Array, angle: float = 0.0) -> Array:
    """Exact stiffness of layers whose normal has this angle to x, shape (3, 3)."""
    across = [0, 2]
    mean, jump = share * first + (1 - share) * second, first - second
    acoustic = ((1 - share) * first + share * second)[np.ix_(across, across)]
    layers = mean - share * (1 - share) * jump[:, across] @ np.linalg.inv(acoustic) @ jump[across]
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array(
        [[c * c, s * s, c * s], [s * s, c * c, -c * s], [-2 * c * s, 2 * c * s, c * c - s * s]]
    )
    return np.asarray(turn.T @ layers @ turn)


def random_moduli(rng: np.random.Generator) -> list[PlaneModuli]:
    """Two phases, K + G/3 and G of each drawn over a factor 100."""
    return [PlaneModuli(*10 ** rng.uniform(0, 2, 2)) for _ in range(2)]


def axis_parallel(rng: np.random.Generator, largest: int = 96) -> tuple[bool, float]:
    """A laminate along an axis, as many pixels long as drawn; the whole tensor."""
    columns = int(rng.integers(2, largest))
    layers = rng.random(columns) < rng.uniform(0.2, 0.8)
    layers[:2] = True, False
    matrix, particle = random_moduli(rng)
    image = np.tile(layers, (int(rng.integers(2, 9)), 1))
    solver = ConjugateGradient(1e-11)
    found = solve_image(*moduli_of(image, [matrix, particle]), solver=solver).bounds
    pair = (isotropic(p.bulk, p.shear) for p in (particle, matrix))
    return found.contains(layered(layers.mean(), *pair)), found.width


def equal_shear(rng: np.random.Generator) -> tuple[bool, float]:
    """Discs of the matrix's shear modulus: isotropic for any geometry (Hill 1964)."""
    matrix, other = random_moduli(rng)
    particle = PlaneModuli(other.bulk, matrix.shear)
    image = discs(48, number=int(rng.integers(1, 6)), radius=0.12, seed=int(rng.integers(1 << 30)))
    share, shear = image.mean(), matrix.shear
    bulk = 1 / (share / (particle.bulk + shear) + (1 - share) / (matrix.bulk + shear)) - shear
    found = solve_image(*moduli_of(image, [matrix, particle])).bounds
    return found.contains(isotropic(bulk, shear)), found.width


def chequerboard(rng: np.random.Generator) -> tuple[bool, float]:
    """Equal K + G/3 in a chequerboard: the product of 1/G + 1/k of both shears is the phases'."""
    first, other = random_moduli(rng)
    second = PlaneModuli(first.bulk, other.shear)
    image = np.kron([[1, 0], [0, 1]], np.ones((16, 16))) > 0
    found = solve_image(*moduli_of(image, [first, second])).bounds
    low, high = (
        (1 / c[2, 2] + 1 / first.bulk) * (2 / (c[0, 0] - c[0, 1]) + 1 / first.bulk)
        for c in (found.upper, found.lower)
    )
    exact = (1 / first.shear + 1 / first.bulk) * (1 / second.shear + 1 / first.bulk)
    return bool(low <= exact <= high), found.width


def bracket(inequality: str, grid: Grid, phases: Sequence[PlaneModuli]) -> StiffnessBounds:
    """Bounds from the inner and the outer pixels of an outline."""
    ranges = phase_ranges(Equation(inequality).classify(grid))
    images = moduli_images(*ranges, [ModuliInterval.crisp(p) for p in phases])
    return solve_between(images, aspect=grid.aspect).bounds


def inclined(rng: np.random.Generator) -> tuple[bool, float]:
    """An inclined laminate between its inner and outer pixels."""
    phases, (m, n) = random_moduli(rng), rng.integers(1, 4, 2)
    share = rng.uniform(0.2, 0.8)
    level = float(np.cos(np.pi * share))
    found = bracket(f"cos(2*pi*({m}*x + {n}*y)) >= {level!r}", Grid(64, 64), phases)
    pair = (isotropic(p.bulk, p.shear) for p in phases[::-1])
    return found.contains(layered(share, *pair, angle=float(np.arctan2(n, m)))), found.width


def disc(rng: np.random.Generator, size: int = 64) -> tuple[bool, float]:
    """A disc between its inner and outer pixels, against the series."""
    radius = float(rng.uniform(0.1, 0.98))
    phases = [Phase(10 ** rng.uniform(9, 11), rng.uniform(-0.2, 0.45)) for _ in range(2)]
    exact = square_stiffness(np.array([radius]), phases[0], phases[1:]).matrix[0, 0]
    moduli = [PlaneModuli.of_young(p.modulus, p.poisson) for p in phases]
    inequality = f"(x - 1)**2 + (y - 1)**2 <= {radius!r}**2"
    found = bracket(inequality, Grid(size, size, 2.0, 2.0), moduli)
    return found.contains(exact), found.width


def count(name: str, draw: Draw, number: int, seed: int) -> bool:
    """Print how many of the draws hold their exact value."""
    began = time.perf_counter()
    results = [draw(np.random.default_rng([seed, k])) for k in range(number)]
    inside = sum(held for held, _ in results)
    width = np.median([width for _, width in results])
    seconds = time.perf_counter() - began
    print(
        f"{name}: {inside} of {number} inside, median width {width:.2e}, {seconds:.0f} s",
        flush=True,
    )
    return inside == number


def poor_fields(number: int, seed: int) -> bool:
    """Fields perturbed or stopped after two iterations bound, only wider; the default is close."""
    early, perturbed, near, worst = 0, 0, 0, 0.0
    for k in range(number):
        rng = np.random.default_rng([seed, k])
        image = discs(48, number=4, radius=0.12, seed=int(rng.integers(1 << 30)))
        moduli = moduli_of(image, random_moduli(rng))
        rules = (
            ConjugateGradient(1e-10),
            ConjugateGradient(ACCURACY),
            ConjugateGradient(iterations=2),
        )
        full, usual, stopped = (solve_image(*moduli, solver=rule) for rule in rules)
        early += _outside(stopped.bounds, full.bounds)
        perturbed += _outside(shaken(usual, moduli, rng), full.bounds)
        worst = max(worst, excess := _excess(usual.bounds, full.bounds))
        near += excess < 1e-3
    print(
        f"bounds that lie outside the converged ones: {early} of {number} after two iterations, "
        f"{perturbed} with the fields perturbed; default within 1e-3 of converged: {near} of "
        f"{number}, farthest {worst:.1e}",
        flush=True,
    )
    return early == perturbed == near == number


def shaken(
    found: CrispBounds, moduli: tuple[Array, Array], rng: np.random.Generator
) -> StiffnessBounds:
    """Bounds from the fields with a random change of up to a tenth of their size."""
    above = []
    for side in (found.upper, found.lower):
        size = rng.uniform(0.001, 0.1) * np.abs(side.fields).max()
        fields = side.fields + size * rng.normal(size=side.fields.shape)
        element = side.side.element(1.0)
        coefficients = side.side.coefficients(*(m[None] for m in moduli))
        means = element.mean_modes(UNIT_LOADS)
        above.append(energy(element, *coefficients, fields, means).upper[0])
    return StiffnessBounds(inverse_below(above[1]), above[0])


def _outside(found: StiffnessBounds, full: StiffnessBounds) -> bool:
    """True if bounds hold the converged ones, and are wider."""
    slack = 1e-8 * np.eye(3)
    return bool(
        np.linalg.eigvalsh(found.upper - full.upper + full.upper[0, 0] * slack)[0] >= 0
        and np.linalg.eigvalsh(full.lower - found.lower + full.lower[0, 0] * slack)[0] >= 0
        and found.width >= full.width
    )


def _excess(found: StiffnessBounds, full: StiffnessBounds) -> float:
    """The most by which a bound differs from the converged one in any strain, relative."""
    upper = np.linalg.eigvals(np.linalg.solve(full.upper, found.upper)).real.max() - 1
    lower = np.linalg.eigvals(np.linalg.solve(found.lower, full.lower)).real.max() - 1
    return float(max(upper, lower))


def first_order(seed: int) -> None:
    """Widths of one disc's bracket as pixels shrink."""
    widths = [disc(np.random.default_rng([seed, 0]), size)[1] for size in (32, 64, 128, 256)]
    ratios = ", ".join(f"{a / b:.2f}" for a, b in pairwise(widths))
    print(f"ratios of the disc's bracket as pixels halve, 32² to 256²: {ratios}")


def largest_laminate() -> bool:
    """A laminate of one-pixel layers' width on 1024²: the rounding bound at the largest size."""
    image = np.tile(np.arange(1024) % 128 < 40, (1024, 1))
    phases = [PlaneModuli(3.0, 1.0), PlaneModuli(150.0, 90.0)]
    found = solve_image(*moduli_of(image, phases), solver=ConjugateGradient(1e-11))
    pair = (isotropic(p.bulk, p.shear) for p in phases[::-1])
    inside = found.bounds.contains(layered(40 / 128, *pair))
    rounding = [
        float(s.energy.rounding.max() / abs(s.energy.value).max())
        for s in (found.upper, found.lower)
    ]
    told = "inside" if inside else "OUTSIDE"
    print(
        f"laminate at 1024²: {told}, width {found.bounds.width:.1e}, "
        f"rounding bounds {rounding[0]:.1e} and {rounding[1]:.1e}"
    )
    return inside


def main(arguments: Sequence[str] | None = None) -> int:
    """All counts; 1 if one exact value lies outside."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--draws", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args(arguments)
    cases: list[tuple[str, Draw]] = [
        ("axis-parallel laminates", axis_parallel),
        ("mixtures of equal shear moduli", equal_shear),
        ("chequerboards of equal bulk moduli", chequerboard),
        ("inclined laminates", inclined),
        ("discs against the series", disc),
    ]
    good = [count(name, draw, options.draws, options.seed) for name, draw in cases]
    good.append(poor_fields(options.draws, options.seed))
    good.append(largest_laminate())
    first_order(options.seed)
    return 0 if all(good) else 1


if __name__ == "__main__":
    sys.exit(main())
