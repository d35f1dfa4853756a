"""The models of a cell with one particle: what each can solve, and where it stands.

A new model is its own file, with the members of `CellModel`, and one entry here; of another
distribution, an entry point in the group "alphacut.cells", whose place is that of a `ModelEntry`.
`demos/templates/cell_model.py` is one to copy.
"""

from __future__ import annotations

from dataclasses import dataclass
from pkgutil import resolve_name

from alphacut.base.entry_points import registered
from alphacut.rve.result.cell_model import CellModel


@dataclass(frozen=True)
class ModelEntry:
    """A model, known before it is imported, which may need DOLFINx.

    Args:
        name: Word for it in cases, `modulus.method`.
        place: Place "module:Class" of its class.
        particles: Kinds of particles that it solves.
        needs_isotropy: Whether both phases must be isotropic.
    """

    name: str
    place: str
    particles: frozenset[str]
    needs_isotropy: bool = False

    def load(self) -> type[CellModel]:
        """Return the class; MissingLibraryError where DOLFINx is needed and missing."""
        found: type[CellModel] = resolve_name(self.place)
        return found


ROUND = frozenset({"cylinders", "ellipses"})
MODELS = [
    # The order is that of preference: series are exact to rounding, slices are plane finite
    # elements at nodes of θ, and prisms are finite elements that have θ as a third axis.
    ModelEntry("series", "alphacut.rve.series.model:SeriesModel", frozenset({"cylinders"}), True),
    ModelEntry("series", "alphacut.rve.spheres.model:SpheresModel", frozenset({"spheres"}), True),
    ModelEntry("slices", "alphacut.rve.slices.model:SlicesModel", ROUND),
    ModelEntry("prism", "alphacut.rve.prism.model:PrismModel", ROUND),
]
"""All models; where a case says "auto", the first that fits is taken."""


def known_names(asked: str = "") -> tuple[str, ...]:
    """Return the names of all models, each once.

    Args:
        asked: A name. If no model has it, and another distribution registers one of this name, that
            model is added to `MODELS`.
    """
    if asked and all(entry.name != asked for entry in MODELS):
        place = registered("alphacut.cells").get(asked)
        if place is not None:
            MODELS.append(resolve_name(place))
    return tuple(dict.fromkeys(entry.name for entry in MODELS))


def fitting_models(particles: str, *, is_isotropic: bool) -> dict[str, ModelEntry]:
    """Return the models for a kind of particles by name, the preferred one first."""
    return {
        entry.name: entry
        for entry in MODELS
        if particles in entry.particles and (is_isotropic or not entry.needs_isotropy)
    }
