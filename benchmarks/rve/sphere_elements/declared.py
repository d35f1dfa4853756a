"""Declared errors of elements about a sphere against the series: single meshes, a fuzzy modulus."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from alphacut.rve import Phase
from alphacut.rve.spheres.series.stiffness import cubic_stiffness
from alphacut.stochastic.theta.truncated_normal import Array

CASE = Path(__file__).parents[3] / "cases" / "paper-3d.toml"
ROUND_OFF = 1e-9
"""Relative error of the series that the elements are judged by, at the most."""


@dataclass(frozen=True)
class Draws:
    """Random cells.

    Args:
        declared: Declared relative error of each, shape (n,).
        true: Largest relative error of its three moduli, shape (n,).
    """

    declared: Array
    true: Array

    @property
    def covered(self) -> int:
        """Cells whose error is no larger than declared."""
        return int((self.true <= self.declared + ROUND_OFF).sum())


def from_series(
    radius: float, matrix: Phase, contrast: float, size: float, ratio: float = 0.2
) -> tuple[float, float]:
    """Relative error of extrapolated elements, the largest of three moduli: true and declared.

    Args:
        radius: Of the sphere, in halves of the cell's side.
        matrix: The matrix.
        contrast: E of the sphere over the matrix's.
        size: Edge of the elements.
        ratio: Poisson's ratio of the sphere.
    """
    from alphacut.rve.spheres.fem.extrapolation import Meshes

    sphere = Phase(matrix.modulus * contrast, ratio)
    found = Meshes(radius, matrix, size=size).judged([sphere])
    cell = cubic_stiffness(np.array([radius]), matrix, [sphere], tolerance=ROUND_OFF)
    exact = np.array([cell.bulk[0, 0], cell.deviator[0, 0], cell.shear[0, 0]])
    return float(np.abs(found.moduli / exact - 1).max()), float(found.errors.max())


def random_cells(count: int, seed: int) -> Draws:
    """Radii 0.15 … 0.95, contrasts 1e-2 … 1e2, ν 0 … 0.4 in either phase, sizes 0.12 … 0.3."""
    generator = np.random.default_rng(seed)
    errors = []
    for _ in range(count):
        radius = generator.uniform(0.15, 0.95)
        size = 0.12 * 2.5 ** generator.uniform()
        ratios = generator.uniform(0, 0.4, 2)
        contrast = 10 ** generator.uniform(-2, 2)
        errors.append(from_series(radius, Phase(20e9, ratios[0]), contrast, size, ratios[1]))
    true, declared = np.array(errors).T
    return Draws(declared, true)


@dataclass(frozen=True)
class Fuzzy:
    """Fuzzy modulus of the paper's case with spheres, five levels.

    Args:
        seconds: Wall time of the command, its table built anew.
        declared: Largest declared relative error of E of any sample.
        true: Largest relative error of the ends of its α-cuts against the series.
    """

    seconds: float
    declared: float
    true: float


def fuzzy_modulus(tolerance: float, workers: int) -> Fuzzy:
    """The command that a user runs, by table and by series, in an empty cache."""
    with tempfile.TemporaryDirectory() as folder:
        table, seconds = _modulus("table", tolerance, workers, Path(folder))
        exact, _ = _modulus("series", 1e-8, 1, Path(folder))
    ends = [
        np.array([found["E_GPa"][end] for end in ("lower", "upper")]) for found in (table, exact)
    ]
    off = float(np.abs(ends[0] / ends[1] - 1).max())
    return Fuzzy(seconds, float(sum(table["error"].values())), off)


def _modulus(
    method: str, tolerance: float, workers: int, folder: Path
) -> tuple[dict[str, Any], float]:
    """What the command prints, and its wall time."""
    command = [sys.executable, "-m", "fuzzy", "modulus", str(CASE), "--method", method]
    command += ["--tolerance", str(tolerance), "--workers", str(workers), "--json", "-"]
    environment = os.environ | {"ALPHACUT_CACHE": str(folder)}
    started = perf_counter()
    done = subprocess.run(command, capture_output=True, text=True, env=environment, check=False)
    seconds = perf_counter() - started
    if done.returncode:
        raise RuntimeError(f"the fuzzy modulus ends with {done.returncode}: {done.stderr[-500:]}")
    return json.loads(done.stdout), seconds
