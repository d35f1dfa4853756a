"""Random storey frames, and the relations of their envelopes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from alphacut.frame import Accelerogram, DualProof, MatrixStructure, Proof, StoreyFrame, envelope
from alphacut.frame.structures.quantities import Output
from alphacut.frame.structures.storey import chain_matrix
from alphacut.fuzzy import FuzzyNumber, Interval, Triangular
from alphacut.fuzzy.arrays import Array
from benchmarks.relations.relation import ROUNDED, Chance, Relation, one_level, shuffled
from benchmarks.relations.stated import Stated

Units = tuple[int, int, int]
"""Powers of length, time and mass."""
OUTPUTS: dict[str, Units] = {"m": (1, 0, 0), "m/s": (1, -1, 0), "m/s^2": (1, -2, 0)}
OUTPUTS |= {"N": (1, -2, 1)}
METHODS = {"proof": Proof, "dual": DualProof}


@dataclass(frozen=True, eq=False)
class Frame:
    """A storey frame with fuzzy inputs under a record, and how its envelopes are asked for.

    Args:
        stiffness: Of storeys, shape (n,), in N/m.
        masses: Of floors, shape (n,), in kg.
        damping: Ratio of all modes, or Rayleigh's factors of mass (1/s) and stiffness (s).
        fuzzy: Half-widths of inputs by name, relative; 0 makes one crisp.
        outputs: Names.
        record: Ground acceleration, in m/s².
        sampling: Its step, in s.
        nodes: Number of steps.
        step: Of the nodes, in s.
        alpha: Levels.
        method: proof, dual or search.
        tolerance: As a share of each peak, where `relative`.
        relative: Whether it is one.
        workers: Threads.
        powers: Powers of two that the units of length, time and mass are smaller by.
        matrices: Whether the frame is given as matrices.
    """

    stiffness: Array
    masses: Array
    damping: tuple[float, ...]
    fuzzy: Mapping[str, float]
    outputs: tuple[str, ...]
    record: Array
    sampling: float
    nodes: int
    step: float
    alpha: tuple[float, ...] = (0.0, 0.6)
    method: str = "proof"
    tolerance: float = 1e-2
    relative: bool = True
    workers: int = 2
    powers: Units = (0, 0, 0)
    matrices: bool = False

    @classmethod
    def drawn(cls, chance: Chance) -> Self:
        """A frame of 1 to 3 storeys with 1 to 3 fuzzy inputs, wide ones where the proof is dual."""
        n = int(chance.integers(1, 4))
        masses, stiffness = chance.uniform(1e4, 3e4, n), chance.uniform(1e7, 4e7, n)
        names = [f"{kind}{z + 1}" for kind in "km" for z in range(n)]
        method = str(chance.choice(["proof", "dual", "search"]))
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
        return cls(
            *(stiffness, masses, damping),
            {str(name): float(chance.uniform(0.01, widest)) for name in inputs},
            *(tuple(map(str, outputs)), 3 * wave / np.abs(wave).max(), sampling),
            nodes=int(chance.choice([20, 100])),
            step=0.04,
            method=method,
        )

    def stated(self) -> Stated:
        """Statements in SI units."""
        options: dict[str, Any] = {"workers": self.workers} if self.method in METHODS else {}
        if self.method == "proof":
            options["tolerance"] = self.tolerance
        second = self._unit((0, 1, 0))
        result = envelope(
            self._as_matrices() if self.matrices else self._structure(),
            {name: self._number(name) for name in self.fuzzy},
            duration=self.nodes * self.step * second,
            step=self.step * second,
            alpha=self.alpha,
            method=METHODS[self.method](**options) if options else self.method,
            relative=self.relative,
            progress=False,
        )
        factors = {name: 1 / self._unit(OUTPUTS[Output(name).unit]) for name in self.outputs}
        return Stated.of_bounds(result).scaled(factors, 1 / second)

    def _unit(self, powers: Units) -> float:
        """Factor on numbers with a unit."""
        return float(2.0 ** np.dot(self.powers, powers))

    def _structure(self) -> StoreyFrame:
        damping: dict[str, Any] = {"damping_ratio": self.damping[0]}
        if len(self.damping) == 2:
            per_second, second = self._unit((0, -1, 0)), self._unit((0, 1, 0))
            damping = {"rayleigh": (self.damping[0] * per_second, self.damping[1] * second)}
        record = self.record * self._unit((1, -2, 0))
        return StoreyFrame(
            masses=tuple(self.masses * self._unit((0, 0, 1))),
            stiffness=tuple(self.stiffness * self._unit((0, -2, 1))),
            ground=Accelerogram(self.sampling * self._unit((0, 1, 0)), record),
            outputs=self.outputs,
            **damping,
        )

    def _number(self, name: str) -> FuzzyNumber:
        """A triangular number about the modal value."""
        modal = self._structure().parameters[name]
        reach = self.fuzzy[name] * modal
        return Triangular(modal - reach, modal, modal + reach) if reach else Interval(modal, modal)

    def _as_matrices(self) -> MatrixStructure:
        """The frame as sums of arrays times parameters; displacements, drifts, velocities alone."""
        frame, floors = self._structure(), np.eye(len(self.masses))
        mass = [(f"m{z + 1}", np.outer(e, e)) for z, e in enumerate(floors)]
        springs = [(f"k{z + 1}", chain_matrix(e)) for z, e in enumerate(floors)]
        damping: dict[str, Any] = {"ratios": ("zeta",)}
        if len(self.damping) == 2:
            terms = zip(frame.rayleigh, (mass, springs), strict=True)
            damping = {"damping": [(x, factor * array) for factor, y in terms for x, array in y]}
        rows = {Output(x): self._row(x) for x in self.outputs}
        return MatrixStructure(
            frame.parameters, mass, springs, rows, ground=frame.ground, **damping
        )

    def _row(self, output: str) -> Array:
        """Row of displacements, drifts and velocities."""
        kind, place = output[:-1], int(output[-1]) - 1
        row = np.zeros(2 * len(self.masses))
        row[place + len(self.masses) * (kind == "v")] = 1.0
        if kind == "drift" and place:
            row[place - 1] = -1.0
        return row


def _matrices(frame: Frame, chance: Chance) -> Frame | None:
    """The matrices, where damping is linear in the inputs and outputs are plain rows."""
    plain = all(name[0] in "qdv" for name in frame.outputs)
    # the dual proof takes modes that damping by matrices may couple
    fixed = frame.method != "dual" and not any(name.startswith("rayleigh") for name in frame.fuzzy)
    return replace(frame, matrices=True) if plain and (len(frame.damping) == 1 or fixed) else None


def _crisp(frame: Frame, chance: Chance) -> Frame | None:
    names = (f"k{z + 1}" for z in range(len(frame.masses)))
    other = next((name for name in names if name not in frame.fuzzy), None)
    return other and replace(frame, fuzzy={other: 0.0, **frame.fuzzy})


def _refined(frame: Frame, chance: Chance) -> Frame:
    count = len(frame.record)
    fine = np.interp(np.arange(2 * count - 1) / 2, np.arange(count), frame.record)
    return replace(frame, record=fine, sampling=frame.sampling / 2)


def _in_units(frame: Frame, chance: Chance) -> Frame:
    """Other units by powers of two, even ones of mass: its square root is then exact, too.

    With odd ones the dual proof rounds otherwise, takes other steps and ends at another bound.
    """
    length, time, mass = map(int, chance.integers(-12, 13, 3))
    return replace(frame, powers=(length, time, 2 * (mass // 2)))


RELATIONS = (
    Relation("inputs in another order", shuffled),
    Relation("one level", one_level),
    Relation("one output", lambda x, chance: replace(x, outputs=x.outputs[:1])),
    Relation("half the duration", lambda x, chance: replace(x, nodes=x.nodes // 2)),
    Relation("half the step", lambda x, chance: replace(x, step=x.step / 2, nodes=2 * x.nodes)),
    Relation("one more crisp input", _crisp),
    Relation("record refined", _refined),
    Relation("record padded", lambda x, chance: replace(x, record=np.pad(x.record, (0, 7)))),
    Relation("other units", _in_units, within=ROUNDED),
    Relation("as matrices", _matrices),
    Relation("one thread", lambda x, chance: replace(x, workers=1), within=0.0),
    Relation("three threads", lambda x, chance: replace(x, workers=3), within=0.0),
)
