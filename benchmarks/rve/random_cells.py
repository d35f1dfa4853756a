"""Random cells by finite elements: declared against true errors of all that a result holds.

    ./enter python -m benchmarks.rve.random_cells --cells 150 --seed 1
    ./enter python -m benchmarks.rve.random_cells --cells 150 --seed 1 --lattices

Round cells of isotropic phases (contrasts of 1e-3 to 1e3, Poisson's ratios of 0 to 0.45 in either
phase, random maps with radii to nearly touching) are judged by the multipole series; ellipses and
orthotropic particles (`--any`) by prisms and slices against one another. With `--lattices` the
cells are hexagons and rectangles in place of the square. Each result has a random
resolution. Prints by quantity how many numbers lie outside their declared errors, and the median of
declared over true; exit status 1 if one lies outside
or a median of E, ν, moduli or stresses is above 10.
"""

from __future__ import annotations

import argparse
import sys
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from alphacut.base.errors import FailedError, RefusedError
from alphacut.rve.cell.cell import Cell, Phase, VoigtPhase
from alphacut.rve.cell.lattice import Arrangement
from alphacut.rve.cell.outline import Ellipse, circle
from alphacut.rve.prism.model import PrismModel
from alphacut.rve.prism.problem import FoldedMeshError
from alphacut.rve.result.engineering_constants import NAMES, engineering_constants
from alphacut.rve.result.loss_factors import loss_factors
from alphacut.rve.result.result import HomogenisedStiffness
from alphacut.rve.series.model import SeriesModel
from alphacut.rve.slices.model import SlicesModel
from alphacut.stochastic import HermiteMap

NOISE = 1e-10  # of the truth, relative
MOST_MEDIAN = 10.0
FINEST = 0.1
"""Size of elements below which no finer mesh is tried, whose memory grows with the square."""
TIGHT = ("E", "ν", "C11 + C12", "C11 − C12", "C33", "s11", "s12")
"""Quantities whose declared errors are not to be far above the true ones."""


@dataclass(frozen=True)
class Judgement:
    """One number beside its truth, both errors relative.

    Args:
        quantity: Its name.
        declared: Its declared error.
        true: Its true one.
    """

    quantity: str
    declared: float
    true: float

    @property
    def covered(self) -> bool:
        """True if the declared error covers the true one."""
        return bool(self.true <= self.declared + NOISE)


def random_map(rng: np.random.Generator, most: float) -> HermiteMap:
    """A map with radii below `most`."""
    while True:
        ends = rng.uniform([0.02, -0.5, 0.05, -0.5], [0.9, 1.0, 0.99, 1.0])
        try:
            radius = HermiteMap(*map(float, ends))
        except ValueError:
            continue
        if radius.extremes()[1] < most:
            return radius


def round_cell(rng: np.random.Generator) -> Cell:
    """A circle, isotropic phases."""
    matrix = Phase(20e9, float(rng.uniform(0, 0.45)))
    particle = Phase(20e9 * 10 ** rng.uniform(-3, 3), float(rng.uniform(0, 0.45)))
    return Cell(matrix, particle, random_map(rng, 0.97))


def any_cell(rng: np.random.Generator) -> Cell:
    """An ellipse or a circle of an orthotropic material, its axes turned."""
    axial, lateral, shear = 20e9 * 10 ** rng.uniform(-1, 1, 3)
    mixed = rng.uniform(0, 0.5) * np.sqrt(axial * lateral)
    own = np.array([[axial, mixed, 0], [mixed, lateral, 0], [0, 0, shear]])
    c, s = np.cos(angle := rng.uniform(0, np.pi)), np.sin(angle)
    turn = np.array(
        [[c * c, s * s, c * s], [s * s, c * c, -c * s], [-2 * c * s, 2 * c * s, c * c - s * s]]
    )
    particle = VoigtPhase((turn.T @ own @ turn).tolist())
    turned = Ellipse(float(rng.choice([0.5, 2.0])), float(rng.choice([0.0, 30.0])))
    outline = turned if rng.random() < 0.75 else circle
    if rng.random() < 0.5:
        particle = Phase(20e9 * 10 ** rng.uniform(-2, 2), float(rng.uniform(0, 0.4)))
    return Cell(Phase(20e9, 0.3), particle, random_map(rng, 0.66), outline)


def random_lattice(rng: np.random.Generator) -> Arrangement:
    """The hexagonal array, or a rectangle of a ratio of sides up to 4."""
    if rng.random() < 0.4:
        return "hexagonal"
    sides = [1.0, float(rng.uniform(1, 4))]
    return sides if rng.random() < 0.5 else sides[::-1]


def draw_prism(rng: np.random.Generator, cell: Cell) -> PrismModel:
    """Prisms at a random resolution."""
    size, layers = float(rng.uniform(0.2, 0.5)), int(rng.choice([1, 2, 4, 6]))
    return PrismModel(size, layers, stiffness=True, outline=cell.outline)


def draw_slices(rng: np.random.Generator, cell: Cell) -> SlicesModel:
    """Slices at a random resolution."""
    size, points = float(rng.uniform(0.2, 1.0)), int(rng.integers(3, 10))
    return SlicesModel(size, points, cell.outline)


def judged(own: HomogenisedStiffness, truth: HomogenisedStiffness) -> Iterator[Judgement]:
    """Every number of a result beside that of the truth, whose declared error is added."""
    slack = truth.largest_error
    yield Judgement("E", own.estimated_error + slack, abs(own.modulus / truth.modulus - 1))
    yield Judgement("ν", own.poisson_error + slack, abs(own.poisson - truth.poisson))
    moduli = ("C11 + C12", "C11 − C12", "C33")
    for name, error, one, two in zip(
        moduli, own.modulus_errors, own.moduli, truth.moduli, strict=True
    ):
        yield Judgement(name, error + slack, abs(one / two - 1))
    for name, one, two in zip(("s11", "s12"), own.curve.mean, truth.curve.mean, strict=True):
        error = own.modulus_errors[0 if name == "s11" else 2]
        yield Judgement(name, error + slack, abs(one / two - 1))
    yield from judged_entries(own, truth)


def judged_entries(own: HomogenisedStiffness, truth: HomogenisedStiffness) -> Iterator[Judgement]:
    """Entries of C over C11, engineering constants of both definitions, and loss factors."""
    pairs = [(x.stiffness, x.stiffness_errors) for x in (own, truth)]
    (first, declared), (second, slack) = ([np.asarray(x) for x in pair] for pair in pairs)
    for i, j in zip(*np.triu_indices(3), strict=True):
        error = (declared + slack)[i, j] / second[0, 0]
        true = abs(first - second)[i, j] / second[0, 0]
        yield Judgement(f"C{i + 1}{j + 1}", float(error), float(true))
    constants, others = engineering_constants(own), engineering_constants(truth)
    for definition, one in constants.items():
        other = others[definition]
        errors = (one.errors + other.errors) / abs(other.values)
        true_errors = abs(one.values / other.values - 1)
        for row in zip(NAMES, errors, true_errors, strict=True):
            yield Judgement(*row)
    if own.energies is not None and truth.energies is not None:
        losses = np.array([[0.02, 0.03], [0.005, 0.001]])
        loss, true_loss = loss_factors(own, losses), loss_factors(truth, losses)
        for name, value in loss.values.items():
            errors = loss.errors[name] + true_loss.errors[name]
            yield Judgement(f"loss {name}", errors, abs(value - true_loss.values[name]))


def solved(model: PrismModel, cell: Cell) -> HomogenisedStiffness:
    """The cell by prisms, on a finer mesh where the one drawn folds over.

    Raises:
        FoldedMeshError: It folds over on a mesh below `FINEST` as well.
    """
    try:
        return model.solve(cell.radius_map, cell.matrix, [cell.inclusion])[0]
    except FoldedMeshError:
        if model.mesh_size < FINEST:
            raise
        return solved(replace(model, mesh_size=model.mesh_size / 2), cell)


def judge(cell: Cell, rng: np.random.Generator, lattice: Arrangement = "square") -> list[Judgement]:
    """All numbers of one cell by prisms and slices; empty where a model refuses.

    Args:
        cell: Its phases, radius map and outline.
        rng: For the resolution of both.
        lattice: The arrangement that it stands in.
    """
    parts = cell.radius_map, cell.matrix, [cell.inclusion]
    try:
        prism = replace(draw_prism(rng, cell), lattice=lattice)
        slices = replace(draw_slices(rng, cell), lattice=lattice)
        results = [solved(prism, cell), slices.solve(*parts)[0]]
    except (FailedError, RefusedError) as refusal:
        print(f"refused: {refusal}", flush=True)
        return []
    if cell.square:
        truth = SeriesModel(accuracy=1e-12, energies=True, lattice=lattice).solve(*parts)[0]
    else:
        fine = SlicesModel(0.15, 16, cell.outline, lattice)
        truth = fine.solve(*parts)[0]
    return [one for result in results for one in judged(result, truth)]


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table; exit 1 if a number lies outside its declared error."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cells", type=int, default=150)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--any", action="store_true", help="ellipses and orthotropic particles")
    help_text = "hexagonal and rectangular cells"
    parser.add_argument("--lattices", action="store_true", help=help_text)
    options = parser.parse_args(arguments)
    draw, rows = any_cell if options.any else round_cell, defaultdict(list)
    for number in range(options.cells):
        rng = np.random.default_rng([options.seed, number])
        cell = draw(rng)
        lattice = random_lattice(rng) if options.lattices else "square"
        for one in judge(cell, rng, lattice):
            rows[one.quantity].append(one)
            if not one.covered:
                print(f"cell {number}: {one}", flush=True)
    outside, worst = 0, 0.0
    print(f"{'quantity':12} {'numbers':>8} {'outside':>8} {'declared/true':>14}")
    for name, numbers in rows.items():
        missed = sum(not one.covered for one in numbers)
        median = float(np.median([one.declared / max(one.true, NOISE) for one in numbers]))
        outside = outside + missed
        worst = max(worst, median) if name in TIGHT else worst
        print(f"{name:12} {len(numbers):8} {missed:8} {median:14.2f}")
    return int(outside > 0 or worst > MOST_MEDIAN)


if __name__ == "__main__":
    sys.exit(main())
