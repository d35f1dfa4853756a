"""Models refuse options out of range by one line."""

import numpy as np
import pytest

from alphacut import rve
from alphacut.base.errors import RefusedError
from alphacut.rve.spheres.model import SpheresModel

POINTS, ACCURACY = (
    "is 1; allowed: 2 or more",
    r"the accuracy of the series is .*; allowed: values in",
)
WRONG = [
    (rve.SeriesModel, {"points": 1}, POINTS),
    (rve.SeriesModel, {"accuracy": 1e-15}, ACCURACY),
    (SpheresModel, {"points": 1}, POINTS),
    (SpheresModel, {"accuracy": 1e-12}, ACCURACY),
    (SpheresModel, {"accuracy": np.nan}, ACCURACY),
    ("SlicesModel", {"points": 1}, POINTS),
    ("SlicesModel", {"mesh_size": 2}, "the mesh size is 2; allowed"),
    ("PrismModel", {"mesh_size": 0.0}, r"the mesh size is 0; allowed: values in \(0, 1\]"),
    ("PrismModel", {"layers": 0}, "the number of layers is 0; allowed: 1 or more"),
]


@pytest.mark.parametrize(("model", "options", "message"), WRONG)
def test_an_option_out_of_range_is_refused(model, options, message):
    if isinstance(model, str):
        pytest.importorskip("alphacut.rve.fenicsx")
        model = getattr(rve, model)
    with pytest.raises(RefusedError, match=message):
        model(**options)
