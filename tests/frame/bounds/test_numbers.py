"""Numbers of the dual proof: fast modes and crisp inputs."""

import numpy as np
import pytest

from alphacut.frame import Accelerogram, DualProof, Proof, StoreyFrame, envelope
from alphacut.fuzzy import Crisp, Triangular


@pytest.mark.parametrize(
    ("first", "step", "parts"), [(60e6, 0.25, 10), (60e9, 0.02, 1)], ids=["pulses", "stiff"]
)
def test_records_far_slower_than_the_modes_are_bounded(first, step, parts):
    """The step of the record times the highest frequency is 26 and 35."""
    masses, springs = np.full(4, 20e3), np.array([first, 60e6, 60e6, 60e6])
    ground = Accelerogram(step, np.random.default_rng(7).normal(size=7))
    frame = StoreyFrame(
        masses=masses, stiffness=springs, damping_ratio=0.03, ground=ground, outputs=("q4",)
    )
    fuzzy = {f"k{z}": Triangular(*(springs[z - 1] * np.array([0.95, 1, 1.05]))) for z in (1, 2, 4)}
    found = envelope(
        frame,
        fuzzy,
        duration=6 * step,
        step=step / parts,
        alpha=(0,),
        method=DualProof(slabs=2, peaks=0.5),
        progress=False,
    )
    assert found.facts["motions_tested"] > 0
    assert found.upper.max() < 3 * np.abs(found.inner.upper).max()


def oscillator(turn, duration, **values):
    """A mass on a spring that starts at 1 m/s, and its inputs: a spring without a width."""
    frame = StoreyFrame(masses=[1e3], stiffness=[1e3 * turn**2], outputs=("q1",), **values)
    return frame, {"k1": Crisp(1e3 * turn**2)}, {"duration": duration, "alpha": (0, 1)}


@pytest.mark.parametrize("method", [DualProof(), Proof()])
def test_crisp_inputs_stray_between_nodes_as_stated(method):
    frame, inputs, given = oscillator(20.0, 0.2, damping_ratio=0.02, v0=(1.0,))
    found = envelope(frame, inputs, step=0.05, method=method, progress=False, **given)
    time, fast = np.linspace(0, 0.2, 2001), 20 * np.sqrt(1 - 4e-4)
    motion = np.exp(-0.4 * time) * np.sin(fast * time) / fast
    nodes = motion[::500]
    off = np.abs(motion - np.interp(time, time[::500], nodes))[1:].reshape(4, 500).max(1)
    stray = found.between[1:, 0]
    assert (off <= stray).all()
    assert (stray <= 3 * off.max()).all()
    assert (np.abs(found.upper[1, :, 0] - nodes) <= 2e-5).all()


def test_crisp_modes_that_do_not_oscillate_are_their_exact_motion():
    """With the exponents −10/s and −40/s."""
    frame, inputs, given = oscillator(20.0, 0.2, rayleigh=(50.0, 0.0), v0=(1.0,))
    found = envelope(frame, inputs, step=0.05, method=DualProof(), progress=False, **given)
    time = np.linspace(0, 0.2, 2001)
    motion = (np.exp(-10 * time) - np.exp(-40 * time)) / 30
    nodes = motion[::500]
    assert np.abs(found.upper[1, :, 0] - nodes).max() <= 1e-8
    off = np.abs(motion - np.interp(time, time[::500], nodes))[1:].reshape(4, 500).max(1)
    assert (off <= found.between[1:, 0]).all()
