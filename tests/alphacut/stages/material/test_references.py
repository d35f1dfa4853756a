"""Bounds and estimates beside E: against each other, limits and numbers found another way."""

from __future__ import annotations

import json
import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from alphacut.case.case import Case
from alphacut.case.load import load
from alphacut.entry import main
from alphacut.report.key_results import of_cell
from alphacut.rve import bounds as plane
from alphacut.rve.anisotropy import plane_average, shear_ratio
from alphacut.rve.cell import Cell, Phase, square_moduli
from alphacut.rve.fibre_constants import across_fibres, fibre_constants
from alphacut.rve.series.model import SeriesModel
from alphacut.rve.spheres import bounds as space
from alphacut.stages import summary
from alphacut.stages.material.cell import cell_inputs, modal_parts, parts
from alphacut.stages.material.modulus import read_number
from alphacut.stages.material.references import beside, bounds_over_cuts, lines, publish, references
from alphacut.stages.material.spheres import unmeasured
from alphacut.stochastic import HermiteMap, RadiusMap
from benchmarks.stochastic.averages import Isotropic

CASES = Path(__file__).parents[4] / "cases"
MATRIX, STIFF = Phase(20e9, 0.3), Phase(80e9, 0.3)


def circle(radius: float) -> HermiteMap:
    return HermiteMap(radius, 0.0, radius, 0.0)


def test_bounds_meet_the_phases_and_mori_tanaka_is_one_of_them() -> None:
    rng = np.random.default_rng()
    phases = [Phase(10 ** rng.uniform(8, 11), rng.uniform(0, 0.45)) for _ in range(2)]
    share = np.array([0.0, rng.uniform(0.05, 0.95), 1.0])
    for module, moduli_of in (
        (plane, lambda p: (plane.bulk_modulus(p.stiffness), p.stiffness[2, 2])),
        (space, space.bulk_and_shear),
    ):
        found = module.hashin_shtrikman(share, *phases)
        assert (found[:, 0] <= found[:, 1] * (1 + 1e-12)).all()
        for end, phase in ((0, phases[0]), (2, phases[1])):
            np.testing.assert_allclose(found[:, 0, end], moduli_of(phase), rtol=1e-9)
            np.testing.assert_allclose(found[:, 1, end], moduli_of(phase), rtol=1e-9)
    low, high = plane.hashin_shtrikman_bulk(share, *phases)
    own = plane.hashin_shtrikman(share, *phases)[0]
    if phases[0].stiffness[2, 2] != phases[1].stiffness[2, 2]:
        assert (own[0] <= low * (1 + 1e-9)).all()
        assert (own[1] >= high * (1 - 1e-9)).all()
    stiffer = plane.hashin_shtrikman(share, MATRIX, STIFF)[:, 0]
    bulk, _, shear = plane.mori_tanaka(share, MATRIX, STIFF).T
    np.testing.assert_allclose(stiffer, [bulk / 2, shear], rtol=1e-12)


def test_the_references_are_the_numbers_that_the_benchmark_prints() -> None:
    found = references(
        circle(np.sqrt(4 * 0.2 / np.pi)), (MATRIX, STIFF), (24.5e9, 0.29), 1.04, "cylinders"
    )
    assert found.fraction == pytest.approx(0.2, rel=1e-12)
    assert found.fibres[0] / 1e9 == pytest.approx(24.673, abs=6e-4)  # README, `many_particles`
    assert found.fibres_estimate == pytest.approx(found.fibres[0], rel=1e-12)
    assert found.spheres[0] / 1e9 == pytest.approx(25.49, abs=6e-3)
    assert found.spheres_estimate == pytest.approx(found.spheres[0], rel=1e-12)
    assert found.fibres[1] < found.spheres[1]


def test_the_average_over_directions_is_that_of_the_whole_stiffness() -> None:
    from alphacut.rve.result import effective_modulus
    from alphacut.rve.series.stiffness import square_stiffness

    stiffness = square_stiffness(np.array([0.8]), MATRIX, [STIFF]).matrix[0, 0]
    bulk, axes = plane.bulk_modulus(stiffness), stiffness[2, 2]
    diagonals = (stiffness[0, 0] - stiffness[0, 1]) / 2
    eq16 = effective_modulus(0.02 * float(bulk), 0.02 * float(axes))
    found = references(circle(0.8), (MATRIX, STIFF), eq16, shear_ratio(stiffness), "cylinders")
    between = [
        Isotropic(float(bulk), g).modulus
        for g in (2 / (1 / axes + 1 / diagonals), (axes + diagonals) / 2)
    ]
    assert found.average is not None
    assert between[0] < found.average < between[1]
    assert eq16[0] < found.average
    assert references(circle(0.8), (MATRIX, STIFF), eq16, None, "cylinders").average is None


def test_the_transverse_modulus_of_fibres_stands_beside_e_of_plane_strain(tmp_path: Path) -> None:
    """By its formula, between those of the array's axes and diagonals, above E of plane strain."""
    case = load(polymer(tmp_path, "fibres"))
    result = SeriesModel().solve(*modal_parts(case)[:2], [modal_parts(case)[2]])[0]
    exact, stiffness = fibre_constants(result).values, np.asarray(result.stiffness)
    ratio, own = shear_ratio(stiffness), (result.modulus, result.poisson)
    told = beside(case, *own, ratio)
    found, bulk = told["beside"]["across"], float(plane.bulk_modulus(stiffness))
    by_formula = (
        1 / (4 * found["G23_GPa"])
        + 1 / (4 * found["K23_GPa"])
        + found["nu_LT"] ** 2 / found["E_L_GPa"]
    )
    assert found["E_T_GPa"] == pytest.approx(1 / by_formula, rel=1e-12)
    assert found["K23_GPa"] == pytest.approx(bulk / 1e9, rel=1e-9)
    assert found["E_L_GPa"] == pytest.approx(exact["E3"] / 1e9, rel=1e-9)
    diagonal = across_fibres(
        Cell(*modal_parts(case)[1:], modal_parts(case)[0]), bulk, ratio * stiffness[2, 2]
    )
    assert diagonal["E_T"] == pytest.approx(exact["E1"], rel=1e-9)
    assert told["beside"]["isotropic_average_E_GPa"] < found["E_T_GPa"] < exact["E1"] / 1e9
    text = "\n".join(lines(told["beside"], "cylinders"))
    assert (
        f"not the transverse Young's modulus of a fibre composite; that is E_T = {found['E_T_GPa']:.3f} GPa"
        in text
    )
    assert "Hashin–Shtrikman bounds of E at nominal inputs and the area fraction" in text
    fuzzy = {**told["beside"], "cuts": bounds_over_cuts(case, [1.0])}
    text = "\n".join(lines(fuzzy, "cylinders"))
    assert f"E_T = {found['E_T_GPa']:.3f} GPa at the middle of the cut at α = 1" in text
    averaged = plane_average(square_moduli(stiffness))
    again = beside(load(case.path, ["modulus.average=isotropic"]), *averaged, ratio)
    assert again["beside"]["across"] == pytest.approx(found, rel=1e-9)
    assert "refuses this cell" in "".join(lines(beside(case, *own, None)["beside"], "cylinders"))
    old = {name: value for name, value in told["beside"].items() if name != "across"}
    assert "refuses" not in "".join(lines(old, "cylinders"))
    spheres = load(case.path, ["cell.particles=spheres"])
    assert "transverse" not in "".join(lines(beside(spheres, *own, 1.0)["beside"], "spheres"))


POLYMER = """
schema = 1
title = "Polymer"
about = "A polymer with glass WHAT"
stages = ["modulus"]
[radius]
a1 = 0.6676
a2 = 0
a3 = 0.6676
a4 = 0
[cell]
matrix_modulus = "2.8 GPa"
matrix_poisson = 0.38
inclusion_modulus = "[70, 73, 76] GPa"
inclusion_poisson = 0.22
[modulus]
method = "series"
alpha = [0, 1]
"""


@pytest.mark.parametrize(
    "command", ["cell", "modulus", pytest.param("run", marks=pytest.mark.slow)]
)
def test_e_below_the_bound_of_spheres_is_never_silent(
    command: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "polymer.toml"
    path.write_text(POLYMER.replace("WHAT", "beads"), encoding="utf-8")
    out = ["--out", str(tmp_path / "out"), "--no-figures"] if command == "run" else []
    assert main([command, str(path), *out]) == 0
    told = " ".join(capfd.readouterr())
    assert "lies below the Hashin–Shtrikman bound" in told
    assert "discs of the plane are long fibres" in told
    assert told.count("'beads'") == 1
    if command == "run":
        assert main(["report", str(tmp_path / "out"), "--quiet"]) == 0
        page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
        assert "lies below the Hashin–Shtrikman bound" in page
        summary = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))
        low, high = summary["modulus"]["beside"]["spheres"]["hashin_shtrikman_E_GPa"]
        assert summary["modulus"]["modal_GPa"] < low < high


def test_fibres_and_named_cylinders_are_not_warned_of(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    for text in (
        POLYMER.replace("WHAT", "fibres"),
        POLYMER.replace("WHAT", "beads").replace("[cell]", '[cell]\nparticles = "cylinders"'),
    ):
        path = tmp_path / "polymer.toml"
        path.write_text(text, encoding="utf-8")
        assert main(["cell", str(path), "--json", "-"]) == 0
        out, err = capfd.readouterr()
        assert json.loads(out)["outside"] == ""
        assert "lies below" not in err


def polymer(tmp_path: Path, what: str = "beads") -> Path:
    """A case with a fuzzy matrix, whose Poisson's ratio is fuzzy as well."""
    path = tmp_path / "fuzzy.toml"
    text = POLYMER.replace("WHAT", what).replace('"2.8 GPa"', '"[2.7, 2.8, 2.9] GPa"')
    path.write_text(text.replace("0.38", "[0.36, 0.38, 0.4]"), encoding="utf-8")
    return path


def test_bounds_over_cuts_hold_those_of_every_choice_inside(tmp_path: Path) -> None:
    case = load(polymer(tmp_path))
    found = bounds_over_cuts(case, [0.0, 0.5, 1.0])
    modal = references(*modal_case(case), (4.6e9, 0.37), None, "cylinders")
    for kind, ends in (("fibres", modal.fibres), ("spheres", modal.spheres)):
        assert found[kind]["lower"][2] == pytest.approx(ends[0] / 1e9, rel=1e-12)
        assert found[kind]["upper"][2] == pytest.approx(ends[1] / 1e9, rel=1e-12)
    rng, inputs = np.random.default_rng(), cell_inputs(case)
    for k, level in enumerate(found["alpha"][:2]):
        drawn = []
        for _ in range(60):
            values = {name: rng.uniform(*one.cut(level)) for name, one in inputs.items()}
            radius, *phases = parts(values, case.radius.family)
            one = references(radius, (phases[0], phases[1]), (4.6e9, 0.37), None, "cylinders")
            drawn.append([one.fibres, one.spheres])
        ends = np.array(drawn) / 1e9
        for column, kind in enumerate(("fibres", "spheres")):
            low, high = found[kind]["lower"][k], found[kind]["upper"][k]
            assert (ends[:, column] >= low * (1 - 1e-12)).all()
            assert (ends[:, column] <= high * (1 + 1e-12)).all()
            span = np.ptp(ends[:, column], axis=0)  # and they are not wider than need be
            assert low > ends[:, column, 0].min() - span[0] - 1e-9
            assert high < ends[:, column, 1].max() + span[1] + 1e-9


def modal_case(case: Case) -> tuple[RadiusMap, tuple[Phase, Phase]]:
    """The modal map and phases."""
    radius, matrix, inclusion = modal_parts(case)
    return radius, (matrix, inclusion)


def test_a_fuzzy_e_below_the_bound_of_spheres_is_flagged_wherever_it_goes(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """In the words of the command, in Key results, and where a frame takes it from the file."""
    path, file = polymer(tmp_path), tmp_path / "modulus.nc"
    assert main(["modulus", str(path), "--out", str(file), "--json", "-"]) == 0
    told = json.loads(capfd.readouterr().out)
    assert "so does all of its support" in told["outside"]
    assert told["publish"].startswith("To publish: E of spheres, by")
    numbers = {**told, "modal_GPa": 4.56, "lower_GPa": 4.4, "upper_GPa": 4.7, "nu": 0.37}
    numbers["nu_cuts"] = {"lower": [0.36, 0.37], "upper": [0.38, 0.37]}
    rows = list(of_cell(numbers))
    assert rows[0][0] == "Young's modulus E of the square array (eq. 16)"
    assert [row[0].split(" of ")[0] for row in rows] == [
        "Young's modulus E",
        "Poisson's ratio ν",
        "Hashin–Shtrikman bounds",
    ]
    assert all("outside the bounds of spheres" in row[3] for row in rows[:2])
    assert "GPa" in rows[2][2]
    read_number(file)
    assert "--modulus: E = 4.5" in capfd.readouterr().err
    read_number(file, warn=False)
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ([], "the isotropic average, 5"),
        (["modulus.average=isotropic"], "this E for plane strain, the isotropic average"),
        (["cell.particles=spheres"], "isotropic (Hill) average of spheres"),
    ],
)
def test_one_e_is_named_to_be_published(tmp_path: Path, change: list[str], words: str) -> None:
    case = load(polymer(tmp_path, "fibres"), change)
    assert words in beside(case, 4.6e9, 0.37, 1.35)["publish"]


@pytest.mark.parametrize(
    ("beyond", "words"), [(0.57, "Not to be published: E leaves out 57%"), (0.2, "To")]
)
def test_an_e_without_much_of_the_volume_is_not_to_be_published(beyond, words, monkeypatch):
    numbers = {"modulus": {"publish": "To publish: this E"}}
    seen = {"microstructure": {"share_beyond_limit": beyond}}
    found = {"inputs": seen, "material": numbers, "motion": {}, "question": {}}
    for name, part in found.items():
        monkeypatch.setattr(summary, f"{name}_numbers", lambda results, part=part: part)
    monkeypatch.setattr(summary, "origin", lambda case: {})
    results = SimpleNamespace(case=SimpleNamespace(quoted=None))
    assert summary.summary(results)["modulus"]["publish"].startswith(words)


@pytest.mark.parametrize("command", ["cell", "modulus"])
def test_commands_of_the_material_remark_on_it_as_check_does(command, tmp_path, capfd):
    case = str(polymer(tmp_path, "fibres"))
    changes = ["--set", "cell.matrix_modulus=3 kPa", "--set", "modulus.method=series"]
    assert main([command, case, *changes]) == 0
    assert "warning: cell: the particle's modulus is" in capfd.readouterr().err


def test_measured_particles_of_spheres_are_warned_of_before_the_run(tmp_path: Path) -> None:
    (told,) = unmeasured(load(polymer(tmp_path)))
    assert "whose E is lower than that of stiffer spheres" in told
    assert not list(unmeasured(load(polymer(tmp_path), ["cell.particles=cylinders"])))


def test_e_of_spheres_says_what_is_not_in_its_error() -> None:
    case = SimpleNamespace(cell=SimpleNamespace(particles="spheres"))
    told = publish(case, {})  # type: ignore[arg-type]
    assert "What one cubic cell misses of many random spheres is not in its error: 0.44 %" in told


@pytest.mark.parametrize("particles", ["spheres", "cylinders"])
def test_an_e_to_publish_that_passes_the_bounds_beside_it_says_so(
    tmp_path: Path, particles: str, capfd: pytest.CaptureFixture[str]
) -> None:
    """Pores of very different radii: one strain for all cells overrates E."""
    path = polymer(tmp_path, "pores")
    pores = ["cell.inclusion_modulus=1 MPa", "cell.matrix_modulus=3 GPa", "radius.a1=0.05"]
    pores += ["radius.a3=0.95", "radius.a2=0.2", f"cell.particles={particles}"]
    own = ["modulus.average=isotropic"] if particles == "cylinders" else []
    pores += ["modulus.method=series", *own]
    words = [word for change in pores for word in ("--set", change)]
    assert main(["cell", str(path), *words]) == 0
    (told,) = [x for x in capfd.readouterr().out.splitlines() if x.startswith("To publish")]
    value, bound = re.search(r"But ([\d.]+) GPa lies [\d.]+ % above ([\d.]+) GPa", told).groups()
    assert float(value) > float(bound)
    fine = ["--set", "modulus.average=isotropic", "--set", "modulus.method=series"]
    assert main(["cell", str(path), *fine]) == 0
    assert "But" not in capfd.readouterr().out.partition("To publish")[2]


def test_moduli_of_gels_keep_their_digits(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    gel = ["cell.matrix_modulus=2 kPa", "cell.inclusion_modulus=40 kPa", "modulus.method=series"]
    words = [word for change in gel for word in ("--set", change)]
    for command in ("cell", "modulus"):
        assert main([command, str(polymer(tmp_path, "fibres")), *words]) == 0
        out = capfd.readouterr().out
        assert re.search(r"\d\.\d{3,}e-06", out)
        assert "0.000 " not in out


def test_wide_inputs_are_no_e_beyond_the_bounds(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """The middle of E's core need not lie between bounds at the middle of the inputs."""
    wide = ["cell.matrix_modulus=20 GPa", "cell.inclusion_modulus=[1, 100] GPa"]
    wide += ["cell.particles=spheres", "modulus.method=series", "modulus.alpha=[0, 1]"]
    words = [word for change in wide for word in ("--set", change)]
    assert main(["modulus", str(polymer(tmp_path, "spheres")), *words]) == 0
    assert "But" not in capfd.readouterr().out
