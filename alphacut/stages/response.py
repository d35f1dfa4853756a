"""Random and fuzzy stress of the cell: p-box, quantiles, exceedance.

The mean stress of section 3.2 leaves out how the stress scatters with θ; every sample of the fuzzy
modulus holds the whole curve.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from alphacut.fuzzy import RandomResponse
from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.result import Bounds as Cuts
from alphacut.fuzzy.sets.boxes import Domain
from alphacut.io.files import Document
from alphacut.stages.cell import GPA
from alphacut.stages.modulus import BOUNDS, CURVES, CUT, Campaign
from alphacut.stages.store import Stage, Work

if TYPE_CHECKING:
    import xarray

    from alphacut.case.material import Response

GRID = 81  # stresses at which the p-box is stored


def stage(section: Response, campaign: Campaign, modulus: xarray.Dataset) -> Stage:
    """The stage of the cell's random stress, from the samples of its modulus."""
    compute = partial(dataset, section, campaign, modulus)
    inputs = [section, modulus.attrs.get("fingerprint")]
    return Stage("response", inputs, ("stochastic", "fuzzy", "alphacut"), compute)


def random_response(
    section: Response, campaign: Campaign, modulus: xarray.Dataset
) -> RandomResponse:
    """The stress at every sample of the fuzzy modulus, whose curves over θ it holds."""
    curves, theta = modulus[CURVES[section.quantity]].values, modulus["theta"].values
    alpha, quantile = tuple(map(float, modulus["alpha"].values)), campaign.radius.law.quantile
    points, domain = modulus["point"].values, Domain(campaign.inputs, alpha)
    return RandomResponse.from_curves(domain, points, curves, theta=theta, quantile=quantile)


def dataset(
    section: Response, campaign: Campaign, modulus: xarray.Dataset, work: Work
) -> xarray.Dataset:
    """p-box, fuzzy mean and quantiles, and exceedance of a limit, by level, in SI."""
    import xarray

    response = random_response(section, campaign, modulus)
    about, quantiles = BOUNDS[section.quantity][1], response.quantile(section.quantiles)
    stress = np.linspace(response.ordered.min(), response.ordered.max(), GRID)
    variables: dict[str, Any] = {
        "mean": (CUT, ends(response.mean())[..., 0], {"units": "Pa"}),
        "cdf": ((*CUT, "stress"), ends(response.p_box(stress)), {"units": "1"}),
        "quantile": ((*CUT, "probability"), ends(quantiles), {"units": "Pa"}),
    }
    if section.limit is not None:
        over = ends(response.exceedance(section.limit))[..., 0]
        variables["exceedance"] = (CUT, over, {"units": "1", "limit": section.limit})
    coordinates: dict[str, Any] = {
        "alpha": quantiles.alpha,
        "bound": ["lower", "upper"],
        "stress": ("stress", stress, {"units": "Pa"}),
        "probability": list(section.quantiles),
    }
    facts = {"quantity": section.quantity, "about": about, "nature": str(quantiles.nature)}
    return xarray.Dataset(variables, coordinates, {**facts, "note": quantiles.notes[0]})


def ends(result: Cuts) -> Array:
    """Lower and upper ends, shape (levels, 2, entries)."""
    return np.stack([result.lower, result.upper], axis=1)


def document(variables: xarray.Dataset) -> Document:
    """The response as it is printed with ``--json``; stresses in GPa."""

    def cuts(name: str, unit: float = GPA, **place: float) -> Document:
        values = variables[name].sel(place) if place else variables[name]
        return {str(side): values.sel(bound=side).values / unit for side in ("lower", "upper")}

    numbers: dict[str, Any] = {
        **{name: variables.attrs[name] for name in ("quantity", "nature", "note")},
        "alpha": variables["alpha"].values,
        "mean_GPa": cuts("mean"),
        "quantiles": [
            {"probability": p, "GPa": cuts("quantile", probability=p)}
            for p in variables["probability"].values
        ],
    }
    if "exceedance" in variables:
        numbers["exceedance"] = {
            "limit_GPa": variables["exceedance"].attrs["limit"] / GPA,
            **cuts("exceedance", 1.0),
        }
    return numbers
