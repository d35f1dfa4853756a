"""Peaks of oscillators of one period on the floors of an uncertain structure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import ceil
from typing import NamedTuple

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import require
from alphacut.base.progress_bar import Progress
from alphacut.frame.analyses.peaks import Peak, close_peaks
from alphacut.frame.bounds.acceleration_gain import acceleration_gain
from alphacut.frame.boxes import Boxes, boxes
from alphacut.frame.calculus.polynomials import Jet
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.dynamics.flow import LinearFlow
from alphacut.frame.dynamics.integrators import Exact
from alphacut.frame.records.history import Accelerogram
from alphacut.frame.response.filtered_record import filtered_record
from alphacut.frame.structures.linear import LinearSystem
from alphacut.frame.structures.matrix import MatrixStructure
from alphacut.frame.structures.model import Dynamics, StructureModel
from alphacut.fuzzy import FuzzyNumber
from alphacut.fuzzy.result import Nature

NODES = 12
"""Time nodes in a period of the oscillator, at least (tuned: 20 take twice the time, and narrow
bounds by a thousandth)."""
FIRST_PHASE = 0.25
"""Phase in rad that the oscillator may turn in a step of its response (tuned)."""
PHASE_WITHOUT_PROOF = 0.05
"""The same where the error of these steps has no bound. A sine is 0.03 % from such lines."""
STEP_ERROR = 1e-3
"""Error of these steps that is aimed at, as a fraction of the spectrum (tuned)."""
MAX_SAMPLES = 200_000
"""Most samples of an oscillator's response; more would take minutes for a bound (tuned)."""


def observed_accelerations(
    structure: StructureModel, outputs: Sequence[str], inputs: Mapping[str, FuzzyNumber | float]
) -> LinearSystem:
    """Return a structure with some absolute accelerations as its outputs.

    Args:
        structure: The structure.
        outputs: Names of the accelerations.
        inputs: Fuzzy parameters by name; without them the nominal ones are looked at.

    Raises:
        RefusedError: It is not linear, not at rest, under forces, or not moved by a record from
            t = 0 on; or an output is no absolute acceleration.
    """
    linear = require_linear(structure)
    grounds = grounds_of(linear)
    for ground in grounds:
        is_plain = not (ground.start or ground.frequency or ground.is_held)
        allowed = "samples from t = 0 on alone"
        require(is_plain, "ground", "a record that starts late, is held or has a sine", allowed)
    forces = [force for force in structure.loads if not force.is_inertial]
    allowed = "accelerograms of the ground alone"
    require(not forces, "loads", f"{len(forces)} forces", allowed)
    system = linear.with_outputs(outputs)
    points = {"": np.zeros(1)}
    if inputs:
        cuts = boxes(inputs)
        points = dict(zip(cuts.names, cuts.probes.T, strict=True))
    count = len(next(iter(points.values())))
    parameters: dict[str, Jet] = {}
    for name, value in system.parameters.items():
        parameters[name] = Jet.constant(np.broadcast_to(points.get(name, value), count), 0)
    assembly = system.assembly(parameters)
    is_at_rest = not (assembly.q0.value.any() or assembly.v0.value.any())
    require(is_at_rest, "structure", "displaced or in motion at the start", "one at rest")
    for k, name in enumerate(system.outputs):
        # Rows are an array unless the overturning moment is an output, which is no acceleration.
        row = assembly.rows[k] if isinstance(assembly.rows, np.ndarray) else np.ones(1)
        is_acceleration = bool(assembly.accelerated[k].any() and not row.any())
        require(is_acceleration, "output", name, "absolute accelerations, as a3 of a frame")
    return system


def moved_by(
    structure: StructureModel, motions: Sequence[Sequence[Accelerogram]]
) -> list[StructureModel]:
    """Return a structure under each of some motions of the ground; without any, as it is moved.

    Args:
        structure: The structure.
        motions: The accelerograms of the components of each.

    Raises:
        RefusedError: It is not linear, or has another number of components.
    """
    if not motions:
        return [structure]
    return [require_linear(structure).moved_by(*grounds) for grounds in motions]


def require_linear(structure: StructureModel) -> LinearSystem:
    """Return a structure, or raise RefusedError if it is not linear."""
    is_linear = structure.dynamics is Dynamics.LINEAR and isinstance(structure, LinearSystem)
    allowed = "a linear structure, whose columns do not yield"
    require(is_linear, "structure", type(structure).__name__, allowed)
    assert isinstance(structure, LinearSystem)
    return structure


def grounds_of(structure: LinearSystem) -> list[Accelerogram]:
    """Return the accelerograms of all components of the ground motion.

    Raises:
        RefusedError: A component has none.
    """
    grounds = [structure.ground]
    if isinstance(structure, MatrixStructure):
        grounds += [ground for ground, _ in structure.components]
    found = [ground for ground in grounds if ground is not None]
    is_complete = len(found) == len(grounds)
    require(is_complete, "ground", None, "an accelerogram of each direction, which moves it")
    return found


class FloorValues(NamedTuple):
    """Floor spectra at one period, of m outputs; levels as of `FloorSpectrum`.

    Args:
        nominal: Values at the nominal inputs, shape (m,), in m/s².
        bound: Upper bounds, shape (levels, m).
        attained: Attained values, shape (levels, m).
        natures: Guarantees of the bounds of each output.
        encloses: Name of the set that the cuts enclose, or empty.
        flow: Accelerations of the oscillators as functions of the inputs.
        error: Error of these by the steps of the oscillator on the ground, shape (m,), in m/s².
        reached_at: Inputs that attain values, and the nominal ones, shape (points, inputs), in SI
            units.
    """

    nominal: Array
    bound: Array
    attained: Array
    natures: tuple[Nature, ...]
    encloses: str
    flow: LinearFlow
    error: Array
    reached_at: Array

    def peaks_at(self, points: Array) -> Array:
        """Return values that the spectra exceed at inputs (points, inputs), shape (points, m)."""
        peaks = np.abs(self.flow.values(points)).max(axis=1)
        return np.asarray(np.maximum(peaks - self.error, 0.0))


def mean_values(values: Sequence[FloorValues], cuts: Boxes) -> FloorValues:
    """Return the means of floor spectra of one period over records.

    The mean of the bounds is one of the mean. What is attained under one record need not be under
    another one by the same structure: so the mean is computed at the inputs that attain the values
    under each, and the largest one in each cut is taken.

    Args:
        values: Those under each record, one at least.
        cuts: Boxes of the inputs.
    """
    first = values[0]
    if len(values) == 1:
        return first
    attained = np.full_like(first.attained, -np.inf)
    if not first.encloses:
        points = np.unique(np.concatenate([x.reached_at for x in values]), axis=0)
        means = np.mean([x.peaks_at(points) for x in values], axis=0)
        for level, (low, high) in enumerate(zip(cuts.lower, cuts.upper, strict=True)):
            is_inside = ((points >= low) & (points <= high)).all(axis=1)
            attained[level] = means[is_inside].max(axis=0)
    natures = zip(*(x.natures for x in values), strict=True)
    return first._replace(
        nominal=np.mean([x.nominal for x in values], axis=0),
        bound=np.mean([x.bound for x in values], axis=0),
        attained=attained,
        natures=tuple(map(Nature.weakest, natures)),
    )


@dataclass(frozen=True, eq=False)
class FloorOscillators:
    """What the spectra of all periods have in common.

    Args:
        system: The structure, whose outputs are absolute accelerations.
        cuts: Boxes of its inputs.
        damping: Damping ratio of the oscillators.
        duration: Length of the simulation, in s.
        step: Largest distance of the time nodes, in s.
        error: Error that is aimed at, as a fraction of each value.
        gain: Bounds in 1/s of the accelerations for a unit of the integral of each component of
            that of the ground, shape (components, outputs); None where no bound is known, for the
            reason `unproved`.
    """

    system: LinearSystem
    cuts: Boxes
    damping: float
    duration: float
    step: float
    error: float
    gain: Array | None
    unproved: str

    @classmethod
    def of(
        cls,
        system: LinearSystem,
        cuts: Boxes,
        damping: float,
        *,
        duration: float,
        step: float,
        error: float,
    ) -> FloorOscillators:
        """Return what the spectra have in common; see the class."""
        gain = None
        unproved = ""
        try:
            influences: list[Array | None] = [None]
            if isinstance(system, MatrixStructure):
                influences += [influence for _, influence in system.components]
            gain = np.array([acceleration_gain(system, cuts, duration, x) for x in influences])
        except UnprovedError as reason:
            unproved = str(reason)
        return cls(system, cuts, damping, duration, step, error, gain, unproved)

    def values(self, period: float, progress: Progress) -> FloorValues:
        """Return the floor spectra at a period in s, which may be 0."""
        step = self.step
        if period:
            step /= ceil(NODES * step / period)
        system, nominal, error = self._filtered(period, step)
        peaks = close_peaks(
            system,
            self.cuts.inputs,
            system.outputs,
            duration=self.duration,
            step=step,
            alpha=tuple(map(float, self.cuts.alpha)),
            error=self.error,
            progress=progress,
        )
        found = [peaks[name] for name in system.outputs]
        natures = [peak.nature for peak in found]
        if error is None:
            natures = [Nature.weakest((nature, Nature.ESTIMATED)) for nature in natures]
            error = np.zeros(len(found))
        bound = np.stack([_upper(peak) for peak in found], axis=-1)
        attained = np.stack([peak.reached for peak in found], axis=-1)
        encloses = found[0].encloses
        if not encloses:  # the nominal inputs belong to each cut
            attained = np.maximum(np.maximum(attained, nominal) - error, 0.0)
        known = [peak.reached_at for peak in found if peak.reached_at]
        points = [[at[name] for name in self.cuts.names] for at in known]
        flow = LinearFlow(system, self.cuts.names, self.duration, step, Exact())
        return FloorValues(
            nominal=nominal,
            bound=bound + error,
            attained=attained,
            natures=tuple(natures),
            encloses=encloses,
            flow=flow,
            error=error,
            reached_at=np.array([self.cuts.nominal, *points]),
        )

    def _filtered(self, period: float, step: float) -> tuple[LinearSystem, Array, Array | None]:
        """Return the structure under the response of an oscillator on the ground.

        Its outputs are the accelerations of oscillators on the floors, see `filtered_record`.

        Args:
            period: Period of the oscillator; at 0 it follows the ground.
            step: Distance of the time nodes, in s.

        Returns:
            The structure; the peaks of its outputs at the nominal inputs, shape (outputs,); and the
            bounds of their errors by the steps of the response, the same shape, None if not known.
        """
        grounds = grounds_of(self.system)
        if not period:
            return self.system, self._nominal(self.system, step), np.zeros(len(self.system.outputs))
        phase = PHASE_WITHOUT_PROOF if self.gain is None else FIRST_PHASE
        substeps = ceil(2 * np.pi / period * grounds[0].step / phase)
        while True:
            found = [
                filtered_record(
                    ground, period, self.damping, substeps=substeps, duration=self.duration
                )
                for ground in grounds
            ]
            system = self.system.moved_by(*(x.record for x in found))
            nominal = self._nominal(system, step)
            if self.gain is None:
                return system, nominal, None
            error = np.array([x.integral_error for x in found]) @ self.gain
            # The error falls with the cube of the step.
            excess = float((error / np.maximum(nominal, 1e-300)).max()) / STEP_ERROR
            finer = substeps * max(2, ceil(excess ** (1 / 3)))
            if excess <= 1 or self.duration * finer > MAX_SAMPLES * grounds[0].step:
                return system, nominal, error
            substeps = finer

    def _nominal(self, system: LinearSystem, step: float) -> Array:
        """Return the peaks of the outputs at the nominal inputs at a third of the step, (m,)."""
        flow = LinearFlow(system, self.cuts.names, self.duration, step / 3, Exact())
        return np.asarray(np.abs(flow.values(self.cuts.nominal[np.newaxis])[0]).max(axis=0))


def _upper(peak: Peak) -> Array:
    """Return the upper bound of a peak with its error, shape (levels,); infinite without one."""
    if peak.nature is Nature.ATTAINED:
        return np.full_like(peak.upper, np.inf)
    return np.asarray(peak.upper + peak.error)
