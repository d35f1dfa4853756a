"""Every E, ν and G that `cell` and `modulus` print is theory/cell.md's formula of the stiffness."""

import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

from tests.scenes.test_materials import micrograph

ROOT = Path(__file__).parents[2]
SERIES = "modulus.method='series'"
UNEQUAL = ("cell.inclusion_poisson=0.15", SERIES)  # so that ν_LT is not that of both phases


def printed(folder, command, case, changes):
    """What a command prints, as text and as JSON."""
    file = folder / f"{command}.json"
    sets = [f"--set={change}" for change in changes]
    words = [command, f"cases/{case}.toml", f"--json={file}", *sets]
    done = subprocess.run(
        [sys.executable, "-m", "alphacut", *words], cwd=ROOT, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    return done.stdout, json.loads(file.read_text(encoding="utf-8"))


def numbers_of(text):
    """First number of each line of a table of single values, with half of its last digit."""
    rows = re.findall(r"^(\S+?)(?:, GPa)? +(-?\d+\.?\d*)  ", text, re.M)
    return {name: (float(x), 0.5 * 10.0 ** -len(x.partition(".")[2])) for name, x in rows}


def hill(first, second):
    """Hill's shear modulus of a square array."""
    return ((first + second) / 2 + 2 / (1 / first + 1 / second)) / 2


def plane(stiffness, average):
    """K_T, G_T, E and ν of a plane stiffness."""
    c = np.asarray(stiffness)
    axial = (c[0, 0] + c[1, 1]) / 2
    bulk, diagonal = (axial + c[0, 1]) / 2, (axial - c[0, 1]) / 2
    shear = c[2, 2] if average == "axes" else hill(c[2, 2], diagonal)
    nu = (1 - 2 * shear / (2 * bulk)) / 2
    return {"K_T": bulk, "G_T": shear, "E": 2 * shear * (1 + nu), "nu": nu}


def along_fibres(bulk, shear, fraction, phases):
    """E_L, ν_LT and E_T by Hill's relations from K_T, G_T and the phases' E and ν."""
    e, nu = np.array(phases).T
    mu = e / (2 * (1 + nu))
    lam = 2 * mu * nu / (1 - 2 * nu)
    k, low, high = lam + mu, lam, lam + 2 * mu
    share = np.array([1 - fraction, fraction])
    slope = np.diff(low)[0] / np.diff(k)[0]
    cross = share @ low + slope * (bulk - share @ k)
    axial = share @ high + slope**2 * (bulk - share @ k)
    young, ratio = axial - cross**2 / bulk, cross / (2 * bulk)
    across = 1 / (1 / (4 * shear) + 1 / (4 * bulk) + ratio**2 / young)
    return {"E_L": young, "nu_LT": ratio, "E_T": across}


def phases_of(case, changes):
    """E in GPa and ν of matrix and inclusion at the nominal values."""
    cell = tomllib.loads((ROOT / f"cases/{case}.toml").read_text(encoding="utf-8"))["cell"]
    pairs = []
    for name in ("matrix", "inclusion"):
        young = re.findall(r"[\d.]+", str(cell[f"{name}_modulus"]))
        unit = {"G": 1.0, "M": 1e-3}[re.search(r"([GM])Pa", cell[f"{name}_modulus"])[1]]
        pairs.append([unit * float(young[len(young) // 2]), cell[f"{name}_poisson"]])
    if UNEQUAL[0] in changes:
        pairs[1][1] = 0.15
    return pairs


def agree(text, expected):
    """Whether a table has the expected numbers, to the digits that it shows."""
    shown = numbers_of(text)
    for name, value in expected.items():
        number, half = shown[name.replace("nu", "ν")]
        assert abs(number - value) <= 1.0001 * half, (name, number, value)


@pytest.mark.parametrize(
    ("case", "changes"),
    [
        ("porous", ()),
        ("paper", ("modulus.average='isotropic'", *UNEQUAL)),
    ],
)
def test_fibres(case, changes, tmp_path):
    average = "isotropic" if "modulus.average='isotropic'" in changes else "axes"
    text, cell = printed(tmp_path, "cell", case, changes)
    moduli = plane(cell["stiffness_GPa"], average)
    phases = phases_of(case, changes)
    fraction = cell["references"]["fraction"]
    moduli |= along_fibres(moduli["K_T"], moduli["G_T"], fraction, phases)
    assert cell["E_GPa"] == pytest.approx(moduli["E"], rel=1e-12)
    assert cell["nu"] == pytest.approx(moduli["nu"], rel=1e-12)
    for name, pair in cell["fibres"].items():
        plain = name.removesuffix("_GPa")
        if plain != "G_L":  # Rayleigh's series, of no plane stiffness
            assert pair["value"] == pytest.approx(moduli[plain], rel=1e-9), name
    agree(text, moduli)
    _, modulus = printed(tmp_path, "modulus", case, (*changes, "modulus.alpha=[1]"))
    cuts = {"E": modulus["E_GPa"], "nu": modulus["nu_cuts"]}
    cuts |= {name.removesuffix("_GPa"): cut for name, cut in modulus["fibres"].items()}
    for name in set(cuts) & set(moduli):
        for side in ("lower", "upper"):
            assert cuts[name][side][-1] == pytest.approx(moduli[name], rel=1e-5), name


def test_spheres(tmp_path):
    text, cell = printed(tmp_path, "cell", "paper-3d", ())
    c = np.array(cell["stiffness_GPa"])
    bulk, deviator, shear = (c[0, 0] + 2 * c[0, 1]) / 3, (c[0, 0] - c[0, 1]) / 2, c[3, 3]
    voigt, reuss = (2 * deviator + 3 * shear) / 5, 5 / (2 / deviator + 3 / shear)
    mean = (voigt + reuss) / 2
    moduli = {
        "E": 9 * bulk * mean / (3 * bulk + mean),
        "nu": (3 * bulk - 2 * mean) / (6 * bulk + 2 * mean),
    }
    assert cell["E_GPa"] == pytest.approx(moduli["E"], rel=1e-12)
    assert cell["nu"] == pytest.approx(moduli["nu"], rel=1e-12)
    agree(text, moduli)


def test_images(tmp_path):
    """The ends of E and ν are those over all G and K between the ends of the stiffness."""
    micrograph(tmp_path / "cell.png")
    image = f"cell.image='{tmp_path / 'cell.png'}'"
    changes = (image, "modulus.average='isotropic'", "modulus.alpha=[1]")
    _, cell = printed(tmp_path, "modulus", "composite", changes)
    low, high = (plane(cell[f"{end}_GPa"], "isotropic") for end in ("lower", "upper"))
    corners = [(g, k) for g in (low["G_T"], high["G_T"]) for k in (low["K_T"], high["K_T"])]
    young = [3 * g - g * g / k for g, k in corners]  # rises with both, as G < 3 K/2
    ratios = [(1 - g / k) / 2 for g, k in corners]
    (cut,) = zip(*(cell["cuts"]["E_GPa"][side] for side in ("lower", "upper")), strict=True)
    assert cut == pytest.approx((min(young), max(young)), rel=1e-12)
    expected = {"nu": (min(ratios), max(ratios)), "G_T_GPa": (low["G_T"], high["G_T"])}
    for name, ends in expected.items():
        assert (cell[name]["lower"], cell[name]["upper"]) == pytest.approx(ends, rel=1e-12), name
    assert cell["average"] == "isotropic"
