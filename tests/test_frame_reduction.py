"""Beam frames and their reduction: against the storey frame, and against the full structure."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse.linalg import eigsh

from frame import Accelerogram, Exact, LinearFlow, StoreyFrame, envelope
from frame.beam_frame import BeamFrame
from frame.linear import frequencies
from fuzzy import Triangular

TIME = np.arange(201) * 0.02
GROUND = Accelerogram(0.02, np.sin(2 * np.pi * 1.1 * TIME) * np.exp(-(((TIME - 2) / 1.5) ** 2)))
TOWER = BeamFrame(6, 2, ground=GROUND)


def test_stiff_beams_and_light_columns_make_a_storey_frame() -> None:
    frame = BeamFrame(3, 2, beam=(1e4, 1e4), column=(1e3, 0.02), density=1e-6)
    M, K = frame.structure().assembled(frame.structure().parameters)
    beam = np.sqrt(eigsh(K, 3, M, sigma=0.0, return_eigenvectors=False))
    mass = 2 * frame.width * frame.floor
    storey = StoreyFrame([mass] * 3, [3.0] * 3, 30e9, 0.02 * 12 * 3 / 24)  # three columns of 12 E I / h³
    assert np.sort(beam) == pytest.approx(frequencies(storey), rel=2e-3)


def test_rigid_motion_costs_no_energy_away_from_the_foot() -> None:
    structure = TOWER.structure()
    _, K = structure.assembled(structure.parameters)
    force = K @ structure.excitation
    assert np.abs(force[3 * 3 :]).max() < 1e-6 * np.abs(force).max()  # only the first storey resists
    M, _ = structure.assembled(structure.parameters)
    columns, beams = 3 * 6 * 3.0 * 2500 * 0.49, 2 * 6 * 6.0 * 12e3
    foot = 3 * 3.0 * 2500 * 0.49 * (1 - 1 / 2 + (156 / 420 - 1 / 2))  # the clamped joints take their share of the lowest columns
    assert structure.excitation @ (M @ structure.excitation) == pytest.approx(columns + beams - 3 * 3.0 * 2500 * 0.49 + foot, rel=0.02)


def test_reduced_structure_follows_the_full_one() -> None:
    structure = TOWER.structure()
    reduced = structure.reduced({"E_beams": (27e9, 33e9), "mass": (11e3, 13e3)}, order=14)
    points = np.array([[27e9, 13e3], [33e9, 11.5e3]])
    values = LinearFlow(reduced, ("E_beams", "mass"), 4, 0.02, Exact()).values(points)
    named = [{"E_beams": a, "mass": b} for a, b in points]
    assert reduced.error(named, TIME, values) < 5e-3
    poor = structure.reduced({"E_beams": (27e9, 33e9), "mass": (11e3, 13e3)}, order=1)
    worse = LinearFlow(poor, ("E_beams", "mass"), 4, 0.02, Exact()).values(points)
    assert poor.error(named, TIME, worse) > 0.02


def test_envelope_of_a_reduced_tower() -> None:
    inputs = {"E_beams": Triangular(27e9, 30e9, 33e9), "rayleigh_mass": Triangular(0.03, 0.05, 0.07)}
    reduced = TOWER.structure().reduced({"E_beams": (27e9, 33e9)}, order=6, samples=2)
    common = {"duration": 4, "step": 0.02, "alpha": (0,), "integrator": "exact"}
    found = envelope(reduced, inputs, method="improved-graph-follower", tolerance=1e-5, **common)
    sampled = envelope(reduced, inputs, method="quasi-monte-carlo", samples=256, **common)
    beyond = np.maximum(sampled.upper - found.upper, found.lower - sampled.lower).max((0, 1))
    assert (beyond < 1e-3 * np.abs(found.upper).max((0, 1))).all()
    assert found.outputs == ("roof", "drift")


def test_impossible_frames_are_refused() -> None:
    with pytest.raises(ValueError, match="bays: 0 is not allowed"):
        BeamFrame(3, 0)
