"""Figures of a run: what of them is up to date, and their making side by side."""

from __future__ import annotations

from concurrent.futures import Executor, Future
from dataclasses import dataclass

import xarray

from alphacut.figures import all as figures
from alphacut.io.provenance import NESTED, fingerprint, version_of
from alphacut.stages.results import Results
from alphacut.stages.store import Store


@dataclass
class Showing:
    """The figures of a run; those that are not up to date are drawn anew.

    Args:
        store: Folder of the results.
        figures: Whether figures are drawn.
        executor: Processes that share the work; None: this one does it.
    """

    store: Store
    figures: bool
    executor: Executor | None
    meshes: dict[str, Future[bool]] | None = None

    def begin(self, results: Results) -> None:
        """Sets under way what needs no envelope: pictures of the mesh."""
        if self.figures:
            self.meshes = figures.begin_meshes(results, self.executor)

    def drawn(self, results: Results) -> list[str]:
        """Names of all figures, which are drawn if they or what they show are new."""
        if not self.figures:
            return []
        key, folder = figures_key(results), self.store.folder
        kept = figures.kept(folder, key)
        if kept is not None and not self.store.fresh:
            return kept
        meshes = self.meshes
        if meshes is None:
            meshes = figures.begin_meshes(results, self.executor)
        shares = results.shares if results.shares is not None else xarray.Dataset()
        names = figures.draw(
            results, shares, meshes, executor=self.executor, quiet=self.store.quiet
        )
        figures.sweep(folder, names)
        if all(made.result() for made in meshes.values()):
            figures.keep(folder, key, names)
        return names


def figures_key(results: Results) -> str:
    """Fingerprint of all that the figures show, and of what draws them."""
    content = {
        "content": results.content,
        "results": {name: x.attrs.get("fingerprint") for name, x in results.datasets.items()},
        "libraries": [version_of(name) for name in ("matplotlib", "pyvista")],
    }
    return fingerprint(content, (*NESTED, "alphacut"))
