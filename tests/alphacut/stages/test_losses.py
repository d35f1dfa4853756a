"""Loss factors of phases in a case: their α-cuts, and the damping of a frame of the material."""

import numpy as np

from tests.alphacut.small import summary_of_run, table_of, written

CASE = table_of("losses")["case"]


def test_the_frame_is_damped_by_half_the_loss_factor_of_its_material(tmp_path):
    document = summary_of_run(written(tmp_path, CASE))
    loss = document["modulus"]["loss"]["E"]
    low, nominal, high = document["damping"]["zeta"]
    expected = np.sin(np.arctan([loss["lower"][0], loss["lower"][-1], loss["upper"][0]]) / 2)
    assert np.allclose([low, nominal, high], expected, rtol=1e-12)
    assert low > 0.35e-2 / 2
    assert high < 2.6e-2 / 2
    assert document["envelopes"]["all"]["nature"] == "guaranteed"
    without = CASE.partition("[frame]")[0].replace(', "envelope"]', "]")
    lines = (x for x in without.splitlines() if "_loss" not in x)
    other = summary_of_run(written(tmp_path, "\n".join(lines)))
    assert other["modulus"]["E_GPa"] == document["modulus"]["E_GPa"]
    assert other["modulus"]["loss"] is None
