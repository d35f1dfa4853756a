"""All engineering constants of a homogenised cell in one place."""

from __future__ import annotations

from alphacut.rve.result.engineering_constants import FREE, NAMES, engineering_constants
from alphacut.rve.result.result import DeclaredConstants, HomogenisedStiffness
from alphacut.rve.series.fibre_constants import fibre_constants


def constants(result: HomogenisedStiffness) -> DeclaredConstants:
    """Return the engineering constants of a cell by name, moduli in Pa, with their declared errors.

    All results have E and nu of their average. Round fibres in a matrix have E_T, E_L, nu_LT, G_T,
    G_L and K_T, across (T) and along (L) the fibres. A plane stiffness has E_x, E_y, nu_xy and G_xy
    in plane strain; two isotropic phases have E_x_free and so on as well, without stress along the
    fibres.

    Args:
        result: Result of any model.

    Returns:
        `values` and absolute `errors`, NaN where the result declares none.

    Example:
        >>> from alphacut.rve import Phase, SeriesModel
        >>> from alphacut.stochastic import HermiteMap
        >>> radius = HermiteMap(0.2, 0.1, 0.6, 0.1)
        >>> [cell] = SeriesModel().solve(radius, Phase(20e9), [Phase(80e9)])
        >>> f"{constants(cell).values['E_L'] / 1e9:.3f} GPa"
        '27.865 GPa'
    """
    values = {"E": result.modulus, "nu": result.poisson}
    errors = {"E": result.estimated_error * result.modulus, "nu": result.poisson_error}
    if result.is_of_fibres:
        of_fibres = fibre_constants(result)
        values |= of_fibres.values
        errors |= of_fibres.errors
    # Both definitions of the constants along x and y have the same names but for the ending.
    for definition, plane in engineering_constants(result).items():
        names = [f"{name}_free" if definition == FREE else name for name in NAMES]
        values |= dict(zip(names, map(float, plane.values), strict=True))
        errors |= dict(zip(names, map(float, plane.errors), strict=True))
    return DeclaredConstants(values, errors)
