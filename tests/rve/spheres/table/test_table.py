"""Tables of spheres against the exact series."""

import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from alphacut.rve import Phase
from alphacut.rve.spheres.bounds import mori_tanaka
from alphacut.rve.spheres.series.model import SphereSeriesModel
from alphacut.rve.spheres.series.stiffness import cubic_stiffness
from alphacut.rve.spheres.table import model as tabled
from alphacut.rve.spheres.table.model import SphereRange, SphereTableModel
from alphacut.rve.table.build import TableError
from alphacut.stochastic import HermiteMap

MATRIX, MODULI, MAP = Phase(20e9), (75e9, 85e9), HermiteMap(0.47, 0.1, 0.9, 0.0)


def against_series(model, radius_map=MAP, moduli=(75e9, 79e9)):
    phases = [Phase(e) for e in moduli]
    results = model.solve(radius_map, MATRIX, phases)
    for own, exact in zip(
        results, SphereSeriesModel().solve(radius_map, MATRIX, phases), strict=True
    ):
        true = np.append(own.moduli / exact.moduli, own.modulus / exact.modulus) - 1
        declared = np.append(own.modulus_errors, own.estimated_error)
        assert (abs(true) <= declared).all()
    return results


class SeriesSource:
    """Moduli by series, to test the table itself."""

    mesh_size, unknowns, systems = 0.0, 0, 0
    space = np.array([[0.5], *4 * [[1e-10]]])

    def __init__(self, span, accuracy, parallel):
        self.span = span

    def moduli(self, radii, modulus):
        return [self.rough(radius, modulus) for radius in radii]

    def rough(self, radius, modulus):
        phases = [Phase(float(e), self.span.poisson) for e in modulus]
        cell = cubic_stiffness(np.array([radius]), self.span.matrix, phases, tolerance=1e-10)
        return np.stack([cell.bulk[0], cell.deviator[0], cell.shear[0]], axis=-1)


def test_interpolation_keeps_what_it_declares(monkeypatch):
    monkeypatch.setattr(tabled, "OctantSource", SeriesSource)
    monkeypatch.setattr("alphacut.rve.table.cache._in_process", {})
    for result in against_series(SphereTableModel(3e-4, moduli=MODULI)):
        assert result.largest_error <= 4e-4


def test_elements_in_a_table_keep_what_they_declare():
    result = against_series(SphereTableModel(1e-2), HermiteMap(0.5, 0.0, 0.5, 0.0), (80e9,))[0]
    assert 0 < result.errors["space"].max() <= 6e-3
    assert result.unknowns > 1000


@pytest.mark.slow
def test_a_whole_table_of_elements_keeps_what_it_declares():
    for result in against_series(SphereTableModel(2e-3, moduli=MODULI)):
        assert result.estimated_error <= 2.1e-3


def test_what_is_tabled_is_over_mori_and_tanaka():
    span = SphereRange(MATRIX, 0.2, (0.3, 0.9), MODULI)
    bulk, shear = mori_tanaka(np.array(np.pi / 6 * 0.6**3), MATRIX, Phase(80e9, 0.2))
    found = span.dilute(np.array([0.6]), np.array([80e9]))
    np.testing.assert_allclose(found[0, 0], [bulk, shear, shear])


def test_an_accuracy_out_of_reach_is_refused(monkeypatch):
    with pytest.raises(ValueError, match=r"accuracy of the table of spheres is 1e-06"):
        SphereTableModel(1e-6)
    monkeypatch.setattr("alphacut.rve.spheres.table.model._FINEST", 0.5)
    with pytest.raises(TableError, match=r"on the finest mesh .*--tolerance") as told:
        SphereTableModel(1e-4).solve(HermiteMap(0.5, 0.0, 0.5, 0.0), MATRIX, [Phase(80e9)])
    larger = 0.9 * float(re.search(r" of ([\d.e-]+), say", str(told.value))[1])
    model = SphereTableModel(larger)
    assert model.solve(HermiteMap(0.5, 0.0, 0.5, 0.0), MATRIX, [Phase(80e9)])


def test_ranks_that_share_a_mesh_build_the_table_by_themselves(tmp_path, monkeypatch):
    """A file that one of them finds and another does not would leave them waiting."""
    radii, found = HermiteMap(0.5, 0.0, 0.5, 0.0), []
    for parallel in (False, True):
        monkeypatch.setattr("alphacut.rve.table.cache._in_process", {})
        model = SphereTableModel(1e-2, tmp_path / str(parallel), parallel=parallel)
        found.append(model.solve(radii, MATRIX, [Phase(80e9)])[0])
    np.testing.assert_allclose(found[1].moduli, found[0].moduli, rtol=1e-10)
    assert list((tmp_path / "False").iterdir())
    assert not (tmp_path / "True").exists()


@pytest.mark.slow
def test_two_ranks_give_what_one_gives():
    case = Path(__file__).parents[4] / "cases" / "paper-3d.toml"
    command = [sys.executable, "-m", "rve", "solve", str(case), "--method", "table", "--json", "-"]
    command += ["--radius", "0.6", "--tolerance", "1e-2"]
    one, two = (
        json.loads(subprocess.run([*start, *command], capture_output=True, check=True).stdout)
        for start in ((), ("mpirun", "-n", "2"))
    )
    for name in ("E_GPa", "K_GPa", "G_GPa"):
        np.testing.assert_allclose(two[name], one[name], rtol=1e-10)
