"""Bounds of random cells at the edges of what is allowed: their ends, and exact values inside.

    ./enter python -m benchmarks.rve.extreme_cells --cells 300
    ./enter python -m benchmarks.rve.extreme_cells --seed 1 --keep new.npz    # all ends
    ./enter python -m benchmarks.rve.extreme_cells --against old.npz new.npz  # of two versions

The cells are images, volumes and meshes of one's own: white noise, stripes at 45°, layers along an
axis and homogeneous ones, coarse and fine, of two or three phases. Contrasts are from 1e-12 to
1e12, ν from −.95 to .4999999 (of meshes .45), some phases are pores (of meshes anisotropic), and a
fifth of the images conducts. No end may be NaN or above the other one, no exception may leave but
the project's own, and the exact tensor of layers and of homogeneous cells must be inside, judged in
rational numbers. Exit status 1 if a cell does not hold.

Of two versions, ends are compared where those of the older one are in order and its lower bound is
positive definite by 1e-8 of its largest eigenvalue.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from alphacut.base.errors import FailedError, RefusedError
from alphacut.rve import MeshModel, Phase, VoigtPhase, solve_conduction, solve_image
from alphacut.rve.mesh.file import write
from alphacut.rve.mesh.wedge import vertices_and_midpoints
from alphacut.stochastic import TruncatedNormal

LAW = TruncatedNormal(-3.0, 3.0)
ACROSS = {
    (2, 0): [0, 2], (2, 1): [1, 2],
    (3, 0): [0, 4, 5], (3, 1): [1, 3, 5], (3, 2): [2, 3, 4],
}  # fmt: skip
"""Stresses that are the same in all layers, in Voigt's order, by dimension and normal."""
Matrix = np.ndarray[Any, np.dtype[Any]]


@dataclass(frozen=True)
class Cell:
    """A random cell.

    Args:
        kind: "image", "volume", "conduction" or "mesh".
        pattern: "noise", "stripes", "layers" or "one".
        phase: Phase of each pixel, voxel or square, in the order of the arrays of images.
        tensors: Stiffness or conductivity of each phase.
        moduli: Arguments of each phase: bulk and shear modulus, a conductivity, or a phase.
        contrast: Largest ratio of their moduli.
        axis: Normal of the layers, 0 for x.
    """

    kind: str
    pattern: str
    phase: Matrix
    tensors: list[Matrix]
    moduli: list[Any]
    contrast: float
    axis: int


def random_cell(seed: int, number: int) -> Cell:
    """Return a cell, the same for equal seeds and numbers."""
    rng = np.random.default_rng([seed, number])
    kind = ["image", "volume", "mesh", "image", "conduction"][number % 5]
    dimension = 3 if kind == "volume" or (kind == "conduction" and rng.random() < 0.4) else 2
    pattern = str(rng.choice(["noise", "stripes", "layers", "one"], p=[0.35, 0.25, 0.3, 0.1]))
    most = {"image": 9, "volume": 5, "mesh": 4, "conduction": 6}[kind]
    shape = tuple(int(n) for n in rng.integers(2, most, dimension))
    count = int(rng.integers(2, 4))
    index = np.indices(shape)
    axis = int(rng.integers(dimension))  # of x, y, z
    if pattern == "noise":
        phase = rng.integers(0, count, shape)
    elif pattern == "stripes":
        shape = (*shape[:-2], shape[-1], shape[-1])
        phase = np.indices(shape)[-2:].sum(axis=0) % shape[-1] * count // shape[-1]
    elif pattern == "layers":
        size = shape[dimension - 1 - axis]
        phase = index[dimension - 1 - axis] * min(count, size) // size
    else:
        phase = np.zeros(shape, int)
    values, numbers = np.unique(phase, return_inverse=True)
    phase = numbers.reshape(phase.shape)
    used = len(values)
    # One of the phases has the modulus 1 GPa, and the widest contrast is uniform on a log scale.
    span = float(rng.uniform(-12, 12))
    sizes = 10.0 ** np.append([0.0, span][:used], span * rng.random(max(used - 2, 0)))
    if kind != "mesh" and used > 1 and rng.random() < 0.2:
        sizes[int(rng.integers(used))] = 0.0  # pores
    tensors, moduli = zip(*(_material(rng, kind, dimension, 1e9 * s) for s in sizes), strict=True)
    solid = sizes[sizes > 0]
    contrast = float(solid.max() / solid.min())
    return Cell(kind, pattern, phase, list(tensors), list(moduli), contrast, axis)


def _material(rng: np.random.Generator, kind: str, dimension: int, size: float) -> tuple[Any, Any]:
    """Return the tensor of a material of about a modulus, and its argument."""
    edges = [-0.95, 0.4999999, 0.4999, 0.0, 0.3]
    nu = float(rng.choice(edges)) if rng.random() < 0.5 else float(rng.uniform(-0.95, 0.49))
    if kind == "conduction":
        return size * np.eye(dimension), (size,)
    if kind == "mesh":
        if rng.random() < 0.3:
            root = rng.normal(size=(3, 3))
            stiffness = size * (root @ root.T + 10 ** rng.uniform(-4, 0) * np.eye(3))
            material = VoigtPhase(tuple(map(tuple, ((stiffness + stiffness.T) / 2).tolist())))
            return material.stiffness, material
        isotropic = Phase(size, min(nu, 0.45))
        return isotropic.stiffness, isotropic
    shear = size / (2 * (1 + nu))
    bulk = size / (3 * (1 - 2 * nu))
    if dimension == 2:
        bulk += shear / 3
    # From the rounded moduli exactly: λ = K − 2/3 G, in the plane K − G.
    lame = Fraction(bulk) - Fraction(shear) * (1 if dimension == 2 else Fraction(2, 3))
    n = dimension
    stiffness = np.full((3 * n - 3, 3 * n - 3), Fraction(0))
    stiffness[:n, :n] = lame
    for k in range(3 * n - 3):
        stiffness[k, k] += Fraction(shear) * (2 if k < n else 1)
    return stiffness, (bulk, shear)


def solved(cell: Cell, folder: Path) -> Any:
    """Return the bounds of a cell."""
    if cell.kind == "mesh":
        path = folder / "cell.msh"
        names = _write_mesh(path, cell.phase)
        return MeshModel(path).bounds(LAW, dict(zip(names, cell.moduli, strict=True)))
    images = [np.array(of_phases)[cell.phase] for of_phases in zip(*cell.moduli, strict=True)]
    if cell.kind == "conduction":
        return solve_conduction(images[0]).bounds
    return solve_image(*images).bounds


def _write_mesh(path: Path, phase: Matrix) -> tuple[str, ...]:
    """Write a square of two triangles a square of an array (y, x), and return names of phases."""
    corners, phases = [], []
    rows, columns = phase.shape
    for j, i in np.ndindex(rows, columns):
        square = np.array([[i, j], [i + 1, j], [i + 1, j + 1], [i, j + 1]])
        square = 2 * square / [columns, rows] - 1
        corners += [square[[0, 1, 2]], square[[0, 2, 3]]]
        phases += [phase[j, i]] * 2
    x, y, z = vertices_and_midpoints().T
    plane = np.stack([1 - x - y, x, y], axis=1) @ np.array(corners)
    theta = np.broadcast_to(6 * z - 3, plane.shape[:2])
    nodes = np.concatenate([plane, theta[..., np.newaxis]], axis=-1).reshape(-1, 3)
    points, cells = np.unique(nodes.round(9), axis=0, return_inverse=True)
    names = ("a", "b", "c")[: phase.max() + 1]
    write(path, points, cells.reshape(-1, 15), np.array(phases), names)
    return names


def ends_of(bounds: Any) -> Matrix:
    """Return all ends that bounds give, shape (ends, 2)."""
    if hasattr(bounds, "mean"):
        return np.array([bounds.mean, *bounds.components()])
    averages = [bounds.bulk]
    for average in ("axes", "isotropic"):
        averages += [bounds.shear(average), bounds.young(average), bounds.poisson(average)]
    return np.array([*averages, *bounds.constants()])


def exact_tensor(cell: Cell) -> Matrix | None:
    """Return the exact tensor of layers or of a homogeneous cell in fractions, None of others."""
    tensors = [np.vectorize(Fraction, otypes=[object])(tensor) for tensor in cell.tensors]
    if cell.pattern == "one":
        return tensors[0]
    if cell.pattern != "layers" or not all(np.asarray(tensor).any() for tensor in cell.tensors):
        return None
    dimension = cell.phase.ndim
    weights = [Fraction(int(n), cell.phase.size) for n in np.bincount(cell.phase.ravel())]
    across = [cell.axis] if cell.kind == "conduction" else ACROSS[dimension, cell.axis]
    along = [k for k in range(len(tensors[0])) if k not in across]
    # Means of the mixed form of Hooke's law, in which both kinds of components are uniform.
    compliance, coupling, rest = 0, 0, 0
    for weight, tensor in zip(weights, tensors, strict=True):
        inverse = _inverse(tensor[np.ix_(across, across)])
        mixed = inverse @ tensor[np.ix_(across, along)]
        compliance = compliance + weight * inverse
        coupling = coupling + weight * mixed
        rest = rest + weight * (
            tensor[np.ix_(along, along)] - tensor[np.ix_(along, across)] @ mixed
        )
    stiff = _inverse(compliance)
    exact = np.empty_like(tensors[0])
    exact[np.ix_(across, across)] = stiff
    exact[np.ix_(across, along)] = stiff @ coupling
    exact[np.ix_(along, across)] = (stiff @ coupling).T
    exact[np.ix_(along, along)] = rest + coupling.T @ stiff @ coupling
    return exact


def _inverse(matrix: Matrix) -> Matrix:
    """Return the inverse of a positive definite matrix of fractions."""
    rows = np.hstack([matrix, np.vectorize(Fraction)(np.eye(len(matrix), dtype=int))])
    for k in range(len(rows)):
        rows[k] = rows[k] / rows[k, k]
        for other in range(len(rows)):
            if other != k:
                rows[other] = rows[other] - rows[other, k] * rows[k]
    return rows[:, len(matrix) :]


def is_semidefinite(matrix: Matrix) -> bool:
    """Return whether a symmetric matrix of fractions has no negative eigenvalue."""
    left = matrix.copy()
    for k in range(len(left)):
        if left[k, k] < 0 or (left[k, k] == 0 and left[k, k:].any()):
            return False
        if left[k, k] > 0:
            left[k:, k:] = left[k:, k:] - np.multiply.outer(left[k:, k], left[k, k:] / left[k, k])
    return True


def faults(cell: Cell, bounds: Any, ends: Matrix) -> list[str]:
    """Return what is wrong with the bounds of a cell, in words."""
    found = []
    if np.isnan(ends).any():
        found.append("NaN")
    if (ends[:, 0] > ends[:, 1]).any():
        found.append("crossed")
    exact = exact_tensor(cell)
    if exact is not None:
        as_fractions = np.vectorize(Fraction, otypes=[object])
        if not is_semidefinite(exact - as_fractions(bounds.lower)):
            found.append("exact tensor below")
        if np.isfinite(bounds.upper).all() and not is_semidefinite(
            as_fractions(bounds.upper) - exact
        ):
            found.append("exact tensor above")
    return found


def run(count: int, seed: int, kept: Path | None) -> int:
    """Judge cells, print a line for each one that does not hold, and return their number."""
    wrong = 0
    outcomes: dict[str, Matrix] = {}
    refused: dict[str, int] = {}
    with tempfile.TemporaryDirectory() as folder:
        for number in range(count):
            cell = random_cell(seed, number)
            name = f"{number} {cell.kind} {cell.pattern} {cell.phase.shape} {cell.contrast:.1e}"
            try:
                bounds = solved(cell, Path(folder))
                ends = ends_of(bounds)
                found = faults(cell, bounds, ends)
                outcomes[f"{number} ends"] = ends
                outcomes[f"{number} lower"] = bounds.lower
            except (RefusedError, FailedError) as error:
                found = []
                refused[str(error)[:60]] = refused.get(str(error)[:60], 0) + 1
                print(f"{name}: {error}", flush=True)
            except Exception as error:  # which the project should not let out
                found = [f"{type(error).__name__}: {error}"]
            outcomes[f"{number} contrast"] = np.array(cell.contrast)
            if found:
                wrong += 1
                print(f"{name}: {'; '.join(found)}", flush=True)
    print(f"{count} cells, {wrong} wrong, {sum(refused.values())} refused")
    if kept is not None:
        np.savez(kept, **outcomes)
    return wrong


def compare(old_file: Path, new_file: Path) -> int:
    """Print where ends of two versions differ, and return the number of such cells."""
    old, new = dict(np.load(old_file)), dict(np.load(new_file))
    compared, differing, lost = 0, 0, 0
    for name in [key for key in old if key.endswith(" ends")]:
        number = name.split()[0]
        before = old[name]
        lower = np.linalg.eigvalsh(old[f"{number} lower"])
        in_order = bool((before[:, 0] <= before[:, 1]).all())  # NaN is not
        is_mild = old[f"{number} contrast"] <= 1e8
        after = new.get(name)
        if is_mild and in_order:
            was_finite = np.isfinite(before)
            if after is None or not np.isfinite(after[was_finite]).all():
                lost += 1
                print(f"{number}: refused or infinite, contrast {old[f'{number} contrast']:.1e}")
        if not in_order or lower[0] <= 1e-8 * lower[-1] or after is None:
            continue
        compared += 1
        with np.errstate(invalid="ignore"):
            distance = np.abs(after - before)
            # Ratios are of the order of 1, and moduli larger.
            allowed = 1e-10 * np.maximum(np.abs(before).max(axis=1, keepdims=True), 1)
            is_apart = ~((distance <= allowed) | (after == before))
        if is_apart.any():
            differing += 1
            narrower = (after[:, 0] >= before[:, 0]) & (after[:, 1] <= before[:, 1])
            k = int(np.argmax(is_apart.any(axis=1)))
            kind = "narrower" if narrower[is_apart.any(axis=1)].all() else "WIDER"
            print(f"{number}: {kind}, {before[k]} became {after[k]}, λ {lower[0] / lower[-1]:.1e}")
    print(f"{compared} cells compared, {differing} differ, {lost} were lost at contrasts to 1e8")
    return differing + lost


def main(arguments: Sequence[str] | None = None) -> int:
    """Judge random cells, or compare two files of ends."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cells", type=int, default=300)
    parser.add_argument(
        "--seed", type=int, default=int(np.random.SeedSequence().generate_state(1)[0])
    )
    parser.add_argument("--keep", type=Path, help="file of NumPy, .npz, that takes all ends")
    parser.add_argument("--against", type=Path, nargs=2, metavar=("OLD", "NEW"))
    options = parser.parse_args(arguments)
    if options.against:
        return int(compare(*options.against) > 0)
    print(f"seed {options.seed}")
    warnings.simplefilter("ignore")  # of moduli that no material has
    return int(run(options.cells, options.seed, options.keep) > 0)


if __name__ == "__main__":
    sys.exit(main())
