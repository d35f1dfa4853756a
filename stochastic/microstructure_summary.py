"""The numbers of a microstructure as JSON, as a fragment of a case file, and as a dataset."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from alphacut.stochastic.microstructure import Microstructure
from alphacut.stochastic.tessellation.delaunay import neighbouring_values, neighbours

if TYPE_CHECKING:
    import xarray

CRISP_TOLERANCE = 1e-6  # of a3 − a1: an end nearer to the fitted slope differs by round-off


def summary(result: Microstructure) -> dict[str, object]:
    """Return all numbers of a microstructure study by name, lengths in m."""
    particles = [section.particles for section in result.sections]
    radii = np.concatenate([packing.radii for packing in particles])
    shape, map_ = result.study.shape, result.fraction_of_map
    cells = float(result.sample.weights @ shape.shares(result.sample.values))  # eq. 10
    numbers: dict[str, object] = {
        "particles": shape.particles,
        "packings": len(particles),
        shape.particles: len(radii),
        f"{shape.cells}_fraction": float(np.mean([packing.fraction for packing in particles])),
        f"{shape.cells}_fraction_of_cells": cells,
        f"mean_{shape.cells}_fraction_of_map": map_,
        "fraction_of_case": result.stated_fraction,
        "smallest_radius": float(radii.min()),
        "largest_radius": float(radii.max()),
        "share_capped": result.share_capped,
    }
    return numbers | _of_discs(result) | _of_map(result) | {"radius": radius_section(result)}


def _of_discs(result: Microstructure) -> dict[str, object]:
    """Return number and distances of direct neighbours and the correlation of r_n across walls.

    Empty for spheres.
    """
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


def _of_map(result: Microstructure) -> dict[str, object]:
    """Return statistics of r_n, limits, fuzzy slopes with their bands, and misfits, by name."""
    box, sample = result.pbox, result.sample
    return {
        "cells": len(sample.values),
        "mean_r_n": sample.mean,
        "largest_r_n": float(sample.values[-1]),
        "limits": list(result.limits),
        "share_kept": result.share_within,
        "a1": box.fit.a1,
        "a2": list(box.a2),
        "a3": box.fit.a3,
        "a4": list(box.a4),
        "a2_band": list(result.slopes.a2),
        "a4_band": list(result.slopes.a4),
        "band": result.band,
        "pbox_area": box.area,
        "pbox_breach": box.excess(result.truncated),
        "misfit": box.fit.misfit(result.truncated, (box.a2[1], box.a4[1])),
        "seed": result.study.seed,
    }


def radius_section(result: Microstructure) -> dict[str, list[float] | float]:
    """Return the case section [radius] as a mapping: ends of θ, a1, a3 and fuzzy a2, a4."""
    box, law = result.pbox, result.pbox.fit.distribution
    near = CRISP_TOLERANCE * (box.fit.a3 - box.fit.a1)

    def triangle(ends: tuple[float, float, float]) -> list[float]:
        near_ends = (ends[1] if abs(end - ends[1]) <= near else end for end in ends)
        return [float(f"{end:.8g}") for end in near_ends]

    return {
        "theta": [float(f"{end:g}") for end in (law.lower, law.upper)],
        "a1": float(f"{box.fit.a1:.10g}"),
        "a2": triangle(box.a2),
        "a3": float(f"{box.fit.a3:.10g}"),
        "a4": triangle(box.a4),
    }


def fragment(numbers: Mapping[str, Any]) -> str:
    """Return the case section [radius] as TOML text, with fractions as comments.

    Args:
        numbers: Those of `summary`.
    """
    cells = "volume" if "mean_volume_fraction_of_map" in numbers else "area"
    stated = numbers["fraction_of_case"]
    beside = "" if stated is None else f"; of the case: {stated:g}"
    lines = [
        f"[radius]  # from {numbers['cells']} cells; the limits keep"
        f" {numbers['share_kept']:.4%} of their {cells}",
        f"# {cells} fraction of this map at its modal values:"
        f" {numbers[f'mean_{cells}_fraction_of_map']:.4f}{beside}",
    ]
    for name, value in numbers["radius"].items():
        ends = [f"{x:.10g}" for x in (value if isinstance(value, list) else [value])]
        lines.append(f"{name} = [{', '.join(ends)}]" if len(ends) > 1 else f"{name} = {ends[0]}")
    return "\n".join(lines) + "\n"


def to_dataset(result: Microstructure) -> xarray.Dataset:
    """Return the distribution function of r_n over 501 radii as a dataset.

    Returns:
        Variables cdf (of the sample), pbox_lower, pbox_upper and fitted, over the coordinate r_n.
    """
    import xarray

    box, fit = result.pbox, result.pbox.fit
    radius = np.linspace(fit.a1, fit.a3, 501)
    law = fit.distribution
    theta = np.asarray(np.linspace(law.lower, law.upper, 5001), float)
    low, high = box.bounds(theta)
    share = fit.distribution.cdf(theta)
    columns = {
        "cdf": result.truncated.cdf(radius),
        "pbox_lower": np.interp(radius, high, share),
        "pbox_upper": np.interp(radius, low, share),
        "fitted": np.interp(radius, fit.map((box.a2[1], box.a4[1]))(theta), share),
    }
    dataset = xarray.Dataset(
        {name: ("r_n", values, {"units": "1"}) for name, values in columns.items()},
        {"r_n": radius},
    )
    name = "reduced radius: radius over half the side of a square or cube as large as the cell"
    dataset["r_n"].attrs = {"units": "1", "long_name": name}
    return dataset
