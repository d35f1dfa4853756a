"""Figures that the paper alone needs, drawn by cases/paper_figures.py beside those of a run."""

import importlib.util
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from alphacut import main
from alphacut.fuzzy import Triangular
from alphacut.io.results import ResultsFolder
from alphacut.rve import Cell, Phase
from alphacut.rve.cell.lattice import HEXAGONAL
from alphacut.stochastic import HermiteMap
from tests.alphacut.small import CELL, FRAME, written

PROGRAM = Path(__file__).parents[2] / "cases/paper_figures.py"
BOTH = (
    CELL.replace('["modulus"]', '["modulus", "envelope"]')
    + "[frame]"
    + FRAME.partition("[frame]")[2].replace('modulus = "[22, 24, 26] GPa"\n', "")
)


@pytest.fixture(scope="module")
def paper():
    spec = importlib.util.spec_from_file_location("paper_figures", PROGRAM)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_a_mesh_and_six_cuts_are_those_of_the_case(paper):
    cell = Cell(Phase(20e9), Phase(80e9), HermiteMap(0.2, 0.1, 0.6, 0.1))
    plane, density, prisms = paper.domains(cell, 0.5, 3).axes
    (opened,) = paper.draw_mesh(cell, 0.5, 3).axes[0].collections
    cuts = paper.alpha_cuts(Triangular(75e9, 80e9, 85e9))
    assert "3 layers" in density.get_title()
    assert len(prisms.collections) == 4
    assert len(opened.get_facecolor()) > 100
    hexagon = replace(cell, lattice=HEXAGONAL)
    assert paper.domains(hexagon, 0.5, 3).axes[0].get_ylim()[1] == pytest.approx(2 / np.sqrt(3))
    assert paper.draw_mesh(hexagon, 0.5, 3).axes[0].get_xlim()[1] == pytest.approx(1, abs=0.1)
    _, count = paper.edges_of(np.array([[0, 1, 2], [2, 1, 3]]))
    assert count.tolist() == [1, 1, 2, 1, 1]  # the third edge is inside: no face of it is drawn
    assert plane.get_title() == "physical domain, θ = -1"
    bars = [line.get_xdata() for line in cuts.axes[0].lines[1:]]
    assert np.array(bars) / 1e9 == pytest.approx(np.array([[75 + k, 85 - k] for k in range(6)]))


def test_the_box_of_the_cell_has_the_ends_of_the_widest_cut(paper):
    cuts = [22.0, 23.0, 24.0], [28.0, 26.0, 25.0]
    numbers = SimpleNamespace(E_GPa=cuts, method="series", samples=5)
    content, modulus = SimpleNamespace(radius=None), SimpleNamespace(numbers=numbers)
    results = SimpleNamespace(content=content, modulus=modulus, structure=None)
    ((_, lines, _),) = paper.boxes_of(results)
    assert lines[-1] == "E = 22 … 28 GPa"


def test_figures_of_the_paper_stand_beside_those_of_the_run_and_are_drawn_once(
    tmp_path, capfd, paper
):
    case, out = written(tmp_path, BOTH), tmp_path / "out"
    assert main(["run", str(case), "--quiet", "--no-figures", "--out", str(out)]) == 0
    run = set(ResultsFolder.read(out).files)
    capfd.readouterr()
    paper.main([str(case), "--out", str(out)])
    drawn = capfd.readouterr().out.splitlines()
    numbers = {Path(name).name.partition("-")[0] for name in drawn}
    assert numbers == {f"fig{x}" for x in ("02", 13, 14, 16, 17, 19, 20, 21, 26, 27, 36, 37)}
    assert all(Path(name).stat().st_size > 2000 for name in drawn)
    files = set(ResultsFolder.read(out).files)
    assert files - run == {f"figures/{Path(x).name}" for x in drawn} | {"paper_figures.json"}
    before = {name: Path(name).stat().st_mtime_ns for name in drawn}
    paper.main([str(case), "--out", str(out)])
    assert {name: Path(name).stat().st_mtime_ns for name in drawn} == before
