"""From spheres to the fuzzy radius map: volume fraction, possible laws, what is not known."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

from alphacut.stochastic.errors import RefusedError, UnfitDataError
from alphacut.stochastic.fit.area_weighted import DISCS, SPHERES, AreaWeighted
from alphacut.stochastic.fit.hermite_fit import HermiteFit
from alphacut.stochastic.fit.pbox import least_pbox
from alphacut.stochastic.microstructure import Study, study
from alphacut.stochastic.microstructure_summary import fragment, summary
from alphacut.stochastic.particles.packing import Packing
from alphacut.stochastic.particles.radius_laws import LogNormalRadii, TabulatedRadii
from alphacut.stochastic.particles.sieve import SieveRadii
from alphacut.stochastic.sections import Simulated
from alphacut.stochastic.spheres.microstructure import _one, sphere_study
from alphacut.stochastic.spheres.packing import SpherePacking, SpherePackings
from alphacut.stochastic.spheres.wicksell import RadiiPBox, by_number, middle_law, possible_laws
from alphacut.stochastic.theta.quadrature import gauss_rule
from alphacut.stochastic.theta.truncated_normal import TruncatedNormal

LAW = LogNormalRadii(1e-3, 4e-3)
EDGES = np.geomspace(1e-3, 3e-3, 17)
TRUTH = np.linspace(0, 1, 17)
WIDE = RadiiPBox(
    EDGES, np.clip(TRUTH - 0.3, 0, None), np.clip(TRUTH + 0.3, None, 1), "volume", 0.95
)
WIDE.lower[-1], WIDE.upper[0] = 1.0, 0.0


def spheres(count=120, fraction=0.2, packings=5, law=LAW, section=None):
    source = SpherePackings(SpherePacking(count, fraction, law), packings, section)
    return Study(source, seed=4, bootstrap=100)


@pytest.fixture(scope="module")
def one():
    return sphere_study(spheres(fraction=0.3))


@pytest.fixture(scope="module")
def wide():
    return sphere_study(spheres(60, section=WIDE))


def test_the_map_has_the_volume_fraction_asked_for(one):
    """Judged by E[π r³/6] over the law of θ, though the limit cuts the tightest cells off."""
    fitted = one.pbox.fit.map((one.pbox.a2[1], one.pbox.a4[1]))
    rule = gauss_rule(fitted.distribution, points=60)
    assert rule.mean(np.pi / 6 * fitted(rule.nodes) ** 3) == pytest.approx(0.3, rel=0.02)
    assert one.packed[0].fraction > 0.32
    assert one.limits[1] <= 0.97
    assert one.pbox.contains(one.kept, one.allowed)
    assert not list(one.remarks)


def test_what_is_left_out_is_told_from_a_quarter_of_the_volume_on():
    found = sphere_study(spheres(60, fraction=0.36))
    assert 0.25 < found.share_beyond < 0.5
    assert f"{found.share_beyond:.1%} of the volume lies in cells" in next(iter(found.remarks))


def test_denser_than_any_packing_is_said_and_not_refused():
    found = sphere_study(spheres(80, fraction=0.44))
    assert found.packed[0].fraction == 0.5
    tight, remark = found.remarks
    assert found.share_beyond > 0.5
    assert f"{found.share_beyond:.1%} of the volume lies" in tight
    assert "0.4400 is asked for" in remark
    assert found.fraction_of_map < 0.43


def test_workers_change_nothing(one):
    with ThreadPoolExecutor(2) as pool:
        again = sphere_study(spheres(fraction=0.3), executor=pool)
    assert fragment(again) == fragment(one)
    assert again.packed[0].packings[0].radii.tolist() == one.packed[0].packings[0].radii.tolist()


def test_laws_of_a_section_stay_inside_its_bounds_and_are_its_ends():
    laws = possible_laws(WIDE)
    volumes = {}
    for name, law in laws.items():
        radii = np.interp(np.linspace(0, 1, 400_001), law.shares, law.radii)
        total = np.concatenate([[0.0], np.cumsum(radii**3)])
        share = total[np.searchsorted(radii, EDGES, side="right")] / total[-1]
        volumes[name] = np.array([*share[:-1], 1.0])
        assert (share >= WIDE.lower - 0.02).all()
        assert (share <= WIDE.upper + 0.02).all()
    np.testing.assert_allclose(volumes["smallest spheres"], WIDE.upper, atol=0.02)
    np.testing.assert_allclose(volumes["largest spheres"], WIDE.lower, atol=0.02)
    level = np.clip(0.5, WIDE.lower, WIDE.upper)
    np.testing.assert_allclose(volumes["least alike"], level, atol=0.02)
    spread = {  # of log r by volume: no law of the p-box lies between other ends
        name: np.ptp(np.interp([0.25, 0.75], share, np.log(EDGES)))
        for name, share in volumes.items()
    }
    assert spread["most alike"] < 0.3 * min(spread["smallest spheres"], spread["largest spheres"])
    assert spread["least alike"] > 1.2 * max(spread["smallest spheres"], spread["largest spheres"])
    with pytest.raises(ValueError, match="the p-box is one by number"):
        possible_laws(replace(WIDE, weight="number"))


def test_a_wide_section_makes_a_wide_map_that_holds_every_possible_law(wide):
    narrow = sphere_study(spheres(60))
    assert wide.pbox.area > 2 * narrow.pbox.area
    assert len(wide.packed) == 5
    for packed in wide.packed:
        assert wide.pbox.contains(packed.sample.truncated(*wide.limits), wide.allowed)


def test_what_the_section_does_not_tell_is_said(wide):
    told = next(one for one in wide.remarks if "does not tell" in one)
    assert "between 1 and 3 mm: what smaller ones there are the section does not" in told
    document = summary(wide)
    assert "smaller ones" in str(document["unknown"])
    assert document["remarks"] == list(wide.remarks)
    assert len(document["possible_laws"]) == 4
    assert "volume fraction of the spheres" in fragment(wide)


def test_a_band_too_narrow_for_every_law_is_widened_and_told():
    """Samples at either end of the limits: no monotone cubics of slopes from 0 hold them as is."""
    law, rng = TruncatedNormal(), np.random.default_rng(1)
    low, high = (
        AreaWeighted.of(
            np.concatenate([[0.3, 0.9], ends[0] + (ends[1] - ends[0]) * rng.random(400)]),
            None,
            np.arange(402) % 5,
        )
        for ends in ((0.31, 0.45), (0.75, 0.89))
    )
    with pytest.raises(RefusedError, match="no p-box"):
        least_pbox(HermiteFit(0.3, 0.9, law), low, 0.001, others=[high])
    from alphacut.stochastic.microstructure import fitted_map

    found = fitted_map(replace(spheres(), limits=(0.3, 0.9)), low, [high])
    assert found.allowed > found.band
    assert found.pbox.contains(low.truncated(0.3, 0.9), found.allowed)
    assert found.pbox.contains(high.truncated(0.3, 0.9), found.allowed)


def test_a_table_of_radii_is_a_law():
    law = TabulatedRadii((1.0, 2.0, 4.0), (0.0, 0.5, 1.0))
    drawn = law.sample(200_000, np.random.default_rng())
    for radius in (1.5, 3.0):
        assert (drawn <= radius).mean() == pytest.approx(float(law.cdf(radius)), abs=0.01)
    assert (law.smallest, law.largest) == (1.0, 4.0)
    for radii, shares in (((1.0,), (0.0,)), ((1.0, 2.0), (0.1, 1.0)), ((2.0, 1.0), (0.0, 1.0))):
        with pytest.raises(ValueError, match=r"makes no law|must rise"):
            TabulatedRadii(radii, shares)


def test_a_law_by_volume_becomes_one_by_number():
    """Equal volumes of radii about 1 and 2: of eight small ones one is large."""
    law = by_number(np.array([0.99, 1.01, 1.99, 2.01]), np.array([0, 0.5, 0.5, 1.0]), "two")
    assert float(law.cdf(1.5)) == pytest.approx(8 / 9, abs=1e-3)


def test_the_middle_law_of_circles_lies_inside_their_bounds():
    circles = np.linspace(1e-3, 2.8e-3, 40)
    law = middle_law(circles, WIDE, visible=9e-4)
    volume = np.cumsum(np.diff(law.shares) * (np.array(law.radii[1:]) ** 3))
    share = np.interp(EDGES[1:-1], law.radii[1:], volume / volume[-1])
    assert (share >= WIDE.lower[1:-1] - 0.02).all()
    assert (share <= WIDE.upper[1:-1] + 0.02).all()


def test_shapes_fill_their_cells_at_the_largest_radius():
    for shape in (DISCS, SPHERES):
        assert float(shape.shares(shape.largest)) == pytest.approx(1)


def coarse(cubes):
    """Share of the volume in spheres of more than 4 mm."""
    drawn = np.concatenate(cubes)
    return (drawn[drawn > 4e-3] ** 3).sum() / (drawn**3).sum()


def test_packings_keep_the_volume_of_the_largest_spheres():
    """A sieve curve of 1 … 16 mm; draws too large for their cubes were drawn anew."""
    law = SieveRadii((0.5e-3, 1e-3, 2e-3, 4e-3, 8e-3), (0, 0.15, 0.35, 0.65, 1), 3)
    wanted = SpherePackings(SpherePacking(60, 0.2, law)).laws["the law"]
    assert 1000 < wanted.spheres < 1500
    seeds = np.random.SeedSequence(1).spawn(40)
    made = [_one(wanted, seed)[0].radii for seed in seeds]
    assert coarse(made) == pytest.approx(0.35, abs=3 * 0.025 / np.sqrt(2))
    few = [_one(replace(wanted, spheres=60), seed)[0].radii for seed in seeds]
    assert max(map(len, few)) > min(map(len, few)) == 60
    assert coarse(few) > 0.25


def test_more_spheres_than_asked_for_are_told_and_too_many_refused():
    """Of equal volumes of two sizes, a ratio ρ of radii needs about ρ³ as many small ones."""
    one = SpherePackings(SpherePacking(60, 0.2, two(6)))
    (told,) = one.remarks
    assert told.startswith(f"{one.laws['the law'].spheres} spheres or more are packed")
    assert not list(SpherePackings(SpherePacking(5000, 0.2, two(6))).remarks)
    assert not list(SpherePackings(SpherePacking(60, 0.06, two(6))).remarks)
    with pytest.raises(UnfitDataError, match=r"50.0% of the volume .* need .* ask for as many"):
        SpherePackings(SpherePacking(60, 0.2, two(30)))
    assert SpherePackings(SpherePacking(100_000, 0.2, two(20))).laws["the law"].spheres == 100_000


def test_a_thin_tail_is_cut_off_and_told():
    one = SpherePackings(SpherePacking(60, 0.2, two(30, 0.004)))
    law = one.laws["the law"]
    assert law.radii.largest < 0.9 * two(30).largest
    assert law.radii.sample(10**5, np.random.default_rng(1)).max() <= law.radii.largest
    assert any("without 0.004 of the volume above" in told for told in one.remarks)


def two(ratio, share=0.5):
    """Radii about 1 mm, and about `ratio` times that for a share of the volume."""
    ends = 1e-3 * np.array([0.99, 1.01, 0.99 * ratio, 1.01 * ratio])
    return by_number(ends, np.array([0, 1 - share, 1 - share, 1]), "two sizes")


def test_sources_go_to_their_own_study():
    with pytest.raises(ValueError, match="packs spheres"):
        study(spheres())
    with pytest.raises(ValueError, match="one of discs"):
        sphere_study(Study(Simulated(Packing(100, 0.2, LAW), 5)))
    with pytest.raises(ValueError, match="4 packings were asked for"):
        SpherePackings(SpherePacking(50, 0.2, LAW), 4)
