"""Proved bounds of floor accelerations, which are forces over fuzzy masses."""

import numpy as np
from scipy.linalg import expm, sqrtm

from alphacut.frame import StoreyFrame, envelope
from alphacut.fuzzy import Interval


def test_bounds_of_accelerations_hold_with_fuzzy_masses_and_weights(rng):
    inputs = {"m2": Interval(7e3, 9e3), "k1": Interval(9e5, 11e5)}
    k2, m1, h, a, b, gravity, zeta = 6e5, 1e4, 3.0, 0.2, 1e-3, 9.81, 0.04
    frame = StoreyFrame(
        (m1, 8e3),
        (h, h),
        stiffness=(1e6, k2),
        gravity=gravity,
        rayleigh=(a, b),
        damping_ratio=zeta,
        q0=(0.01, 0.02),
        outputs=("a1", "a2"),
    )
    found = envelope(frame, inputs, duration=1.0, step=0.05, alpha=(0,), tolerance=1e-2)
    assert found.nature == "guaranteed"
    tight = np.zeros(2)
    for m2, k1 in rng.uniform([7e3, 9e5], [9e3, 11e5], (20, 2)):
        M = np.diag([m1, m2])
        elastic = np.array([[k1 + k2, -k2], [-k2, k2]])
        p1, p2 = gravity * (m1 + m2) / h, gravity * m2 / h
        K = elastic - np.array([[p1 + p2, -p2], [-p2, p2]])
        D = a * M + b * elastic + 2 * zeta * M @ sqrtm(np.linalg.solve(M, K)).real
        A = np.block([[np.zeros((2, 2)), np.eye(2)], [-np.linalg.solve(M, np.hstack([K, D]))]])
        state = np.array([expm(A * t) @ [0.01, 0.02, 0, 0] for t in found.time])
        motion = (state @ A.T)[:, 2:]  # the ground is at rest
        assert (motion >= found.lower[0] - 1e-9).all()
        assert (motion <= found.upper[0] + 1e-9).all()
        tight = np.maximum(tight, np.abs(motion).max(0))
    assert (np.abs(found.upper[0]).max(0) < 1.2 * tight).all()
