"""The content of a case that its cell needs; the other sections are known by name alone."""

from __future__ import annotations

from typing import Annotated

from alphacut.base.errors import RefusedError, require
from alphacut.case.analyses import ANALYSES
from alphacut.case.material import (
    AnyLaw,
    Cell,
    ImageCell,
    Mesh,
    MeshedCell,
    ModulusSection,
    RadiusMapSection,
    RoundCell,
    ThetaSection,
)
from alphacut.case.types import NotEmpty, Section, after, distinct, require_alone
from alphacut.io.files import suggestion
from alphacut.io.provenance import command_to_paste
from alphacut.stochastic import FractionMap


def _stage(name: str) -> str:
    """Return the name of a stage, if it is one; those of analyses are registered."""
    of_analyses = [analysis.stage for analysis in ANALYSES.values()]
    known = list(dict.fromkeys(["microstructure", "modulus", "envelope", *of_analyses]))
    if name not in known:
        raise RefusedError("", f'"{name}"', ", ".join(known), suggestion(name, known))
    return name


class CellContent(Section, defer_build=True):
    """The sections of the cell, built; microstructure as it stands in the file.

    Validators of this class and of those derived from it are built at first use, since a case is
    read by the class that `with_structures` derives.

    Args:
        title: one line, for figures and the report.
        about: a paragraph: what the case shows.
        stages: stages that `alphacut run` computes.
        shares: whether to compute the fraction of the widths that each input causes.
    """

    title: str
    about: str = ""
    stages: Annotated[tuple[Annotated[str, after(_stage)], ...], NotEmpty, after(distinct)]
    shares: bool = True
    microstructure: object = None
    radius: AnyLaw | None = None
    cell: Cell | None = None
    mesh: Mesh = Mesh()
    modulus: ModulusSection = ModulusSection()

    @property
    def image_cell(self) -> ImageCell | None:
        """The cell if it is an image."""
        return self.cell if isinstance(self.cell, ImageCell) else None

    @property
    def particle_cell(self) -> RoundCell | None:
        """The cell if it has one particle."""
        return self.cell if isinstance(self.cell, RoundCell) else None

    @property
    def has_spheres(self) -> bool:
        """Whether the particles of the cell are spheres."""
        return self.cell is not None and self.cell.particles == "spheres"

    @property
    def stated_fraction(self) -> float | None:
        """Fraction of the cell that the particles take as the case says, at its nominal value."""
        if self.particle_cell is None or self.particle_cell.fraction is None:
            return None
        return float(self.particle_cell.fraction.nominal)

    @property
    def radius_map(self) -> RadiusMapSection | None:
        """The radius map of [radius], if there is one."""
        return self.radius if isinstance(self.radius, RadiusMapSection) else None

    @property
    def radius_and_cell(
        self,
    ) -> tuple[RadiusMapSection | ThetaSection | FractionMap, RoundCell | MeshedCell]:
        """Return the source of the random size of the particles, and the cell with its phases.

        Returns:
            The source, and the section [cell]. For a cell with one particle the source is the map
            from the random variable θ to the radius: [radius], else the map of the constant
            fraction `cell.fraction`. A cell whose mesh comes from a file needs the distribution of
            θ alone: [radius], or without one a standard normal variable cut off at -3 and 3.

        Raises:
            RefusedError: The cell is an image or missing, or a particle has neither [radius] nor a
                fraction.
        """
        if isinstance(self.cell, MeshedCell):
            return self.radius or ThetaSection(), self.cell
        allowed = "a section [cell] with a particle"
        # An image has no random θ: bounds of its stiffness need no samples.
        if isinstance(self.cell, ImageCell):
            cure = f"run {command_to_paste('modulus', 'CASE.toml')}"
            raise RefusedError("cell", "an image", allowed, cure)
        if self.cell is None:
            raise RefusedError("cell", None, allowed)
        radius = self.radius_map or self.cell.fraction_map
        if radius is None:
            raise RefusedError("radius", None, "a section [radius], or cell.fraction")
        return radius, self.cell

    def require_consistent(self) -> None:
        """Refuse sections that do not fit each other."""
        self._require_mesh()
        self._require_stages()

    def _require_mesh(self) -> None:
        """Refuse keys of [mesh], [radius] and [modulus] that do not fit the source of the mesh.

        Without `mesh.file` the program makes the mesh: then [cell.phases], `mesh.refine` and
        `mesh.bounds` have no meaning, and [radius] must be a whole radius map, with the keys a1 …
        a4. With `mesh.file` the geometry comes from the file: [cell.phases] must give a phase for
        each physical group, element sizes and radius maps are refused, [radius] may only have the
        distribution of θ, and `modulus.tolerance` needs `mesh.refine`.

        Raises:
            RefusedError: With the key that does not fit.
        """
        if self.mesh.file is None:
            allowed = "a mesh of Gmsh beside [cell.phases]"
            require(not isinstance(self.cell, MeshedCell), "mesh.file", None, allowed)
            for key in ("refine", "bounds"):
                require(not getattr(self.mesh, key), f"mesh.{key}", True, "true beside mesh.file")
            # `radius_map` is [radius] if it has a1 … a4, else None.
            if self.radius is not None and self.radius_map is None:
                about = RadiusMapSection.described_fields()["a1"].description
                raise RefusedError("radius.a1", None, f"{about}; theta alone beside mesh.file")
            return
        allowed = "[cell.phases], a phase for each physical group of mesh.file"
        require(isinstance(self.cell, MeshedCell), "cell.phases", None, allowed)
        # The file has its own elements and its own shape of particles. Keys that a run would
        # ignore are refused, since their author expects them to act.
        for key in ("size", "layers"):
            require_alone(f"mesh.{key}", self.mesh.has_key(key), "mesh.file")
        has_map = self.radius_map is not None or "microstructure" in self.stages
        require(not has_map, "radius", "a map of radii", "theta alone beside mesh.file")
        # The error is estimated from the results on the mesh of the file and on its refinement.
        # Without the second mesh nothing is known of the error, and a tolerance promises one.
        tolerance = self.modulus.tolerance
        allowed = "none beside mesh.file, whose error nobody knows"
        has_error = tolerance is None or self.mesh.refine
        require(has_error, "modulus.tolerance", tolerance, allowed, cure="set mesh.refine = true")

    def _require_stages(self) -> None:
        """Refuse stages without the sections that they need, and several sources of the radius.

        Each name in `stages` but "modulus" needs the section of the same name. Stage modulus needs
        [cell], and [radius] unless stage microstructure computes the radius map, `cell.fraction`
        makes all particles equal, or the cell is an image or a mesh from a file. `modulus.method`
        must be one of the methods of the kind of cell.

        Raises:
            RefusedError: With the key that is missing, or that stands beside another source of the
                radius.
        """
        # The radius comes from one source: a stage, a fraction of equal particles, or [radius].
        # Of two sources one would silently win.
        particle = self.particle_cell
        has_fraction = particle is not None and particle.fraction is not None
        is_computed = "microstructure" in self.stages
        needs_radius = not (
            is_computed or has_fraction or isinstance(self.cell, ImageCell | MeshedCell)
        )
        needed = {"modulus": ("radius", "cell") if needs_radius else ("cell",)}
        for stage in self.stages:
            # An empty section is there: its keys have defaults, or are told as missing.
            for key in needed.get(stage, (stage,)):
                is_there = getattr(self, key) is not None
                require(is_there, key, None, f"[{key}], which stage {stage} needs")
        has_radius = self.radius is not None
        require_alone("radius", has_radius and is_computed, "stage microstructure")
        require_alone("radius", has_radius and has_fraction, "cell.fraction")
        require_alone("cell.fraction", has_fraction and is_computed, "stage microstructure")
        if is_computed and particle is not None:
            # The radius of a particle is there over half the side of a square as large as its cell.
            lattice = particle.lattice
            allowed = "square beside stage microstructure"
            cure = "give [radius] or cell.fraction for other arrays"
            require(lattice == "square", "cell.lattice", lattice, allowed, cure)
        # A model that cannot solve this cell is refused here, and not after the stages before it.
        if self.cell is not None:
            method = self.modulus.method
            methods = self.cell.methods
            allowed = f"{', '.join(methods)} for this cell"
            require(method in methods, "modulus.method", method, allowed)


class CellCase(CellContent):
    """A case of which the cell alone is built; other sections are kept as they stand in the file.

    The sections of the structure and of analyses are among them, see `with_structures`.
    """

    records: object = None
    force: object = ()
    study: object = ()
    envelope: object = None
    identify: object = None
