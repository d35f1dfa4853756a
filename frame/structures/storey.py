"""Plane storey frame: rigid floors on bending columns (section 6, Figs. 26, 27).

A weight P on a storey of height l that is displaced by Δ presses with P Δ / l against what holds
it: the linear geometric stiffness −P/l (P-Delta). The columns' own bending between their ends is
left out: a clamped column buckles there at 12 E I / l² and in truth at π² E I / l².
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Annotated, Literal, NamedTuple, Self, TypeGuard

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import (
    RefusedError,
    checked_number,
    require,
    require_choice,
    require_numbers,
    require_sequence,
)
from alphacut.base.number_text import STANDARD_GRAVITY
from alphacut.base.quantity import Quantity
from alphacut.frame.calculus.polynomials import Jet
from alphacut.frame.records.history import Accelerogram
from alphacut.frame.structures.linear import Assembly, LinearSystem, Number, in_periods, stack
from alphacut.frame.structures.loads import Force, distinct_histories, require_loads
from alphacut.frame.structures.model import Dynamics, PlacedForce, StructureModel
from alphacut.frame.structures.quantities import OF_STOREY_FRAME, Output, Parameter, of_storey_frame

# Names of the parameters of each list field, with {} for the number of the floor or storey.
SYMBOLS = {
    "masses": "m{}",
    "lengths": "l{}",
    "columns": "c{}",
    "stiffness": "k{}",
    "dampers": "d{}",
    "q0": "q{}_0",
    "v0": "v{}_0",
    "second_moment": "I{}",
    "yield_force": "fy{}",
    "yield_drift": "dy{}",
    "hardening": "hardening{}",
}
MOMENT = "overturning_moment"


class _Storeys(NamedTuple):
    """Storeys somewhere in a box, from below: arrays of shape (n,).

    Args:
        stiffness: k_z in N/m.
        mass_over_height: Mass of all floors above over the height l_z, in kg/m.
    """

    stiffness: Array
    mass_over_height: Array


@dataclass(frozen=True)
class StoreyFrame(LinearSystem):
    """Chain of n floors with k_z = 12 c_z E I / l_z³ for c_z clamped columns (2 by default).

    Parameters that can be uncertain: "E", "I" or "I1" …, "m1" … "mn", "l1" …, "c1" … (columns of a
    storey), or "k1" … where stiffnesses are given (and "l1" … beside them); "d1" …, "q1_0" …
    (initial displacements), "v1_0" … (initial velocities), "rayleigh_mass", "rayleigh_stiffness",
    and "zeta", or "zeta1" … of single modes, where there are damping ratios; "frequency" where it
    is given; "F3" of a force on floor 3, "F3_2" of a second one there, "J3" of an impulse; of
    columns that yield "fy1" … or "dy1" … (yield forces or drifts) and "hardening1" ….
    Outputs: "q1" … (displacement, m), "v1" … (velocity, m/s), "a1" … (absolute acceleration,
    m/s²), "drift1" … (q_z − q_(z−1), m), "shear1" … (k_z drift_z of the columns,
    without dampers' forces, N); "base_shear" is "shear1", "overturning_moment" Σ_z l_z shear_z
    (N m, where lengths are given). Where columns yield "residual1" … (drift when unloaded, m),
    "ductility1" … (drift over yield drift), "dissipated1" … (energy, J), too.

    Args:
        masses: Floors from below, in kg.
        lengths: Column lengths per storey, in m; beside stiffness the storeys' heights, which
            gravity and the overturning moment need.
        modulus: Young's modulus E, in Pa.
        second_moment: Second moment of area I of one column, in m⁴: one for all storeys, or one
            for each.
        dampers: Damping constants, in N s/m.
        damper_placement: From each floor to the ground, or between neighbouring floors ("storey").
        q0: Initial displacements, in m; zero when empty.
        v0: Initial velocities, in m/s; zero when empty.
        outputs: Names of the observed quantities; all displacements when empty.
        rayleigh: Mass and stiffness factors a (1/s), b (s) of a damping a M + b K added to the
            dampers.
        rayleigh_of: Whether K there is the initial stiffness of columns or the tangent one, of
            which storeys that yield have hardening times k_z.
        ground: Base excitation, if any; displacements are then relative to the ground.
        damping_ratio: ζ of all modes, or a list with one of each mode by rising frequency, added to
            the other damping; it follows the parameters through the modes.
        columns: Columns in each storey, each with the second moment I; where a storey's are
            stiffer, their number times that ratio. Two in each when empty.
        stiffness: Stiffness k_z of each storey, in N/m, in place of modulus, second moment and
            columns.
        gravity: Acceleration of gravity, in m/s², of the weights that reduce the stiffness of each
            storey to k_z − P_z / l_z, P_z that of all floors above it (P-Delta); 0 leaves them out.
            Rayleigh's damping and shears keep k_z.
        loads: Forces on floors.
        yield_force: Force of each storey at which its columns yield, in N: bilinear, with kinematic
            hardening. Damping ratios stay those of the initial stiffness. An isolator is a soft
            first storey; a storey of hardening 1 stays elastic.
        yield_drift: Drift of each storey at which they yield, in m, in place of yield_force.
        hardening: Stiffness of each storey after yielding over k_z, from 0 (the default) to 1.
        frequency: Frequency f0 in Hz of the harmonic loads, if the parameter "frequency" is to
            change it. Times are then those of the period: at a frequency f what happens at t is
            found at t f / f0, so that a duration is a number of periods. See `in_periods`.

    Raises:
        RefusedError: The lists differ in length, a value is outside its range, the weight buckles a
            storey, a stiffness stands beside what makes one, a force acts on no floor, or a yield
            force beside a yield drift.

    Example:
        >>> frame = StoreyFrame(masses=[1e3, 1e3], stiffness=[4e4, 4e4], q0=[0.1, 0.2])
        >>> frame.floors, frame.outputs
        (2, ('q1', 'q2'))
    """

    masses: Annotated[Sequence[float], OF_STOREY_FRAME["m"]]
    lengths: Annotated[Sequence[float], OF_STOREY_FRAME["l"]] = ()
    modulus: Annotated[float | None, OF_STOREY_FRAME["E"]] = None
    second_moment: Annotated[float | Sequence[float] | None, OF_STOREY_FRAME["I"]] = None
    dampers: Annotated[Sequence[float], OF_STOREY_FRAME["d"]] = ()
    damper_placement: Literal["ground", "storey"] = "ground"
    q0: Annotated[Sequence[float], OF_STOREY_FRAME["q"]] = ()
    v0: Annotated[Sequence[float], OF_STOREY_FRAME["v"]] = ()
    outputs: tuple[str, ...] = ()
    rayleigh: tuple[float, float] = (0.0, 0.0)
    ground: Accelerogram | None = None
    damping_ratio: Annotated[float | Sequence[float] | None, OF_STOREY_FRAME["zeta"]] = None
    columns: Annotated[Sequence[float], OF_STOREY_FRAME["c"]] = ()
    stiffness: Annotated[Sequence[float], OF_STOREY_FRAME["k"]] = ()
    gravity: Annotated[float, Quantity("m/s^2", minimum=0)] = 0.0
    loads: Sequence[Force] = ()
    yield_force: Annotated[Sequence[float], OF_STOREY_FRAME["fy"]] = ()
    yield_drift: Annotated[Sequence[float], OF_STOREY_FRAME["dy"]] = ()
    hardening: Annotated[Sequence[float], OF_STOREY_FRAME["hardening"]] = ()
    rayleigh_of: Literal["initial", "tangent"] = "initial"
    frequency: float | None = None

    def __post_init__(self) -> None:
        """Check all fields, store lists as tuples, and fill empty ones with their defaults.

        Without dampers, q0 or v0, each floor gets a zero. Without columns, each storey gets two,
        unless stiffnesses are given. Without hardening, columns that yield get zeros. Without
        outputs, the displacements "q1" … of all floors are taken. Outputs become texts that know
        their unit.

        Raises:
            RefusedError: A list has a wrong length; a number is outside the range of its parameter;
                springs are given twice or not at all; hardening is given without a yield force or
                drift, or both of these; the base excitation or a force has a wrong type or acts on
                no floor; an output is unknown or repeated; or the weight buckles a storey.
        """
        self._require_values()
        self._require_springs()
        require_loads(self.ground, self.loads)
        n = len(self.masses)
        for force in self.loads:
            is_floor = force.at in range(1, n + 1)
            require(is_floor, "floor", value=force.at, allowed=f"1 to {n}")
            checked_number("amplitude", force.amplitude)

        zeros = ("dampers", "q0", "v0")
        defaults: dict[str, tuple[float, ...]] = dict.fromkeys(zeros, (0.0,) * n)
        if not len(self.stiffness):
            defaults["columns"] = (2.0,) * n
        if len(self.yield_force) or len(self.yield_drift):
            defaults["hardening"] = (0.0,) * n
        others = ("loads", "stiffness", "columns", "yield_force", "yield_drift", "hardening")
        for name in zeros + others:
            values = tuple(getattr(self, name)) or defaults.get(name, ())
            object.__setattr__(self, name, values)
        # frozen dataclasses are set by `object.__setattr__`, as in their own initialiser
        names = tuple(self.outputs) or tuple(f"q{z + 1}" for z in range(n))
        object.__setattr__(self, "outputs", tuple(Output(str(name)) for name in names))
        for output in self.outputs:
            self.quantity(output)
        are_unique = len(set(self.outputs)) == len(self.outputs)
        require(are_unique, "output", value=", ".join(self.outputs), allowed="each output once")
        self._require_frequency()
        # The empty box is the nominal structure alone; boxes of inputs are checked where they are
        # known.
        self.require_standing({})

    def _require_values(self) -> None:
        """Check the lengths of all lists and the ranges of all numbers.

        Each list has one number for each floor, from below. A list that may be left out may be
        empty; the second moment may also be one number for all storeys, and so may the damping
        ratio.

        Raises:
            RefusedError: `masses` is empty; a list has another length or is no list of finite
                numbers; `rayleigh` is no list of two numbers, or `outputs` no list; a number is
                outside the range of its parameter, such as a mass that is not positive; or the
                place of the dampers or the stiffness of Rayleigh's damping is none of the two words
                allowed.
        """
        lists = ["masses", "stiffness", "lengths", "columns", "dampers", "q0", "v0"]
        lists += ["yield_force", "yield_drift", "hardening"]
        for name in lists:
            require_sequence(name, getattr(self, name), "one value a floor, from below")
        allowed = "two numbers, of mass and of stiffness"
        require_sequence("rayleigh", self.rayleigh, allowed)
        require(len(self.rayleigh) == 2, "rayleigh", f"a list of {len(self.rayleigh)}", allowed)
        require_sequence("outputs", self.outputs, "a list of names")
        n = len(self.masses)
        require(n > 0, "masses", value=None, allowed="one value a floor, from below")
        checked_number("gravity", self.gravity, least=0)
        # Lengths that each list may have: 0 of optional ones, 1 of a moment of all storeys.
        sizes = dict.fromkeys(SYMBOLS, (0, n)) | {"second_moment": (1, n), "damping_ratio": (n,)}
        # Fields that may be one number, and the parameters whose ranges they have. Rayleigh's two
        # factors have the same range.
        single = {"modulus": "E", "damping_ratio": "zeta", "rayleigh": "rayleigh_mass"}
        for name, symbol in (SYMBOLS | single).items():
            values = getattr(self, name)
            if values is None:
                continue
            is_single = not hasattr(values, "__len__") or name == "modulus"
            if is_single:
                checked_number(name, values)
            else:
                require_numbers(name, values)
                shape = np.shape(values)
                require(len(shape) == 1, name, f"of shape {shape}", "a list of numbers")
            parameter = of_storey_frame(symbol.format(""))
            for value in np.atleast_1d(values):
                allowed = parameter.range or "finite numbers"
                require(parameter.admits(value, value), name, value=f"{value:g}", allowed=allowed)
            if name in sizes and not (is_single and name in single):
                size = np.size(values)
                allowed = f"{n}, as masses has, from below"
                require(size in sizes[name], name, f"a list of {size}", allowed)
        require_choice("damper_placement", self.damper_placement, ("ground", "storey"))
        require_choice("rayleigh_of", self.rayleigh_of, ("initial", "tangent"))

    def _require_springs(self) -> None:
        """Check that each storey's stiffness and yield point is given in exactly one way.

        The stiffness is given as `stiffness`, or follows from `modulus`, `second_moment` and
        `lengths` (with `columns` if they are not two); beside `stiffness` the lengths are heights,
        which gravity needs. Columns yield at `yield_force` or at `yield_drift`; `hardening` needs
        one of them.

        Raises:
            RefusedError: A value is missing, or two of them contradict one another.
        """
        names = ("modulus", "second_moment", "columns", "lengths")
        given = [x for x in names if getattr(self, x) is not None and np.size(getattr(self, x))]
        examples = {"modulus": "200e9", "second_moment": "1e-6", "lengths": "[3.0]"}
        needed = list(examples)
        alternative = ", or stiffness, as [30e6]"
        if len(self.stiffness):
            beside = ", ".join(name for name in given if name != "lengths")
            allowed = "either stiffness or what makes it"
            require(not beside, beside, value="there", allowed=allowed)
            # Weights act over the height of a storey, which given stiffnesses do not tell.
            needed = []
            alternative = ""
            if self.gravity:
                needed = ["lengths"]
        for name in needed:
            cure = f"give {name}, as {examples[name]} in SI{alternative}"
            allowed = "lengths, modulus and second_moment, or stiffness (with lengths for gravity)"
            require(name in given, name, value=None, allowed=allowed, cure=cure)

        has_force = bool(len(self.yield_force))
        has_drift = bool(len(self.yield_drift))
        require(
            not (has_force and has_drift),
            "yield_force",
            value="beside yield_drift",
            allowed="one of them",
            cure="leave out yield_drift: it is yield_force over stiffness",
        )
        if len(self.hardening):
            allowed = "one of them beside hardening"
            require(has_force or has_drift, "yield_force, yield_drift", None, allowed)

    def _require_frequency(self) -> None:
        """Refuse an uncertain frequency beside loads of other frequencies.

        Raises:
            RefusedError: The ground moves, columns yield, or a load is not harmonic with the
                frequency in the field of this name.
        """
        if self.frequency is None:
            return
        hertz = checked_number("frequency", self.frequency, positive=True)
        allowed = "one course of harmonic loads, an elastic frame, and no motion of the ground"
        histories = distinct_histories(self.loads)
        is_one = len(histories) == 1 and all(force.history for force in self.loads)
        is_harmonic = is_one and bool(np.isclose(histories[0].frequency, 2 * np.pi * hertz))
        is_alone = self.ground is None and not self.hardening
        require(is_harmonic and is_alone, "frequency", f"{hertz:g} Hz", allowed)

    @property
    def floors(self) -> int:
        """Number of floors n."""
        return len(self.masses)

    @property
    def moments(self) -> tuple[float, ...]:
        """Second moments of area, one for all storeys or one for each; empty with a stiffness."""
        if self.second_moment is None:
            return ()
        return tuple(np.atleast_1d(self.second_moment))

    @property
    def ratios(self) -> dict[str, float]:
        """Damping ratios by the names of their parameters; empty where there are none."""
        if self.damping_ratio is None:
            return {}
        return _named("zeta{}", self.damping_ratio)

    @cached_property
    def parameters(self) -> dict[str, float]:
        """Nominal values of all parameters by name, in SI units.

        A list gives one parameter for each floor or storey, numbered from 1 from below: "m1" …
        (masses), "l1" … (lengths), "c1" … (columns), "k1" … (given stiffnesses), "d1" … (dampers),
        "q1_0" …, "v1_0" … (initial displacements and velocities), "fy1" …, "dy1" …, "hardening1" …
        (yielding). Further names are "E"; "I", or "I1" … of single storeys; "rayleigh_mass" and
        "rayleigh_stiffness"; "zeta", or "zeta1" … of single modes; and those of the loads'
        amplitudes, such as "F3" on floor 3. Fields that are not given have no parameters.

        Raises:
            RefusedError: The amplitude of a load is no finite number.
        """
        named: dict[str, float] = {}
        if self.modulus is not None:
            named["E"] = self.modulus
        named |= _named("I{}", self.moments)
        lists = ["stiffness", "masses", "lengths", "columns", "dampers", "q0", "v0"]
        lists += ["yield_force", "yield_drift", "hardening"]
        for name in lists:
            named |= _named(SYMBOLS[name], getattr(self, name), single=False)
        named["rayleigh_mass"], named["rayleigh_stiffness"] = self.rayleigh
        named |= self.ratios
        if self.frequency is not None:
            named["frequency"] = self.frequency
        for name, force in zip(self.force_names, self.loads, strict=True):
            named[name] = checked_number(name, force.amplitude)
        return named

    @property
    def force_names(self) -> tuple[str, ...]:
        """Names of the parameters that are the loads' amplitudes, in the order of the loads.

        A force on floor 3 is "F3", the second and third one there "F3_2" and "F3_3"; an impulse is
        "J3". Floors are counted from 1 from below.
        """
        names: list[str] = []
        for force in self.loads:
            name = f"F{force.at}"
            if force.history is None:
                name = f"J{force.at}"  # of an impulse
            # The name before "_" is that of the floor; so many forces of the floor came before.
            n_before = sum(other.partition("_")[0] == name for other in names)
            if n_before:
                name += f"_{n_before + 1}"
            names.append(name)
        return tuple(names)

    @property
    def dynamics(self) -> Dynamics:
        """Linear, unless columns yield."""
        if self.hardening:
            return Dynamics.YIELDING
        return Dynamics.LINEAR

    def parameter(self, name: str) -> Parameter:
        """Return a parameter with its unit and range."""
        return of_storey_frame(name)

    def require_quantity(self, name: str) -> None:
        """Refuse an output that the frame cannot have."""
        self.quantity(name)

    def with_outputs(self, names: Sequence[str]) -> Self:
        """Return the frame, observed at any quantities that it can have."""
        return replace(self, outputs=tuple(names))

    def with_forces(self, forces: Sequence[PlacedForce]) -> tuple[Self, tuple[str, ...]]:
        """Return the frame under other forces, and the names of their amplitudes.

        Args:
            forces: For each force its `place`, the floor counted from 0; its nominal `amplitude` in
                N, or in N s of an impulse; and its `history`, None for an impulse. They replace the
                frame's loads.

        Returns:
            The frame, and the names of the parameters that are the amplitudes, as "F3" on the floor
            with the place 2.

        Raises:
            RefusedError: There is no such floor, or an amplitude is no finite number.
        """
        loads = [Force(force.place + 1, force.amplitude, force.history) for force in forces]
        frame = replace(self, loads=loads)
        return frame, frame.force_names

    def elastic(self) -> Self:
        """Return the frame with its initial stiffness, whose columns do not yield."""
        return replace(self, yield_force=(), yield_drift=(), hardening=(), rayleigh_of="initial")

    def require_dissipation(self, lowest: Mapping[str, float]) -> None:
        """Refuse nothing: the ranges of a frame's parameters have no negative damping."""

    def group(self, name: str) -> tuple[str, ...]:
        """Return the names of the parameters that a name stands for.

        A short name stands for a whole list: "m" for "m1" … "mn", likewise "l", "c", "k", "d",
        "q0", "v0", "I", "fy", "dy", "hardening" and "zeta", where the frame has numbered ones; "F"
        stands for the amplitudes of all loads, impulses among them. The name of a single parameter
        stands for itself.

        Raises:
            RefusedError: There is no such parameter or list.
        """
        groups: dict[str, tuple[str, ...]] = {}
        for pattern in (*SYMBOLS.values(), "zeta{}"):
            # A moment or a damping ratio of all storeys or modes has no number, and is no list.
            if pattern.format(1) in self.parameters:
                short = pattern.format("").replace("_", "")
                groups[short] = tuple(pattern.format(z + 1) for z in range(self.floors))
        if self.loads:
            groups["F"] = self.force_names
        require_choice("parameter", name, groups | self.parameters)
        return groups.get(name, (name,))

    def springs(self, p: Mapping[str, Number]) -> Number:
        """Return the stiffness k_z of each storey, shape (…, n), in N/m, from below.

        It is as given, or 12 c E I / l³ of c columns that are clamped at both ends.

        Args:
            p: All parameters by name, all of one shape (…): jets (values with derivatives) or
                Taylor models (polynomials with error bounds).
        """
        if self.stiffness:
            return self._of_floors("k{}", p)
        if len(self.moments) > 1:
            inertia = self._of_floors("I{}", p)
        else:
            inertia = p["I"][..., None]
        # A column that is clamped at both ends resists a unit displacement between them by
        # 12 E I / l³ (slope-deflection equations); c columns of a storey act side by side.
        rigidity = 12.0 * p["E"][..., None] * inertia
        return rigidity * self._of_floors("c{}", p) * self._of_floors("l{}", p) ** -3

    def yield_drifts(self, p: Mapping[str, Number]) -> Number:
        """Return the drifts at which storeys yield, shape (…, n), in m."""
        if self.yield_drift:
            return self._of_floors("dy{}", p)
        # A bilinear spring is elastic up to its yield force, so that its drift there is f_y / k.
        return self._of_floors("fy{}", p) * self.springs(p) ** -1

    def hardenings(self, p: Mapping[str, Number]) -> Number:
        """Return the stiffness of yielding storeys over the initial one, shape (…, n)."""
        return self._of_floors("hardening{}", p)

    def softening(self, p: Mapping[str, Number]) -> Number:
        """Return weight of all floors above over height of storeys, P_z / l_z, (…, n), in N/m."""
        return self._masses_over_heights(p) * self.gravity

    def _masses_over_heights(self, p: Mapping[str, Number]) -> Number:
        """Return the mass above each storey over its height, shape (…, n), in kg/m."""
        # Row i of the lower triangle adds the mass of floor i to storeys 1 … i
        above = self._of_floors("m{}", p).contract(np.tri(self.floors))
        return above * self.heights(p) ** -1

    def heights(self, p: Mapping[str, Number]) -> Number:
        """Return the heights l_z of storeys, shape (…, n), in m."""
        return self._of_floors("l{}", p)

    def assembly(self, p: Mapping[str, Number]) -> Assembly[Number]:
        """Return matrices, output rows and loads of the frame at given parameters (eq. 23).

        Args:
            p: All parameters by name: jets at S parameter sets (values with derivatives), or Taylor
                models over a box (polynomials with error bounds).

        Returns:
            Assembly of numbers of the type of `p`, for n floors from below: mass, stiffness of the
            springs, weights that reduce it (P-Delta; None without gravity) and damping matrix of
            the dashpots, shape (…, n, n); Rayleigh's factors a and b and the damping ratios, shape
            (…); initial displacements and velocities, shape (…, n); rows of the m outputs on [q;
            v], shape (m, 2n), or (…, m, 2n) with the overturning moment among them, and on absolute
            accelerations, shape (m, n); factors of these rows, shape (…, m): k_z of a shear, else
            1; the force vector of each load at its amplitude, shape (…, n, loads), None without
            loads. Here … stands for S with jets and for nothing with Taylor models.
        """
        found = self._in_seconds(p)
        if self.frequency is None:
            return found
        is_velocity = np.array([self.quantity(name)[0] == "v" for name in self.outputs])
        return in_periods(found, p["frequency"] * (1 / self.frequency), is_velocity)

    def _in_seconds(self, p: Mapping[str, Number]) -> Assembly[Number]:
        """Return the `assembly` at the nominal frequency."""
        n = self.floors
        identity: Array = np.eye(n)
        # Matrices are sums of constant ones, one for each floor or storey, with the parameters as
        # factors: a contraction makes each sum in one step.
        by_floor = diagonal(identity)
        by_storey = chain_matrix(identity)
        springs = self.springs(p)
        damper_matrices = by_storey if self.damper_placement == "storey" else by_floor

        # Rows are constant but for the overturning moment, whose factors k_z l_z depend on
        # parameters; the stiffness in a shear is a factor of its whole row.
        coefficients = self._coefficients
        rows: Array | Number = coefficients[:, : 2 * n]
        if MOMENT in self.outputs:  # Σ_z l_z k_z (q_z − q_(z−1))
            drifts = np.zeros((n, len(self.outputs), 2 * n))
            drifts[:, self.outputs.index(MOMENT), :n] = identity - np.eye(n, k=-1)
            rows = (springs * self.heights(p)).contract(drifts) + rows
        one = p["rayleigh_mass"] * 0.0 + 1.0
        row_factors = [one] * len(self.outputs)
        for row, (kind, z) in enumerate(map(self.quantity, self.outputs)):
            if kind == "shear":
                row_factors[row] = springs[..., z]

        columns: Number | None = None
        if self.loads:
            # one column a force: its amplitude times the unit vector of its floor
            amplitudes = stack([p[name] for name in self.force_names])
            unit_forces = np.array([identity[int(force.at) - 1] for force in self.loads])
            columns = amplitudes[..., None, :] * unit_forces.T
        return Assembly(
            mass=self._of_floors("m{}", p).contract(by_floor),
            springs=springs.contract(by_storey),
            weights=self.softening(p).contract(by_storey) if self.gravity else None,
            dashpots=self._of_floors("d{}", p).contract(damper_matrices),
            rayleigh=(p["rayleigh_mass"], p["rayleigh_stiffness"]),
            ratios=[p[name] for name in self.ratios],
            q0=self._of_floors("q{}_0", p),
            v0=self._of_floors("v{}_0", p),
            row_factors=stack(row_factors),
            rows=rows,
            accelerated=coefficients[:, 2 * n :],
            pattern=np.ones(n),
            massive=np.arange(n),
            loads=self.loads,
            columns=columns,
        )

    @cached_property
    def _coefficients(self) -> Array:
        """Coefficients of the outputs on motions of the floors, shape (m, 3n) for m outputs.

        Columns 0 … n - 1 are for the displacements of the n floors relative to the ground, from
        below, the next n for their velocities, and the last n for their absolute accelerations. The
        row of a shear has the coefficients of the drift, not multiplied by the stiffness. The rows
        of residual drift, ductility and dissipated energy have a 1 at the displacement of their
        floor, though these outputs are no sums. The row of the overturning moment is 0, since its
        coefficients depend on parameters.
        """
        coefficients = np.zeros((len(self.outputs), 3 * self.floors))
        for row, (kind, z) in zip(coefficients, map(self.quantity, self.outputs), strict=True):
            if kind == MOMENT:
                continue
            # The storey z stands on the floor z - 1, or on the ground, which does not move here.
            block = {"v": 1, "a": 2}.get(kind, 0)
            row[z + self.floors * block] = 1.0
            if kind in ("drift", "shear") and z:
                row[z - 1] = -1.0
        return coefficients

    def quantity(self, name: str) -> tuple[str, int]:
        """Return the kind of an output, and its floor or storey, counted from 0 from below.

        Args:
            name: "q3", "v3" or "a3" (displacement, velocity, absolute acceleration of floor 3),
                "drift3" or "shear3" (of storey 3), "base_shear", which is the shear of storey 1, or
                "overturning_moment"; and of a frame whose columns yield "residual3", "ductility3"
                or "dissipated3".

        Returns:
            The name without its number, as "drift", and the number less 1; ("shear", 0) of the base
            shear, and ("overturning_moment", 0).

        Raises:
            RefusedError: The frame has no such output, or the overturning moment without lengths.
        """
        if name == MOMENT:
            allowed = "it beside lengths, the heights of the storeys"
            require(len(self.lengths) > 0, "output", value=name, allowed=allowed)
            return MOMENT, 0
        kinds = ["q", "v", "a", "drift", "shear"]
        if self.frequency is not None:  # what a force adds to an acceleration at once has no factor
            kinds.remove("a")
        if self.hardening:
            kinds += ["residual", "ductility", "dissipated"]
        pattern = rf"({'|'.join(kinds)})([1-9]\d{{0,5}})"
        if name == "base_shear":
            return "shear", 0
        match = re.fullmatch(pattern, name)
        words = f"{', '.join(kinds[:-1])} or {kinds[-1]}"
        allowed = f"{words} with a floor from 1 to {self.floors}, base_shear, {MOMENT}"
        if match is None or int(match[2]) > self.floors:
            raise RefusedError("output", name, allowed)
        return match[1], int(match[2]) - 1

    def stability_coefficients(self, ends: Mapping[str, tuple[float, float]]) -> Array:
        """Return the largest P_z / (k_z l_z) of each storey in a box of parameters, shape (n,).

        P_z is the weight that storey z carries, of the floor on it and all above, under the frame's
        own gravity, or standard gravity if it has none; k_z is the stiffness and l_z the height of
        the storey. Below 0.1 second-order effects may be neglected (EN 1998-1, 4.4.2.2, where the
        storey is elastic); from 1 on the storey buckles.

        Args:
            ends: Lower and upper end of parameters in SI units, by name; others are nominal.

        Raises:
            KeyError: The frame has no lengths.
        """
        worst = self._worst_storeys(ends)
        return (self.gravity or STANDARD_GRAVITY) * worst.mass_over_height / worst.stiffness

    def require_standing(self, ends: Mapping[str, tuple[float, float]]) -> None:
        """Raise an error if the weight buckles a storey somewhere in a box of parameters.

        A storey z stands if its stiffness k_z is more than P_z / l_z, with the weight P_z of the
        floor on it and all above, and its height l_z. A frame without gravity stands always.

        Args:
            ends: Lower and upper end of parameters in SI units, by name; others are nominal.

        Raises:
            RefusedError: A storey buckles; the message names the lowest one that does.
        """
        if not self.gravity:
            return
        worst = self._worst_storeys(ends)
        softening = self.gravity * worst.mass_over_height
        for z, (k, soft) in enumerate(zip(worst.stiffness, softening, strict=True), start=1):
            allowed = f"more than weight over height, {soft:.5g} N/m"
            cure = "else it buckles: take stiffer storeys, lighter floors or narrower supports"
            key = f"stiffness of storey {z} under P-Delta"
            require(k > soft, key, value=f"{k:.5g} N/m", allowed=allowed, cure=cure)

    def _worst_storeys(self, ends: Mapping[str, tuple[float, float]]) -> _Storeys:
        """Return the storeys where k_z l_z / P_z is smallest over a box of parameters.

        Here k_z is the stiffness of storey z, l_z its height, and P_z the weight of the floor on it
        and all above. All storeys have their smallest ratio at one corner of the box.

        Args:
            ends: Lower and upper end of parameters in SI units, by name; others are nominal.

        Returns:
            Arrays of shape (n,), from below: `stiffness`, k_z in N/m at that corner, and
            `mass_over_height`, the mass that storey z carries over l_z, in kg/m.

        Raises:
            KeyError: The frame has no lengths.
        """
        # With k = 12 c E I / l³ the ratio k l / P is 12 c E I / (l² P). It is smallest at the
        # highest l and P and the lowest c, E and I; of given springs at the lowest k and l.
        # Only names of masses begin with m, and only names of heights with l.
        worst_when_high = "m" if self.stiffness else "ml"
        p: dict[str, Jet] = {}
        for name, nominal in self.parameters.items():
            low, high = ends.get(name, (nominal, nominal))
            worst = low
            if name[0] in worst_when_high:
                worst = high
            p[name] = Jet.constant(np.array([worst]), 0)
        return _Storeys(
            stiffness=self.springs(p).value[0],
            mass_over_height=self._masses_over_heights(p).value[0],
        )

    def _of_floors(self, pattern: str, p: Mapping[str, Number]) -> Number:
        """Return the parameters of all floors of a pattern such as "m{}", shape (…, n)."""
        return stack([p[pattern.format(z + 1)] for z in range(self.floors)])


def yields(model: object) -> TypeGuard[StoreyFrame]:
    """Return whether an object is a frame whose columns yield."""
    return isinstance(model, StructureModel) and model.dynamics is Dynamics.YIELDING


def chain_matrix(links: Array) -> Array:
    """Return the matrices of chains of n masses that are fixed at their lower end.

    Args:
        links: Coefficients of the links, from below, shape (…, n), with n ≥ 1: link z joins the
            masses z - 1 and z, and link 0 joins the ground and mass 0.

    Returns:
        Symmetric tridiagonal matrices, shape (…, n, n). The diagonal has the sum of the links at
        each mass; beside it stands, with a minus sign, the link between two masses.
    """
    place = np.arange(links.shape[-1])
    below = place[:-1]
    above = place[1:]
    matrix = diagonal(links)
    matrix[..., below, below] += links[..., 1:]
    matrix[..., below, above] = -links[..., 1:]
    matrix[..., above, below] = -links[..., 1:]
    return matrix


def diagonal(values: Array) -> Array:
    """Return the diagonal matrices of values (…, n), shape (…, n, n)."""
    return values[..., None] * np.eye(values.shape[-1])


def _named(
    pattern: str, given: float | Sequence[float], *, single: bool = True
) -> dict[str, float]:
    """Return values by the names of their parameters.

    Args:
        pattern: The names, with {} for the number, as "I{}".
        given: One value or a list of n values, from below.
        single: Whether a single value has no number, "I", since it holds for all floors.

    Returns:
        The values by name, as "I1" … "In", in their order; nothing for an empty list.
    """
    values = np.ravel(given).tolist()
    if single and len(values) == 1:
        return {pattern.format(""): values[0]}
    return {pattern.format(z): value for z, value in enumerate(values, start=1)}
