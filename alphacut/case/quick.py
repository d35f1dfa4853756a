"""Quick form of a case: the same stages in seconds, with meaningless numbers."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from alphacut.case.case import Case

NODES = 120  # time steps of an envelope
LEVELS = (0.0, 1.0)
COARSE = {
    "mesh.layers": 3,
    "mesh.size": 0.4,
    "modulus.plan": "reduced",
    "modulus.alpha": LEVELS,
    "modulus.tolerance": 1e-2,
    "envelope.alpha": LEVELS,
    "envelope.relative_tolerance": 1e-2,
    "exceedance.samples": 10,
    "microstructure.bootstrap": 100,
    "microstructure.packing.packings": 5,
    "microstructure.packing.discs": 500,
}


PARTS = {
    "modulus.alpha": ("modulus", "image"),
    "mesh": ("modulus",),
    "modulus": ("modulus",),
    "exceedance": ("envelope",),
    "study": ("envelope",),
    "envelope": ("envelope",),
}


def settings(case: Case) -> dict[str, object]:
    """Values of the quick form in place of the case's own."""
    keys = [
        key for key in case.values if (key in COARSE or key.endswith(".duration")) and case.has(key)
    ]
    return {key: case.values[key] for key in keys if set(_readers(key)) & set(case.stages)}


def _readers(key: str) -> tuple[str, ...]:
    """Stages that read a key."""
    return PARTS.get(key) or PARTS.get(re.split(r"[.\[]", key)[0], ("microstructure",))


def banner(found: Mapping[str, Any]) -> str:
    """Banner above the results of a quick form, from `settings`."""
    parts = []
    for key, value in found.items():
        words = (
            f"[{', '.join(f'{x:g}' for x in value)}]"
            if isinstance(value, Sequence) and not isinstance(value, str)
            else f"{value}"
        )
        parts.append(f"{key} = {value:g} s" if key.endswith(".duration") else f"{key} = {words}")
    return f"Quick form: {', '.join(parts)}; these numbers mean nothing"


def quick(case: Case) -> Case:
    """The case with few levels, samples and time steps on a coarse mesh."""
    values = dict(case.values)
    values |= {key: value for key, value in COARSE.items() if key in case.values}
    for key in case.values:
        if key.endswith(".duration") and case.has(key):
            values[key] = min(case.number(key), NODES * case.number("envelope.step"))
    return replace(case, values=values)
