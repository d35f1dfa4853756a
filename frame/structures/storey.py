"""Plane storey frame: rigid floors on bending columns (section 6, Figs. 26, 27)."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, cast

import numpy as np

from alphacut.frame.calculus.jet import Jet, stack
from alphacut.frame.calculus.numbers import require_number, require_numbers
from alphacut.frame.structures.damping import modal_damping
from alphacut.frame.structures.linear import Accelerogram, Matrices

Entry = Jet | float
UNITS = {
    "masses": "kg",
    "lengths": "m",
    "modulus": "Pa",
    "second_moment": "m⁴",
    "dampers": "N s/m",
    "q0": "m",
    "v0": "m/s",
}
UNITS |= {
    "rayleigh": "1/s and s",
    "damping_ratio": "shares of the critical damping",
    "columns": "columns of each storey",
}


@dataclass(frozen=True)
class StoreyFrame:
    """Chain of n floors with k_z = 12 c_z E I / l_z³ for c_z clamped columns (2 by default).

    Parameters that can be uncertain: "E", "I", "m1" … "mn", "l1" …, "c1" … (columns of a storey),
    "d1" …, "q1_0" … (initial displacements), "v1_0" … (initial velocities), "rayleigh_mass",
    "rayleigh_stiffness", and "zeta", or "zeta1" … where each mode has its own ratio.
    Outputs: "q1" … (displacement, m), "v1" … (velocity, m/s), "a1" … (absolute acceleration,
    m/s²), "drift1" … (q_z − q_(z−1), m), "shear1" … (k_z drift_z, N); "base_shear" is "shear1".

    Args:
        masses: Floors from below, in kg.
        lengths: Column lengths per storey, in m.
        modulus: Young's modulus E, in Pa.
        second_moment: Second moment of area I of one column, in m⁴.
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

    Raises:
        ValueError: A length of the lists differs, a mass, length, modulus, moment or number of
            columns is not positive, a damper is negative, or a ratio is outside [0, 1).
    """

    masses: Sequence[float]
    lengths: Sequence[float]
    modulus: float
    second_moment: float
    dampers: Sequence[float] = ()
    damper_placement: Literal["ground", "storey"] = "ground"
    q0: Sequence[float] = ()
    v0: Sequence[float] = ()
    outputs: tuple[str, ...] = ()
    rayleigh: tuple[float, float] = (0.0, 0.0)
    ground: Accelerogram | None = None
    damping_ratio: float | Sequence[float] = ()
    columns: Sequence[float] = ()

    def __post_init__(self) -> None:
        self._check_numbers()
        n = len(self.masses)
        single = np.ndim(self.damping_ratio) == 0
        object.__setattr__(
            self,
            "damping_ratio",
            (self.damping_ratio,) if single else tuple(cast(Sequence[float], self.damping_ratio)),
        )
        for name in ("dampers", "q0", "v0"):
            object.__setattr__(self, name, tuple(getattr(self, name)) or (0.0,) * n)
        object.__setattr__(self, "columns", tuple(self.columns) or (2.0,) * n)
        object.__setattr__(
            self, "outputs", tuple(self.outputs) or tuple(f"q{z + 1}" for z in range(n))
        )
        self._check()

    def _check_numbers(self) -> None:
        for name, unit in UNITS.items():
            value = getattr(self, name)
            single = name in ("modulus", "second_moment") or (
                name == "damping_ratio" and np.ndim(value) == 0
            )
            (require_number if single else require_numbers)(name, value, unit)

    def _check(self) -> None:
        n = len(self.masses)
        for name in ("lengths", "dampers", "q0", "v0", "columns"):
            if len(getattr(self, name)) != n:
                raise ValueError(
                    f"{name}: {len(getattr(self, name))} values for {n} floors; give one per floor,"
                    " from below"
                )
        positive = {
            "masses": self.masses,
            "lengths": self.lengths,
            "modulus": [self.modulus],
            "second_moment": [self.second_moment],
        }
        positive["columns"] = self.columns
        for name, values in positive.items():
            for value in values:
                if not (value > 0 and np.isfinite(value)):
                    raise ValueError(
                        f"{name}: {value:g} is not allowed; it must be positive and finite"
                    )
        for name, values in {"dampers": self.dampers, "rayleigh": self.rayleigh}.items():
            for value in values:
                if not (value >= 0 and np.isfinite(value)):
                    raise ValueError(
                        f"{name}: {value:g} is not allowed; damping must not be negative"
                    )
        for value in self.ratios.values():
            if not 0 <= value < 1:
                raise ValueError(
                    f"damping_ratio: {value:g} is not allowed; it must be 0 or greater and below 1,"
                    " the critical damping"
                )
        if len(self.ratios) not in (0, 1, n):
            raise ValueError(
                f"damping_ratio: {len(self.ratios)} values for {n} modes; give one for all modes,"
                f" or {n}, by rising frequency"
            )
        if self.damper_placement not in ("ground", "storey"):
            raise ValueError(
                f"damper_placement: '{self.damper_placement}' is unknown; allowed are 'ground' and"
                " 'storey'"
            )
        for output in self.outputs:
            self._output(output)

    @property
    def floors(self) -> int:
        """Number of floors n."""
        return len(self.masses)

    @property
    def ratios(self) -> dict[str, float]:
        """Damping ratios by the names of their parameters; empty where there are none."""
        values = np.atleast_1d(self.damping_ratio)
        return {
            "zeta" if len(values) == 1 else f"zeta{k + 1}": float(x) for k, x in enumerate(values)
        }

    @property
    def parameters(self) -> dict[str, float]:
        """All parameters with their modal values, in SI units."""
        lists = {
            "m{}": self.masses,
            "l{}": self.lengths,
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
        return {"E": self.modulus, "I": self.second_moment, **named, **damping, **self.ratios}

    def group(self, name: str) -> tuple[str, ...]:
        """Parameters of a short name: "m" is m1 … mn; any other name is itself.

        Raises:
            ValueError: The name is neither a group nor a parameter.
        """
        patterns = {"m": "m{}", "l": "l{}", "c": "c{}", "d": "d{}", "q0": "q{}_0", "v0": "v{}_0"}
        if name in patterns:
            return tuple(patterns[name].format(z + 1) for z in range(self.floors))
        if name == "zeta" and self.ratios:
            return tuple(self.ratios)
        if name not in self.parameters:
            raise ValueError(
                f"uncertain parameter '{name}' is unknown; known are"
                f" {', '.join([*patterns, *self.parameters])}"
            )
        return (name,)

    def matrices(self, p: Mapping[str, Jet]) -> Matrices:
        """M, D, K and the initial state, at S parameter sets."""
        n = self.floors
        mass = stack([[p[f"m{i + 1}"] if i == j else 0.0 for j in range(n)] for i in range(n)], p)
        dampers: list[Entry] = [p[f"d{z + 1}"] for z in range(n)]
        chain = stack(_chain(self._columns(p)), p)
        if self.damper_placement == "storey":
            damping = stack(_chain(dampers), p)
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
                + p["rayleigh_stiffness"][:, None, None] * chain
            )
        if self.ratios:
            damping = damping + modal_damping(mass, chain, [p[name] for name in self.ratios])
        q0, v0 = (stack([[p[f"{x}{z + 1}_0"]] for z in range(n)], p) for x in "qv")
        return Matrices(mass, damping, chain, q0, v0)

    def observation(self, p: Mapping[str, Jet]) -> Jet:
        """Rows C(p) with output = C(p) [q; v], shape (S, outputs, 2n)."""
        columns = self._columns(p)
        rows: list[list[Entry]] = []
        for output in self.outputs:
            kind, z = self._output(output)
            if kind == "a":
                rows.append(self._acceleration(p, z))
                continue
            row: list[Entry] = [0.0] * (2 * self.floors)
            factor: Entry = columns[z] if kind == "shear" else 1.0
            row[z + self.floors * (kind == "v")] = factor
            if kind in ("drift", "shear") and z > 0:
                row[z - 1] = -factor
            rows.append(row)
        return stack(rows, p)

    def _acceleration(self, p: Mapping[str, Jet], z: int) -> list[Entry]:
        """Row of a floor's absolute acceleration: forces on it over its mass."""
        at, inertia = self.matrices(p), -1.0 * p[f"m{z + 1}"] ** -1
        forces = (at.stiffness, at.damping)
        return [inertia * force[:, z, j] for force in forces for j in range(self.floors)]

    def _columns(self, p: Mapping[str, Jet]) -> list[Entry]:
        # k_z; 24 E I / l³ in section 6.1
        rigidity = 12 * p["E"] * p["I"]
        return [rigidity * p[f"c{z + 1}"] * p[f"l{z + 1}"] ** -3 for z in range(self.floors)]

    def _output(self, name: str) -> tuple[str, int]:
        found = re.fullmatch(
            r"(q|v|a|drift|shear)([1-9]\d*)", "shear1" if name == "base_shear" else name
        )
        if not found or int(found[2]) > self.floors:
            raise ValueError(
                f"output '{name}' is unknown; allowed are q, v, a, drift or shear with a floor"
                f" from 1 to {self.floors}, base_shear"
            )
        return found[1], int(found[2]) - 1


def _chain(links: Sequence[Entry]) -> list[list[Entry]]:
    """Matrix of a chain fixed at its lower end from the coefficients of its links."""
    n = len(links)
    rows: list[list[Entry]] = [[0.0] * n for _ in range(n)]
    for i in range(n):
        rows[i][i] = links[i] + links[i + 1] if i + 1 < n else links[i]
        if i + 1 < n:
            rows[i][i + 1] = rows[i + 1][i] = -1.0 * links[i + 1]
    return rows
