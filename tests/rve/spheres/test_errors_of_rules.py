import numpy as np

from alphacut.rve import Phase
from alphacut.rve.spheres.model import SphereSeriesModel
from alphacut.rve.spheres.result import cubic_moduli
from alphacut.stochastic import HermiteMap


def mean_moduli(result):
    return result.curve.weights @ cubic_moduli(np.asarray(result.curve.stiffness))


def test_errors_of_the_rules_that_judge_are_declared_too():
    """The truncated series is off by as much in the finer rules, which hides the rule's own."""
    matrix, sphere = Phase(20e9, 0.38989580956002057), Phase(8646840811.373384, 0.0953606432814216)
    radius_map = HermiteMap(
        0.2270821390262417, 0.5551610886291878, 0.7679608088541565, 0.74899234963229
    )
    found, exact = (
        SphereSeriesModel(accuracy=accuracy).solve(radius_map, matrix, [sphere])[0]
        for accuracy in (2.6785698164863e-06, 1e-11)
    )
    declared = (found.errors["space"] + found.errors["theta"])[:3]
    off = abs(mean_moduli(found) / mean_moduli(exact) - 1)
    assert (off <= declared).all()
    assert (declared <= 10 * off).any()
