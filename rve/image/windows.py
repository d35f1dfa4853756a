"""Windows of a material: a tiling's bracket, and the interval of the material.

For a tiling of a periodic cell the harmonic mean of the tiles' stiffnesses under uniform traction
(SUBC) and the arithmetic mean of those under uniform displacement (KUBC) bracket the cell's
stiffness (Huet 1990). A window of a larger material is another sample: its bracket bounds its own
apparent stiffness only, and the material's takes the scatter between tiles besides.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import stdtrit

from alphacut.rve.image.bounds import EQUAL, StiffnessBounds, inverse_below
from alphacut.rve.image.fields.energy import UNIT
from alphacut.stochastic.theta.truncated_normal import Array

CONFIDENCE = 0.95


@dataclass(frozen=True)
class Tiling:
    """Bounds of the tiles.

    Args:
        stiffness: Above each tile's stiffness under uniform displacement, shape (tiles, 3, 3), in
            Pa.
        compliance: Above each tile's compliance under uniform traction, shape (tiles, 3, 3), in
            1/Pa.
    """

    stiffness: Array
    compliance: Array

    @property
    def bracket(self) -> StiffnessBounds:
        """Bounds of the stiffness of the periodic cell that the tiles fill."""
        return StiffnessBounds(inverse_below(_mean(self.compliance)), _mean(self.stiffness))

    def material_modulus(self, confidence: float = CONFIDENCE) -> tuple[float, float]:
        """Confidence interval of E of eq. 16 of the material, from independent tiles.

        The bracket's ends, each moved out by t·s/√m, with s the scatter of E between m tiles to
        first order; ValueError where there is one tile only, or E may fall as A rises.
        """
        count = len(self.stiffness)
        if count < 2:
            raise ValueError("one tile has no scatter; divide the window into 2 × 2 tiles or more")
        bracket = self.bracket
        fewer = "fewer tiles (cell.tiles), so that each is larger, or " if count > 4 else ""
        others = "(cell.boundary periodic would bound the picture repeated, no larger material)"
        bracket.require_rising(f"take {fewer}a larger picture {others}")
        low, high = bracket.modulus
        softer = -bracket.lower @ (self.compliance - self.compliance.mean(axis=0)) @ bracket.lower
        stiffer = self.stiffness - self.stiffness.mean(axis=0)
        quantile = float(stdtrit(count - 1, (1 + confidence) / 2)) / np.sqrt(count)
        below, above = (
            quantile * float(np.std(_change(centre, changes), ddof=1))
            for centre, changes in ((bracket.lower, softer), (bracket.upper, stiffer))
        )
        return low - below, high + above


def tiles_of(image: Array, along: int) -> Array:
    """An image as tiles, (tiles, rows/along, columns/along); ValueError where it has none such."""
    rows, columns = image.shape
    if along < 1 or rows % along or columns % along or min(rows, columns) < 2 * along:
        raise ValueError(
            f"an image of {rows} × {columns} pixels has no {along} × {along} equal tiles of "
            "2 × 2 pixels or more; crop it or take another number"
        )
    blocks = image.reshape(along, rows // along, along, columns // along)
    return np.ascontiguousarray(blocks.swapaxes(1, 2).reshape(-1, rows // along, columns // along))


def _mean(matrices: Array) -> Array:
    """Mean of matrices, not below the true one in the Loewner order."""
    slack = 2 * len(matrices) * UNIT * np.abs(matrices).mean(axis=0).sum(axis=1)
    return np.asarray(matrices.mean(axis=0) + np.diag(slack))


def _change(centre: Array, changes: Array) -> Array:
    """First-order change of E of eq. 16 with changes of the stiffness, shape (…, 3, 3)."""
    shear, bulk = 2 * centre[2, 2], EQUAL @ centre @ EQUAL / 2
    by_shear, by_bulk = 1.5 - shear / bulk, (shear / bulk) ** 2 / 2
    return np.asarray(by_shear * 2 * changes[..., 2, 2] + by_bulk * (changes @ EQUAL) @ EQUAL / 2)
