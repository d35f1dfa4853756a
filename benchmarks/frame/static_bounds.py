"""Bounds of trusses and frames at rest against random inputs and corners, over seed and number.

    python -m benchmarks.frame.static_bounds [--seed N] [--count 60] [--large]

Each structure has 3 to 40 inputs of ± 1 to 20 %. Of half of them an input is the stiffness of one
bar of a truss; of the others it is the modulus of a group of bars, or of a group of beams and
columns of a plane frame. Printed are the number of samples outside, and gaps and seconds.
"""

from __future__ import annotations

import argparse
import secrets
from itertools import pairwise, product
from time import process_time

import numpy as np

from alphacut.base.arrays import Array
from alphacut.frame import Force, History, MatrixStructure, UnprovedError, static_bounds
from alphacut.fuzzy import Interval

SAMPLES = 5000


def truss_elements(bays: int, rng: np.random.Generator) -> tuple[list[Array], list[int]]:
    """Return matrices of the bars of a braced girder on two supports, and the loaded unknowns.

    Chords have unit bays and a height of 1, each bay two crossing diagonals.
    """
    nodes = np.array([(x, y) for x in range(bays + 1) for y in (0.0, 1.0)])
    nodes[:, 1] *= rng.uniform(0.6, 1.5)
    pairs = []
    for x in range(bays):
        a = 2 * x
        pairs += [(a, a + 2), (a + 1, a + 3), (a, a + 3), (a + 1, a + 2), (a, a + 1)]
    pairs.append((2 * bays, 2 * bays + 1))
    free = [k for k in range(2 * len(nodes)) if k not in (0, 1, 4 * bays + 1)]
    elements = []
    for a, b in pairs:
        along = nodes[b] - nodes[a]
        length = np.linalg.norm(along)
        row = np.zeros(2 * len(nodes))
        row[2 * a : 2 * a + 2] = -along / length
        row[2 * b : 2 * b + 2] = along / length
        elements.append(1e9 / length * np.outer(row[free], row[free]))
    loaded = [free.index(4 * x + 3) for x in range(1, bays)] or [free.index(3)]
    return elements, loaded


def frame_elements(bays: int, storeys: int) -> tuple[list[Array], list[int]]:
    """Return matrices of the columns and beams of a clamped plane frame, and the loaded unknowns.

    Elements have the length 3 m, E A = 3 GN and E I = 90 MN m².
    """
    index = {
        (x, y): 3 * ((y - 1) * (bays + 1) + x)
        for y in range(1, storeys + 1)
        for x in range(bays + 1)
    }
    n = 3 * len(index)
    length, axial, bending = 3.0, 3e9, 9e7
    local = np.zeros((6, 6))
    local[np.ix_([0, 3], [0, 3])] = axial / length * np.array([[1, -1], [-1, 1]])
    square, single = 6 / length, 12 / length**2
    local[np.ix_([1, 2, 4, 5], [1, 2, 4, 5])] = (
        bending
        / length
        * np.array(
            [
                [single, square, -single, square],
                [square, 4, -square, 2],
                [-single, -square, single, -square],
                [square, 2, -square, 4],
            ]
        )
    )
    elements = []
    lines = [((x, y), (x, y + 1)) for x, y in product(range(bays + 1), range(storeys))]
    lines += [((x, y), (x + 1, y)) for x, y in product(range(bays), range(1, storeys + 1))]
    for a, b in lines:
        cosine, sine = b[0] - a[0], b[1] - a[1]
        turn = np.kron(np.eye(2), np.array([[cosine, sine, 0], [-sine, cosine, 0], [0, 0, 1]]))
        whole = np.zeros((n + 6, n + 6))
        places = [
            index[p] + k if p in index else n + 3 * i + k
            for i, p in enumerate((a, b))
            for k in range(3)
        ]
        whole[np.ix_(places, places)] = turn.T @ local @ turn
        elements.append(whole[:n, :n])
    return elements, [index[0, y] for y in range(1, storeys + 1)]


def structure_of(
    elements: list[Array], loaded: list[int], inputs: int, outputs: int, rng: np.random.Generator
) -> MatrixStructure:
    """Return a structure whose inputs "p1" … are factors of random groups of elements."""
    order = rng.permutation(len(elements))
    cuts = np.linspace(0, len(elements), inputs + 1).astype(int)
    terms = [
        (f"p{k + 1}", np.sum([elements[e] for e in order[a:b]], axis=0))
        for k, (a, b) in enumerate(pairwise(cuts))
    ]
    n = len(elements[0])
    force = np.zeros(n)
    force[loaded] = rng.uniform(0.3, 1.0, len(loaded))
    observed = {f"u{k}": np.eye(n)[k] for k in rng.choice(n, min(outputs, n), replace=False)}
    loads = [Force(force, 1e5, History.constant(0, is_static=True))]
    return MatrixStructure({name: 1.0 for name, _ in terms}, (), terms, observed, loads=loads)


def sampled(structure: MatrixStructure, radius: float, rng: np.random.Generator) -> Array:
    """Return the smallest and largest outputs at random points and corners, shape (outputs, 2)."""
    d = len(structure.parameters)
    ends = rng.choice([-1.0, 1.0], (SAMPLES, d))
    if d <= 12:
        ends = np.array(list(product((-1.0, 1.0), repeat=d)))
    points = 1 + radius * np.vstack([rng.uniform(-1, 1, (SAMPLES, d)), ends])
    matrices = np.array([array for _, array in structure.stiffness])
    force = structure.loads[0].at * structure.loads[0].amplitude
    rows = np.array(list(structure.observed.values()))
    found = []
    for part in np.array_split(points, max(1, len(points) * matrices[0].size // 2_000_000)):
        stiffness = np.tensordot(part, matrices, 1)
        found.append(np.linalg.solve(stiffness, force[None, :, None])[..., 0] @ rows.T)
    values = np.vstack(found)
    return np.stack([values.min(0), values.max(0)], -1)


def run(count: int, seed: int) -> int:
    """Print the table of random structures; return the number of samples outside."""
    rng = np.random.default_rng(seed)
    outside = 0
    print("structure inputs radius unknowns  gap median  gap largest  seconds  outside")
    for number in range(count):
        is_grouped = number % 2 == 1
        radius = rng.uniform(0.01, 0.2)
        if is_grouped:
            radius = min(radius, 0.1) if number % 4 == 1 else radius
            inputs = int(rng.integers(3, 11))
            if number % 4 == 1:
                elements, loaded = truss_elements(int(rng.integers(3, 9)), rng)
            else:
                elements, loaded = frame_elements(int(rng.integers(1, 4)), int(rng.integers(2, 5)))
            inputs = min(inputs, len(elements))
        else:
            elements, loaded = truss_elements(int(rng.integers(1, 9)), rng)
            inputs = len(elements)
        structure = structure_of(elements, loaded, inputs, 4, rng)
        box = {name: Interval(1 - radius, 1 + radius) for name in structure.parameters}
        begun = process_time()
        try:
            bounds = static_bounds(structure, box, alpha=[0], gap=0.01 if is_grouped else 1e-9)
        except UnprovedError as error:
            print(f"{number:9d} {inputs:6d} {radius:6.3f} {structure.size:8d}  {error}")
            continue
        seconds = process_time() - begun
        ends = sampled(structure, radius, rng)
        slack = 1e-9 * np.abs(ends).max(axis=1)
        is_out = (ends[:, 0] < bounds.bounds[0, :, 0] - slack) | (
            ends[:, 1] > bounds.bounds[0, :, 1] + slack
        )
        outside += int(is_out.sum())
        gaps = bounds.gaps[0]
        kind = "groups" if is_grouped else "bars"
        print(
            f"{kind:9s} {inputs:6d} {radius:6.3f} {structure.size:8d} {np.median(gaps):11.2e}"
            f" {gaps.max():12.2e} {seconds:8.1f} {int(is_out.sum()):8d}",
            flush=True,
        )
    print(f"seed {seed}: {outside} outside")
    return outside


def large(seed: int) -> None:
    """Print the bounds of a plane frame of some 1,000 unknowns with five inputs ± 10 %."""
    rng = np.random.default_rng(seed)
    elements, loaded = frame_elements(9, 34)
    structure = structure_of(elements, loaded, 5, 2, rng)
    box = {name: Interval(0.9, 1.1) for name in structure.parameters}
    begun = process_time()
    found = static_bounds(structure, box, alpha=[0])
    print(f"{structure.size} unknowns: gaps {found.gaps[0]}, {process_time() - begun:.1f} s")


def main() -> None:
    """Run the comparison that the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seed", type=int, default=secrets.randbits(32))
    parser.add_argument("--count", type=int, default=60)
    parser.add_argument("--large", action="store_true", help="a frame of 1,000 unknowns instead")
    options = parser.parse_args()
    if options.large:
        large(options.seed)
        return
    raise SystemExit(bool(run(options.count, options.seed)))


if __name__ == "__main__":
    main()
