"""Each block of the page "From Python" runs, made quicker, and has the numbers of its case."""

import ast
import importlib
import json
import re
import runpy
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from alphacut import main
from alphacut.case.content import load
from alphacut.frame import envelope
from alphacut.fuzzy import Interval
from tests.alphacut.small import replaced, summary_of_run

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs/from_python.md").read_text(encoding="utf-8")
SCENE = re.compile(r"^## (\d+)\. [^\n]+\n(?:(?!^## ).)*?```python\n(.*?)```", re.M | re.S)
BLOCKS = {int(number): block for number, block in SCENE.findall(PAGE)}
PACKAGES = ("alphacut.rve", "alphacut.frame", "alphacut.fuzzy", "alphacut.stochastic")
OTHERS = ("numpy", "scipy", "matplotlib", "pathlib", "math")
QUICKER = {
    1: {"alpha=(0, 0.5, 1))": "alpha=(0, 1))", '"duration": 5.0': '"duration": 0.5'},
    4: {"particles=2000, packings=20": "particles=100, packings=6"},
    5: {":16, :16, :16": ":8, :8, :8"},
    6: {
        '"duration": 10.0': '"duration": 2.0',
        "record-200[1-3]": "record-200[1-2]",
        '"drift1", 0.008': '"drift1", 0.001163',
        "tolerances(frame, inputs, limits,": "tolerances(frame, inputs, limits, most=1.2,",
        "decide(envelope(frame, inputs,": "decide(envelope(frame, inputs, alpha=(0,),",
    },
    7: {
        "duration=6.0, step=0.02": "duration=2.0, step=0.02, alpha=(0,)",
        "duration=2.0, step=0.01": "duration=0.5, step=0.01",
    },
    8: {"duration=4.0": "duration=1.0"},
}
"""Texts that replace others in a block, by scene; its case is made as quick."""
GOLDEN = json.loads((ROOT / "tests/scenes/golden.json").read_text(encoding="utf-8"))


def test_every_scene_has_one_block_and_every_block_a_scene():
    assert PAGE.count("```python") == len(BLOCKS) == len(re.findall(r"^## \d+\.", PAGE, re.M))
    assert list(BLOCKS) == sorted(BLOCKS)


@pytest.mark.parametrize("scene", BLOCKS)
def test_a_block_has_at_most_twelve_statements_and_public_imports(scene):
    nodes = list(ast.walk(ast.parse(BLOCKS[scene])))
    imports = [node for node in nodes if isinstance(node, ast.Import | ast.ImportFrom)]
    statements = [node for node in nodes if isinstance(node, ast.stmt)]
    assert len(statements) - len(imports) <= 12
    for node in imports:
        if isinstance(node, ast.ImportFrom) and node.module in PACKAGES:
            public = set(importlib.import_module(node.module).__all__)
            assert {alias.name for alias in node.names} <= public
            continue
        names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
        names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
        assert all(name.partition(".")[0] in OTHERS for name in names), names


def has_the_radius_map_of_the_case(names):
    """Whether packed particles have the map of cases/concrete.toml."""
    counts = [f"--set=microstructure.packing.{x}" for x in ("particles=100", "packings=6")]
    words = ["microstructure", "cases/concrete.toml", *counts, "--quiet", "--json", "map.json"]
    assert main(words) == 0
    fitted, case = names["fitted"], json.loads(Path("map.json").read_text(encoding="utf-8"))
    for name in ("a2", "a4"):
        cut = fitted.inputs[name].support
        numbers = [cut.lower, fitted.inputs[name].nominal, cut.upper]
        assert numbers == pytest.approx(case[name], rel=1e-7)
        assert getattr(fitted.map, name) == pytest.approx(case[name][1], rel=1e-7)
    assert (fitted.map.a1, fitted.map.a3) == (case["a1"], case["a3"])


def moves_as_the_structure_of_the_case(names):
    """Whether matrices move as those of cases/plane-frame.toml under its first record."""
    content = load(str(ROOT / "cases/plane-frame.toml")).content
    ground = content.records.suite[0][0].accelerogram(content.records.baseline)
    model = replace(content.structure.model.with_outputs(("roof",)), ground=ground)
    times = {"duration": 2.0, "step": 0.02, "alpha": (0,)}
    of_case = envelope(model, {"ks": Interval(0.75, 1.25)}, **times)
    of_block = envelope(names["frame"], {"springs": Interval(0.75, 1.25)}, **times)
    size = np.abs(of_case.upper).max()
    assert size > 0.005
    assert of_block.lower == pytest.approx(of_case.lower, abs=1e-9 * size)
    assert of_block.upper == pytest.approx(of_case.upper, abs=1e-9 * size)


def teaches_what_the_case_learns(names):
    """Whether modes narrow the storeys of cases/laboratory-frame.toml as in the case."""
    learned = names["learned"].answer
    case = GOLDEN["laboratory-frame"]["update"]
    by_column = 12 * 200e9 * 9.850884e-12 / 0.3**3  # stiffness of one column, in N/m
    for storey in (1, 2, 3, 4):
        ends, columns = learned.inputs[f"k{storey}"], case["inputs"][f"c{storey}"]
        assert ends.lower[0] == pytest.approx(by_column * columns["lower"][0], rel=1e-3)
        assert ends.upper[0] == pytest.approx(by_column * columns["upper"][0], rel=1e-3)
    assert [mode.mode for mode in learned.held_out if mode.inside] == [3, 4]


def has_the_modulus_of_the_paper(names):
    """Whether the campaign has E of cases/paper.toml at its lowest and highest level."""
    cuts, case = names["stiffness"].cuts("E") / 1e9, GOLDEN["paper"]["modulus"]["E_GPa"]
    for row, level in ((0, 0), (-1, -1)):
        ends = case["lower"][level], case["upper"][level]
        assert cuts[row] == pytest.approx(ends, rel=1e-7)


def has_the_modulus_of_the_sample(names):
    """Whether prisms have E of the paper's nominal cell; see tests/scenes/test_materials.py."""
    assert names["sample"].modulus == pytest.approx(24.773342084495e9, rel=1e-6)


BUILDING = """
title = "A building under records"
stages = ["envelope"]
shares = false
[frame]
masses = ["50 t", "50 t", "50 t"]
stiffness = ["90 MN/m ± 6 %", "80 MN/m ± 6 %", "70 MN/m ± 6 %"]
lengths = ["3.5 m", "3 m", "3 m"]
damping_ratio = "4 %"
outputs = ["drift1", "a3"]
GROUND
[envelope]
fuzzy = ["k"]
alpha = [0, 1]
duration = "2 s"
step = "0.02 s"
"""


def answers_as_the_cases_of_a_building(names):
    """Whether a building has the answers of two cases: under one record, and under a suite."""
    text = BUILDING + '[decision]\nlimits = ["drift1 <= 1.163 mm"]\n'
    text += '[tolerances]\nmost = 1.2\nlimits = ["drift1 <= 1.163 mm"]\n'
    samples = [
        f"{0.02 * k:.2f},{x!r}" for k, x in enumerate(names["frame"].ground.samples.tolist())
    ]
    Path("ground.csv").write_text("\n".join(["time [s],a [m/s^2]", *samples]), encoding="utf-8")
    case = Path("building.toml")
    case.write_text(text.replace("GROUND", 'accelerogram = "ground.csv"'), encoding="utf-8")
    summary = summary_of_run(case, "--fresh")
    limit, found = summary["decision"]["limits"]["drift1"], names["decision"].limits["drift1"]
    assert (limit["verdict"], limit["nature"]) == (found.verdict, "guaranteed")
    upper = limit["peak"]["upper"][0]
    assert found.peak.upper[0] == pytest.approx(upper, rel=0.01)
    assert 1 < summary["tolerances"]["kept"] < 1.2
    assert names["scale"].kept == pytest.approx(summary["tolerances"]["kept"], rel=0.03)
    text = BUILDING + '[fragility]\nlimits = ["drift1 <= 1.163 mm"]\n'
    records = '[records]\nbaseline = "mean"\nfiles = "cases/suite/record-200[1-2].AT2"\n'
    case.write_text(text.replace("GROUND", records), encoding="utf-8")
    of_case = summary_of_run(case, "--fresh")["fragility"]["limits"]["drift1"]
    of_block = names["under_suite"].limits["drift1"]
    assert of_block.critical.low[0] == pytest.approx(of_case["critical"]["low"][0], rel=1e-3)
    assert of_block.critical.high[0] == pytest.approx(of_case["critical"]["high"][0], rel=1e-3)
    assert of_block.median.lower[0] == pytest.approx(of_case["median"]["lower"][0], rel=1e-3)


def has_bounds_between_those_of_the_phases(names):
    """Whether E at the most plausible values lies between its means by Reuss and Voigt."""
    stiffness = names["stiffness"]
    fractions = list(stiffness.fractions.values())
    lower, upper = stiffness.young[-1]
    softest = 1 / sum(f / e for f, e in zip(fractions, (19.9e9, 79e9), strict=True))
    stiffest = sum(f * e for f, e in zip(fractions, (20.1e9, 81e9), strict=True))
    assert softest < lower < upper < 1.05 * stiffest  # ν of the phases differ
    assert stiffness.young[0, 0] < lower
    assert stiffness.young[0, 1] > upper
    assert set(stiffness.widths) == {"discretisation", "threshold", "phases"}


CHECKS = {
    1: has_the_modulus_of_the_paper,
    2: has_the_modulus_of_the_sample,
    4: has_the_radius_map_of_the_case,
    6: answers_as_the_cases_of_a_building,
    5: has_bounds_between_those_of_the_phases,
    7: moves_as_the_structure_of_the_case,
    8: teaches_what_the_case_learns,
}
"""What the names that a block leaves are compared with, by scene."""


@pytest.mark.parametrize("scene", BLOCKS)
def test_a_block_runs_and_has_the_numbers_of_its_case(scene, tmp_path, monkeypatch, capsys):
    """In a folder of its own, with links to what a block may read in that of the project."""
    if "PrismModel" in BLOCKS[scene]:
        pytest.importorskip("dolfinx")
    for name in ("cases", "meshes"):
        (tmp_path / name).symlink_to(ROOT / name)
    file = tmp_path / f"scene_{scene}.py"
    file.write_text(replaced(BLOCKS[scene], QUICKER.get(scene, {})), encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    names = runpy.run_path(str(file), run_name="__main__")
    printed = capsys.readouterr().out
    assert printed
    assert "object at 0x" not in printed
    if scene in CHECKS:
        CHECKS[scene](names)
