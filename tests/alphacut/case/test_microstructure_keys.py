"""The keys of [microstructure] reach the study, and a value outside a half-open range is refused."""

import re
from pathlib import Path

import numpy as np
import pytest

from alphacut.case.load import load
from alphacut.entry import main
from alphacut.io.problem import BadInput
from alphacut.io.provenance import door
from alphacut.stages.material.microstructure import study_of
from alphacut.stochastic.particles.packing import Packing
from alphacut.stochastic.particles.radius_laws import LogNormalRadii

CONCRETE = Path(__file__).parents[3] / "cases" / "concrete.toml"


def test_a_cell_without_a_radius_map_tells_where_it_comes_from(capfd):
    assert main(["cell", str(CONCRETE), "--set", "modulus.method=series"]) == 2
    assert (
        f"{door()} microstructure {CONCRETE} --out particles makes it from the particles"
        in capfd.readouterr().err
    )


def test_band_and_sampling_reach_the_study():
    assert study_of(load(CONCRETE)).sampling is True
    found = study_of(load(CONCRETE, ["microstructure.sampling=false", "microstructure.band=0.01"]))
    assert (found.sampling, found.band) == (False, 0.01)
    assert study_of(load(CONCRETE)).band is None
    assert study_of(load(CONCRETE, ["microstructure.band=0"])).band == 0


@pytest.mark.parametrize("value", ["1", "-0.1", "nan"])
def test_a_band_outside_0_to_1_is_refused(value):
    with pytest.raises(BadInput, match=r"microstructure\.band"):
        load(CONCRETE, [f"microstructure.band={value}"])


def test_a_flag_is_true_or_false():
    with pytest.raises(BadInput, match="neither true nor false"):
        load(CONCRETE, ["microstructure.sampling=1"])


@pytest.fixture(scope="module")
def section(tmp_path_factory):
    """A case with 400 measured circles in a window, two of them nonsense that is dropped."""
    folder = tmp_path_factory.mktemp("section")
    packed = Packing(400, 0.25, LogNormalRadii(1e-3, 2e-3)).make(np.random.default_rng(1))
    rows = np.column_stack([packed.centres, packed.radii]) * 1e3
    lines = [
        "x [mm],y [mm],r [mm]",
        *(",".join(f"{value:.9f}" for value in row) for row in rows),
        "1,1,x",
        "2,2,y",
    ]
    (folder / "section.csv").write_text("\n".join(lines), encoding="utf-8")
    text = CONCRETE.read_text(encoding="utf-8")
    side = f'"{packed.size[0] * 1e3:.9f} mm"'
    circles = (
        f'[microstructure.circles]\nfile = "section.csv"\nsize = [{side}, {side}]\nperiodic ='
        " true\ndrop = true\n"
    )
    text = re.sub(r"\[microstructure\.packing\].*?(?=\n\[cell\])", circles, text, flags=re.DOTALL)
    text = re.sub(r"limits = .*", "", text).replace("sampling = true", "sampling = false")
    (folder / "own.toml").write_text(text, encoding="utf-8")
    return folder / "own.toml"


def test_both_area_fractions_and_what_was_left_out_are_told(section, capfd):
    assert main(["microstructure", str(section), "--set", "bootstrap=100"]) == 0
    out, err = capfd.readouterr()
    told = re.search(
        r"area fraction of the discs 0\.2500, of the cells 0\.2\d+, of this map at its modal"
        r" values.* (0\.2\d+)",
        out,
    )
    assert told
    assert "warning: 2 of 402 particles were left out: 2 since each lacks a finite number" in err


def test_a_run_warns_of_what_was_left_out_as_well(section, tmp_path, capfd):
    words = [
        "--set",
        'stages=["microstructure"]',
        "--set",
        "bootstrap=100",
        "--set",
        "microstructure.band=0.3",
    ]
    assert (
        main(["run", str(section), *words, "--no-figures", "--quiet", "--out", str(tmp_path)]) == 0
    )
    err = capfd.readouterr().err
    assert err.count("2 of 402 particles were left out") == 1
    assert (
        err.count("a2 came out crisp: the band around the particles' distribution is so wide") == 1
    )


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        (
            ["microstructure.band=0", "microstructure.limits=[0.05, 0.99]"],
            r"widen the limits, or the band \(where none is given",
        ),
        (
            ["microstructure.limits=[0.5, 0.5001]"],
            r"between 0\.5 and 0\.5001; 10 needed: take wider limits, or more particles",
        ),
        (
            ["microstructure.circles.overlap=1"],
            r"overlap = 1: 1 is out of range; allowed: .* 0 or greater and below 1",
        ),
        (["microstructure.circles.unit=GPa"], "unit for all columns.*'GPa', which is not a length"),
    ],
)
def test_a_refusal_names_a_cure_that_the_case_has(changes, told, section, capfd):
    words = [
        word for change in ["microstructure.bootstrap=100", *changes] for word in ("--set", change)
    ]
    assert main(["microstructure", str(section), *words]) == 2
    assert re.search(told, capfd.readouterr().err)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ("limits=[0.9, 0.1]", "rising order"),
        ("limits=[0.1, 1]", r"inside \(0, 1\)"),
        ("share=1.2", r"inside \(0, 1\)"),
        ("confidence=1", r"inside \(0, 1\)"),
        ("bootstrap=10", "from 100 to 1e5"),
        ("seed=-1", "from 0 to 1e18"),
        ("band=2", "0 or greater and below 1"),
        ("packing.discs=0", "from 10 to 1e6"),
        ("packing.discs=20.5", "20.5"),
        ("packing.packings=4", "from 5 to 10,000"),
        ("packing.area_fraction=0", r"inside \(0, 0\.84\)"),
        ("packing.area_fraction=0.84", r"inside \(0, 0\.84\)"),
        ("packing.gap=-1 mm", "0 or greater"),
        ("packing.gap=inf mm", "0 or greater"),
        ("packing.method=magic", "auto, sequential, relaxed"),
    ],
)
def test_settings_of_a_study_and_of_packings_are_checked_by_their_keys(change, told):
    """And nowhere else, so that no second range can differ from the documented one."""
    with pytest.raises(BadInput, match=rf"microstructure\.{change.partition('=')[0]}.*{told}"):
        load(CONCRETE, [f"microstructure.{change}"])


@pytest.mark.parametrize("size", ['["0 m", "1 m"]', '["inf m", "1 m"]', '["1 m"]', '"1 m"'])
def test_a_section_has_two_sides(section, size):
    with pytest.raises(BadInput, match=r"microstructure\.circles\.size"):
        study_of(load(section, [f"microstructure.circles.size={size}"]))


@pytest.mark.parametrize("fraction", [0.01, 0.8399])
def test_every_fraction_that_the_key_allows_reaches_the_packing(fraction):
    found = study_of(load(CONCRETE, [f"microstructure.packing.area_fraction={fraction}"]))
    assert found.source.packing.area_fraction == fraction


@pytest.mark.parametrize("side", [1, 2, 4, 8])
@pytest.mark.parametrize("radius", [0.24, 0.3])
def test_one_reduced_radius_is_refused_with_a_cure_whatever_the_rounding(
    section, tmp_path, side, radius, capfd
):
    """A lattice of equal discs: r_n is 2 radii over the pitch, but for round-off."""
    at = (np.arange(side) + 0.5) / side * 0.7
    rows = [f"{x!r},{y!r},{radius * 0.7 / side!r}" for x in map(float, at) for y in map(float, at)]
    (tmp_path / "section.csv").write_text("\n".join(["x [m],y [m],r [m]", *rows]))
    text = section.read_text(encoding="utf-8")
    (tmp_path / "own.toml").write_text(
        re.sub(r"(?m)^size = \[.*", 'size = ["0.7 m", "0.7 m"]', text)
    )
    assert main(["microstructure", str(tmp_path / "own.toml"), "--set", "bootstrap=100"]) == 2
    (line,) = capfd.readouterr().err.splitlines()
    assert f"all cells kept have one r_n, {2 * radius:g}, and a fit needs unequal ones" in line
    cure = re.findall(r"(a\d) = ([\d.]+)", line)
    assert [name for name, _ in cure] == ["a1", "a2", "a3", "a4"]
    radius = "\n".join(["[radius]", *(f"{name} = {value}" for name, value in cure), ""])
    text = re.sub(r"\[microstructure\].*?(?=\n\[cell\])", radius, text, flags=re.DOTALL)
    text = text.replace('["microstructure", ', "[")
    (tmp_path / "own.toml").write_text(text, encoding="utf-8")
    words = ["--set", "modulus.method=series", "--quiet"]
    assert main(["cell", str(tmp_path / "own.toml"), *words]) == 0, capfd.readouterr().err


def test_check_tells_the_size_of_an_image(section, capfd):
    from skimage import io

    grey = np.random.default_rng(0).integers(0, 255, (30, 40)).astype(np.uint8)
    io.imsave(section.parent / "seen.png", grey, check_contrast=False)
    text = section.read_text(encoding="utf-8")
    image = '[microstructure.image]\nfile = "seen.png"\npixel = "0.5 mm"\n'
    text = re.sub(r"\[microstructure\.circles\].*?(?=\n\[cell\])", image, text, flags=re.DOTALL)
    case = section.parent / "image.toml"
    case.write_text(text, encoding="utf-8")
    assert main(["check", str(case)]) == 0
    assert "shows a section of 20.00 mm × 15.00 mm; check pixel" in capfd.readouterr().out
