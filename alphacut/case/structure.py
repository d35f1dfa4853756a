"""A structure at modal values, and its parameters as fuzzy numbers."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from alphacut.frame import StoreyFrame
from alphacut.frame.dynamics.flow import Flow
from alphacut.frame.dynamics.nonlinear import flow_of
from alphacut.frame.structures.lagrangian import LagrangianSystem
from alphacut.fuzzy import FuzzyNumber
from alphacut.fuzzy.refused import RefusedError
from alphacut.io.problem import suggestion

INPUTS = {"modulus": "E", "second_moment": "I", "masses": "m", "lengths": "l", "columns": "c"}
INPUTS |= {"stiffness": "k", "dampers": "d", "displacements": "q0", "velocities": "v0"}
INPUTS |= {"damping_ratio": "zeta"}
"""Input that each key of a frame is, as `fuzzy` names it."""


@dataclass(frozen=True)
class Structure:
    """A storey frame or a pendulum.

    Args:
        model: The model at modal values.
        numbers: Every parameter, crisp or fuzzy, in SI.
    """

    model: StoreyFrame | LagrangianSystem
    numbers: Mapping[str, FuzzyNumber]

    @property
    def frame(self) -> StoreyFrame | None:
        """The model if it is a storey frame, else None."""
        return self.model if isinstance(self.model, StoreyFrame) else None

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the observed quantities."""
        return self.model.outputs

    def members(self, name: str, key: str = "envelope.fuzzy") -> tuple[str, ...]:
        """Fuzzy parameters of a name: ``m`` all masses of a frame, others themselves.

        Raises:
            RefusedError: The name stands for nothing, or for nothing fuzzy.
        """
        try:
            members = self.frame.group(name) if self.frame else (name,)
            fuzzy = tuple(member for member in members if self.numbers[member].support.width > 0)
        except (ValueError, KeyError):
            allowed = ", ".join(self.numbers)
            cure = suggestion(INPUTS.get(name, name), self.numbers)
            raise RefusedError(key, name, allowed, cure) from None
        if not fuzzy:
            keys = [of for of, short in INPUTS.items() if re.fullmatch(rf"{short}\d*", name)]
            cure = f"{keys[0] if keys and self.frame else name} is one number"
            raise RefusedError(key, name, "inputs that are fuzzy", cure)
        return fuzzy

    def inputs(self, names: Sequence[str], key: str = "envelope.fuzzy") -> dict[str, FuzzyNumber]:
        """The fuzzy inputs that the names stand for."""
        return {
            member: self.numbers[member] for name in names for member in self.members(name, key)
        }

    def require_outputs(self, key: str, names: Iterable[str]) -> None:
        """Refuses outputs that are not observed.

        Raises:
            RefusedError: One is not.
        """
        for name in names:
            if name not in self.outputs:
                cure = suggestion(name, self.outputs)
                raise RefusedError(key, name, ", ".join(self.outputs), cure)

    def observing(self, key: str, outputs: tuple[str, ...]) -> StoreyFrame | LagrangianSystem:
        """The model; of a storey frame with these outputs alone.

        Raises:
            RefusedError: It has no such output.
        """
        if self.frame is None:
            self.require_outputs(key, outputs)
            return self.model
        try:
            return replace(self.frame, outputs=outputs)
        except RefusedError as error:
            raise RefusedError(key, error.value, error.allowed) from None

    def flow(
        self, names: Sequence[str], duration: float, step: float, integrator: str | None = None
    ) -> Flow:
        """Trajectories as a function of parameters, by the midpoint rule by default."""
        return flow_of(self.model, names, duration, step, integrator or "midpoint")
