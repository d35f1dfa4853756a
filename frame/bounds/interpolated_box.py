"""Guaranteed bounds of the outputs of a frame with one yielding storey over a box of inputs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.interpolate import PPoly
from scipy.linalg import eigh

from alphacut.base.arrays import Array, Ints
from alphacut.frame.bounds.interpolated_defects import (
    BoxModel,
    Properties,
    defects,
    drifts,
    interpolate,
)
from alphacut.frame.bounds.interpolated_motions import (
    LOAD_TERMS,
    MAX_TERMS,
    NONE,
    Elements,
    Frames,
    LoadIntegrals,
    march,
)
from alphacut.frame.bounds.interpolated_outputs import (
    OutputRows,
    observe,
    output_series,
    part_peaks,
    polygons,
)
from alphacut.frame.calculus.interpolation import bernstein_matrix, coefficients, grid
from alphacut.frame.calculus.taylor_model import TaylorModel, concatenate
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.dynamics.integrators import SAME
from alphacut.frame.dynamics.yielding import YieldingFlow
from alphacut.frame.modes.damped import geometric_mean
from alphacut.frame.records.history import History
from alphacut.frame.structures.linear import Assembly, histories, undamped_modes
from alphacut.frame.structures.storey import MOMENT

# Degree of the interpolation of motions in each input, by the number of inputs (tuned; up to 4 the
# Lebesgue constant of the grid is below 2).
DEGREES = {0: 0, 1: 4, 2: 3, 3: 2}
# Highest order of the Taylor models of properties, and the sum of their remainders, as fractions,
# at which a lower one suffices (tuned: over 30 s the response misses some hundred times that).
MAX_ORDER = 6
SMALL_REMAINDER = 1e-7
# Fraction of each output's peak that is added for the rounding of all operations (not proved: they
# are some thousand for each number, each with an error of 1e-16).
ROUNDING = 1e-9
# Intervals that are added behind the end of the loads, since an event near the end of the motion
# may come later at some inputs. What acts there does not matter.
EXTRA_INTERVALS = 60
# Elements of one march at most, for each interval of the loads and each substep between samples.
MAX_ELEMENTS = 8
# Norm S, as a multiple of the room at its time for events that are left out, at which a box is
# given up as too wide, and the part of the least room that an element may take without a closer
# look (tuned).
GIVE_UP = 10.0
SMALL_VIOLATION = 1e-4
# Length of an element that begins and ends at fixed times, as a fraction of the largest one, and
# the same where much may be left out (tuned: the polynomial of the load misses little of intervals
# that are much shorter).
STRIDE = 0.25
LONG_STRIDE = 0.5
# Numbers of one array up to which elements are treated together (tuned to the processor's caches).
CHUNK = 400_000
# How far the slider may be moved by events that are left out if nothing else is known, and by one
# that all motions have, as multiples of the yield drift (tuned).
MAX_MOVED = 3.0
# Parts of an element's time on which the side of the slider's force is sought (tuned).
SIDE_PARTS = 8
SMALL_EVENT = 1e-8
# Changes of the side of the slider's force that the room for left-out events reckons with (tuned).
SIDE_CHANGES = 20
# Largest difference of the times of an event at the parameter sets of a box, as a fraction of the
# elastic period (tuned: far below the time between two events with one side).
WINDOW = 0.25


@dataclass(frozen=True, eq=False)
class BoxBounds:
    """Guaranteed bounds over a box; infinite where it is too wide.

    Args:
        upper: Largest values of (−output, output) at T time nodes, shape (T, m, 2).
        steps: The same over the step before each node, shape (T, m, 2).
        peaks: The same over all times, shape (m, 2).
        error: Bound of the energy norm S of the error at the end, in J^½.
        axis: Number of the input, among all of the flow, at whose two ends the most different
            numbers of motions have an event without a common order; None if there is none.
    """

    upper: Array
    steps: Array
    peaks: Array
    error: float
    axis: int | None = None


class _Swept(NamedTuple):
    """What is known of E elements before the errors of their motions are."""

    growth: Array  # as those that follow, see `Defects`
    violation: Array
    drift: Array
    path: Array
    beyond: Array
    level: Array
    times: Array  # see `Interpolant`, (E, 6)
    upper: Array  # see `polygons`, (E, m, 2, K)
    missed: Array  # what the series of outputs miss, (E, m)
    at_end: Array  # largest values of (−output, output) at the end, (E, m, 2)
    low: Array  # bounds of the slider's force on parts of the time, (E, SIDE_PARTS)
    high: Array


@dataclass(frozen=True, eq=False)
class InterpolatedFrame:
    """A frame with one yielding storey, with its active inputs.

    Args:
        flow: Its exact trajectories.
        active: Indices of the inputs that have a width, at most three, among the names of `flow`.

    Raises:
        UnprovedError: More or less than one storey yields, or damping, loads or outputs are such
            that the energy of an error is not bounded.
    """

    flow: YieldingFlow
    active: Ints

    def __post_init__(self) -> None:
        """Check that the inequality of the theory holds for the frame."""
        system = self.flow.system
        names = {self.flow.names[i] for i in self.active}
        yielding = self._yielding
        if len(yielding) != 1:
            what = f"columns of one storey can be proved, and {len(yielding)} storeys may yield"
            cure = "take hardening 1 for storeys that stay elastic"
            raise UnprovedError(what, cure)
        has_tangent = system.rayleigh_of == "tangent"
        factor = "rayleigh_stiffness"
        if has_tangent and (system.parameters[factor] or factor in names):
            what = "damping by the tangent stiffness jumps at events"
            raise UnprovedError(what, 'take rayleigh_of = "initial"')
        if not system.loads:
            return
        # The accelerations by loads must be the same at all inputs.
        if any(load.history is None or load.history.is_static for load in system.loads):
            raise UnprovedError("a static force or an impulse moves the frame at the start")
        masses = {f"m{z + 1}" for z in range(system.floors)}
        if names & (masses | set(system.force_names)):
            what = "beside a force its amplitude and the masses are not enclosed"
            raise UnprovedError(what, "take them as crisp numbers")
        if any(system.quantity(name)[0] == "a" for name in self.flow.outputs):
            raise UnprovedError("a force moves accelerations at once", "observe other outputs")

    @property
    def _yielding(self) -> list[int]:
        """Numbers of the storeys that may yield, from 0."""
        system = self.flow.system
        names = [f"hardening{z + 1}" for z in range(system.floors)]
        nominal = system.parameters
        return [z for z, x in enumerate(names) if nominal[x] < 1 or x in self.flow.names]

    @cached_property
    def loads(self) -> tuple[LoadIntegrals, int]:
        """Integrals of the loads twice over time, and the number of the edge at the end."""
        system = self.flow.system
        keys = list(histories(system).values())
        nominal = {x: TaylorModel.constant(np.float64(y), 0) for x, y in system.parameters.items()}
        stiffness = float(system.springs(nominal).value[self._yielding[0]])
        frequency = np.sqrt(stiffness / sum(system.masses))
        edges, last = _edges(keys, float(self.flow.time[-1]), longest=0.3 / frequency)
        first = np.zeros((len(edges) - 1, max(len(keys), 1)))
        end = np.zeros_like(first)
        for column, load in enumerate(keys):
            first[:last, column] = load.envelope(edges[:last])
            end[:last, column] = load.envelope(edges[1 : last + 1], -1.0)
        slope = (end - first) / np.diff(edges)[:, np.newaxis]
        powers = PPoly(np.stack([slope, first]), edges).antiderivative(2).c[::-1]
        return LoadIntegrals(edges, np.ascontiguousarray(np.moveaxis(powers, 0, -1))), last

    def bounds(self, low: Array, high: Array, allowed: Array | None = None) -> BoxBounds:
        """Return guaranteed bounds of the outputs over a box of the inputs.

        Args:
            low: Lower ends of all inputs of the flow, in SI units, shape (d,).
            high: Upper ends; those of inputs that are not active must be equal.
            allowed: By how much events that are left out may widen each output from each time node
                on, shape (T, m); as much as they do by default. It guides the proof, and proves
                nothing.

        Raises:
            UnprovedError: A quantity that must be positive is not known to be so over the box.
        """
        model, rows = self._model(low, high)
        room = None if allowed is None else self._room(model, rows, allowed)
        elements, alone = self._motions(model, room)
        if elements is None:
            along = np.abs(alone @ grid(model.inputs, model.degree))
            if not (along > 1e-9).any():  # but for rounding as many at either end of each input
                return self.infinite
            return replace(self.infinite, axis=int(self.active[along.argmax()]))
        return self._sweep(model, rows, elements, room) or self.infinite

    def _room(self, model: BoxModel, rows: OutputRows, allowed: Array) -> Array:
        """Return how large S may become from each interval of the loads on, shape (E,), in J^½.

        Args:
            model: The frame over the box.
            rows: Its outputs.
            allowed: See `bounds`.
        """
        end = self.flow.time[-1]
        # The error of a drift without hardening is bounded by the integral of S alone, and that of
        # the plastic path by changes of side.
        by_drift = rows.of_drift * model.direction_norm * end + rows.without_drift
        plastic = min(1 / model.soft_root, model.direction_norm * end) + 2 / np.sqrt(
            model.low.slider
        )
        by_norm = np.minimum(rows.by_norm, by_drift)
        by_norm += rows.magnitude[:, -1] * 2 * SIDE_CHANGES * plastic
        # Outputs that stay at rest, on which S has no influence, do not count.
        room = (allowed / np.where(by_norm > 0, by_norm, 1e-300)).min(axis=1)
        least_drift = (model.at_sets.force / model.at_sets.slider).min()
        room = np.minimum(room, MAX_MOVED * least_drift * np.sqrt(model.high.slider))
        return np.asarray(np.interp(self.loads[0].edges[:-1], self.flow.time, room))

    @property
    def infinite(self) -> BoxBounds:
        """Bounds that say nothing."""
        shape = (len(self.flow.time), len(self.flow.outputs), 2)
        nothing = np.full(shape, np.inf)
        return BoxBounds(nothing, nothing.copy(), np.full(shape[1:], np.inf), np.inf)

    def require_provable(self, point: Array) -> None:
        """Raise an error unless the frame at parameters in SI units, shape (d,), can be proved.

        Raises:
            UnprovedError: See `_model`.
        """
        self._model(point, point)

    def _parameters(self, low: Array, high: Array, order: int) -> dict[str, TaylorModel]:
        """Return all parameters of the frame over a box, as Taylor models."""
        d = len(self.active)
        fixed = self.flow.system.parameters | dict(zip(self.flow.names, low, strict=True))
        p = {x: TaylorModel.constant(np.float64(y), d, order) for x, y in fixed.items()}
        centre = (low + high)[self.active] / 2
        radius = (high - low)[self.active] / 2
        variables = TaylorModel.variables(centre, radius, order)
        for number, index in enumerate(self.active):
            p[self.flow.names[index]] = variables[number]
        return p

    def _properties(self, p: Mapping[str, TaylorModel]) -> tuple[Properties[TaylorModel], Array]:
        """Return the properties of the frame from its parameters, and w of its loads, (L, N)."""
        system = self.flow.system
        full: Assembly[TaylorModel] = system.assembly(p)
        z = self._yielding[0]
        floors = np.arange(system.floors)
        mass = full.mass[floors, floors]
        damping = full.dashpots
        for factor, matrix in zip(full.rayleigh, (full.mass, full.springs), strict=True):
            if factor.magnitude() > 0:
                damping = damping + factor * matrix
        if any(x.magnitude() > 0 for x in full.ratios):
            damping = damping + _ratio_damping(full)
        follow: list[Array] = []
        if system.ground is not None:
            follow.append(np.full((1, system.floors), -1.0))
        if full.forces is not None:
            follow.append((full.forces.value / mass.value[:, np.newaxis]).T)
        inverse_mass = mass**-1.0
        hardening = system.hardenings(p)
        columns = system.springs(p)
        stiffness = hardening * columns
        if system.gravity:
            stiffness = stiffness - system.softening(p)
        found = Properties(
            mass=mass,
            inverse_mass=inverse_mass,
            damping=damping,
            decay=inverse_mass[:, None] * damping,
            stiffness=stiffness,
            slider=(1.0 - hardening[z]) * columns[z],
            force=(1.0 - hardening[z]) * self._yield_force(p),
            q0=full.q0,
            v0=full.v0,
        )
        return found, np.concatenate(follow or [np.zeros((1, system.floors))])

    def _yield_force(self, p: Mapping[str, TaylorModel]) -> TaylorModel:
        """Return the yield force of the yielding storey, in N."""
        system = self.flow.system
        z = self._yielding[0]
        if system.yield_force:
            return p[f"fy{z + 1}"]
        return system.springs(p)[z] * system.yield_drifts(p)[z]

    def _model(self, low: Array, high: Array) -> tuple[BoxModel, OutputRows]:
        """Return the properties of the frame and its outputs over a box.

        They are kept to the lowest order with small remainders.

        Raises:
            UnprovedError: Hardening, masses or yield drift are not known to be such that the energy
                norm bounds errors; or the storey may be displaced beyond its yield drift at first.
        """
        for order in range(1, MAX_ORDER + 1):
            p = self._parameters(low, high, order)
            found, follow = self._properties(p)
            # Initial states are linear in the inputs; their rounding is covered by the margin.
            scaled = found._replace(stiffness=found.stiffness + found.slider)  # may be near 0 alone
            if max(map(_relative_remainder, scaled[:-2])) < SMALL_REMAINDER:
                break
        z = self._yielding[0]
        rows = [self._row(p, found, output) for output in self.flow.outputs]
        d = len(self.active)
        degree = DEGREES[d]
        of_speed = max(_degree(found.inverse_mass), _degree(found.decay))
        n = len(found.mass.value)
        row_degrees = np.zeros(len(rows), int)
        if d:
            row_degrees += [
                degree + _degree(x) + of_speed * bool(x[n : 2 * n].magnitude().any()) for x in rows
            ]
        order = max(_degree(x) for x in found[:-2])
        coarse = max(degree + order, int(row_degrees.max(initial=0)))
        fine = max(2 * degree + order, coarse)
        points = grid(d, fine)
        lowest = Properties(*(x.bounds()[0] for x in found))
        # Products of the lower ends of factors are lower ends, too, and closer where the hardening
        # may be 0 or near 1.
        system = self.flow.system
        least_columns = system.springs(p).bounds()[0]
        least_hardening, most_hardening = system.hardenings(p).bounds()
        by_factors = least_hardening * least_columns
        if system.gravity:
            by_factors = by_factors - system.softening(p).bounds()[1]
        least_stiffness = np.maximum(lowest.stiffness, by_factors)
        least_part = max(1 - most_hardening[z], 0.0)
        lowest = lowest._replace(
            stiffness=np.maximum(least_stiffness, 0.0),
            slider=max(lowest.slider, least_part * least_columns[z]),
            force=max(lowest.force, least_part * self._yield_force(p).bounds()[0]),
        )
        # Without hardening rounding alone may make this negative.
        for storey in np.flatnonzero(least_stiffness < -1e-12 * system.springs(p).magnitude())[:1]:
            stiffness_words = f"the stiffness of storey {storey + 1} after yielding"
            what = f"{stiffness_words}, less weight over height, may be negative"
            raise UnprovedError(what, "take more hardening, or less weight")
        if not min(lowest.slider, lowest.force, lowest.mass.min()) > 0:
            what = "positive masses, hardening below 1 and a positive yield drift are needed"
            raise UnprovedError(what, "narrow them")
        start = found.q0[z] - found.q0[z - 1] if z else found.q0[z]
        if not float(start.magnitude()) * found.slider.magnitude() < lowest.force:
            what = "the storey may be displaced beyond its yield drift at the start"
            raise UnprovedError(what, "take a smaller q1_0, or none")
        model = BoxModel(
            inputs=d,
            degree=degree,
            fine=fine,
            coarse=coarse,
            of_slider=degree + max(_degree(found.slider), _degree(found.force)) if d else 0,
            place=z,
            follow=np.ascontiguousarray(follow),
            at_sets=Properties(*(_on_grid(x, grid(d, degree)) for x in found)),
            grid=Properties(*(_on_grid(x, points) for x in found)),
            low=lowest,
            high=Properties(*(x.magnitude() for x in found)),
            missed=Properties(*(x.remainder for x in found)),
        )
        magnitude = np.array([x.magnitude() for x in rows])
        # (hᵀ K_p⁻¹ h + jᵀ M⁻¹ j + g² K_z)^½ of an output hᵀ q + jᵀ v + g r
        by_drift = magnitude[:, :n] ** 2 / np.maximum(lowest.stiffness, 1e-150)
        others = magnitude[:, n : 2 * n] ** 2 @ model.high.inverse_mass
        others += magnitude[:, 2 * n] ** 2 * model.high.slider
        return model, OutputRows(
            factors=np.array([_on_grid(x, grid(d, coarse)) for x in rows]),
            remainder=np.array([x.remainder for x in rows]),
            magnitude=magnitude,
            by_norm=np.sqrt(others + by_drift.sum(axis=1)),
            without_drift=np.sqrt(others + np.delete(by_drift, z, axis=1).sum(axis=1)),
            of_drift=magnitude[:, z],
            degree=row_degrees,
        )

    def _motions(self, model: BoxModel, room: Array | None) -> tuple[Elements | None, Array]:
        """Return motions at J parameter sets of the box, or None without a common order of events.

        The array, of shape (J,), is 1 then where motions have an event that others do not have.
        """
        at = model.at_sets
        z = model.place
        loads, last = self.loads
        n, n_sets = at.mass.shape
        # The Taylor series over an element converges fast where |λ| h ≤ 1 for all eigenvalues λ;
        # where nothing happens an element may be twice as long (`CALM`).
        incidence = drifts(np.eye(n), axis=0)  # drifts of displacements
        elastic = at.stiffness + at.slider * (np.arange(n) == z)[:, np.newaxis]
        zero = np.zeros((n_sets, n, n))
        mobility = at.inverse_mass.T[:, :, np.newaxis] * np.eye(n)
        springs = np.einsum("zi,zj,zp->pij", incidence, incidence, elastic)
        state = np.block([[-np.moveaxis(at.decay, -1, 0), mobility], [-springs, zero]])
        longest = 1.0 / float(np.abs(np.linalg.eigvals(state)).max())
        slowest = float(np.sqrt((at.slider * at.inverse_mass[z]).min()))
        width = np.diff(loads.edges[: last + 1]).mean() if last else 1.0
        most = int(MAX_ELEMENTS * (last + 10) * (1 + width / longest))
        n_loads = len(model.follow)
        elements = Elements(
            begin=np.empty((most, n_sets)),
            length=np.empty((most, n_sets)),
            phase=np.empty(most, np.int64),
            constant=np.empty((most, n_sets)),
            path=np.empty((most, n_sets)),
            series=np.empty((most, MAX_TERMS, 2 * n, n_sets)),
            fit=np.empty((most, n_loads, LOAD_TERMS)),
            span=np.empty((most, 2)),
            fit_error=np.empty((most, n_loads, 2)),
            event=np.empty(most, np.int64),
            terms=np.empty(most, np.int64),
        )
        least_drift = float((at.force / at.slider).min())
        # Without a plan an event that only some motions have is left out at any cost.
        moved: Array = np.full(len(loads.powers), MAX_MOVED * least_drift)
        small = SMALL_EVENT * least_drift
        if room is not None:
            moved = room / np.sqrt(model.high.slider)
            small = max(0.1 * float(moved[0]), small)
        frames = Frames(
            at.inverse_mass, at.decay, at.stiffness, at.slider, at.force, z, model.follow
        )
        momentum = at.mass * at.v0 + (at.damping * at.q0).sum(axis=1)
        start = np.concatenate([at.q0, momentum]).T.copy()
        window = WINDOW * 2 * np.pi / slowest
        alone = np.empty(n_sets)
        spectral = np.ascontiguousarray(coefficients(np.eye(n_sets), model.inputs, model.degree).T)
        # What longer elements miss matters little beside much that may be left out.
        is_wide = room is not None and float(moved.min()) > least_drift / 2
        stride = max(int((LONG_STRIDE if is_wide else STRIDE) * longest / width), 1)
        count = march(
            frames, loads, start, last, longest, window, moved, small, stride, spectral, elements,
            alone,
        )  # fmt: skip
        if count == NONE:
            return None, alone
        return Elements._make(x[:count] for x in elements), alone

    def _sweep(
        self, model: BoxModel, rows: OutputRows, elements: Elements, room: Array | None
    ) -> BoxBounds | None:
        """Return bounds by what interpolated motions miss, or None where they go too far astray."""
        small = 0.0
        give_up: Array = np.full(len(elements.phase), np.inf)
        if room is not None:
            small = SMALL_VIOLATION * float(room.min())
            edges = self.loads[0].edges
            give_up = GIVE_UP * np.interp(elements.begin.min(axis=1), edges[:-1], room)
        varies = np.ptp(elements.length, axis=1) > 0
        groups: list[tuple[BoxModel, Ints]] = []
        # Elements at events come first, since errors are largest there.
        for of_group, mask in ((model, varies), (model.fixed, ~varies)):
            numbers = np.flatnonzero(mask)
            groups += [(of_group, x) for x in _chunks(of_group, numbers)]
        of_path = rows.magnitude[:, -1]
        start = _start_error(model, elements)
        norm = np.full(model.parts**model.inputs, start)
        swept = []
        for of_group, chosen in groups:
            found = interpolate(of_group, elements, chosen, with_rates=rows.uses_rates)
            if found is None:
                return None
            missed = defects(found, small)
            if of_group is model:
                grown = norm + (missed.growth[:, np.newaxis] + missed.violation).cumsum(axis=0)
                if (grown.min(axis=1) > give_up[chosen]).any():
                    return None
                norm = grown[-1]
            values, error = output_series(found, rows, missed.level)
            reached = values.sum(axis=1)
            at_end = np.stack([-reached, reached], axis=-1).max(axis=2)
            low = high = at_end  # no matter if no output uses the path
            if of_path.any():
                matrix = bernstein_matrix(found.terms - 1, SIDE_PARTS)
                middle, radius = of_group.ranges(matrix @ found.elastic_force)
                radius += missed.level[:, np.newaxis]
                shape = (len(error), SIDE_PARTS, found.terms)
                low = (middle - radius).reshape(shape).min(axis=2)
                high = (middle + radius).reshape(shape).max(axis=2)
            upper = polygons(found, values)
            swept.append(_Swept(*missed, found.times, upper, error, at_end, low, high))
        in_time = np.argsort(np.concatenate([chosen for _, chosen in groups]))
        done = _Swept(*(np.concatenate(x)[in_time] for x in zip(*swept, strict=True)))

        # Errors of the motion, on parts of the box and at the ends of elements. The drift without
        # hardening is off by ∫ (‖b‖ S + |bᵀ δ_q|) dt at most, with the norm of b in M⁻¹.
        norms = start + (done.growth[:, np.newaxis] + done.violation).cumsum(axis=0)
        most = norms.max(axis=1)
        drift = (done.times[:, 5] * model.direction_norm * most + done.drift).cumsum()
        path: Array = np.zeros(len(most))
        if of_path.any():
            path = _path_errors(
                model, elements, done, np.minimum(drift, most / model.soft_root), most
            )
        if path[-1] == np.inf:
            return None
        # What errors add: on each part of the box by S, everywhere by the slider's force beyond its
        # yield force and by the path.
        common = done.missed + np.outer(done.beyond.max(axis=1), rows.magnitude[:, -2])
        common += np.outer(path, of_path)
        by_drift = np.outer(drift, rows.of_drift) + np.outer(most, rows.without_drift)
        by_state = np.minimum(np.outer(most, rows.by_norm), by_drift)
        upper = done.upper + (common + by_state)[:, :, np.newaxis, np.newaxis]
        at_nodes = np.full((2, len(self.flow.time), len(rows.factors), 2), -np.inf)
        observe(upper, done.times, self.flow.time, at_nodes[0], at_nodes[1])

        # Peaks at the ends of elements, and those on parts of the box and of time where rough ones
        # matter.
        known = done.at_end.max(axis=0)
        peaks = known.copy()
        rough = upper.max(axis=-1)
        beyond = (rough - known).max(axis=(1, 2))
        order = np.argsort(-beyond)[: np.count_nonzero(beyond > 0)]
        for here in _chunks(model, order):
            here = here[(rough[here] > peaks).any(axis=(1, 2))]
            found = interpolate(model, elements, here, with_rates=rows.uses_rates)
            assert found is not None  # as it was found before
            values, _ = output_series(found, rows, done.level[here])
            for number, row, side in np.argwhere(rough[here] > peaks):
                e = here[number]
                if rough[e, row, side] <= peaks[row, side]:
                    continue
                signed = values[number, :, row] if side else -values[number, :, row]
                fine = part_peaks(found, signed, int(rows.degree[row]))
                of_part = np.minimum(norms[e] * rows.by_norm[row], by_drift[e, row])
                peak = min((fine + of_part).max() + common[e, row], rough[e, row, side])
                peaks[row, side] = max(peaks[row, side], peak)
        widening = ROUNDING * np.abs(known).max(axis=1)[:, np.newaxis]
        for values in (*at_nodes, peaks):
            values += widening
            self._limit_residual(model, values)
        return BoxBounds(at_nodes[0], at_nodes[1], peaks, float(most[-1]))

    def _row(
        self, p: Mapping[str, TaylorModel], found: Properties[TaylorModel], output: str
    ) -> TaylorModel:
        """Return the factors of drifts, velocities, slider's force and path in an output."""
        system = self.flow.system
        n = system.floors
        z = self._yielding[0]
        zero = found.slider * 0.0
        of_drifts = of_velocities = found.mass * 0.0
        of_slider = of_path = zero
        kind, floor = system.quantity(output)
        unit = np.eye(n)[floor]
        if kind == "q":
            of_drifts = of_drifts + (np.arange(n) <= floor)
        elif kind == "drift":
            of_drifts = of_drifts + unit
        elif kind == "ductility":
            of_drifts = (system.yield_drifts(p) ** -1.0) * unit
        elif kind == "v":
            of_velocities = of_velocities + unit
        elif kind == "shear":
            of_drifts = system.hardenings(p) * system.springs(p) * unit
            of_slider = zero + float(floor == z)
        elif kind == MOMENT:
            of_slider = system.heights(p)[z]
            of_drifts = system.hardenings(p) * system.springs(p) * system.heights(p)
        elif kind == "a":  # the forces of columns, weight and damping move the mass
            factor = -found.inverse_mass[floor]
            pulled = drifts(np.eye(n), axis=0)[:, floor]  # by the forces of storeys
            of_drifts = found.stiffness * pulled * factor
            of_velocities = -found.decay[floor]
            of_slider = factor * float(pulled[z])
        elif kind == "residual" and floor == z:
            # the drift without load, (1 − a) k p / (k − s), is limited afterwards
            of_slider = -((found.stiffness[z] + found.slider) ** -1.0)
            of_drifts = unit * (-(found.slider * of_slider))
        elif kind == "dissipated" and floor == z:
            of_path = found.force
        return concatenate([of_drifts, of_velocities, of_slider[None], of_path[None]], -1)

    def _limit_residual(self, model: BoxModel, values: Array) -> None:
        """Limit bounds of residual drifts, in place, to where the unloaded storey yields back.

        It yields back at (1 − a) k y / |a k − s| of either sign. `values` has the shape (…, m, 2).
        """
        z = model.place
        stiffness = model.low.stiffness[z], model.high.stiffness[z]
        if not stiffness[0] > 0:
            return
        least = model.low.force / stiffness[1] * (1 - ROUNDING)
        most = model.high.force / stiffness[0] * (1 + ROUNDING)
        for column, name in enumerate(self.flow.outputs):
            if self.flow.system.quantity(name) == ("residual", z):
                of_output = values[..., column, :]
                of_output[...] = np.clip(of_output, -least, most)


def _chunks(model: BoxModel, numbers: Ints) -> list[Ints]:
    """Divide numbers of elements into groups whose arrays have about `CHUNK` numbers each."""
    size = max(CHUNK // (MAX_TERMS * 3 * model.grid.mass.size), 4)
    return [numbers[first : first + size] for first in range(0, len(numbers), size)]


def _start_error(model: BoxModel, elements: Elements) -> float:
    """Bound S at the start: by how much the interpolated initial velocity differs, in J^½."""
    grid_ = model.grid
    n = len(grid_.mass)
    momentum = elements.series[0, 0, n:]
    velocity = grid_.inverse_mass * model.refined(momentum) - (grid_.decay * grid_.q0).sum(axis=1)
    missed = model.magnitude(velocity - grid_.v0)
    missed += model.missed.inverse_mass * model.largest(momentum)
    missed += model.missed.decay @ model.high.q0
    return float(np.sqrt((missed**2 * model.high.mass).sum()))


def _path_errors(
    model: BoxModel, elements: Elements, done: _Swept, drift: Array, most: Array
) -> Array:
    """Return bounds of the error of the plastic path's length at the ends of elements, (E,), in m.

    The theory is in docs/theory/proofs.md, "A yielding storey", with the sides ± of the slider.

    Args:
        model: The frame over the box.
        elements: The motions.
        done: What is known of them.
        drift: Bounds of the error of the yielding storey's drift, shape (E,), in m.
        most: Bounds of S, shape (E,).
    """
    # The plastic drift is off by the errors of the drift and of the slider, and by how far defects
    # move this.
    plastic = drift + 2 * most / np.sqrt(model.low.slider)
    # May the slider's force lie beyond ∓ F / 2?
    half = model.low.force / 2
    phase = elements.phase[:, np.newaxis]
    may_be_low = np.where(phase == 0, done.low <= -half, phase < 0)
    may_be_high = np.where(phase == 0, done.high >= half, phase > 0)
    if (may_be_low & may_be_high).any():
        return np.full(len(most), np.inf)
    side = may_be_high.astype(int) - may_be_low
    element, _ = np.nonzero(side)
    changes = np.diff(side[side != 0], prepend=0) != 0
    path = done.path.copy()
    np.add.at(path, element, 2 * plastic[element] * changes)
    # Up to here no motion has yielded if none can have come to the yield force.
    force = np.maximum(-done.low, done.high).max(axis=1) + most * np.sqrt(model.high.slider)
    has_yielded = np.logical_or.accumulate((elements.phase != 0) | (force >= model.low.force))
    return np.where(has_yielded, path.cumsum() + plastic + 2 * most**2 / model.low.force, 0.0)


def _edges(loads: Sequence[History], end: float, *, longest: float) -> tuple[Array, int]:
    """Return the times between which all loads are linear, and the number of the end among them.

    Args:
        loads: Histories that are linear between samples; there may be none.
        end: End of the motion, in s.
        longest: Longer intervals are divided into equal ones.

    Returns:
        Times in s, with `EXTRA_INTERVALS` more intervals behind the end.
    """
    times = [np.array([0.0, end])]
    for load in loads:
        times.append(load.start + np.arange(len(load.samples)) * load.step)
    samples = np.unique(np.concatenate(times))
    samples = samples[(samples >= 0) & (samples <= end)]
    # Samples that differ by rounding are one; the end stays as it is.
    apart = SAME * min([load.step for load in loads], default=end)
    is_new = np.append(np.diff(samples) > apart, True)
    samples = samples[is_new]
    samples[0] = 0.0
    counts = np.ceil(np.diff(samples) / longest)
    before = np.append(0, np.cumsum(counts))
    edges = np.interp(np.arange(before[-1] + 1), before, samples)
    beyond = np.diff(edges).max() * np.arange(1, EXTRA_INTERVALS + 1)
    return np.append(edges, edges[-1] + beyond), len(edges) - 1


def _ratio_damping(full: Assembly[TaylorModel]) -> TaylorModel:
    """Return the damping matrix of ratios, 2 M Φ diag(ζ_k ω_k) Φᵀ M, over the box.

    Raises:
        UnprovedError: Modes have ratios of their own while masses or stiffnesses are uncertain; or
            the box is too wide.
    """
    mass = full.mass
    stiffness = full.stiffness
    n = len(mass.value)
    is_crisp = not any(part.any() for x in (mass, stiffness) for part in x.parts[1:])
    if n > 1 and len(full.ratios) > 1 and not is_crisp:
        what = "modes with ratios of their own are damped in a frame with uncertain stiffness"
        raise UnprovedError(what, "take one ratio for all modes")
    if len(full.ratios) == 1 or n == 1:
        ratio = full.ratios[0]
        if n == 1:
            return (ratio * 2.0) * (stiffness * mass) ** 0.5
        eigenvalues, basis = eigh(stiffness.value, mass.value)
        inverse = np.linalg.inv(basis)
        mean = geometric_mean(
            basis.T @ mass @ basis, basis.T @ stiffness @ basis, np.sqrt(eigenvalues)
        )
        whole: TaylorModel = (ratio * 2.0) * (inverse.T @ mean @ inverse)
        return whole
    eigenvalues, shapes = undamped_modes(mass.value, stiffness.value)
    total = mass * 0.0
    for ratio, eigenvalue, shape in zip(full.ratios, eigenvalues, shapes.T, strict=True):
        momentum = mass.value @ shape
        total = total + ratio * (2.0 * np.sqrt(eigenvalue) * np.outer(momentum, momentum))
    return total


def _on_grid(model: TaylorModel, points: Array) -> Array:
    """Return the values of polynomials at points, shape (*V, points)."""
    return np.ascontiguousarray(np.moveaxis(model.at(points), 0, -1))


def _degree(model: TaylorModel) -> int:
    """Return the largest degree of a polynomial in any of the inputs."""
    used = np.abs(model.coefficients.reshape(len(model.exponents), -1)).max(axis=1) > 0
    return int(model.exponents[used].max(initial=0))


def _relative_remainder(model: TaylorModel) -> float:
    """Return the largest remainder as a fraction of the largest magnitude."""
    return float(model.remainder.max() / max(model.magnitude().max(), 1e-300))
