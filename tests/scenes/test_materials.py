"""Scenes 2 and 5: three samples of the product-space cell, and a micrograph as the cell."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
import xarray
from PIL import Image

from alphacut import main
from alphacut.rve import solve_image
from alphacut.rve.image.phases import PhaseModuli
from alphacut.stages.modulus import fuzzy_loss
from tests.scenes.test_cases import overlapping_cuts

ROOT = Path(__file__).parents[2]
SAMPLES = {  # a2, a4, modulus of the particles in GPa: E in GPa and ν at size 0.15 with 12 layers
    (0.1, 0.1692, 80): (24.773342084495, 0.302194748870),
    (0.001, 0.9975, 75): (22.803977321420, 0.300610589460),
    (0.3145, 0.001, 85): (25.838067087830, 0.303097877986),
}
MICROGRAPH = {
    "lower": [24.40941710097642, 26.508645442920326],
    "upper": [28.958025908990347, 26.51700242188462],
}


def alphacut(folder, *words):
    """The document of a command of the program that must succeed."""
    file = folder / "answer.json"
    assert main([*map(str, words), "--quiet", "--json", str(file)]) == 0
    return json.loads(file.read_text(encoding="utf-8"))


@pytest.mark.parametrize("sample", SAMPLES)
def test_a_sample_of_the_cell_has_its_golden_modulus(sample, tmp_path):
    a2, a4, modulus = sample
    sets = f"radius.a2={a2}", f"radius.a4={a4}", f"cell.inclusion_modulus='{modulus} GPa'"
    words = "cell", ROOT / "cases/paper.toml", *(f"--set={one}" for one in sets)
    result = alphacut(tmp_path, *words)
    young, poisson = SAMPLES[sample]
    assert result["E_GPa"] == pytest.approx(young, rel=1e-6)
    assert result["nu"] == pytest.approx(poisson, rel=1e-6)


TOLERANCE = "--set=modulus.tolerance=1e-3"
CELL = """
title = "Any particle"
stages = ["modulus"]
radius = {a1 = 0.3, a2 = 0, a3 = 0.5, a4 = 0}
[cell]
particles = "ellipses(2, ANGLE)"
matrix_modulus = "20 GPa"
matrix_poisson = 0.3
inclusion_modulus = [
    ["90 GPa", "20 GPa", "0 GPa"], ["20 GPa", "90 GPa", "0 GPa"], ["0 GPa", "0 GPa", "25 GPa"]
]
"""


def test_an_ellipse_of_any_stiffness_is_a_case(tmp_path):
    (tmp_path / "case.toml").write_text(CELL.replace("ANGLE", "0"), encoding="utf-8")
    result = alphacut(tmp_path, "cell", tmp_path / "case.toml", "--set=mesh.size=0.6")
    assert (result["method"], result["fibres"]) == ("slices", {})
    assert list(result["references"]) == ["fraction"]


@pytest.mark.slow
def test_ellipses_of_two_models_agree_and_turn_their_stiffness(tmp_path):
    """Prisms agree with slices, which `auto` takes; turned by 90 degrees, C11 and C22 exchange."""
    results = []
    for angle, method in ((0, "slices"), (0, "prism"), (90, "slices")):
        (tmp_path / "case.toml").write_text(CELL.replace("ANGLE", str(angle)), encoding="utf-8")
        words = "cell", tmp_path / "case.toml", TOLERANCE, f"--method={method}"
        results.append(alphacut(tmp_path, *words))
    assert results[1]["E_GPa"] == pytest.approx(results[0]["E_GPa"], rel=1e-3)
    swap = np.ix_([1, 0, 2], [1, 0, 2])
    first, _, turned = (np.array(result["stiffness_GPa"]) for result in results)
    np.testing.assert_allclose(first, turned[swap], rtol=1e-6, atol=1e-6)


def micrograph(path, *, pixels=48, discs=6):
    """A picture of discs that repeats itself, its edges four pixels wide."""
    rng = np.random.default_rng(7)
    y, x = np.mgrid[:pixels, :pixels] + 0.5
    centres, radii = rng.random((2, discs)) * pixels, rng.uniform(4, 7, discs)
    outside = np.full((pixels, pixels), 9.0)  # distance to the nearest circle
    for cx, cy, radius in zip(*centres, radii, strict=True):
        dx, dy = abs(x - cx), abs(y - cy)
        away = np.hypot(np.minimum(dx, pixels - dx), np.minimum(dy, pixels - dy))
        outside = np.minimum(outside, away - radius)
    Image.fromarray(np.clip(130 - 30 * outside, 70, 190).astype(np.uint8)).save(path)


def test_a_micrograph_has_its_proved_bounds_and_losses(tmp_path):
    micrograph(tmp_path / "cell.png")
    text = (ROOT / "cases/composite.toml").read_text(encoding="utf-8")
    text = text.replace("composite.png", "cell.png")
    text = re.sub(r'^(stages = .*), "envelope"\]', r"\1]", text, flags=re.MULTILINE)
    case = tmp_path / "case.toml"
    case.write_text(text, encoding="utf-8")
    out = tmp_path / "out"
    sets = "cell.threshold=['[120, 130, 140]']", "modulus.alpha=[0, 1]", "cell.loss=['4 %', '1 %']"
    words = "run", case, "--no-figures", f"--out={out}", *(f"--set={one}" for one in sets)
    image = alphacut(tmp_path, *words)["image"]
    overlapping_cuts(image, {"E_GPa": MICROGRAPH})
    assert image["nature"] == "guaranteed"
    for name in ("E", "G", "K"):
        ends = image["proved_losses"][name]
        assert 0.01 < ends["lower"][1] < ends["upper"][1] < 0.04
    proved = image["proved_losses"]["E"]
    with xarray.open_dataset(out / "image.nc") as data:  # what a frame takes
        assert [*fuzzy_loss(data).cut(1.0)] == [proved["lower"][1], proved["upper"][1]]


def test_a_tomogram_has_its_proved_bounds_and_losses(tmp_path):
    volume = np.load(ROOT / "cases/tomogram.npy")[:8, :7, :5]
    tifffile = pytest.importorskip("tifffile")
    tifffile.imwrite(tmp_path / "volume.tif", volume)
    text = (ROOT / "cases/tomogram.toml").read_text(encoding="utf-8")
    text = text.replace("tomogram.npy", "volume.tif").replace('"envelope"', "")
    case = tmp_path / "case.toml"
    case.write_text(text, encoding="utf-8")
    words = f"--out={tmp_path / 'out'}", "--set=modulus.alpha=[0, 1]", "--no-figures"
    image = alphacut(tmp_path, "run", case, *words)["image"]
    assert image["nature"] == "guaranteed"
    low, high = (np.array(image["E_GPa"][side]) for side in ("lower", "upper"))
    phase = (volume >= 130).astype(int)  # at the nominal threshold and moduli
    pairs = [PhaseModuli.of_young(e, nu, 3) for e, nu in ((20.0, 0.3), (80.0, 0.2))]
    bulk, shear = (np.array([getattr(x, name) for x in pairs])[phase] for name in ("bulk", "shear"))
    inside = solve_image(bulk, shear, division=2).bounds
    assert (low <= inside.young()[0]).all()
    assert (inside.young()[1] <= high).all()
    assert (high - low)[1] < 0.1 * low[1] < (high - low)[0]
    losses = {name: ends["lower"] for name, ends in image["proved_losses"].items()}
    assert set(losses) == {"E", "E_x", "E_y", "E_z", "G", "K"}
    assert all(0.01 < loss[0] < 0.04 for loss in losses.values())
