"""The commands: what each does in a line, its options, and the function that runs it."""

from __future__ import annotations

import argparse

from alphacut.commands.options import Command, add_common, add_quiet, add_run


def add_cell(parser: argparse.ArgumentParser) -> None:
    """Add the options of ``cell``.

    They are those of every command on a case, --method and --export.
    """
    add_common(parser)
    parser.add_argument(
        "--method",
        dest="set",
        action="append",
        type="modulus.method={}".format,  # --method is a short form of --set: it is checked there
        help="model of the cell, or auto; short for --set",
    )
    parser.add_argument(
        "--export", metavar="FILE", help="mesh, displacements, stresses: .msh, .vtu, .xdmf"
    )


def add_modulus(parser: argparse.ArgumentParser, default_place: str = "nothing is kept") -> None:
    """Add the options of a command that computes stage modulus."""
    add_run(parser, default_place)
    about = "where an image is solved: cpu (default), or cuda by CuPy"
    parser.add_argument("--device", choices=("cpu", "cuda"), default="cpu", help=about)


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of a run."""
    add_modulus(parser, "results/NAME")
    parser.add_argument("--fresh", action="store_true", help="compute everything anew")
    parser.add_argument("--no-figures", action="store_true", help="numbers only")


def add_page(parser: argparse.ArgumentParser) -> None:
    """Add the options of a report to a parser, in place.

    They are `folder`, a list of one or more, the files and folders `out`, `csv` and `tables`, which
    are None by default, `json` and `quiet`.
    """
    parser.add_argument(
        "folder", metavar="FOLDER", nargs="+", help="results of a run; of several to compare them"
    )
    parser.add_argument(
        "--out", metavar="FILE.html", help="file for the page (default: FOLDER/report.html)"
    )
    parser.add_argument("--csv", metavar="FOLDER", help="folder for every table as a CSV file")
    parser.add_argument("--tables", metavar="FOLDER", help="folder for every table in LaTeX")
    add_quiet(parser)


def add_folder(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of ``verify``."""
    parser.add_argument("folder", metavar="FOLDER", help="results of a run, as results/wind")
    add_quiet(parser)


def add_section(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of ``keys``."""
    about = "one section, as cell or records.spectrum (default: all)"
    parser.add_argument("section", metavar="SECTION", nargs="?", default="", help=about)
    add_quiet(parser)


COMMANDS = {
    "run": Command("run every stage of a case: files, figures, summary", add_options, "run:run"),
    "check": Command(
        "check a case, and print what it was read as and its first natural period",
        add_common,
        "check:check",
    ),
    "microstructure": Command(
        "from particles, packed or measured, to the random radius and its fuzzy map",
        add_run,
        "run:microstructure",
    ),
    "cell": Command(
        "effective modulus and stresses of the cell at the nominal values", add_cell, "cell:run"
    ),
    "modulus": Command(
        "fuzzy effective modulus of the cell or of the image", add_modulus, "run:modulus"
    ),
    "identify": Command(
        "inputs of a frame from its measured natural modes", add_common, "run:identify"
    ),
    "report": Command("one self-contained HTML page of a run's results", add_page, "run:report"),
    "keys": Command(
        "keys of case files with their units, ranges and defaults", add_section, "keys:run"
    ),
    "verify": Command(
        "test the proved envelopes of a run by exact motions, without the proof",
        add_folder,
        "verify:verify",
    ),
}
"""Commands by the names that a user writes."""
