"""Beam frames and their reduction: against the storey frame, and against the full structure."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse.linalg import eigsh

from alphacut.frame import Accelerogram, Exact, LinearFlow, StoreyFrame, envelope
from alphacut.frame.boxes import UnitFlow, boxes
from alphacut.frame.checks.step_error import step_error
from alphacut.frame.reduced.beam import BeamFrame
from alphacut.frame.structures.linear import evaluate, frequencies
from alphacut.frame.structures.modes import classical_modes
from alphacut.fuzzy import Triangular

TIME = np.arange(201) * 0.02
GROUND = Accelerogram(0.02, np.sin(2 * np.pi * 1.1 * TIME) * np.exp(-(((TIME - 2) / 1.5) ** 2)))
TOWER = BeamFrame(6, 2, ground=GROUND)


def test_stiff_beams_and_light_columns_make_a_storey_frame() -> None:
    frame = BeamFrame(3, 2, beam=(1e4, 1e4), column=(1e3, 0.02), density=0.0)
    M, K = frame.structure().assembled(frame.structure().parameters)
    beam = np.sqrt(eigsh(K, 3, M, sigma=0.0, return_eigenvectors=False))
    mass = 2 * frame.width * frame.floor
    # three columns of 12 E I / h³
    storey = StoreyFrame([mass] * 3, [3.0] * 3, 30e9, 0.02 * 12 * 3 / 24)
    assert np.sort(beam) == pytest.approx(frequencies(storey), rel=2e-3)


def test_rigid_motion_costs_no_energy_away_from_the_foot() -> None:
    structure = TOWER.structure()
    _, K = structure.assembled(structure.parameters)
    force = K @ structure.excitation
    # only the first storey resists
    assert np.abs(force[3 * 3 :]).max() < 1e-6 * np.abs(force).max()
    M, _ = structure.assembled(structure.parameters)
    columns, beams = 3 * 6 * 3.0 * 2500 * 0.49, 2 * 6 * 6.0 * 12e3
    # the clamped joints take their share of the lowest columns
    foot = 3 * 3.0 * 2500 * 0.49 * (1 - 1 / 2 + (156 / 420 - 1 / 2))
    assert structure.excitation @ (M @ structure.excitation) == pytest.approx(
        columns + beams - 3 * 3.0 * 2500 * 0.49 + foot, rel=0.02
    )


@pytest.mark.parametrize("ratio", [None, 0.05])
def test_reduced_structure_follows_the_full_one(ratio: float | None) -> None:
    structure = replace(TOWER, damping_ratio=ratio).structure()
    box = {"E_beams": (27e9, 33e9), "mass": (11e3, 13e3)}
    reduced, poor = structure.reduced(box), structure.reduced(box, keep=1e-3)
    points = np.array([[27e9, 13e3], [33e9, 11.5e3], [28e9, 11e3]])
    named = [{"E_beams": a, "mass": b} for a, b in points]
    values, worse = (
        LinearFlow(x, ("E_beams", "mass"), 4, 0.02, Exact()).values(points) for x in (reduced, poor)
    )
    truth = np.array([structure.trajectories({**structure.parameters, **p}, TIME) for p in named])
    off, far = (np.abs(x - truth).max(1) / np.abs(truth).max(1) for x in (values, worse))
    assert off.max() < 1e-4
    assert far.max() > 5e-3


@pytest.mark.parametrize("ratio", [None, 0.05])
def test_full_structure_agrees_with_the_propagator_of_its_matrices(ratio: float | None) -> None:
    structure = replace(
        BeamFrame(2, 1, ground=GROUND, damping_ratio=ratio).structure(),
        q0=np.full(12, 1e-3),
        v0=np.linspace(-0.1, 0.1, 12),
    )
    small = replace(structure.reduced({"mass": (11e3, 13e3)}), basis=np.eye(12))
    rows = np.array(list(structure.observed.values()))
    terms = [
        [(f, A.toarray()) for f, A in pairs] for pairs in (structure.mass, structure.stiffness)
    ]
    small = replace(
        small,
        mass=terms[0],
        stiffness=terms[1],
        push=structure.excitation,
        rows=rows,
        q0=structure.q0,
        v0=structure.v0,
    )
    found = LinearFlow(small, ("mass",), 4, 0.04, Exact()).values(np.array([[12e3]]))[0]
    truth = structure.trajectories(structure.parameters, TIME)[::2]
    assert np.abs(found - truth).max() < 1e-9 * np.abs(truth).max()


def test_envelope_of_a_reduced_tower() -> None:
    inputs = {
        "E_beams": Triangular(27e9, 30e9, 33e9),
        "rayleigh_mass": Triangular(0.03, 0.05, 0.07),
    }
    reduced = TOWER.structure().reduced({"E_beams": (27e9, 33e9)}, keep=1e-5)
    common = {"duration": 4, "step": 0.02, "alpha": (0,), "integrator": "exact"}
    found = envelope(reduced, inputs, method="improved-graph-follower", tolerance=1e-5, **common)
    sampled = envelope(reduced, inputs, method="quasi-monte-carlo", samples=256, **common)
    beyond = np.maximum(sampled.upper - found.upper, found.lower - sampled.lower).max((0, 1))
    assert (beyond < 1e-3 * np.abs(found.upper).max((0, 1))).all()
    assert found.outputs == ("roof", "drift")


def test_eigenvalues_and_powers_give_the_same_trajectory(monkeypatch: pytest.MonkeyPatch) -> None:
    noise = Accelerogram(0.03, np.random.default_rng(0).standard_normal(100))
    frame = StoreyFrame(
        [1e4] * 3,
        [3.0] * 3,
        25e9,
        1e-6,
        [900, 0, 700],
        "storey",
        [0.01] * 3,
        [0.1] * 3,
        rayleigh=(0.1, 0.2),
        ground=noise,
    )
    flow, point = (
        LinearFlow(frame, ("E", "m1", "d1"), 3, 0.05, Exact()),
        np.array([[25e9, 1e4, 900], [24e9, 1.1e4, 950]]),
    )
    powers = flow.taylor(point)
    monkeypatch.setattr("alphacut.frame.dynamics.flow.LARGE", 2)
    modes = flow.taylor(point)  # some of them overdamped
    assert np.abs(powers.value - modes.value).max() < 1e-11 * np.abs(powers.value).max()
    for i in range(3):
        assert (
            np.abs(powers.first[i] - modes.first[i]).max() < 1e-10 * np.abs(powers.first[i]).max()
        )
        assert (
            np.abs(powers.second[i] - modes.second[i]).max() < 1e-9 * np.abs(powers.second[i]).max()
        )


@pytest.mark.parametrize("shaken", [True, False])
@pytest.mark.parametrize(
    "damping",
    [{"rayleigh": (0.1, 0.02)}, {"damping_ratio": (0.02, 0.3, 0.1)}, {}],
    ids=["rayleigh", "ratios", "none"],
)
def test_undamped_modes_give_the_same_trajectory_as_powers(
    shaken: bool, damping: dict[str, object], monkeypatch: pytest.MonkeyPatch
) -> None:
    noise = Accelerogram(0.03, np.random.default_rng(0).standard_normal(100)) if shaken else None
    frame = StoreyFrame(
        [1e4] * 3,
        [3.0] * 3,
        25e9,
        1e-6,
        q0=[0.01] * 3,
        v0=[0.1] * 3,
        outputs=("q3", "v2", "shear1"),
        ground=noise,
    )
    flow, point = (
        LinearFlow(replace(frame, **damping), ("E", "m1"), 3, 0.05, Exact()),
        np.array([[25e9, 1e4], [24e9, 1.1e4]]),
    )
    powers = flow.values(point)
    monkeypatch.setattr("alphacut.frame.dynamics.flow.LARGE", 2)
    monkeypatch.setattr("alphacut.frame.dynamics.spectral.natural.eigenvectors", None)  # not needed
    assert np.abs(flow.values(point) - powers).max() < 1e-11 * np.abs(powers).max()


@pytest.mark.parametrize(
    "damping", [{"dampers": (900, 0, 700)}, {"rayleigh": (0, 3.0)}], ids=["coupled", "overdamped"]
)
def test_damping_that_couples_or_stops_the_modes_has_no_undamped_ones(
    damping: dict[str, object],
) -> None:
    frame = StoreyFrame([1e4] * 3, [3.0] * 3, 25e9, 1e-6, q0=[0.01] * 3, **damping)
    assert classical_modes(*evaluate(frame, ("E",), np.array([[25e9]]), derivatives=False)) is None


def test_impossible_frames_are_refused() -> None:
    with pytest.raises(ValueError, match="bays: 0 is not allowed"):
        BeamFrame(3, 0)


@pytest.mark.parametrize("certify", [None, 1e-3])
def test_what_the_reduction_leaves_out_counts_as_error(certify: float | None) -> None:
    """A start on a sine in a tower with hardly any damping, and a poor basis besides."""
    sine = Accelerogram(0.01, np.sin(2 * np.pi * 3.1 * 0.01 * np.arange(150)))
    structure = BeamFrame(12, 2, rayleigh=(0.01, 1e-4), ground=sine).structure()
    time, box = np.arange(101) * 0.01, {"E_columns": (29.4e9, 30.6e9)}
    inputs = {"E_columns": Triangular(29.4e9, 30e9, 30.6e9)}
    truth = [structure.trajectories({**structure.parameters, "E_columns": 29.7e9}, time)]
    for reduced in (structure.reduced(box), structure.reduced(box, keep=1e-5, accuracy=1.0)):
        way = {"method": "modal", "certify": certify} if certify else {"method": "modal"}
        found = envelope(reduced, inputs, duration=1.0, step=0.01, alpha=(0,), **way)  # type: ignore[arg-type]
        error = np.zeros_like(found.lower) if certify else found.error
        assert error is not None
        assert (found.lower - error - 1e-9 <= truth).all()
        assert (truth <= found.upper + error + 1e-9).all()
        off = reduced.deviation(
            [structure.parameters], time, [structure.trajectories(structure.parameters, time)]
        )
        assert float(found.facts["step_error"]) >= off * np.abs(truth).max() / 20


def test_shapes_come_in_until_the_motion_is_accurate() -> None:
    sine = Accelerogram(0.01, np.sin(2 * np.pi * 3.1 * 0.01 * np.arange(486)))
    structure = BeamFrame(30, 4, rayleigh=(0.01, 1e-4), ground=sine).structure()
    box, time = {"E_columns": (29.7e9, 30.3e9)}, np.arange(151) * 0.01
    truth = [structure.trajectories(structure.parameters, time)]
    few, more = structure.reduced(box, accuracy=1.0), structure.reduced(box)
    assert few.deviation([structure.parameters], time, truth) > 0.02
    assert more.deviation([structure.parameters], time, truth) < 1e-3
    assert few.basis.shape[1] < more.basis.shape[1]


def test_certified_bounds_of_a_poor_reduction_are_widened_on_both_sides() -> None:
    """A box so narrow that the bounds proved of the reduced motion leave the true one out."""
    sine = Accelerogram(0.01, np.sin(2 * np.pi * 3.1 * 0.01 * np.arange(150)))
    structure = BeamFrame(12, 2, rayleigh=(0.01, 1e-4), ground=sine).structure()
    time, inputs = np.arange(101) * 0.01, {"E_columns": Triangular(29.9999e9, 30e9, 30.0001e9)}
    truth = structure.trajectories(structure.parameters, time)
    reduced = structure.reduced({"E_columns": (29.9999e9, 30.0001e9)}, keep=1e-5, accuracy=1.0)
    flow = LinearFlow(reduced, ("E_columns",), 1.0, 0.01, Exact())
    off = flow.values(np.array([[30e9]]))[0] - truth
    assert off.max() > 1e-6
    assert off.min() < -1e-6
    found = envelope(
        reduced, inputs, duration=1.0, step=0.01, alpha=(0,), method="modal", certify=1e-7
    )
    assert (found.lower[0] <= truth).all()
    assert (truth <= found.upper[0]).all()


def test_a_resonance_inside_the_box_is_within_the_declared_error() -> None:
    """Undamped, so that the motion is worst between the corners."""
    sine = Accelerogram(0.02, 3 * np.sin(2 * np.pi * 4.0 * 0.02 * np.arange(401)))
    structure = BeamFrame(8, 3, rayleigh=(0.0, 0.0), ground=sine).structure()
    reduced = structure.reduced({"E_columns": (18e9, 42e9)}, accuracy=1.0)
    inputs = {"E_columns": Triangular(18e9, 30e9, 42e9)}
    flow = LinearFlow(reduced, ("E_columns",), 8.0, 0.02, Exact())
    declared = step_error(UnitFlow(flow, boxes(inputs, (0,))))
    points = np.linspace(18e9, 42e9, 41)[:, None]
    for point, found in zip(points, flow.values(points), strict=True):
        p = {**structure.parameters, "E_columns": float(point[0])}
        off = np.abs(found - structure.trajectories(p, flow.time))
        assert (off <= declared + 1e-9 * np.abs(found).max()).all()


def test_one_storey_has_lower_columns_alone():
    low = BeamFrame(1, 2, ground=GROUND).structure()
    assert "E_columns_top" not in low.parameters
    reduced = low.reduced({"E_columns": (30e9, 60e9)})
    flow = LinearFlow(reduced, ("E_columns",), 2.0, 0.02, Exact())
    soft, stiff = np.abs(flow.values(np.array([[30e9], [60e9]]))[..., 0]).max(1)
    assert abs(stiff / soft - 1) > 0.1
