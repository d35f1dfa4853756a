"""Hashin–Shtrikman interval of the three-dimensional isotropic composite of the same phases.

An image read as plane strain is the section of a prismatic material: fibres. If its particles are
grains, this interval bounds what the solid can be (Hashin and Shtrikman 1963; Walpole 1966 where
the phases have no order).
"""

from __future__ import annotations

from collections.abc import Sequence

from alphacut.rve.image.moduli import PlaneModuli


def grain_modulus(
    fractions: Sequence[float], softest: Sequence[PlaneModuli], stiffest: Sequence[PlaneModuli]
) -> tuple[float, float]:
    """Bounds of Young's modulus of an isotropic solid of grains, in Pa.

    Args:
        fractions: Share of each phase, sum 1.
        softest: Least moduli of each phase.
        stiffest: Greatest moduli of each phase.
    """
    ends = []
    for phases, pick in ((softest, min), (stiffest, max)):
        pairs = [(p.bulk - p.shear / 3, p.shear) for p in phases]
        bulk, shear = pick(k for k, _ in pairs), pick(g for _, g in pairs)
        about_bulk = 4 / 3 * shear
        about_shear = shear * (9 * bulk + 8 * shear) / (6 * (bulk + 2 * shear))
        k, g = (
            1 / sum(f / (value + around) for f, value in zip(fractions, values, strict=True))
            - around
            for values, around in (
                ([k for k, _ in pairs], about_bulk),
                ([g for _, g in pairs], about_shear),
            )
        )
        ends.append(9 * k * g / (3 * k + g))
    return ends[0], ends[1]
