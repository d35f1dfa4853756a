"""Guaranteed bounds of the outputs of one yielding storey over a box of inputs."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import comb
from typing import NamedTuple

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.frame.bounds.yielding_element import Load, Storey
from alphacut.frame.bounds.yielding_march import PROVED, End, march
from alphacut.frame.bounds.yielding_outputs import Found, Observed
from alphacut.frame.calculus.taylor_model import TaylorModel
from alphacut.frame.calculus.truncated_polynomials import product_table
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.dynamics.yielding import LoadSubsteps, YieldingFlow, load_substeps
from alphacut.frame.structures.linear import histories
from alphacut.frame.structures.storey import MOMENT
from alphacut.fuzzy.sets.boxes import corners

# Degree of the polynomials by the number of inputs (tuned: more inputs have many more monomials).
DEGREES = {0: 1, 1: 7, 2: 5, 3: 4}
# Most events of a motion whose times are kept; further ones are enclosed, but not named.
MAX_EVENTS = 4000
# Intervals that are added behind the end of the loads, since an event near the end of the motion
# may come later at some inputs. What acts there does not matter.
EXTRA_INTERVALS = 50
# Energy norm of the error, as a fraction of the velocity ω y of a slider that yields, at which a
# sub-box is given up as too wide (tuned).
MAX_ERROR = 0.5
# Fraction of each output's peak that is added for the rounding of all operations (not proved: they
# are some thousand for each number, each with an error of 1e-16).
ROUNDING = 1e-9


class BoxBounds(NamedTuple):
    """Guaranteed bounds over a box; infinite where it is too wide.

    `upper` has the largest values of (−output, output) at T time nodes, shape (T, m, 2), `steps`
    the same over the step before each node, and `peaks` over all times, shape (m, 2). `events` has
    the events in their order, shape (events, 3): the direction of yielding, or 0 of an end of
    yielding, and the earliest and the latest time, in s, which is −∞ and ∞ if it is not bounded.
    `error` bounds the energy norm of the error, in m/s.
    """

    upper: Array
    steps: Array
    peaks: Array
    events: Array
    error: float


class _Coefficients(NamedTuple):
    """Polynomials of the storey over the box, as Taylor models of no axes."""

    stiffness: TaylorModel  # k, in N/m
    hardening: TaylorModel
    yield_drift: TaylorModel
    softening: TaylorModel  # weight over height, in N/m
    mass: TaylorModel
    damping: TaylorModel  # in N s/m
    height: TaylorModel | None
    start: tuple[TaylorModel, TaylorModel]  # displacement and velocity


@dataclass(frozen=True, eq=False)
class YieldingStorey:
    """One storey that yields, with its active inputs.

    Args:
        flow: Its exact trajectories.
        active: Indices of the inputs that have a width, at most three, among the names of `flow`.

    Raises:
        UnprovedError: There is more than one storey, more than three inputs are active, or damping,
            loads or outputs are such that the energy of an error is not bounded.
    """

    flow: YieldingFlow
    active: Ints

    def __post_init__(self) -> None:
        """Check that the inequality of `yielding_element` holds for the storey."""
        system = self.flow.system
        if system.floors > 1:
            what = f"columns of one storey can be proved, and the frame has {system.floors}"
            raise UnprovedError(what, "take quasi-monte-carlo, or auto, which searches peaks")
        has_tangent = system.rayleigh_of == "tangent"
        if has_tangent and (system.rayleigh[1] or "rayleigh_stiffness" in self.flow.names):
            what = "damping by the tangent stiffness jumps at events"
            raise UnprovedError(what, 'take rayleigh_of = "initial"')
        if len(system.ratios) and "zeta1" in system.ratios and "zeta" in system.ratios:
            raise UnprovedError("damping has two ratios", "take one")
        self._require_loads()

    def _require_loads(self) -> None:
        """Raise an error unless the load per unit of mass is the same at all inputs.

        Raises:
            UnprovedError: A force is static or an impulse; or a force acts, and it, or the mass, is
                uncertain, or an acceleration is observed.
        """
        system = self.flow.system
        if not system.loads:
            return
        names = {self.flow.names[i] for i in self.active}
        if any(load.history is None or load.history.is_static for load in system.loads):
            raise UnprovedError("a static force or an impulse moves the storey at the start")
        if names & {"m1", *system.force_names}:
            what = "beside a force its amplitude and the mass are not enclosed"
            raise UnprovedError(what, "take them as crisp numbers")
        if any(system.quantity(name)[0] == "a" for name in self.flow.outputs):
            raise UnprovedError("a force moves accelerations at once", "observe other outputs")

    @property
    def degree(self) -> int:
        """Degree of the polynomials of the inputs."""
        return DEGREES[len(self.active)]

    @cached_property
    def substeps(self) -> LoadSubsteps:
        """Substeps in which all loads are linear, each no longer than 1 / `max_frequency`."""
        loads = list(histories(self.flow.system).values())
        return load_substeps(loads, self.flow.time, longest=1 / self.max_frequency)

    def loads(self, values: Array) -> tuple[Load, Ints, int]:
        """Return the load, the time node at each of its edges, −1 for none, and the last edge.

        Args:
            values: Values of all inputs in SI units, shape (d,). The load per unit of mass must be
                the same at all values of the active inputs, see `_require_loads`.
        """
        flow = self.flow
        system = flow.system
        parameters = system.parameters | dict(zip(flow.names, values, strict=True))
        steps = self.substeps
        n_loads = steps.first.shape[1]
        pushes = np.zeros(n_loads)
        column = 0
        if system.ground is not None:
            pushes[0] = -1.0
            column = 1
        keys = list(histories(system).values())[column:]
        for name, force in zip(system.force_names, system.loads, strict=True):
            assert force.history is not None
            place = [x.identity for x in keys].index(force.history.identity)
            pushes[column + place] += parameters[name] / parameters["m1"]
        first = steps.first @ pushes
        last = steps.last @ pushes
        width = np.diff(steps.edges)
        slope = (last - first) / width
        beyond = width.max() * np.arange(1, EXTRA_INTERVALS + 1)
        edges = np.append(steps.edges, steps.edges[-1] + beyond)
        end = last[-1] if len(last) else 0.0
        load = Load(
            edges=edges,
            first=np.append(first, np.full(EXTRA_INTERVALS, end)),
            slope=np.append(slope, np.zeros(EXTRA_INTERVALS)),
        )
        node: Ints = np.full(len(edges), -1)
        node[: len(steps.edges)][steps.is_node] = np.arange(len(flow.time))
        return load, node, len(steps.edges) - 1

    @cached_property
    def max_frequency(self) -> float:
        """Frequency that sets the length of elements, in rad/s; any value would be valid."""
        system = self.flow.system
        p = {x: TaylorModel.constant(y, 0) for x, y in system.parameters.items()}
        found = self._coefficients(p)
        return float(np.sqrt(found.stiffness.value / found.mass.value))

    @cached_property
    def yield_velocity(self) -> float:
        """Velocity ω y of the storey when it begins to yield, at nominal parameters, in m/s."""
        system = self.flow.system
        p = {x: TaylorModel.constant(y, 0) for x, y in system.parameters.items()}
        return self.max_frequency * float(self._coefficients(p).yield_drift.value)

    def bounds(self, low: Array, high: Array) -> BoxBounds:
        """Return guaranteed bounds of the outputs over a box of the inputs.

        Args:
            low: Lower ends of all inputs of the flow, in SI units, shape (d,).
            high: Upper ends; those of inputs that are not active must be equal.

        Raises:
            UnprovedError: A quantity that must be positive is not so at a corner of the box.
        """
        m = len(self.flow.outputs)
        shape = (len(self.flow.time), m, 2)
        try:
            found = self._coefficients(self._parameters(low, high))
            storey = self._storey(found)
            rows, remainder, weights = self._observed(found)
        except UnprovedError:
            # It may be positive nevertheless, which is then known of sub-boxes.
            for corner in corners(low, high):
                self._storey(self._coefficients(self._parameters(corner, corner)))
            unknown = np.full(shape, np.inf)
            return BoxBounds(unknown, unknown, unknown[0], np.zeros((0, 3)), np.inf)
        load, node, last = self.loads(low)
        step: Ints = np.cumsum((node >= 0).astype(np.int64))
        terms = rows.shape[-1]
        observed = Observed(rows, remainder, weights, last, node, step)
        result = Found(
            bounds=np.full(shape, -np.inf),
            steps=np.full(shape, -np.inf),
            peaks=np.full((m, 2), -np.inf),
            events=np.zeros((MAX_EVENTS, 3)),
        )
        start = tuple(_padded(x, terms) for x in found.start)
        limit = MAX_ERROR * self.yield_velocity
        end = End(*march(storey, load, observed, start, limit, result))
        widening = ROUNDING * np.abs(result.peaks).max(axis=1, initial=0.0)[:, np.newaxis]
        for values in (result.bounds, result.steps, result.peaks):
            values += widening
            if end.status != PROVED:
                values[:] = np.inf
            self._limit_residual(found, values)
        events = result.events[: end.events]
        return BoxBounds(result.bounds, result.steps, result.peaks, events, end.error)

    def _parameters(self, low: Array, high: Array) -> dict[str, TaylorModel]:
        """Return all parameters of the frame over a box, as Taylor models."""
        d = len(self.active)
        fixed = self.flow.system.parameters | dict(zip(self.flow.names, low, strict=True))
        p = {x: TaylorModel.constant(np.float64(y), d, self.degree) for x, y in fixed.items()}
        centre = (low + high)[self.active] / 2
        radius = (high - low)[self.active] / 2
        variables = TaylorModel.variables(centre, radius, self.degree)
        for number, index in enumerate(self.active):
            p[self.flow.names[index]] = variables[number]
        return p

    def _coefficients(self, p: dict[str, TaylorModel]) -> _Coefficients:
        """Return the properties of the storey from its parameters."""
        system = self.flow.system
        k = system.springs(p)[..., 0]
        m = p["m1"]
        softening = k * 0.0
        height = None
        if system.gravity:
            softening = system.softening(p)[..., 0]
        if len(system.lengths):
            height = p["l1"]
        damping = p["d1"] + p["rayleigh_mass"] * m + p["rayleigh_stiffness"] * k
        for ratio in system.ratios:
            # the only mode has the damping 2 ζ √(stiffness · mass)
            damping = damping + p[ratio] * ((k - softening) * m) ** 0.5 * 2.0
        return _Coefficients(
            stiffness=k,
            hardening=system.hardenings(p)[..., 0],
            yield_drift=system.yield_drifts(p)[..., 0],
            softening=softening,
            mass=m,
            damping=damping,
            height=height,
            start=(p["q1_0"], p["v1_0"]),
        )

    def _storey(self, found: _Coefficients) -> Storey:
        """Return the storey per unit of mass.

        Raises:
            UnprovedError: Hardening or yield drift are not known to be such that the energy norm
                bounds errors; or the initial displacement may be beyond the yield drift.
        """
        per_mass = found.mass**-1.0
        slider = (1.0 - found.hardening) * found.stiffness
        yielded = found.hardening * found.stiffness - found.softening
        force = slider * found.yield_drift * per_mass
        models = [
            found.damping * per_mass,
            (yielded + slider) * per_mass,
            yielded * per_mass,
            slider * per_mass,
            force,
            found.yield_drift,
        ]
        terms = comb(len(self.active) + self.degree, self.degree)
        # The lower end of a product may be negative where all factors are positive. So those of the
        # factors are multiplied as well: K_z = (1 − a) k / m, and so on.
        least_stiffness = _lower_end(found.stiffness)
        greatest_mass = -_lower_end(-found.mass)
        min_drift = _lower_end(found.yield_drift)
        min_slider = _lower_end(1.0 - found.hardening) * least_stiffness / greatest_mass
        after_yielding = _lower_end(found.hardening) * least_stiffness
        after_yielding += _lower_end(-found.softening)
        by_factors = np.array([after_yielding / greatest_mass, min_slider, min_slider * min_drift])
        by_factors -= 1e-15 * np.abs(by_factors)
        lower = np.maximum(by_factors, [_lower_end(x) for x in models[2:5]])
        # Without hardening rounding alone may make this negative.
        if lower[0] < -1e-12 * float(models[1].magnitude()):
            what = "the stiffness after yielding, less weight over height, may be negative"
            raise UnprovedError(what, "take more hardening, or less weight")
        if not min(min_drift, *lower[1:]) > 0:
            what = "hardening below 1 and a positive yield drift are needed at all inputs"
            raise UnprovedError(what, "narrow them")
        if not float(found.start[0].magnitude()) < min_drift:
            what = "the storey may be displaced beyond its yield drift at the start"
            raise UnprovedError(what, "take a smaller q1_0, or none")
        return Storey(
            rows=np.array([_padded(x, terms) for x in models]),
            remainder=np.array([float(x.remainder) for x in models]),
            magnitude=np.array([float(x.magnitude()) for x in models]),
            table=product_table(len(self.active), self.degree),
            min_yielded=max(float(lower[0]), 0.0),
            min_slider=float(lower[1]),
            min_force=float(lower[2]),
        )

    def _observed(self, found: _Coefficients) -> tuple[Array, Array, Array]:
        """Return coefficients, remainders and weights of the outputs; see `Observed`."""
        k = found.stiffness
        zero = k * 0.0
        one = zero + 1.0
        slider = (1.0 - found.hardening) * k
        y = found.yield_drift
        all_rows = []
        weights = []
        for kind, _ in map(self.flow.system.quantity, self.flow.outputs):
            row = [zero] * 6
            weight = [zero] * 4
            if kind in ("q", "drift", "ductility"):
                factor = y**-1.0 if kind == "ductility" else one
                row[:2] = [factor, factor]
                weight[0] = factor
            elif kind == "v":
                row[2] = weight[1] = one
            elif kind in ("shear", MOMENT, "a"):
                factor = one
                stiffness = k
                if kind == "a":  # the forces of columns, weight and damping move the mass
                    factor = -(found.mass**-1.0)
                    stiffness = k - found.softening
                    row[2] = weight[1] = found.damping * factor
                if kind == MOMENT:
                    assert found.height is not None  # as the output would be refused
                    factor = found.height
                row[0] = stiffness * factor
                row[1] = weight[0] = (stiffness - slider) * factor
                row[3] = weight[2] = slider * factor
                row[4] = slider * y * factor
            elif kind == "residual":
                # the drift without load, (1 − a) k p / (k − s), is limited afterwards
                factor = slider * (k - found.softening) ** -1.0
                row[3] = -factor
                row[1] = weight[0] = weight[2] = factor
                row[4] = -(y * factor)
            else:
                row[5] = weight[3] = slider * y
            all_rows.append(row)
            weights.append([float(x.magnitude()) for x in weight])
        terms = comb(len(self.active) + self.degree, self.degree)
        rows = np.array([[_padded(x, terms) for x in row] for row in all_rows])
        remainder = np.array([[float(x.remainder) for x in row] for row in all_rows])
        return rows, remainder, np.array(weights)

    def _limit_residual(self, found: _Coefficients, values: Array) -> None:
        """Limit bounds of residual drifts, in place, to where the unloaded storey yields back.

        It yields back at (1 − a) k y / |a k − s| of either sign. `values` has the shape (…, m, 2).
        """
        stiffness = found.hardening * found.stiffness - found.softening
        if not float(stiffness.bounds()[0]) > 0:
            return
        slider = (1.0 - found.hardening) * found.stiffness
        low, high = (slider * found.yield_drift * stiffness**-1.0).bounds()
        for column, name in enumerate(self.flow.outputs):
            if self.flow.system.quantity(name)[0] == "residual":
                of_output = values[..., column, :]
                of_output[...] = np.clip(of_output, -low, high)


def _lower_end(model: TaylorModel) -> float:
    """Return the lower bound of one function over the box."""
    return float(model.bounds()[0])


def _padded(model: TaylorModel, terms: int) -> Array:
    """Return the coefficients of one function, with zeros up to (terms,)."""
    found = np.zeros(terms)
    given = model.coefficients
    found[: len(given)] = given
    return found
