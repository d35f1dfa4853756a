"""Random threshold, directions, grains, the picture of the error, reading of images."""

import numpy as np
import pytest
from scipy.special import ndtr

from alphacut.rve.anisotropy import directional_young
from alphacut.rve.image.bounds import StiffnessBounds
from alphacut.rve.image.directions import directions
from alphacut.rve.image.fields.conjugate_gradient import ConjugateGradient
from alphacut.rve.image.gap import constitutive_gap
from alphacut.rve.image.model import ImageModel, usual_division
from alphacut.rve.image.moduli import ModuliInterval, PlaneModuli, grain_modulus
from alphacut.rve.image.phase_images import ModuliImages
from alphacut.rve.image.random_threshold import (
    NormalThreshold,
    threshold_nodes,
    threshold_response,
)
from alphacut.rve.image.read import read_grey, require_memory, require_phases
from alphacut.rve.image.solve import solve_image

PHASES = [ModuliInterval.crisp(PlaneModuli.of_young(e, 0.3)) for e in (20.0, 80.0)]


def ramp(size=16):
    """Periodic grey values between 0 and 1, every pixel another."""
    x, y = np.meshgrid(*(2 * np.pi * (np.arange(size) + 0.5) / size,) * 2)
    return 0.5 + 0.2 * np.sin(x) + 0.2 * np.cos(2 * y + x) + 0.05 * np.sin(3 * y)


@pytest.fixture(scope="module")
def response():
    return threshold_response(ramp(), np.linspace(0.2, 0.8, 9), PHASES)


def test_the_mean_and_quantiles_hold_those_of_samples(response):
    rng, grey = np.random.default_rng(0), ramp()
    law = NormalThreshold((0.5, 0.5), (0.08, 0.08))
    ends = []
    for threshold in rng.normal(0.5, 0.08, 25):
        moduli = [
            np.where(grey >= threshold, b, a)
            for a, b in zip(*((p.lower.bulk, p.lower.shear) for p in PHASES), strict=True)
        ]
        ends.append(solve_image(*moduli).bounds.modulus)
    samples = np.mean(ends, axis=1)
    error = samples.std(ddof=1) / np.sqrt(len(samples))
    low, high = response.mean(law)
    assert low - 4 * error < samples.mean() < high + 4 * error
    assert high - low < 0.35 * samples.mean()
    for share in (0.25, 0.5, 0.75):
        low, high = response.quantile(law, share)
        assert np.mean(samples <= low) < share + 0.2
        assert np.mean(samples <= high) > share - 0.2


@pytest.mark.parametrize("seed", range(5))
def test_laws_within_an_interval_stay_within_its_bounds(response, seed):
    rng = np.random.default_rng(seed)
    mean, deviation = np.sort(rng.uniform(0.3, 0.7, 2)), np.sort(rng.uniform(0.01, 0.2, 2))
    whole = NormalThreshold(tuple(mean), tuple(deviation))
    for _ in range(20):
        m, s = rng.uniform(*mean), rng.uniform(*deviation)
        law = NormalThreshold((m, m), (s, s))
        for share in (None, 0.1, 0.5, 0.95):
            outer, inner = (
                response.mean(x) if share is None else response.quantile(x, share)
                for x in (whole, law)
            )
            assert outer[0] <= inner[0] + 1e-12
            assert inner[1] <= outer[1] + 1e-12


def test_a_random_threshold_needs_ordered_phases():
    crossed = [ModuliInterval.crisp(PlaneModuli(*pair)) for pair in ((1.0, 3.0), (3.0, 1.0))]
    with pytest.raises(ValueError, match="one phase that is stiffer"):
        threshold_response(ramp(8), [0.4, 0.6], crossed)


def test_the_law_of_e_needs_an_e_that_rises_with_the_stiffness():
    auxetic = [ModuliInterval.crisp(PlaneModuli.of_young(e, -0.5)) for e in (20.0, 80.0)]
    found = threshold_response(ramp(8), [0.4, 0.6], auxetic)
    law = NormalThreshold((0.5, 0.5), (0.1, 0.1))
    assert found.stiffness(law).modulus[0] > 0  # of the mean stiffness nothing need rise
    for law_of_e in (lambda: found.mean(law), lambda: found.quantile(law, 0.5)):
        with pytest.raises(ValueError, match=r"1\.61 times .* falls as A rises: give the thr"):
            law_of_e()


def exact(grey, law, phases=PHASES):
    """Probabilities of an image's steps, rising thresholds, and bounds of E and stiffness there."""
    values = np.unique(grey)
    below = ndtr((values - law.mean[0]) / law.deviation[0])
    found = []
    for value in [*values, np.inf]:  # thresholds up to a grey value, above the one before: an image
        moduli = [
            np.where(grey >= value, b, a)
            for a, b in zip(*((p.lower.bulk, p.lower.shear) for p in phases), strict=True)
        ]
        found.append(solve_image(*moduli).bounds)
    return np.diff(below, prepend=0.0, append=1.0), found


STEPPED = np.round(8 * ramp(12))
GREYS = {
    "integers": (STEPPED, 4.5),
    "threshold at a grey value": (STEPPED, 4.0),
    "fractions": (0.37 * STEPPED - 1.1, 0.37 * 4.4 - 1.1),
    "two values": (np.where(ramp(12) > 0.5, 1, 0), 0.5),
    "one value": (np.full((2, 2), 3.0), 2.0),
    "threshold beyond all greys": (STEPPED, 12.0),
}


@pytest.mark.parametrize("deviation", [1e-9, 1e-6, 1e-3, 0.1, 0.3, 1.0, 10.0])
@pytest.mark.parametrize("kind", GREYS)
def test_a_random_threshold_of_any_deviation_is_as_close_as_its_images(kind, deviation):
    grey, mean = GREYS[kind]
    law = NormalThreshold((mean, mean), (deviation, deviation))
    found = threshold_response(grey, threshold_nodes(grey, law), PHASES)
    shares, images = exact(grey, law)
    lower, upper = (
        np.tensordot(shares, [getattr(image, end) for image in images], axes=1)
        for end in ("lower", "upper")
    )
    whole, (low, high) = found.stiffness(law), StiffnessBounds(lower, upper).modulus
    assert np.linalg.eigvalsh(upper - whole.lower)[0] > 0
    assert np.linalg.eigvalsh(whole.upper - lower)[0] > 0
    assert whole.modulus[1] - whole.modulus[0] < 1.2 * (high - low) + 0.01
    ends = np.array([found.quantile(law, share) for share in (0.05, 0.3, 0.5, 0.7, 0.95)])
    assert (np.diff(ends, axis=0) >= 0).all()
    over = np.cumsum(shares)  # E falls with the threshold: its quantile is that of 1 - share
    for share, (low, high) in zip((0.05, 0.3, 0.7, 0.95), ends[[0, 1, 3, 4]], strict=True):
        least, most = images[int(np.searchsorted(over, 1 - share))].modulus
        assert low <= most
        assert least <= high
        assert high - low < 1.2 * (most - least) + 0.01


def test_a_node_beyond_the_reach_of_many_grey_values_leaves_no_probability_to_the_phases():
    grey, law = 1000 * ramp(12), NormalThreshold((500.0, 500.0), (60.0, 60.0))
    nodes = threshold_nodes(grey, law)
    assert len(np.unique(grey[abs(grey - 500) < 240])) > 65
    assert nodes[0] <= grey[grey <= 260].max()
    assert nodes[-1] >= grey[grey >= 740].min()


@pytest.mark.parametrize("order", [1, -1])
def test_few_grey_values_give_the_mean_as_close_as_their_images(order):
    grey = np.round(8 * ramp(12)).astype(int)
    law, phases = NormalThreshold((4.2, 4.2), (0.9, 0.9)), PHASES[::order]
    nodes = threshold_nodes(grey, law)
    found = threshold_response(grey, nodes, phases)
    low, high = found.mean(law)
    shares, images = exact(grey, law, phases)
    least, most = shares @ [image.modulus for image in images]
    assert low <= most
    assert least <= high
    assert high - low < 1.5 * (most - least) + 0.002 * least
    whole = found.stiffness(law)
    assert whole.width < 0.05
    assert whole.modulus[0] < high
    assert low < whole.modulus[1]
    for share in (0.2, 0.8):
        ends = found.quantile(law, share)
        assert ends[0] <= ends[1] <= 80.0 + 1e-9


def test_fewer_nodes_hold_what_more_nodes_give(response):
    coarse = threshold_response(ramp(), [0.2, 0.5, 0.8], PHASES)
    law = NormalThreshold((0.45, 0.5), (0.08, 0.1))
    wide, narrow = coarse.mean(law), response.mean(law)
    assert wide[0] < narrow[0] < narrow[1] < wide[1]
    outer, inner = coarse.stiffness(law), response.stiffness(law)
    assert np.linalg.eigvalsh(inner.lower - outer.lower)[0] > 0
    assert np.linalg.eigvalsh(outer.upper - inner.upper)[0] > 0
    for share in (0.1, 0.5, 0.9):
        wide, narrow = coarse.quantile(law, share), response.quantile(law, share)
        assert wide[0] <= narrow[0] < narrow[1] <= wide[1]


def test_a_response_over_falling_stiffness_is_that_of_the_mirrored_image():
    law = NormalThreshold((0.45, 0.55), (0.05, 0.1))
    nodes = np.linspace(0.2, 0.8, 5)
    first = threshold_response(ramp(12), nodes, PHASES)
    second = threshold_response(-ramp(12), -nodes[::-1], PHASES[::-1])
    assert second.sign == -1
    assert np.allclose(first.mean(law), second.mean(law.mirrored), rtol=1e-6)
    assert np.allclose(first.quantile(law, 0.1), second.quantile(law.mirrored, 0.1), rtol=1e-6)


def test_the_constitutive_gap_is_nowhere_negative_and_sums_to_the_distance_of_the_bounds():
    mask = ramp(16) > 0.5
    moduli = [np.where(mask, b, a) for a, b in ((2.0, 30.0), (1.0, 20.0))]
    found = solve_image(*moduli, solver=ConjugateGradient(1e-11), pixels=True)
    for strain in (
        np.array([1.0, 1.0, 0.0]),
        np.array([0.0, 0.0, 1.0]),
        np.array([1.0, -0.5, 0.3]),
    ):
        gap = constitutive_gap(found, strain)
        distance = strain @ (found.bounds.upper - found.bounds.lower) @ strain
        assert gap.min() > -1e-10 * gap.max()
        assert np.isclose(gap.mean(), distance, rtol=1e-6)
    assert gap.max() > 4 * gap.mean()


def test_the_gap_needs_the_energies_of_the_pixels():
    found = solve_image(np.ones((4, 4)), np.ones((4, 4)))
    with pytest.raises(ValueError, match="pixels=True"):
        constitutive_gap(found, np.ones(3))


@pytest.mark.parametrize(("contrast", "rows", "parts"), [(9, 4, 2), (11, 4, 1), (9, 1 << 19, 1)])
def test_pixels_are_divided_where_that_is_cheap(contrast, rows, parts):
    image = np.ones((rows, 4))
    image[0] = contrast
    assert usual_division(ModuliImages((image, image), (image, image), attained=True)) == parts


def test_a_width_asked_for_is_reached_by_more_parts():
    mixed = np.where(ramp() > 0.5, 3.0, 1.0)
    images = ModuliImages((mixed, mixed), (mixed, mixed), attained=True)
    _, usual = ImageModel().refined(images)
    model, found = ImageModel(width=usual.bounds.width / 2).refined(images)
    assert model.parts == 4
    assert found.bounds.width <= usual.bounds.width / 2


def test_directions_hold_the_moduli_of_a_stiffness_between():
    root = np.random.default_rng(0).normal(size=(3, 3))
    stiffness = 10 * np.eye(3) + root @ root.T
    found = directions(StiffnessBounds(0.98 * stiffness, 1.03 * stiffness))
    exact = directional_young(stiffness, found.angle)
    assert (found.lower < exact).all()
    assert (exact < found.upper).all()
    assert found.least[0] <= exact.min() <= found.least[1]
    assert found.greatest[0] <= exact.max() <= found.greatest[1]
    assert found.distance > 0.01


def test_an_isotropic_stiffness_is_its_own_nearest():
    k, g = 7.0, 3.0
    stiffness = np.array([[k + g, k - g, 0], [k - g, k + g, 0], [0, 0, g]])
    found = directions(StiffnessBounds(stiffness, stiffness))
    assert np.allclose(found.isotropic, (k, g))
    assert found.distance < 1e-14


def test_the_interval_of_grains_is_that_of_the_literature():
    phases = [PlaneModuli.of_young(e, 0.3) for e in (20.0, 80.0)]
    low, high = grain_modulus([1 - 0.2092, 0.2092], phases, phases)
    assert abs(low - 25.78) < 0.005  # fibres of these phases have 24.77
    assert low < high < 0.7908 * 20 + 0.2092 * 80


def saved(folder, name, values, **options):
    image = pytest.importorskip("PIL.Image")
    path = folder / name
    image.fromarray(values, **options).save(path)
    return path


@pytest.mark.parametrize("name", ["a.png", "a.tif", "a.tiff"])
@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
def test_eight_and_sixteen_bits_are_read_as_they_are(tmp_path, name, kind):
    values = np.random.default_rng(0).integers(0, np.iinfo(kind).max, (5, 7)).astype(kind)
    found = read_grey(saved(tmp_path, name, values))
    assert np.array_equal(found, values[::-1])
    assert found.dtype.itemsize >= values.dtype.itemsize


def test_numpy_files_are_read(tmp_path):
    values = np.random.default_rng(0).normal(size=(4, 6))
    np.save(tmp_path / "a.npy", values)
    assert np.array_equal(read_grey(tmp_path / "a.npy"), values[::-1])


def test_images_that_are_not_plane_grey_are_refused(tmp_path):
    image = pytest.importorskip("PIL.Image")
    colour = saved(tmp_path, "c.png", np.zeros((4, 4, 3), np.uint8))
    with pytest.raises(ValueError, match=r"c\.png has several channels \(RGB\)"):
        read_grey(colour)
    image.open(colour).quantize(4).save(tmp_path / "p.png")
    with pytest.raises(ValueError, match=r"p\.png has a palette"):
        read_grey(tmp_path / "p.png")
    (tmp_path / "t.png").write_text("no image")
    with pytest.raises(ValueError, match=r"t\.png cannot be read"):
        read_grey(tmp_path / "t.png")
    np.save(tmp_path / "n.npy", np.array([[1.0, np.nan], [0.0, 1.0]]))
    with pytest.raises(ValueError, match="1 values that are not finite"):
        read_grey(tmp_path / "n.npy")
    np.save(tmp_path / "l.npy", np.arange(5.0))
    with pytest.raises(ValueError, match="one plane of 2 × 2"):
        read_grey(tmp_path / "l.npy")


def test_an_image_too_large_for_memory_is_told_with_a_window_that_fits():
    with pytest.raises(ValueError, match=r"1000000 × 1000000 pixels .* GB .* crop a window of"):
        require_memory(1_000_000, 1_000_000, 1)


@pytest.mark.parametrize(
    ("grey", "thresholds", "told"),
    [
        (np.full((2, 2), 7), ((3.0, 3.0),), "one grey value, 7"),
        (np.arange(4).reshape(2, 2), ((9.0, 9.0),), r"threshold 9 is outside: .* from 0 to 3"),
        (np.arange(4).reshape(2, 2), ((0.0, 2.0),), r"threshold \[0, 2\] is outside"),
        (np.array([[10, 60000]], np.uint16), ((128.0, 128.0),), "one of 8 bits, the image has 16"),
        (
            np.array([[0, 9]]),
            ((2.0, 3.0), (4.0, 5.0)),
            "no pixel lies between the thresholds 3 and 4: the grey values lie from 0 to 9",
        ),
        (np.arange(9), ((6.0, 6.0), (3.0, 3.0)), "thresholds 6 and 3: they must rise"),
        (np.arange(9), ((2.0, 5.0), (4.0, 4.0)), "thresholds 5 and 4: .* their supports apart"),
    ],
)
def test_thresholds_that_leave_a_phase_empty_are_refused(grey, thresholds, told):
    with pytest.raises(ValueError, match=told):
        require_phases(grey, thresholds)
