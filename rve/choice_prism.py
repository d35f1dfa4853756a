"""The product-space model refined until E settles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from rve.cell import Phase
from rve.result import Homogenised
from stochastic import RadiusMap

_STEP = 2**0.5
_COARSEST, _FINEST = 0.3, 0.05  # mesh sizes
_LAYERS = 12
_RATES = {"space": 3.0, "theta": 3.0}  # of E in mesh size and layer height; quadratic wedges reach more


def refined_prism(radius_map: RadiusMap, matrix: Phase, inclusions: Sequence[Phase], *, tolerance: float) -> list[Homogenised]:
    """Results at the coarsest mesh and layers whose differences to the next coarser ones, carried on at order 3, are below `tolerance`.

    Raises:
        RuntimeError: The finest mesh leaves more.
    """
    from rve.prism import PrismModel

    def moduli(size: float, layers: int) -> list[Homogenised]:
        return PrismModel(mesh_size=size, layers=layers).solve(radius_map, matrix, inclusions)

    size, layers = _COARSEST, _LAYERS
    coarse = moduli(size, layers)
    while True:
        finer = moduli(size / _STEP, layers)
        thinner = moduli(size, layers * 3 // 2)
        space = [_carried(a, b, _STEP ** _RATES["space"]) for a, b in zip(coarse, finer, strict=True)]
        theta = [_carried(a, b, 1.5 ** _RATES["theta"]) * 1.5 ** _RATES["theta"] for a, b in zip(coarse, thinner, strict=True)]
        if max(s + t for s, t in zip(space, theta, strict=True)) <= tolerance:
            return [replace(r, error={"space": s, "theta": t}) for r, s, t in zip(finer, space, theta, strict=True)]
        if max(theta) > max(space):
            layers = layers * 3 // 2
            coarse = thinner
        else:
            size /= _STEP
            coarse = finer
        if size < _FINEST or layers > 100:
            raise RuntimeError(f"mesh size {size:.3g} with {layers} layers leaves a relative error of {max(space) + max(theta):.1e}")


def _carried(coarse: Homogenised, fine: Homogenised, gain: float) -> float:
    """Error of the finer of two results whose errors differ by the factor `gain`, doubled for safety."""
    return 2 * abs(coarse.modulus / fine.modulus - 1) / (gain - 1)
