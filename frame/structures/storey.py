"""Plane storey frame: rigid floors on bending columns (section 6, Figs. 26, 27)."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from alphacut.frame.calculus.jet import Jet, stack
from alphacut.frame.structures.damping import modal_damping
from alphacut.frame.structures.linear import Matrices
from alphacut.frame.structures.quantities import Output
from alphacut.frame.structures.storey_checks import StoreyValues, check_values
from alphacut.frame.structures.storey_springs import (
    Ends,
    Entry,
    chain,
    require_standing,
    softening,
    springs,
)
from alphacut.fuzzy.refused import RefusedError


@dataclass(frozen=True)
class StoreyFrame(StoreyValues):
    """Chain of n floors with k_z = 12 c_z E I / l_z³ for c_z clamped columns (2 by default).

    Parameters that can be uncertain: "E", "I" or "I1" …, "m1" … "mn", "l1" …, "c1" … (columns of a
    storey), or "k1" … where stiffnesses are given (and "l1" … with gravity alone); "d1" …, "q1_0" …
    (initial displacements), "v1_0" … (initial velocities), "rayleigh_mass", "rayleigh_stiffness",
    and "zeta", or "zeta1" … where each mode has its own ratio.
    Outputs: "q1" … (displacement, m), "v1" … (velocity, m/s), "a1" … (absolute acceleration,
    m/s²), "ar1" … (acceleration relative to the ground, of trajectories and envelopes alone),
    "drift1" … (q_z − q_(z−1), m), "shear1" … (k_z drift_z, N); "base_shear" is "shear1".

    Args:
        masses: Floors from below, in kg.
        lengths: Column lengths per storey, in m; beside stiffness the storeys' heights, which
            gravity alone needs.
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
        ground: Base excitation, if any; displacements are then relative to the ground.
        damping_ratio: ζ of all modes, or one for each by rising frequency, added to the other
            damping; it follows the parameters through the modes (`frame.damping`).
        columns: Columns in each storey, each with the second moment I; where a storey's are
            stiffer, their number times that ratio. Two in each when empty.
        stiffness: Stiffness k_z of each storey, in N/m, in place of modulus, second moment and
            columns.
        gravity: Acceleration of gravity, in m/s², of the weights that reduce the stiffness of each
            storey to k_z − P_z / l_z, P_z that of all floors above it (P-Delta); 0 leaves them out.
            Rayleigh's damping and shears keep k_z.

    Raises:
        RefusedError: A length of the lists differs, a mass, length, modulus, moment, stiffness or
            number of columns is not positive, a damper or gravity is negative, a ratio is outside
            [0, 1), the weight buckles a storey, or a stiffness stands beside what makes one.
    """

    def __post_init__(self) -> None:
        check_values(self)
        n, names = len(self.masses), self.outputs or [f"q{z + 1}" for z in range(len(self.masses))]
        filled = {
            name: tuple(getattr(self, name)) or (0.0,) * n for name in ("dampers", "q0", "v0")
        }
        filled["damping_ratio"] = tuple(np.atleast_1d(self.damping_ratio).tolist())
        filled["stiffness"] = tuple(self.stiffness)
        if not filled["stiffness"]:
            filled["columns"] = tuple(self.columns) or (2.0,) * n
        for name, values in filled.items():
            object.__setattr__(self, name, values)
        object.__setattr__(self, "outputs", tuple(Output(str(name)) for name in names))
        for output in self.outputs:
            self._output(output)
        self.require_standing({})

    def require_standing(self, ends: Ends) -> None:
        """Refuse weights that buckle a storey somewhere in a box.

        Args:
            ends: Lower and upper end of parameters, in SI units; others keep their modal values.

        Raises:
            RefusedError: One does.
        """
        if self.gravity:
            at = {name: self._worst(name, *both) for name, both in self.ranges(ends).items()}
            require_standing(springs(self, at), softening(self, at))

    def _worst(self, name: str, low: float, high: float) -> Jet:
        """The end at which k_z l_z / P_z is least; with k_z of columns it falls with heights."""
        falling = "m" if self.stiffness else "ml"
        return Jet.constant(np.array([high if name[0] in falling else low]), 0)

    def ranges(self, ends: Ends) -> dict[str, tuple[float, float]]:
        """Lower and upper end of the values of floors and storeys over a box of parameters."""
        return {name: ends.get(name, (x, x)) for name, x in self.parameters.items()}

    @property
    def floors(self) -> int:
        """Number of floors n."""
        return len(self.masses)

    @property
    def parameters(self) -> dict[str, float]:
        """All parameters with their modal values, in SI units; of lists, one for each floor."""
        first: dict[str, float] = {} if self.modulus is None else {"E": self.modulus}
        if len(self.moments) == 1:
            first["I"] = self.moments[0]
        several = self.moments if len(self.moments) > 1 else ()
        pressed = not self.stiffness or self.gravity
        lists = {
            "I{}": several,
            "k{}": self.stiffness,
            "m{}": self.masses,
            "l{}": self.lengths if pressed else (),
            "c{}": self.columns,
            "d{}": self.dampers,
            "q{}_0": self.q0,
            "v{}_0": self.v0,
        }
        named = {
            pattern.format(z + 1): float(x)
            for pattern, values in lists.items()
            for z, x in enumerate(values)
        }
        damping = {"rayleigh_mass": self.rayleigh[0], "rayleigh_stiffness": self.rayleigh[1]}
        return {**first, **named, **damping, **self.ratios}

    def group(self, name: str) -> tuple[str, ...]:
        """Parameters of a short name: "m" is m1 … mn; any other name is itself.

        Raises:
            RefusedError: The name is neither a group nor a parameter.
        """
        patterns = {"m": "m{}", "d": "d{}", "q0": "q{}_0", "v0": "v{}_0"}
        patterns |= {x: x + "{}" for x in "klcI" if f"{x}1" in self.parameters}
        if name in patterns:
            return tuple(patterns[name].format(z + 1) for z in range(self.floors))
        if name == "zeta" and self.ratios:
            return tuple(self.ratios)
        if name not in self.parameters:
            raise RefusedError("parameter", name, ", ".join([*patterns, *self.parameters]))
        return (name,)

    def matrices(self, p: Mapping[str, Jet]) -> Matrices:
        """M, D, K and the initial state, at S parameter sets."""
        n = self.floors
        mass = stack([[p[f"m{i + 1}"] if i == j else 0.0 for j in range(n)] for i in range(n)], p)
        dampers: list[Entry] = [p[f"d{z + 1}"] for z in range(n)]
        links = springs(self, p)
        elastic = stack(chain(links), p)
        if self.damper_placement == "storey":
            damping = stack(chain(dampers), p)
        else:
            damping = stack(
                [[dampers[i] if i == j else 0.0 for j in range(n)] for i in range(n)], p
            )
        if any(
            p[name].value.any() or p[name].first.any()
            for name in ("rayleigh_mass", "rayleigh_stiffness")
        ):
            damping = (
                damping
                + p["rayleigh_mass"][:, None, None] * mass
                + p["rayleigh_stiffness"][:, None, None] * elastic
            )
        stiffness = elastic
        if self.gravity:
            taken = softening(self, p)
            require_standing(links, taken)
            stiffness = elastic - stack(chain(taken), p)
        if self.ratios:
            damping = damping + modal_damping(mass, stiffness, [p[name] for name in self.ratios])
        q0, v0 = (stack([[p[f"{x}{z + 1}_0"]] for z in range(n)], p) for x in "qv")
        return Matrices(mass, damping, stiffness, q0, v0)

    def observation(self, p: Mapping[str, Jet]) -> Jet:
        """Rows C(p) with output = C(p) [q; v], shape (S, outputs, 2n)."""
        kinds = [self._output(output) for output in self.outputs]
        links = springs(self, p) if any(kind == "shear" for kind, _ in kinds) else []
        at = self.matrices(p) if any(kind in ("a", "ar") for kind, _ in kinds) else None
        rows: list[list[Entry]] = []
        for kind, z in kinds:
            if kind in ("a", "ar"):
                assert at is not None
                rows.append(self._acceleration(at, p, z))
                continue
            row: list[Entry] = [0.0] * (2 * self.floors)
            factor: Entry = links[z] if kind == "shear" else 1.0
            row[z + self.floors * (kind == "v")] = factor
            if kind in ("drift", "shear") and z > 0:
                row[z - 1] = -factor
            rows.append(row)
        return stack(rows, p)

    def _acceleration(self, at: Matrices, p: Mapping[str, Jet], z: int) -> list[Entry]:
        """Row of a floor's absolute acceleration: forces on it over its mass."""
        inertia = -1.0 * p[f"m{z + 1}"] ** -1
        forces = (at.stiffness, at.damping)
        return [inertia * force[:, z, j] for force in forces for j in range(self.floors)]

    def _output(self, name: str) -> tuple[str, int]:
        found = re.fullmatch(
            r"(q|v|ar|a|drift|shear)([1-9]\d*)", "shear1" if name == "base_shear" else name
        )
        if not found or int(found[2]) > self.floors:
            kinds = "q, v, a, ar, drift or shear with a floor"
            raise RefusedError("output", name, f"{kinds} from 1 to {self.floors}, base_shear")
        return found[1], int(found[2]) - 1
