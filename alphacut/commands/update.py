"""Command ``alphacut update``: what measured modes or motion say about a frame's inputs."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

from alphacut.case.idle import require_read
from alphacut.case.load import load
from alphacut.commands.options import add_common, add_modulus, answer, changes, given_modulus
from alphacut.io.files import as_json, write_text
from alphacut.io.progress import progress
from alphacut.stages.material.modulus import stand_in
from alphacut.stages.vibration.structure import structure
from alphacut.stages.vibration.update import Learned, envelopes, learned, narrower, sentences

if TYPE_CHECKING:
    import xarray

ABOUT = "learn inputs of a frame from its modes or its motion"
READ = ("frame", "field", "envelope", "update", "modulus")


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    add_common(parser)
    add_modulus(parser)
    parser.add_argument(
        "--out",
        metavar="FOLDER",
        help="write update.json, and figures of the inputs and of the envelope before and after",
    )


def run(options: argparse.Namespace, petsc: Mapping[str, str], out: TextIO) -> int:
    """Learn and report; status 0 also where the measurement refutes the frame."""
    case = load(options.case, changes(options, {}))
    require_read(case, READ, "update")
    if case.sections.update is None:
        raise case.without("update")
    folder = Path(options.out) if options.out else None
    wanted = structure(case, given_modulus(options.modulus) or stand_in(case))
    found = learned(case, wanted)
    document: dict[str, Any] = {**found.document(), "sections": case.traces(*READ)}
    bands = None
    if folder is not None and found.posterior is not None and case.sections.envelope is not None:
        with progress("Envelopes", quiet=options.quiet) as tick:
            bands = envelopes(case, wanted, found, tick)
        document["envelope_width"] = narrower(bands)
    if folder is not None:
        folder.mkdir(parents=True, exist_ok=True)
        document["figures"] = draw(folder, found, bands)
        write_text(folder / "update.json", as_json(document, indent=2))
    answer(options, document, out, "\n".join([*sentences(document), ""]))
    return 0


def draw(folder: Path, found: Learned, bands: xarray.Dataset | None) -> list[str]:
    """Figures of the inputs and of each output's envelope; names of the files."""
    from alphacut.figures import questions as figures
    from alphacut.figures.style import save, style

    if found.posterior is None:
        return []
    with style():
        drawn = save(figures.boxes(found), folder / "update-inputs")
        if bands is not None:
            for output in map(str, bands["output"].values):
                drawn += save(figures.bands(bands, output), folder / f"update-{output}")
    return [path.name for path in drawn]
