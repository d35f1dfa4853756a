"""Random and fuzzy stress of the cell: p-box, quantiles, exceedance.

The mean stress of section 3.2 leaves out how the stress scatters with θ; every sample of the fuzzy
modulus holds the whole curve.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from alphacut.case.case import Case
from alphacut.fuzzy import RandomResponse
from alphacut.fuzzy.result import Bounds
from alphacut.fuzzy.sets.boxes import Domain
from alphacut.io.files import Document
from alphacut.stages.material.campaign import fuzzy_inputs
from alphacut.stages.material.cell import GPA
from alphacut.stages.material.modulus import CURVES
from alphacut.stochastic.theta.truncated_normal import Array

if TYPE_CHECKING:
    import xarray

GRID = 81  # stresses at which the p-box is stored
CUT = ("alpha", "bound")


def random_response(case: Case, modulus: xarray.Dataset) -> RandomResponse:
    """The wanted stress at every sample of the fuzzy modulus, whose curves over θ it holds."""
    curves, theta = modulus[CURVES[case.response.quantity][0]].values, modulus["theta"].values
    inputs = fuzzy_inputs(case)
    domain = Domain(
        {str(name): inputs[str(name)] for name in modulus["parameter"].values},
        tuple(map(float, modulus["alpha"].values)),
    )
    return RandomResponse.from_curves(
        domain,
        modulus["point"].values,
        curves,
        theta=theta,
        quantile=case.radius.distribution.quantile,
    )


def ends(result: Bounds) -> Array:
    """Lower and upper ends, shape (levels, 2, entries)."""
    return np.stack([result.lower, result.upper], axis=1)


def dataset(case: Case, modulus: xarray.Dataset) -> xarray.Dataset:
    """p-box, fuzzy mean and quantiles, and exceedance of a limit, by level, in SI."""
    import xarray

    wanted = case.response
    response, about = random_response(case, modulus), CURVES[wanted.quantity][1]
    stress = np.linspace(response.ordered.min(), response.ordered.max(), GRID)
    quantiles = response.quantile(wanted.quantiles)
    found = _cuts(response, quantiles, stress, about)
    if wanted.limit is not None:
        found["exceedance"] = (
            CUT,
            ends(response.exceedance(wanted.limit))[..., 0],
            {
                "units": "1",
                "long_name": f"probability that {about} exceeds the limit",
                "limit": wanted.limit,
            },
        )
    coordinates: dict[str, Any] = {
        "alpha": quantiles.alpha,
        "bound": ["lower", "upper"],
        "stress": ("stress", stress, {"units": "Pa"}),
        "probability": list(wanted.quantiles),
        "parameter": list(quantiles.inputs),
    }
    facts = {
        "quantity": wanted.quantity,
        "nature": str(quantiles.nature),
        "note": quantiles.notes[0],
        "mean_deviation": deviation(case, modulus, response),
    }
    return xarray.Dataset(found, coordinates, facts)


def _cuts(response: RandomResponse, quantiles: Bounds, stress: Array, about: str) -> dict[str, Any]:
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


def deviation(case: Case, modulus: xarray.Dataset, response: RandomResponse) -> float:
    """Largest relative difference of the stored curve's mean and the model's own."""
    own = modulus[f"{case.response.quantity}_sample"].values
    return float(np.abs(response.ordered.mean(axis=1) / own - 1).max())


def document(found: xarray.Dataset) -> Document:
    """The response as it is printed with ``--json``; stresses in GPa."""

    def cuts(name: str, unit: float = GPA, **place: float) -> Document:
        values = found[name].sel(place) if place else found[name]
        return {str(side): values.sel(bound=side).values / unit for side in ("lower", "upper")}

    numbers: dict[str, Any] = {
        **{name: found.attrs[name] for name in ("quantity", "nature", "note", "mean_deviation")},
        "alpha": found["alpha"].values,
        "mean_GPa": cuts("mean"),
        "quantiles": [
            {"probability": p, "GPa": cuts("quantile", probability=p)}
            for p in found["probability"].values
        ],
        "p_box": {"stress_GPa": found["stress"].values / GPA, **cuts("cdf", 1.0)},
    }
    if "exceedance" in found:
        numbers["exceedance"] = {
            "limit_GPa": found["exceedance"].attrs["limit"] / GPA,
            **cuts("exceedance", 1.0),
        }
    return numbers


def table(numbers: Document) -> list[tuple[str, ...]]:
    """Each fuzzy quantity with its lowest and highest cut, in words."""
    rows = [("mean", numbers["mean_GPa"], " GPa")]
    rows += [
        (f"quantile {entry['probability']:g}", entry["GPa"], " GPa")
        for entry in numbers["quantiles"]
    ]
    if limit := numbers.get("exceedance"):
        rows.append((f"probability of more than {limit['limit_GPa']:g} GPa", limit, ""))
    return [
        (
            name,
            *(
                f"[{ends['lower'][level]:.4f}, {ends['upper'][level]:.4f}]{unit}"
                for level in (0, -1)
            ),
        )
        for name, ends, unit in rows
    ]


def text(numbers: Document) -> str:
    """The response as a small table."""
    lines = [
        (f"{numbers['quantity']}", f"α = {numbers['alpha'][0]:g}", f"α = {numbers['alpha'][-1]:g}"),
        *table(numbers),
    ]
    return "".join(f"{name:<38}{low:<26}{high}\n" for name, low, high in lines)
