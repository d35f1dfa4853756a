"""Guaranteed bounds of the outputs of a frame with one yielding storey over a box of inputs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import eigh

from alphacut.base.arrays import Array, Ints
from alphacut.frame.bounds.interpolated_defects import (
    BoxModel,
    Defects,
    Interpolant,
    defects,
    drifts,
    interpolate,
    ranges,
)
from alphacut.frame.bounds.interpolated_motions import (
    DONE,
    LOAD_TERMS,
    MAX_TERMS,
    Elements,
    Frames,
    LoadIntegrals,
    march,
)
from alphacut.frame.bounds.interpolated_outputs import (
    OutputRows,
    Row,
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
from alphacut.frame.modes.geometric_mean import geometric_mean
from alphacut.frame.records.history import History
from alphacut.frame.structures.linear import Assembly, histories, undamped_modes
from alphacut.frame.structures.storey import MOMENT

# Degree of the interpolation of motions in each input, by the number of inputs (tuned; up to 4 the
# Lebesgue constant of the grid is below 2).
DEGREES = {0: 0, 1: 4, 2: 3, 3: 2}
# Highest order of the Taylor models of properties, and the sum of their remainders, as fractions,
# at which a lower one suffices (tuned: over 30 s the response misses some hundred times that).
MAX_ORDER = 4
SMALL_REMAINDER = 1e-7
# Fraction of each output's peak that is added for the rounding of all operations (not proved: they
# are some thousand for each number, each with an error of 1e-16).
ROUNDING = 1e-9
# Intervals that are added behind the end of the loads, since an event near the end of the motion
# may come later at some inputs. What acts there does not matter.
EXTRA_INTERVALS = 60
# Elements of one march at most, for each interval of the loads and each substep between samples.
MAX_ELEMENTS = 8
# Norm S, as a multiple of the largest room for events that are left out, at which a box is given up
# as too wide, and the part of this room that an element may take without a closer look (tuned).
GIVE_UP = 10.0
SMALL_VIOLATION = 1e-4
# Length of an element that begins and ends at fixed times, as a fraction of the largest one (tuned:
# the polynomial of the load misses little of intervals that are much shorter).
STRIDE = 0.25
# Numbers of one array up to which elements are treated together (tuned to the processor's caches).
CHUNK = 400_000
# How far the slider may be moved by events that are left out if nothing else is known, and by one
# that all motions have, as multiples of the yield drift (tuned).
MAX_MOVED = 3.0
# Parts of an element's time on which the side of the slider's force is sought (tuned).
SIDE_PARTS = 8
SMALL_EVENT = 1e-8
# Largest difference of the times of an event at the parameter sets of a box, as a fraction of the
# elastic period (tuned: far below the time between two events with one side).
WINDOW = 0.25


@dataclass(frozen=True, eq=False)
class PeakHistory:
    """Peaks of interpolated motions over time, and what errors add to them.

    Args:
        begin: Begin of each element, shape (e,), in s.
        peaks: Largest magnitude of each output on it, shape (e, m).
        by_norm: Error of each output for S = 1, shape (m,).
    """

    begin: Array
    peaks: Array
    by_norm: Array


@dataclass(frozen=True, eq=False)
class BoxBounds:
    """Guaranteed bounds over a box; infinite where it is too wide.

    Args:
        upper: Largest values of (−output, output) at T time nodes, shape (T, m, 2).
        steps: The same over the step before each node, shape (T, m, 2).
        peaks: The same over all times, shape (m, 2).
        error: Bound of the energy norm S of the error at the end, in J^½.
        history: What is known of the motions for a plan of narrower boxes; None if the box is too
            wide.
    """

    upper: Array
    steps: Array
    peaks: Array
    error: float
    history: PeakHistory | None = None


@dataclass(frozen=True, eq=False)
class _Properties:
    """Properties of the frame over a box, as Taylor models.

    Args:
        mass: Shape (N,), in kg.
        columns: k of each storey, shape (N,), in N/m.
        softening: Weight over height, shape (N,), in N/m.
        hardening: Shape (N,).
        yield_drift: Shape (N,), in m.
        yield_force: Of the yielding storey, in N.
        force: Its slider's part of this, in N.
        damping: C, shape (N, N), in N s/m.
        heights: Shape (N,), in m; None if they are not given.
        q0: Initial displacements, shape (N,), in m.
        v0: Initial velocities, shape (N,), in m/s.
        follow: w, shape (L, N).
    """

    mass: TaylorModel
    columns: TaylorModel
    softening: TaylorModel
    hardening: TaylorModel
    yield_drift: TaylorModel
    yield_force: TaylorModel
    force: TaylorModel
    damping: TaylorModel
    heights: TaylorModel | None
    q0: TaylorModel
    v0: TaylorModel
    follow: Array


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
        nominal = system.parameters
        yielding = [
            z
            for z in range(system.floors)
            if nominal[f"hardening{z + 1}"] < 1 or f"hardening{z + 1}" in self.flow.names
        ]
        if len(yielding) != 1:
            what = f"columns of one storey can be proved, and {len(yielding)} storeys may yield"
            cure = "take hardening 1 for storeys that stay elastic"
            raise UnprovedError(what, cure)
        has_tangent = system.rayleigh_of == "tangent"
        if has_tangent and (nominal["rayleigh_stiffness"] or "rayleigh_stiffness" in names):
            what = "damping by the tangent stiffness jumps at events"
            raise UnprovedError(what, 'take rayleigh_of = "initial"')
        self._require_loads(names)

    def _require_loads(self, names: set[str]) -> None:
        """Raise an error unless the accelerations by loads are the same at all inputs.

        Raises:
            UnprovedError: A force is static or an impulse; or a force acts, and it, or a mass, is
                uncertain, or an acceleration is observed.
        """
        system = self.flow.system
        if not system.loads:
            return
        if any(load.history is None or load.history.is_static for load in system.loads):
            raise UnprovedError("a static force or an impulse moves the frame at the start")
        masses = {f"m{z + 1}" for z in range(system.floors)}
        if names & (masses | set(system.force_names)):
            what = "beside a force its amplitude and the masses are not enclosed"
            raise UnprovedError(what, "take them as crisp numbers")
        if any(system.quantity(name)[0] == "a" for name in self.flow.outputs):
            raise UnprovedError("a force moves accelerations at once", "observe other outputs")

    @property
    def place(self) -> int:
        """Number of the yielding storey, from 0."""
        nominal = self.flow.system.parameters
        for z in range(self.flow.system.floors):
            name = f"hardening{z + 1}"
            if nominal[name] < 1 or name in self.flow.names:
                return z
        raise AssertionError("a frame without a yielding storey has been refused")

    @cached_property
    def loads(self) -> tuple[LoadIntegrals, int]:
        """Integrals of the loads twice over time, and the number of the edge at the end."""
        system = self.flow.system
        keys = list(histories(system).values())
        nominal = {x: TaylorModel.constant(np.float64(y), 0) for x, y in system.parameters.items()}
        stiffness = float(system.springs(nominal).value[self.place])
        frequency = np.sqrt(stiffness / sum(system.masses))
        edges, last = _edges(keys, float(self.flow.time[-1]), longest=0.3 / frequency)
        n_loads = max(len(keys), 1)
        width = np.diff(edges)
        first = np.zeros((len(width), n_loads))
        end = np.zeros_like(first)
        for column, load in enumerate(keys):
            first[:last, column] = load.envelope(edges[:last])
            end[:last, column] = load.envelope(edges[1 : last + 1], -1.0)
        slope = (end - first) / width[:, np.newaxis]
        powers = np.zeros((len(width), n_loads, 4))
        powers[:, :, 2] = first / 2
        powers[:, :, 3] = slope / 6
        # g and g' at the edges are sums of what each interval adds.
        h = width[:, np.newaxis]
        speed = np.cumsum(h * (first + end) / 2, axis=0)
        powers[1:, :, 1] = speed[:-1]
        added = h * powers[:, :, 1] + h**2 * (first / 3 + end / 6)
        powers[1:, :, 0] = np.cumsum(added, axis=0)[:-1]
        return LoadIntegrals(edges, powers), last

    def bounds(self, low: Array, high: Array, room: Array | None = None) -> BoxBounds:
        """Return guaranteed bounds of the outputs over a box of the inputs.

        Args:
            low: Lower ends of all inputs of the flow, in SI units, shape (d,).
            high: Upper ends; those of inputs that are not active must be equal.
            room: How large S may become by events that are left out, in J^½, from each interval of
                the loads on, shape (E,); none by default. It guides the proof, and proves nothing.

        Raises:
            UnprovedError: A quantity that must be positive is not known to be so over the box.
        """
        properties, model = self._model(low, high)
        rows = self._rows(properties, model)
        found = self._motions(properties, model, room)
        if found is None:
            return self.infinite
        elements, count = found
        start = self._start_error(properties, model, elements)
        most = np.inf if room is None else GIVE_UP * float(room.max())
        small = 0.0 if room is None else SMALL_VIOLATION * float(room.min())
        bounds = _Sweep(self, model, rows, elements, count, most, small).run(start)
        if bounds is None:
            return self.infinite
        for values in (bounds.upper, bounds.steps, bounds.peaks):
            self._limit_residual(properties, values)
        return bounds

    @property
    def infinite(self) -> BoxBounds:
        """Bounds that say nothing."""
        shape = (len(self.flow.time), len(self.flow.outputs), 2)
        nothing = np.full(shape, np.inf)
        return BoxBounds(nothing, nothing.copy(), np.full(shape[1:], np.inf), np.inf)

    def require_provable(self, point: Array) -> None:
        """Raise an error unless the frame at parameters in SI units, shape (d,), can be proved.

        Raises:
            UnprovedError: See `_box_model`.
        """
        self._box_model(self._properties(self._parameters(point, point, order=1)))

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

    def _model(self, low: Array, high: Array) -> tuple[_Properties, BoxModel]:
        """Return the properties over a box to the lowest order with small remainders."""
        for order in range(1, MAX_ORDER + 1):
            properties = self._properties(self._parameters(low, high, order))
            total = 0.0
            for model in (properties.mass, properties.columns, properties.hardening):
                total += _relative_remainder(model)
            for model in (properties.force, properties.softening, properties.damping):
                total += _relative_remainder(model)
            if total < SMALL_REMAINDER:
                break
        return properties, self._box_model(properties)

    def _properties(self, p: dict[str, TaylorModel]) -> _Properties:
        """Return the properties of the frame from its parameters."""
        system = self.flow.system
        full: Assembly[TaylorModel] = system.assembly(p)
        k = system.springs(p)
        hardening = system.hardenings(p)
        z = self.place
        y = system.yield_drifts(p)
        yield_force = p[f"fy{z + 1}"] if system.yield_force else k[z] * y[z]
        floors = np.arange(system.floors)
        mass = full.mass[floors, floors]
        damping = full.dashpots
        for factor, matrix in zip(full.rayleigh, (full.mass, full.springs), strict=True):
            if factor.magnitude() > 0:
                damping = damping + factor * matrix
        if any(x.magnitude() > 0 for x in full.ratios):
            damping = damping + _ratio_damping(full)
        loads = [np.full(system.floors, -1.0)] if system.ground is not None else []
        if full.forces is not None:
            loads += list((full.forces.value / mass.value[:, np.newaxis]).T)
        if not loads:
            loads = [np.zeros(system.floors)]
        return _Properties(
            mass=mass,
            columns=k,
            softening=system.softening(p) if system.gravity else k * 0.0,
            hardening=hardening,
            yield_drift=y,
            yield_force=yield_force,
            force=(1.0 - hardening[z]) * yield_force,
            damping=damping,
            heights=system.heights(p) if len(system.lengths) else None,
            q0=full.q0,
            v0=full.v0,
            follow=np.array(loads),
        )

    def _box_model(self, found: _Properties) -> BoxModel:
        """Return polynomials on a grid, with bounds.

        Raises:
            UnprovedError: Hardening, masses or yield drift are not known to be such that the energy
                norm bounds errors; or the storey may be displaced beyond its yield drift at first.
        """
        z = self.place
        slider = (1.0 - found.hardening[z]) * found.columns[z]
        stiffness = found.hardening * found.columns - found.softening
        d = len(self.active)
        degree = DEGREES[d]
        models = [found.mass, found.columns, stiffness, slider, found.force, found.damping]
        order = max(_degree(x) for x in models)
        rows = self._row_models(found)
        of_rows = max(_degree(x) for row in rows for x in row)
        fine = max(2 * degree + order, degree + of_rows) if d else 0
        of_slider = degree + max(_degree(slider), _degree(found.force)) if d else 0
        points = grid(d, fine)

        stiffness_low, stiffness_high = stiffness.bounds()
        # The product of the lower ends of its factors, which are not negative, is a lower end, too;
        # it is closer where the hardening may be 0.
        by_factors = _ends(found.hardening)[0] * _ends(found.columns)[0]
        by_factors = by_factors - _ends(found.softening)[1]
        stiffness_low = np.maximum(stiffness_low, by_factors)
        # Without hardening rounding alone may make this negative.
        allowed = -1e-12 * found.columns.magnitude()
        if (stiffness_low < allowed).any():
            storey = int((stiffness_low < allowed).argmax()) + 1
            stiffness_words = f"the stiffness of storey {storey} after yielding"
            what = f"{stiffness_words}, less weight over height, may be negative"
            raise UnprovedError(what, "take more hardening, or less weight")
        slider_ends = _ends(slider)
        force_ends = _ends(found.force)
        least_part = 1 - found.hardening[z].bounds()[1]
        if least_part > 0:
            slider_ends[0] = max(slider_ends[0], least_part * found.columns[z].bounds()[0])
            force_ends[0] = max(force_ends[0], least_part * found.yield_force.bounds()[0])
        mass_ends = _ends(found.mass)
        if not min(slider_ends[0], force_ends[0], mass_ends[0].min()) > 0:
            what = "positive masses, hardening below 1 and a positive yield drift are needed"
            raise UnprovedError(what, "narrow them")
        start = found.q0[z] - found.q0[z - 1] if z else found.q0[z]
        if not float(start.magnitude()) * slider_ends[1] < force_ends[0]:
            what = "the storey may be displaced beyond its yield drift at the start"
            raise UnprovedError(what, "take a smaller q1_0, or none")
        return BoxModel(
            inputs=d,
            degree=degree,
            fine=fine,
            of_slider=of_slider,
            place=z,
            follow=found.follow,
            mass=_on_grid(found.mass, points),
            stiffness=_on_grid(stiffness, points),
            damping=_on_grid(found.damping, points),
            slider=_on_grid(slider, points),
            force=_on_grid(found.force, points),
            mass_remainder=found.mass.remainder,
            stiffness_remainder=stiffness.remainder,
            damping_remainder=found.damping.remainder,
            slider_remainder=float(slider.remainder),
            force_remainder=float(found.force.remainder),
            mass_ends=mass_ends,
            stiffness_ends=np.stack([np.maximum(stiffness_low, 0.0), stiffness_high]),
            slider_ends=slider_ends,
            force_ends=force_ends,
            max_damping=found.damping.magnitude(),
        )

    def _motions(
        self, found: _Properties, model: BoxModel, room: Array | None
    ) -> tuple[Elements, int] | None:
        """Return motions at parameter sets of the box, or None without a common order of events."""
        frames, start = self._frames(found, model)
        loads, last = self.loads
        n_sets, n = frames.inverse_mass.shape
        # The Taylor series over an element converges fast where |λ| h ≤ 1 for all eigenvalues λ.
        zero = np.zeros_like(frames.damping)
        over_mass = frames.inverse_mass[:, :, np.newaxis]
        upper = np.concatenate([-over_mass * frames.damping, over_mass * np.eye(n)], axis=2)
        lower = np.concatenate([-frames.elastic, zero], axis=2)
        state = np.concatenate([upper, lower], axis=1)
        fastest = float(np.abs(np.linalg.eigvals(state)).max())
        slowest = float(np.sqrt((frames.slider * frames.inverse_mass[:, model.place]).min()))
        longest = 1.0 / fastest
        width = np.diff(loads.edges[: last + 1]).mean() if last else 1.0
        most = int(MAX_ELEMENTS * (last + 10) * (1 + width / longest))
        elements = Elements(
            begin=np.empty((most, n_sets)),
            length=np.empty((most, n_sets)),
            phase=np.empty(most, np.int64),
            constant=np.empty((most, n_sets)),
            path=np.empty((most, n_sets)),
            series=np.empty((most, MAX_TERMS, 2 * n, n_sets)),
            load=np.empty((most, LOAD_TERMS, len(found.follow), n_sets)),
            fit=np.empty((most, len(found.follow), LOAD_TERMS)),
            span=np.empty((most, 2)),
            fit_error=np.empty((most, len(found.follow), 2)),
            event=np.empty(most, np.int64),
            terms=np.empty(most, np.int64),
        )
        least_drift = float((frames.force / frames.slider).min())
        # Without a plan an event that only some motions have is left out at any cost.
        moved: Array = np.full(len(loads.powers), MAX_MOVED * least_drift)
        small = SMALL_EVENT * least_drift
        if room is not None:
            moved = np.asarray(room / float(np.sqrt(model.slider_ends[1])), np.float64)
            small = max(0.1 * float(moved[0]), small)
        window = WINDOW * 2 * np.pi / slowest
        spectral = np.ascontiguousarray(
            coefficients(np.eye(n_sets), len(self.active), model.degree).T
        )
        stride = max(int(STRIDE * longest / width), 1)
        status, count = march(
            frames, loads, start, last, longest, window, moved, small, stride, spectral, elements
        )
        if status != DONE:
            return None
        return elements, count

    def _frames(self, found: _Properties, model: BoxModel) -> tuple[Frames, Array]:
        """Return the frames at the parameter sets of the motions, and their initial states X, P."""
        points = grid(model.inputs, model.degree)
        z = model.place
        n = model.floors
        stiffness = _on_grid(found.hardening * found.columns - found.softening, points)
        slider = _on_grid((1.0 - found.hardening[z]) * found.columns[z], points)
        incidence = drifts(np.eye(n), axis=0)  # drifts of displacements
        yielded = np.einsum("zi,zj,zp->pij", incidence, incidence, stiffness)
        column = np.outer(incidence[z], incidence[z])
        mass = _on_grid(found.mass, points).T
        damping = np.moveaxis(_on_grid(found.damping, points), -1, 0)
        q0 = _on_grid(found.q0, points).T
        v0 = _on_grid(found.v0, points).T
        momentum = mass * v0 + (damping @ q0[:, :, np.newaxis])[:, :, 0]
        frames = Frames(
            inverse_mass=np.ascontiguousarray(1 / mass),
            damping=np.ascontiguousarray(damping),
            elastic=yielded + slider[:, np.newaxis, np.newaxis] * column,
            yielded=np.ascontiguousarray(yielded),
            slider=np.ascontiguousarray(slider),
            force=np.ascontiguousarray(_on_grid(found.force, points)),
            place=z,
            follow=np.ascontiguousarray(found.follow),
        )
        return frames, np.concatenate([q0, momentum], axis=1)

    def _start_error(self, found: _Properties, model: BoxModel, elements: Elements) -> float:
        """Bound S at the start: by how much the interpolated initial state differs, in J^½.

        Initial displacements are linear in the inputs, so that only their rounding differs.
        """
        points = grid(model.inputs, model.fine)
        q0 = _on_grid(found.q0, points)
        n = model.floors
        exact = model.mass * _on_grid(found.v0, points)
        exact += (model.damping * q0).sum(axis=1)
        momentum = model.refined(elements.series[0, 0, n:])
        missed = model.magnitude(momentum - exact)
        missed += model.mass_remainder * found.v0.magnitude()
        missed += model.damping_remainder @ found.q0.magnitude()
        missed += model.mass_ends[1] * found.v0.remainder
        missed += model.max_damping @ found.q0.remainder
        squared = (missed**2 / model.mass_ends[0]).sum()
        remainder = found.q0.remainder.copy()
        remainder[1:] += found.q0.remainder[:-1]
        stiffest = model.stiffness_ends[1].copy()
        stiffest[model.place] += model.slider_ends[1]
        return float(np.sqrt(squared + (stiffest * remainder**2).sum()))

    def _row_models(self, found: _Properties) -> list[Row]:
        """Return the factors of each output."""
        n = self.flow.system.floors
        z = self.place
        k = found.columns
        zero = k[0] * 0.0
        one = zero + 1.0
        zeros = k * 0.0
        slider = (1.0 - found.hardening[z]) * k[z]
        stiffness = found.hardening * k - found.softening
        incidence = drifts(np.eye(n), axis=0)
        all_rows = []
        for kind, floor in map(self.flow.system.quantity, self.flow.outputs):
            of_drifts = zeros
            of_velocities = zeros
            of_slider = zero
            of_path = zero
            unit = np.eye(n)[floor]
            if kind == "q":
                of_drifts = zeros + (np.arange(n) <= floor)
            elif kind == "drift":
                of_drifts = zeros + unit
            elif kind == "ductility":
                of_drifts = (found.yield_drift**-1.0) * unit
            elif kind == "v":
                of_velocities = zeros + unit
            elif kind == "shear":
                of_drifts = found.hardening * k * unit
                if floor == z:
                    of_slider = one
            elif kind == MOMENT:
                assert found.heights is not None  # as the output would be refused
                of_drifts = found.hardening * k * found.heights
                of_slider = found.heights[z]
            elif kind == "a":  # the forces of columns, weight and damping move the mass
                factor = -(found.mass[floor] ** -1.0)
                of_drifts = stiffness * incidence[:, floor] * factor
                of_velocities = found.damping[floor] * factor
                of_slider = factor * float(incidence[z, floor])
            elif kind == "residual" and floor == z:
                # the drift without load, (1 − a) k p / (k − s), is limited afterwards
                factor = (k[z] - found.softening[z]) ** -1.0
                of_drifts = zeros + unit
                of_drifts = of_drifts * (slider * factor)
                of_slider = -factor
            elif kind == "dissipated" and floor == z:
                of_path = found.force
            over_mass = of_velocities * found.mass**-1.0
            if of_velocities.magnitude().any():
                of_q = -(over_mass[np.newaxis] @ found.damping)[0]
                rates = (of_velocities[np.newaxis] @ found.follow.T)[0]
            else:
                of_q = zeros
                rates = of_velocities.like(np.zeros(len(found.follow)))
            all_rows.append(
                Row(
                    drifts=of_drifts,
                    momenta=over_mass,
                    displacements=of_q,
                    rates=rates,
                    slider=of_slider[None],
                    path=of_path[None],
                    velocities=of_velocities,
                )
            )
        return all_rows

    def _rows(self, found: _Properties, model: BoxModel) -> OutputRows:
        """Return the outputs over the box."""
        points = grid(model.inputs, model.fine)
        factors = []
        remainders = []
        magnitudes = []
        weights = []
        degrees = []
        z = model.place
        n = model.floors
        for factors_of in self._row_models(found):
            row = concatenate(factors_of[:-1], -1)
            factors.append(_on_grid(row, points))
            remainders.append(row.remainder)
            magnitudes.append(row.magnitude())
            degrees.append(model.degree + _degree(row) if model.inputs else 0)
            # (hᵀ K_p⁻¹ h + jᵀ M⁻¹ j + g² / K_z)^½ of an output hᵀ q + jᵀ v + g z
            drift_factor = factors_of.drifts.magnitude()
            soft = np.maximum(model.stiffness_ends[0], 1e-150)
            by_drift = np.where(drift_factor > 0, drift_factor**2 / soft, 0.0)
            others = (factors_of.velocities.magnitude() ** 2 / model.mass_ends[0]).sum()
            others += float(factors_of.slider.magnitude()[0]) ** 2 * model.slider_ends[1]
            without = others + np.delete(by_drift, z).sum()
            weights.append(
                (
                    np.sqrt(others + by_drift.sum()),
                    np.sqrt(without),
                    drift_factor[z],
                    factors_of.slider.magnitude()[0],
                    factors_of.path.magnitude()[0],
                )
            )
        by_norm, without_drift, of_drift, slider, path = np.array(weights).T
        return OutputRows(
            factors=np.array(factors),
            remainder=np.array(remainders),
            magnitude=np.array(magnitudes),
            by_norm=by_norm,
            without_drift=without_drift,
            of_drift=of_drift,
            of_slider=slider,
            of_path=path,
            degree=np.array(degrees),
            uses_rates=bool(np.array(magnitudes)[:, 3 * n : 3 * n + len(found.follow)].any()),
        )

    def _limit_residual(self, found: _Properties, values: Array) -> None:
        """Limit bounds of residual drifts, in place, to where the unloaded storey yields back.

        It yields back at (1 − a) k y / |a k − s| of either sign. `values` has the shape (…, m, 2).
        """
        z = self.place
        stiffness = (found.hardening * found.columns - found.softening)[z]
        if not float(stiffness.bounds()[0]) > 0:
            return
        least, most = (found.force * stiffness**-1.0).bounds()
        for column, name in enumerate(self.flow.outputs):
            if self.flow.system.quantity(name) == ("residual", z):
                of_output = values[..., column, :]
                of_output[...] = np.clip(of_output, -least, most)


class _Sweep:
    """Bounds of errors and outputs along the elements of interpolated motions.

    Attributes:
        give_up: Value of S at which the box is given up, in J^½.
        small: Growth of S on an element that is not bounded more closely, in J^½.
        norm: Bounds of S at the end of the elements that are done, on parts of the box, (parts,).
        drift: Bound of ∫ (‖b‖ S + |bᵀ δ_q|) dt, in m.
        path: By how much that of the plastic path is off by defects and changes of side, in m.
        has_yielded: Whether the storey may have yielded.
        side: Side of zero on which the slider's force was known to be last; 0 at the start.
        path_error: Bound of the error of the plastic path's length, in m.
    """

    def __init__(
        self,
        frame: InterpolatedFrame,
        model: BoxModel,
        rows: OutputRows,
        elements: Elements,
        count: int,
        give_up: float,
        small: float,
    ) -> None:
        self.frame = frame
        self.model = model
        self.rows = rows
        self.elements = elements
        self.count = count
        self.give_up = give_up
        self.small = small
        self.drift = 0.0
        self.path = 0.0
        self.side = 0
        self.has_yielded = False
        self.path_error = 0.0
        m = len(rows.by_norm)
        nodes = len(frame.flow.time)
        self.upper = np.full((nodes, m, 2), -np.inf)
        self.steps = np.full((nodes, m, 2), -np.inf)
        self.peaks = np.full((m, 2), -np.inf)
        self.known = np.full((m, 2), -np.inf)
        self.largest = np.zeros((count, m))

    def run(self, start: float) -> BoxBounds | None:
        """Return the bounds, or None where times go astray.

        Args:
            start: Bound of S at the start, in J^½.
        """
        model = self.model
        rows = self.rows
        self.norm = np.full(model.parts**model.inputs, start)
        size = MAX_TERMS * 3 * model.floors * model.mass.shape[1]
        chunk = max(CHUNK // size, 4)
        for first in range(0, self.count, chunk):
            if not self._add(slice(first, min(first + chunk, self.count))):
                return None
        self.peaks = np.maximum(self.peaks, self.known)
        widening = ROUNDING * np.abs(self.known).max(axis=1, initial=0.0)[:, np.newaxis]
        for values in (self.upper, self.steps, self.peaks):
            values += widening
        # The error of a drift without hardening is bounded by the integral of S alone, and that of
        # the plastic path by changes of side.
        end = self.frame.flow.time[-1]
        by_drift = rows.of_drift * model.direction_norm * end + rows.without_drift
        by_path = rows.of_path * self.path_error / max(float(self.norm.max()), 1e-300)
        history = PeakHistory(
            begin=self.elements.begin[: self.count].mean(axis=1),
            peaks=self.largest,
            by_norm=np.minimum(rows.by_norm, by_drift) + by_path,
        )
        return BoxBounds(self.upper, self.steps, self.peaks, float(self.norm.max()), history)

    def _add(self, chosen: slice) -> bool:
        """Add some elements to all bounds; False where the box is too wide for bounds."""
        model = self.model
        rows = self.rows
        found = interpolate(model, self.elements, chosen, with_rates=rows.uses_rates)
        if found is None:
            return False
        missed = defects(found, self.elements.event[chosen], self.small)
        growth = missed.growth[:, np.newaxis] + missed.violation
        norms = self.norm + growth.cumsum(axis=0)
        self.norm = norms[-1]
        most = norms.max(axis=1)
        if self.norm.min() > self.give_up:
            return False
        by_norm = self._drift_errors(found, missed.drift, most)
        off = np.minimum(by_norm, most / np.sqrt(max(model.stiffness_ends[0, model.place], 1e-300)))
        path = self._path_errors(found, missed, off, most)
        self.path_error = float(path[-1])
        if self.path_error == np.inf:
            return False
        values, series_error = output_series(found, rows, missed.level)
        # What the error of the motion adds: on each part by S, everywhere by the slider's force
        # beyond its yield force and by the path.
        common = series_error + missed.beyond.max(axis=1)[:, np.newaxis] * rows.of_slider
        common += np.outer(path, rows.of_path)
        by_drift = by_norm[:, np.newaxis] * rows.of_drift + most[:, np.newaxis] * rows.without_drift
        by_state = np.minimum(most[:, np.newaxis] * rows.by_norm, by_drift)
        upper = polygons(found, values)
        upper += (common + by_state)[:, :, np.newaxis, np.newaxis]
        observe(upper, found.times, self.frame.flow.time, self.upper, self.steps)

        # Rough peaks, and those on parts of the box and of time where the rough ones matter.
        reached = values.sum(axis=1)  # at the ends of elements
        at_end = np.stack([-reached, reached], axis=-1).max(axis=2)
        self.known = np.maximum(self.known, at_end.max(axis=0))
        self.largest[chosen] = np.abs(reached).max(axis=-1)
        rough = upper.max(axis=-1)
        matters = rough > np.maximum(self.known, self.peaks)
        candidates = np.argwhere(matters)
        for e, row, side in candidates[np.argsort(-rough[matters])]:
            if rough[e, row, side] <= max(self.known[row, side], self.peaks[row, side]):
                continue
            signed = values[e, :, row] if side else -values[e, :, row]
            fine = part_peaks(found, signed, int(rows.degree[row]))
            of_part = np.minimum(norms[e] * rows.by_norm[row], by_drift[e, row])
            peak = min((fine + of_part).max() + common[e, row], rough[e, row, side])
            self.peaks[row, side] = max(self.peaks[row, side], peak)
        return True

    def _drift_errors(self, found: Interpolant, defect: Array, most: Array) -> Array:
        """Return bounds of the error of the yielding storey's drift at the ends of elements, (e,).

        It is at most ∫ (‖b‖ S + |bᵀ δ_q|) dt, with the norm of b in M⁻¹.

        Args:
            found: The motions.
            defect: Bounds of ∫ |bᵀ δ_q| dt over each element, shape (e,).
            most: Bounds of S, shape (e,).
        """
        added = found.max_length * self.model.direction_norm * most + defect
        errors = self.drift + added.cumsum()
        self.drift = float(errors[-1])
        return errors

    def _path_errors(self, found: Interpolant, missed: Defects, drift: Array, most: Array) -> Array:
        """Return bounds of the error of the plastic path's length at the ends of elements, (e,).

        The theory is in docs/theory/proofs.md, "A yielding storey", with the sides ± of the slider.

        Args:
            found: The motions.
            missed: Their defects.
            drift: Bounds of the error of the yielding storey's drift, shape (e,), in m.
            most: Bounds of S, shape (e,).
        """
        if not self.rows.uses_path:
            return np.zeros(len(most))
        model = self.model
        # The plastic drift is off by the errors of the drift and of the slider, and by how far
        # defects move this.
        plastic = drift + 2 * most / np.sqrt(model.slider_ends[0])
        # Bounds of the slider's force on parts of an element's time: may it lie beyond ∓ F / 2?
        matrix = bernstein_matrix(found.terms - 1, SIDE_PARTS)
        control = np.einsum("ik,ekf->eif", matrix, found.slider_force)
        middle, radius = ranges(model, control)
        shape = (len(most), SIDE_PARTS, found.terms)
        low = (middle - radius).reshape(shape).min(axis=2) - missed.level[:, np.newaxis]
        high = (middle + radius).reshape(shape).max(axis=2) + missed.level[:, np.newaxis]
        half = model.force_ends[0] / 2
        is_elastic = (found.phase == 0)[:, np.newaxis]
        phase = found.phase[:, np.newaxis]
        may_be_low = np.where(is_elastic, low <= -half, phase < 0)
        may_be_high = np.where(is_elastic, high >= half, phase > 0)
        if (may_be_low & may_be_high).any():
            return np.full(len(most), np.inf)
        side = may_be_high.astype(int) - may_be_low
        element, _ = np.nonzero(side)
        sides = np.append(self.side, side[side != 0])
        changes = np.diff(sides) != 0
        switched = np.zeros(len(most))
        np.add.at(switched, element, 2 * plastic[element] * changes)
        self.side = int(sides[-1])
        path = self.path + np.cumsum(switched + missed.path)
        self.path = float(path[-1])
        # Up to here no motion has yielded if none can have come to the yield force.
        force_bound = np.maximum(-low, high).max(axis=1) + most * np.sqrt(model.slider_ends[1])
        yields = (found.phase != 0) | (force_bound >= model.force_ends[0])
        has_yielded = np.logical_or.accumulate(np.append(self.has_yielded, yields))[1:]
        self.has_yielded = bool(has_yielded[-1])
        return np.where(has_yielded, path + plastic + 2 * most**2 / model.force_ends[0], 0.0)


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


def _ends(model: TaylorModel) -> Array:
    """Return lower and upper bounds over the box, shape (2, *V)."""
    low, high = model.bounds()
    return np.array([low, high])


def _degree(model: TaylorModel) -> int:
    """Return the largest degree of a polynomial in any of the inputs."""
    used = np.abs(model.coefficients.reshape(len(model.exponents), -1)).max(axis=1) > 0
    return int(model.exponents[used].max(initial=0))


def _relative_remainder(model: TaylorModel) -> float:
    """Return the largest remainder as a fraction of the largest magnitude."""
    return float(model.remainder.max() / max(model.magnitude().max(), 1e-300))
