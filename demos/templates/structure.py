"""A kind of structure to copy: a mass on a spring, as the section [rig] of a case.

Register it as ``rig = "MODULE:Rig"``: in `STRUCTURES` of `alphacut/case/structures.py`, or as an
entry point of your own distribution in the group "alphacut.structures".
`alphacut.frame.verification.check_structure` has the check that it must pass.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from alphacut.case.structure import Mass, Stiffness, Structure, StructureSection
from alphacut.frame import Accelerogram, Output
from alphacut.frame.structures.linear import Assembly, LinearSystem, Number
from alphacut.fuzzy import FuzzyNumber


@dataclass(frozen=True)
class RigModel(LinearSystem):
    """A mass on a spring, released from 10 mm.

    Args:
        mass: Mass in kg.
        spring: Stiffness in N/m.
        ground: Acceleration of the ground, if it moves.
        outputs: Names of the observed quantities.
    """

    mass: float
    spring: float
    ground: Accelerogram | None = None
    outputs: tuple[str, ...] = (Output("q1"),)

    @property
    def parameters(self) -> Mapping[str, float]:
        """The nominal values by name, in SI units."""
        return {"mass": self.mass, "spring": self.spring}

    def assembly(self, p: Mapping[str, Number]) -> Assembly[Number]:
        """Return the matrices at many sets of parameters, arrays of one shape by name."""
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
    """A mass on a spring.

    Args:
        mass: mass of the rig.
        spring: its spring.
    """

    mass: Mass
    spring: Stiffness

    def structure(
        self, modulus: FuzzyNumber | None = None, loss: FuzzyNumber | None = None
    ) -> Structure:
        """Return the structure at nominal values, with its fuzzy parameters."""
        numbers = {"mass": self.mass, "spring": self.spring}
        return Structure(RigModel(self.mass.nominal, self.spring.nominal), numbers)
