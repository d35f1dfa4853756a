"""The numbers of a microstructure as JSON, as a fragment of a case file, and as a dataset."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from alphacut.stochastic.microstructure import Microstructure, mean_correlation

if TYPE_CHECKING:
    import xarray


EDGE = (
    "only cells that no disc beyond the window's edge can change; each stands for 1/p, p the share"
    " of places where its like is whole"
)


def summary(found: Microstructure) -> dict[str, object]:
    """Every number found, lengths in m."""
    box, sample, discs = found.pbox, found.sample, [section.discs for section in found.sections]
    radii = np.concatenate([one.radii for one in discs])
    return {
        "packings": len(discs),
        "discs": len(radii),
        "cells": len(sample.values),
        "edge": "none: the boxes are periodic" if all(one.periodic for one in discs) else EDGE,
        "hidden": int(sum(section.diagram.hidden.sum() for section in found.sections)),
        "rejected": {
            str(row): reason
            for section in found.sections
            for row, reason in section.rejected.items()
        },
        "area_fraction": float(np.mean([one.area_fraction for one in discs])),
        "area_fraction_of_cells": sample.area_fraction,
        "area_fraction_of_image": found.sections[0].phase_fraction,
        "smallest_radius": float(radii.min()),
        "largest_radius": float(radii.max()),
        "cell_areas_sum_error": max(
            abs(section.diagram.areas.sum() / section.discs.area - 1) for section in found.sections
        ),
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
        "mean_area_fraction_of_map": _mean_area_fraction(found),
        "neighbours": _neighbours(found),
        "correlation": mean_correlation(found.sections),
        "seed": found.study.seed,
        "seconds": found.seconds,
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


def _mean_area_fraction(found: Microstructure) -> float:
    """Mean of π/4 r² under the law of θ, for the modal map."""
    from alphacut.stochastic.theta.quadrature import gauss_rule

    fit = found.pbox.fit
    rule = gauss_rule(fit.distribution, points=8)
    return float(
        rule.mean(np.pi / 4 * fit.map((found.pbox.a2[1], found.pbox.a4[1]))(rule.nodes) ** 2)
    )


def fragment(found: Microstructure) -> str:
    """The section [radius] of a case file, with as many digits as the fit has."""
    law, box = found.pbox.fit.distribution, found.pbox

    def triangle(ends: tuple[float, float, float]) -> str:
        return "[" + ", ".join(f"{end:.8g}" for end in ends) + "]"

    discs = float(np.mean([section.discs.area_fraction for section in found.sections]))
    return (
        f"[radius]  # from {len(found.sample.values)} cells; the limits keep {found.share_kept:.4%}"
        f" of their area\n# area fraction of the discs {discs:.4f}, of the cells"
        f" {found.sample.area_fraction:.4f}, of this map at its modal values, which the modulus"
        f" uses, {_mean_area_fraction(found):.4f}\ntheta = [{law.lower:g}, {law.upper:g}]\na1 ="
        f" {box.fit.a1:.10g}\na2 = {triangle(box.a2)}\na3 = {box.fit.a3:.10g}\na4 ="
        f" {triangle(box.a4)}\n"
    )


def to_dataset(found: Microstructure) -> xarray.Dataset:
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
        "long_name": "reduced radius r/a, a half the side of a square of the cell's area",
    }
    return dataset
