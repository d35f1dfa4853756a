"""Conductivities of arrays of fibres and spheres by multipoles."""

import numpy as np
import pytest
from scipy.integrate import quad

from alphacut.rve import fibre_conductivity, sphere_conductivity
from alphacut.rve.image.model import ConductionModel
from alphacut.rve.image.phases import ModuliImages
from alphacut.rve.series.fibre_constants import longitudinal_shear
from alphacut.rve.spheres.conduction import cubic_conductivity
from alphacut.stochastic import HermiteMap
from tests.refused import refuses
from tests.rve.image.test_conduction import multipoles


def constant(radius):
    """A map of one radius."""
    return HermiteMap(radius, 0.0, radius, 0.0)


@pytest.mark.parametrize("ratio", [0.01, 30.0])
@pytest.mark.parametrize("radius", [0.3, 0.7, 0.9])
def test_fibres_of_one_radius_are_those_of_multipoles(radius, ratio):
    found = fibre_conductivity(constant(radius), 2.0, 2.0 * ratio)
    fraction = np.pi * radius**2 / 4
    assert found.values["k_T"] == pytest.approx(
        2 * multipoles(fraction, ratio, hexagonal=False), rel=1e-10
    )
    assert found.values["k_L"] == pytest.approx(2 * (1 + fraction * (ratio - 1)), rel=1e-12)


def test_a_random_radius_has_the_mean(rng):
    radii = HermiteMap(*rng.uniform(0.2, 0.8, 4))
    law = radii.distribution

    def mean(values_at):
        """Mean over θ by adaptive quadrature."""
        return quad(lambda t: law.pdf(t) * values_at(float(radii(t))), law.lower, law.upper)[0]

    fibres = fibre_conductivity(radii, 1.0, 5.0)
    exact = mean(lambda r: multipoles(np.pi * r**2 / 4, 5.0, hexagonal=False))
    assert fibres.values["k_T"] == pytest.approx(exact, abs=fibres.errors["k_T"] + 1e-8)
    spheres = sphere_conductivity(radii, 1.0, 5.0)
    exact = mean(lambda r: cubic_conductivity(np.array([r]), 5.0)[0][0])
    assert spheres.values["k"] == pytest.approx(exact, abs=spheres.errors["k"] + 1e-8)


def ball(cells, radius, ratio):
    """Conductivities of voxels below and above those of a ball in a cell of side 2."""
    x = np.abs((np.arange(cells) + 0.5) / cells * 2 - 1)
    places = np.stack(np.meshgrid(x, x, x, indexing="ij"))
    inside = np.sqrt(((places + 1 / cells) ** 2).sum(axis=0)) <= radius
    touched = np.sqrt((np.maximum(places - 1 / cells, 0) ** 2).sum(axis=0)) < radius
    ends = [np.where(mask, ratio, 1.0)[np.newaxis] for mask in (inside, touched)]
    return ModuliImages(*(ends if ratio > 1 else ends[::-1]))


@pytest.mark.parametrize("ratio", [0.02, 20.0])
@pytest.mark.parametrize("radius", [0.5, 0.8, 0.95])
def test_voxels_enclose_the_array_of_spheres(radius, ratio):
    (value,), (error,) = cubic_conductivity(np.array([radius]), ratio)
    bounds = ConductionModel((1.0, 1.0, 1.0)).solve(ball(20, radius, ratio)).bounds
    assert bounds.contains(value * np.eye(3))
    assert error < 1e-9
    fraction = np.pi * radius**3 / 6
    contrast = (ratio - 1) / (ratio + 2)
    dipoles_alone = 1 + 3 * fraction * contrast / (1 - fraction * contrast)
    # What octupoles add to leading order has the factor 1.3047 of the simple cubic lattice.
    octupoles = (ratio - 1) / (ratio + 4 / 3)
    denominator = 1 / contrast - fraction - 1.3047 * octupoles * fraction ** (10 / 3)
    assert value == pytest.approx(1 + 3 * fraction / denominator, rel=fraction**4)
    assert (value > dipoles_alone) == (ratio > 1)


@pytest.mark.parametrize("radius", [0.999, 0.9999, 0.99999, 0.999999])
def test_the_error_of_fibres_that_nearly_touch_covers_the_flux_through_the_gap(radius):
    """Of perfect conductors: π √(r/h) − 1.88 with the gap h (Keller, J. Appl. Phys. 34, 991)."""
    [value], [error] = longitudinal_shear(np.array([radius]), 1.0, 1e12)
    limit = np.pi * np.sqrt(radius / (2 - 2 * radius)) - 1.88
    assert abs(value - limit) <= error * value + 2e-3 * limit


@pytest.mark.parametrize("radius", [0.9999, 0.99999])
def test_the_error_of_spheres_that_nearly_touch_covers_the_flux_through_the_gap(radius):
    """Of perfect conductors: near contact it grows by (π/2) ln of the gap's inverse."""
    far = 0.999
    [start], [start_error] = cubic_conductivity(np.array([far]), 1e6)
    limit = start + np.pi / 2 * np.log((1 - far) / (1 - radius))
    [value], [error] = cubic_conductivity(np.array([radius]), 1e6)
    assert abs(value - limit) <= error * value + start_error * start
    assert error < 2


def test_wrong_conductivities_are_refused():
    for wrong in (0.0, -1.0, np.inf, np.nan):
        for function in (fibre_conductivity, sphere_conductivity):
            with refuses("inclusion"):
                function(constant(0.5), 1.0, wrong)
    with refuses("radius map"):
        fibre_conductivity(lambda theta: theta, 1.0, 2.0)
