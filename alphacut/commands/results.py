"""Whole cases and the folder of their results, as commands open them."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import replace
from pathlib import Path

from alphacut.case.load import Case, load
from alphacut.commands.options import require_case_petsc
from alphacut.fuzzy.refused import require
from alphacut.io.files import locked, rank, require_writable, say
from alphacut.io.results import MANIFEST, ResultsFolder
from alphacut.stages.store import StageStore


def read_case(options: argparse.Namespace) -> Case:
    """The case file that the options name, with the changes of ``--set``."""
    case = load(options.case, options.set)
    require_case_petsc(options.petsc, case.content)
    return case


@contextmanager
def open_results(
    options: argparse.Namespace, folder: str = ""
) -> Iterator[tuple[Case, StageStore]]:
    """Yields the case and the store of its results, whose folder is locked during the block.

    `folder` is that of the results where ``--out`` is left out; empty to write nothing.
    """
    allowed = "a whole number 1 or more"
    require(options.workers >= 1, "--workers", value=options.workers, allowed=allowed)
    case, path = read_case(options), options.out or folder
    fresh = getattr(options, "fresh", False)
    store = StageStore(None, case.text, fresh, options.quiet, options.workers)
    if not path:
        yield case, store
        return
    require_writable("--out", path, folder=True)
    with locked("--out", Path(path)) if rank() == 0 else nullcontext():
        results = ResultsFolder.read(Path(path))
        if results.is_damaged:
            say(f"warning: {results.path / MANIFEST} is damaged; everything is computed anew")
        if fresh and rank() == 0:
            results.clear()
        yield case, replace(store, folder=results)
