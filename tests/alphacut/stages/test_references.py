"""Bounds and estimates beside E: against each other, limits and numbers found another way."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from alphacut.entry import main
from alphacut.rve import bounds as plane
from alphacut.rve.cell import Phase
from alphacut.rve.representative.averages import Isotropic
from alphacut.rve.spheres import bounds as space
from alphacut.stages.material.references import references
from alphacut.stochastic import HermiteMap

CASES = Path(__file__).parents[3] / "cases"
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
    from alphacut.rve.anisotropy import shear_ratio
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
