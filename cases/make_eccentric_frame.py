"""Make eccentric-frame/, the matrices and records of the case eccentric-frame.toml.

    python cases/make_eccentric_frame.py

A building of three storeys with rigid floors, 18 m along x and 12 m along y. Each storey stands on
four frames: the wall and a frame along x, which are not alike, and the core and a frame along y.
Floors move along x and y and turn about the vertical; their unknowns 1.x, 1.y, 1.r … are those of
the centre of mass. Besides, three records of two horizontal components are made, of no measured
earthquake.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.io import mmwrite
from scipy.sparse import coo_array

from benchmarks.synthetic_record import SyntheticRecord, at2_text

FOLDER = Path(__file__).with_name("eccentric-frame")
SIDES = 18.0, 12.0  # along x and y, in m
MASS = 220e3  # of a floor, in kg
STOREYS = 3
# stiffness of a storey in N/m, direction (0: x, 1: y), distance of the frame's line from the centre
FRAMES = {
    "wall": (300e6, 0, -5.0),
    "frame_x": (100e6, 0, 6.0),
    "core": (120e6, 1, -6.0),
    "frame_y": (70e6, 1, 9.0),
}
FIRST_SEED, RECORDS = 4001, 3


def storey_stiffness(stiffness: float, direction: int, distance: float) -> np.ndarray:
    """Return the stiffness of one frame over (x, y, r) of the floor above, shape (3, 3).

    A frame along x at the distance y from the centre is displaced by x - y r, one along y at the
    distance x by y + x r.
    """
    row = np.zeros(3)
    row[direction] = 1.0
    row[2] = distance if direction else -distance
    return stiffness * np.outer(row, row)


def chain(storeys: int) -> np.ndarray:
    """Return the stiffness of equal springs between neighbouring floors, shape (storeys,) * 2."""
    matrix = 2 * np.eye(storeys) - np.eye(storeys, k=1) - np.eye(storeys, k=-1)
    matrix[-1, -1] = 1.0
    return matrix


def write_matrix(name: str, matrix: np.ndarray) -> None:
    """Write a matrix in N, m, kg and s, without its zeros."""
    mmwrite(FOLDER / f"{name}.mtx", coo_array(matrix), precision=12, symmetry="symmetric")


if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    for name, (stiffness, direction, distance) in FRAMES.items():
        write_matrix(
            name, np.kron(chain(STOREYS), storey_stiffness(stiffness, direction, distance))
        )
    inertia = (SIDES[0] ** 2 + SIDES[1] ** 2) / 12
    write_matrix("mass", np.kron(np.eye(STOREYS), MASS * np.diag([1.0, 1.0, inertia])))
    for number in range(RECORDS):
        for k, axis in enumerate("xy"):
            seed = FIRST_SEED + 2 * number + k
            peak = 2.0 * np.random.default_rng(seed).lognormal(0, 0.2)
            record = SyntheticRecord(peak=peak, duration=8.0, step=0.02, seed=seed)
            (FOLDER / f"{number + 1}_{axis}.AT2").write_text(at2_text(record), encoding="utf-8")
