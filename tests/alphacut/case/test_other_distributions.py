"""What other distributions register is taken by a case; the templates pass the common checks."""

import importlib.util
import os
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np

from alphacut.frame import StoreyFrame, pendulum
from alphacut.frame.dynamics.nonlinear import make_flow
from alphacut.frame.records.check import check_record_format
from alphacut.frame.records.networks import FORMATS
from alphacut.frame.verification import check_structure as check
from alphacut.frame.verification.check_structure import check_structure
from alphacut.rve.models import MODELS
from alphacut.rve.result.check import check_cell_model
from alphacut.stochastic import HermiteMap
from tests.alphacut.small import CELL, FRAME, told_by
from tests.refused import refuses

ROOT = Path(__file__).parents[3]
TEMPLATES = ROOT / "demos/templates"
RIG = """
title = "A mass on a spring"
stages = ["envelope"]
[rig]
mass = "[9, 10, 11] t"
spring = "[3.6, 4, 4.4] MN/m"
[envelope]
fuzzy = ["mass", "spring"]
alpha = [0, 1]
duration = "0.4 s"
step = "0.02 s"
"""
ENTRIES = """[alphacut.structures]
rig = structure:Rig
[alphacut.cells]
rough = cell_model:ENTRY
[alphacut.records]
acme = record_format:ACME
"""
SAMPLES = " ".join(f"{0.01 * np.sin(0.3 * k):.5f}" for k in range(100))
ACME = f"ACME RECORDER  step .02 s  100 samples\n{SAMPLES}\n"


def template(name):
    spec = importlib.util.spec_from_file_location(name, TEMPLATES / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # where dataclasses look for the types of fields
    spec.loader.exec_module(module)
    return module


def wheel(folder):
    """A wheel of the three templates."""
    path = folder / "templates-1-py3-none-any.whl"
    with zipfile.ZipFile(path, "w") as archive:
        for name in ("structure", "cell_model", "record_format"):
            archive.write(TEMPLATES / f"{name}.py", f"{name}.py")
        info = "templates-1.dist-info"
        archive.writestr(f"{info}/METADATA", "Metadata-Version: 2.1\nName: templates\nVersion: 1\n")
        archive.writestr(
            f"{info}/WHEEL", "Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n"
        )
        archive.writestr(f"{info}/entry_points.txt", ENTRIES)
        archive.writestr(f"{info}/RECORD", "")
    return path


def test_a_case_takes_what_a_distribution_of_its_own_registers(tmp_path):
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-index", "--no-deps"]
    subprocess.run([*pip, "--target", tmp_path / "site", wheel(tmp_path)], check=True)
    (tmp_path / "acme.txt").write_text(ACME)
    shaken = FRAME.replace('displacements = "10 mm"', 'accelerogram = "acme.txt"')
    shaken = shaken.replace('method = "graph-follower"\ntolerance = "0.1 mm"\n', "")
    cell = CELL.replace('"series"', '"rough"').replace("tolerance = 1e-6\n", "")
    cases = {"rig": RIG, "shaken": shaken, "cell": cell}
    for name, text in cases.items():
        (tmp_path / f"{name}.toml").write_text(text)
    runs = [["run", f"{name}.toml", "--quiet", "--no-figures"] for name in cases]
    program = f"from alphacut import main; assert not any([main(words) for words in {runs}])"
    paths = os.pathsep.join([str(ROOT), str(tmp_path / "site")])
    environment = os.environ | {"PYTHONPATH": paths}
    subprocess.run([sys.executable, "-c", program], cwd=tmp_path, env=environment, check=True)
    assert '"method": "rough' in (tmp_path / "results/cell/summary.json").read_text()
    for name, key in (("rig", "rig"), ("cell", "modulus.method"), ("shaken", "acme.txt")):
        assert key in told_by("check", tmp_path / f"{name}.toml", status=2)


def test_structures_pass_their_check():
    check_structure(template("structure").RigModel(1e4, 4e6), duration=0.2, step=0.02)
    frame = StoreyFrame([1e4], stiffness=[2e6], damping_ratio=0.02, q0=(0.01,))
    check_structure(frame, duration=0.2, step=0.02)
    check_structure(pendulum(), duration=0.2, step=0.02)


def test_a_structure_that_mixes_sets_of_parameters_is_refused(monkeypatch):
    class Mixed:
        def __init__(self, *arguments):
            self.flow = make_flow(*arguments)

        def values(self, points):
            return self.flow.values(0.0 * points + points.mean(axis=0))

    monkeypatch.setattr(check, "make_flow", Mixed)
    with refuses("response of many sets of parameters"):
        check_structure(StoreyFrame([1e4], stiffness=[2e6], q0=(0.01,)), duration=0.2, step=0.02)


def test_cell_models_pass_their_check():
    radius_map = HermiteMap(0.3, 0.1, 0.6, 0.2)
    check_cell_model(template("cell_model").RoughModel, radius_map)
    check_cell_model(next(x for x in MODELS if x.name == "series").load(), radius_map)


def test_a_cell_model_that_solves_one_inclusion_alone_is_refused(monkeypatch):
    kind = template("cell_model").RoughModel
    solve = kind.solve
    monkeypatch.setattr(kind, "solve", lambda self, r, m, phases: solve(self, r, m, phases[:1]))
    with refuses("solve"):
        check_cell_model(kind, HermiteMap(0.3, 0.1, 0.6, 0.2))


def test_record_formats_pass_their_check():
    check_record_format(template("record_format").ACME, ACME)
    from tests.frame.records import samples

    check_record_format(FORMATS[-1], samples.at2("NPTS=   400, DT=   .0050 SEC,"))


def test_a_format_that_takes_files_of_another_is_refused():
    with refuses("mark"):
        check_record_format(template("record_format").ACME, ACME.replace("ACME", "OTHER"))


def test_a_format_that_takes_damaged_files_is_refused():
    module = template("record_format")
    lenient = module.ACME._replace(
        read=lambda file, unit: module.read_acme(
            module.TextFile.from_bytes("sample", ACME.encode()), unit
        )
    )
    with refuses("read"):
        check_record_format(lenient, ACME)
