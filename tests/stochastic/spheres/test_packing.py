from time import perf_counter

import numpy as np
import pytest

from alphacut.stochastic.errors import RefusedError
from alphacut.stochastic.particles.radius_laws import LogNormalRadii
from alphacut.stochastic.spheres import power_cells
from alphacut.stochastic.spheres.packing import SpherePacking
from alphacut.stochastic.spheres.power_cells import cell_volumes, reduced_radii, volume_fraction
from alphacut.stochastic.spheres.spheres import Spheres

LAW = LogNormalRadii(1e-3, 1e-2)


@pytest.mark.parametrize("fraction", [0.05, 0.2092, 0.35, 0.5])
def test_spheres_fill_what_they_shall_without_overlap(fraction):
    packing = SpherePacking(600, fraction, LAW).make(np.random.default_rng(2))
    assert packing.volume_fraction == pytest.approx(fraction, rel=1e-12)
    apart = packing.centres[:, None] - packing.centres
    apart -= packing.side * np.round(apart / packing.side)
    gaps = np.linalg.norm(apart, axis=-1) - packing.radii[:, None] - packing.radii
    np.fill_diagonal(gaps, np.inf)
    assert gaps.min() >= 0
    assert packing.smallest_gap() == pytest.approx(gaps.min(), abs=1e-15)


def test_overlaps_are_measured():
    pair = Spheres(np.array([[0.05, 0.5, 0.5], [0.95, 0.5, 0.5]]), np.array([0.06, 0.07]), 1.0)
    assert pair.smallest_gap() == pytest.approx(-0.03)


def test_two_cells_of_known_volume():
    """Radical planes of two spheres: shifted from the middle by (R1² − R2²)/2d, on both sides."""
    pair = Spheres(np.array([[0.25, 0.5, 0.5], [0.75, 0.5, 0.5]]) * 2, np.array([0.4, 0.2]), 2.0)
    shift = (0.4**2 - 0.2**2) / 2  # d = 1, towards the smaller, at both of its walls
    np.testing.assert_allclose(
        cell_volumes(pair), [4 * (1 + 2 * shift), 4 * (1 - 2 * shift)], rtol=1e-5
    )


def test_reduced_radii_keep_the_volume_fraction():
    packings = [SpherePacking(300, 0.3, LAW).make(np.random.default_rng(k)) for k in (1, 2)]
    sample = reduced_radii(packings)
    assert volume_fraction(sample) == pytest.approx(0.3, rel=1e-6)
    assert np.unique(sample.groups).size == 2
    assert sample.values[0] > 0


def test_sections_show_the_volume_fraction():
    """Delesse's principle: area fraction of random planes, 40 packings, within 3 standard errors."""
    shares = []
    for seed in range(40):
        generator = np.random.default_rng(seed)
        packing = SpherePacking(150, 0.2, LAW).make(generator)
        circles = packing.section(seed % 3, generator.uniform(0, packing.side))
        shares.append(np.pi * (circles**2).sum() / packing.side**2)
    assert abs(np.mean(shares) - 0.2) < 3 * np.std(shares, ddof=1) / np.sqrt(len(shares))


@pytest.mark.slow
def test_ten_thousand_spheres_in_a_minute():
    start = perf_counter()
    packing = SpherePacking(10_000, 0.2092, LAW).make(np.random.default_rng(0))
    sample = reduced_radii([packing])
    assert perf_counter() - start <= 60
    assert volume_fraction(sample) == pytest.approx(0.2092, rel=1e-6)


def test_what_cannot_be_packed_is_refused():
    with pytest.raises(RefusedError, match="too large for its periodic cube"):
        SpherePacking(2, 0.2, LAW).make(np.random.default_rng(0))


def test_overlapping_spheres_and_a_missing_program_are_refused(monkeypatch):
    hidden = Spheres(np.array([[0.5, 0.5, 0.5], [0.5, 0.5, 0.45]]), np.array([0.3, 0.01]), 1.0)
    with pytest.raises(RefusedError, match="1 spheres have none: do they overlap"):
        cell_volumes(hidden)
    monkeypatch.setattr(power_cells.shutil, "which", lambda name: None)
    with pytest.raises(RefusedError, match="install Debian's package voro"):
        cell_volumes(hidden)
