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
from typing import Literal, NamedTuple, Self, TypeGuard

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import (
    checked_number,
    require,
    require_choice,
    require_numbers,
    require_sequence,
)
from alphacut.base.number_text import STANDARD_GRAVITY
from alphacut.frame.calculus.jet import Jet
from alphacut.frame.records.history import Accelerogram
from alphacut.frame.structures.linear import Assembly, LinearSystem, Number, stack
from alphacut.frame.structures.loads import Force, require_loads
from alphacut.frame.structures.model import Dynamics, PlacedForce, StructureModel
from alphacut.frame.structures.quantities import Output, Parameter, of_storey_frame

# names of the parameters that each list holds, by floor or storey, and of values that may be single
SYMBOLS = {
    **{"masses": "m{}", "lengths": "l{}", "columns": "c{}", "stiffness": "k{}", "dampers": "d{}"},
    **{"q0": "q{}_0", "v0": "v{}_0", "second_moment": "I{}"},
    **{"yield_force": "fy{}", "yield_drift": "dy{}", "hardening": "hardening{}"},
}
SINGLE = {"modulus": "E", "damping_ratio": "zeta", "rayleigh": "rayleigh_mass"}
MOMENT = "overturning_moment"
SPRING_KEYS = "lengths, modulus and second_moment, or stiffness (with lengths for gravity)"


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
    and "zeta", or "zeta1" … of single modes, where there are damping ratios; "F3" of a force on
    floor 3, "F3_2" of a second one there, "J3" of an impulse; of columns that yield "fy1" … or
    "dy1" … (yield forces or drifts) and "hardening1" ….
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

    Raises:
        RefusedError: The lists differ in length, a value is outside its range, the weight buckles a
            storey, a stiffness stands beside what makes one, a force acts on no floor, or a yield
            force beside a yield drift.

    Example:
        >>> frame = StoreyFrame(masses=[1e3, 1e3], stiffness=[4e4, 4e4], q0=[0.1, 0.2])
        >>> frame.floors, frame.outputs
        (2, ('q1', 'q2'))
    """

    masses: Sequence[float]
    lengths: Sequence[float] = ()
    modulus: float | None = None
    second_moment: float | Sequence[float] | None = None
    dampers: Sequence[float] = ()
    damper_placement: Literal["ground", "storey"] = "ground"
    q0: Sequence[float] = ()
    v0: Sequence[float] = ()
    outputs: tuple[str, ...] = ()
    rayleigh: tuple[float, float] = (0.0, 0.0)
    ground: Accelerogram | None = None
    damping_ratio: float | Sequence[float] | None = None
    columns: Sequence[float] = ()
    stiffness: Sequence[float] = ()
    gravity: float = 0.0
    loads: Sequence[Force] = ()
    yield_force: Sequence[float] = ()
    yield_drift: Sequence[float] = ()
    hardening: Sequence[float] = ()
    rayleigh_of: Literal["initial", "tangent"] = "initial"

    def __post_init__(self) -> None:
        """Refuse values that are not allowed, and fill empty lists with their defaults."""
        self._require_values()
        self._require_springs()
        require_loads(self.ground, self.loads)
        n = len(self.masses)
        for force in self.loads:
            is_floor = force.at in range(1, n + 1)
            require(is_floor, "floor", value=force.at, allowed=f"1 to {n}")
            checked_number("amplitude", force.amplitude)
        defaults: dict[str, tuple[float, ...]] = dict.fromkeys(("dampers", "q0", "v0"), (0.0,) * n)
        defaults["columns"] = () if len(self.stiffness) else (2.0,) * n
        yields = len(self.yield_force) or len(self.yield_drift)
        defaults["hardening"] = (0.0,) * n if yields else ()
        for name in (*defaults, "loads", "stiffness", "yield_force", "yield_drift"):
            values = tuple(getattr(self, name)) or defaults.get(name, ())
            object.__setattr__(self, name, values)
        names = self.outputs or [f"q{z + 1}" for z in range(n)]
        object.__setattr__(self, "outputs", tuple(Output(str(name)) for name in names))
        for output in self.outputs:
            self.quantity(output)
        are_unique = len(set(self.outputs)) == len(self.outputs)
        require(are_unique, "output", value=", ".join(self.outputs), allowed="each output once")
        self.require_standing({})

    def _require_values(self) -> None:
        for name in ("masses", "stiffness", "lengths", "yield_force", "yield_drift"):
            if getattr(self, name) is not None and not isinstance(getattr(self, name), str):
                require_sequence(name, getattr(self, name), "one value a floor, from below")
        n = len(self.masses)
        require(n > 0, "masses", value=None, allowed="one value a floor, from below")
        checked_number("gravity", self.gravity, least=0)
        sizes = dict.fromkeys(SYMBOLS, (0, n)) | {"second_moment": (1, n), "damping_ratio": (n,)}
        for name, symbol in {**SYMBOLS, **SINGLE}.items():
            values, parameter = getattr(self, name), of_storey_frame(symbol.format(""))
            if values is None:
                continue
            is_single = np.ndim(values) == 0 or name == "modulus"
            (checked_number if is_single else require_numbers)(name, values)
            for value in np.atleast_1d(values):
                allowed = parameter.range or "finite numbers"
                require(parameter.admits(value, value), name, value=f"{value:g}", allowed=allowed)
            if name in sizes and not (is_single and name in SINGLE):
                what, allowed = f"a list of {np.size(values)}", f"{n}, as masses has, from below"
                require(np.size(values) in sizes[name], name, value=what, allowed=allowed)
        require_choice("damper_placement", self.damper_placement, ("ground", "storey"))
        require_choice("rayleigh_of", self.rayleigh_of, ("initial", "tangent"))

    def _require_springs(self) -> None:
        names = ("modulus", "second_moment", "columns", "lengths")
        given = [x for x in names if getattr(self, x) is not None and np.size(getattr(self, x))]
        needed = ["modulus", "second_moment", "lengths"]
        if len(self.stiffness):
            beside, allowed = ", ".join(x for x in given if x != "lengths"), "either stiffness or"
            require(not beside, beside, value="there", allowed=f"{allowed} what makes it")
            needed = ["lengths"] if self.gravity else []
        for name in needed:
            example = {"lengths": "[3.0]", "modulus": "200e9", "second_moment": "1e-6"}[name]
            cure = f"give {name}, as {example} in SI"
            cure += "" if len(self.stiffness) else ", or stiffness, as [30e6]"
            require(name in given, name, value=None, allowed=SPRING_KEYS, cure=cure)
        has_force, has_drift = bool(len(self.yield_force)), bool(len(self.yield_drift))
        require(
            not has_force & has_drift,
            "yield_force",
            value="beside yield_drift",
            allowed="one of them",
            cure="leave out yield_drift: it is yield_force over stiffness",
        )
        if len(self.hardening):
            allowed = "one of them beside hardening"
            require(has_force | has_drift, "yield_force, yield_drift", value=None, allowed=allowed)

    @property
    def floors(self) -> int:
        """Number of floors n."""
        return len(self.masses)

    @property
    def moments(self) -> tuple[float, ...]:
        """Second moments of area: one for all storeys, one for each, or none beside stiffness."""
        return () if self.second_moment is None else tuple(np.atleast_1d(self.second_moment))

    @property
    def entry_roundings(self) -> int:
        """Roundings of a storey's stiffness 12 c E I / l³ and of the sum of two of them."""
        return 8

    @property
    def ratios(self) -> dict[str, float]:
        """Damping ratios by the names of their parameters; empty where there are none."""
        return _named("zeta{}", () if self.damping_ratio is None else self.damping_ratio)

    @cached_property
    def parameters(self) -> dict[str, float]:
        """Nominal values of all parameters by name, in SI units; of lists, one for each floor."""
        named: dict[str, float] = {} if self.modulus is None else {"E": self.modulus}
        named |= _named("I{}", self.moments)
        lists = ["stiffness", "masses", "lengths", "columns", "dampers", "q0", "v0"]
        for name in (*lists, "yield_force", "yield_drift", "hardening"):
            named |= _named(SYMBOLS[name], getattr(self, name), single=False)
        named |= zip(("rayleigh_mass", "rayleigh_stiffness"), self.rayleigh, strict=True)
        forces = zip(self.force_names, self.loads, strict=True)
        return named | self.ratios | {x: checked_number(x, y.amplitude) for x, y in forces}

    @property
    def force_names(self) -> tuple[str, ...]:
        """Names of the loads' amplitudes in their order: "F3", "F3_2" of a second one; "J3"."""
        names = list[str]()
        for force in self.loads:
            name = f"{'J' if force.history is None else 'F'}{force.at}"  # J of an impulse
            n_before = sum(x.partition("_")[0] == name for x in names)
            names.append(f"{name}_{n_before + 1}" if n_before else name)
        return tuple(names)

    @property
    def dynamics(self) -> Dynamics:
        """Linear, unless columns yield."""
        return Dynamics.YIELDING if self.hardening else Dynamics.LINEAR

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
        """Return the frame under forces on its floors, with the amplitudes `force_names`."""
        loads = [Force(force.place + 1, force.amplitude, force.history) for force in forces]
        frame = replace(self, loads=loads)
        return frame, frame.force_names

    def elastic(self) -> Self:
        """Return the frame with its initial stiffness, whose columns do not yield."""
        return replace(self, yield_force=(), yield_drift=(), hardening=(), rayleigh_of="initial")

    def require_dissipation(self, lowest: Mapping[str, float]) -> None:
        """Refuse nothing: the ranges of a frame's parameters have no negative damping."""

    def group(self, name: str) -> tuple[str, ...]:
        """The parameters that a short name stands for: "m" for m1 … mn; else itself."""
        patterns = [x for x in (*SYMBOLS.values(), "zeta{}") if x.format(1) in self.parameters]
        groups = {
            pattern.format("").replace("_", ""): [pattern.format(z + 1) for z in range(self.floors)]
            for pattern in patterns
        }
        groups |= {"F": list(self.force_names)} if self.loads else {}
        allowed = ", ".join([*groups, *self.parameters])
        require({name} <= {*groups, *self.parameters}, "parameter", value=name, allowed=allowed)
        return tuple(groups.get(name, [name]))

    def springs(self, p: Mapping[str, Number]) -> Number:
        """k_z of each storey (…, n), in N/m: as given, or 12 c E I / l³ of columns."""
        if self.stiffness:
            return self._of_floors("k{}", p)
        inertia = self._of_floors("I{}", p) if len(self.moments) > 1 else p["I"][..., None]
        rigidity = 12.0 * p["E"][..., None] * inertia  # 24 E I / l³ of two columns in section 6.1
        return rigidity * self._of_floors("c{}", p) * self._of_floors("l{}", p) ** -3

    def yield_drifts(self, p: Mapping[str, Number]) -> Number:
        """Drifts at which storeys yield, shape (…, n), in m."""
        if self.yield_drift:
            return self._of_floors("dy{}", p)
        return self._of_floors("fy{}", p) * self.springs(p) ** -1

    def hardenings(self, p: Mapping[str, Number]) -> Number:
        """Stiffness of yielding storeys over the initial one, shape (…, n)."""
        return self._of_floors("hardening{}", p)

    def softening(self, p: Mapping[str, Number]) -> Number:
        """P_z / l_z of storeys, shape (…, n), in N/m, P_z the weight of all floors above."""
        return self._masses_over_heights(p) * self.gravity

    def _masses_over_heights(self, p: Mapping[str, Number]) -> Number:
        """Mass of all floors above each storey over its height, shape (…, n), in kg/m."""
        # row i of the lower triangle adds the mass of floor i to storeys 1 … i
        above = self._of_floors("m{}", p).contract(np.tri(self.floors))
        return above * self.heights(p) ** -1

    def heights(self, p: Mapping[str, Number]) -> Number:
        """Heights l_z of storeys, shape (…, n), in m."""
        return self._of_floors("l{}", p)

    def assembly(self, p: Mapping[str, Number]) -> Assembly[Number]:
        """Matrices, rows and loads at parameters `p`, jets or Taylor models (eq. 23)."""
        n, links, names = self.floors, self.springs(p), self.force_names
        floors, storeys = diagonal(np.eye(n)), chain_matrix(np.eye(n))
        dashpots, unity = self._of_floors("d{}", p), p["rayleigh_mass"] * 0.0 + 1.0
        shears = [z if kind == "shear" else None for kind, z in map(self.quantity, self.outputs)]
        forces = np.array([np.eye(n)[int(force.at) - 1] for force in self.loads])
        rows: Array | Number
        rows, accelerated = np.split(self._rows, [2 * n], axis=1)
        if MOMENT in self.outputs:  # Σ_z l_z k_z (q_z − q_(z−1))
            drifts = np.zeros((n, len(self.outputs), 2 * n))
            drifts[:, self.outputs.index(MOMENT), :n] = np.eye(n) - np.eye(n, k=-1)
            rows = (links * self.heights(p)).contract(drifts) + rows
        return Assembly(
            mass=self._of_floors("m{}", p).contract(floors),
            springs=links.contract(storeys),
            weights=self.softening(p).contract(storeys) if self.gravity else None,
            dashpots=dashpots.contract(storeys if self.damper_placement == "storey" else floors),
            rayleigh=(p["rayleigh_mass"], p["rayleigh_stiffness"]),
            ratios=[p[name] for name in self.ratios],
            q0=self._of_floors("q{}_0", p),
            v0=self._of_floors("v{}_0", p),
            row_factors=stack([unity if z is None else links[..., z] for z in shears]),
            rows=rows,
            accelerated=accelerated,
            pattern=np.ones(n),
            massive=np.arange(n),
            loads=self.loads,
            columns=stack([p[x] for x in names])[..., None, :] * forces.T if names else None,
        )

    @cached_property
    def _rows(self) -> Array:
        """Coefficients of outputs on displacements, velocities and accelerations, shape (m, 3n)."""
        rows = np.zeros((len(self.outputs), 3 * self.floors))
        for row, (kind, z) in zip(rows, map(self.quantity, self.outputs), strict=True):
            if kind == MOMENT:  # whose row has parameters
                continue
            block = {"v": 1, "a": 2}.get(kind, 0)  # displacements, velocities, accelerations
            row[z + self.floors * block] = 1.0
            if kind in ("drift", "shear") and z:  # of shears the stiffness is a factor besides
                row[z - 1] = -1.0
        return rows

    def quantity(self, name: str) -> tuple[str, int]:
        """An output's kind, such as "drift", and its floor or storey, from 0; refuses others."""
        if name == MOMENT:
            allowed = "it beside lengths, the heights of the storeys"
            require(len(self.lengths) > 0, "output", value=name, allowed=allowed)
            return MOMENT, 0
        kinds = "q|v|a|drift|shear" + "|residual|ductility|dissipated" * bool(self.hardening)
        pattern = rf"({kinds})([1-9]\d*)"
        match = re.fullmatch(pattern, "shear1" if name == "base_shear" else name)
        kind, z = (match[1], int(match[2])) if match else ("", 0)
        words = f"{', '.join(kinds.split('|')[:-1])} or {kinds.split('|')[-1]}"
        allowed = f"{words} with a floor from 1 to {self.floors}, base_shear, {MOMENT}"
        require(0 < z <= self.floors, "output", value=name, allowed=allowed)
        return kind, z - 1

    def stability_coefficients(self, ends: Mapping[str, tuple[float, float]]) -> Array:
        """Return the largest P_z / (k_z l_z) of each storey in a box, P_z the weight above.

        Below 0.1 second-order effects may be neglected (EN 1998-1, 4.4.2.2, where the storey is
        elastic); from 1 on the storey buckles.

        Args:
            ends: Lower and upper end of parameters in SI units, by name; others are nominal.

        Returns:
            Shape (n,), with the frame's own gravity, or standard gravity if it has none.
        """
        worst = self._worst_storeys(ends)
        return (self.gravity or STANDARD_GRAVITY) * worst.mass_over_height / worst.stiffness

    def require_standing(self, ends: Mapping[str, tuple[float, float]]) -> None:
        """Refuse weights that buckle a storey somewhere in a box of parameters, by SI ends."""
        if not self.gravity:
            return
        # k − P / l of all storeys must be positive
        worst = self._worst_storeys(ends)
        softening = self.gravity * worst.mass_over_height
        for z, (k, soft) in enumerate(zip(worst.stiffness, softening, strict=True), start=1):
            allowed = f"more than weight over height, {soft:.5g} N/m"
            cure = "else it buckles: take stiffer storeys, lighter floors or narrower supports"
            key = f"stiffness of storey {z} under P-Delta"
            require(k > soft, key, value=f"{k:.5g} N/m", allowed=allowed, cure=cure)

    def _worst_storeys(self, ends: Mapping[str, tuple[float, float]]) -> _Storeys:
        """The storeys where k l / P is least in a box: stiffness low, mass high.

        The k of columns falls with the cube of the height, so that k l is least where it is high;
        the k of springs does not depend on it.
        """
        worst_when_high = "m" if self.stiffness else "ml"
        worst = {name: ends.get(name, (x, x)) for name, x in self.parameters.items()}
        p = {
            name: Jet.constant(np.array([high if name[0] in worst_when_high else low]), 0)
            for name, (low, high) in worst.items()
        }
        return _Storeys(self.springs(p).value[0], self._masses_over_heights(p).value[0])

    def _of_floors(self, pattern: str, p: Mapping[str, Number]) -> Number:
        """Parameters of all floors, shape (…, n)."""
        return stack([p[pattern.format(z + 1)] for z in range(self.floors)])


def yields(model: object) -> TypeGuard[StoreyFrame]:
    """Return whether an object is a frame whose columns yield."""
    return isinstance(model, StructureModel) and model.dynamics is Dynamics.YIELDING


def chain_matrix(links: Array) -> Array:
    """Matrices (…, n, n) of chains fixed at their lower end, from their links' coefficients."""
    at, matrix = np.arange(links.shape[-1]), diagonal(links)
    matrix[..., at[:-1], at[:-1]] += links[..., 1:]
    matrix[..., at[:-1], at[1:]] = matrix[..., at[1:], at[:-1]] = -links[..., 1:]
    return matrix


def diagonal(values: Array) -> Array:
    """Diagonal matrices (…, n, n)."""
    return values[..., None] * np.eye(values.shape[-1])


def _named(
    pattern: str, given: float | Sequence[float], *, single: bool = True
) -> dict[str, float]:
    """Values by names with numbers from 1 on; without one where a single value is for all."""
    values = np.ravel(given).tolist()
    numbers = [""] if single and len(values) == 1 else range(1, len(values) + 1)
    return {pattern.format(z): value for z, value in zip(numbers, values, strict=True)}
