"""Stage microstructure of spheres from the command line: check, run, report, bad input."""

import json
import re
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy import integrate

from alphacut.case.load import load
from alphacut.entry import main
from alphacut.stages.material.campaign import campaign
from alphacut.stages.material.cell import cell_choice
from alphacut.stages.material.microstructure import crisp_slopes

CASE = Path(__file__).parents[3] / "cases" / "spheres.toml"
FEW = (
    "microstructure.spheres.spheres=50",
    "microstructure.spheres.packings=5",
    "microstructure.bootstrap=100",
    'microstructure.spheres.largest_radius="9.7 mm"',
)
SMALL = [word for key in FEW for word in ("--set", key)]


def test_check_says_what_spheres_are_packed(capfd):
    assert main(["check", str(CASE)]) == 0
    out = capfd.readouterr().out
    assert "6 packings of 200 spheres, volume fraction 0.2, radii 2.000 mm … 11.00 mm" in out
    assert "the map also holds 4 other laws that the circles leave possible" in out
    assert "what smaller ones there are the section does not tell" in out


def test_a_section_of_spheres_becomes_a_modulus_and_a_report(tmp_path, capfd):
    folder = tmp_path / "run"
    changes = [
        *SMALL,
        "--set",
        'stages=["microstructure", "modulus"]',
        "--set",
        "modulus.alpha=[0, 1]",
    ]
    assert main(["run", str(CASE), *changes, "--out", str(folder), "--quiet", "--no-figures"]) == 0
    found = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    own = found["microstructure"]
    assert own["particles"] == "spheres"
    assert found["volume_fraction"] == pytest.approx(own["mean_volume_fraction_of_map"], rel=1e-6)
    assert found["volume_fraction"] == pytest.approx(0.2, rel=0.03)
    low, high = found["modulus"]["lower_GPa"], found["modulus"]["upper_GPa"]
    assert low < found["modulus"]["modal_GPa"] < high
    assert (folder / "figures" / "radii_bounds.png").stat().st_size > 1000
    assert (folder / "figures" / "10_cells.png").stat().st_size > 1000
    told = capfd.readouterr().err
    assert "does not tell" in told
    beyond, packed = own["share_beyond_limit"], own["volume_fraction_packed"]
    line = f"the map is of {1 - beyond:.0%} of the volume; packed at {packed:.3f} so that the map"
    assert line in told
    assert (f"warning: {line}" in told) == (beyond > 0.1)
    assert main(["report", str(folder)]) == 0
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert line.removeprefix("the") in page
    assert "250 spheres in 5 periodic cubes, divided into Laguerre cells, and 4 more laws" in page
    assert "what smaller ones there are the section does not tell" in page


def test_measured_diameters_are_packed(tmp_path, capfd):
    own = tmp_path / "own.toml"
    text = CASE.read_text(encoding="utf-8")
    keys = ("circles", "visible", "smallest_radius", "largest_radius")
    lines = [line for line in text.splitlines() if not line.startswith(keys)]
    at = lines.index("[microstructure.spheres]") + 1
    own.write_text("\n".join([*lines[:at], 'file = "d.csv"', *lines[at:]]), encoding="utf-8")
    (tmp_path / "d.csv").write_text("d [mm]\n" + "\n".join("345678"), encoding="utf-8")
    assert main(["microstructure", str(own), *SMALL[:-2], "--json", "-"]) == 0
    found = json.loads(capfd.readouterr().out)
    assert found["law"] == "6 values of d.csv"
    assert found["smallest_radius"] >= 1.5e-3
    assert found["unknown"] is None


def test_check_foretells_how_many_spheres_a_list_needs(tmp_path, capfd):
    """200 beads of 1 mm and one of 10 mm; one of 1 m has a wrong unit, and no cube."""
    beads, own = tmp_path / "beads.csv", tmp_path / "own.toml"
    unfold = r"(?m)^(circles|visible|smallest_radius|largest_radius) .*\n"
    text = re.sub(unfold, "", CASE.read_text(encoding="utf-8"))
    own.write_text(text.replace("packings = 6", 'file = "beads.csv"'), encoding="utf-8")
    sizes = "d [mm]\n" + "".join(f"{0.8 + k / 500}\n" for k in range(200))
    beads.write_text(sizes + "10\n", encoding="utf-8")
    assert main(["check", str(own)]) == 0
    out, err = capfd.readouterr()
    (count,) = re.findall(r"spheres.spheres: (\d+) spheres or more are packed", err)
    assert f"20 packings of {count} spheres, " in out
    assert int(count) > 1000
    assert "times the median" not in err

    told = r"file: (\d+)% of the particles' volume has diameters from 1.198 mm to 10.00 mm"
    (share,) = map(int, re.findall(told, err))
    diameters = np.append(0.8 + np.arange(200) / 500, 10.0)
    each = [integrate.quad(lambda d: d**3, a, b)[0] / (b - a) for a, b in pairwise(diameters)]
    assert share == round(100 * each[-1] / sum(each))
    beads.write_text(sizes + "1000\n", encoding="utf-8")
    assert main(["check", str(own), "--set", f"{SPHERES}.volume_fraction=0.05"]) == 0
    assert (
        f"{SPHERES}.file: a size is 1e+03 times the median: check units" in capfd.readouterr().err
    )
    beads.write_text(sizes + "".join(f"{k / 1e3}\n" for k in range(10, 200)) * 9 + "100\n")
    for command in ("check", "microstructure"):
        assert main([command, str(own)]) == 2
        *_, line = capfd.readouterr().err.splitlines()
        assert "too large for cubes of 20000; the largest, of radius 0.05 m, need" in line


@pytest.mark.parametrize("command", ["microstructure", "run"])
def test_a_raised_number_of_spheres_is_told_once(command, tmp_path, capfd):
    changes = [
        f'{SMALL[-1].partition("=")[0]}="14 mm"',
        "--no-figures",
        "--out",
        str(tmp_path / "out"),
    ]
    changes += ["--set", 'stages=["microstructure"]'] * (command == "run")
    assert main([command, str(CASE), *SMALL[:-1], *changes]) == 0
    assert capfd.readouterr().err.count("spheres or more are packed") == 1
    found = json.loads((tmp_path / "out" / "microstructure.json").read_text(encoding="utf-8"))
    assert any("spheres or more are packed" in remark for remark in found["remarks"])


SPHERES = "microstructure.spheres"


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ([f"{SPHERES}.volume_fraction=0.5"], "inside (0, 0.45)"),
        ([f'{SPHERES}.visible="3 mm"'], "less than microstructure.spheres.smallest_radius"),
        ([f'{SPHERES}.visible="0.6 mm"', f'{SPHERES}.largest_radius="9 mm"'], "the largest 0.009 m"),
        ([f'{SPHERES}.largest_radius="60 mm"'], "at most 20 times the smallest"),
        ([f'{SPHERES}.file="spheres.circles.csv"'], "the radii come from measured spheres besides"),
        ([f'{SPHERES}.circles="paper.toml"'], "paper.toml"),
        ([f'{SPHERES}.circles="none.csv"'], "there is no such file"),
        ([f'{SPHERES}.circles="composite.png"'], "composite.png is no CSV file: it is a PNG image"),
        ([f"{SPHERES}.packings=3"], "from 5 to 10,000"),
        ([f"{SPHERES}.level=1"], "inside (0, 1)"),
        (['cell.particles="cylinders"', 'modulus.method="series"'], "stage microstructure packs"),
    ],
)  # fmt: skip
def test_what_spheres_cannot_be_is_one_line(changes, words, tmp_path, capfd):
    chosen = [word for change in changes for word in ("--set", change)]
    folder = tmp_path / "run"
    assert main(["run", str(CASE), *chosen, "--out", str(folder)]) == 2
    out, err = capfd.readouterr()
    assert not out
    assert words in err
    assert err.count("\n") == 1
    assert not folder.exists()


def test_samples_of_the_series_keep_a_tolerance_where_none_is_asked_for(tmp_path):
    """1e-9 near touching takes minutes a level; a single cell keeps it."""
    text = CASE.with_name("paper-3d.toml").read_text(encoding="utf-8")
    (tmp_path / "own.toml").write_text(re.sub(r"\ntolerance = 1e-6.*", "", text), encoding="utf-8")
    case = load(tmp_path / "own.toml")
    assert cell_choice(case).tolerance is None
    assert campaign(case).task.choice.tolerance == 1e-5
    assert campaign(load(CASE.with_name("paper-3d.toml"))).task.choice.tolerance == 1e-6


IMAGE = """
schema = 1
title = "Epoxy with glass beads"
about = "A section seen under the microscope."
stages = ["microstructure", "modulus"]
[microstructure]
seed = 1
bootstrap = 100
[microstructure.image]
file = "section.png"
pixel = "1 µm"
[cell]
matrix_modulus = "3 GPa"
matrix_poisson = 0.35
inclusion_modulus = "70 GPa"
inclusion_poisson = 0.22
[modulus]
method = "series"
"""


def section_of_discs(path):
    """Write an image of 49 bright discs in rows, of seven sizes."""
    io = pytest.importorskip("skimage.io")
    rows, columns = np.mgrid[:294, :294]
    grey = np.full((294, 294), 60, np.uint8)
    for k, (row, column) in enumerate(np.argwhere(np.ones((7, 7))) * 42 + 21):
        grey[np.hypot(rows - row, columns - column) < 10 + k % 7] = 200
    io.imsave(path, grey, check_contrast=False)


def test_an_image_of_spheres_is_led_to_the_spheres_behind_its_circles(tmp_path, capfd):
    """No stage unfolds an image's circles: one line says how, and every step of it goes through."""
    section_of_discs(tmp_path / "section.png")
    path = tmp_path / "own.toml"
    path.write_text(IMAGE, encoding="utf-8")
    assert main(["check", str(path)]) == 0
    assert "in place of [microstructure.image]" in capfd.readouterr().err
    assert main(["check", str(path), "--set", "cell.particles=spheres"]) == 2
    (line,) = capfd.readouterr().err.splitlines()
    assert re.search(
        r"circles = particles/circles.csv, which .*alphacut microstructure \S+ --out", line
    )
    out = ["--out", str(tmp_path / "FOLDER"), "--no-figures"]
    assert main(["microstructure", str(path), *out]) == 0
    spheres = (
        '[microstructure.spheres]\ncircles = "FOLDER/circles.csv"\nsmallest_radius = "9 µm"\n'
        'largest_radius = "20 µm"\nvisible = "3 µm"\nvolume_fraction = 0.2\nspheres = 50\n[cell]'
    )
    text = re.sub(r"\[microstructure\.image\].*\[cell\]", spheres, IMAGE, flags=re.DOTALL)
    path.write_text(text, encoding="utf-8")
    assert main(["check", str(path), "--set", "cell.particles=spheres"]) == 0
    assert "radii 9 µm … 20 µm" in re.sub(r"\.0+ ", " ", capfd.readouterr().out)


def test_a_slope_at_the_least_of_rising_maps_is_not_told_to_be_widened():
    section = "[radius]\na1 = 0.42\na2 = [0.8, 0.9, 1]\na3 = 0.97\na4 = "
    (line,) = crisp_slopes(f"{section}[1e-5, 1e-5, 1e-5]")
    assert line.startswith("a4 is crisp: the fit wants the least slope")
    assert "sampling" not in line
    (other,) = crisp_slopes(f"{section}[0.5, 0.5, 0.5]")
    assert "microstructure.sampling = true" in other


def test_keys_of_circles_need_circles(tmp_path, capfd):
    own = tmp_path / "own.toml"
    text = CASE.read_text(encoding="utf-8")
    lines = [line for line in text.splitlines() if not line.startswith("circles")]
    own.write_text("\n".join(lines), encoding="utf-8")
    assert main(["check", str(own)]) == 2
    assert "this has an effect on the circles of a section alone" in capfd.readouterr().err


def test_a_machine_without_voro_is_told_before_anything_runs(monkeypatch, tmp_path, capfd):
    from alphacut.stochastic.spheres import power_cells

    monkeypatch.setattr(power_cells.shutil, "which", lambda name: None)
    assert main(["run", str(CASE), "--out", str(tmp_path / "run")]) == 2
    (line,) = capfd.readouterr().err.splitlines()
    assert "install Debian's package voro++" in line
    assert not (tmp_path / "run").exists()


def test_circles_over_the_image_and_the_notes_of_a_run_stand_in_its_report(tmp_path, capfd):
    section_of_discs(tmp_path / "section.png")
    case, folder = tmp_path / "own.toml", tmp_path / "run"
    text = IMAGE.replace(', "modulus"]', "]")
    case.write_text(text.partition("[modulus]")[0], encoding="utf-8")
    (folder / "figures").mkdir(parents=True)
    for name in ("radii_bounds.svg", "2024-notes.svg"):  # of other particles, and of the user
        (folder / "figures" / name).write_text("<svg></svg>", encoding="utf-8")
    assert main(["run", str(case), "--out", str(folder), "--quiet"]) == 0
    found = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    assert "figures/image_circles.png" in found["figures"]
    assert not {"figures/radii_bounds.svg", "figures/2024-notes.svg"} & {*found["figures"]}
    assert not (folder / "figures" / "radii_bounds.svg").exists()
    assert (folder / "figures" / "2024-notes.svg").exists()
    assert main(["report", str(folder)]) == 0
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert page.count("Circles that stand for the particles, drawn over the image</") == 1
    assert "Area fraction to compare with others" in page
    told, cure = found["microstructure"]["remarks"]
    assert told.startswith("area fraction to compare")
    assert "the edge, and what is not round, leave 0." in told
    whole = found["microstructure"]["area_fraction_of_image"]
    assert f"pack these circles: [microstructure.packing] {keys(whole)}, in place of" in cure
    assert '[microstructure.image], and cell.particles = "cylinders"; the stage writes' in cure
    assert cure.endswith("beside radius.toml: put its folder before their name")
    packing = f"[microstructure.packing]\n{keys(whole)}\n".replace(", ", "\n")
    cell = '[cell]\nparticles = "cylinders"'
    text = re.sub(r"\[microstructure\.image\].*\[cell\]", packing + cell, IMAGE, flags=re.DOTALL)
    (folder / "own.toml").write_text(text, encoding="utf-8")
    capfd.readouterr()
    assert main(["check", str(folder / "own.toml")]) == 0
    assert "spheres" not in capfd.readouterr().err


def keys(fraction):
    """Keys that pack the circles of an image."""
    return f'file = "circles.csv", area_fraction = {fraction:.4f}, discs = 2000'


@pytest.mark.parametrize(("fraction", "said"), [(0.28, False), (0.3, True), (0.38, True)])
def test_spheres_too_dense_for_cubic_cells_are_told_before(fraction, said, capfd):
    assert main(["check", str(CASE), "--set", f"{SPHERES}.volume_fraction={fraction}"]) == 0
    assert ("run then marks E not to be published" in capfd.readouterr().err) == said


def test_a_smallest_sphere_below_the_circles_seen_is_told_in_its_unit(tmp_path, capfd):
    rows = "".join(f"{10 + k / 10:g}\n" for k in range(40))
    (tmp_path / "c.csv").write_text(f"r [µm]\n{rows}", encoding="utf-8")
    text = CASE.read_text(encoding="utf-8")
    for name, value in (
        ("circles", "c.csv"),
        ("smallest_radius", "4 µm"),
        ("largest_radius", "30 µm"),
    ):
        text = re.sub(rf"(?m)^{name} =.*", f'{name} = "{value}"', text)
    text = re.sub(r"(?m)^visible.*\n", "", text)
    (tmp_path / "own.toml").write_text(text, encoding="utf-8")
    assert main(["check", str(tmp_path / "own.toml")]) == 2
    told = "smallest_radius = 4.000 µm must exceed the smallest circle seen, 10.00 µm: raise it"
    assert told in capfd.readouterr().err
