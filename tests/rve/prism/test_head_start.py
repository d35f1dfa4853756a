"""A second process that begins a cell changes no bit of its result, and may fail."""

import json
import os
import subprocess
import sys
from dataclasses import fields, replace

import numpy as np
import pytest

pytest.importorskip("dolfinx")

from alphacut.entry import main
from alphacut.rve import Phase
from alphacut.rve.mesh.triangulation import reference_radius, triangulate
from alphacut.rve.prism import head_start
from alphacut.rve.prism.head_start import HeadStart
from alphacut.rve.prism.model import PrismModel
from alphacut.stochastic import HermiteMap, TruncatedNormal

MAP = HermiteMap(0.4, 0.1, 0.5, 0.2, TruncatedNormal())
CASE = "cases/paper.toml"


def same(one, other):
    """Whether two meshes are alike to the last bit."""
    return all(
        np.array_equal(getattr(one, part.name), getattr(other, part.name)) for part in fields(one)
    )


def test_mesh_and_errors_come_as_they_are_made_and_once():
    mesh = triangulate(size=0.5, radius=0.4)
    ahead = HeadStart(lambda: triangulate(size=0.5, radius=0.4), lambda: [np.array([1.0, 2.0])])
    assert same(ahead.mesh(), mesh)
    assert np.array_equal(ahead.errors(), [[1.0, 2.0]])
    assert ahead.errors() is None
    ahead.stop()
    with pytest.raises(ChildProcessError):
        os.waitpid(ahead._process, 0)


def test_a_second_process_that_fails_leaves_the_work_to_the_first():
    ahead = HeadStart(lambda: 1 / 0, list)
    assert ahead.mesh() is None
    assert ahead.errors() is None
    ahead.stop()
    model = PrismModel(0.5, 2, estimate=True)
    phases = Phase(20e9), [Phase(80e9)]
    alone = model.solve(MAP, *phases)[0]
    ahead = HeadStart(lambda: os.kill(os.getpid(), 9), list)
    together = replace(model, ahead=ahead).solve(MAP, *phases)[0]
    ahead.stop()
    assert (together.modulus, together.error) == (alone.modulus, alone.error)


def test_what_it_gives_is_taken():
    model = PrismModel(0.5, 2, estimate=True)
    phases = Phase(20e9), [Phase(80e9)]
    layers = [0.1 * error for error in model.errors_of_layers(MAP, *phases)]
    mesh = triangulate(size=0.4, radius=reference_radius(MAP))
    ahead = HeadStart(lambda: mesh, lambda: layers)
    result = replace(model, ahead=ahead).solve(MAP, *phases)[0]
    ahead.stop()
    finer = PrismModel(0.4, 2, estimate=True).solve(MAP, *phases)[0]
    assert (result.modulus, result.unknowns) == (finer.modulus, finer.unknowns)
    assert 0 < result.error["theta"] < 0.2 * finer.error["theta"]


@pytest.mark.parametrize("name", head_start._LAUNCHED)
def test_none_is_begun_under_mpirun(name, monkeypatch):
    monkeypatch.setattr(head_start.sys, "modules", {})
    monkeypatch.setattr(head_start.os, "sched_getaffinity", lambda _: {0, 1})
    monkeypatch.setattr(head_start.os, "listdir", lambda _: ["1"])
    assert head_start.possible()
    monkeypatch.setenv(name, "1")
    assert not head_start.possible()


def test_the_program_gives_the_same_with_and_without(capfd):
    words = ["solve", CASE, "--mesh-size", "0.5", "--layers", "2", "--json", "-"]
    assert main(words, program="test", names={"solve": "cell"}) == 0  # DOLFINx is loaded: none
    here = json.loads(capfd.readouterr().out)
    run = subprocess.run(
        [sys.executable, "-m", "rve", *words], capture_output=True, text=True, check=True
    )
    there = json.loads(run.stdout)
    assert here.pop("seconds") != there.pop("seconds")
    assert here == there
