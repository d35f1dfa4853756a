"""The law of θ and the kind of the map by keys: they reach the cell, the campaign and its store, and
keys that do not belong to them are refused.
"""

from pathlib import Path

import numpy as np
import pytest

from alphacut.case.load import load
from alphacut.entry import main
from alphacut.figures.radius import distribution, maps, modal_map
from alphacut.io.problem import BadInput
from alphacut.rve.spheres.result import volume_fraction
from alphacut.stages.material import modulus
from alphacut.stages.material.campaign import campaign, identity
from alphacut.stages.material.cell import modal_parts, solve
from alphacut.stages.material.cell_models import cell_model
from alphacut.stages.material.references import beside, mean_share
from alphacut.stochastic import Beta, ExponentialMap, HermiteMap

PAPER = Path(__file__).parents[3] / "cases" / "paper.toml"
CASE = """schema = 1
title = "Another law"
about = "For a test."
stages = ["modulus"]
[radius]
law = "beta"
exponents = [2, 5]
map = "exponential"
a1 = [0.2, 0.25, 0.3]
a3 = 0.8
[cell]
matrix_modulus = "20 GPa"
matrix_poisson = 0.3
inclusion_modulus = "80 GPa"
inclusion_poisson = 0.3
[modulus]
method = "series"
plan = "signed"
alpha = [0, 1]
[response]
quantiles = [0.5]
"""


@pytest.fixture
def case(tmp_path):
    path = tmp_path / "case.toml"
    path.write_text(CASE, encoding="utf-8")
    return path


def test_keys_reach_the_map_and_its_law(case):
    radius = modal_parts(load(case))[0]
    assert radius == ExponentialMap(0.25, 0.8, Beta(2, 5))
    uniform = load(PAPER, ["radius.law=uniform", "radius.theta=[-2, 2]"])
    assert modal_parts(uniform)[0].distribution == Beta(1, 1, -2, 2)
    linear = load(case, ["radius.map=linear"])
    assert modal_parts(linear)[0] == HermiteMap(0.25, 0.55, 0.8, 0.55, Beta(2, 5))
    assert load(PAPER).radius.family.names == ("a1", "a2", "a3", "a4")


def test_cell_and_campaign_are_those_of_the_law(case):
    """E from the cell at the ends of a1, and the fraction by SciPy's own quantiles."""
    from scipy import stats

    chosen = load(case)
    found = modulus.compute(campaign(chosen))
    lower, upper = found.result.bounds("E")
    for end, value in ((0.2, lower[0]), (0.3, upper[0]), (0.25, lower[1])):
        crisp = load(case, [f"radius.a1={end}"])
        own = solve(crisp, cell_model(campaign(crisp).task.choice)).modulus
        assert value == pytest.approx(own, rel=1e-9)
    xi = stats.beta(2, 5).ppf((np.arange(100_000) + 0.5) / 100_000)
    radii = 0.25 * (0.8 / 0.25) ** xi
    radius = modal_parts(chosen)[0]
    assert mean_share(radius, "cylinders") == pytest.approx(np.mean(np.pi / 4 * radii**2), rel=1e-6)
    told = beside(chosen, 25e9, 0.3, 1.0)["beside"]
    assert told["fraction"] == pytest.approx(np.mean(np.pi / 4 * radii**2), rel=1e-6)
    assert volume_fraction(radii).mean() < told["fraction"]
    at = np.linspace(0.25, 0.8, 7)
    share = np.searchsorted(np.sort(radii), at) / len(radii)
    assert distribution(modal_map(chosen), at) == pytest.approx(share, abs=2e-3)
    assert len(maps(chosen, 0.0)) == 2


def test_stored_samples_of_another_law_are_not_taken(case):
    other = [["radius.exponents=[3, 5]"], ["radius.map=linear"], ["radius.theta=[-2, 3]"]]
    known = identity(campaign(load(case)).task)
    assert all(identity(campaign(load(case, change)).task) != known for change in other)


def test_a_map_that_falls_has_its_distribution(case):
    falling = modal_map(load(case, ["radius.a1=0.8", "radius.a3=0.25"]))
    shares = distribution(falling, np.array([0.2, 0.25, 0.5, 0.8, 0.9]))
    assert shares[[0, 4]] == pytest.approx([0, 1])
    assert (np.diff(shares) >= 0).all()
    xi = np.log(0.5 / 0.8) / np.log(0.25 / 0.8)
    assert shares[2] == pytest.approx(1 - Beta(2, 5, 0.0, 1.0).cdf(xi), abs=2e-3)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("radius.a2=0.1", r"radius\.a2.*map exponential has no such slope"),
        ("radius.map=hermite", r"radius\.a2.*missing: slope .* needed by map hermite"),
        ("radius.exponents=[2]", r"radius\.exponents.*needs its two exponents"),
        ("radius.exponents=[0.5, 2]", "from 1 to 1000"),
        ("radius.law=normal", r"radius\.exponents.*law normal has no exponents"),
        ("radius.law=gauss", "normal, uniform, beta"),
    ],
)
def test_keys_that_do_not_belong_together_are_refused(case, change, words):
    with pytest.raises(BadInput, match=words):
        load(case, [change])


def test_a_law_without_probability_on_its_support_is_refused(case):
    changes = ["radius.theta=[9, 10]", "radius.a2=0", "radius.a4=0"]
    assert load(PAPER, changes)  # little, but some
    with pytest.raises(BadInput, match="rising order"):
        load(case, ["radius.theta=[3, -3]"])


@pytest.mark.parametrize(("exponents", "modulus"), [(600, 23.99634), (1000, 23.99515)])
def test_steep_beta_laws_give_a_cell_without_a_warning(tmp_path, capfd, exponents, modulus):
    text = CASE.replace('map = "exponential"', "a2 = 0.3\na4 = 0.4").replace("[2, 5]", "[2, 2]")
    text = text.replace("[0.2, 0.25, 0.3]", "0.2").partition("[response]")[0]
    (tmp_path / "case.toml").write_text(text, encoding="utf-8")
    change = f"radius.exponents=[{exponents}, {exponents}]"
    assert main(["cell", str(tmp_path / "case.toml"), "--set", change]) == 0
    told = capfd.readouterr()
    assert "warning" not in told.err
    assert float(told.out.split()[2]) == pytest.approx(modulus, abs=1e-5)


def test_too_narrow_a_support_is_refused_by_its_key(capfd):
    assert main(["cell", str(PAPER), "--set", "radius.theta=[9.999999,10]"]) == 2
    (line,) = capfd.readouterr().err.splitlines()
    assert "radius.theta = [9.999999, 10.0]: the support" in line


def test_one_radius_stands_for_any_map(case, capfd):
    assert main(["cell", str(case), "--radius", "0.5", "--json", "-"]) == 0
    assert '"E_GPa": 24.2182' in capfd.readouterr().out
