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

from alphacut.frame.calculus.jet import Jet
from alphacut.frame.dynamics.flow import Flow, StepError
from alphacut.frame.dynamics.integrators import SAME, Exact, state_matrix
from alphacut.frame.structures.linear import evaluate, histories
from alphacut.frame.structures.loads import History
from alphacut.frame.structures.storey import StoreyFrame
from alphacut.fuzzy.arrays import Array, Mask
from alphacut.fuzzy.kernels import compiled
from alphacut.fuzzy.refused import RefusedError, require

MAX_PHASE = 1.0
"""Largest |λ| h of a part of a step: the series of exp(A h) then has no cancellation."""
MAX_TERMS = 24
"""Terms of the series: 1 / 24! is 2e-24; it mostly ends sooner."""
TERM_ROUNDING = 1e-17
"""Size of two terms in turn, as a fraction of the largest one, at which the series ends."""
EVENT_ROUNDING = 1e-13
"""Width in which an event is located, as a fraction of a part; and the same of the yield drift, or
of the velocity, by which it may be passed: so that a state just left is not met again at once."""
RESOLUTION = 2.0**-34
"""Shortest interval in which a double root is looked for: between its ends a polynomial is within
2⁻⁷¹ of its curvature of a straight line."""
TURN_ROUNDING = 1e-8
"""Width in which a peak is located: its value is as exact as the square of that."""
MAX_EVENTS = 1000
"""Events in a part of a step after which the motion has failed."""
MAX_IMBALANCE = 1e-9
"""Energy that may be missing at the end, as a fraction of all energies that were exchanged."""
MAX_NUMBERS = 4e6
"""Most numbers of states that are held at once: 32 MB."""
KINDS = ("q", "drift", "shear")
"""Outputs whose peaks are found between nodes, too."""
AT_NODES = ("v", "a", "residual")
RUNS, COLLAPSED, FAILED = 0, 1, 2


@dataclass(frozen=True, eq=False)
class YieldingFlow(Flow):
    """Exact trajectories of a storey frame with yielding columns.

    Dashpots, Rayleigh's damping and damping ratios are those of the initial stiffness.

    Raises:
        RefusedError: A force is harmonic or yields a storey before the start, or a storey yields
            whose tangent stiffness is then not positive under the weight.

    Example:
        >>> from alphacut.frame import StoreyFrame
        >>> frame = StoreyFrame(masses=[1e3], stiffness=[4e4], v0=[1.0], yield_drift=[0.05])
        >>> flow = YieldingFlow(frame, ("dy1",), duration=0.5, step=0.25)
        >>> flow.values([[0.05]])[0, :, 0].round(4).tolist()
        [0.0, 0.1993, 0.2744]
    """

    system: StoreyFrame

    def __post_init__(self) -> None:
        super().__post_init__()
        require(bool(self.system.hardening), "frame", value="elastic", allowed="columns that yield")
        for history in histories(self.system).values():
            value, allowed = "harmonic, on columns that yield", "loads linear between samples"
            require(not history.frequency, "load", value=value, allowed=allowed)

    @property
    def method(self) -> str:
        """Name of the time stepping: steps only say where the exact motion is read."""
        return Exact.name

    def finer(self) -> tuple[YieldingFlow, int]:
        """Return the flow with a quarter of the step, and 4."""
        return replace(self, step=self.step / 4), 4

    def deviations(self, points: Array) -> tuple[Array, Array]:
        """Return trajectories at points (S, d), and zeros of the same shape."""
        values = self.values(points)
        return values, np.zeros_like(values)

    def _march(self, points: Array, *, derivatives: bool) -> Jet:
        """Trajectories at points (S, d), shape (S, T, m); they have no derivatives."""
        if derivatives:
            allowed = "methods without derivatives: auto or quasi-monte-carlo"
            raise RefusedError("method", "a follower or a proof, of columns that yield", allowed)
        points = np.asarray(points, float)
        per_motion = 4 * self.system.floors * len(self.time)
        chunks = np.array_split(points, -(-len(points) * per_motion // int(MAX_NUMBERS)) or 1)
        motions = [self.values_and_peaks(chunk)[0] for chunk in chunks]
        return Jet.constant(np.concatenate(motions), 0)

    def values_and_peaks(self, points: Array) -> tuple[Array, Array]:
        """Return trajectories (S, T, m) at points (S, d), and their largest magnitudes (S, m).

        These are largest over time, of outputs of the kinds `AT_NODES` at the nodes.
        """
        system, n = self.system, self.system.floors
        matrices, _ = evaluate(system, self.names, points, derivatives=False)
        named = {**system.parameters, **dict(zip(self.names, points.T, strict=True))}
        p = {x: Jet.constant(np.zeros(len(points)) + y, 0) for x, y in named.items()}
        properties = [matrices.mass.value.diagonal(axis1=1, axis2=2), system.springs(p).value]
        properties.append(system.softening(p).value if system.gravity else 0 * properties[1])
        properties += [system.hardenings(p).value, system.yield_drifts(p).value]
        storeys = np.ascontiguousarray(np.stack(properties, 1))  # (S, 5, n)
        start = matrices.start.value[..., 0]
        drift0 = np.diff(start[:, :n], prepend=0.0)
        if matrices.static is not None and (np.abs(drift0) > storeys[:, 4]).any():
            allowed = "forces under which no storey yields before the start"
            raise RefusedError("load", "static, and yields a storey", allowed)
        loads = list(histories(system).values())
        pushes = matrices.pushes(ground=system.ground is not None).value
        fastest = float(np.abs(np.linalg.eigvals(state_matrix(matrices).value)).max())
        parts = load_parts(loads, self.time, MAX_PHASE / max(fastest, 1e-300))
        states = np.empty((len(points), len(self.time), 4 * n))
        peaks, ends = np.zeros((len(points), 3, n)), np.zeros((len(points), 4))
        damping = np.ascontiguousarray(matrices.damping.value)
        pushes = np.ascontiguousarray(pushes)
        _march(storeys, damping, pushes, start, *parts, states, peaks, ends)
        self._require_motions(points, ends)
        values = self._observed(damping, pushes, loads, storeys, states)
        largest = np.abs(values).max(1)
        for row, (kind, z) in enumerate(map(self.system.quantity, self.outputs)):
            if kind in KINDS:
                largest[:, row] = peaks[:, KINDS.index(kind), z]
            elif kind == "ductility":
                largest[:, row] = peaks[:, KINDS.index("drift"), z] / storeys[:, 4, z]
        return values, largest

    def _require_motions(self, points: Array, ends: Array) -> None:
        """Refuse motions that collapse, whose events do not end or whose energy is not balanced.

        `ends` (S, 4) are status, time, storey and imbalance of energy of each.
        """
        for row, status in enumerate(ends[:, 0]):
            time, storey, imbalance = (float(ends[row, x]) for x in (1, 2, 3))
            if status == COLLAPSED:
                where = self._point_words(points[row])
                value = f"collapses under its weight at t = {time:.6g} s at {where}"
                allowed = "hardening times stiffness above weight over height where it yields"
                cure = "take more hardening, a larger yield force or a weaker load"
                raise RefusedError(f"storey {storey + 1:g}", value, allowed, cure)
            if status == FAILED:
                what = f"more than {MAX_EVENTS} events in a step at t = {time:.6g} s"
                raise StepError(what, "take a smaller step or a larger yield force")
            if not abs(imbalance) <= MAX_IMBALANCE:
                what = f"energy is missing at the end of a motion, {imbalance:.2g} of it"
                raise StepError(what, "take a smaller step, or parameters where the motion exists")

    def _observed(
        self, damping: Array, pushes: Array, loads: Sequence[History], storeys: Array, states: Array
    ) -> Array:
        """Outputs (S, T, m) of states (S, T, 4n): q, v, plastic drifts and dissipated energies."""
        n = self.system.floors
        mass, k, softening, hardening, yield_drift = (storeys[:, None, x] for x in range(5))
        q, v, plastic, dissipated = (states[..., x * n : (x + 1) * n] for x in range(4))
        drift = np.diff(q, prepend=0.0)
        shear = k * drift - (1 - hardening) * k * plastic
        # drift in equilibrium without load; storeys that would yield back rest where they do
        unloaded = k - softening
        with np.errstate(divide="ignore"):
            back = np.abs((1 - hardening) * k * yield_drift / (hardening * k - softening))
        residual = np.clip((1 - hardening) * k * plastic / unloaded, -back, back)
        net_force = shear - softening * drift
        acceleration = np.diff(net_force, append=0.0) - np.einsum("sij,stj->sti", damping, v)
        acceleration /= mass
        for c, load in enumerate(loads):
            if load is not self.system.ground:  # absolute ones do not contain the ground's
                acceleration += load.values(self.time)[:, None] * pushes[:, None, :, c]
        by_kind = {
            "q": q, "v": v, "a": acceleration, "drift": drift, "shear": shear,
            "residual": residual, "ductility": drift / yield_drift, "dissipated": dissipated,
        }  # fmt: skip
        quantities = map(self.system.quantity, self.outputs)
        return np.stack([by_kind[kind][..., z] for kind, z in quantities], -1)


def load_parts(
    loads: Sequence[History], time: Array, longest: float
) -> tuple[Array, Mask, Array, Array]:
    """Return times (E + 1,) between which L loads are linear, and their values there.

    The times are the nodes, all samples, and others so that no part is longer than `longest`.
    Which are nodes comes second, then the values at the beginning and at the end of each part,
    shape (E, L), between jumps.
    """
    step = time[1]
    samples = [load.start + np.arange(len(load.samples)) * load.step for load in loads]
    inner = np.unique(np.concatenate([np.zeros(0), *samples]))
    inner = inner[(inner > 0) & (inner < time[-1])]
    inner = inner[np.abs(inner - np.round(inner / step) * step) > SAME * step]
    inner = inner[np.diff(inner, prepend=-1.0) > SAME * step]
    edges = np.sort(np.concatenate([time, inner]))
    counts = np.ceil(np.diff(edges) / longest).astype(int)
    segment = np.repeat(np.arange(len(counts)), counts)  # of each part
    number = np.arange(len(segment)) - np.repeat(np.cumsum(counts) - counts, counts)
    share = np.stack([number, number + 1]) / counts[segment]
    first, last = np.zeros((2, len(segment), len(loads)))
    for c, load in enumerate(loads):
        ends = load.envelope(edges[:-1])[segment], load.envelope(edges[1:], -1.0)[segment]
        first[:, c], last[:, c] = ends[0] + share * (ends[1] - ends[0])
    is_node = np.append(True, (number + 1 == counts[segment]) & np.isin(edges, time)[segment + 1])
    times = edges[:-1][segment] + share[0] * np.diff(edges)[segment]
    return np.append(times, edges[-1]), is_node, first, last


@compiled
def _march(
    storeys: Array, damping: Array, pushes: Array, start: Array, edges: Array, is_node: Mask,
    first: Array, last: Array, states: Array, peaks: Array, ends: Array,
) -> None:  # fmt: skip
    """Write states (S, T, 4n), peaks (S, 3, n) and ends (S, 4): status, time, storey, imbalance.

    Peaks are the largest magnitudes of displacements, drifts and shears.

    `storeys` (S, 5, n): mass, stiffness, softening by weight, hardening, yield drift; `damping`
    (S, n, n) in N s/m, `pushes` (S, n, L) by loads, `start` (S, 2n); parts as of `load_parts`.
    """
    n, n_loads = storeys.shape[2], pushes.shape[2]
    # coefficients by powers of the fraction of a part: q, v, drifts, damping forces
    series = np.zeros((4, n, MAX_TERMS + 1))
    load, rise, tangent, constant = np.zeros((4, n))
    for s in range(len(storeys)):
        mass, k, softening, hardening, yield_drift = storeys[s]
        q, v = start[s, :n].copy(), start[s, n:].copy()
        plastic, dissipated, direction = np.zeros((3, n))  # direction 0: elastic, ±1: yields
        for z in range(n):  # loaded in one direction before the start
            d = _drift(q, z)
            plastic[z] = d - min(max(d, -yield_drift[z]), yield_drift[z])
        before, works, node = _energy(storeys[s], q, v, plastic), np.zeros(2), 1
        states[s, 0] = np.concatenate((q, v, plastic, dissipated))
        for e in range(len(edges) - 1):
            length, begun = edges[e + 1] - edges[e], 0.0  # fraction of the part that is done
            for event in range(MAX_EVENTS + 1):
                for i in range(n):
                    load[i] = rise[i] = 0.0
                    for c in range(n_loads):
                        change = last[e, c] - first[e, c]
                        load[i] += pushes[s, i, c] * (first[e, c] + begun * change)
                        rise[i] += pushes[s, i, c] * (1 - begun) * change
                    spring = direction[i] * yield_drift[i] if direction[i] != 0 else -plastic[i]
                    constant[i] = (1 - hardening[i]) * k[i] * spring
                    tangent[i] = (hardening[i] if direction[i] != 0 else 1.0) * k[i] - softening[i]
                h = length * (1 - begun)
                terms = _expand(mass, damping[s], tangent, constant, load, rise, h, q, v, series)
                at, z = _first_event(series, terms, plastic, direction, yield_drift, hardening)
                _add_works(mass, load, rise, series, terms, at, h, works)
                _add_peaks(series, terms, at, tangent + softening, constant, peaks[s])
                for i in range(n):
                    q[i] = _value(series[0, i], terms, at)
                    v[i] = _value(series[1, i], terms, at)
                    if direction[i] != 0:
                        flow = _drift(q, i) - direction[i] * yield_drift[i] - plastic[i]
                        plastic[i] += flow
                        force = (1 - hardening[i]) * k[i] * yield_drift[i]
                        dissipated[i] += force * abs(flow)
                begun += at * (1 - begun)
                if z < 0 or begun >= 1:
                    break
                if direction[z] != 0:
                    direction[z] = 0.0
                else:
                    direction[z] = math.copysign(1.0, _drift(q, z) - plastic[z])
                    if softening[z] > 0 and hardening[z] * k[z] <= softening[z]:
                        ends[s, 0] = COLLAPSED
                if event == MAX_EVENTS:
                    ends[s, 0] = FAILED
                if ends[s, 0] != RUNS:
                    ends[s, 1], ends[s, 2] = edges[e] + length * begun, z
                    break
            if ends[s, 0] != RUNS:
                break
            if is_node[e + 1]:
                states[s, node] = np.concatenate((q, v, plastic, dissipated))
                node += 1
        after, spent = _energy(storeys[s], q, v, plastic), works[1] + dissipated.sum()
        exchanged = abs(before) + abs(after) + abs(works[0]) + spent
        if exchanged > 0:
            ends[s, 3] = (before + works[0] - after - spent) / exchanged


@compiled
def _expand(
    mass: Array, damping: Array, tangent: Array, constant: Array, load: Array, rise: Array,
    h: float, q: Array, v: Array, series: Array,
) -> int:  # fmt: skip
    """Write coefficients of q, v, drifts and damping forces by powers of τ/h; return their number.

    The storeys' net forces are tangent · drift + constant, accelerations by loads load + rise τ/h.
    `series` has shape (4, n, powers).
    """
    Q, V, drifts, resistance = series
    n, scale, previous = len(q), 0.0, math.inf
    for i in range(n):
        Q[i, 0], V[i, 0] = q[i], v[i]
        scale = max(scale, abs(q[i]), h * abs(v[i]))
    for term in range(MAX_TERMS + 1):
        factor, size = h / (term + 1), 0.0
        for i in range(n):
            drifts[i, term] = Q[i, term] - Q[i - 1, term] if i else Q[i, term]
            total = 0.0
            for j in range(n):
                total += damping[i, j] * V[j, term]
            resistance[i, term] = total
            size = max(size, abs(Q[i, term]), h * abs(V[i, term]))
        scale = max(scale, size)
        if term == MAX_TERMS or (term > 1 and max(size, previous) <= TERM_ROUNDING * scale):
            return term + 1
        previous = size
        for i in range(n):
            force = -tangent[i] * drifts[i, term] - resistance[i, term]
            if i + 1 < n:
                force += tangent[i + 1] * drifts[i + 1, term]
            if term == 0:
                force += (constant[i + 1] if i + 1 < n else 0.0) - constant[i] + mass[i] * load[i]
            elif term == 1:
                force += mass[i] * rise[i]
            Q[i, term + 1] = factor * V[i, term]
            V[i, term + 1] = factor * force / mass[i]
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
        stretch, variation = drifts[z, 0] - plastic[z], 0.0
        if direction[z] == 0:
            for term in range(1, terms):
                variation += abs(drifts[z, term])
            if abs(stretch) + variation < yield_drift[z] or hardening[z] == 1:
                continue
            for sign in (-1.0, 1.0):
                margin[0] = yield_drift[z] * (1 + EVENT_ROUNDING) - sign * stretch
                for term in range(1, terms):
                    margin[term] = -sign * drifts[z, term]
                at = _first_root(margin, terms, first)
                if at < first:
                    first, storey = at, z
        else:  # yields until the velocity of the drift has the other sign
            for term in range(1, terms):
                margin[term - 1] = direction[z] * term * drifts[z, term]
                variation += abs(margin[term - 1])
            if 2 * margin[0] > variation:
                continue
            margin[0] += EVENT_ROUNDING * variation
            at = _first_root(margin, terms - 1, first)
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
            high = low + width
            while high - low > EVENT_ROUNDING:
                middle = (low + high) / 2
                if _value(polynomial, terms, middle) >= 0:
                    low = middle
                else:
                    high = middle
            return high
        else:
            width /= 2
    return low if left < 0 else 1.0


@compiled
def _add_works(
    mass: Array, load: Array, rise: Array, series: Array, terms: int, at: float, h: float,
    works: Array,
) -> None:  # fmt: skip
    """Add the work of loads and what damping takes up to a fraction of a part, ∫ v·f dt."""
    # products of powers above the last one are rounding, too: 2^terms of it at most
    V, resistance, power = series[1], series[3], h
    for term in range(terms):
        power *= at
        damped, pushed = 0.0, 0.0
        for i in range(len(mass)):
            for k in range(term + 1):
                damped += V[i, k] * resistance[i, term - k]
            pushed += mass[i] * load[i] * V[i, term]
            if term:
                pushed += mass[i] * rise[i] * V[i, term - 1]
        works[0] += pushed * power / (term + 1)
        works[1] += damped * power / (term + 1)


@compiled
def _energy(storeys: Array, q: Array, v: Array, plastic: Array) -> float:
    """Return kinetic and stored energy, less the work of weights, in J."""
    total = 0.0
    for z in range(len(q)):
        mass, k, softening, a, _ = storeys[:, z]
        d = _drift(q, z)
        total += mass * v[z] ** 2 + (a * k - softening) * d**2 + (1 - a) * k * (d - plastic[z]) ** 2
    return total / 2


@compiled
def _drift(q: Array, z: int) -> float:
    """Return the drift of a storey, counted from 0."""
    return q[z] - q[z - 1] if z else q[z]


@compiled
def _add_peaks(
    series: Array, terms: int, end: float, stiffness: Array, constant: Array, peaks: Array
) -> None:
    """Raise largest magnitudes of q, drifts and shears (3, n) by those up to `end` of a part."""
    for i in range(len(constant)):
        shift, stretch = 0.0, 0.0  # bounds of how far q and the drift move from their start
        for term in range(1, terms):
            shift += abs(series[0, i, term])
            stretch += abs(series[2, i, term])
        if abs(series[0, i, 0]) + shift > peaks[0, i]:
            for place in (0.0, _turn(series[0, i], terms, end), end):
                peaks[0, i] = max(peaks[0, i], abs(_value(series[0, i], terms, place)))
        force = abs(stiffness[i] * series[2, i, 0] + constant[i]) + stiffness[i] * stretch
        if abs(series[2, i, 0]) + stretch > peaks[1, i] or force > peaks[2, i]:
            for place in (0.0, _turn(series[2, i], terms, end), end):
                drift = _value(series[2, i], terms, place)
                peaks[1, i] = max(peaks[1, i], abs(drift))
                peaks[2, i] = max(peaks[2, i], abs(stiffness[i] * drift + constant[i]))


@compiled
def _turn(polynomial: Array, terms: int, end: float) -> float:
    """Return where a polynomial's slope changes its sign between 0 and `end`, else `end`."""
    low, high, middle = 0.0, end, end
    while high - low > TURN_ROUNDING:
        slope = 0.0
        for term in range(terms - 1, 0, -1):
            slope = slope * middle + term * polynomial[term]
        if polynomial[1] * slope < 0:
            high = middle
        elif middle == end:
            return end
        else:
            low = middle
        middle = (low + high) / 2
    return middle


@compiled
def _value(polynomial: Array, terms: int, at: float) -> float:
    """Return the value of a polynomial by Horner's rule."""
    value = polynomial[terms - 1]
    for term in range(terms - 2, -1, -1):
        value = value * at + polynomial[term]
    return value
