"""The quick form of a case: the same stages, cut down to seconds, to see that everything runs; its numbers mean nothing."""

from __future__ import annotations

from dataclasses import replace

from alphacut.case import Case

NODES = 120  # time steps of an envelope
LEVELS = (0.0, 1.0)
COARSE = {
    "mesh.layers": 3,
    "mesh.size": 0.4,
    "modulus.plan": "reduced",
    "modulus.alpha": LEVELS,
    "modulus.tolerance": 1e-2,
    "envelope.alpha": LEVELS,
    "exceedance.samples": 10,
    "microstructure.bootstrap": 100,
    "microstructure.packing.packings": 5,
    "microstructure.packing.discs": 500,
}


def quick(case: Case) -> Case:
    """The case with few levels, samples and time steps on a coarse mesh."""
    values = dict(case.values)
    values |= {key: value for key, value in COARSE.items() if case.has(key)}
    for key in case.values:
        if key.endswith(".duration") and case.has(key):
            values[key] = min(case.number(key), NODES * case.number("envelope.step"))
    return replace(case, values=values)
