"""The picture of the cell's stress: its legend has the bands that can be seen, and no text lies on
a curve.
"""

import matplotlib.pyplot as plt
import numpy as np
import pytest
import xarray

from alphacut.figures.modulus import response

ALPHA, STRESS = np.array([0.0, 0.5, 1.0]), np.linspace(4e8, 7e8, 61)


def picture(width: float):
    """A response whose bands are `width` and half of it wide, in probability."""
    middle = (STRESS - STRESS[0]) / np.ptp(STRESS)
    cdf = np.array(
        [
            [np.clip(middle + sign * width * (1 - level) / 2, 0, 1) for sign in (-1, 1)]
            for level in ALPHA
        ]
    )
    quantile = np.array([[[5e8 - 1e7 * (1 - level), 5e8 + 1e7 * (1 - level)] for level in ALPHA]])
    found = xarray.Dataset(
        {
            "cdf": (("alpha", "bound", "stress"), cdf),
            "quantile": (("probability", "alpha", "bound"), quantile),
            "exceedance": (("alpha", "bound"), cdf[:, :, 30], {"limit": 4.3e8}),
        },
        {"alpha": ALPHA, "stress": STRESS, "probability": [0.5], "bound": ["lower", "upper"]},
        {"quantity": "s11"},
    )
    return response(found).axes[0]


@pytest.mark.parametrize(
    ("width", "levels"),
    [(0.2, ["α = 0", "α = 0.5", "α = 1"]), (0.006, ["α = 0", "α = 1"]), (0.0, ["α = 1"])],
)
def test_the_legend_has_the_bands_that_are_there(width, levels):
    axes = picture(width)
    assert [text.get_text() for text in axes.get_legend().get_texts()] == levels
    plt.close("all")


def test_the_limit_is_named_above_the_curves():
    (text,) = [text for text in picture(0.2).texts if "limit 0.43 GPa" in text.get_text()]
    assert text.get_position() == pytest.approx((0.43, 1.02))
    plt.close("all")
