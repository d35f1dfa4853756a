"""α-cuts of the cell's loss factors, from those of its phases level by level."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Self

import numpy as np

from alphacut.fuzzy import Crisp, FuzzyNumber
from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.result import Nature
from alphacut.rve.result.loss_factors import (
    CONSTANTS,
    MAX_FIRST_ORDER,
    bulk_and_shear_losses,
    loss_factors,
)
from alphacut.rve.result.result import HomogenisedStiffness
from alphacut.stages.store import CutsResult, Numbers


class LossResult(Numbers):
    """α-cuts of the loss factors of E, G and K; their errors by name, where they are declared."""

    E: CutsResult
    G: CutsResult
    K: CutsResult
    error: dict[str, float]
    nature: Nature

    @classmethod
    def of(
        cls, cuts: Mapping[str, Array], errors: Mapping[str, float], nature: Nature
    ) -> LossResult:
        """The result of cuts (levels, 2) by the names of `CONSTANTS`."""
        named = {name: CutsResult.of(cuts[name]) for name in CONSTANTS}
        return cls(**named, error=dict(errors), nature=nature)


Losses = tuple[FuzzyNumber, FuzzyNumber | None]
"""Loss factor of a phase's Young's modulus, and of its bulk modulus where that is another."""


@dataclass(frozen=True, eq=False)
class LossCuts:
    """Cuts of the phases' loss factors.

    Args:
        bounds: Of Young's and of the bulk modulus, shape (levels, 2, phases, 2); 0 where the
            bulk modulus has no loss factor of its own.
        has_bulk: Whether it has, for each phase.
    """

    bounds: Array
    has_bulk: tuple[bool, ...]

    @classmethod
    def from_phases(cls, losses: Sequence[Losses], alpha: Sequence[float]) -> Self:
        """Cuts of the phases' fuzzy loss factors on some levels."""
        pairs = [(young, bulk or Crisp(0.0)) for young, bulk in losses]
        cuts = [[[young.cut(x), bulk.cut(x)] for young, bulk in pairs] for x in alpha]
        has_bulk = tuple(bulk is not None for _, bulk in losses)
        return cls(np.moveaxis(np.array(cuts), -1, 1), has_bulk)  # the ends after the levels

    def corners(self, fractions: Array, to_moduli: Array) -> Array:
        """Phases' loss factors where those of E, G and K are least and greatest, to first order.

        Args:
            fractions: ∂ln c/∂ln X by X = K and G of each phase, shape (phases, 2, 3).
            to_moduli: Loss factors of K and G from those of Young's and the bulk modulus, shape
                (phases, 2, 2).

        Returns:
            Of K and G of the phases, shape (levels, 2, 3, phases, 2).
        """
        # level l, end e, constant c (E, G, K), phase p, modulus x (K, G), loss factor j (η_E, η_K)
        slopes = np.einsum("pxj,pxc->cpj", to_moduli, fractions)
        lower, upper = np.moveaxis(self.bounds[:, :, None], 1, 0)
        least, most = np.where(slopes >= 0, lower, upper), np.where(slopes >= 0, upper, lower)
        return np.asarray(np.einsum("pxj,elcpj->lecpx", to_moduli, np.array([least, most])))


def loss_bounds(result: HomogenisedStiffness, cuts: LossCuts) -> tuple[Array, Array]:
    """Bounds of the loss factors of E, G and K, (levels, 2, 3), and their largest errors, (3,)."""
    assert result.energies is not None
    fractions, _ = result.energies.energy_fractions(result.constants_of)
    # phases of a mesh, whose result knows no cell, have no bulk losses of their own
    phases = (None,) * len(cuts.has_bulk) if result.cell is None else result.cell.phases
    pairs = zip(phases, cuts.has_bulk, strict=True)
    corners = cuts.corners(fractions, np.array([bulk_and_shear_losses(*pair) for pair in pairs]))
    errors = [loss_factors(result, corners[0, 1, k]).errors[x] for k, x in enumerate(CONSTANTS)]
    if corners.max() <= MAX_FIRST_ORDER:  # letters as in `LossCuts.corners`
        return np.einsum("lecpx,pxc->lec", corners, fractions), np.array(errors)
    bounds = np.empty(corners.shape[:3])
    for corner in product(*map(range, bounds.shape)):
        bounds[corner] = loss_factors(result, corners[corner]).values[CONSTANTS[corner[-1]]]
    return bounds, np.array(errors)
