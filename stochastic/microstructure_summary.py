"""The numbers of a microstructure as JSON, as a fragment of a case file, and as a dataset."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from alphacut.stochastic.microstructure import FittedMap, Microstructure, mean_correlation
from alphacut.stochastic.spheres.microstructure import SphereMicrostructure, map_fraction
from alphacut.stochastic.spheres.power_cells import volume_fraction

if TYPE_CHECKING:
    import xarray


CRISP = 1e-6  # of a3 − a1: nearer to the fitted slope, an end is round-off of the fit
PERIODIC = "none: the boxes are periodic"
EDGE = (
    "only cells that no disc beyond the window's edge can change; each stands for 1/p, p the share"
    " of places where its like is whole"
)


def summary(found: Microstructure | SphereMicrostructure) -> dict[str, object]:
    """Every number found, lengths in m."""
    if isinstance(found, SphereMicrostructure):
        return {**_of_spheres(found), **_of_map(found), "seconds": found.seconds}
    discs = [section.discs for section in found.sections]
    radii = np.concatenate([one.radii for one in discs])
    return {
        "particles": found.study.shape.particles,
        "packings": len(discs),
        "discs": len(radii),
        "edge": PERIODIC if all(one.periodic for one in discs) else EDGE,
        "hidden": int(sum(section.diagram.hidden.sum() for section in found.sections)),
        "rejected": {
            str(row): reason
            for section in found.sections
            for row, reason in section.read.rejected.items()
        },
        "area_fraction": float(np.mean([one.area_fraction for one in discs])),
        "area_fraction_of_cells": found.sample.area_fraction,
        "area_fraction_of_image": found.sections[0].read.phase_fraction,
        "smallest_radius": float(radii.min()),
        "largest_radius": float(radii.max()),
        "cell_areas_sum_error": max(
            abs(section.diagram.areas.sum() / section.discs.area - 1) for section in found.sections
        ),
        **_of_map(found),
        "mean_area_fraction_of_map": found.fraction_of_map,
        "neighbours": _neighbours(found),
        "share_capped": found.share_capped,
        "hexagonal_order": found.hexagonal_order,
        "crystalline": found.is_crystalline,
        "correlation": mean_correlation(found.sections),
        "seconds": found.seconds,
    }


def _of_map(found: FittedMap) -> dict[str, object]:
    """Numbers of the reduced radii and their map."""
    box, sample = found.pbox, found.sample
    return {
        "cells": len(sample.values),
        "mean_r_n": sample.mean,
        "largest_r_n": float(sample.values[-1]),
        "limits": list(found.limits),
        "share_kept": found.share_kept,
        "a1": box.fit.a1,
        "a2": list(box.a2),
        "a3": box.fit.a3,
        "a4": list(box.a4),
        "modal": {"a2": box.a2[1], "a4": box.a4[1]},
        "lower": {"a2": box.a2[0], "a4": box.a4[0]},
        "upper": {"a2": box.a2[2], "a4": box.a4[2]},
        "a2_band": list(found.slopes.a2),
        "a4_band": list(found.slopes.a4),
        "confidence": found.study.confidence,
        "band": found.band,
        "band_allowed": found.allowed,
        "pbox_area": box.area,
        "pbox_breach": box.excess(found.kept),
        "misfit": box.fit.misfit(found.kept, (box.a2[1], box.a4[1])),
        "seed": found.study.seed,
    }


def _of_spheres(found: SphereMicrostructure) -> dict[str, object]:
    """Numbers of the spheres, of their law and of those that are possible besides."""
    packed, section = found.packed[0], found.source.section
    radii = np.concatenate([one.radii for one in packed.packings])
    cubes = zip(packed.packings, packed.volumes, strict=True)
    return {
        "particles": found.study.shape.particles,
        "packings": len(packed.packings),
        "spheres": len(radii),
        "edge": PERIODIC,
        "law": found.source.laws["the law"].radii.label,
        "volume_fraction": found.source.packing.volume_fraction,
        "volume_fraction_packed": packed.fraction,
        "volume_fraction_of_cells": volume_fraction(found.sample),
        "mean_volume_fraction_of_map": found.fraction_of_map,
        "share_beyond_limit": found.share_beyond,
        "smallest_radius": float(radii.min()),
        "largest_radius": float(radii.max()),
        "cell_volumes_sum_error": max(
            abs(float(volumes.sum()) / one.side**3 - 1) for one, volumes in cubes
        ),
        "possible_laws": [
            {
                "law": one.name,
                "spheres": sum(len(part.radii) for part in one.packings),
                "volume_fraction_packed": one.fraction,
                "mean_r_n": one.sample.mean,
                "mean_volume_fraction_of_its_map": map_fraction(found.study, one.sample),
            }
            for one in found.packed[1:]
        ],
        "radii_pbox": None
        if section is None
        else {
            "weight": section.weight,
            "level": section.level,
            "radius": section.edges.tolist(),
            "lower": section.lower.tolist(),
            "upper": section.upper.tolist(),
        },
        "unknown": None if section is None else section.unknown,
        "remarks": list(found.remarks),
    }


def _neighbours(found: Microstructure) -> dict[str, Any]:
    number = np.concatenate([one.number for one in found.direct])
    distance = np.concatenate([one.distances for one in found.direct])
    diameter = 2 * float(
        np.mean(np.concatenate([section.discs.radii for section in found.sections]))
    )
    if not len(number):
        return {"counted": 0}
    return {
        "counted": len(number),
        "mean": float(number.mean()),
        "least": int(number.min()),
        "most_frequent": int(np.bincount(number).argmax()),
        "greatest": int(number.max()),
        "least_distance": float(distance.min()),
        "mean_distance": float(distance.mean()),
        "mean_diameter": diameter,
    }


def fragment(found: Microstructure | SphereMicrostructure) -> str:
    """The section [radius] of a case file, with as many digits as the fit has."""
    law, box, shape = found.pbox.fit.distribution, found.pbox, found.study.shape

    def triangle(ends: tuple[float, float, float]) -> str:
        near = CRISP * (box.fit.a3 - box.fit.a1)
        told = (ends[1] if abs(end - ends[1]) <= near else end for end in ends)
        return "[" + ", ".join(f"{end:.8g}" for end in told) + "]"

    if isinstance(found, SphereMicrostructure):
        particles, cells = found.packed[0].fraction, volume_fraction(found.sample)
    else:
        particles = float(np.mean([section.discs.area_fraction for section in found.sections]))
        cells = found.sample.area_fraction
    return (
        f"[radius]  # from {len(found.sample.values)} cells; the limits keep {found.share_kept:.4%}"
        f" of their {shape.cells}\n# {shape.cells} fraction of the {shape.particles}"
        f" {particles:.4f}, of the cells"
        f" {cells:.4f}, of this map at its modal values, which the modulus"
        f" uses, {found.fraction_of_map:.4f}\ntheta = [{law.lower:g}, {law.upper:g}]\na1 ="
        f" {box.fit.a1:.10g}\na2 = {triangle(box.a2)}\na3 = {box.fit.a3:.10g}\na4 ="
        f" {triangle(box.a4)}\n"
    )


def to_dataset(found: FittedMap) -> xarray.Dataset:
    """Distribution function of r_n with its band and p-box, over a grid of radii."""
    import xarray

    fit = found.pbox.fit
    radius = np.linspace(fit.a1, fit.a3, 501)
    theta = np.linspace(fit.distribution.lower, fit.distribution.upper, 5001)
    low, high = found.pbox.bounds(theta)
    share = fit.distribution.cdf(theta)
    columns = {
        "cdf": found.kept.cdf(radius),
        "pbox_lower": np.interp(radius, high, share),
        "pbox_upper": np.interp(radius, low, share),
        "fitted": np.interp(radius, fit.map((found.pbox.a2[1], found.pbox.a4[1]))(theta), share),
    }
    said = {"a1": fit.a1, "a2": list(found.pbox.a2), "a3": fit.a3, "a4": list(found.pbox.a4)}
    said |= {"band": found.band, "band_allowed": found.allowed, "seed": found.study.seed}
    dataset = xarray.Dataset(
        {name: ("r_n", values, {"units": "1"}) for name, values in columns.items()},
        {"r_n": radius},
        said,
    )
    dataset["r_n"].attrs = {
        "units": "1",
        "long_name": "reduced radius r/a, a half the side of a"
        f" {'cube' if found.study.shape.power == 3 else 'square'} of the cell's"
        f" {found.study.shape.cells}",
    }
    return dataset
