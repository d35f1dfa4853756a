"""Scale bars and captions are found, named and cut; particles that are not round are told by what
their circles leave uncovered.
"""

import itertools
from types import SimpleNamespace

import numpy as np
import pytest

from alphacut.report.material import discs
from alphacut.stages.material.micrograph import compared, fractions
from alphacut.stochastic.particles.annotation import cropped, rectangles
from alphacut.stochastic.particles.image import LIGHT, MISFIT, STRANGERS, UNEVEN, SectionImage

SIDE = 300


def section(generator, aspect=1.0, count=60, noise=12.0, dark=False):
    """Particles of one aspect ratio that may touch, at random angles, grey and noisy."""
    y, x = np.mgrid[:SIDE, :SIDE] + 0.5
    mask, placed = np.zeros((SIDE, SIDE), bool), []
    while len(placed) < count:
        at, angle, radius = generator.uniform(0, SIDE, 2), generator.uniform(0, np.pi), 12.0
        if all(np.hypot(*(at - other)) > 0.95 * 2 * radius for other in placed):
            placed.append(at)
            u = (x - at[0]) * np.cos(angle) + (y - at[1]) * np.sin(angle)
            v = (y - at[1]) * np.cos(angle) - (x - at[0]) * np.sin(angle)
            mask |= (u**2 / aspect + v**2 * aspect) < radius**2
    grey = np.where(mask != dark, 170, 80) + generator.normal(0, noise, mask.shape)
    return np.clip(grey, 0, 255).round()


@pytest.mark.parametrize(
    ("box", "grey"), [((200, 270, 300, 300), 0), ((0, 0, 90, 20), 255), ((0, 280, 300, 300), 128)]
)
def test_a_drawn_rectangle_is_named_with_the_crop_that_cuts_it(box, grey):
    picture = section(np.random.default_rng(), count=30)
    left, top, right, bottom = box
    picture[top:bottom, left:right] = grey
    picture[top + 6 : top + 9, left + 10 : left + 50] = 255 - grey  # the bar itself
    (found,) = rectangles(picture)[:1]
    assert found.box == pytest.approx(box, abs=1)
    with pytest.raises(ValueError, match=r"rectangle of one grey.*crop = \[.*cuts it off") as told:
        cropped(picture, None, "bar.png")
    part = tuple(map(int, str(told.value).split("crop = [")[1].split("]")[0].split(", ")))
    left_over = cropped(picture, part, "bar.png")
    assert left_over.size > 0.85 * picture.size
    assert cropped(picture, (0, 0, SIDE, SIDE), "bar.png") is not None  # taken as it is, on request


@pytest.mark.parametrize("noise", [0.0, 6.0])
def test_no_micrograph_of_discs_is_taken_for_a_caption(noise):
    picture = section(np.random.default_rng(), noise=noise)
    assert cropped(picture, None, "discs.png").shape == picture.shape


def test_a_part_outside_the_image_is_refused():
    with pytest.raises(ValueError, match=r"must lie in its 300 × 300 pixels"):
        cropped(section(np.random.default_rng(), count=5), (0, 0, 301, 100), "x.png")


@pytest.mark.parametrize("dark", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_discs_that_touch_are_covered_by_their_circles_and_ellipses_are_not(dark):
    generator = np.random.default_rng()
    kind = "dark" if dark else "bright"
    read = SectionImage("d.png", 1.0, kind).circles(section(generator, dark=dark))
    assert read.misfit < 0.7 * MISFIT
    picture = section(generator, aspect=1.8, dark=dark)
    with pytest.raises(ValueError, match=r"not round"):
        SectionImage("e.png", 1.0, kind).circles(picture)
    found = SectionImage("e.png", 1.0, kind, drop=True).circles(picture)
    assert found.misfit > 1.2 * MISFIT


def test_pieces_that_pass_as_round_are_judged_by_what_their_circles_leave_out():
    """One picture: among others a piece whose neighbours flatten it is refused before."""
    picture = section(np.random.default_rng(1), aspect=1.8, count=35)
    with pytest.raises(ValueError, match=r"lies outside the circles that would stand for them"):
        SectionImage("e.png", 1.0, "bright", roundness=0.2).circles(picture)


def test_the_wrong_phase_is_named_and_naming_it_ends_the_refusal():
    y, x = np.mgrid[:200, :200]
    centres = [(50, 50), (50, 140), (140, 60), (145, 145), (100, 100)]
    grey = np.sum([(x - a) ** 2 + (y - b) ** 2 < 18**2 for a, b in centres], axis=0)
    for kind, other, sign in (("dark", "bright", 1.0), ("bright", "dark", -1.0)):
        with pytest.raises(ValueError, match=f'the {other} phase is round: .*"{other}".$') as told:
            SectionImage("phase.png", 1.0, kind).circles(sign * grey)
        assert "drop" not in str(told.value)
        assert len(SectionImage("phase.png", 1.0, other).circles(sign * grey).discs) == 5


def test_uneven_light_of_few_discs_is_evened_or_named():
    y, x = np.mgrid[:200, :200]
    centres = [(50, 50), (50, 140), (140, 60), (145, 145), (100, 100)]
    grey = np.sum([(x - a) ** 2 + (y - b) ** 2 < 18**2 for a, b in centres], axis=0)
    for light in (0.0, (x + y) / 600, (x + y) / 200, -(x + y) / 200, x / 50):
        try:
            read = SectionImage("light.png", 1.0, "bright").circles(grey + light)
        except ValueError as error:
            told = str(error)
            right = "light is uneven" in told and "drop" not in told
        else:
            right = len(read.discs) == 5 and abs(read.phase_fraction / grey.mean() - 1) < 0.02
            right |= read.unevenness > UNEVEN
        assert right


LIGHTS = {
    "ramp": lambda x, y: x,
    "vignette": lambda x, y: -2 * (x**2 + y**2 - x - y),
    "valley": lambda x, y: (2 * x - 1) ** 2,
}


@pytest.mark.parametrize("light", LIGHTS)
@pytest.mark.parametrize("strength", [0.3, 0.6, 2.0])
def test_slow_light_is_evened_whatever_its_shape_and_named_where_strong(light, strength):
    generator = np.random.default_rng()
    dark = bool(generator.integers(2))
    even = section(generator, count=40, noise=0.0, dark=dark)
    y, x = np.mgrid[:SIDE, :SIDE] / SIDE
    uneven = even + 90 * strength * LIGHTS[light](x, y) + generator.normal(0, 9, even.shape)
    read = SectionImage("light.png", 1.0, "dark" if dark else "bright", drop=True).circles(uneven)
    truth = ((even < 125) == dark).mean()
    named = read.unevenness > UNEVEN
    assert named == (strength > 1)
    assert named or read.phase_fraction == pytest.approx(truth, rel=0.02)
    assert read.light == pytest.approx(strength, rel=0.5)


def test_light_that_no_smooth_surface_follows_is_named():
    picture = section(np.random.default_rng(), count=40)
    for part in (np.s_[: SIDE // 2, SIDE // 2 :], np.s_[SIDE // 2 :, : SIDE // 2]):
        picture[part] += 38  # four pictures side by side
    read = SectionImage("seams.png", 1.0, "bright", drop=True).circles(picture)
    assert read.light < LIGHT
    assert read.unevenness > UNEVEN


def test_labels_are_warned_of_and_a_frame_is_cut_on_request():
    picture = section(np.random.default_rng(), count=40)
    even = SectionImage("even.png", 1.0, "bright", drop=True).circles(picture)
    assert even.strange < 0.1 * STRANGERS
    labels = np.zeros((2, SIDE, SIDE), bool)
    labels[0, 280:286, 20:90] = labels[1, 280:296, 20:90:5] = True  # a bar; strokes of a pixel
    for label, grey in itertools.product(labels, (0, 255)):
        read = SectionImage("label.png", 1.0, "bright", drop=True)
        assert read.circles(np.where(label, grey, picture)).strange > STRANGERS
    for grey in (0, 255):
        frame = np.pad(picture, 5, constant_values=grey)
        with pytest.raises(ValueError, match=r"frame of one grey.*crop = \[5, 5, 305, 305\] cuts"):
            cropped(frame, None, "frame.png")
        assert cropped(frame, (5, 5, 305, 305), "frame.png").shape == picture.shape


@pytest.mark.parametrize("dark", [False, True])
def test_even_light_is_not_taken_for_uneven(dark):
    generator = np.random.default_rng()
    count, noise = int(generator.integers(20, 90)), generator.uniform(0, 18)
    picture = section(generator, count=count, noise=noise, dark=dark)
    read = SectionImage("even.png", 1.0, "dark" if dark else "bright", drop=True)
    found = read.circles(picture)
    assert found.unevenness < 0.7 * UNEVEN
    assert found.light == 0


def test_an_accepted_image_warns_of_uneven_light():
    def told(unevenness, light=0.0, strange=0.0, unsure=()):
        read = SimpleNamespace(
            misfit=0.0, unevenness=unevenness, light=light, strange=strange, unsure=unsure
        )
        seen = SimpleNamespace(discs=range(9), read=read)
        sample = SimpleNamespace(values=range(4), area_fraction=0.39)
        found = SimpleNamespace(fraction_of_map=0.4, sample=sample, sections=[seen])
        return "\n".join(fractions(found, 0.4))

    assert "warning" not in told(0.9 * UNEVEN)
    assert "warning: the light is uneven, the matrix's brightness differs by 0.56" in told(0.56)
    assert "subtract the background" in told(0.56)
    assert "the light differed by 0.35 of the contrast" in told(0.0, light=0.35)
    doubtful = told(0.0, unsure=[(0.35e-3, 0.25e-3), (0.1e-3, 0.2e-3)])
    assert "2 clusters of touching particles were parted uncertainly, at (0.35, 0.25)," in doubtful
    assert "warning: 2.00% of the pixels are much brighter" in told(0.0, strange=0.02)


def test_the_report_tells_the_fraction_of_the_image_as_the_terminal_does():
    found = {"discs": 9, "packings": 1, "area_fraction": 0.3688, "area_fraction_of_image": 0.3925}
    assert compared(0.3925) in discs(found)
    assert "to compare with others: 0.3925" in compared(0.3925)
    assert "compare" not in discs({**found, "area_fraction_of_image": None})
