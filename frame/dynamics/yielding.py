"""Response of storey frames whose columns yield: bilinear springs with kinematic hardening.

A storey with drift d and plastic drift p resists with k d − (1 − a) k p, where a is its hardening.
It is elastic, and p rests, while |d − p| is below the yield drift. Then it yields: p follows d
until d turns. Between these events the structure is linear, and the loads are linear in time.
There the exponential of the state matrix acts on the state as its Taylor series, summed to rounding
(Al-Mohy, Higham 2011). Its terms are polynomials in time, in which a bound of the curvature finds
the first event.

A substep is the time between neighbouring nodes, samples of loads and points that keep the series
short. Inside it, τ in [0, 1] is the fraction that has passed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from alphacut.base.arrays import Array, Ints, Mask
from alphacut.base.errors import RefusedError, require
from alphacut.base.kernels import compiled
from alphacut.frame.calculus.polynomials import Jet
from alphacut.frame.dynamics.flow import Flow, StepError, with_feedthrough
from alphacut.frame.dynamics.integrators import SAME, state_matrix
from alphacut.frame.records.history import History
from alphacut.frame.structures.linear import Matrices, evaluate, histories
from alphacut.frame.structures.storey import MOMENT, StoreyFrame

# Largest degree of the series over a substep. With |λ| h ≤ 1 the next term is below 1/25! = 6e-26
# of the first one. The series mostly ends sooner.
MAX_TERMS = 24
# Quadrature on [0, 1] for works: for |λ| h ≤ 1 products of two velocities exp(±i τ) are exact to
# 1e-17.
GAUSS_NODES, GAUSS_WEIGHTS = (np.polynomial.legendre.leggauss(8) + np.array([[1], [0]])) / 2
# Width in τ to which an event is located (tuned: some hundred units of rounding). By the same
# fraction of the yield drift, or of the velocity, a state may pass an event, so that an event just
# handled is not met again at once.
EVENT_ROUNDING = 1e-13
# Events in a substep after which the computation has failed.
MAX_EVENTS = 1000
# Largest energy that may be missing at the end, as a fraction of all energies exchanged (tuned).
MAX_IMBALANCE = 1e-9
# Kinds of outputs, which kernels know by their index.
KINDS = ("q", "drift", "shear", "ductility", "v", "a", "residual", "dissipated", MOMENT)
# Indices of those kinds whose peaks are found between nodes, too.
Q, DRIFT, SHEAR, DUCTILITY = range(4)
# Kinds whose peaks are sought at nodes alone; dissipated energy never falls.
AT_NODES = ("v", "a", "residual", MOMENT)
# How a motion ends: at its last node, by collapse, or with too many events.
RUNS = 0
COLLAPSED = 1
FAILED = 2


@dataclass(frozen=True, eq=False)
class YieldingFlow(Flow):
    """Exact trajectories of a storey frame with yielding columns.

    Damping ratios belong to the initial stiffness. So does Rayleigh damping, unless the frame's
    `rayleigh_of` is "tangent".

    Raises:
        RefusedError: The frame is elastic or a force is harmonic; of trajectories: a force yields a
            storey before the start, or a storey collapses under its weight.
    """

    system: StoreyFrame

    def __post_init__(self) -> None:
        """Check the arguments, as all flows do, and the structure.

        Raises:
            RefusedError: A parameter is unknown, the duration is no whole number of steps, no
                storey of the frame can yield, or a load is harmonic, which is not linear between
                samples.
        """
        super().__post_init__()
        require(bool(self.system.hardening), "frame", value="elastic", allowed="columns that yield")
        for history in histories(self.system).values():
            require(
                not history.frequency,
                "load",
                value="harmonic, on columns that yield",
                allowed="loads linear between samples",
                cure='sample it: a case has force.history = "sine.csv", with time [s],force [kN]',
            )

    @property
    def exact(self) -> bool:
        """True: steps only say where the exact response is observed."""
        return True

    def finer(self) -> tuple[YieldingFlow, int]:
        """Return the flow with a quarter of the step, and 4 for the substeps."""
        return replace(self, step=self.step / 4), 4

    def _march(self, points: Array, *, derivatives: bool) -> Jet:
        """Return trajectories at parameter sets, shape (S, time nodes, outputs).

        They are in the units of the outputs, as a jet (values with derivatives) without
        derivatives.

        Args:
            points: Parameter sets in SI units, shape (S, d): a column for each uncertain parameter.
            derivatives: Must be false.

        Raises:
            RefusedError: Derivatives are asked for, which do not exist where a storey yields; a
                static force yields a storey before the start; or a storey collapses.
            StepError: A substep has too many events, or the balance of energy is not met.
        """
        if derivatives:
            allowed = "methods without derivatives: auto or quasi-monte-carlo"
            raise RefusedError("method", "a follower or a proof, of columns that yield", allowed)
        trajectories, _ = self.values_and_peaks(points)
        return Jet.constant(trajectories, 0)

    def values_and_peaks(
        self, points: Array, *, takes_collapse: bool = False
    ) -> tuple[Array, Array]:
        """Return trajectories at parameter sets, and the peak magnitudes of the outputs over time.

        Peaks of displacements, drifts, shears and ductilities are exact, also between time nodes.
        Those of velocities, accelerations, residual drifts and the overturning moment are the
        largest at a time node. Dissipated energy never falls, so that its peak is its last value.

        Args:
            points: Parameter sets in SI units, shape (S, d): a column for each uncertain parameter.
            takes_collapse: Whether a motion that collapses has trajectories of zero and infinite
                peaks. If not, it raises an error.

        Returns:
            Trajectories, shape (S, time nodes, outputs), and peaks, shape (S, outputs), both in the
            SI units of the outputs.

        Raises:
            RefusedError: A static force yields a storey before the start, or a storey collapses
                under its weight and `takes_collapse` is false: it yields beyond the drift at which
                its columns could hold the weight at rest.
            StepError: A substep has more than 1000 events, or the balance of energy is off by more
                than 1e-9 of all energies exchanged at the end.
        """
        system = self.system
        points = np.asarray(points, float)
        matrices, _ = evaluate(system, self.names, points, derivatives=False)
        storeys, drifts_at_yield = self._storeys(points, matrices)
        start = matrices.start.value[..., 0]
        start_drifts = np.diff(start[:, : system.floors], prepend=0.0)
        if matrices.static is not None and (np.abs(start_drifts) > drifts_at_yield).any():
            allowed = "forces under which no storey yields before the start"
            raise RefusedError("load", "static, and yields a storey", allowed)
        pushes = matrices.pushes(ground=system.ground is not None).value
        fastest = float(np.abs(np.linalg.eigvals(state_matrix(matrices).value)).max())
        loads = list(histories(system).values())
        # The response over a substep h is a Taylor series, whose terms are at most (|λ| h)^k / k!
        # of the first one. Up to |λ| h = 1 they fall from the first one on, without cancellation.
        # Yielding only softens a storey, so that the elastic structure has the fastest mode.
        max_phase = 1.0
        substeps = load_substeps(loads, self.time, longest=max_phase / max(fastest, 1e-300))
        kinds = np.array([(KINDS.index(x), z) for x, z in map(system.quantity, self.outputs)])
        values: Array = np.empty((len(points), len(self.time), len(kinds)))
        peaks = np.zeros((len(points), len(kinds)))
        for s in range(len(points)):
            found = _march(
                np.ascontiguousarray(storeys[s]),
                np.ascontiguousarray(matrices.damping.value[s]),
                np.ascontiguousarray(pushes[s]),
                np.ascontiguousarray(start[s]),
                *substeps,
                kinds,
                values[s],
                peaks[s],
            )
            end = MotionEnd(*found)
            if takes_collapse and end.status == COLLAPSED:
                values[s] = 0.0
                peaks[s] = np.inf
                continue
            self._require_motion(points[s], end)
        values = with_feedthrough(Jet.constant(values, 0), matrices, system, self.time).value
        return values, np.maximum(peaks, np.abs(values).max(1))

    def _storeys(self, points: Array, matrices: Matrices) -> tuple[Array, Array]:
        """Return the properties of n storeys at S parameter sets, and their yield drifts.

        Args:
            points: Parameter sets in SI units, shape (S, d): a column for each uncertain parameter.
            matrices: Matrices of the frame at these sets, of which the masses are taken.

        Returns:
            Properties, shape (S, 7, n), with the rows 0 mass of the floor in kg, 1 initial
            stiffness in N/m, 2 softening by the weight above over the height in N/m (0 without
            gravity), 3 hardening, the stiffness after yielding over the initial one, 4 yield drift
            in m, 5 height in m (0 if not given), and 6 damping in N s/m that is lost while the
            storey yields. Then the yield drifts alone, shape (S, n), in m.
        """
        system = self.system
        named = {**system.parameters, **dict(zip(self.names, points.T, strict=True))}
        p = {x: Jet.constant(np.zeros(len(points)) + y, 0) for x, y in named.items()}
        k = system.springs(p)
        hardening = system.hardenings(p)
        yield_drift = system.yield_drifts(p)
        softening = k * 0.0
        heights = k * 0.0
        if system.gravity:
            softening = system.softening(p)
        if len(system.lengths):
            heights = system.heights(p)
        mass = matrices.mass.value.diagonal(axis1=1, axis2=2)
        # Rayleigh damping b K by the tangent stiffness K loses b (1 - hardening) k of a storey.
        lost_damping = k * 0.0
        if system.rayleigh_of == "tangent":
            lost_damping = k * (1.0 - hardening) * p["rayleigh_stiffness"][:, None]
        rows = [mass]
        for jet in (k, softening, hardening, yield_drift, heights, lost_damping):
            rows.append(jet.value)
        storeys = np.stack(rows, 1)
        return storeys, yield_drift.value

    def _require_motion(self, point: Array, end: MotionEnd) -> None:
        """Raise an error unless a motion has reached its end with its energy in balance.

        Args:
            point: Parameter set of the motion, shape (d,), for the message.
            end: How it ended: its status (0 at the last node, 1 by collapse, 2 with too many
                events), the time in s, the storey of the collapse, from 0 on, and the fraction of
                energy that is missing.

        Raises:
            RefusedError: A storey has collapsed under its weight.
            StepError: A substep had more than 1000 events, or the energy is off by more than 1e-9.
        """
        if end.status == COLLAPSED:
            where = self._point_words(point)
            value = f"collapsing under its weight at t = {end.time:.6g} s at {where}"
            allowed = "drifts at which its columns hold the weight at rest"
            cure = "take more hardening, a larger yield force or a weaker load"
            raise RefusedError(f"storey {end.storey + 1}", value, allowed, cure)
        if end.status == FAILED:
            what = f"more than {MAX_EVENTS} events in a step at t = {end.time:.6g} s"
            raise StepError(what, "take a smaller step or a larger yield force")
        if not abs(end.imbalance) <= MAX_IMBALANCE:
            off = f"{abs(end.imbalance):.2g}"
            what = f"the balance of energy is off by {off} at the end of a motion"
            raise StepError(what, "take a smaller step, or parameters where the motion exists")


class MotionEnd(NamedTuple):
    """How a motion ends.

    `status` is RUNS, COLLAPSED or FAILED, `time` is in s, `storey` is that of the collapse or of
    the last event, −1 for none, and `imbalance` is the energy that is missing, as a fraction of all
    energies exchanged.
    """

    status: int
    time: float
    storey: int
    imbalance: float


class LoadSubsteps(NamedTuple):
    """E substeps in which L loads are linear.

    `edges` are the times between them, shape (E + 1,), and `is_node` says which of these are time
    nodes. `first` and `last` are the loads at the beginning and at the end of each substep, shape
    (E, L), on its side of a jump.
    """

    edges: Array
    is_node: Mask
    first: Array
    last: Array


def load_substeps(loads: Sequence[History], time: Array, *, longest: float) -> LoadSubsteps:
    """Return substeps between all time nodes and all samples of the loads, up to `longest` each.

    Args:
        loads: Histories that are linear between samples; there may be none.
        time: Equally spaced nodes from 0, two or more, in s.
        longest: Largest length of a substep, in s; intervals between nodes and samples are divided
            into equal parts.

    Returns:
        E substeps up to the last node: `edges`, the times between them, shape (E + 1,), in s;
        `is_node`, which of these are time nodes, shape (E + 1,); and `first` and `last`, the loads
        at the beginning and at the end of each substep, shape (E, loads). Where a load jumps there,
        its value inside the substep counts.
    """
    step = time[1]
    sample_times: list[Array] = [np.zeros(0)]  # so that there may be no loads
    for load in loads:
        sample_times.append(load.start + np.arange(len(load.samples)) * load.step)
    samples = np.unique(np.concatenate(sample_times))
    # Samples that lie on a node, or on another load's sample, but for rounding, make no new edge.
    nearest_nodes = np.round(samples / step) * step
    is_new = np.abs(samples - nearest_nodes) > SAME * step
    is_new &= samples < time[-1]
    is_new &= np.diff(samples, prepend=-1.0) > SAME * step
    segments = np.union1d(time, samples[is_new])
    # Each segment is divided into equal substeps. The number of edges before each end of a segment
    # is known, and the times of all edges lie on straight lines between these ends.
    substeps = np.ceil(np.diff(segments) / longest)
    edges_before = np.append(0, np.cumsum(substeps))
    edges = np.interp(np.arange(edges_before[-1] + 1), edges_before, segments)
    first = np.zeros((len(edges) - 1, len(loads)))
    last = np.zeros((len(edges) - 1, len(loads)))
    for column, load in enumerate(loads):
        first[:, column] = load.envelope(edges[:-1])
        last[:, column] = load.envelope(edges[1:], -1.0)
    return LoadSubsteps(edges, np.isin(edges, time), first, last)


@compiled
def _march(
    storeys: Array, damping: Array, pushes: Array, start: Array, edges: Array, is_node: Mask,
    first: Array, last: Array, kinds: Ints, values: Array, peaks: Array,
) -> tuple[int, float, int, float]:  # fmt: skip
    """Write the response of one frame to `values` and `peaks`, and return a `MotionEnd` as a tuple.

    Args:
        storeys: Properties of the n storeys, shape (7, n), with the rows 0 mass, 1 initial
            stiffness, 2 softening by weight, 3 hardening, 4 yield drift, 5 height, 6 damping lost
            while yielding, in SI units.
        damping: Damping matrix while no storey yields, shape (n, n), in N s/m.
        pushes: Accelerations of the floors by a unit of each of L loads, shape (n, L).
        start: Initial displacements in m, then velocities in m/s, shape (2n,).
        edges: Times between E substeps, shape (E + 1,), in s.
        is_node: Which edges are time nodes, shape (E + 1,).
        first: Loads at the beginning of the substeps, shape (E, L).
        last: Loads at their end, shape (E, L).
        kinds: Code and storey (from 0) of each of m outputs, shape (m, 2). Codes are 0
            displacement, 1 drift, 2 shear, 3 ductility, 4 velocity, 5 acceleration, 6 residual
            drift, 7 dissipated energy, 8 overturning moment.
        values: Receives the outputs at time nodes, shape (T, m). Accelerations lack the forces over
            the masses.
        peaks: Raised to the largest magnitudes of outputs of the codes 0 to 3 within substeps,
            shape (m,).
    """
    mass, k, softening, hardening, yield_drift, _, lost_damping = storeys
    n = len(mass)
    inverse_mass = 1 / mass
    # coefficients of displacements, velocities and drifts by powers of τ
    series = np.zeros((3, n, MAX_TERMS + 1))
    load, rise, tangent, constant = np.zeros((4, n))
    q = start[:n].copy()
    v = start[n:].copy()
    # plastic drift, dissipated energy, and direction of yielding: ±1, or 0 of an elastic storey
    plastic, dissipated, direction = np.zeros((3, n))
    # The start counts as reached by loading in one direction: a drift beyond the yield drift has
    # left the plastic drift that keeps |d − p| at the yield drift.
    for z in range(n):
        d = _drift(q, z)
        plastic[z] = d - min(max(d, -yield_drift[z]), yield_drift[z])
    # Where the weight softens a yielding storey by more than it hardens, columns hold the weight up
    # to a drift at which their force and its own are equal: (1 − a) k d_y = (s − a k) d.
    last_drift = np.full(n, np.inf)
    for z in range(n):
        if softening[z] > hardening[z] * k[z]:
            excess = softening[z] - hardening[z] * k[z]
            last_drift[z] = (1 - hardening[z]) * k[z] * yield_drift[z] / excess
    before = _energy(storeys, q, v, plastic)
    works = np.zeros(2)
    node = 0
    # `damping` changes while storeys yield; the caller's array must not
    elastic_damping = damping
    damping = damping.copy()
    for e in range(len(edges)):
        if is_node[e]:
            _observe(kinds, storeys, damping, (q, v, plastic, dissipated), values[node])
            node += 1
        if e == len(edges) - 1:
            break
        # forces of the loads at the beginning of the substep, and their rise until its end
        h = edges[e + 1] - edges[e]
        for i in range(n):
            load[i] = rise[i] = 0.0
            for c in range(pushes.shape[1]):
                load[i] += mass[i] * pushes[i, c] * first[e, c]
                rise[i] += mass[i] * pushes[i, c] * (last[e, c] - first[e, c])
        # from event to event; h is what remains of the substep
        for event in range(MAX_EVENTS + 1):
            # The net force of a storey is tangent · drift + constant. The weight takes `softening`
            # from the stiffness of an elastic and of a yielding storey alike (P-Delta).
            for i in range(n):
                if direction[i] != 0:
                    spring = direction[i] * yield_drift[i]
                    fraction = hardening[i]
                else:
                    spring = -plastic[i]
                    fraction = 1.0
                constant[i] = (1 - hardening[i]) * k[i] * spring
                tangent[i] = fraction * k[i] - softening[i]
            terms = _expand(inverse_mass, damping, tangent, constant, load, rise, h, q, v, series)
            at, z = _first_event(
                series, terms, plastic, direction, yield_drift, hardening, last_drift
            )
            _add_works(damping, load, rise, series, terms, at, h, works)
            # move the state to the event (or to the end); the plastic drift of a yielding storey
            # follows its drift, and what it dissipates is the yield force of its plastic spring
            # times this flow
            for i in range(n):
                q[i] = _value(series[0, i], terms, at)
                v[i] = _value(series[1, i], terms, at)
                load[i] += at * rise[i]
                rise[i] *= 1 - at
                if direction[i] != 0:
                    flow = _drift(q, i) - direction[i] * yield_drift[i] - plastic[i]
                    plastic[i] += flow
                    dissipated[i] += (1 - hardening[i]) * k[i] * yield_drift[i] * abs(flow)
            _add_peaks(kinds, storeys, tangent, constant, series, terms, at, q, v, peaks)
            h *= 1 - at
            if z < 0:
                break
            # A yielding storey turns elastic, or has collapsed. An elastic one begins to yield.
            if direction[z] != 0:
                if direction[z] * _drift(q, z) >= (1 - 1e-9) * last_drift[z]:
                    return COLLAPSED, edges[e + 1] - h, z, 0.0
                direction[z] = 0.0
            else:
                direction[z] = math.copysign(1.0, _drift(q, z) - plastic[z])
            # damping forces jump at the event, velocities do not
            damping[:] = elastic_damping
            for i in range(n):
                if direction[i] != 0:
                    damping[i, i] -= lost_damping[i]
                    if i:
                        damping[i - 1, i - 1] -= lost_damping[i]
                        damping[i, i - 1] += lost_damping[i]
                        damping[i - 1, i] += lost_damping[i]
            # so many events in one substep are those of a motion that is computed wrongly
            if event == MAX_EVENTS:
                return FAILED, edges[e + 1] - h, z, 0.0
    # Work of the loads less changes of energy and dissipation vanishes for the exact motion. The
    # sum of all magnitudes is the scale against which it is judged.
    after = _energy(storeys, q, v, plastic)
    dissipation = works[1] + dissipated.sum()
    exchanged = abs(before) + abs(after) + abs(works[0]) + dissipation
    imbalance = 0.0
    if exchanged > 0:
        imbalance = (before + works[0] - after - dissipation) / exchanged
    return RUNS, edges[-1], -1, imbalance


@compiled
def _expand(
    inverse_mass: Array, damping: Array, tangent: Array, constant: Array, load: Array, rise: Array,
    h: float, q: Array, v: Array, series: Array,
) -> int:  # fmt: skip
    """Write the Taylor series of a state over a substep, and return the number of its terms.

    The equations are M q̈ + D q̇ + (forces of the storeys) = loads. Time is measured by τ in [0,
    1], the fraction of the substep that has passed.

    Args:
        inverse_mass: 1/m of each of n floors, shape (n,), in 1/kg.
        damping: Damping matrix, shape (n, n), in N s/m.
        tangent: Stiffness t of each storey, in N/m: its force on the floor above is −(t · drift +
            c), on the floor below the opposite, shape (n,).
        constant: c of each storey, in N, shape (n,).
        load: Force on each floor at τ = 0, in N, shape (n,).
        rise: Rise of this force until τ = 1, linear in τ, in N, shape (n,).
        h: Length of the substep, in s.
        q: Displacements at τ = 0, in m, shape (n,).
        v: Velocities at τ = 0, in m/s, shape (n,).
        series: Receives coefficients by powers of τ, shape (3, n, MAX_TERMS + 1): of displacements,
            velocities and drifts. Those behind the returned number of terms are not meant.
    """
    Q, V, drifts = series
    n = len(q)
    term_rounding = 1e-17  # a tenth of the unit roundoff: what follows changes no digit
    scale = 0.0
    previous = math.inf
    for i in range(n):
        Q[i, 0] = q[i]
        V[i, 0] = v[i]
    for term in range(MAX_TERMS + 1):
        factor = h / (term + 1)
        size = 0.0
        below = 0.0
        for i in range(n):
            drifts[i, term] = Q[i, term] - below
            below = Q[i, term]
            size += abs(Q[i, term]) + h * abs(V[i, term])
        # The series ends at two small terms in a row, since in free vibration every other one
        # may vanish.
        scale = max(scale, size)
        if term == MAX_TERMS or (term > 1 and max(size, previous) <= term_rounding * scale):
            return term + 1
        previous = size
        above = 0.0
        # from the top storey down: the force on a floor is that of the storey above less its own.
        # Constants act on the first coefficient alone, the rise of the loads on the second.
        for i in range(n - 1, -1, -1):
            column = tangent[i] * drifts[i, term]
            if term == 0:
                column += constant[i]
            force = above - column
            above = column
            if term == 0:
                force += load[i]
            elif term == 1:
                force += rise[i]
            for j in range(n):
                force -= damping[i, j] * V[j, term]
            Q[i, term + 1] = factor * V[i, term]
            V[i, term + 1] = (factor * inverse_mass[i]) * force
    return MAX_TERMS + 1


@compiled
def _first_event(
    series: Array, terms: int, plastic: Array, direction: Array, yield_drift: Array,
    hardening: Array, last_drift: Array,
) -> tuple[float, int]:  # fmt: skip
    """Return τ at the first event of a substep, and its storey; 1 and −1 where there is none.

    An elastic storey yields where |drift − plastic drift| exceeds the yield drift; a yielding one
    turns elastic where the velocity of its drift changes its sign, and collapses where its drift
    passes the last one at which it holds its weight.

    Args:
        series: Coefficients by powers of τ, τ in [0, 1] the fraction of the substep that has
            passed, shape (3, n, coefficients): of displacements of the floors, of their velocities,
            and of drifts of the storeys.
        terms: Number of coefficients that count.
        plastic: Plastic drift of each storey, in m, shape (n,).
        direction: 1 or −1 of a storey that yields with rising or falling drift, 0 of an elastic
            one, shape (n,).
        yield_drift: Yield drift of each storey, in m, shape (n,).
        hardening: Stiffness after yielding over the initial one, shape (n,); a storey of 1 never
            yields.
        last_drift: Drift at which a storey that yields outwards collapses, in m, shape (n,).
    """
    first = 1.0
    storey = -1
    drifts = series[2]
    margin = np.empty(terms)  # coefficients of a polynomial that is negative after the event
    for z in range(len(plastic)):
        elastic = drifts[z, 0] - plastic[z]
        variation = 0.0
        sign = direction[z]
        for term in range(1, terms):
            variation += (term if sign != 0 else 1) * abs(drifts[z, term])
        # Σ |c_k| bounds the variation of a polynomial Σ c_k τ^k: mostly there is no event
        if sign != 0:
            at = first
            # `variation` also bounds that of the drift
            if sign * drifts[z, 0] + variation > last_drift[z]:
                for term in range(terms):
                    margin[term] = -sign * drifts[z, term]
                margin[0] += last_drift[z]
                at = min(at, _first_root(margin, terms, at))
            # unless the velocity of the drift cannot change its sign within the substep
            if 2 * sign * drifts[z, 1] <= variation:
                for term in range(1, terms):
                    margin[term - 1] = sign * term * drifts[z, term]
                margin[0] += EVENT_ROUNDING * variation
                at = min(at, _first_root(margin, terms - 1, at))
        # a storey whose hardening is 1 never yields
        elif abs(elastic) + variation < yield_drift[z] or hardening[z] == 1:
            continue
        else:
            at = first
            for side in (-1.0, 1.0):
                for term in range(terms):
                    margin[term] = -side * drifts[z, term]
                # A drift far above the yield drift rounds by more than that. Without the second
                # term a storey that has just reversed would yield at once.
                rounding = EVENT_ROUNDING * yield_drift[z] + 4.5e-16 * abs(drifts[z, 0])
                margin[0] = yield_drift[z] + rounding - side * elastic
                at = min(at, _first_root(margin, terms, at))
        if at < first:
            first = at
            storey = z
    return first, storey


@compiled
def _first_root(polynomial: Array, terms: int, end: float) -> float:
    """Return the first τ in [0, end) from which on a polynomial is negative, or 1 if there is none.

    Over an interval of width w a polynomial deviates from its chord by at most w²/8 times its
    largest second derivative, and its slope from that of the chord by w/2 times that. An interval
    is passed where the chord is above this deviation, halved where this is not known, and searched
    for the root where the polynomial surely falls through zero. A dip below zero over less than
    2⁻³⁴ may be passed. The root is found to 1e-13.

    Args:
        polynomial: Coefficients by powers of τ.
        terms: Number of coefficients that count, at least 1.
        end: End of the search, at most 1.

    Returns:
        τ, 0 if the polynomial is negative there already; 1 if it is not negative before `end`.
    """
    # Shortest interval in which a double root is looked for. In it a polynomial differs from its
    # chord by w²/8 = 2⁻⁷¹ of its curvature, far below rounding.
    resolution = 2.0**-34
    # On [0, 1] the sum of the magnitudes of its coefficients bounds the second derivative.
    curvature = 0.0
    for term in range(2, terms):
        curvature += term * (term - 1) * abs(polynomial[term])
    low = 0.0
    width = end
    left = polynomial[0]
    # `left` and `right` are the values at the ends of the interval [low, low + width]
    while low < end and left >= 0:
        width = min(width, end - low)
        right = _value(polynomial, terms, low + width)
        if min(left, right) > curvature * width**2 / 8 or (width <= resolution and right >= 0):
            low = low + width
            left = right
            width = 2 * width
        elif width <= resolution or (right < 0 and right - left < -curvature * width**2 / 2):
            # Newton's method from the chord's root, with bisection where a step leaves the interval
            high = low + width
            root = low + width * left / (left - right)
            while high - low > EVENT_ROUNDING:
                value = polynomial[terms - 1]
                slope = 0.0
                for term in range(terms - 2, -1, -1):
                    slope = slope * root + value
                    value = value * root + polynomial[term]
                if value >= 0:
                    low = root
                else:
                    high = root
                change = -value / slope
                if not low < root + change < high:
                    change = (low + high) / 2 - root
                root += change
                if abs(change) <= EVENT_ROUNDING:
                    break
            return root
        else:
            width /= 2
    return low if left < 0 else 1.0


@compiled
def _add_works(
    damping: Array, load: Array, rise: Array, series: Array, terms: int, at: float, h: float,
    works: Array,
) -> None:  # fmt: skip
    """Add works ∫ v·f dt from τ = 0 to τ = `at` to `works`, in place.

    Args:
        damping: Damping matrix of n floors, shape (n, n), in N s/m.
        load: Force on each floor at τ = 0, in N, shape (n,).
        rise: Rise of this force until τ = 1, linear in τ, in N, shape (n,).
        series: Coefficients by powers of τ, τ in [0, 1] the fraction of the substep that has
            passed, shape (3, n, coefficients): of displacements of the floors, of their velocities,
            and of drifts of the storeys.
        terms: Number of coefficients that count.
        at: End of the integration, from 0 to 1.
        h: Length of the substep, in s.
        works: Works in J, shape (2,): what the loads do, and what damping takes.
    """
    n = len(load)
    V = series[1]
    points = at * GAUSS_NODES
    weights = at * h * GAUSS_WEIGHTS
    velocity = np.empty((n, len(GAUSS_NODES)))
    for i in range(n):
        velocity[i] = V[i, terms - 1]
        for term in range(terms - 2, -1, -1):
            for g in range(len(GAUSS_NODES)):
                velocity[i, g] = velocity[i, g] * points[g] + V[i, term]
    for g in range(len(GAUSS_NODES)):
        for i in range(n):
            damped = 0.0
            for j in range(n):
                damped += damping[i, j] * velocity[j, g]
            works[0] += weights[g] * velocity[i, g] * (load[i] + rise[i] * points[g])
            works[1] += weights[g] * velocity[i, g] * damped


@compiled
def _energy(storeys: Array, q: Array, v: Array, plastic: Array) -> float:
    """Return the sum of kinetic and elastic energy of a state, less the work of weights, in J.

    It is ½ Σ [m v² + (a k − s) d² + (1 − a) k (d − p)²] over floors and storeys, with the drift d,
    the plastic drift p, the hardening a and the softening s by weight.

    Args:
        storeys: Properties of the n storeys, shape (7, n), with the rows 0 mass, 1 initial
            stiffness, 2 softening by weight, 3 hardening, 4 yield drift, 5 height, 6 damping lost
            while yielding, in SI units.
        q: Displacements of the floors, in m, shape (n,).
        v: Their velocities, in m/s, shape (n,).
        plastic: Plastic drifts, in m, shape (n,).
    """
    total = 0.0
    for z in range(len(q)):
        mass, k, softening, a = storeys[:4, z]
        d = _drift(q, z)
        total += mass * v[z] ** 2 + (a * k - softening) * d**2 + (1 - a) * k * (d - plastic[z]) ** 2
    return total / 2


@compiled
def _drift(q: Array, z: int) -> float:
    """Return the drift of storey z, counted from 0, of displacements (or velocities) of floors."""
    if z == 0:
        return q[z]
    return q[z] - q[z - 1]


@compiled
def _add_peaks(
    kinds: Ints, storeys: Array, tangent: Array, constant: Array, series: Array, terms: int,
    end: float, q: Array, v: Array, peaks: Array,
) -> None:  # fmt: skip
    """Raise the peaks of outputs, in place, by those from τ = 0 to τ = `end` of a substep.

    An output is scale · x + shift, with a displacement or drift x. Its magnitude is taken
    where the velocity of x changes its sign, and at the end. Outputs with codes from 4 on are
    passed over.

    Args:
        kinds: Code and storey (from 0) of each of m outputs, shape (m, 2). Codes are 0
            displacement, 1 drift, 2 shear, 3 ductility, 4 velocity, 5 acceleration, 6 residual
            drift, 7 dissipated energy, 8 overturning moment.
        storeys: Properties of the n storeys, shape (7, n), with the rows 0 mass, 1 initial
            stiffness, 2 softening by weight, 3 hardening, 4 yield drift, 5 height, 6 damping lost
            while yielding, in SI units.
        tangent: Stiffness t of each storey less its softening: the net force of its columns and of
            the weight is t · drift + c, shape (n,).
        constant: c of each storey, shape (n,).
        series: Coefficients by powers of τ, τ in [0, 1] the fraction of the substep that has
            passed, shape (3, n, coefficients): of displacements of the floors, of their velocities,
            and of drifts of the storeys.
        terms: Number of coefficients that count.
        end: End of the interval, from 0 to 1.
        q: Displacements at the end, in m, shape (n,).
        v: Velocities at the end, in m/s, shape (n,).
        peaks: Peak magnitude of each output, shape (m,).
    """
    for row in range(len(kinds)):
        kind, z = kinds[row]
        if kind > DUCTILITY:
            continue
        if kind == Q:
            polynomial = series[0, z]
            x = q[z]
            velocity = v[z]
        else:
            polynomial = series[2, z]
            x = _drift(q, z)
            velocity = _drift(v, z)
        scale = 1.0
        shift = 0.0
        if kind == DUCTILITY:
            scale = 1 / storeys[4, z]
        elif kind == SHEAR:
            scale = tangent[z] + storeys[2, z]
            shift = constant[z]
        peaks[row] = max(peaks[row], abs(scale * x + shift))
        if polynomial[1] * velocity < 0:  # x turns in between
            reach = abs(scale * polynomial[0] + shift)
            slope = np.empty(terms - 1)
            for term in range(1, terms):
                slope[term - 1] = math.copysign(term, polynomial[1]) * polynomial[term]
                reach += abs(scale * polynomial[term])
            # The sum of all magnitudes bounds the output: mostly no new peak is possible.
            if reach > peaks[row]:
                # a turn that rounding hides lies at the end
                stop = min(_first_root(slope, terms - 1, end), end)
                turn = scale * _value(polynomial, terms, stop) + shift
                peaks[row] = max(peaks[row], abs(turn))


@compiled
def _observe(
    kinds: Ints, storeys: Array, damping: Array, state: tuple[Array, Array, Array, Array],
    values: Array,
) -> None:  # fmt: skip
    """Write all outputs of a state to `values`, shape (m,), in SI units.

    Args:
        kinds: Code and storey (from 0) of each of m outputs, shape (m, 2). Codes are 0
            displacement, 1 drift, 2 shear, 3 ductility, 4 velocity, 5 acceleration, 6 residual
            drift, 7 dissipated energy, 8 overturning moment.
        storeys: Properties of the n storeys, shape (7, n), with the rows 0 mass, 1 initial
            stiffness, 2 softening by weight, 3 hardening, 4 yield drift, 5 height, 6 damping lost
            while yielding, in SI units.
        damping: Damping matrix at this state, shape (n, n), in N s/m.
        state: Displacements in m, velocities in m/s, plastic drifts in m and dissipated energies in
            J of n floors or storeys, shape (n,) each.
        values: Receives the outputs. Accelerations lack the forces of the loads over the masses,
            which the caller adds; they are absolute ones where the load is a base excitation.
    """
    q, v, plastic, dissipated = state
    for row in range(len(kinds)):
        kind, z = kinds[row]
        mass, k, softening, hardening, yield_drift = storeys[:5, z]
        drift = _drift(q, z)
        offset_force = (1 - hardening) * k * plastic[z]
        # `_net_force` is the force of a storey's columns less the softening by weight times drift.
        # The columns below pull the floor z back, those above pull it on.
        force = -_net_force(storeys, q, plastic, z)
        moment = 0.0
        if z + 1 < len(q):
            force += _net_force(storeys, q, plastic, z + 1)
        for i in range(len(q)):
            force -= damping[z, i] * v[i]
            shear = _net_force(storeys, q, plastic, i) + storeys[2, i] * _drift(q, i)
            moment += storeys[5, i] * shear
        # The residual drift is that at which the storey would rest without load. Elastic unloading
        # leads to (1 − a) k p / (k − s), a the hardening, p the plastic drift and s the softening.
        # The storey yields back on the way if that is beyond (1 − a) k d_y / |a k − s|, which is
        # infinite where a k = s, as without hardening and weight.
        back = abs((1 - hardening) * k * yield_drift / (hardening * k - softening))
        residual = min(max(offset_force / (k - softening), -back), back)
        by_kind = (
            q[z], drift, k * drift - offset_force, drift / yield_drift,
            v[z], force / mass, residual, dissipated[z], moment,
        )  # fmt: skip
        values[row] = by_kind[kind]


@compiled
def _net_force(storeys: Array, q: Array, plastic: Array, z: int) -> float:
    """Return the force of the columns of storey z less the overturning one of its weight, in N."""
    _, k, softening, hardening = storeys[:4, z]
    return (k - softening) * _drift(q, z) - (1 - hardening) * k * plastic[z]


@compiled
def _value(polynomial: Array, terms: int, at: float) -> float:
    """Return the value of a polynomial at τ = `at`, by Horner's rule."""
    value = polynomial[terms - 1]
    for term in range(terms - 2, -1, -1):
        value = value * at + polynomial[term]
    return value
