"""The numbers of a microstructure as JSON, as a fragment of a case file, and as a dataset."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from alphacut.stochastic.microstructure import Microstructure
from alphacut.stochastic.tessellation.apollonius import neighbouring_values, neighbours

if TYPE_CHECKING:
    import xarray

CRISP_TOLERANCE = 1e-6  # of a3 − a1: an end nearer to the fitted slope differs by round-off


def summary(result: Microstructure) -> dict[str, object]:
    """All numbers of a microstructure study by the keys of its JSON file, lengths in m."""
    packings = [section.particles for section in result.sections]
    radii = np.concatenate([packing.radii for packing in packings])
    shape = result.study.shape
    cell_fraction = float(result.sample.weights @ shape.fractions(result.sample.values))  # eq. 10
    numbers: dict[str, object] = {
        "particles": shape.particles,
        "packings": len(packings),
        shape.particles: len(radii),
        f"{shape.cells}_fraction": float(np.mean([packing.fraction for packing in packings])),
        f"{shape.cells}_fraction_of_cells": cell_fraction,
        f"mean_{shape.cells}_fraction_of_map": result.fraction_of_map,
        "fraction_of_case": result.stated_fraction,
        "smallest_radius": float(radii.min()),
        "largest_radius": float(radii.max()),
        "share_capped": result.share_capped,
    }
    neighbour_numbers, map_numbers = _neighbour_numbers(result), _map_numbers(result)
    return numbers | neighbour_numbers | map_numbers | {"radius": radius_section(result)}


def _neighbour_numbers(result: Microstructure) -> dict[str, object]:
    """Number and distances of direct neighbours, and correlation of r_n; empty for spheres."""
    diagrams = [section.diagram for section in result.sections if section.diagram]
    if not diagrams:
        return {}
    direct = [neighbours(diagram.discs) for diagram in diagrams]
    number = np.concatenate([found.number for found in direct])
    distance = np.concatenate([found.distances for found in direct])
    sharing = [neighbouring_values(diagram, diagram.reduced_radii) for diagram in diagrams]
    return {
        "neighbours": {
            "counted": len(number),
            "mean": float(number.mean()) if len(number) else None,
            "mean_distance": float(distance.mean()) if len(distance) else None,
        },
        "correlation": float(np.mean([np.corrcoef(pairs)[0, 1] for pairs in sharing])),
    }


def _map_numbers(result: Microstructure) -> dict[str, object]:
    """Numbers of the sample of r_n, of the fuzzy map, and how far the sample leaves its p-box."""
    pbox, sample = result.pbox, result.sample
    return {
        "cells": len(sample.values),
        "mean_r_n": sample.mean,
        "largest_r_n": float(sample.values[-1]),
        "limits": list(result.limits),
        "share_kept": result.share_within,
        "a1": pbox.fit.a1,
        "a2": list(pbox.a2),
        "a3": pbox.fit.a3,
        "a4": list(pbox.a4),
        "a2_band": list(result.slopes.a2),
        "a4_band": list(result.slopes.a4),
        "band": result.band,
        "pbox_area": pbox.area,
        "pbox_breach": pbox.excess(result.truncated),
        "misfit": pbox.fit.misfit(result.truncated, (pbox.a2[1], pbox.a4[1])),
        "seed": result.study.seed,
    }


def radius_section(result: Microstructure) -> dict[str, list[float] | float]:
    """The case section [radius] as a mapping: ends of θ, a1, a3 and fuzzy a2, a4."""
    box, law = result.pbox, result.pbox.fit.distribution
    tolerance = CRISP_TOLERANCE * (box.fit.a3 - box.fit.a1)

    def triangle(ends: tuple[float, float, float]) -> list[float]:
        """Lower end, modal value and upper end; ends at the modal value but for round-off on it."""
        snapped = (ends[1] if abs(end - ends[1]) <= tolerance else end for end in ends)
        return [float(f"{end:.8g}") for end in snapped]

    return {
        "theta": [float(f"{end:g}") for end in (law.lower, law.upper)],
        "a1": float(f"{box.fit.a1:.10g}"),
        "a2": triangle(box.a2),
        "a3": float(f"{box.fit.a3:.10g}"),
        "a4": triangle(box.a4),
    }


def fragment(numbers: Mapping[str, Any]) -> str:
    """The case section [radius] as TOML text, with fractions as comments, from a `summary`."""
    measure = "volume" if "mean_volume_fraction_of_map" in numbers else "area"
    stated, map_fraction = numbers["fraction_of_case"], numbers[f"mean_{measure}_fraction_of_map"]
    words = f"; of the particles: {numbers[f'{measure}_fraction']:.4f}"
    words += "" if stated is None else f"; of the case: {stated:g}"
    lines = [
        f"[radius]  # from {numbers['cells']} cells; the limits keep"
        f" {numbers['share_kept']:.4%} of their {measure}",
        f"# {measure} fraction of this map at its modal values: {map_fraction:.4f}{words}",
    ]
    for name, value in numbers["radius"].items():
        is_fuzzy = isinstance(value, list)
        ends = ", ".join(f"{x:.10g}" for x in (value if is_fuzzy else [value]))
        lines.append(f"{name} = [{ends}]" if is_fuzzy else f"{name} = {ends}")
    return "\n".join(lines) + "\n"


def to_dataset(result: Microstructure) -> xarray.Dataset:
    """Return cdf of the sample, pbox_lower, pbox_upper and fitted over 501 r_n as a dataset."""
    import xarray

    box, fit = result.pbox, result.pbox.fit
    radius = np.linspace(fit.a1, fit.a3, 501)
    law = fit.distribution
    theta = np.asarray(np.linspace(law.lower, law.upper, 5001), float)
    low, high = box.bounds(theta)
    probability = fit.distribution.cdf(theta)
    columns = {
        "cdf": result.truncated.cdf(radius),
        "pbox_lower": np.interp(radius, high, probability),
        "pbox_upper": np.interp(radius, low, probability),
        "fitted": np.interp(radius, fit.map((box.a2[1], box.a4[1]))(theta), probability),
    }
    variables = {name: ("r_n", values, {"units": "1"}) for name, values in columns.items()}
    dataset = xarray.Dataset(variables, {"r_n": radius})
    name = "reduced radius: radius over half the side of a square or cube as large as the cell"
    dataset["r_n"].attrs = {"units": "1", "long_name": name}
    return dataset
