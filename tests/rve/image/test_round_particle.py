"""The model `image` of the round particle, against the series."""

import numpy as np
import pytest

from alphacut.entry import main
from alphacut.rve import Phase, named
from alphacut.rve.cell import square_moduli
from alphacut.rve.image.bounds import StiffnessBounds
from alphacut.rve.image.round_particle import RasterModel
from alphacut.rve.series.stiffness import square_stiffness
from alphacut.stochastic import HermiteMap, TruncatedNormal


def random_phases(rng):
    return [Phase(10 ** rng.uniform(9, 11), rng.uniform(-0.2, 0.45)) for _ in range(2)]


@pytest.mark.parametrize("seed", range(3))
def test_the_modulus_is_the_series_within_the_declared_error(seed):
    rng = np.random.default_rng(seed)
    matrix, inclusion = random_phases(rng)
    radius = HermiteMap(0.25, 0.3, rng.uniform(0.4, 0.7), 0.3, TruncatedNormal(-3.0, 3.0))
    (found,) = named("image", pixels=32, points=3).solve(radius, matrix, [inclusion])
    (exact,) = named("series").solve(radius, matrix, [inclusion])
    assert found.method == "image"
    ratio = found.modulus / exact.modulus
    assert max(ratio, 1 / ratio) - 1 <= found.estimated_error < 0.3
    assert (found.curve.error > 0).all()


@pytest.mark.parametrize("seed", range(5))
def test_the_errors_of_a_slice_are_proved(seed):
    rng = np.random.default_rng(seed)
    (matrix, inclusion), radius = random_phases(rng), float(rng.uniform(0.1, 0.95))
    bounds = RasterModel(pixels=16).slice(radius, matrix, inclusion).bounds
    middle = square_moduli((bounds.lower + bounds.upper) / 2)
    exact = square_moduli(square_stiffness(np.array([radius]), matrix, [inclusion]).matrix[0, 0])
    assert (exact >= middle / (1 + bounds.relative_error)).all()
    assert (exact <= middle * (1 + bounds.relative_error)).all()


def test_the_relative_error_reaches_both_bounds():
    found = StiffnessBounds(np.eye(3), 3 * np.eye(3)).relative_error
    assert np.allclose(found, 1.0)  # 2 lies a factor 2 above 1, a factor 1.5 below 3


@pytest.mark.parametrize("options", [{"pixels": 7}, {"pixels": 6}, {"points": 1}])
def test_settings_out_of_range_are_refused(options):
    with pytest.raises(ValueError, match=r"take an even number|at least 2"):
        named("image", **options)


@pytest.mark.slow
def test_the_command_takes_it_as_a_method_and_checks_its_tolerance(capfd):
    command = ["cell", "cases/paper.toml", "--method", "image"]
    assert main([*command, "--tolerance", "1e-6", "--quiet"]) == 1
    assert "by method image is up to 0.0" in capfd.readouterr().err
