"""Quick form of a case: the same stages in seconds, with meaningless numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from alphacut.case.case import Case
from alphacut.case.sections.particles import Microstructure
from alphacut.io.files import Document

NODES = 120  # time steps of an envelope
LEVELS = (0.0, 1.0)  # where a case names more than one
COARSE = {
    "microstructure": (
        "microstructure.bootstrap",
        "microstructure.packing.packings",
        "microstructure.packing.discs",
        "microstructure.spheres.packings",
        "microstructure.spheres.spheres",
    ),
    "modulus": ("mesh.layers", "mesh.size", "modulus.plan", "modulus.alpha", "modulus.tolerance"),
    "image": ("modulus.alpha",),
    "envelope": (
        "envelope.alpha",
        "envelope.relative_tolerance",
        "envelope.duration",
        "exceedance.samples",
    ),
}
"""Keys that the quick form changes, by the stage that reads them."""
WAIVED = (
    "envelope.tolerance",
    "envelope.relative_tolerance",
    "envelope.certify",
    "pendulum.tolerance",
)
"""Tolerances of the case that numbers without a meaning are not held to."""


def settings(case: Case) -> dict[str, object]:
    """Values of the quick form in place of the case's own."""
    found: dict[str, object] = {}
    for stage, keys in COARSE.items():
        found |= {key: value_of(case, key) for key in keys if stage in case.stages}
    if "envelope" in case.stages:
        for index, study in enumerate(case.sections.study):
            found[f"study[{index}].duration"] = study.duration
    return {key: value for key, value in found.items() if value is not None}


def value_of(case: Case, key: str) -> object:
    """The value of a key; None where the case has no such section."""
    found: object = case.sections
    for name in key.split("."):
        found = None if found is None else getattr(found, name)
    return found


def banner(found: Document) -> str:
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
    old = case.sections
    longest = NODES * old.envelope.step if old.envelope else 0.0
    return replace(
        case,
        written={key: text for key, text in case.written.items() if key not in WAIVED},
        sections=replace(
            old,
            microstructure=old.microstructure and few_particles(old.microstructure),
            mesh=old.mesh and replace(old.mesh, layers=3, size=0.4),
            modulus=old.modulus
            and replace(old.modulus, plan="reduced", alpha=few(old.modulus.alpha), tolerance=1e-2),
            study=tuple(replace(x, duration=min(x.duration, longest)) for x in old.study),
            envelope=old.envelope
            and replace(
                old.envelope,
                alpha=few(old.envelope.alpha),
                relative_tolerance=1e-2,
                duration=min(old.envelope.duration, longest),
            ),
            exceedance=old.exceedance and replace(old.exceedance, samples=10),
        ),
    )


def few(alpha: tuple[float, ...]) -> tuple[float, ...]:
    """The outer levels; one level stays alone."""
    return LEVELS if len(alpha) > 1 else alpha


def few_particles(wanted: Microstructure) -> Microstructure:
    """The microstructure from few particles and resamples."""
    packing = wanted.packing and replace(wanted.packing, packings=5, discs=500)
    spheres = wanted.spheres and replace(
        wanted.spheres, packings=5, spheres=min(wanted.spheres.spheres, 200)
    )
    return replace(wanted, bootstrap=100, packing=packing, spheres=spheres)
