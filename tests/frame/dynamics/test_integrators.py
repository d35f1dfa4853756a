"""The one-step methods: order, and derivatives of the scheme."""

from dataclasses import replace

import numpy as np
import pytest

from alphacut.frame import INTEGRATORS, Accelerogram, Exact, LinearFlow, StoreyFrame
from benchmarks.frame.envelopes import FRAME
from tests.frame.differences import require_derivatives
from tests.refused import refuses

SHAKEN = replace(
    FRAME,
    ground=Accelerogram(0.007, np.cos(6 * 0.007 * np.arange(1600))),  # finer than the steps
    dampers=(900.0, 700.0, 400.0),
    damper_placement="storey",
)
NAMES = ("E", "m1", "l2", "d3", "q2_0", "v3_0")
ALL = list(INTEGRATORS.values())


def modal(names: tuple[str, ...], system: StoreyFrame = FRAME) -> np.ndarray:
    return np.array([[system.parameters[name] for name in names]])


@pytest.mark.parametrize("method", ALL, ids=str)
@pytest.mark.parametrize("system", [FRAME, SHAKEN], ids=["free", "shaken"])
def test_error_falls_with_the_square_of_the_step(method, system: StoreyFrame) -> None:
    truth = LinearFlow(system, ("E",), 10, 0.1, Exact()).values(modal(("E",)))
    flows = [(LinearFlow(system, ("E",), 10, 0.1 / n, method), n) for n in (2, 4)]
    errors = [np.abs(flow.values(modal(("E",)))[:, ::n] - truth).max() for flow, n in flows]
    if isinstance(method, Exact):
        assert max(errors) < 1e-11
    else:
        assert abs(np.log2(errors[0] / errors[1]) - 2) < 0.15


def test_motions_as_of_a_stiffness_in_a_wrong_unit_are_refused() -> None:
    stiff = replace(SHAKEN, modulus=1e15 * SHAKEN.modulus)
    with refuses("step"):
        LinearFlow(stiff, ("E",), 10, 0.1, Exact()).values(modal(("E",), stiff))


@pytest.mark.parametrize("method", ALL, ids=str)
def test_derivatives_are_those_of_the_scheme(method) -> None:
    flow, (p,) = LinearFlow(SHAKEN, NAMES, 8, 0.1, method), modal(NAMES)
    shares = np.array((3e-4, 1e-3, 3e-4, 3e-2, 0.3, 0.3))  # weaker effects take longer steps
    require_derivatives(flow.taylor, p, shares, within=(1e-7, 1e-7))
