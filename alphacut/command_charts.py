"""``alphacut charts``: what the methods cost and how well they do, measured on this machine."""

from __future__ import annotations

import argparse
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import TextIO

from alphacut.output import as_json, write_text
from alphacut.problem import BadInput, Problem

ABOUT = "measure what the methods cost on this machine, into benchmarks/results (needs a checkout; takes a while)"
CHARTS = ("cell_charts", "frame_integrators", "frame_envelopes", "frame_failures")
FOLDER = Path(__file__).resolve().parent.parent / "benchmarks"


def programs() -> list[str]:
    """Names of the benchmarks of this checkout: the files of the folder that are programs."""
    return [file.stem for file in sorted(FOLDER.glob("*_*.py")) if "__main__" in file.read_text(encoding="utf-8")]


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    parser.add_argument("names", metavar="NAME", nargs="*", help=f"which of benchmarks/ (default: {', '.join(CHARTS)})")
    parser.add_argument("--json", metavar="FILE", help="write the names of those that were run as JSON; - for standard output")
    parser.add_argument("--quiet", action="store_true", help="print nothing")


def run(options: argparse.Namespace, petsc: Mapping[str, str], out: TextIO) -> int:
    """Run each as a program of its own."""
    known = programs()
    if not known:
        raise BadInput(
            Problem("charts", "there are no benchmarks here", allowed="in a checkout of the project, where the folder benchmarks is")
        )
    for name in options.names:
        if name not in known:
            raise BadInput(Problem("charts", "there is no such benchmark", name, ", ".join(known)))
    for name in options.names or CHARTS:
        stream = subprocess.DEVNULL if options.quiet or options.json == "-" else None
        done = subprocess.run([sys.executable, "-m", f"benchmarks.{name}"], cwd=FOLDER.parent, stdout=stream, check=False)
        if done.returncode:
            raise RuntimeError(f"the benchmark {name} ended with status {done.returncode}; its own messages are above")
    document = as_json({"run": options.names or CHARTS})
    if options.json == "-":
        out.write(document)
    elif options.json:
        write_text(options.json, document)
    return 0
