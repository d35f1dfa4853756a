"""Structure of a case at modal values, and its parameters as fuzzy numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal, cast

from alphacut.case.case import Case
from alphacut.case.checks import beside
from alphacut.case.names import OTHERS
from alphacut.fuzzy import FuzzyNumber
from alphacut.io.problem import BadInput, Problem
from alphacut.stages.accelerogram import accelerogram

if TYPE_CHECKING:
    from alphacut.frame import StoreyFrame
    from alphacut.frame.dynamics.flow import Flow
    from alphacut.frame.reduced.reduction import ReducedStructure
    from alphacut.frame.structures.lagrangian import LagrangianSystem
    from alphacut.frame.structures.linear import LinearSystem

LISTS = {"m": "masses", "l": "lengths", "d": "dampers"}
RAYLEIGH = ("rayleigh_mass", "rayleigh_stiffness")
STARTS = {"q": "displacements", "v": "velocities"}
PENDULUM = {
    "m": "mass",
    "l": "length",
    "d": "damping",
    "g": "gravity",
    "phi_0": "angle",
    "omega_0": "angular_velocity",
}


@dataclass(frozen=True)
class Structure:
    """A storey frame, a tower of beams, or a pendulum.

    Args:
        model: The model at modal values.
        numbers: Every parameter, crisp or fuzzy, in SI.
    """

    model: StoreyFrame | ReducedStructure | LagrangianSystem
    numbers: Mapping[str, FuzzyNumber]

    @property
    def frame(self) -> StoreyFrame | None:
        """The model if it is a storey frame, else None."""
        from alphacut.frame import StoreyFrame

        return self.model if isinstance(self.model, StoreyFrame) else None

    @property
    def linear(self) -> LinearSystem | None:
        """The model if it is linear, else None."""
        from alphacut.frame.structures.lagrangian import LagrangianSystem

        return None if isinstance(self.model, LagrangianSystem) else self.model

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the observed quantities."""
        return self.model.outputs

    def with_modulus(self, number: FuzzyNumber | None) -> Structure:
        """The structure with another Young's modulus in Pa, if it is a storey frame."""
        if number is None or self.frame is None:
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
            raise BadInput(
                Problem(
                    "envelope.fuzzy",
                    " ".join(str(error.args[0]).split()),
                    name,
                    ", ".join(self.numbers),
                )
            ) from None
        if not found:
            raise BadInput(
                Problem(
                    "envelope.fuzzy",
                    "this input is crisp in the case",
                    name,
                    "an input with a triangle or an interval",
                )
            )
        return found

    def inputs(self, names: Sequence[str]) -> dict[str, FuzzyNumber]:
        """The fuzzy inputs that the names stand for."""
        return {member: self.numbers[member] for name in names for member in self.members(name)}

    def flow(
        self, names: Sequence[str], duration: float, step: float, integrator: str | None = None
    ) -> Flow:
        """Trajectories as a function of parameters, by the midpoint rule by default."""
        from alphacut.frame import INTEGRATORS, LinearFlow
        from alphacut.frame.dynamics.nonlinear import LagrangianFlow

        if self.linear is not None:
            return LinearFlow(
                self.linear, tuple(names), duration, step, INTEGRATORS[integrator or "midpoint"]
            )
        system = cast("LagrangianSystem", self.model)
        return LagrangianFlow(system, tuple(names), duration, step, integrator or "midpoint")


def structure(case: Case, handed: FuzzyNumber | None) -> Structure:
    """The structure of a case, with the modulus handed on from the stage before, if any.

    Raises:
        BadInput: Its values do not make a structure.
    """
    try:
        if case.has("pendulum.mass"):
            return pendulum(case)
        return (
            tower(case)
            if case.has("tower.storeys")
            else storey_frame(case, modulus_of(case, handed))
        )
    except ValueError as error:
        raise BadInput(Problem("frame", str(error), file=str(case.path))) from None


def pendulum(case: Case) -> Structure:
    """A damped pendulum."""
    from alphacut.frame.structures.lagrangian import pendulum as make

    numbers = {name: case.fuzzy(f"pendulum.{key}") for name, key in PENDULUM.items()}
    names = {
        "m": "mass",
        "l": "length",
        "d": "damping",
        "g": "gravity",
        "phi_0": "phi0",
        "omega_0": "omega0",
    }
    modal: dict[str, Any] = {names[name]: number.modal for name, number in numbers.items()}
    model = make(**modal)
    return Structure(replace(model, observed={"force": model.observed["force"]}), numbers)


def tower(case: Case) -> Structure:
    """Plane beam frame, reduced for the whole supports of its fuzzy inputs."""
    from alphacut.frame.reduced.beam import BeamFrame

    numbers = {name: case.fuzzy(f"tower.{name}") for name in OTHERS["tower"] if name != "zeta"}
    if case.has("tower.damping_ratio"):
        numbers["zeta"] = case.fuzzy("tower.damping_ratio")
    sizes: dict[str, Any] = {
        name: case.number(f"tower.{name}") for name in ("height", "width", "density")
    }
    column, beam = (
        (case.number(f"tower.{part}_area"), case.number(f"tower.{part}_moment"))
        for part in ("column", "beam")
    )
    ground = accelerogram(beside(case, case.text("tower.accelerogram")), "tower.accelerogram")
    ratio = numbers["zeta"].modal if "zeta" in numbers else None
    counts = (case.integer("tower.storeys"), case.integer("tower.bays"))
    frame = BeamFrame(
        *counts, column=column, beam=beam, ground=ground, damping_ratio=ratio, **sizes
    )
    full = replace(
        frame.structure(), parameters={name: number.modal for name, number in numbers.items()}
    )
    bounds = {
        name: (number.support.lower, number.support.upper)
        for name, number in numbers.items()
        if number.support.width > 0
    }
    return Structure(full.reduced(bounds), numbers)


def storey_frame(case: Case, modulus: FuzzyNumber) -> Structure:
    """A storey frame."""
    from alphacut.frame import StoreyFrame

    numbers = parameters(case, modulus)
    modal = {
        name: tuple(x.modal for x in per_floor(case, f"frame.{name}"))
        for name in (*LISTS.values(), *STARTS.values())
    }
    model = StoreyFrame(
        modal["masses"],
        modal["lengths"],
        modulus.modal,
        case.fuzzies("frame.second_moment")[0].modal,
        dampers=modal["dampers"],
        damper_placement=cast(
            Literal["ground", "storey"],
            case.text("frame.damper_placement") if case.has("frame.damper_placement") else "ground",
        ),
        q0=modal["displacements"],
        v0=modal["velocities"],
        outputs=case.names("frame.outputs"),
        rayleigh=(
            case.fuzzy("frame.rayleigh_mass").modal,
            case.fuzzy("frame.rayleigh_stiffness").modal,
        ),
        ground=(
            accelerogram(beside(case, case.text("frame.accelerogram")))
            if case.has("frame.accelerogram")
            else None
        ),
        damping_ratio=tuple(ratio.modal for ratio in ratios(case)),
        columns=tuple(number.modal for number in columns(case)),
    )
    return Structure(model, numbers)


def parameters(case: Case, modulus: FuzzyNumber) -> dict[str, FuzzyNumber]:
    """Every parameter of the frame by the name that `frame` gives it, in SI."""
    found = {"E": modulus, "I": case.fuzzies("frame.second_moment")[0]}
    found |= {name: case.fuzzy(f"frame.{name}") for name in RAYLEIGH}
    found |= {
        "zeta" if len(ratios(case)) == 1 else f"zeta{mode}": ratio
        for mode, ratio in enumerate(ratios(case), start=1)
    }
    for letter, key in LISTS.items():
        found |= {
            f"{letter}{floor}": value
            for floor, value in enumerate(per_floor(case, f"frame.{key}"), start=1)
        }
    found |= {f"c{floor}": value for floor, value in enumerate(columns(case), start=1)}
    for letter, key in STARTS.items():
        found |= {
            f"{letter}{floor}_0": value
            for floor, value in enumerate(per_floor(case, f"frame.{key}"), start=1)
        }
    return found


def columns(case: Case) -> tuple[FuzzyNumber, ...]:
    """Columns of each storey; differing second moments become numbers of columns."""
    moments = [moment.modal for moment in per_floor(case, "frame.second_moment")]
    return tuple(
        c if moment == moments[0] else c * (moment / moments[0])
        for c, moment in zip(per_floor(case, "frame.columns"), moments, strict=True)
    )


def ratios(case: Case) -> tuple[FuzzyNumber, ...]:
    """Damping ratios: none, one for all modes, or one for each."""
    return case.fuzzies("frame.damping_ratio") if case.has("frame.damping_ratio") else ()


def per_floor(case: Case, key: str) -> tuple[FuzzyNumber, ...]:
    """One value for each floor; a single one holds for all of them."""
    values, floors = case.fuzzies(key), len(case.fuzzies("frame.masses"))
    return values * floors if len(values) == 1 else values


def modulus_of(case: Case, given: FuzzyNumber | None) -> FuzzyNumber:
    """The modulus handed on, else the frame's own.

    Raises:
        BadInput: There is none.
    """
    if given is not None:
        return given
    if not case.has("frame.modulus"):
        raise BadInput(
            Problem(
                "frame.modulus",
                "missing: give it here, or by --modulus FILE.nc from `fuzzy modulus CASE --out"
                " FILE.nc`; `alphacut run CASE` does both",
                file=str(case.path),
            )
        )
    return case.fuzzy("frame.modulus")
