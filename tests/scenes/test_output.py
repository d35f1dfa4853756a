"""Closing output of shipped cases, made smaller: few lines, narrow ones; and what they say."""

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lsim

from tests.alphacut.small import summary_of
from tests.scenes.test_cases import QUICK

ROOT = Path(__file__).parents[2]
SHARED = {  # case: changes of its keys; runs that golden numbers are compared with, too
    "building": QUICK["building"][0],
    "composite": ("envelope.duration=1 s", "envelope.step=0.02 s", "modulus.alpha=[0, 0.5, 1]"),
    "laboratory-frame": QUICK["laboratory-frame"][0],
}


@pytest.fixture
def run(shipped_run):
    """A function from a case to the lines that its run prints at the end, and its summary."""

    def lines_and_summary(name):
        folder = shipped_run(name, SHARED[name])
        told = json.loads((folder / "told.json").read_text(encoding="utf-8"))
        summary = summary_of(folder)
        return [line.replace(str(folder), f"results/{name}") for line in told], summary

    return lines_and_summary


@pytest.mark.parametrize(
    "name", ["building", pytest.param("composite", marks=pytest.mark.slow), "laboratory-frame"]
)
def test_the_closing_output_fits_on_a_screen(run, name):
    told, _ = run(name)
    lines = [x for x in told if not x.startswith("alphacut: warning: ") and "% after" not in x]
    assert len(lines) <= 25, "\n".join(lines)
    assert max(map(len, lines)) <= 80, "\n".join(lines)
    assert any("peak of" in line for line in lines)
    assert "next: " in lines[-1]


def motion(young, roof, height, mass_damping=0.5, stiffness_damping=2.5e-3):
    """Roof displacement, drift and base shear of the building, by scipy, shape (T, 3), in SI."""
    time = np.arange(0, 1 + 1e-9, 0.01)
    text = (ROOT / "cases" / "building.record.csv").read_text(encoding="utf-8")
    record = np.array([x.split(",") for x in text.splitlines() if x[:1].isdigit()], float)
    masses = np.array([40e3] * 7 + [roof])
    lengths = np.array([height] + [3.2] * 7)
    stiff = 24 * young * 3.2e-3 / lengths**3
    whole = (
        np.diag(stiff + np.append(stiff[1:], 0)) - np.diag(stiff[1:], 1) - np.diag(stiff[1:], -1)
    )
    inverse = np.diag(1 / masses)
    damping = mass_damping * np.eye(8) + stiffness_damping * inverse @ whole
    system = np.block([[np.zeros((8, 8)), np.eye(8)], [-inverse @ whole, -damping]])
    force = np.concatenate([np.zeros(8), -np.ones(8)])[:, None]
    ground = np.interp(time, record[:, 0], record[:, 1])
    states = lsim((system, force, np.eye(16), np.zeros((16, 1))), ground, time)[2]
    q = states[:, :8]
    return np.stack([q[:, 7], q[:, 0], stiff[0] * q[:, 0]], axis=1)


def test_the_building_moves_as_another_program_computes_it(run, rng):
    """The nominal peaks agree; random motions of the box stay inside, and corners come near."""
    _, summary = run("building")
    peaks = summary["envelopes"]["all"]["peak"]
    names = ("q8", "drift1", "base_shear")
    modulus = summary["modulus"]["E_GPa"]
    nominal = motion(1e9 * modulus["lower"][-1], 30e3, 4.0)
    lower, upper, error = (
        np.array([peaks[x][k] for x in names]) for k in ("lower", "upper", "error")
    )
    top = np.abs(nominal).max(axis=0)
    assert top == pytest.approx(upper[:, -1], rel=2e-2)
    assert top == pytest.approx(lower[:, -1], rel=2e-2)
    ends = [
        (1e9 * modulus["lower"][0], 1e9 * modulus["upper"][0]),
        (28e3, 34e3), (3.92, 4.08),
    ]  # fmt: skip
    box = np.array(ends).T
    inside = box[0] + rng.random((60, 3)) * (box[1] - box[0])
    corners = np.array(np.meshgrid(*ends)).reshape(3, -1).T
    tried = np.array([np.abs(motion(*x)).max(axis=0) for x in (*inside, *corners)])
    slack = error[:, 0] + 2e-3 * top  # of the steps of this program
    assert (tried <= upper[:, 0] + slack).all()
    assert (tried >= lower[:, 0] - slack).all()
    assert (tried.max(axis=0) >= 0.95 * upper[:, 0]).all()
    share = summary["probability"]["events"]["drift1"]
    assert share["limit"] == pytest.approx(0.04)
    if upper[1, 0] + error[1, 0] < share["limit"]:
        assert max(share["upper"]) == 0
