"""Words for names of figures, inputs, sources of error and checks."""

from __future__ import annotations

import re

from alphacut.io.files import Document

FIGURES = {
    "radii": "Distribution of the particles' radii",
    "p-box": "Random radius of the cell: distribution at the modal values, and its p-box",
    "cone": "Particle in the physical-stochastic domain: every slice at one θ is a cell",
    "prism-mesh": (
        "Prism mesh of the physical-stochastic domain, cut open: the matrix orange, the particle"
        " violet"
    ),
    "stress-on-slices": "Stress 11 under ε11 = ε22 = 0.01 on slices at several θ",
    "stress-curves": "Homogenised stress over θ, a curve for each fuzzy sample",
    "mean-stress": "Mean homogenised stress of every sample, rearranged into α-cuts",
    "modulus": "Fuzzy effective modulus",
    "image": "The image, the error of its two fields pixel by pixel, and the bounds of E",
    "membership": "Membership function of a fuzzy parameter and one of its α-cuts",
    "fuzzy-sets": "Crisp, interval, triangular, trapezoidal and non-convex fuzzy sets",
    "cuts": "A triangular fuzzy number, decomposed into α-cuts",
    "mapping": "Fuzzy mapping: trajectories inside an α-cut, and the envelope that encloses them",
    "graph-follower": "The Graph Follower, step by step",
    "record": "Acceleration of the ground",
    "spectrum": "Response spectrum of the record: pseudo-acceleration and displacement",
    "frame": "The frame, to scale",
    "tower": "The tower, to scale",
    "chain": "The frame as masses, springs and dampers",
    "response": (
        "Random and fuzzy stress: its distribution between two bounds, and its fuzzy quantiles"
    ),
    "exceedance": "Fuzzy probability of exceeding a limit, over the limit",
    "shares-modulus": "Share of each input in the width of the modulus",
    "shares-over-time": "Share of each input in the width of the vibration over time",
    "decision": "Fuzzy peak of each limited output beside its limit",
    "joint": (
        "What two values may be together: enclosing polygons shaded, hulls of pairs reached as"
        " lines, the rectangle of both ranges dashed"
    ),
    "field": "Storeys that are alike: what each direction of their field does by itself",
    "measure-next": "Width lost if an input is known twice as well, and exactly",
    "update-inputs": "Inputs before and after natural modes were measured, level by level",
    "two-point": (
        "Why two points do not describe particles: equal discs of the same area fraction, for"
        " illustration"
    ),
    "neighbours": (
        "Direct neighbours and cells: equal discs of the same area fraction, for illustration"
    ),
    "neighbour-statistics": "Statistics of the direct neighbours",
    "correlation": (
        "Reduced radius of a cell against that of its neighbours, with their correlation"
    ),
    "cells": "Cells of the particles",
    "areas": "Size of each cell over its reduced radius, and the limits that are kept",
    "pbox": "Measured distribution of the reduced radius, and the p-box of its fuzzy map",
    "radii-bounds": (
        "Bounds of the spheres' radii, by volume, that the circles of a section leave, with those"
        " of the packings"
    ),
    "radius-map": "Fuzzy map from θ to the reduced radius",
}
WORDS = {
    "a2": "slope a2 of the radius map",
    "a4": "slope a4 of the radius map",
    "a1": "least radius a1",
    "a3": "greatest radius a3",
    "matrix_modulus": "modulus of the matrix",
    "matrix_poisson": "Poisson's ratio of the matrix",
    "inclusion_modulus": "modulus of the particle",
    "inclusion_poisson": "Poisson's ratio of the particle",
    "space": "mesh, or order of the series",
    "theta": "discretisation of θ",
    "table": "table over radius and modulus",
    "symmetry": "symmetry of the stiffness",
    "reuss": "Reuss bound",
    "voigt": "Voigt bound",
    "hashin_shtrikman": "Hashin–Shtrikman bounds of the plane bulk modulus",
    "hill_mandel": (
        "Hill–Mandel condition: mean stress times mean strain is the mean of their product"
    ),
    "residual": "residual of the linear systems",
    "periodicity": "displacements agree on opposite sides of the cell",
}


def in_words(name: str) -> str:
    """Name in words; a hyphen or underscore becomes a space where there are none."""
    return WORDS.get(name, name.replace("_", " "))


def caption(stem: str, *, paper: bool) -> str:
    """Caption of a figure's file, with the paper's number where the case is the paper's."""
    found = re.fullmatch(r"(?:fig)?(\d+(?:-\d+)?)[-_](.+)", stem)
    number, name = (
        (" to ".join(str(int(n)) for n in found[1].split("-")), found[2]) if found else ("", stem)
    )
    words = figure_words(
        name if name.startswith(("envelope-", "update-")) else name.replace("_", "-")
    )
    if not (paper and number):
        return words
    return f"{'Figs.' if 'to' in number else 'Fig.'} {number}: {words}"


def figure_words(name: str) -> str:
    """Words for a figure without its number."""
    if match := re.fullmatch(r"envelope-(.+)-([^-]+)", name):
        return f"Envelope of {match[2]}" + ("" if match[1] == "all" else f", study {match[1]}")
    if name.startswith("exceedance-"):
        of = name.removeprefix("exceedance-").replace("-", " ")
        return f"Fuzzy probability that {of} exceeds a limit, over the limit"
    if name not in FIGURES and name.startswith("update-"):
        return f"Envelope of {name.removeprefix('update-')} before and after the measurement"
    return FIGURES.get(name, name.replace("-", " "))


def core(modulus: Document) -> str:
    """Modal value or core interval of a summary's fuzzy modulus, in GPa."""
    low, high = (float(modulus["E_GPa"][side][-1]) for side in ("lower", "upper"))
    if high - low <= 1e-9 * abs(high):
        return f"{modulus['modal_GPa']:.4f} GPa"
    return f"[{low:.4f}, {high:.4f}] GPa at α = {modulus['alpha'][-1]:g}"
