"""Random and fuzzy stress of the cell: p-box, quantiles, exceedance.

The mean stress of section 3.2 leaves out how the stress scatters with θ; every sample of the fuzzy
modulus holds the whole curve.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from alphacut.fuzzy import RandomResponse
from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.result import Bounds as Cuts
from alphacut.fuzzy.sets.boxes import Domain
from alphacut.io.files import Document
from alphacut.stages.cell import GPA
from alphacut.stages.modulus import BOUNDS, CURVES, Campaign
from alphacut.stages.store import Stage, Work

if TYPE_CHECKING:
    import xarray

    from alphacut.case.material import Response

GRID = 81  # stresses at which the p-box is stored
CUT = ("alpha", "bound")


def stage(section: Response, campaign: Campaign, modulus: xarray.Dataset) -> Stage:
    """The stage of the cell's random stress, from the samples of its modulus."""

    def compute(work: Work) -> xarray.Dataset:
        return dataset(section, campaign, modulus)

    inputs = [section, modulus.attrs.get("fingerprint")]
    return Stage("response", inputs, ("stochastic", "fuzzy", "alphacut"), compute)


def random_response(
    section: Response, campaign: Campaign, modulus: xarray.Dataset
) -> RandomResponse:
    """The stress at every sample of the fuzzy modulus, whose curves over θ it holds."""
    curves, theta = modulus[CURVES[section.quantity]].values, modulus["theta"].values
    domain = Domain(
        {str(name): campaign.inputs[str(name)] for name in modulus["parameter"].values},
        tuple(map(float, modulus["alpha"].values)),
    )
    quantile = campaign.task.law.quantile
    return RandomResponse.from_curves(
        domain, modulus["point"].values, curves, theta=theta, quantile=quantile
    )


def ends(result: Cuts) -> Array:
    """Lower and upper ends, shape (levels, 2, entries)."""
    return np.stack([result.lower, result.upper], axis=1)


def dataset(section: Response, campaign: Campaign, modulus: xarray.Dataset) -> xarray.Dataset:
    """p-box, fuzzy mean and quantiles, and exceedance of a limit, by level, in SI."""
    import xarray

    response = random_response(section, campaign, modulus)
    about = BOUNDS[section.quantity][1]
    stress = np.linspace(response.ordered.min(), response.ordered.max(), GRID)
    quantiles = response.quantile(section.quantiles)
    variables = _cuts(response, quantiles, stress, about)
    if section.limit is not None:
        variables["exceedance"] = (
            CUT,
            ends(response.exceedance(section.limit))[..., 0],
            {
                "units": "1",
                "long_name": f"probability that {about} exceeds the limit",
                "limit": section.limit,
            },
        )
    coordinates: dict[str, Any] = {
        "alpha": quantiles.alpha,
        "bound": ["lower", "upper"],
        "stress": ("stress", stress, {"units": "Pa"}),
        "probability": list(section.quantiles),
        "parameter": list(quantiles.inputs),
    }
    facts = {
        "quantity": section.quantity,
        "nature": str(quantiles.nature),
        "note": quantiles.notes[0],
    }
    return xarray.Dataset(variables, coordinates, facts)


def _cuts(response: RandomResponse, quantiles: Cuts, stress: Array, about: str) -> dict[str, Any]:
    """Variables with the fuzzy mean, the p-box at `stress` and the quantiles."""

    def words(what: str, unit: str = "Pa") -> dict[str, str]:
        return {"units": unit, "long_name": f"{what} of {about}"}

    places = np.stack([quantiles.lower_at, quantiles.upper_at], axis=1)
    return {
        "mean": (CUT, ends(response.mean())[..., 0], words("mean")),
        "cdf": (
            (*CUT, "stress"),
            ends(response.p_box(stress)),
            words("distribution function", "1"),
        ),
        "quantile": ((*CUT, "probability"), ends(quantiles), words("quantile")),
        "quantile_at": (
            (*CUT, "probability", "parameter"),
            places,
            {"long_name": "inputs that reach it, in SI"},
        ),
    }


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
        "p_box": {"stress_GPa": variables["stress"].values / GPA, **cuts("cdf", 1.0)},
    }
    if "exceedance" in variables:
        numbers["exceedance"] = {
            "limit_GPa": variables["exceedance"].attrs["limit"] / GPA,
            **cuts("exceedance", 1.0),
        }
    return numbers
