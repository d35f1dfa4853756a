"""Files that the base cases of `refused/` name, each function for some of them."""

from pathlib import Path

import numpy as np
import scipy.io
import scipy.sparse

from tests.alphacut.small import table_of, written
from tests.frame.structures.test_affine import beam


def matrices(folder):
    """Masses, a stiffness in two files, and files that are no such matrices."""
    np.savetxt(folder / "masses.csv", np.diag([1.0, 0.5]), delimiter=",")
    scipy.io.mmwrite(folder / "lower.mtx", scipy.sparse.coo_matrix([[1.0, 0.0], [0.0, 0.0]]))
    springs = np.array([[1.0, -1.0], [-1.0, 1.0]])
    np.savez(folder / "upper.npz", springs=springs, other=np.eye(2))
    (folder / "short.csv").write_text("1,0\n")
    np.save(folder / "diagonal.npy", np.ones(2))
    (folder / "upper.csv").write_text("9,3\n0,4\n")
    np.save(folder / "zeros.npy", np.zeros((2, 2)))
    record(folder, "record", np.sin(9 * 0.02 * np.arange(40)))


def record(folder, name, samples, step=0.02):
    """A record NAME.csv with samples in m/s²."""
    rows = "".join(f"{step * k:.4f},{x:.6f}\n" for k, x in enumerate(samples))
    (folder / f"{name}.csv").write_text(f"time [s],acceleration [m/s^2]\n{rows}")


def sines(folder):
    """A record of 4 s, and the same 25 times as fast."""
    time = 0.01 * np.arange(400)
    for name, step in (("record", 0.01), ("short", 0.0004)):
        record(folder, name, np.sin(14 * time) + np.sin(9 * time), step)


def wind(folder):
    """A force of 2 kN and more."""
    (folder / "wind.csv").write_text("time [s],force [kN]\n0,2\n0.5,-4\n1,3\n", encoding="utf-8")


def suite(folder):
    """Two records, the second one three times as strong."""
    for name, seed, size in (("one", 1, 1.0), ("two", 2, 3.0)):
        record(folder, name, size * np.random.default_rng(seed).normal(size=80))


def two_records(folder):
    """Two records of 40 samples."""
    for seed, name in enumerate(("record", "other")):
        record(folder, name, np.random.default_rng(5 + seed).normal(size=40))


MASS = np.diag([20e3, 20e3, 120e3])
STIFFNESS = 2e6 * np.array([[1.0, 0, -0.5], [0, 1.4, 0.8], [-0.5, 0.8, 9.0]])


def components(folder):
    """Matrices of an eccentric floor; records, of which one is longer and one slower."""
    rng = np.random.default_rng(5)
    for name in ("one", "two", "three"):
        record(folder, name, rng.normal(size=60))
    record(folder, "long", rng.normal(size=61))
    record(folder, "slow", rng.normal(size=60), 0.04)
    np.save(folder / "mass.npy", MASS)
    np.save(folder / "stiffness.npy", STIFFNESS)


def exports(folder):
    """Masses of two of three nodes, and stiffnesses of nine digits for some moduli and springs."""
    scipy.io.mmwrite(folder / "mass.mtx", np.diag([0, 0, 40.0, 0.5, 60.0, 0.7]))
    moduli = np.array([210e9, 420e9, 315e9, 210e9, 210e9, 300e9])
    springs = np.array([3.7e6, 3.7e6, 3.7e6, 7.4e6, 5.5e6, 5e6])
    for number, values in enumerate(zip(moduli, springs, strict=True)):
        scipy.io.mmwrite(folder / f"k{number}.mtx", beam(*values), precision=9)


def meshes(folder):
    """The shipped meshes."""
    (folder / "meshes").symlink_to(Path(__file__).parents[3] / "meshes")


def prepared(folder, name, changes=(), texts=None):
    """A base case with texts replaced, beside its files."""
    table = table_of(name)
    for writer in table.get("files", ()):
        globals()[writer](folder)
    for file, text in (table.get("texts", {}) | (texts or {})).items():
        (folder / file).write_text(text, encoding="utf-8")
    return written(folder, table["case"], **dict(changes))
