"""The dual bound of structures whose dashpots couple the modes, with many inputs."""

from dataclasses import replace

import numpy as np
import pytest

from alphacut.frame import (
    Accelerogram,
    Auto,
    DualProof,
    Force,
    History,
    Proof,
    StoreyFrame,
    UnprovedError,
    envelope,
)
from alphacut.frame.boxes import Boxes, UnitFlow, boxes
from alphacut.frame.dynamics.flow import LinearFlow
from alphacut.frame.dynamics.integrators import Exact
from alphacut.frame.modes.modes import damped_modes
from alphacut.frame.response.duhamel import responses_at_nodes
from alphacut.fuzzy import Interval
from tests.frame.motions import judged_motions, random_points, require_inside

TIME = {"duration": 1.0, "step": 0.02}
NOISE = np.random.default_rng(4).normal(size=60)


def frame(floors, rng, **moved):
    """A frame with a dashpot in each storey, of one to four per cent of the critical one."""
    dampers = rng.uniform(0.02, 0.08, floors) * np.sqrt(5e4 * 6e7)
    return StoreyFrame(
        [5e4] * floors,
        stiffness=[6e7] * floors,
        dampers=dampers,
        damper_placement="storey",
        outputs=(f"q{floors}", f"a{floors}", "v1", "drift2"),
        **moved,
    )


MOVED = {
    "record": {"ground": Accelerogram(0.02, NOISE)},
    "start": {"q0": (0.01, 0.0, -0.01), "v0": (0.0, 0.3, 0.0)},
    "force": {"loads": [Force(3, 2e4, History(0.05, NOISE, 0.1))]},
    "all": {
        "ground": Accelerogram(0.02, NOISE),
        "v0": (0.0, 0.3, 0.0),
        "loads": [Force(1, 2e4, History.harmonic(3.0)), Force(3, 1e4, History(0.05, NOISE))],
    },
}


def box_around(system, names, width):
    values = {name: system.parameters[name] for name in names}
    return {name: Interval(x * (1 - width), x * (1 + width)) for name, x in values.items()}


@pytest.mark.parametrize("moved", MOVED)
def test_no_motion_leaves_the_bounds_at_nodes_or_between(moved, rng):
    system = frame(3, rng, **MOVED[moved])
    inputs = box_around(system, ("k1", "k2", "k3", "m1", "m2", "d1", "d3"), 0.02)
    found = envelope(system, inputs, DualProof(workers=1), alpha=[0.0], progress=False, **TIME)
    assert found.nature == "guaranteed"
    assert found.facts["gap_of_peaks"] < 0.05
    parts = 7
    points = random_points(inputs, 20, rng)
    times = np.sort(np.append(found.time, rng.uniform(0, 1.0, (parts - 1) * 50)))
    step = np.searchsorted(found.time, times, side="left")
    require_inside(judged_motions(system, points, inputs, found.time), found, slack=1e-12)
    for values in judged_motions(system, points, inputs, times):
        for sign, at_nodes in ((1.0, found.upper[0]), (-1.0, -found.lower[0])):
            bound = np.maximum(at_nodes[step], at_nodes[np.maximum(step - 1, 0)])
            assert (sign * values <= bound + found.between[step] + 1e-12).all()
        assert (found.least_peaks.lower[0] <= np.abs(values).max(0)).all()


def test_bounds_are_those_of_branch_and_bound_within_both_gaps(rng):
    """With two inputs both proofs hold; a cut within the other one is bounded as well."""
    system = frame(3, rng, **MOVED["all"])
    inputs = box_around(system, ("k2", "d1"), 0.04)
    given = {"alpha": [0.0], "progress": False, **TIME}
    few = envelope(system, inputs, Proof(tolerance=1e-3, workers=1), **given)
    many = envelope(system, inputs, DualProof(peaks=1e-2, workers=1), **given)
    for sign, side in ((1, "upper"), (-1, "lower")):
        closest, wide = ((sign * getattr(x, side)[0]).max(0) for x in (few, many))
        reached = (sign * getattr(few.attained, side)[0]).max(0)
        assert (reached <= wide).all()
        assert (wide <= closest + 0.015 * np.abs(closest)).all()


@pytest.mark.parametrize("moved", ["start", "force", "all"])
def test_oscillators_and_feedthrough_add_up_to_the_response(moved, rng):
    """At points of a narrow box, with the sign and the formula of each source."""
    system = frame(3, rng, **MOVED[moved])
    names = ("k1", "m2", "d3")
    centre = np.array([system.parameters[name] for name in names])
    cuts = Boxes(names, np.zeros(1), 0.99 * centre[None], 1.01 * centre[None], centre)
    flow = LinearFlow(system, names, 2.0, 0.02, Exact())
    size = np.abs(flow.values(centre[None])[0]).max(0)
    found = damped_modes(flow, cuts, {}, 1e-3 * size)
    for u in rng.uniform(-1, 1, (3, 3)):
        (exact,) = judged_motions(system, centre * (1 + 0.01 * u)[None], names, flow.time)
        total = np.zeros((len(flow.time), 4))
        for mode in found.oscillators:
            omega, decay = (x.at(u[None])[0] for x in (mode.omega, mode.decay))
            sigma = np.array([-decay + 1j * omega])
            for source, factor in zip(
                found.sources, mode.participation.at(u[None])[0], strict=True
            ):
                G = np.exp(sigma * flow.time[:, None])
                if source.load:
                    (G,) = responses_at_nodes(sigma, source.load, flow.time, 0)
                total += source.read(sigma, G) * factor
        for term in found.truncated:
            total += np.einsum(
                "so,sot->to", term.participation.at(u[None])[0], term.response_midpoint
            )
        assert (np.abs(total - exact) <= found.open + 1e-4 * size).all()
        assert (np.abs(total - exact) <= 0.02 * size).all()


@pytest.mark.parametrize(("first", "dampers"), [("proof", {}), ("dual", {"dampers": (0.0,) * 3})])
def test_branch_and_bound_comes_first_up_to_six_inputs_with_dashpots_alone(first, dampers, rng):
    system = replace(frame(3, rng, **MOVED["record"]), damping_ratio=0.03, **dampers)
    inputs = box_around(system, ("k1", "k2", "k3", "m1", "m2", "m3"), 0.02)
    flow = UnitFlow(LinearFlow(system, tuple(inputs), 2.0, 0.02, Exact()), boxes(inputs, [0.0]))
    assert next(Auto()._proofs(flow, [])).name == first


def test_modes_without_oscillation_are_refused():
    heavy = StoreyFrame(
        [5e4, 5e4], stiffness=[6e7, 6e7], dampers=[1e8, 1e8], damper_placement="storey", v0=(0, 1.0)
    )
    inputs = box_around(heavy, ("k1", "m1"), 0.02)
    with pytest.raises(UnprovedError, match="oscillate"):
        envelope(heavy, inputs, DualProof(workers=1), alpha=[0.0], progress=False, **TIME)
