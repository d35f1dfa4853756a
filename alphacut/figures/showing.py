"""Shares and figures of a run: what of them is up to date, and their making side by side."""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import Executor, Future
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from alphacut.figures import all as figures
from alphacut.fuzzy.campaign.workers import submitted
from alphacut.io.files import say
from alphacut.io.netcdf import read_dataset, write_dataset
from alphacut.io.progress import progress
from alphacut.io.provenance import NESTED, attributes, fingerprint, version_of
from alphacut.stages import width_shares as shares
from alphacut.stages.pipeline import Chain, Results

if TYPE_CHECKING:
    import xarray

SOURCE = (*NESTED, "alphacut")


@dataclass
class Showing:
    """Shares of the inputs in the widths, and the figures; what is not up to date is made anew.

    Args:
        chain: The stages.
        figures: Whether figures are wanted.
        executor: Processes that share the work; None: this one does it.
    """

    chain: Chain
    figures: bool
    executor: Executor | None
    making: Future[None] | None = None
    meshes: dict[str, Future[bool]] | None = None

    @property
    def file(self) -> Path:
        """File of the shares."""
        return self.chain.file("shares.nc")

    def begin(self, results: Results) -> None:
        """Set under way what needs no envelope: shares, and pictures of the mesh."""
        self.make_shares(results)
        if self.figures:
            self.meshes = figures.begin_meshes(results, self.executor)

    def make_shares(self, results: Results) -> None:
        """Set the shares under way where they are not up to date or under way."""
        key = shares_key(results)
        if self.making is None and not self.chain.current(self.file.name, key):
            told = attributes(results.case.text_of_file, key)
            self.say_cost(results)
            quiet = self.chain.quiet or self.executor is not None
            self.making = submitted(
                self.executor, write_shares, results, self.file, told, quiet=quiet
            )

    def say_cost(self, results: Results) -> None:
        """Tell how many envelopes the shares take."""
        study = shares.richest(results)
        if study and shares.of_width(results, study) and not self.chain.quiet:
            count = 1 + len(study.task.fuzzy)
            say(
                f"what drives the width: {count} envelopes more; [envelope] shares = false leaves"
                " them out"
            )

    def driving(self) -> xarray.Dataset:
        """The shares, once they are made."""
        if self.making is not None:
            self.making.result()
        return read_dataset(self.file)

    def drawn(self, results: Results) -> list[str]:
        """Names of all figures, which are drawn if they or what they show are new."""
        self.make_shares(results)
        key, folder = figures_key(results), self.chain.folder
        kept = figures.kept(folder, key)
        if not self.figures:
            if (folder / figures.KEPT).is_file():  # tells what the figures there show
                stage = figures.particle_pictures(results)
                figures.sweep(folder, [*figures.written_down(folder / figures.KEPT, key), *stage])
            return []
        if kept is not None and not self.chain.fresh:
            return kept
        meshes = self.meshes
        if meshes is None:
            meshes = figures.begin_meshes(results, self.executor)
        names = figures.draw(
            results, self.driving, meshes, executor=self.executor, quiet=self.chain.quiet
        )
        figures.sweep(folder, names)
        if all(made.result() for made in meshes.values()):
            figures.keep(folder, key, names)
        return names


def shares_key(results: Results) -> str:
    """Fingerprint of shares.nc, which says what drives the widths."""
    given = results.case.sections
    files = results.case.digests(*given.files)
    content = {"case": given, "files": files, "modulus": results.handed}
    return fingerprint(content, SOURCE)


def figures_key(results: Results) -> str:
    """Fingerprint of all that the figures show, and of what draws them."""
    content = {
        "shares": shares_key(results),
        "results": [data.attrs.get("fingerprint") for data in results.datasets],
        "libraries": [version_of(name) for name in ("matplotlib", "pyvista")],
    }
    return fingerprint(content, SOURCE)


def write_shares(
    results: Results, file: Path, told: Mapping[str, str | int], *, quiet: bool
) -> None:
    """Compute shares.nc, with the attributes of every result."""
    with progress("What drives the width", quiet=quiet) as tick:
        found = shares.dataset(results, tick)
    write_dataset(found, file, told)
