"""Motion of storey frames whose columns yield: bilinear springs with kinematic hardening.

A storey of drift d and plastic drift p resists with k d − (1 − a) k p, a its hardening. It is
elastic, p at rest, while |d − p| is below the yield drift, and then yields: p follows d until d
turns. Between these events the motion is linear and the load linear in time. The exponential of
the state matrix acts on the state as its Taylor series, summed to rounding (Al-Mohy, Higham 2011):
polynomials in time, in which the first event is found by a bound of their curvature.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from alphacut.base.arrays import Array, Ints, Mask
from alphacut.base.errors import RefusedError, require
from alphacut.base.kernels import compiled
from alphacut.frame.calculus.jet import Jet
from alphacut.frame.dynamics.flow import Flow, StepError, with_feedthrough
from alphacut.frame.dynamics.integrators import SAME, state_matrix
from alphacut.frame.records.history import History
from alphacut.frame.structures.linear import evaluate, histories
from alphacut.frame.structures.storey import MOMENT, StoreyFrame

MAX_PHASE = 1.0
"""Largest |λ| h of a part of a step: the series of exp(A h) then has no cancellation."""
MAX_TERMS = 24
"""Terms of the series: 1 / 24! is 2e-24; it mostly ends sooner."""
TERM_ROUNDING = 1e-17
"""Size of two terms in turn, as a fraction of the largest one, at which the series ends."""
GAUSS_NODES, GAUSS_WEIGHTS = (np.polynomial.legendre.leggauss(8) + np.array([[1], [0]])) / 2
"""Quadrature on [0, 1] of works: of products of exp(±i MAX_PHASE τ) exact to 1e-17."""
EVENT_ROUNDING = 1e-13
"""Width in which an event is located, as a fraction of a part; and the same of the yield drift, or
of the velocity, by which it may be passed: so that a state just left is not met again at once."""
RESOLUTION = 2.0**-34
"""Shortest interval in which a double root is looked for: between its ends a polynomial is within
2⁻⁷¹ of its curvature of a straight line."""
MAX_EVENTS = 1000
"""Events in a part of a step after which the motion has failed."""
MAX_IMBALANCE = 1e-9
"""Energy that may be missing at the end, as a fraction of all energies that were exchanged."""
KINDS = ("q", "drift", "shear", "ductility", "v", "a", "residual", "dissipated", MOMENT)
Q, DRIFT, SHEAR, DUCTILITY = range(4)  # kinds whose peaks are found between nodes
AT_NODES = ("v", "a", "residual", MOMENT)
"""Outputs whose peaks are sought at nodes alone; dissipated energy never falls."""
RUNS, COLLAPSED, FAILED = 0, 1, 2


@dataclass(frozen=True, eq=False)
class YieldingFlow(Flow):
    """Exact trajectories of a storey frame with yielding columns.

    Damping ratios are those of the initial stiffness, and so is Rayleigh's damping unless
    `rayleigh_of` is "tangent".

    Raises:
        RefusedError: A force is harmonic or yields a storey before the start, or a storey yields
            whose tangent stiffness is then not positive under the weight.
    """

    system: StoreyFrame

    def __post_init__(self) -> None:
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
        """True: steps only say where the exact motion is read."""
        return True

    def finer(self) -> tuple[YieldingFlow, int]:
        """Return the flow with a quarter of the step, and 4."""
        return replace(self, step=self.step / 4), 4

    def _march(self, points: Array, *, derivatives: bool) -> Jet:
        if derivatives:
            allowed = "methods without derivatives: auto or quasi-monte-carlo"
            raise RefusedError("method", "a follower or a proof, of columns that yield", allowed)
        return Jet.constant(self.values_and_peaks(points)[0], 0)

    def values_and_peaks(
        self, points: Array, *, takes_collapse: bool = False
    ) -> tuple[Array, Array]:
        """Return trajectories (S, T, m) at points (S, d), and their largest magnitudes (S, m).

        These are largest over time, of outputs of the kinds `AT_NODES` at the nodes. Those of a
        motion that collapses are infinite if `takes_collapse`; else it is refused.
        """
        system, points, loads = self.system, np.asarray(points, float), histories(self.system)
        matrices, _ = evaluate(system, self.names, points, derivatives=False)
        named = {**system.parameters, **dict(zip(self.names, points.T, strict=True))}
        p = {x: Jet.constant(np.zeros(len(points)) + y, 0) for x, y in named.items()}
        k, hardening, yield_drift = system.springs(p), system.hardenings(p), system.yield_drifts(p)
        softening = system.softening(p) if system.gravity else k * 0.0
        heights = system.heights(p) if len(system.lengths) else k * 0.0
        mass = matrices.mass.value.diagonal(axis1=1, axis2=2)
        is_tangent = float(system.rayleigh_of == "tangent")
        lost_damping = k * (1.0 - hardening) * (is_tangent * p["rayleigh_stiffness"])[:, None]
        properties = [k, softening, hardening, yield_drift, heights, lost_damping]
        storeys = np.stack([mass, *(x.value for x in properties)], 1)  # (S, 7, n)
        start = matrices.start.value[..., 0]
        drift0 = np.diff(start[:, : system.floors], prepend=0.0)
        if matrices.static is not None and (np.abs(drift0) > yield_drift.value).any():
            allowed = "forces under which no storey yields before the start"
            raise RefusedError("load", "static, and yields a storey", allowed)
        pushes = matrices.pushes(ground=system.ground is not None).value
        fastest = float(np.abs(np.linalg.eigvals(state_matrix(matrices).value)).max())
        parts = load_parts([*loads.values()], self.time, MAX_PHASE / max(fastest, 1e-300))
        kinds = np.array([(KINDS.index(x), z) for x, z in map(system.quantity, self.outputs)])
        values: Array = np.empty((len(points), len(self.time), len(kinds)))
        peaks = np.zeros((len(points), len(kinds)))
        by_motion = map(np.ascontiguousarray, (storeys, matrices.damping.value, pushes, start))
        for s, motion in enumerate(zip(*by_motion, strict=True)):
            end = _march(*motion, *parts, kinds, values[s], peaks[s])
            if takes_collapse and end[0] == COLLAPSED:
                values[s], peaks[s] = 0.0, np.inf
                continue
            self._require_motion(points[s], *end)
        values = with_feedthrough(Jet.constant(values, 0), matrices, system, self.time).value
        return values, np.maximum(peaks, np.abs(values).max(1))

    def _require_motion(
        self, point: Array, status: int, time: float, storey: int, imbalance: float
    ) -> None:
        if status == COLLAPSED:
            value = f"collapsing under its weight at t = {time:.6g} s at {self._point_words(point)}"
            allowed = "hardening times stiffness above weight over height where it yields"
            cure = "take more hardening, a larger yield force or a weaker load"
            raise RefusedError(f"storey {storey + 1}", value, allowed, cure)
        if status == FAILED:
            what = f"more than {MAX_EVENTS} events in a step at t = {time:.6g} s"
            raise StepError(what, "take a smaller step or a larger yield force")
        if not abs(imbalance) <= MAX_IMBALANCE:
            what = f"the balance of energy is off by {abs(imbalance):.2g} at the end of a motion"
            raise StepError(what, "take a smaller step, or parameters where the motion exists")


def load_parts(
    loads: Sequence[History], time: Array, longest: float
) -> tuple[Array, Mask, Array, Array]:
    """Return times (E + 1,) between which L loads are linear, and their values there.

    The times are the nodes, all samples, and others so that no part is longer than `longest`.
    Which are nodes comes second, then the values at the beginning and at the end of each part,
    shape (E, L), between jumps.
    """
    step = time[1]
    times = [load.start + np.arange(len(load.samples)) * load.step for load in loads]
    samples = np.unique(np.concatenate([np.zeros(0), *times]))
    is_new = np.abs(samples - np.round(samples / step) * step) > SAME * step  # no node
    is_new &= (samples < time[-1]) & (np.diff(samples, prepend=-1.0) > SAME * step)
    segments = np.union1d(time, samples[is_new])
    counts = np.append(0, np.cumsum(np.ceil(np.diff(segments) / longest)))
    edges = np.interp(np.arange(counts[-1] + 1), counts, segments)
    first, last = np.zeros((2, len(edges) - 1, len(loads)))
    for c, load in enumerate(loads):
        first[:, c], last[:, c] = load.envelope(edges[:-1]), load.envelope(edges[1:], -1.0)
    return edges, np.isin(edges, time), first, last


@compiled
def _march(
    storeys: Array, damping: Array, pushes: Array, start: Array, edges: Array, is_node: Mask,
    first: Array, last: Array, kinds: Ints, values: Array, peaks: Array,
) -> tuple[int, float, int, float]:  # fmt: skip
    """Write values (T, m) and peaks within parts (m,); return status, time, storey, imbalance.

    `storeys` (7, n): mass, stiffness, softening by weight, hardening, yield drift, height, damping
    in N s/m that is lost while it yields; `damping` (n, n) without yielding, `pushes` (n, L) by
    loads, `start` (2n,); parts as of `load_parts`; `kinds` (m, 2): kinds and storeys. Accelerations
    lack the forces over the masses.
    """
    mass, k, softening, hardening, yield_drift, _, lost_damping = storeys
    n, inverse_mass = len(mass), 1 / mass
    # coefficients by powers of the fraction of a part: q, v, drifts
    series = np.zeros((3, n, MAX_TERMS + 1))
    load, rise, tangent, constant = np.zeros((4, n))
    q, v = start[:n].copy(), start[n:].copy()
    plastic, dissipated, direction = np.zeros((3, n))  # direction 0: elastic, ±1: yields
    for z in range(n):  # loaded in one direction before the start
        d = _drift(q, z)
        plastic[z] = d - min(max(d, -yield_drift[z]), yield_drift[z])
    before, works, node = _energy(storeys, q, v, plastic), np.zeros(2), 0
    elastic_damping, damping = damping, damping.copy()
    for e in range(len(edges)):
        if is_node[e]:
            _observe(kinds, storeys, damping, (q, v, plastic, dissipated), values[node])
            node += 1
        if e == len(edges) - 1:
            break
        h = edges[e + 1] - edges[e]
        for i in range(n):
            load[i] = rise[i] = 0.0
            for c in range(pushes.shape[1]):
                load[i] += mass[i] * pushes[i, c] * first[e, c]
                rise[i] += mass[i] * pushes[i, c] * (last[e, c] - first[e, c])
        for event in range(MAX_EVENTS + 1):  # h is what remains of the part
            for i in range(n):
                spring = direction[i] * yield_drift[i] if direction[i] != 0 else -plastic[i]
                constant[i] = (1 - hardening[i]) * k[i] * spring
                tangent[i] = (hardening[i] if direction[i] != 0 else 1.0) * k[i] - softening[i]
            terms = _expand(inverse_mass, damping, tangent, constant, load, rise, h, q, v, series)
            at, z = _first_event(series, terms, plastic, direction, yield_drift, hardening)
            _add_works(damping, load, rise, series, terms, at, h, works)
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
            if direction[z] != 0:
                direction[z] = 0.0
            elif softening[z] > 0 and hardening[z] * k[z] <= softening[z]:
                return COLLAPSED, edges[e + 1] - h, z, 0.0
            else:
                direction[z] = math.copysign(1.0, _drift(q, z) - plastic[z])
            damping[:] = elastic_damping  # forces jump with it, velocities do not
            for i in range(n):
                if direction[i] != 0:
                    damping[i, i] -= lost_damping[i]
                    if i:
                        damping[i - 1, i - 1] -= lost_damping[i]
                        damping[i, i - 1] += lost_damping[i]
                        damping[i - 1, i] += lost_damping[i]
            if event == MAX_EVENTS:
                return FAILED, edges[e + 1] - h, z, 0.0
    after, dissipation = _energy(storeys, q, v, plastic), works[1] + dissipated.sum()
    exchanged = abs(before) + abs(after) + abs(works[0]) + dissipation
    missing = before + works[0] - after - dissipation
    return RUNS, edges[-1], -1, missing / exchanged if exchanged > 0 else 0.0


@compiled
def _expand(
    inverse_mass: Array, damping: Array, tangent: Array, constant: Array, load: Array, rise: Array,
    h: float, q: Array, v: Array, series: Array,
) -> int:  # fmt: skip
    """Write coefficients of q, v and drifts by powers of τ/h; return their number.

    The storeys' net forces are tangent · drift + constant, loads load + rise τ/h.
    `series` has shape (3, n, powers).
    """
    Q, V, drifts = series
    n, scale, previous = len(q), 0.0, math.inf
    for i in range(n):
        Q[i, 0], V[i, 0] = q[i], v[i]
    for term in range(MAX_TERMS + 1):
        factor, size, below = h / (term + 1), 0.0, 0.0
        for i in range(n):
            drifts[i, term] = Q[i, term] - below
            below = Q[i, term]
            size += abs(Q[i, term]) + h * abs(V[i, term])
        scale = max(scale, size)
        if term == MAX_TERMS or (term > 1 and max(size, previous) <= TERM_ROUNDING * scale):
            return term + 1
        previous, above = size, 0.0
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
    hardening: Array,
) -> tuple[float, int]:  # fmt: skip
    """Return the fraction of the part at the first event, and its storey; 1 and −1 for none."""
    first, storey, drifts = 1.0, -1, series[2]
    margin = np.empty(terms)  # polynomial that is negative after the event
    for z in range(len(plastic)):
        elastic, variation, sign = drifts[z, 0] - plastic[z], 0.0, direction[z]
        for term in range(1, terms):
            variation += (term if sign != 0 else 1) * abs(drifts[z, term])
        if sign != 0:  # yields until the velocity of the drift has the other sign
            if 2 * sign * drifts[z, 1] > variation:
                continue
            for term in range(1, terms):
                margin[term - 1] = sign * term * drifts[z, term]
            margin[0] += EVENT_ROUNDING * variation
            at = _first_root(margin, terms - 1, first)
        elif abs(elastic) + variation < yield_drift[z] or hardening[z] == 1:
            continue
        else:
            at = first
            for side in (-1.0, 1.0):
                for term in range(terms):
                    margin[term] = -side * drifts[z, term]
                # a drift far above the yield drift rounds more than that: after a reversal no event
                rounding = EVENT_ROUNDING * yield_drift[z] + 4.5e-16 * abs(drifts[z, 0])
                margin[0] = yield_drift[z] + rounding - side * elastic
                at = min(at, _first_root(margin, terms, at))
        if at < first:
            first, storey = at, z
    return first, storey


@compiled
def _first_root(polynomial: Array, terms: int, end: float) -> float:
    """Return the first place in [0, end) from which on a polynomial is negative; 1 for none.

    Over an interval of width w it deviates from its chord by w²/8 times the largest second
    derivative, and its slope from the chord's by w/2 times that.
    """
    curvature = 0.0
    for term in range(2, terms):
        curvature += term * (term - 1) * abs(polynomial[term])
    low, width, left = 0.0, end, polynomial[0]
    while low < end and left >= 0:
        width = min(width, end - low)
        right = _value(polynomial, terms, low + width)
        if min(left, right) > curvature * width**2 / 8 or (width <= RESOLUTION and right >= 0):
            low, left, width = low + width, right, 2 * width
        elif width <= RESOLUTION or (right < 0 and right - left < -curvature * width**2 / 2):
            # Newton's steps, or halves where they leave the interval
            high, root = low + width, low + width * left / (left - right)
            while high - low > EVENT_ROUNDING:
                value, slope = polynomial[terms - 1], 0.0
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
    """Add the work of loads and what damping takes up to a fraction of a part, ∫ v·f dt."""
    n, V = len(load), series[1]
    points, weights = at * GAUSS_NODES, at * h * GAUSS_WEIGHTS
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
    """Return kinetic and stored energy, less the work of weights, in J."""
    total = 0.0
    for z in range(len(q)):
        mass, k, softening, a = storeys[:4, z]
        d = _drift(q, z)
        total += mass * v[z] ** 2 + (a * k - softening) * d**2 + (1 - a) * k * (d - plastic[z]) ** 2
    return total / 2


@compiled
def _drift(q: Array, z: int) -> float:
    """Return the drift of a storey, counted from 0."""
    return q[z] - q[z - 1] if z else q[z]


@compiled
def _add_peaks(
    kinds: Ints, storeys: Array, tangent: Array, constant: Array, series: Array, terms: int,
    end: float, q: Array, v: Array, peaks: Array,
) -> None:  # fmt: skip
    """Raise peaks (m,) of outputs by those within a part, at whose `end` the motion is q, v."""
    for row in range(len(kinds)):
        kind, z = kinds[row]
        if kind > DUCTILITY:
            continue
        polynomial = series[0, z] if kind == Q else series[2, z]
        x, velocity = (q[z], v[z]) if kind == Q else (_drift(q, z), _drift(v, z))
        scale, shift = 1.0, 0.0
        if kind == DUCTILITY:
            scale = 1 / storeys[4, z]
        elif kind == SHEAR:
            scale, shift = tangent[z] + storeys[2, z], constant[z]
        peaks[row] = max(peaks[row], abs(scale * x + shift))
        if polynomial[1] * velocity < 0:  # it turns
            reach, slope = abs(scale * polynomial[0] + shift), np.empty(terms - 1)
            for term in range(1, terms):
                slope[term - 1] = math.copysign(term, polynomial[1]) * polynomial[term]
                reach += abs(scale * polynomial[term])
            if reach > peaks[row]:
                stop = min(_first_root(slope, terms - 1, end), end)  # 1 where rounding decides
                turn = scale * _value(polynomial, terms, stop) + shift
                peaks[row] = max(peaks[row], abs(turn))


@compiled
def _observe(
    kinds: Ints, storeys: Array, damping: Array, state: tuple[Array, Array, Array, Array],
    values: Array,
) -> None:  # fmt: skip
    q, v, plastic, dissipated = state
    for row in range(len(kinds)):
        kind, z = kinds[row]
        mass, k, softening, hardening, yield_drift = storeys[:5, z]
        drift, offset_force = _drift(q, z), (1 - hardening) * k * plastic[z]
        force, moment = -_net_force(storeys, q, plastic, z), 0.0
        if z + 1 < len(q):
            force += _net_force(storeys, q, plastic, z + 1)
        for i in range(len(q)):
            force -= damping[z, i] * v[i]
            shear = _net_force(storeys, q, plastic, i) + storeys[2, i] * _drift(q, i)
            moment += storeys[5, i] * shear
        # drift in equilibrium without load, where storeys that yield back rest
        back = abs((1 - hardening) * k * yield_drift / (hardening * k - softening))
        residual = min(max(offset_force / (k - softening), -back), back)
        by_kind = (
            q[z], drift, k * drift - offset_force, drift / yield_drift,
            v[z], force / mass, residual, dissipated[z], moment,
        )  # fmt: skip
        values[row] = by_kind[kind]


@compiled
def _net_force(storeys: Array, q: Array, plastic: Array, z: int) -> float:
    """Return the force of a storey's columns less that of the weight."""
    _, k, softening, hardening = storeys[:4, z]
    return (k - softening) * _drift(q, z) - (1 - hardening) * k * plastic[z]


@compiled
def _value(polynomial: Array, terms: int, at: float) -> float:
    value = polynomial[terms - 1]
    for term in range(terms - 2, -1, -1):
        value = value * at + polynomial[term]
    return value
