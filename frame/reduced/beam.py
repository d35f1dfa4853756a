"""Plane frames of Euler–Bernoulli beams, many storeys and bays."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from operator import itemgetter
from typing import Any

import numpy as np

from alphacut.frame.calculus.jet import Array
from alphacut.frame.reduced.reduction import AffineStructure
from alphacut.frame.structures.linear import Accelerogram


@dataclass(frozen=True, eq=False)
class BeamFrame:
    """Regular frame clamped at its foot, with uncertain moduli, floor mass and damping.

    Parameters: "E_columns", "E_columns_top" (upper half, with the middle one of an odd number of
    storeys; one storey has none), "E_beams", "mass" (of the floors, per length of beam),
    "rayleigh_mass", "rayleigh_stiffness", "zeta" where a damping ratio is given.
    Outputs: "roof" (displacement, m) and "drift" (of the first storey, m).

    Args:
        storeys: Number of storeys.
        bays: Number of bays.
        height: Storey height, in m.
        width: Width of a bay, in m.
        modulus: Young's modulus, in Pa.
        column: Area (m²) and second moment of area (m⁴) of a column.
        beam: The same of a beam.
        floor: Mass per length of beam, in kg/m.
        density: Density of the columns, in kg/m³.
        rayleigh: Damping factors, 1/s and s.
        ground: Base excitation.
        damping_ratio: ζ of all modes, beside Rayleigh's damping; None for none.

    Raises:
        ValueError: A count or quantity is not positive, the density negative, or the ratio outside
            [0, 1).
    """

    storeys: int
    bays: int
    height: float = 3.0
    width: float = 6.0
    modulus: float = 30e9
    column: tuple[float, float] = (0.49, 0.02)
    beam: tuple[float, float] = (0.24, 0.0072)
    floor: float = 12e3
    density: float = 2500.0
    rayleigh: tuple[float, float] = (0.05, 0.004)
    ground: Accelerogram | None = None
    damping_ratio: float | None = None

    def __post_init__(self) -> None:
        if not self.density >= 0:
            raise ValueError(f"density: {self.density:g} is not allowed; it must be 0 or greater")
        for name in ("storeys", "bays", "height", "width", "modulus", "floor"):
            if not getattr(self, name) > 0:
                raise ValueError(
                    f"{name}: {getattr(self, name):g} is not allowed; it must be positive"
                )
        if self.damping_ratio is not None and not 0 <= self.damping_ratio < 1:
            raise ValueError(
                f"damping_ratio: {self.damping_ratio:g} is not allowed; it must be 0 or greater and"
                " below 1"
            )

    def structure(self) -> AffineStructure:
        """The frame as an affine structure with 3 (bays + 1) storeys unknowns."""
        columns = [self._column(s, b) for s in range(self.storeys) for b in range(self.bays + 1)]
        half = max(self.storeys // 2, 1) * (self.bays + 1)
        beams = [self._beam(s, b) for s in range(1, self.storeys + 1) for b in range(self.bays)]
        stiff = [self._sum(part, 0) for part in (columns[:half], columns[half:], beams)]
        heavy = [self._sum(part, 1) for part in (columns, beams)]
        joints = self.bays + 1
        sway = np.zeros(3 * joints * self.storeys)
        sway[0::3] = 1.0
        roof, first = np.zeros_like(sway), np.zeros_like(sway)
        roof[3 * joints * (self.storeys - 1)], first[0] = 1.0, 1.0
        parameters = {
            "E_columns": self.modulus,
            **({"E_columns_top": self.modulus} if self.storeys > 1 else {}),
            "E_beams": self.modulus,
            "mass": self.floor,
        }
        parameters |= {"rayleigh_mass": self.rayleigh[0], "rayleigh_stiffness": self.rayleigh[1]}
        names = ("E_columns", "E_columns_top", "E_beams")
        if self.damping_ratio is not None:
            parameters["zeta"] = self.damping_ratio
        return AffineStructure(
            parameters,
            [(_one, heavy[0]), (itemgetter("mass"), heavy[1])],
            [(itemgetter(name), A) for name, A in zip(names, stiff, strict=True) if A.nnz],
            ("rayleigh_mass", "rayleigh_stiffness"),
            sway,
            {"roof": roof, "drift": first},
            self.ground,
            ratio=None if self.damping_ratio is None else "zeta",
        )

    def _column(self, storey: int, line: int) -> tuple[list[int], Array, Array]:
        area, moment = self.column
        foot, head = self._joint(storey, line), self._joint(storey + 1, line)
        return [*foot, *head], *_beam_matrices(
            self.height, area, moment, self.density * area, upright=True
        )

    def _beam(self, storey: int, bay: int) -> tuple[list[int], Array, Array]:
        area, moment = self.beam
        left, right = self._joint(storey, bay), self._joint(storey, bay + 1)
        return [*left, *right], *_beam_matrices(self.width, area, moment, 1.0, upright=False)

    def _joint(self, storey: int, line: int) -> list[int]:
        """Unknowns (x, y, rotation) of a joint; −1 at the clamped foot."""
        start = 3 * ((storey - 1) * (self.bays + 1) + line)
        return [start, start + 1, start + 2] if storey else [-1, -1, -1]

    def _sum(self, elements: list[tuple[list[int], Array, Array]], which: int) -> Any:
        from scipy.sparse import coo_array

        size = 3 * (self.bays + 1) * self.storeys
        index = np.array([e[0] for e in elements], int).reshape(-1, 6)
        blocks = np.array([e[1 + which] for e in elements]).reshape(-1, 6, 6)
        rows = np.repeat(index, 6, 1).reshape(-1, 6, 6)
        columns = np.tile(index[:, None, :], (1, 6, 1))
        kept = (rows >= 0) & (columns >= 0)
        return coo_array((blocks[kept], (rows[kept], columns[kept])), (size, size)).tocsr()


def _one(p: Mapping[str, Any]) -> float:
    return 1.0


def _beam_matrices(
    length: float, area: float, moment: float, line_mass: float, *, upright: bool
) -> tuple[Array, Array]:
    """Stiffness per unit modulus and consistent mass of a beam in global axes, each (6, 6)."""
    L, a, c = length, area / length, moment / length**3
    s, t = L, L * L
    bend = c * np.array(
        [
            [12, 6 * s, -12, 6 * s],
            [6 * s, 4 * t, -6 * s, 2 * t],
            [-12, -6 * s, 12, -6 * s],
            [6 * s, 2 * t, -6 * s, 4 * t],
        ]
    )
    heavy = [
        [156, 22 * s, 54, -13 * s],
        [22 * s, 4 * t, 13 * s, -3 * t],
        [54, 13 * s, 156, -22 * s],
        [-13 * s, -3 * t, -22 * s, 4 * t],
    ]
    inert = np.array(heavy)
    K, M = np.zeros((6, 6)), np.zeros((6, 6))
    along, across = [0, 3], [1, 2, 4, 5]
    K[np.ix_(along, along)] = a * np.array([[1, -1], [-1, 1]])
    M[np.ix_(along, along)] = line_mass * L / 6 * np.array([[2, 1], [1, 2]])
    K[np.ix_(across, across)], M[np.ix_(across, across)] = bend, line_mass * L / 420 * inert
    if upright:  # local (along, across) is global (y, −x)
        turn = np.kron(np.eye(2), np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]]))
        return turn.T @ K @ turn, turn.T @ M @ turn
    return K, M
