"""Structure of a case at modal values, and its parameters as fuzzy numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from alphacut.case.case import Case
from alphacut.case.sections.structures import Frame, Pendulum
from alphacut.frame import INTEGRATORS, LinearFlow, StoreyFrame
from alphacut.frame.dynamics.flow import Flow
from alphacut.frame.dynamics.nonlinear import LagrangianFlow
from alphacut.frame.structures.lagrangian import LagrangianSystem
from alphacut.frame.structures.lagrangian import pendulum as make
from alphacut.frame.structures.linear import LinearSystem
from alphacut.fuzzy import Crisp, FuzzyNumber
from alphacut.io.problem import BadInput
from alphacut.io.provenance import door
from alphacut.io.units import STANDARD_GRAVITY
from alphacut.stages.vibration.accelerogram import accelerogram


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
    def linear(self) -> LinearSystem | None:
        """The model if it is linear, else None."""
        return None if isinstance(self.model, LagrangianSystem) else self.model

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the observed quantities."""
        return self.model.outputs

    def with_modulus(self, number: FuzzyNumber | None) -> Structure:
        """The structure with another Young's modulus in Pa, if it is a storey frame."""
        if number is None or self.frame is None or self.frame.stiffness:
            return self
        return Structure(replace(self.frame, modulus=number.modal), {**self.numbers, "E": number})

    def members(self, name: str) -> tuple[str, ...]:
        """Fuzzy parameters of a name: ``m`` all masses of a frame, others themselves.

        Raises:
            BadInput: It stands for nothing, or for nothing fuzzy.
        """
        try:
            members = self.frame.group(name) if self.frame else (name,)
            found = tuple(member for member in members if self.numbers[member].support.width > 0)
        except (ValueError, KeyError) as error:
            raise BadInput.of(
                "envelope.fuzzy",
                "the structure has no such input"
                if isinstance(error, KeyError)
                else " ".join(str(error).split()),
                name,
                ", ".join(self.numbers),
            ) from None
        if not found:
            spread = any(not isinstance(self.numbers[member], Crisp) for member in members)
            why = "its values are all equal" if spread else "it is one number"
            cure = "an interval or a triangle whose values differ, or a list without this input"
            raise BadInput.of(
                "envelope.fuzzy", f"this input is crisp in the case: {why}", name, cure
            )
        return found

    def inputs(self, names: Sequence[str]) -> dict[str, FuzzyNumber]:
        """The fuzzy inputs that the names stand for."""
        return {member: self.numbers[member] for name in names for member in self.members(name)}

    def flow(
        self, names: Sequence[str], duration: float, step: float, integrator: str | None = None
    ) -> Flow:
        """Trajectories as a function of parameters, by the midpoint rule by default."""
        scheme, model = integrator or "midpoint", self.model
        if isinstance(model, LagrangianSystem):
            return LagrangianFlow(model, tuple(names), duration, step, scheme)
        return LinearFlow(model, tuple(names), duration, step, INTEGRATORS[scheme])


def structure(case: Case, handed: FuzzyNumber | None) -> Structure:
    """The structure of a case, with the modulus handed on from the stage before, if any.

    Raises:
        BadInput: Its values do not make a structure.
    """
    try:
        if case.sections.pendulum:
            return pendulum(case.pendulum)
        return storey_frame(case, modulus_of(case, handed))
    except ValueError as error:
        raise BadInput.of("frame", str(error), file=str(case.path)) from None


def pendulum(given: Pendulum) -> Structure:
    """A damped pendulum."""
    model = make(
        mass=given.mass.modal,
        length=given.length.modal,
        damping=given.damping.modal,
        gravity=given.gravity.modal,
        phi0=given.angle.modal,
        omega0=given.angular_velocity.modal,
    )
    numbers = {
        "m": given.mass,
        "l": given.length,
        "d": given.damping,
        "g": given.gravity,
        "phi_0": given.angle,
        "omega_0": given.angular_velocity,
    }
    return Structure(replace(model, observed={"force": model.observed["force"]}), numbers)


def storey_frame(case: Case, modulus: FuzzyNumber | None) -> Structure:
    """A storey frame."""
    given = case.frame

    def modal(values: tuple[FuzzyNumber, ...] | None) -> tuple[float, ...]:
        return tuple(x.modal for x in per_floor(given, values or ()))

    moments = tuple(x.modal for x in given.second_moment or ())
    model = StoreyFrame(
        modal(given.masses),
        modal(given.lengths),
        None if modulus is None else modulus.modal,
        moments[0] if len(moments) == 1 else moments or None,
        dampers=modal(given.dampers),
        damper_placement=given.damper_placement or "ground",
        q0=modal(given.displacements),
        v0=modal(given.velocities),
        outputs=given.outputs,
        rayleigh=(given.rayleigh_mass.modal, given.rayleigh_stiffness.modal),
        ground=(
            None if given.accelerogram is None else accelerogram(case.beside(given.accelerogram))
        ),
        damping_ratio=tuple(ratio.modal for ratio in given.damping_ratio or ()),
        columns=() if given.stiffness else modal(given.columns),
        stiffness=modal(given.stiffness),
        gravity=float(STANDARD_GRAVITY) if given.p_delta else 0.0,
    )
    every = parameters(given, modulus)
    numbers = {name: every[name] for name in model.parameters}
    computed = {"modulus", "image"} & set(case.stages)  # no E is known yet, or its support only
    ends = {x: (n.support.lower, n.support.upper) for x, n in numbers.items()}
    model.require_standing({x: both for x, both in ends.items() if x != "E" or not computed})
    return Structure(model, numbers)


def parameters(given: Frame, modulus: FuzzyNumber | None) -> dict[str, FuzzyNumber]:
    """Every value of the frame by the name that `frame` gives it as a parameter, in SI."""
    found = {"rayleigh_mass": given.rayleigh_mass, "rayleigh_stiffness": given.rayleigh_stiffness}
    moments = given.second_moment or ()
    found |= {} if modulus is None else {"E": modulus}
    found |= {"I": moments[0]} if len(moments) == 1 else {}
    ratios = given.damping_ratio or ()
    found |= {
        "zeta" if len(ratios) == 1 else f"zeta{mode}": ratio
        for mode, ratio in enumerate(ratios, start=1)
    }
    for name, values in (
        ("I{}", moments),
        ("k{}", given.stiffness or ()),
        ("m{}", given.masses),
        ("l{}", given.lengths or ()),
        ("d{}", given.dampers),
        ("c{}", given.columns),
        ("q{}_0", given.displacements),
        ("v{}_0", given.velocities),
    ):
        every = enumerate(per_floor(given, values), start=1)
        found |= {name.format(floor): value for floor, value in every}
    return found


def per_floor(given: Frame, values: tuple[FuzzyNumber, ...]) -> tuple[FuzzyNumber, ...]:
    """One value for each floor; a single one holds for all of them."""
    return values * len(given.masses) if len(values) == 1 else values


def modulus_of(case: Case, given: FuzzyNumber | None) -> FuzzyNumber | None:
    """The modulus handed on, else the frame's own; None beside stiffnesses.

    Raises:
        BadInput: There is none, or a frame of given stiffnesses is handed one.
    """
    if case.frame.stiffness is not None:
        if given is not None:
            what = "the frame makes no use of the modulus that is handed on: its stiffness is given"
            raise case.refuse("frame.stiffness", what, "one of stiffness and a modulus")
        return None
    if given is not None:
        return given
    if case.frame.modulus is None:
        raise BadInput.of(
            "frame.modulus",
            "missing: give it here, or by --modulus modulus.nc from"
            f" `{door('modulus', case.path)} --out modulus.nc`; `{door('run', case.path)}` does"
            " both",
            file=str(case.path),
        )
    return case.frame.modulus
