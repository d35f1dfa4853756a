"""Random storey frames, and the relations of their envelopes."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from alphacut.frame import Accelerogram, DualProof, MatrixStructure, Proof, StoreyFrame, envelope
from alphacut.frame.structures.quantities import Output
from alphacut.frame.structures.storey import chain_matrix
from alphacut.fuzzy import FuzzyNumber, Interval, Triangular
from benchmarks.relations.relation import (
    ONE_LEVEL,
    ONE_OUTPUT,
    ROUNDED,
    SHUFFLED,
    Chance,
    Kind,
    Problem,
    Relation,
)
from benchmarks.relations.stated import of_dataset, scaled

Units = tuple[int, int, int]
"""Powers of length, time and mass."""
OUTPUTS: dict[str, Units] = {"m": (1, 0, 0), "m/s": (1, -1, 0), "m/s^2": (1, -2, 0)}
OUTPUTS |= {"N": (1, -2, 1)}
PLAIN: Problem = {
    "alpha": (0.0, 0.6),
    "tolerance": 1e-2,  # as a share of each peak, where `relative`
    "relative": True,
    "workers": 2,
    "powers": (0, 0, 0),  # of two, by which the units of length, time and mass are smaller
    "matrices": False,  # whether the frame is given as matrices
}


def drawn(chance: Chance) -> Problem:
    """A frame of 1 to 3 storeys with 1 to 3 fuzzy inputs, wide ones where the proof is dual.

    In SI units. `damping` is the ratio of all modes or Rayleigh's factors of mass and stiffness;
    `fuzzy` has relative half-widths, 0 for a crisp input.
    """
    n = int(chance.integers(1, 4))
    masses, stiffness = chance.uniform(1e4, 3e4, n), chance.uniform(1e7, 4e7, n)
    names = [f"{kind}{z + 1}" for kind in "km" for z in range(n)]
    method = str(chance.choice(["proof", "dual"]))
    count, widest = (3, 0.3) if method == "dual" else (int(chance.integers(1, 3)), 0.1)
    damping: tuple[float, ...] = (float(chance.uniform(0.01, 0.1)),)
    names.append("zeta")
    if chance.random() < 0.5:
        damping = (float(chance.uniform(0.2, 0.8)), float(chance.uniform(5e-4, 3e-3)))
        names[-1:] = ["rayleigh_mass", "rayleigh_stiffness"]
    kinds = [f"{kind}{z + 1}" for kind in ("q", "drift", "v", "a", "shear") for z in range(n)]
    inputs, outputs = chance.choice(names, count, False), chance.choice(kinds, 3, False)
    sampling = 0.02 * float(chance.choice([0.5, 1, 2.5]))
    wave = chance.normal(size=int(0.6 / sampling))  # rises from zero and fades to it
    wave = np.append(wave * np.sin(np.linspace(0, np.pi, len(wave))), 0.0)
    return PLAIN | {
        "stiffness": stiffness,
        "masses": masses,
        "damping": damping,
        "fuzzy": {str(name): float(chance.uniform(0.01, widest)) for name in inputs},
        "outputs": tuple(map(str, outputs)),
        "record": 3 * wave / np.abs(wave).max(),
        "sampling": sampling,
        "nodes": int(chance.choice([20, 100])),
        "step": 0.04,
        "method": method,
    }


def stated(problem: Problem) -> xr.Dataset:
    """Statement in SI units."""
    workers, tolerance = problem["workers"], problem["tolerance"]
    methods = {"proof": Proof(tolerance=tolerance, workers=workers)}
    methods["dual"] = DualProof(workers=workers)
    second, frame = _unit(problem, (0, 1, 0)), _structure(problem)
    bounds = envelope(
        _as_matrices(problem, frame) if problem["matrices"] else frame,
        {name: _number(frame, name, reach) for name, reach in problem["fuzzy"].items()},
        duration=problem["nodes"] * problem["step"] * second,
        step=problem["step"] * second,
        alpha=problem["alpha"],
        method=methods.get(problem["method"], problem["method"]),
        relative=problem["relative"],
        progress=False,
    )
    units = {name: 1 / _unit(problem, OUTPUTS[Output(name).unit]) for name in problem["outputs"]}
    return scaled(of_dataset(bounds.to_dataset()), units, 1 / second)


def _unit(problem: Problem, powers: Units) -> float:
    """Factor on numbers with a unit."""
    return float(2.0 ** np.dot(problem["powers"], powers))


def _structure(problem: Problem) -> StoreyFrame:
    """The storey frame in the problem's units."""
    second, damping = _unit(problem, (0, 1, 0)), problem["damping"]
    given: dict[str, Any] = {"damping_ratio": damping[0]}
    if len(damping) == 2:
        given = {"rayleigh": (damping[0] / second, damping[1] * second)}
    record = problem["record"] * _unit(problem, (1, -2, 0))
    return StoreyFrame(
        masses=tuple(problem["masses"] * _unit(problem, (0, 0, 1))),
        stiffness=tuple(problem["stiffness"] * _unit(problem, (0, -2, 1))),
        ground=Accelerogram(problem["sampling"] * second, record),
        outputs=problem["outputs"],
        **given,
    )


def _number(frame: StoreyFrame, name: str, share: float) -> FuzzyNumber:
    """A triangular number about the nominal value, or that value."""
    nominal = frame.parameters[name]
    reach = share * nominal
    ends = nominal - reach, nominal + reach
    return Triangular(ends[0], nominal, ends[1]) if reach else Interval(*ends)


def _as_matrices(problem: Problem, frame: StoreyFrame) -> MatrixStructure:
    """The frame as sums of arrays times parameters; displacements, drifts, velocities alone."""
    n = len(problem["masses"])
    mass = [(f"m{z + 1}", np.outer(e, e)) for z, e in enumerate(np.eye(n))]
    springs = [(f"k{z + 1}", chain_matrix(e)) for z, e in enumerate(np.eye(n))]
    damping: dict[str, Any] = {"ratios": ("zeta",)}
    if len(problem["damping"]) == 2:
        terms = zip(frame.rayleigh, (mass, springs), strict=True)
        damping = {"damping": [(x, factor * array) for factor, y in terms for x, array in y]}
    rows = {}
    for output in problem["outputs"]:
        kind, place = output[:-1], int(output[-1]) - 1
        row = np.eye(2 * n)[place + n * (kind == "v")]
        rows[Output(output)] = row - np.eye(2 * n)[place - 1] * (kind == "drift" and place > 0)
    return MatrixStructure(frame.parameters, mass, springs, rows, ground=frame.ground, **damping)


def _matrices(problem: Problem, chance: Chance) -> Problem | None:
    """The matrices, where damping is linear in the inputs and outputs are plain rows."""
    plain = all(name[0] in "qdv" for name in problem["outputs"])
    # the dual proof takes modes that damping by matrices may couple
    fixed = problem["method"] != "dual" and not any(x.startswith("rayl") for x in problem["fuzzy"])
    return {"matrices": True} if plain and (len(problem["damping"]) == 1 or fixed) else None


def _crisp(problem: Problem, chance: Chance) -> Problem | None:
    names = [f"k{z + 1}" for z in range(len(problem["masses"]))]
    others = [name for name in names if name not in problem["fuzzy"]]
    return {"fuzzy": {others[0]: 0.0, **problem["fuzzy"]}} if others else None


def _refined(problem: Problem, chance: Chance) -> Problem:
    count = len(problem["record"])
    fine = np.interp(np.arange(2 * count - 1) / 2, np.arange(count), problem["record"])
    return {"record": fine, "sampling": problem["sampling"] / 2}


def _in_units(problem: Problem, chance: Chance) -> Problem:
    """Other units by powers of two, even ones of mass: its square root is then exact, too.

    With odd ones the dual proof rounds otherwise, takes other steps and ends at another bound.
    """
    length, time, mass = map(int, chance.integers(-12, 13, 3))
    return {"powers": (length, time, 2 * (mass // 2))}


KIND = Kind(
    drawn,
    stated,
    (
        *(SHUFFLED, ONE_LEVEL, ONE_OUTPUT),
        Relation("half the duration", lambda x, chance: {"nodes": x["nodes"] // 2}),
        Relation(
            "half the step", lambda x, chance: {"step": x["step"] / 2, "nodes": 2 * x["nodes"]}
        ),
        Relation("one more crisp input", _crisp),
        Relation("record refined", _refined),
        Relation("record padded", lambda x, chance: {"record": np.pad(x["record"], (0, 7))}),
        Relation("other units", _in_units, within=ROUNDED),
        Relation("as matrices", _matrices),
        Relation("one thread", lambda x, chance: {"workers": 1}, within=0.0),
        Relation("three threads", lambda x, chance: {"workers": 3}, within=0.0),
    ),
)
