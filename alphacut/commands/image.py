"""Command ``alphacut image``, also ``python -m rve image``: proved stiffness of an image."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TextIO

from alphacut.case.idle import require_read
from alphacut.case.load import load
from alphacut.commands.options import add_common, answer
from alphacut.io.files import Document, say
from alphacut.io.progress import progress
from alphacut.io.provenance import attributes, fingerprint
from alphacut.io.units import fixed
from alphacut.stages.image.bounds import compute
from alphacut.stages.image.document import document, interval, own_of_window, write
from alphacut.stages.image.phases import contradicted
from alphacut.stages.image.reading import study_of

ABOUT = "proved bounds of the stiffness of the material whose every section is an image"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    add_common(parser)
    parser.add_argument("--out", metavar="FILE.nc", help="write bounds and pictures as NetCDF")


def run(options: argparse.Namespace, petsc: Mapping[str, str], out: TextIO) -> int:
    """Compute and report."""
    case = load(options.case, options.set)
    require_read(case, ("cell", "modulus.alpha"), "image")
    study = study_of(case, petsc=petsc)
    for remark in contradicted(case, study):
        say(f"warning: {remark}")
    kept = Path(options.out).with_suffix(".partial") if options.out else None
    with progress("Image", quiet=options.quiet) as tick:
        found = compute(study, progress=tick, kept=kept)
    if kept:
        inputs = {"case": case.sections, "petsc": dict(petsc)}
        key = fingerprint(inputs, ("stochastic", "rve", "fuzzy"))
        write(found, Path(options.out), attributes(case.text_of_file, key), kept)
    numbers = document(found)
    if answer(options, numbers, out, summary(numbers)) and not options.out:
        say("to hand this on: the same command with --out image.nc, then modulus.file")
    return 0


def summary(found: Document) -> str:
    """The bounds in a few lines for people."""
    cuts = found["cuts"]
    columns = (cuts["alpha"], *(cuts["E_GPa"][x] for x in ("lower", "upper")), cuts["nature"])
    rows = "".join(
        f"{alpha:5.2f}  {low:10.5f}  {high:10.5f}  {nature}\n"
        for alpha, low, high, nature in zip(*columns, strict=True)
    )
    bulk, grains = found["plane_strain_bulk_GPa"], found["grains_E_GPa"]
    own = own_of_window(found)
    place = f"over the inputs at α = {cuts['alpha'][-1]:g}"
    place += ", of the window's tiles and not of the material" if own else ""
    return "".join(f"{line}\n" for line in (*found["phases"], found["boundary"])) + (
        "alpha  lower GPa   upper GPa   (E of eq. 16, plane strain: not E_T, the transverse Young's"
        f" modulus of a fibre composite)\n{rows}"
        f"{place}:\n"
        f"  width of the stiffness's bounds: {found['width']:.2e}\n"
        f"  plane-strain bulk modulus: {interval(bulk)}\n{anisotropy(found)}{quantiles(found)}"
        f"  if the particles are grains, E (Hashin-Shtrikman): {interval(grains)}\n"
        f"{own and own + chr(10)}"
        f"{table_of(found['error_table'])}"
        f"{found['iterations']} iterations, {found['seconds']:.1f} s\n"
    )


def anisotropy(found: Document) -> str:
    """E over all directions, and the nearest isotropic tensor, in two lines."""
    turned, nearest = found["directions_E_GPa"], found["isotropic"]
    return (
        f"  plane-strain Young's modulus of the softest direction: {interval(turned['least'])}, "
        f"of the stiffest: {interval(turned['greatest'])}\n"
        f"  middle of these bounds, nearest isotropic tensor: plane-strain bulk"
        f" {fixed(nearest['plane_strain_bulk_GPa'], 4)} GPa, shear"
        f" {fixed(nearest['shear_GPa'], 4)} GPa, {nearest['distance']:.1%} away\n"
    )


def quantiles(found: Document) -> str:
    """Quantiles of E over a random threshold at the top level, in lines; empty without one."""
    random = found["random_threshold"]
    rows = random["quantiles"] if random else []
    return "".join(
        f"  quantile {row['share']:g} of E: {interval(row['E_GPa'][-1])}\n" for row in rows
    )


def table_of(rows: Sequence[Document]) -> str:
    """The error table in lines, the source to improve first on top."""
    lines = "".join(
        f"{row['source']:<15} {row['width_GPa']:9.3g} GPa {row['share']:6.1%}  {row['cure']}\n"
        for row in rows
    )
    return f"what widens E, the source to improve first on top:\n{lines}"
