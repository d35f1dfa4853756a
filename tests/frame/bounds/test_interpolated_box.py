"""Boxes of frames with one yielding storey: motions stay inside, and the bounds are close."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.polynomial import Polynomial
from numpy.polynomial.chebyshev import chebvander

from alphacut.frame import Accelerogram, StoreyFrame
from alphacut.frame.bounds.interpolated_box import InterpolatedFrame, _start_error
from alphacut.frame.bounds.interpolated_defects import (
    BoxModel,
    _elastic_violations,
    _loads_over_inputs,
    defects,
    interpolate,
)
from alphacut.frame.calculus.interpolation import chebyshev_matrix, grid
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.dynamics.yielding import YieldingFlow


def isolated_building(rng, storeys, **changes):
    """A building of elastic storeys on an isolator of a random period under a random record."""
    floors = storeys + 1
    stiffness = 4e4 * floors * (2 * np.pi / float(rng.uniform(0.4, 1.0))) ** 2
    samples = 4 * rng.normal(size=10).repeat(3) + rng.normal(size=30)
    frame = StoreyFrame(
        masses=[4e4] * floors,
        stiffness=[stiffness] + [10 * stiffness] * storeys,
        lengths=[10.0] * floors,
        rayleigh=(0.1, 1e-3),
        dampers=[1e4] * floors,
        damper_placement="storey",
        yield_force=[4e4 * floors * float(rng.uniform(0.5, 1.0))] + [1e9] * storeys,
        hardening=[float(rng.uniform(0.05, 0.2))] + [1.0] * storeys,
        ground=Accelerogram(0.05, samples),
        outputs=("q1", "v1", "a1", "base_shear", "residual1", f"drift{floors}", f"a{floors}"),
    )
    return replace(frame, **changes)


def compared(frame, names, radius, rng):
    """Bounds over a box of inputs, and values and peaks of motions in it."""
    flow = YieldingFlow(frame, names, 1.5, 0.05)
    nominal = np.array([frame.parameters[name] for name in names])
    low, high = nominal * (1 - radius), nominal * (1 + radius)
    found = InterpolatedFrame(flow, np.arange(len(names))).bounds(low, high)
    points = np.vstack([low, high, rng.uniform(low, high, (40, len(names)))])
    return found, *flow.values_and_peaks(points)


@pytest.mark.parametrize(
    ("names", "changes"),
    [
        (("k1",), {}),
        (("k1", "fy1"), {"gravity": 1.0}),
        (("fy1", "m2"), {"damping_ratio": 0.03}),
        (("k1",), {"damping_ratio": 0.03}),
        (("fy1",), {"hardening": [0.0, 1.0]}),
    ],
)
def test_motions_of_an_isolated_building_stay_inside_close_bounds(names, changes, rng):
    for radius in (1e-4, 0.01):
        frame = isolated_building(rng, 1, **changes)
        found, values, peaks = compared(frame, names, radius, rng)
        if not np.isfinite(found.peaks).all():
            assert radius > 1e-3
            continue
        scale = np.abs(values).max(axis=(0, 1)) + 1e-12
        assert (values <= found.upper[..., 1] + 1e-9 * scale).all()
        assert (-values <= found.upper[..., 0] + 1e-9 * scale).all()
        assert (peaks <= found.peaks.max(axis=1) * (1 + 1e-9)).all()
        if radius == 1e-4 and found.error < 1e-3:
            assert found.peaks.max(axis=1)[0] <= 1.01 * peaks.max(axis=0)[0]


@pytest.mark.parametrize("ratio", [1.0, 10.0, 100.0, 1000.0])
def test_stiff_storeys_widen_no_bounds_of_a_single_motion(ratio):
    rng = np.random.default_rng(1)
    frame = isolated_building(rng, 1)
    k = frame.stiffness[0]
    frame = replace(frame, stiffness=[k, ratio * k], rayleigh=(0.1, 0.0))
    found, _, peaks = compared(frame, ("k1",), 1e-9, rng)
    assert found.peaks.max(axis=1)[0] <= 1.0001 * peaks.max(axis=0)[0]


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"hardening": [0.1, 0.1]}, "one storey"),
        ({"rayleigh_of": "tangent"}, "tangent"),
        ({"gravity": 9.81, "hardening": [0.0, 1.0]}, "negative"),
    ],
)
def test_what_is_not_proved_is_refused(changes, words, rng):
    with pytest.raises(UnprovedError, match=words):
        compared(isolated_building(rng, 1, **changes), ("k1",), 0.01, rng)


def norms_and_bounds(frame, radius, inputs):
    """S of the difference to exact motions at time nodes over k1 in [−1, 1], and bounds; (s, T)."""
    flow = YieldingFlow(
        replace(frame, outputs=("q1", "q2", "v1", "v2", "shear1")), ("k1",), 2, 0.05
    )
    box = InterpolatedFrame(flow, np.arange(1))
    k = frame.parameters["k1"] * (1 + radius * inputs)
    model, _ = box._model(*frame.parameters["k1"] * (1 + radius * np.array([[-1], [1]])))
    elements, _ = box._motions(model, None)
    if elements is None:  # the box is too wide for one order of events
        return np.zeros(1), np.zeros(1), 1.0
    interpolant = interpolate(model, elements, slice(None), with_rates=False)
    if interpolant is None:  # or for the times of its elements
        return np.zeros(1), np.zeros(1), 1.0
    missed = defects(interpolant)
    bounds = (missed.growth[:, np.newaxis] + missed.violation).cumsum(axis=0)
    coarse, fine = (chebvander(inputs, n) @ chebyshev_matrix(n) for n in (model.degree, model.fine))
    mass = np.array(frame.masses)
    a, force = frame.hardening[0], model.grid.force[0]
    found = np.zeros((2, len(k), len(flow.time)))
    for s, exact in enumerate(flow.values(k[:, np.newaxis])):
        weights = coarse[s]
        damping = model.grid.damping @ fine[s]
        begin, length = elements.begin @ weights, elements.length @ weights
        for node, t in enumerate(flow.time[1:-1], 1):
            e = np.searchsorted(begin, t, side="right") - 1
            powers = ((t - begin[e]) / length[e]) ** np.arange(elements.terms[e])
            state = powers @ (elements.series[e, : len(powers)] @ weights)
            loads = box.loads[0]
            i = np.searchsorted(loads.edges, t + 1e-9, side="right") - 1
            cubic = np.polynomial.Polynomial(loads.powers[i, 0])
            q = state[:2] - cubic(t - loads.edges[i])
            v = (state[2:] - damping @ q) / mass - cubic.deriv()(t - loads.edges[i])
            slider = elements.phase[e] * force
            if not elements.phase[e]:
                slider = (1 - a) * k[s] * q[0] - elements.constant[e] @ weights
            true = exact[node, 4] - a * k[s] * exact[node, 0]
            off = np.append(q, v) - exact[node, :4]
            stiffness = np.array([a * k[s], frame.stiffness[1]])
            squared = mass @ off[2:] ** 2 + stiffness @ np.diff(off[:2], prepend=0) ** 2
            squared += (np.clip(slider, -force, force) - true) ** 2 / ((1 - a) * k[s])
            found[:, s, node] = np.sqrt(squared), bounds[e, min(int((inputs[s] + 1) * 4), 7)]
    energy = mass @ np.abs(exact[:, 2:4]).max(axis=0) ** 2
    return *found, np.sqrt(energy)


def test_the_difference_to_exact_motions_is_below_its_bound(rng):
    inputs = np.append(rng.uniform(-1, 1, 6), [-1, 1])
    for radius in (0.01, 0.02, 0.02, 0.05):
        frame = isolated_building(rng, 1)
        elastic = replace(frame, yield_force=[1e9] * 2)
        for which, width in ((frame, radius), (elastic, 0.3)):
            norm, bound, scale = norms_and_bounds(which, width, inputs)
            assert (norm <= bound + 1e-8 * scale).all()


def test_what_kinematics_miss_is_below_its_bound(rng):
    """∫ |q̇₁ − v₁| dt of each element without dampers, at inputs between the nodes."""
    inputs = np.append(rng.uniform(-1, 1, 6), [-1, 1])
    points, weights = np.polynomial.legendre.leggauss(24)
    powers = ((points[:, np.newaxis] + 1) / 2) ** np.arange(40)
    undamped = {"dampers": [0.0, 0.0], "rayleigh": (0.0, 0.0)}
    for hardening in (0.0, 0.1, 0.2):
        frame = isolated_building(rng, 1, hardening=[hardening, 1.0], **undamped)
        box = InterpolatedFrame(YieldingFlow(frame, ("k1",), 2, 0.05), np.arange(1))
        ends = frame.parameters["k1"] * (1 + 0.02 * np.array([[-1], [1]]))
        model, _ = box._model(*ends)
        elements, _ = box._motions(model, None)
        if elements is None:  # the box is too wide for one order of events
            continue
        found = interpolate(model, elements, slice(None), with_rates=False)
        if found is None:  # or for the times of its elements
            continue
        missed = defects(found).drift
        order = np.arange(1, found.terms)[:, np.newaxis]
        for y in chebvander(inputs, model.fine) @ chebyshev_matrix(model.fine):
            speed = powers[:, : found.terms - 1] @ (order * (found.displacement[:, 1:, 0] @ y).T)
            momentum = powers[:, : found.terms] @ (found.momentum[:, :, 0] @ y).T
            missing = np.abs(speed - (found.length @ y) * momentum / frame.masses[0])
            true = weights @ missing / 2
            assert (true <= missed + 1e-14 * np.abs(speed).max()).all()


def test_what_interpolated_loads_miss_is_below_its_bound(rng):
    nodes = grid(1, 3)[:, 0]
    begin, length = 0.3 * nodes, 0.4 + 0.1 * nodes
    load = Polynomial(rng.normal(size=8))
    span, model = np.array([[0.0, 1.0]]), SimpleNamespace(inputs=1, degree=3)
    series, missed, variation = _loads_over_inputs(
        model, begin[np.newaxis], length[np.newaxis], span, load.coef[np.newaxis, np.newaxis]
    )
    inputs, fractions = np.linspace(-1, 1, 201), np.linspace(0, 1, 101)
    of_nodes = chebvander(inputs, 3) @ chebyshev_matrix(3)
    off, change = [], []
    for start, extent, powers in zip(
        of_nodes @ begin, of_nodes @ length, of_nodes @ series[0, :, 0].T, strict=True
    ):
        found, time = Polynomial(powers), start + fractions * extent
        off.append(np.abs(load(time) - found(fractions)).max())
        change.append(np.abs(extent * load.deriv()(time) - found.deriv()(fractions)).max())
    assert max(off) <= missed[0, 0] <= 10 * max(off)
    assert max(change) <= variation[0, 0] <= 20 * max(change)


@pytest.mark.parametrize("names", [("k1",), ("k1", "fy1")])
def test_bounds_on_the_coarse_grid_are_those_on_the_fine_one(names, monkeypatch):
    """Most elements have one length at all inputs; their polynomials are exact on either grid."""
    coarse, *_ = compared(
        isolated_building(np.random.default_rng(1), 1), names, 0.04, np.random.default_rng(2)
    )
    monkeypatch.setattr(BoxModel, "fixed", property(lambda model: model))
    fine, *_ = compared(
        isolated_building(np.random.default_rng(1), 1), names, 0.04, np.random.default_rng(2)
    )
    assert np.isfinite(fine.peaks).all()
    assert coarse.peaks == pytest.approx(fine.peaks, rel=1e-9)
    assert coarse.upper == pytest.approx(fine.upper, rel=1e-9, abs=1e-12 * fine.upper.max())


def just_yielding(rng):
    """A building that moves freely and reaches its yield drift at its first peak; when, and this."""
    still = Accelerogram(0.05, np.zeros(30))
    frame = isolated_building(rng, 1, outputs=("q1",), ground=still, v0=[0.5] * 2)
    frame = replace(frame, yield_force=[1e9] * 2)
    k = frame.stiffness[0]
    motion = np.abs(YieldingFlow(frame, ("k1",), 1.0, 0.01).values(np.array([[k]]))[0, :, 0])
    peak = int(motion.argmax())
    frame = replace(frame, yield_force=[float(k * motion[peak]), 1e9])
    return frame, 0.01 * peak, motion[peak]


def test_an_event_behind_the_end_of_only_some_motions_does_not_count(rng):
    # Free motions reach the yield drift at their first peak, or do not, just behind the end.
    frame, time, drift = just_yielding(rng)
    k = np.array([frame.stiffness[0]])
    flow = YieldingFlow(frame, ("k1",), 0.01 * round(80 * time), 0.01)
    box = InterpolatedFrame(flow, np.arange(1))
    found = box.bounds(0.99 * k, 1.01 * k, np.full((len(flow.time), 1), 1e-9))
    assert found.error < 1e-3 * np.sqrt(k[0]) * drift


@pytest.mark.parametrize("names", [("k1", "fy1"), ("fy1", "k1")])
def test_the_input_that_decides_whether_a_storey_yields_is_named(names, rng):
    frame, time, _ = just_yielding(rng)
    flow = YieldingFlow(frame, names, time + 0.2, 0.01)
    centre = np.array([frame.parameters[x] for x in names])
    radius = centre * [{"k1": 1e-6, "fy1": 0.3}[x] for x in names]
    allowed = np.full((len(flow.time), 1), 1e-9)
    found = InterpolatedFrame(flow, np.arange(2)).bounds(centre - radius, centre + radius, allowed)
    assert found.axis == names.index("fy1")


def crisp_motion(rng):
    """The motion of a frame without uncertain inputs: model and elements."""
    frame = isolated_building(rng, 1)
    flow = YieldingFlow(frame, ("k1",), 1.5, 0.05)
    box = InterpolatedFrame(flow, np.arange(0))
    point = np.array([frame.parameters["k1"]])
    model, _ = box._model(point, point)
    return model, box._motions(model, None)[0]


def defects_of(model, elements):
    interpolant = interpolate(model, elements, slice(None), with_rates=False)
    return interpolant, defects(interpolant)


def test_a_defect_that_is_put_into_a_motion_is_counted_in_full(rng):
    model, elements = crisp_motion(rng)
    slider, mass = model.high.slider, model.high.mass
    drift = np.sqrt(model.grid.stiffness[:, 0] + slider * np.array([1, 0]))
    by_floor = np.append(np.hypot(drift, np.append(drift[1:], 0)), 1 / np.sqrt(mass))
    e = int(rng.integers(len(elements.phase)))
    for row, norm in enumerate(by_floor):  # velocities of X, then those of P
        series = elements.series.copy()
        series[e, 1, row] += 1e-3
        _, missed = defects_of(model, elements._replace(series=series))
        assert missed.growth[e] >= 0.999e-3 * norm, row
    for e in np.flatnonzero((elements.event != 0) & (elements.phase == 0)):
        constant = elements.constant.copy()
        jump = 1e-5 * float(model.grid.force[0])  # far above what the events miss
        constant[e] += jump
        _, missed = defects_of(model, elements._replace(constant=constant))
        assert missed.growth[e] >= 0.99 * jump / np.sqrt(slider)


def test_what_a_slider_falls_back_from_beyond_its_yield_force_is_counted_in_full(rng):
    model, elements = crisp_motion(rng)
    force = 0.7 * model.grid.force
    grid = model.grid._replace(force=force)
    model = replace(model, grid=grid, low=model.low._replace(force=force[0]))
    interpolant, missed = defects_of(model, elements)
    times = np.linspace(0, 1, 2001)
    for e in np.flatnonzero(elements.phase == 0):
        values = np.polynomial.polynomial.polyval(times, interpolant.elastic_force[e, :, 0])
        beyond = np.maximum(np.abs(values) - force[0], 0)
        fall = np.maximum(-np.diff(beyond), 0).sum()
        assert missed.violation[e].max() >= 0.999 * fall / np.sqrt(model.high.slider)
        assert missed.beyond[e].max() >= 0.999 * beyond.max()


def test_what_passes_the_yield_force_between_samples_is_counted(rng):
    # The force rises and falls several times within an element, beyond a level that it keeps at
    # equally spaced times.
    model, _ = crisp_motion(rng)
    force = float(model.grid.force[0])
    roots = np.linspace(0, 1, int(rng.integers(3, 7)))
    powers = np.polynomial.polynomial.polyfromroots(roots)
    times = np.linspace(0, 1, 2001)
    shape = np.polynomial.polynomial.polyval(times, powers)
    size = float(rng.uniform(1e-6, 0.5)) * force / np.abs(shape).max()
    powers = size * powers + force * (np.arange(len(powers)) == 0)
    found = _elastic_violations(model, powers[np.newaxis, :, np.newaxis], *np.zeros((2, 1)), 0.0)
    beyond = np.maximum(size * shape, 0)
    fall = np.maximum(-np.diff(beyond), 0).sum()
    assert fall * (1 - 1e-6) <= found.falls.max() <= 1.5 * fall
    assert found.most.max() >= beyond.max() * (1 - 1e-6)


def test_what_passes_the_yield_force_between_grid_points_of_an_input_is_counted(rng):
    frame = isolated_building(rng, 1)
    box = InterpolatedFrame(YieldingFlow(frame, ("k1",), 1.5, 0.05), np.arange(1))
    model, _ = box._model(*frame.parameters["k1"] * (1 + 1e-5 * np.array([[-1], [1]])))
    points = grid(1, model.fine)[:, 0]
    neighbours = np.sort(points)[int(rng.integers(len(points) - 1)) :][:2]
    middle = neighbours.mean()
    radius = 0.4 * np.ptp(neighbours)
    # The force is beyond within this radius alone, and nowhere beyond on the other side.
    most = radius**2 / 4
    excess = most * (1 - ((points - middle) / radius) ** 2)
    assert (np.abs(excess + 1) < 1).all()
    force = model.grid.force * (1 + excess)
    powers = np.stack([force, np.zeros_like(force)])[np.newaxis]
    found = _elastic_violations(model, powers, *np.zeros((2, 1)), 0.0)
    least = 0.999 * most * model.grid.force.min()
    assert found.most.max() >= least
    assert found.integral.max() >= least


def test_what_moves_against_its_direction_of_yielding_is_counted_in_full(rng):
    model, elements = crisp_motion(rng)
    backwards = elements._replace(phase=-elements.phase)
    interpolant, missed = defects_of(model, backwards)
    yielding = np.flatnonzero(elements.phase)
    assert len(yielding)
    times = np.linspace(0, 1, 2001)
    for e in yielding:
        drift = np.polynomial.polynomial.polyval(times, interpolant.drift[e, :, 0])
        back = np.maximum(elements.phase[e] * np.diff(drift), 0).sum()
        assert missed.violation[e].max() >= 0.999 * np.sqrt(model.high.slider) * back


def test_an_error_of_the_initial_velocity_is_counted_in_full(rng):
    model, elements = crisp_motion(rng)
    floors = len(model.grid.mass)
    for floor in range(floors):
        series = elements.series.copy()
        series[0, 0, floors + floor] += 1e-3
        missed = _start_error(model, elements._replace(series=series))
        assert missed >= 0.999e-3 / np.sqrt(model.high.mass[floor])


def test_what_passes_the_yield_force_at_some_inputs_alone_is_counted(rng):
    frame = isolated_building(rng, 1)
    box = InterpolatedFrame(YieldingFlow(frame, ("k1",), 1.5, 0.05), np.arange(1))
    model, _ = box._model(*frame.parameters["k1"] * (1 + 1e-5 * np.array([[-1], [1]])))
    elements, _ = box._motions(model, None)
    if elements is None:  # a yield drift is grazed
        return
    # The force of the slider shall rise along the input, by half of the yield force in all.
    force = model.grid.force[0]
    inputs = chebvander([-1, 0, 1], model.fine) @ chebyshev_matrix(model.fine)
    nodes = grid(1, model.degree)[:, 0]
    e = int(rng.choice(np.flatnonzero(elements.phase == 0)))
    constant = elements.constant.copy()
    constant[e] += 0.25 * force * nodes
    elements = elements._replace(constant=constant)
    interpolant, _ = defects_of(model, elements)
    times = np.linspace(0, 1, 401)[:, np.newaxis] ** np.arange(interpolant.terms)
    largest = np.abs(times @ interpolant.elastic_force[e] @ inputs.T).max(axis=0)
    force = np.full_like(model.grid.force, largest[1] + 0.1 * force)
    lower = model.low._replace(force=force[0])
    model = replace(model, grid=model.grid._replace(force=force), low=lower)
    _, missed = defects_of(model, elements)
    assert missed.beyond[e].max() >= 0.999 * (largest.max() - force[0]) > 0
