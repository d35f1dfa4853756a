"""A new kind of structure takes its own file, with its section, and one entry in a table."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
import pytest

from alphacut import main
from alphacut.case.structure import Mass, Stiffness, Structure, StructureSection
from alphacut.case.structures import STRUCTURES
from alphacut.frame import Accelerogram, Output
from alphacut.frame.structures.linear import Assembly, LinearSystem
from tests.alphacut.small import summary_of_run, written

CASE = """
title = "A mass on a table that shakes"
stages = ["envelope"]
[rig]
mass = "[9, 10, 11] t"
spring = "[3.6, 4, 4.4] MN/m"
[envelope]
fuzzy = ["mass", "spring"]
alpha = [0, 1]
duration = "0.4 s"
step = "0.02 s"
[decision]
limits = ["q1 <= 9 mm"]
"""
FRAME = """
[frame]
masses = "[9, 10, 11] t"
stiffness = "[3.6, 4, 4.4] MN/m"
dampers = "0 N s/m"
damper_placement = "ground"
displacements = "10 mm"
"""


@dataclass(frozen=True)
class RigModel(LinearSystem):
    """A mass on a spring, released from 10 mm."""

    mass: float
    spring: float
    ground: Accelerogram | None = None
    outputs: tuple[str, ...] = (Output("q1"),)

    @property
    def parameters(self):
        return {"mass": self.mass, "spring": self.spring}

    def assembly(self, p):
        zero = p["mass"] * 0.0
        matrix = zero[..., None, None]
        return Assembly(
            mass=matrix + p["mass"][..., None, None],
            springs=matrix + p["spring"][..., None, None],
            weights=None,
            dashpots=matrix,
            rayleigh=(zero, zero),
            ratios=[],
            q0=zero[..., None] + 0.01,
            v0=zero[..., None],
            row_factors=zero[..., None] + 1.0,
            rows=np.array([[1.0, 0.0]]),
            accelerated=np.zeros((1, 1)),
            pattern=np.ones(1),
            massive=np.arange(1),
            loads=(),
            columns=None,
        )


class Rig(StructureSection):
    """A mass on a spring."""

    mass: Annotated[Mass, "mass of the rig"]
    spring: Annotated[Stiffness, "its spring"]

    def structure(self, modulus=None, loss=None):
        numbers = {"mass": self.mass, "spring": self.spring}
        return Structure(RigModel(self.mass.nominal, self.spring.nominal), numbers)


def test_a_new_structure_takes_its_section_and_one_entry(tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(STRUCTURES, "rig", f"{__name__}:Rig")
    case = written(tmp_path, CASE)
    rig = summary_of_run(case)
    assert main(["check", str(case)]) == 0
    assert "first natural period: 0.3142 s" in capsys.readouterr().out
    assert main(["report", str(tmp_path / "out")]) == 0
    frame_case = CASE[: CASE.index("[rig]")] + FRAME + CASE[CASE.index("[envelope]") :]
    folder = tmp_path / "frame"
    folder.mkdir()
    frame = summary_of_run(written(folder, frame_case.replace('"mass", "spring"', '"m", "k"')))
    of_rig, of_frame = (x["envelopes"]["all"] for x in (rig, frame))
    assert of_rig["nature"] == of_frame["nature"] == "guaranteed"
    assert of_rig["max"]["q1"] == pytest.approx(of_frame["max"]["q1"], rel=1e-2)
    assert rig["decision"].keys() == frame["decision"].keys()
    monkeypatch.delitem(STRUCTURES, "rig")
    assert main(["check", str(case)]) == 2
