"""The error of time steps is that where bounds are attained; a step too coarse there is refused."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from alphacut.frame import Sampled, envelope, pendulum
from alphacut.frame.dynamics.flow import StepError
from alphacut.frame.dynamics.nonlinear import make_flow
from alphacut.frame.verification.step_error import ReferenceMotion
from alphacut.fuzzy import Interval


def angle(parameters, time):
    """Angle of the pendulum, from its equation of motion written here."""
    p = parameters
    damping = p["d"] / (p["m"] * p["l"] ** 2)
    right = lambda t, y: [y[1], -p["g"] / p["l"] * np.sin(y[0]) - damping * y[1]]  # noqa: E731
    accuracy = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-12}
    start = [p["phi_0"], p["omega_0"]]
    return solve_ivp(right, (0, time[-1]), start, t_eval=time, **accuracy).y[0]


def test_a_step_too_coarse_near_the_upright_is_refused_and_a_finer_one_taken():
    near_upright, inputs = pendulum(phi0=3.0, damping=0.01), {"omega_0": Interval(0.4435, 0.4445)}
    motion = {"duration": 5.0, "alpha": (0,), "method": Sampled(32), "progress": False}
    with pytest.raises(
        StepError, match=r"too coarse where a bound is attained, at omega_0 = .*smaller step"
    ):
        envelope(near_upright, inputs, step=0.05, **motion)
    assert envelope(near_upright, inputs, step=0.00625, **motion).error.max() > 0


@pytest.mark.parametrize("low", [2.6, 2.9])
def test_declared_errors_hold_where_bounds_are_attained(low):
    system, inputs = pendulum(phi0=3.0, damping=0.05), {"phi_0": Interval(low, 3.0)}
    motion = {"duration": 5.0, "step": 0.01, "alpha": (0,), "progress": False}
    found = envelope(system, inputs, method=Sampled(16), **motion)
    output = list(found.outputs).index("phi")
    for places, bounds in ((found.lower_at, found.lower), (found.upper_at, found.upper)):
        for point in np.unique(places[0, :, output], axis=0):
            named = (places[0, :, output] == point).all(-1)
            exact = angle({**system.parameters, "phi_0": point[0]}, found.time)
            off = np.abs(exact - bounds[0, :, output])[named]
            assert (off <= found.error[0, named, output] + 1e-9).all()
            assert found.error[0, -1, output] < 0.1  # the error is not simply large


def test_reference_motion_is_that_of_the_equations():
    system, time = pendulum(phi0=2.0), np.linspace(0, 4, 41)
    values = ReferenceMotion(system).outputs(system.parameters, time)
    assert values[:, 1] == pytest.approx(angle(system.parameters, time), abs=1e-8)
    steps = make_flow(system, (), 4.0, 1e-3).values(np.zeros((1, 0)))[0, ::100]
    assert values == pytest.approx(steps, abs=2e-4)
