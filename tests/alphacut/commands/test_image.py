"""The command ``image`` and the stage of a run: cases, results, bad input."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
import xarray
from markupsafe import Markup

from alphacut.case.load import load
from alphacut.entry import main
from alphacut.io.problem import BadInput
from alphacut.report import material
from alphacut.rve.image.fields.conjugate_gradient import ConjugateGradient
from alphacut.rve.image.model import ImageModel
from alphacut.stages.image import bounds
from alphacut.stages.image.bounds import Told
from alphacut.stages.image.reading import study_of

HEAD = 'schema = 1\ntitle = "t"\nabout = "a"\nstages = ["image"]\n'
IMAGE = {
    "image": '"a.png"',
    "pixel": '"2 µm"',
    "threshold": "[[120, 130, 140]]",
    "modulus": '["20 GPa", "80 GPa"]',
    "poisson": "[0.3]",
}
REPEATED = 'if the image repeats itself (boundary = "periodic")'
FRAME = """
[frame]
second_moment = "1e-6 m^4"
masses = ["20 t"]
lengths = ["2.5 m"]
displacements = ["10 mm"]
velocities = ["0 m/s"]
damping_ratio = "5 %"

[envelope]
fuzzy = ["E"]
duration = "0.5 s"
step = "0.01 s"
"""


@pytest.fixture
def folder(tmp_path):
    image = pytest.importorskip("PIL.Image")
    places = (np.arange(32) + 0.5) / 32 - 0.5
    distance = np.hypot(places, places[:, None])
    grey = np.clip(60 + 900 * (0.3 - distance), 60, 200).astype(np.uint8)
    image.fromarray(grey).save(tmp_path / "a.png")
    return tmp_path


def written(folder, head=HEAD, tail="", **changes):
    """A case file with changed keys; None leaves one out."""
    keys = {k: v for k, v in (IMAGE | changes).items() if v is not None}
    text = head + "\n[cell]\n" + "".join(f"{k} = {v}\n" for k, v in keys.items())
    text += "\n[modulus]\nalpha = [0, 1]\n" + tail
    (folder / "case.toml").write_text(text, encoding="utf-8")
    return str(folder / "case.toml")


def solved(folder, capfd, **changes):
    assert main(["image", written(folder, **changes), "--json", "-", "--quiet"]) == 0
    return json.loads(capfd.readouterr().out)


def test_the_keys_of_the_result(folder, capfd):
    found = solved(folder, capfd)
    lower, upper = (np.array(found[f"{end}_GPa"]) for end in ("lower", "upper"))
    assert np.linalg.eigvalsh(upper - lower)[0] > 0
    assert 0 < found["width"] < 0.05
    assert found["E_GPa"]["lower"] < found["E_GPa"]["upper"]
    assert found["nature"] == f"guaranteed, at two corners, {REPEATED}"
    cuts = found["cuts"]["E_GPa"]
    assert cuts["lower"][0] < cuts["lower"][1] < cuts["upper"][1] < cuts["upper"][0]
    assert [row["source"] for row in found["error_table"]] == ["threshold", "discretisation"]
    assert found["grains_E_GPa"]["lower"] > found["E_GPa"]["upper"]
    assert found["iterations"] >= 1
    assert found["seconds"] > 0


def test_the_cost_of_fuzzy_phases_is_told_before_and_nu_with_the_bounds_after(
    folder, capfd, monkeypatch
):
    monkeypatch.setattr(bounds, "MANY", 5 * 1024 - 1)
    case = written(folder, modulus='["20 GPa", "[75, 80, 85] GPa"]')
    assert main(["run", case, "--out", str(folder / "out"), "--no-figures"]) == 0
    told = capfd.readouterr()
    early, first = "pairs of solutions, or more where", "pairs of solutions, the first took"
    assert 0 < told.err.index(f"image of 1024 pixels: 5 {early}") < told.err.index(first)
    assert "; nu = [0." in told.out
    assert "Hashin–Shtrikman bounds of E if the particles are grains: [" in told.out
    assert main(["image", written(folder, threshold="[130]")]) == 0
    assert "pairs of solutions" not in capfd.readouterr().err


@pytest.mark.parametrize(
    ("threshold", "pairs", "work"), [("[130]", 4, 6), ("[[80, 130, 190]]", 7, 11)]
)
def test_the_foretold_time_counts_tiles_and_the_window_by_what_they_take(
    threshold, pairs, work, folder, monkeypatch
):
    """Three tilings of a certain image took 5.3 times as long as the first solution, 256 pixels."""
    solved, tiling = [], ImageModel.tiling
    monkeypatch.setattr(
        ImageModel, "tiling", lambda *given: solved.append(given[2]) or tiling(*given)
    )
    changes = {"threshold": threshold, "boundary": '"window"', "tiles": "2"}
    study = study_of(load(written(folder, **changes)))
    counted, time = bounds.solutions(study)
    bounds.compute(study)
    assert counted == 1 + len(solved) == pairs
    assert time == pytest.approx(
        1 + bounds.TILED * solved.count(2) + bounds.WHOLE * solved.count(1)
    )
    assert time == pytest.approx(work, abs=0.6)


def test_bulk_and_shear_moduli_say_the_same_as_young_and_poisson(folder, capfd):
    young = solved(folder, capfd, threshold="[130]")
    bulk = solved(
        folder,
        capfd,
        threshold="[130]",
        modulus=None,
        poisson=None,
        bulk=f'["{20 / 1.2!r} GPa", "{80 / 1.2!r} GPa"]',
        shear=f'["{20 / 2.6!r} GPa", "{80 / 2.6!r} GPa"]',
    )
    assert np.allclose(young["lower_GPa"], bulk["lower_GPa"], rtol=1e-8, atol=1e-8)


def test_a_fuzzy_poisson_ratio_is_told_to_be_enclosed(folder, capfd):
    found = solved(folder, capfd, poisson="[[0.25, 0.3, 0.35], 0.3]")
    assert found["cuts"]["nature"] == [
        f"{nature}, {REPEATED}" for nature in ("guaranteed enclosure", "guaranteed, at two corners")
    ]


def test_a_random_threshold_gives_the_mean_and_quantiles(folder, capfd):
    law = {"threshold": "[[127, 130, 133]]", "threshold_deviation": "[8, 10, 12]"}
    found = solved(folder, capfd, **law, quantiles="[0.1, 0.9]")
    assert found["nature"] == f"guaranteed, of the mean over the random threshold, {REPEATED}"
    cuts = found["cuts"]["E_GPa"]
    assert cuts["lower"][0] < cuts["lower"][1] < cuts["upper"][1] < cuts["upper"][0]
    random = found["random_threshold"]
    assert random["threshold"] == sorted(random["threshold"])
    assert (np.diff(random["E_GPa"]["upper"]) <= 0).all()
    low, high = (entry["E_GPa"][1] for entry in random["quantiles"])
    assert low["lower"] < cuts["lower"][1] < high["upper"]
    assert low["upper"] < high["upper"]
    sources = {"discretisation", "threshold", "threshold steps"}
    assert {row["source"] for row in found["error_table"]} == sources


def test_a_random_threshold_of_crisp_parameters_and_fuzzy_phases(folder, capfd):
    law = {"threshold": "[130]", "threshold_deviation": "10"}
    fuzzy = '["[19, 20, 21] GPa", "80 GPa"]'
    found = solved(folder, capfd, **law, modulus=fuzzy)
    widths = {row["source"]: row["width_GPa"] for row in found["error_table"]}
    assert widths["phases"] > widths["discretisation"] > widths["threshold steps"]
    assert "threshold" not in widths
    turned = solved(folder, capfd, **law, modulus='["80 GPa", "20 GPa"]')
    assert turned["E_GPa"]["lower"] > found["E_GPa"]["upper"]


def test_labels_and_an_inequality_give_what_a_threshold_does(folder, capfd):
    image = pytest.importorskip("PIL.Image")
    grey = np.asarray(image.open(folder / "a.png"))
    image.fromarray(np.where(grey >= 130, 7, 3).astype(np.uint8)).save(folder / "labels.png")
    crisp = solved(folder, capfd, threshold="[130]")
    labelled = solved(folder, capfd, image='"labels.png"', threshold=None, labels="[3, 7]")
    assert crisp["lower_GPa"] == labelled["lower_GPa"]
    outline = {"image": None, "pixel": None, "threshold": None, "size": '["1 m", "1 m"]'}
    drawn = {"inequality": '"(x - 0.5)**2 + (y - 0.5)**2 <= 0.05"', "pixels": "32"}
    found = solved(folder, capfd, **outline, **drawn)
    assert found["nature"] == f"guaranteed, at two corners, {REPEATED}"
    (widest,) = (row for row in found["error_table"] if row["source"] == "outline")
    assert widest["cure"] == "take more pixels across: cell.pixels"
    corners = 0.5 + np.sqrt(0.05) * np.array(
        [(np.cos(a), np.sin(a)) for a in np.linspace(0, 6.28, 400)]
    )
    rows = "\n".join(f"{x!r},{y!r}" for x, y in corners.tolist())
    (folder / "disc.csv").write_text(f"x [m],y [m]\n{rows}\n")
    polygon = solved(folder, capfd, **outline, polygons='"disc.csv"', pixels="32")
    assert np.allclose(polygon["lower_GPa"], found["lower_GPa"], rtol=0.02)


def test_a_window_gives_a_confidence_interval_and_says_so(folder, capfd):
    found = solved(folder, capfd, boundary='"window"', tiles="2", threshold="[130]")
    assert found["nature"] == "95 % confidence interval of the material, no proof (E alone)"
    assert found["E_GPa"]["lower"] < found["apparent_E_GPa"]["lower"]
    assert found["apparent_E_GPa"]["upper"] < found["E_GPa"]["upper"]
    assert [row["source"] for row in found["error_table"]] == ["finite window", "discretisation"]
    capfd.readouterr()
    assert main(["image", written(folder, boundary='"window"', tiles="2")]) == 0
    told = capfd.readouterr().out
    assert "over the inputs at α = 1, of the window's tiles and not of the material:\n" in told


def test_every_admissible_case_lies_within_what_is_said_of_an_image(folder, capfd):
    image = pytest.importorskip("PIL.Image")
    image.fromarray(np.asarray(image.open(folder / "a.png"))[::2, ::2]).save(folder / "a.png")
    window = {"boundary": '"window"', "tiles": "2"}
    ranges = '["20 GPa ± 10 %", "[70, 75, 85, 90] GPa"]'
    fuzzy = {"modulus": ranges, "poisson": "[[0.1, 0.4], 0.3]"}
    found = solved(folder, capfd, **window, threshold="[[115, 120, 140, 145]]", **fuzzy)
    ends = (("18 GPa", "70 GPa", 145, 0), ("22 GPa", "90 GPa", 115, 0))
    ends += (("18 GPa", "75 GPa", 140, 1), ("22 GPa", "85 GPa", 120, 1))
    grains = []
    for matrix, particle, threshold, alpha in ends:
        modulus = f'["{matrix}", "{particle}"]'
        inputs = {"modulus": modulus, "threshold": f"[{threshold}]"}
        inputs["poisson"] = f"[{0.1 if alpha else 0.4}, 0.3]"
        corner = solved(folder, capfd, **window, **inputs)
        whole = ["apparent_E_support_GPa", "apparent_E_GPa"][alpha]
        inside(corner["apparent_E_GPa"], found[whole])
        if alpha:
            inside(corner["grains_E_GPa"], found["grains_E_GPa"])
            stiff = ("lower", "upper")[matrix == "22 GPa"]
            grains.append(corner["grains_E_GPa"][stiff] / found["grains_E_GPa"][stiff])
    assert np.allclose(grains, 1, rtol=1e-2)
    core, support = found["apparent_E_GPa"], found["apparent_E_support_GPa"]
    assert support["lower"] < core["lower"]
    assert core["upper"] < support["upper"]
    case = written(folder, **window, modulus=ranges)
    assert main(["run", case, "--out", str(folder / "out"), "--no-figures"]) == 0
    told = capfd.readouterr().out
    assert "the window's own apparent E, proved over the inputs: [" in told
    assert "GPa, nu 0.3 (modal values)" in told
    page = material.image(found, Markup(""))
    assert "The window&#39;s own apparent E, proved over the inputs: [" in page


def inside(one, other):
    """An interval lies in another; rounding aside."""
    assert other["lower"] <= one["lower"] * (1 + 1e-6)
    assert one["upper"] <= other["upper"] * (1 + 1e-6)


@pytest.mark.parametrize("command", ["check", "image", "run"])
def test_a_piece_of_a_larger_material_is_not_taken_as_periodic_unseen(folder, capfd, command):
    image = pytest.importorskip("PIL.Image")
    grey = np.asarray(image.open(folder / "a.png"))
    image.fromarray(grey[:, 10:]).save(folder / "piece.png")
    out = ["--out", str(folder / "out"), "--no-figures"] if command == "run" else []
    assert main([command, written(folder, image='"piece.png"', threshold="[130]"), *out]) == 0
    told = capfd.readouterr()
    assert "edges do not match, left and right on " in told.err
    assert 'boundary = "window" is for a piece of a larger material' in told.err
    assert 'boundary = "periodic": the image repeats itself' in told.out
    assert command == "check" or f"guaranteed, at two corners, {REPEATED}" in told.out
    assert main(["check", written(folder)]) == 0
    assert "do not match" not in capfd.readouterr().err
    assert main(["check", written(folder, boundary='"window"')]) == 0
    told = capfd.readouterr()
    assert 'boundary = "window": a piece of a larger material' in told.out
    assert "do not match" not in told.err


def test_a_width_asked_for_divides_the_pixels(folder, capfd):
    whole = solved(folder, capfd, threshold="[130]")
    narrow = solved(folder, capfd, threshold="[130]", width=repr(whole["width"] / 3))
    assert narrow["width"] <= whole["width"] / 3
    open_pixels = {"inequality": '"x <= 0.513"', "size": '["1 m", "1 m"]', "pixels": "16"}
    outline = {"image": None, "pixel": None, "threshold": None, **open_pixels}
    assert main(["image", written(folder, **outline, width="1e-3")]) == 2
    assert "pixels that the outline cuts cause a width" in capfd.readouterr().err


def test_a_width_that_memory_does_not_reach_is_refused_soon(folder, capfd):
    np.save(folder / "l.npy", np.random.default_rng(5).integers(0, 2, (8, 8)))
    case = written(folder, image='"l.npy"', threshold="[0.5]", width="1e-6")
    assert main(["image", case, "--quiet"]) == 2
    (line,) = capfd.readouterr().err.splitlines()
    assert "cell: the width 1.00e-06 takes more parts of a pixel than fit into memory" in line
    assert "at best; take a larger width, or an image of fewer pixels" in line


LOOSE = {"image": '"l.npy"', "threshold": "[0.5]", "modulus": '["20 GPa", "0.002 GPa"]'}


def test_an_e_without_a_positive_bound_is_told_and_handed_to_no_structure(folder, capfd):
    np.save(folder / "l.npy", np.random.default_rng(5).integers(0, 2, (8, 8)))
    assert main(["image", written(folder, **LOOSE), "--quiet"]) == 0
    told = capfd.readouterr().err
    assert "warning: cell: E has no bound above -" in told
    assert "divide the pixels (cell.division) or take phases of less contrast" in told
    head = HEAD.replace('["image"]', '["image", "envelope"]')
    case, out = written(folder, head, FRAME, **LOOSE), folder / "out"
    paper = str(Path(__file__).parents[3] / "cases" / "paper.toml")
    for call, key in (
        (["run", case, "--out", str(out)], "cell"),
        (["envelope", paper, "--modulus", str(out / "image.nc")], "--modulus"),
    ):
        assert main([*call, "--quiet"]) == 2
        line = capfd.readouterr().err.splitlines()[-1]
        assert f"alphacut: {key}: image.nc holds an E down to -" in line
        assert "allowed: an E that is positive throughout: divide the pixels" in line
    whole = ["run", case, "--out", str(out), "--no-figures", "--quiet"]
    assert main([*whole, "--set", 'cell.modulus=["20 GPa", "0.2 GPa"]']) == 0


def test_tiles_that_may_have_no_scatter_of_e_are_bad_input(folder, capfd):
    np.save(folder / "l.npy", np.random.default_rng(5).integers(0, 2, (8, 8)))
    assert main(["image", written(folder, **LOOSE, boundary='"window"'), "--quiet"]) == 2
    assert "take fewer tiles (cell.tiles), so that each is larger" in capfd.readouterr().err


def test_the_words_name_the_plane_strain_bulk_modulus(folder, capfd):
    assert main(["image", written(folder)]) == 0
    told = capfd.readouterr().out
    assert "plane-strain bulk modulus: [" in told
    assert "plane-strain Young's modulus of the softest direction: [" in told
    assert "nearest isotropic tensor: plane-strain bulk " in told
    assert "if the particles are grains, E (Hashin-Shtrikman): [" in told
    assert "the source to improve first on top:\nthreshold " in told


def test_a_run_hands_the_modulus_on_to_the_frame_and_keeps_it(folder, capfd):
    head = HEAD.replace('["image"]', '["image", "envelope"]')
    case = written(folder, head, FRAME)
    out = str(folder / "out")
    assert main(["run", case, "--out", out, "--no-figures", "--json", "-", "--quiet"]) == 0
    found = json.loads(capfd.readouterr().out)
    cuts = found["image"]["cuts"]["E_GPa"]
    assert cuts["lower"][0] < cuts["lower"][-1]
    study = found["envelopes"]["all"]
    assert study["min"]["q1"] < study["max"]["q1"]
    assert main(["report", out]) == 0
    page = (folder / "out" / "report.html").read_text(encoding="utf-8")
    assert "Stiffness of the image" in page
    assert "guaranteed, at two corners" in page
    capfd.readouterr()
    assert main(["run", case, "--out", out, "--no-figures"]) == 0
    assert "image.nc is up to date" in capfd.readouterr().err


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"image": None}, "there is no picture for pixel, threshold, modulus, poisson"),
        ({"image": '"b.png"'}, "there is no such file"),
        ({"inequality": '"x <= 1"'}, "got 2 pictures"),
        ({"pixel": None}, "missing: the side of a pixel"),
        (
            {"pixel": '["1 mm", "1e6 mm"]'},
            "cell.pixel: a pixel is 1e+06 times as high as wide; allowed: 0.001 to 1000 times",
        ),
        ({"threshold": None}, "nothing tells the phases apart"),
        ({"labels": "[0, 1]"}, "two things tell the phases apart"),
        (
            {"threshold": "[250]"},
            "the threshold 250 is outside: the grey values lie from 60 to 200",
        ),
        ({"threshold": "[[50, 130, 140]]"}, r"the threshold [50, 140] is outside"),
        ({"threshold": "[100, 130]"}, "got 2 values for 3 phases"),
        ({"modulus": None}, "cell.modulus: missing beside cell.poisson"),
        ({"bulk": '["1 GPa", "2 GPa"]'}, "both E, ν and K, G are given"),
        ({"poisson": "[0.3, 0.3, 0.3]"}, "got 3 values for 2 phases"),
        ({"modulus": '["1 GPa", "1e300 Pa"]'}, "1e+300 Pa is too large"),
        ({"size": '["64 µm", "70 µm"]'}, "cell.size says 7e-05 m"),
        ({"pixel": '"-1 µm"'}, "greater than 0"),
        ({"threshold": None, "labels": "[60, 200]"}, "which is none of cell.labels"),
        ({"threshold": None, "labels": "[60]"}, "there is one phase"),
        ({"threshold": None, "labels": "[60, 60]"}, "a label stands twice"),
        ({"threshold_deviation": "0"}, "cell.threshold_deviation = 0: 0 is out of range"),
        ({"quantiles": "[0.5]"}, "quantiles are of a random threshold"),
        (
            {"threshold": None, "labels": "[60, 200]", "threshold_deviation": "3"},
            "a random threshold parts two phases",
        ),
        (
            {"threshold_deviation": "3", "boundary": '"window"'},
            "a random threshold is for a periodic image",
        ),
        (
            {
                "threshold_deviation": "3",
                "modulus": None,
                "poisson": None,
                "bulk": '["1 GPa", "3 GPa"]',
                "shear": '["3 GPa", "1 GPa"]',
            },
            "one phase that is stiffer in K + G/3 and in G",
        ),
        ({"matrix_modulus": '"20 GPa"'}, "this is of a round particle"),
        ({"boundary": '"window"', "tiles": "5"}, "no 5 × 5 equal tiles"),
    ],
)
def test_bad_input_is_one_line_and_status_2(folder, capfd, changes, told):
    assert main(["image", written(folder, **changes)]) == 2
    lines = [line for line in capfd.readouterr().err.splitlines() if line]
    assert any(told in line for line in lines), lines
    assert len(lines) == 1
    assert all(line.startswith("alphacut: ") for line in lines)


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"inequality": '"x**2 + y"'}, "is no inequality"),
        ({"inequality": '"x >= 5"'}, "leaves one phase only"),
        ({"inequality": '"x <= 0.5"', "size": None}, "needs the width and height of its cell"),
        ({"inequality": '"x <= 0.5"', "pixel": '"1 m"'}, "this is for cell.image"),
        ({"polygons": '"none.csv"'}, "there is no such file"),
    ],
)
def test_bad_outlines_are_one_line_and_status_2(folder, capfd, changes, told):
    outline = {"image": None, "pixel": None, "threshold": None, "size": '["1 m", "1 m"]'}
    assert main(["image", written(folder, **(outline | changes))]) == 2
    assert told in capfd.readouterr().err


def test_pixels_that_the_file_says_are_not_square_need_their_height(folder, capfd):
    image = pytest.importorskip("PIL.Image")
    image.open(folder / "a.png").save(folder / "b.png", dpi=(300, 150))
    assert main(["image", written(folder, image='"b.png"')]) == 2
    assert "give cell.pixel = [width, height]" in capfd.readouterr().err
    found = solved(folder, capfd, image='"b.png"', pixel='["2 µm", "4 µm"]')
    assert found["upper_GPa"][1][1] > found["upper_GPa"][0][0]  # the particle is twice as high
    assert (
        found["directions_E_GPa"]["greatest"]["upper"] > found["directions_E_GPa"]["least"]["upper"]
    )


def one_phase(folder):
    return np.full((8, 8), 130, np.uint8)


def channels(folder):
    return np.zeros((8, 8, 3), np.uint8)


def palette(folder):
    return pytest.importorskip("PIL.Image").fromarray(channels(folder)).quantize(4)


def sixteen_bits(folder):
    return np.linspace(0, 60000, 64).astype(np.uint16).reshape(8, 8)


def not_finite(folder):
    return np.where(np.eye(8) > 0, np.nan, 200.0)


@pytest.mark.parametrize(
    ("picture", "told"),
    [
        (one_phase, "the image has one grey value, 130, so one phase"),
        (channels, "has several channels (RGB); save the one that tells the phases as grey"),
        (palette, "has a palette: its numbers are colours, not grey values"),
        (sixteen_bits, "the threshold 140 is one of 8 bits, the image has 16"),
        (not_finite, "holds 8 values that are not finite"),
    ],
)
def test_pictures_that_no_threshold_parts_are_one_line_and_status_2(folder, capfd, picture, told):
    image, values = pytest.importorskip("PIL.Image"), picture(folder)
    if picture is not_finite:
        np.save(folder / "b.npy", values)
    else:
        (values if picture is palette else image.fromarray(values)).save(folder / "b.png")
    bad_picture(folder, capfd, '"b.npy"' if picture is not_finite else '"b.png"', told)


def test_an_image_too_large_for_memory_is_refused_with_a_window_that_fits(folder, capfd):
    image = pytest.importorskip("PIL.Image")
    image.new("L", (1200, 1200)).save(folder / "b.png")
    bad_picture(folder, capfd, '"b.png"', "crop a window of ", division="16")
    np.lib.format.open_memmap(folder / "b.npy", "w+", np.uint8, (200_000, 200_000))  # sparse
    bad_picture(folder, capfd, '"b.npy"', "crop a window of ")


def bad_picture(folder, capfd, name, told, **changes):
    out = folder / "out.nc"
    case = written(folder, image=name, **changes)
    assert main(["image", case, "--out", str(out), "--json", str(folder / "o.json")]) == 2
    (line,) = [line for line in capfd.readouterr().err.splitlines() if line]
    assert line.startswith("alphacut: ")
    assert "cell.image" in line
    assert told in line
    assert not out.exists()
    assert not (folder / "o.json").exists()


def test_options_of_petsc_count_and_strangers_are_refused(folder, capfd):
    pytest.importorskip("petsc4py")
    own = solved(folder, capfd, threshold="[130]")
    case = written(folder, threshold="[130]")
    command = ["image", case, "--json", "-", "--quiet"]
    assert main([*command, "-rve_ksp_type", "minres"]) == 0
    other = json.loads(capfd.readouterr().out)
    assert np.allclose(own["lower_GPa"], other["lower_GPa"], rtol=1e-3, atol=1e-3)
    assert main([*command, "-rve_ksp_max_it", "1"]) == 1
    assert "PETSc stopped after 1 iterations" in capfd.readouterr().err
    assert main([*command, "-rve_pc_type", "jacobi"]) == 2
    assert "take python (Fourier transform, the default) or none" in capfd.readouterr().err
    assert main([*command, "-rve_ksp_nonsense", "1"]) == 2
    assert "no use for -rve_ksp_nonsense" in capfd.readouterr().err


def test_an_image_and_another_modulus_are_refused(folder, capfd):
    case = written(folder, HEAD, 'value = "20 GPa"\n')
    assert main(["run", case, "--out", str(folder / "out")]) == 2
    assert "stage image gives the modulus, and so does another" in capfd.readouterr().err


def test_study_of_a_case_without_image_is_refused(folder):
    from alphacut.case.load import load
    from alphacut.stages.image.reading import study_of

    (folder / "c.toml").write_text(
        HEAD.replace('"image"', '"modulus"') + '[modulus]\nvalue = "2 GPa"\n'
    )
    with pytest.raises(BadInput, match=r"needs section \[cell\]"):
        study_of(load(folder / "c.toml"))


def test_each_phase_is_told_with_its_share_and_its_moduli(folder, capfd):
    case = written(folder, threshold="[130]")
    dark = r"dark phase \(below 130\): (\d\d\.\d)% of the area, E 20\.00 GPa, nu 0\.3\n"
    bright = r"bright phase \(above 130\): (\d\d\.\d)% of the area, E 80\.00 GPa, nu 0\.3\n"
    shares = []
    for words in (["check", case], ["image", case], ["run", case, "--out", str(folder / "out")]):
        assert main([*words, *(["--no-figures"] if words[0] == "run" else [])]) == 0
        told = re.search(dark + bright, capfd.readouterr().out)
        assert told, words
        shares.append([float(x) for x in told.groups()])
    assert sum(shares[0]) == pytest.approx(100)
    assert shares[0][1] < 50
    assert shares == [shares[0]] * 3
    assert main(["report", str(folder / "out")]) == 0
    assert "bright phase (above 130)" in (folder / "out/report.html").read_text(encoding="utf-8")


@pytest.mark.parametrize("command", ["check", "image", "run"])
@pytest.mark.parametrize("swapped", [False, True])
def test_a_share_in_words_that_another_phase_covers_is_warned_of(command, swapped, folder, capfd):
    ends = ['"3 GPa"', '"72 GPa"']
    moduli = f"[{', '.join(ends[:: -1 if swapped else 1])}]"
    head = HEAD.replace('"t"', '"Glass fibres in epoxy, 16 % glass"')
    case = written(folder, head, threshold="[130]", modulus=moduli)
    more = ["--out", str(folder / "out"), "--no-figures"] if command == "run" else []
    assert main([command, case, *more]) == 0
    said = "the case says '16 % glass', and the phases of such a modulus cover 84.0%"
    assert (said in capfd.readouterr().err) == swapped


def test_progress_within_a_solution_is_by_the_time_of_the_first(monkeypatch):
    seen, clock = [], iter((0.0, 5.0, 10.0, 10.0, 15.0, 500.0))
    monkeypatch.setattr("alphacut.stages.image.bounds.perf_counter", lambda: next(clock))
    told = Told(seen.append, 4)
    told.still()  # nothing is known of the time of one yet
    told.done(0.25)
    told.first = told.seconds
    told.still()
    told.still()
    told.still()
    assert seen == [0.0, 0.25, 0.25, 0.375, 0.99]


@pytest.mark.parametrize("command", ["image", "run"])
def test_a_stopped_image_goes_on_from_the_fields_that_were_found(
    folder, capfd, monkeypatch, command
):
    case, solve, asked = written(folder), ConjugateGradient.solve, []

    def counted(solver, system):
        asked.append(system)
        if len(asked) == stop:
            raise KeyboardInterrupt
        return solve(solver, system)

    def finished(name):
        asked.clear()
        out = str(folder / name) + (".nc" if command == "image" else "")
        status = main([command, case, "--quiet", "--out", out])
        return status, len(asked), folder / name / "image" if command == "run" else folder / name

    monkeypatch.setattr(ConjugateGradient, "solve", counted)
    monkeypatch.setattr(ConjugateGradient, "threads", 1)
    stop = None
    _, every, whole = finished("whole")
    stop = 5
    status, _, begun = finished("begun")
    assert status == 130
    assert "what was finished is kept in" in capfd.readouterr().err
    assert len(list(begun.with_suffix(".partial").glob("*.npz"))) == 4
    stop = None
    assert finished("begun")[:2] == (0, every - 4)
    assert not begun.with_suffix(".partial").exists()
    first, second = (xarray.load_dataset(file.with_suffix(".nc")) for file in (whole, begun))
    assert first.equals(second)


def test_a_fresh_run_takes_no_fields_of_a_stopped_one(folder, monkeypatch):
    case, solve, asked = written(folder), ConjugateGradient.solve, []

    def counted(solver, system):
        asked.append(system)
        if len(asked) == 5:
            raise KeyboardInterrupt
        return solve(solver, system)

    monkeypatch.setattr(ConjugateGradient, "solve", counted)
    monkeypatch.setattr(ConjugateGradient, "threads", 1)
    command = ["run", case, "--quiet", "--out", str(folder / "out")]
    assert main(command) == 130
    kept = folder / "out" / "image.partial"
    before = {file: file.stat().st_mtime_ns for file in kept.glob("*.npz")}
    asked.clear()
    assert main([*command, "--fresh"]) == 130
    after = {file: file.stat().st_mtime_ns for file in kept.glob("*.npz")}
    assert len(before) == len(after) == 4
    assert all(after[file] > before[file] for file in before)
