"""A structure at nominal values with its fuzzy parameters, and the sections that give one."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from typing import Annotated, Any, Literal, cast

from pydantic import PlainValidator, ValidationInfo

from alphacut.base.errors import RefusedError, by_keys, require
from alphacut.base.number_text import STANDARD_GRAVITY
from alphacut.case.types import Modulus, NotEmpty, OneOrMany, Quantity, Section, case_file, text
from alphacut.frame import (
    Accelerogram,
    BilinearIsolator,
    Identified,
    StoreyFrame,
    damping_from_loss,
    pendulum,
    read_record,
)
from alphacut.frame.structures.linear import LinearSystem, has_matrices
from alphacut.frame.structures.model import StructureModel
from alphacut.frame.structures.quantities import OF_STOREY_FRAME
from alphacut.frame.structures.storey import SYMBOLS
from alphacut.fuzzy import Crisp, FuzzyNumber
from alphacut.io.files import suggestion


def _of_frame(symbol: str) -> Quantity:
    """Return the type of a key that holds a parameter of a storey frame, which may be fuzzy."""
    return Quantity(**(asdict(OF_STOREY_FRAME[symbol]) | {"fuzzy": True}))


Mass = Annotated[FuzzyNumber, _of_frame("m")]
Span = Annotated[FuzzyNumber, _of_frame("l")]
Moment = Annotated[FuzzyNumber, _of_frame("I")]
Count = Annotated[FuzzyNumber, _of_frame("c")]
Stiffness = Annotated[FuzzyNumber, _of_frame("k")]
YieldForce = Annotated[FuzzyNumber, _of_frame("fy")]
YieldDrift = Annotated[FuzzyNumber, _of_frame("dy")]
Hardening = Annotated[FuzzyNumber, _of_frame("hardening")]
Damping = Annotated[FuzzyNumber, _of_frame("d")]
Displacement = Annotated[FuzzyNumber, _of_frame("q")]
Velocity = Annotated[FuzzyNumber, _of_frame("v")]
Rate = Annotated[FuzzyNumber, _of_frame("rayleigh_mass")]
Delay = Annotated[FuzzyNumber, _of_frame("rayleigh_stiffness")]
Acceleration = Annotated[FuzzyNumber, Quantity("m/s^2", above=0, fuzzy=True)]
Turning = Annotated[FuzzyNumber, Quantity("N*m*s", minimum=0, fuzzy=True)]
Angle = Annotated[FuzzyNumber, Quantity("rad", fuzzy=True)]
Spin = Annotated[FuzzyNumber, Quantity("rad/s", fuzzy=True)]

ZERO = Crisp(0.0)
NAMES = {"q0": "displacements", "v0": "velocities", "output": "outputs"}
"""Keys by the names of the frame's own arguments, where they differ."""
STAND_IN = Crisp(2e10)
"""Young's modulus in Pa of a frame whose own is yet to be computed."""
LOSS_STAND_IN = Crisp(0.02)
"""Loss factor of a material whose own is yet to be computed."""


@dataclass(frozen=True)
class MaterialDamping:
    """Damping ratio by the loss factor of the cell's material, and of the joints, to be added."""

    joints: FuzzyNumber = ZERO


def _parse_damping_ratios(value: object) -> MaterialDamping | tuple[FuzzyNumber, ...]:
    """Return the damping ratios, as fractions of critical damping, that a value of a case states.

    Args:
        value: One ratio of all modes is a number, a text such as "2 %", or a list of numbers alone,
            which makes it fuzzy. A list with texts has a ratio for each mode, from the slowest on.
            "material" takes the ratios from the loss factor of the material, and "material + 1 %"
            adds the ratio of the joints.

    Returns:
        MaterialDamping for "material"; else one fuzzy ratio, or one for each mode.

    Raises:
        RefusedError: A ratio is no number from 0 to below 1.
    """
    if isinstance(value, str):
        word, plus, joints = value.partition("+")
        if word.strip() == "material":
            if plus:
                return MaterialDamping(_ratio(joints.strip()))
            return MaterialDamping()
    # A list of numbers alone is one fuzzy ratio, such as the triangle [0.01, 0.02, 0.03].
    if isinstance(value, list) and any(isinstance(entry, str) for entry in value):
        return tuple(_ratio(entry) for entry in value)
    return (_ratio(value),)


def _ratio(value: object) -> FuzzyNumber:
    """Return a fuzzy damping ratio; refuse one from 1 on, at which nothing oscillates."""
    return cast("FuzzyNumber", _of_frame("zeta").parse(value))


DampingRatios = Annotated[
    MaterialDamping | tuple[FuzzyNumber, ...], PlainValidator(_parse_damping_ratios)
]


@dataclass(frozen=True)
class Structure:
    """A structure of a case: the model at its nominal values, and its fuzzy parameters.

    Args:
        model: The structure at its nominal parameters.
        numbers: Every parameter by name, crisp or fuzzy, in SI units.
        heights: Heights of storeys in m by the names of their drifts and residual drifts.
        input_units: SI units of parameters by name where the case states them: of amplitudes of
            forces, empty of factors, and of factors of matrices.
        learned: Set of parameters that measured modes left; None if none were learned.
        always_fuzzy: Parameters that are fuzzy whether the case lists them or not.
    """

    model: StructureModel
    numbers: Mapping[str, FuzzyNumber]
    heights: Mapping[str, FuzzyNumber] = field(default_factory=dict)
    input_units: Mapping[str, str] = field(default_factory=dict)
    learned: Identified | None = None
    always_fuzzy: tuple[str, ...] = ()

    @property
    def floor_masses(self) -> tuple[FuzzyNumber, ...]:
        """Masses of a frame's floors in kg; none of other structures."""
        if not self.model.floors:
            return ()
        return tuple(self.numbers[name] for name in self.model.group("m"))

    @property
    def linear(self) -> LinearSystem | None:
        """The model if it is linear, at least until columns yield; else None."""
        if has_matrices(self.model):
            return self.model
        return None

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the observed quantities."""
        return self.model.outputs

    def unit(self, output: str) -> str:
        """Return the SI unit of an output."""
        return self.model.unit_of(output)

    def input_unit(self, name: str) -> str:
        """Return the SI unit of a parameter; empty where it has none, or none is known."""
        return self.input_units.get(name, self.model.parameter(name).unit)

    def fuzzy_members(self, name: str, key: str = "envelope.fuzzy") -> tuple[str, ...]:
        """Return the fuzzy parameters that a name stands for, as "m" for m1 … mn of a frame.

        Args:
            name: Name in the case.
            key: Key that has it, for the message.

        Raises:
            RefusedError: There is no such parameter, or it is crisp.
        """
        try:
            members = self.model.group(name)
            fuzzy = tuple(member for member in members if self.numbers[member].support.width > 0)
        except (ValueError, KeyError):
            # The model does not know the name, or knows a group of which the case has no numbers.
            # Who writes the key of a list, as stiffness, means its numbers.
            cure = suggestion(name, self.numbers)
            listed = SYMBOLS.get(name, "").format("").replace("_", "")
            if listed and listed + "1" in self.numbers:
                cure = f"did you mean {listed}?"
            raise RefusedError(key, name, ", ".join(self.numbers), cure) from None
        require(bool(fuzzy), key, name, "inputs that are fuzzy", cure=f"{name} is one number")
        return fuzzy

    def with_always_fuzzy(self, names: Sequence[str]) -> tuple[str, ...]:
        """Return names of fuzzy inputs of a case, and those that always are fuzzy, each once."""
        return tuple(dict.fromkeys((*names, *self.always_fuzzy)))

    def inputs(self, names: Sequence[str], key: str = "envelope.fuzzy") -> dict[str, FuzzyNumber]:
        """Return the fuzzy parameters that names stand for, in SI units.

        Args:
            names: Names of the case; "m" stands for m1 … mn of a frame.
            key: Key that has them, for messages. Keys "….fuzzy" have those, too, that always are.

        Raises:
            RefusedError: A name is no parameter, or none of those that it stands for is fuzzy.
        """
        if key.endswith(".fuzzy"):
            names = self.with_always_fuzzy(names)
        members = [member for name in names for member in self.fuzzy_members(name, key)]
        return {member: self.numbers[member] for member in members}

    def require_quantities(self, key: str, names: Sequence[str]) -> None:
        """Refuse outputs that the model cannot have; it need not observe those that it can.

        Args:
            key: Key of the case that names the outputs, for messages.
            names: The outputs. If there are none, nothing is refused.

        Raises:
            RefusedError: With the first output that the model cannot have.
        """
        for name in names:
            # The model speaks of its own argument; the user wrote a key of the case.
            with by_keys(lambda _: key):
                self.model.require_quantity(name)


def read_accelerogram(value: object, info: ValidationInfo) -> Accelerogram:
    """Return the ground acceleration record of a file that the case names.

    Each unusual property of the record is reported by a Python warning, each time it is read.

    Args:
        value: Name of the file, relative to the folder of the case.
        info: Context of the validation, with this folder.

    Raises:
        RefusedError: The file is missing, or no record can be read from it.
    """
    path = case_file(value, info)
    ground = read_record(path)
    # What is unusual need not be wrong: the record is taken as it is.
    for remark in ground.remarks:
        warnings.warn(f"of {path.name} {remark}", stacklevel=2)
    return ground


Ground = Annotated[Accelerogram, text(read_accelerogram)]


def damping_ratios_by_name(
    ratios: MaterialDamping | tuple[FuzzyNumber, ...], loss: FuzzyNumber | None
) -> dict[str, FuzzyNumber]:
    """Return damping ratios by the names of parameters: "zeta", or "zeta1", "zeta2" … of each mode.

    Args:
        ratios: One ratio of all modes; one for each mode from the slowest on; none; or damping by
            the material, which has the ratio of the joints to be added.
        loss: Loss factor η of the material; None for a stand-in of 2 %. It is used for damping by
            the material only, whose ratio is sin(½ arctan η) for all modes.
    """
    if isinstance(ratios, MaterialDamping):
        ratios = (damping_from_loss(loss or LOSS_STAND_IN, joints=ratios.joints),)
    # A single ratio holds for all modes, while "zeta1" would be the ratio of the first mode alone.
    if len(ratios) == 1:
        return {"zeta": ratios[0]}
    return {f"zeta{mode}": ratio for mode, ratio in enumerate(ratios, start=1)}


class StructureSection(Section):
    """A section of the case that gives its structure."""

    def structure(
        self, modulus: FuzzyNumber | None = None, loss: FuzzyNumber | None = None
    ) -> Structure:
        """Return the structure with its fuzzy parameters.

        Args:
            modulus: Young's modulus in Pa; the section's own, or a stand-in, if not given.
            loss: Loss factor of the material; a stand-in if not given. A structure that takes
                neither of them ignores both.

        Raises:
            RefusedError: The values of the section make no structure.
        """
        raise NotImplementedError  # each kind of structure has its own

    @cached_property
    def nominal(self) -> Structure:
        """The structure with stand-ins for what is yet to be computed; built once."""
        return self.structure()

    @property
    def needs_modulus(self) -> bool:
        """Whether the structure needs a modulus that a stage computes."""
        return False

    @property
    def moves_by_itself(self) -> bool:
        """Whether the structure starts displaced or moving, so that it needs no loads."""
        # A system that is not linear is a pendulum, whose weight moves it.
        linear = self.nominal.linear
        return linear is None or not linear.is_at_rest

    @property
    def places(self) -> tuple[str, ...]:
        """Names of the degrees of freedom that forces act on: floors, or unknowns of matrices."""
        return tuple(str(floor + 1) for floor in range(self.nominal.model.floors))

    @property
    def direction_count(self) -> int:
        """Number of directions in which the ground moves, one for each component of a record."""
        return 1

    def require_pattern(self) -> None:
        """Refuse a structure that records of the ground do not move."""

    def warnings(self, structure: Structure | None) -> Iterator[str]:
        """Yield a sentence for each number that is doubtful, and each effect that is left out.

        Args:
            structure: The structure of the section, if all its values are known.
        """
        yield from ()

    def file_warnings(self) -> Iterator[str]:
        """Yield a sentence for each doubt about the files of the section; a run tells them too."""
        yield from ()


class Isolator(Section):
    """Bilinear isolators below the first floor; the storeys above stay elastic.

    Property modification factors λ (ASCE 7, chapter 17) make stiffness (k1) and strength fuzzy.

    Args:
        period: period of the whole mass on the stiffness after yielding.
        strength: characteristic strength: force at zero displacement while yielding.
        strength_ratio: that over the weight, in place of strength.
        hardening: stiffness after yielding over the initial one.
        lambda_min: smallest factor of stiffness and strength.
        lambda_max: largest factor of stiffness and strength.
        linked: whether one factor holds for both, so that k1 alone is fuzzy; else fy1 is, too.
    """

    period: Annotated[float, Quantity("s", above=0)]
    strength: Annotated[float, Quantity("N", above=0)] | None = None
    strength_ratio: Annotated[float, Quantity(above=0, below=1)] | None = None
    hardening: Annotated[float, Quantity(above=0, below=1)] = 0.1
    lambda_min: Annotated[float, Quantity(above=0, maximum=1)] = 1.0
    lambda_max: Annotated[float, Quantity(minimum=1)] = 1.0
    linked: bool = False

    def storeys(self, masses: Sequence[FuzzyNumber]) -> dict[str, tuple[FuzzyNumber, ...]]:
        """Return stiffness of the isolated storey, and yield points and hardening of all storeys.

        Raises:
            RefusedError: Not one of both kinds of strength is given.
        """
        is_one = (self.strength is None) != (self.strength_ratio is None)
        require(is_one, "frame.isolator.strength", None, "either strength or strength_ratio")
        mass = sum(x.nominal for x in masses)
        strength = self.strength or (self.strength_ratio or 0.0) * mass * STANDARD_GRAVITY
        found = BilinearIsolator.of(
            mass, period=self.period, strength=strength, hardening=self.hardening
        )
        factors = (self.lambda_min, self.lambda_max)
        return found.storeys(len(masses) - 1, factors, linked=self.linked)


class Frame(StructureSection):
    """Storey frame: rigid floors on elastic columns, numbered from the ground.

    A key with one value for each floor may hold one value for all of them.

    Args:
        masses: mass of each floor.
        lengths: height of each storey.
        modulus: Young's modulus where no stage computes it.
        second_moment: second moment of area of one column of each storey.
        columns: clamped columns in each storey.
        stiffness: stiffness of each storey, in place of columns and modulus.
        yield_force: force of each storey at which its columns yield.
        yield_drift: drift at which they yield, in place of yield_force.
        hardening: stiffness of each storey after yielding over the initial one, 0 unless given.
        gravity: acceleration of gravity, "1 g", of weights that press on displaced storeys
            (P-Delta): they reduce the stiffness of a storey by the weight above over its height;
            left out unless given.
        damping_ratio: damping over the critical one, of all modes, or texts, one a mode from the
            slowest on: ["2 %", "[2, 3, 4] %", "5 %"]; "material" takes that of the loss factors of
            the cell, "material + 1 %" adds that of joints.
        dampers: viscous damper of each floor.
        damper_placement: dampers to the ground, or between storeys.
        displacements: displacement of each floor at the start.
        velocities: velocity of each floor at the start.
        rayleigh_mass: factor a of a damping a M + b K.
        rayleigh_stiffness: factor b of a damping a M + b K.
        rayleigh_of: whether K there is the initial stiffness of columns that yield, or the tangent
            one.
        accelerogram: file of the ground's acceleration; motion is relative to it.
        outputs: observed quantities: q1, v1, a1, drift1, shear1 … (columns without dampers),
            base_shear, overturning_moment (Σ of storey shears times heights); of columns that yield
            residual1, ductility1, dissipated1 … besides.
    """

    masses: OneOrMany[Mass]
    lengths: OneOrMany[Span] | None = None
    modulus: Modulus | None = None
    second_moment: OneOrMany[Moment] | None = None
    columns: OneOrMany[Count] = (Crisp(2.0),)
    stiffness: OneOrMany[Stiffness] | None = None
    yield_force: OneOrMany[YieldForce] | None = None
    yield_drift: OneOrMany[YieldDrift] | None = None
    hardening: OneOrMany[Hardening] | None = None
    isolator: Isolator | None = None
    gravity: Annotated[float, Quantity("m/s^2", minimum=0)] = 0.0
    damping_ratio: DampingRatios = ()
    dampers: OneOrMany[Damping] = (ZERO,)
    damper_placement: Literal["ground", "storey"] | None = None
    displacements: OneOrMany[Displacement] = (ZERO,)
    velocities: OneOrMany[Velocity] = (ZERO,)
    rayleigh_mass: Rate = ZERO
    rayleigh_stiffness: Delay = ZERO
    rayleigh_of: Literal["initial", "tangent"] = "initial"
    accelerogram: Ground | None = None
    outputs: Annotated[tuple[str, ...], NotEmpty] = ()

    @property
    def floors(self) -> int:
        """Number of floors."""
        return len(self.masses)

    @property
    def needs_modulus(self) -> bool:
        """Whether neither a modulus nor stiffnesses are stated."""
        return self.modulus is None and self.stiffness is None and self.isolator is None

    @property
    def moves_by_itself(self) -> bool:
        """Whether some floor may be displaced or move at the start."""
        return any(any(start.support) for start in (*self.displacements, *self.velocities))

    def warnings(self, structure: Structure | None) -> Iterator[str]:
        """Yield the doubts of `storey_doubts` by the keys of the section.

        Args:
            structure: The frame with its fuzzy parameters; None while its modulus is unknown: then
                weights are not judged.
        """
        from alphacut.frame.analyses.doubts import storey_doubts  # takes time to import

        known = self.nominal if structure is None else structure
        supports = None
        if structure is not None:
            supports = {name: number.support for name, number in structure.numbers.items()}
        for key, words in storey_doubts(cast("StoreyFrame", known.model), supports):
            yield f"frame.{NAMES.get(key, key)} {words}" if key else words

    def per_floor(self, values: tuple[FuzzyNumber, ...] | None) -> tuple[FuzzyNumber, ...]:
        """Return one value for each floor; a single one holds for all of them."""
        if not values:
            return ()
        if len(values) == 1:
            return values * self.floors
        return values

    def structure(
        self, modulus: FuzzyNumber | None = None, loss: FuzzyNumber | None = None
    ) -> Structure:
        """Return the frame with its fuzzy parameters, and the heights of its storeys.

        Args:
            modulus: Young's modulus in Pa; None for the modulus that the section states, or for
                20 GPa if it states none. It is ignored if stiffnesses are given.
            loss: Loss factor of the material, for `damping_ratio` "material"; None for a stand-in
                of 2 %. It is ignored otherwise.

        Returns:
            The model at the nominal values; its parameters by name, such as "m1" or "q3_0"; and the
            heights in m by the names of the drifts and residual drifts of the storeys.

        Raises:
            RefusedError: The values make no frame, for example because a number of values does not
                fit the number of floors, or a storey buckles under its weight. The key is that of
                the case.
        """
        # One number for each floor or storey, by the names of the arguments of `StoreyFrame`.
        lists = {name: self.per_floor(getattr(self, NAMES.get(name, name))) for name in SYMBOLS}
        if self.isolator is not None:
            lists |= self._with_isolator(self.isolator)
        # A single second moment is one parameter "I" of all storeys, so it is not repeated.
        lists["second_moment"] = self.second_moment or ()
        # The stiffness of a storey follows from columns and modulus, 12 c E I / l³ of c columns
        # clamped at both ends; where it is given, it needs neither.
        if lists["stiffness"]:
            lists["columns"] = ()
            young = self.modulus
        else:
            young = modulus or self.modulus or STAND_IN
        ratios = damping_ratios_by_name(self.damping_ratio, loss)
        arguments: dict[str, Any] = {
            name: tuple(number.nominal for number in numbers) for name, numbers in lists.items()
        }
        # Stiffnesses need no second moment: None is its absence, which an empty tuple is not.
        arguments["second_moment"] = arguments["second_moment"] or None
        # A number is the ratio of all modes; a tuple must have one ratio for each.
        if nominal := [ratio.nominal for ratio in ratios.values()]:
            arguments["damping_ratio"] = nominal[0] if len(nominal) == 1 else tuple(nominal)
        with by_keys(lambda name: f"frame.{NAMES.get(name, name)}"):
            model = StoreyFrame(
                **arguments,
                modulus=None if young is None else young.nominal,
                damper_placement=self.damper_placement or "ground",
                outputs=self.outputs,
                rayleigh=(self.rayleigh_mass.nominal, self.rayleigh_stiffness.nominal),
                rayleigh_of=self.rayleigh_of,
                ground=self.accelerogram,
                # A storey may buckle under its weight with the modulus of a stand-in, and stand
                # with that which a stage computes.
                gravity=0.0 if young is STAND_IN else self.gravity,
            )
        stated: dict[str, FuzzyNumber | None] = {
            "E": young,
            "I": next(iter(self.second_moment or ()), None),
            "rayleigh_mass": self.rayleigh_mass,
            "rayleigh_stiffness": self.rayleigh_stiffness,
            **ratios,
        }
        for name, numbers in lists.items():
            for z, number in enumerate(numbers, start=1):
                stated[SYMBOLS[name].format(z)] = number
        # What the case leaves out has the frame's own default, such as q1_0 = 0.
        by_name = {name: stated.get(name) or Crisp(x) for name, x in model.parameters.items()}
        heights: dict[str, FuzzyNumber] = {}
        for z, height in enumerate(lists["lengths"], start=1):
            heights[f"drift{z}"] = heights[f"residual{z}"] = height
        return Structure(model, by_name, heights)

    def _with_isolator(self, isolator: Isolator) -> dict[str, tuple[FuzzyNumber, ...]]:
        """Return what isolators below the first floor give, with the stiffnesses above them.

        Raises:
            RefusedError: A yield point is given besides, or stiffnesses are not those of the
                storeys above.
        """
        for key in ("yield_force", "yield_drift", "hardening"):
            is_absent = getattr(self, key) is None
            require(is_absent, f"frame.{key}", "beside frame.isolator", "one of both")
        found = isolator.storeys(self.per_floor(self.masses))
        above = self.stiffness or ()
        if len(above) == 1:
            above *= self.floors - 1
        allowed = f"{self.floors - 1}, one for each storey above the isolators"
        is_complete = len(above) == self.floors - 1
        require(is_complete, "frame.stiffness", f"a list of {len(above)}", allowed)
        found["stiffness"] = (*found["stiffness"], *above)
        return found

    def require_consistent(self) -> None:
        """Refuse a frame without a word on damping, or with contradictory or impossible values.

        Raises:
            RefusedError: Damping by the material stands beside given stiffnesses; dampers and
                `damper_placement` do not stand together; no key of damping is there, not even with
                0; or the values make no frame.
        """
        # Damping by the material supposes that all strain energy is in columns of this material. If
        # stiffnesses are given, the material of the columns is unknown.
        has_columns = self.stiffness is None or not isinstance(self.damping_ratio, MaterialDamping)
        value = "material, beside stiffness"
        allowed = "columns of the material, or [matrices] if some storeys are of another one"
        require(has_columns, "frame.damping_ratio", value, allowed)
        is_placed = self.has_key("dampers") == (self.damper_placement is not None)
        require(is_placed, "frame.damper_placement", None, "both dampers and damper_placement")
        # Undamped responses are unusual, and a forgotten key would make them: whoever wants one
        # says so, as "0 %".
        keys = ("dampers", "damping_ratio", "rayleigh_mass", "rayleigh_stiffness")
        is_damped = any(map(self.has_key, keys))
        require(is_damped, "frame.dampers", None, " or ".join(keys), cure='"0 %" for none')
        _ = self.nominal  # refuses values that make no frame


class Pendulum(StructureSection):
    """Damped pendulum: a mass on a bar under gravity; the output is the force in the bar.

    Args:
        mass: mass.
        length: length of the bar.
        damping: moment over angular velocity.
        gravity: acceleration of gravity.
        angle: angle at the start, 0 hanging down.
        angular_velocity: angular velocity at the start.
    """

    mass: Mass
    length: Span
    damping: Turning
    gravity: Acceleration
    angle: Angle
    angular_velocity: Spin

    def structure(
        self, modulus: FuzzyNumber | None = None, loss: FuzzyNumber | None = None
    ) -> Structure:
        """Return the pendulum, whose one output is the force in the bar in N.

        Both arguments are ignored: a pendulum takes no modulus and no loss factor.

        Raises:
            RefusedError: The values make no pendulum.
        """
        numbers = {
            **{key: getattr(self, key) for key in ("mass", "length", "damping", "gravity")},
            "phi0": self.angle,
            "omega0": self.angular_velocity,
        }
        model = pendulum(**{name: x.nominal for name, x in numbers.items()})
        # The model also observes the angle; a case has the force in the bar alone.
        model = replace(model, observed={"force": model.observed["force"]})
        return Structure(model, dict(zip(model.parameters, numbers.values(), strict=True)))
