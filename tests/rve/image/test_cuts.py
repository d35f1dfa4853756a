"""Guaranteed cuts: fuzzy threshold, fuzzy phases, phases without order."""

import numpy as np
import pytest

from alphacut.rve.image.cuts import ENCLOSED, TWO_CORNERS, ImageBox, each_cut, nested
from alphacut.rve.image.fields.conjugate_gradient import ConjugateGradient
from alphacut.rve.image.moduli import ModuliInterval, PlaneModuli
from alphacut.rve.image.solve import solve_image

FINE = ConjugateGradient(1e-9)


def noise(size, seed):
    """Smooth periodic noise with values in [0, 1], shape (size, size)."""
    rng = np.random.default_rng(seed)
    waves = np.hypot(
        *np.meshgrid(np.fft.fftfreq(size) * size, np.fft.rfftfreq(size) * size, indexing="ij")
    )
    values = np.fft.irfft2(
        np.fft.rfft2(rng.normal(size=(size, size))) * np.exp(-((waves / 5) ** 2)), s=(size, size)
    )
    return (values - values.min()) / np.ptp(values)


def box(alpha, ordered=True):
    """Cut of a fuzzy threshold and of fuzzy K, G of both phases."""
    slack = 1 - alpha
    matrix, particle = ((10.0, 5.0), (40.0, 25.0)) if ordered else ((10.0, 25.0), (40.0, 5.0))
    phases = [
        ModuliInterval(
            *(PlaneModuli.of_bulk(k * (1 + s * slack), g * (1 + s * slack)) for s in (-0.1, 0.1))
        )
        for k, g in (matrix, particle)
    ]
    return ImageBox([(0.5 - 0.05 * slack, 0.5 + 0.05 * slack)], phases)


def sample(cut, rng, grey):
    """Bounds of one image from inside a cut."""
    ends = np.array(cut.thresholds[0])
    mask = grey >= rng.uniform(*ends)
    moduli = []
    for phase in cut.phases:
        lower = (phase.lower.bulk - phase.lower.shear / 3, phase.lower.shear)
        upper = (phase.upper.bulk - phase.upper.shear / 3, phase.upper.shear)
        bulk, shear = rng.uniform(lower, upper)
        moduli.append((bulk + shear / 3, shear))
    bulk, shear = (np.where(mask, b, a) for a, b in zip(*moduli, strict=True))
    return solve_image(bulk, shear).bounds


@pytest.mark.parametrize("ordered", [True, False])
def test_samples_never_leave_the_cut(ordered):
    grey, rng = noise(24, 1), np.random.default_rng(2)
    cuts = [*each_cut(grey, [box(a, ordered) for a in (1.0, 0.5, 0.0)])]
    assert [cut.nature for cut in cuts] == [
        TWO_CORNERS,
        *[TWO_CORNERS if ordered else ENCLOSED] * 2,
    ]
    for cut, alpha in zip(cuts, (1.0, 0.5, 0.0), strict=True):
        for _ in range(6):
            found = sample(box(alpha, ordered), rng, grey)
            assert np.linalg.eigvalsh(cut.bounds.upper - found.lower)[0] > 0
            assert np.linalg.eigvalsh(found.upper - cut.bounds.lower)[0] > 0
            assert cut.bounds.contains((found.lower + found.upper) / 2)


def test_the_ends_are_those_of_the_two_corners_solved_in_full():
    grey, cut = noise(32, 3), box(0.0)
    found = [*each_cut(grey, [box(1.0), cut])][1].bounds
    for end, threshold in ((0, cut.thresholds[0][1]), (1, cut.thresholds[0][0])):
        sides = [(p.lower, p.upper)[end] for p in cut.phases]
        mask = grey >= threshold
        corner = solve_image(
            np.where(mask, sides[1].bulk, sides[0].bulk),
            np.where(mask, sides[1].shear, sides[0].shear),
            solver=FINE,
        ).bounds
        exact, near = ((corner.lower, found.lower), (corner.upper, found.upper))[end]
        assert np.abs(near - exact).max() < 1e-4 * np.abs(exact).max()


def test_three_phases_and_two_thresholds():
    grey = noise(24, 4)
    phases = [
        ModuliInterval.crisp(PlaneModuli(k, g)) for k, g in ((1.0, 0.5), (3.0, 2.0), (9.0, 6.0))
    ]
    cut = next(each_cut(grey, [ImageBox([(0.3, 0.4), (0.6, 0.6)], phases)]))
    labels = np.digitize(grey, [0.35, 0.6])
    moduli = np.array([(1.0, 0.5), (3.0, 2.0), (9.0, 6.0)])[labels]
    inside = solve_image(moduli[..., 0], moduli[..., 1]).bounds
    assert cut.bounds.contains((inside.lower + inside.upper) / 2)
    assert cut.nature == TWO_CORNERS


@pytest.mark.parametrize("seed", range(5))
def test_an_interval_of_poisson_ratios_is_enclosed(seed):
    rng = np.random.default_rng(seed)
    ratios = np.sort(rng.uniform(-0.5, 0.45, 2))
    interval = ModuliInterval.of_young((2.0, 3.0), tuple(ratios))
    assert not interval.attained
    for young, poisson in zip(rng.uniform(2, 3, 500), rng.uniform(*ratios, 500), strict=True):
        moduli = PlaneModuli.of_young(young, poisson)
        assert interval.lower.bulk <= moduli.bulk <= interval.upper.bulk
        assert interval.lower.shear <= moduli.shear <= interval.upper.shear


def test_nested_cuts_hold_those_before():
    assert nested([(2.0, 3.0), (2.5, 4.0), (1.0, 3.5)]) == [(2.0, 3.0), (2.0, 4.0), (1.0, 4.0)]


@pytest.mark.parametrize(
    ("thresholds", "phases", "told"),
    [
        ([(0.1, 0.2)], 3, "1 thresholds part 2 phases; 3 are given"),
        ([(0.5, 0.5), (0.3, 0.6)], 3, "do not rise"),
        ([(0.5, 0.4)], 2, "runs backwards"),
    ],
)
def test_boxes_that_do_not_fit_are_refused(thresholds, phases, told):
    phase = ModuliInterval.crisp(PlaneModuli(1.0, 1.0))
    with pytest.raises(ValueError, match=told):
        ImageBox(thresholds, [phase] * phases)
