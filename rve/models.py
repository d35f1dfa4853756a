"""The models of a cell with one particle: what each can solve, and where it stands.

A new model is its own file, with the members of `CellModel`, and one entry here.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module

from alphacut.rve.result.cell_model import CellModel


@dataclass(frozen=True)
class ModelEntry:
    """A model, known before it is imported, which may need DOLFINx.

    Args:
        name: Word for it in cases, `modulus.method`.
        module: Module below `alphacut.rve`.
        kind: Name of the class.
        particles: Kinds of particles that it solves.
        needs_isotropy: Whether both phases must be isotropic.
    """

    name: str
    module: str
    kind: str
    particles: frozenset[str]
    needs_isotropy: bool = False

    def load(self) -> type[CellModel]:
        """Return the class; MissingLibraryError where DOLFINx is needed and missing."""
        found: type[CellModel] = getattr(import_module(f"alphacut.rve.{self.module}"), self.kind)
        return found


MODELS = [
    # The order is that of preference: series are exact to rounding, slices are plane finite
    # elements at nodes of θ, and prisms are finite elements that have θ as a third axis.
    ModelEntry("series", "series.model", "SeriesModel", frozenset({"cylinders"}), True),
    ModelEntry("series", "spheres.model", "SpheresModel", frozenset({"spheres"}), True),
    ModelEntry("slices", "slices.model", "SlicesModel", frozenset({"cylinders", "ellipses"})),
    ModelEntry("prism", "prism.model", "PrismModel", frozenset({"cylinders", "ellipses"})),
]
"""All models; where a case says "auto", the first that fits is taken."""


def fitting_models(particles: str, *, is_isotropic: bool) -> dict[str, ModelEntry]:
    """Return the models for a kind of particles by name, the preferred one first."""
    return {
        entry.name: entry
        for entry in MODELS
        if particles in entry.particles and (is_isotropic or not entry.needs_isotropy)
    }
