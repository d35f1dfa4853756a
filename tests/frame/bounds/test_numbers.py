"""Numbers of the dual proof: fast modes and crisp inputs."""

import numpy as np
import pytest

from alphacut.frame import Accelerogram, DualProof, Proof, StoreyFrame, envelope
from alphacut.fuzzy import Crisp, Triangular
from tests.frame.motions import off_chords


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


def decayed(time):
    """A mode of 20 rad/s with a damping ratio of 2 %, kicked to 1 m/s."""
    return np.exp(-0.4 * time) * np.sin((fast := 20 * np.sqrt(1 - 4e-4)) * time) / fast


def crept(time):
    """A mode with the exponents −10/s and −40/s."""
    return (np.exp(-10 * time) - np.exp(-40 * time)) / 30


@pytest.mark.parametrize(
    ("damping", "exact", "method"),
    [
        ({"damping_ratio": 0.02}, decayed, DualProof()),
        ({"damping_ratio": 0.02}, decayed, Proof()),
        ({"rayleigh": (50.0, 0.0)}, crept, DualProof()),
    ],
)
def test_crisp_inputs_are_their_exact_motion_and_stray_between_nodes_as_stated(
    damping, exact, method
):
    frame = StoreyFrame([1e3], stiffness=[4e5], v0=(1.0,), outputs=("q1",), **damping)
    given = {"duration": 0.2, "step": 0.05, "alpha": (0, 1), "progress": False}
    found = envelope(frame, {"k1": Crisp(4e5)}, method, **given)
    motion = exact(np.linspace(0, 0.2, 2001))
    assert np.abs(found.upper[1, :, 0] - motion[::500]).max() <= 1e-8
    off, stray = off_chords(motion, 500), found.between[1:, 0]
    assert (off <= stray).all()
    assert stray.max() <= (3 if exact is decayed else 10) * off.max()
