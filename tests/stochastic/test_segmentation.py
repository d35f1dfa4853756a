"""A segmentation is judged before anything rests on it."""

import numpy as np
import pytest

from alphacut.stochastic.segmentation import CONFIDENT, segment
from tests.refused import refuses

SIZE = 96


def picture(rng, *, contrast=100.0, blur=1.0, noise=0.0, drift=0.0):
    """Grey values of discs from 60 up, and how far each pixel is covered, shape (SIZE, SIZE)."""
    places, cover = (np.arange(SIZE) + 0.5) / SIZE, np.zeros((SIZE, SIZE))
    for radius in rng.uniform(0.05, 0.1, 12):
        x, y = rng.random(2)
        across, up = ((places - c + 0.5) % 1 - 0.5 for c in (x, y))
        distance = (radius - np.hypot(across, up[:, None])) * SIZE
        edge = np.clip(0.5 + distance / (2 * blur), 0, 1) if blur else distance > 0
        cover = np.maximum(cover, edge)
    v, u = np.meshgrid(*(np.linspace(-1, 1, SIZE),) * 2, indexing="ij")
    light = np.tensordot(rng.normal(size=5), [u, v, u * u / 2, u * v / 2, v * v / 2], axes=1)
    light = drift * contrast * (light - light.mean()) / np.ptp(light)
    grain = noise * contrast * rng.normal(size=cover.shape)
    return np.rint(60 + contrast * cover + light + grain), cover


@pytest.mark.parametrize(("noise", "drift"), [(0.02, 0.0), (0.1, 0.0), (0.02, 0.3), (0.05, 0.2)])
def test_noise_and_light_are_measured(noise, drift):
    grey, _ = picture(np.random.default_rng(4), noise=noise, drift=drift)
    judged = segment(grey, [110])
    assert judged.noise == pytest.approx(100 * noise, rel=0.15)
    assert judged.drift == pytest.approx(100 * drift, abs=5)
    assert judged.levels[1] - judged.levels[0] == pytest.approx(100, rel=0.03)


def test_a_clean_image_is_as_sharp_as_its_threshold():
    grey, cover = picture(np.random.default_rng(0))
    judged = segment(grey, [110])
    assert judged.open_fraction == 0
    assert judged.fractions[1] == np.mean(grey >= 110)
    mask = segment(255 * (cover >= 0.5), [128])  # an image of two values is taken as it is
    assert mask.open_fraction == 0
    assert mask.fractions[1] == np.mean(cover >= 0.5)


def test_a_border_is_open_by_the_deviations_of_the_noise():
    """A ramp of grey values: what is open is as wide as the confidence says, no less."""
    rng, noise = np.random.default_rng(1), 4.0
    plain = np.repeat([0.0, 100.0], 200)
    plain[180:220] = np.linspace(0, 100, 40)
    judged = segment(plain + noise * rng.normal(size=(100, 400)), [50])
    first, last = judged.ranges()
    truly = plain >= 50
    sure = first == last
    assert np.mean((first[sure] > 0) != np.broadcast_to(truly, first.shape)[sure]) < 1e-4
    assert (~sure).sum() == pytest.approx(100 * 40 / 100 * 2 * CONFIDENT * noise, rel=0.2)


@pytest.mark.parametrize(("noise", "drift"), [(0.15, 0.0), (0.02, 0.9)])
def test_what_noise_and_light_leave_too_open_is_refused(noise, drift):
    grey, _ = picture(np.random.default_rng(2), noise=noise, drift=drift)
    with refuses("threshold") as error:
        segment(grey, [110]).require_certain()
    assert error.value.key == "threshold"


def test_a_threshold_beyond_the_grey_values_is_refused():
    with refuses("threshold"):
        segment(np.random.default_rng(0).normal(size=(9, 9)), [30])


@pytest.mark.parametrize("ends", [(60, 255), (0, 160), (75, 255), (55, 150), (62, 158)])
def test_clipped_grey_values_are_refused(ends):
    grey, _ = picture(np.random.default_rng(6), noise=0.05)
    with refuses("image"):
        segment(np.clip(grey, *ends), [110])


@pytest.mark.parametrize("noise", [0.0, 0.002, 0.1])
@pytest.mark.parametrize("drift", [0.0, 0.3])
def test_grey_values_that_are_rounded_are_not_clipped(noise, drift):
    for seed in range(3):
        rng = np.random.default_rng([seed, 7])
        segment(picture(rng, noise=noise, drift=drift, blur=seed)[0], [110])


def salt_and_pepper(grey, rng):
    places = rng.random(grey.shape) < 0.03
    grey[places] = rng.choice([0.0, 255.0], places.sum())
    return places


def scratches(grey, rng):
    places = np.zeros(grey.shape, bool)
    places[:, rng.choice(np.arange(5, SIZE, 10), 3, replace=False)] = True
    grey[places] = 250.0
    return places


@pytest.mark.parametrize("noise", [0.0, 0.05])
@pytest.mark.parametrize("spoilt", [salt_and_pepper, scratches])
def test_impulses_and_scratches_are_in_doubt(spoilt, noise):
    rng = np.random.default_rng(5)
    grey, _ = picture(rng, noise=noise)
    before = segment(grey, [110]).open_fraction
    places = spoilt(grey, rng)
    first, last = segment(grey, [110]).ranges()
    assert (first < last)[places].mean() > 0.9
    assert (first < last)[~places].mean() < before + 0.02
    grey[rng.random(grey.shape) < 0.06] = 255
    with refuses("threshold"):
        segment(grey, [110]).require_certain()


def test_clean_lines_of_one_pixel_and_three_greys_are_not_called_clipped():
    lines, three = np.full((2, 60, 60), 50.0)
    lines[::7] = lines[20:40, 20:40] = 150.0
    three[10:30, 10:40], three[40:50] = 150.0, 200.0
    for grey in (lines, three):
        result = segment(grey, [100])
        result.require_certain()
        assert result.open_fraction == 0
        assert result.fractions[1] == np.mean(grey > 100)
