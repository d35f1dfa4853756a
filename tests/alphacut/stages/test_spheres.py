"""Spheres of a stated fraction: E inside the bounds of what the case says, or refused."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from alphacut.case.content import load
from alphacut.case.microstructure import PackingSection
from alphacut.fuzzy import RefusedError
from alphacut.stages.cell import CellProblem, require_bounds
from tests.alphacut.case.test_load import fraction_case


def case(folder: Path, fraction: float):
    path = folder / "case.toml"
    path.write_text(fraction_case("spheres", fraction))
    return load(path).content


@pytest.mark.parametrize("fraction", [0.1, 0.5])
def test_spheres_of_one_size_hold_the_fraction_and_lie_within_its_bounds(tmp_path, fraction):
    problem = CellProblem.of(case(tmp_path, fraction))
    modulus, bounds = problem.solve().modulus, problem.references()
    assert bounds["fraction"] == pytest.approx(fraction, rel=1e-12)
    require_bounds((modulus / 1e9,) * 2, bounds, problem.cell.particles)


@pytest.mark.parametrize(
    ("fraction", "low", "modulus"), [(0.5, 33.333333, 30.466), (0.4, 30.0, 28.30)]
)
def test_a_modulus_outside_the_bounds_of_the_stated_fraction_is_refused(
    tmp_path, fraction, low, modulus
):
    """Both moduli are those of maps that had lost a fifth of the spheres."""
    problem = replace(CellProblem.of(case(tmp_path, 0.3)), stated_fraction=fraction)
    bounds = problem.references()
    ends = np.array(bounds["hashin_shtrikman_E_GPa"])
    assert ends[0] == pytest.approx(low, rel=1e-7)
    with pytest.raises(RefusedError, match=f"E of spheres is .*set cell.fraction = {fraction:g}"):
        require_bounds((modulus, modulus), bounds, "spheres")
    for inside in ends * [0.9951, 1.0049]:
        require_bounds((inside, inside), bounds, "spheres")
    for outside in ends * [0.9949, 1.0051]:
        with pytest.raises(RefusedError):
            require_bounds((outside, outside), bounds, "spheres")


@pytest.mark.parametrize(("shape", "densest"), [("spheres", 0.58), ("cylinders", 0.82)])
def test_a_packing_that_is_too_dense_names_the_cell_of_that_fraction(shape, densest):
    section = PackingSection(
        particles=20, fraction=0.83, smallest_radius="1 mm", largest_radius="2 mm"
    )
    with pytest.raises(RefusedError) as refused:
        section.require_readable(spheres=shape == "spheres")
    assert f"up to {densest}" in str(refused.value)
    assert "set cell.fraction = 0.83" in str(refused.value)
