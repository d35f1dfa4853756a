"""Command ``alphacut identify``: inputs of a frame from its measured modes."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from typing import TextIO

from alphacut.case.load import load
from alphacut.commands.options import add_common, add_modulus, answer, modulus_option
from alphacut.fuzzy.refused import RefusedError
from alphacut.report.tables import run_text
from alphacut.stages.identify import learned

ABOUT = "inputs of a frame from its measured natural modes"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the options of the command."""
    add_common(parser)
    add_modulus(parser)


def run(options: argparse.Namespace, petsc: Mapping[str, str], out: TextIO) -> int:
    """Identifies and reports; status 0 also where the measurement refutes the frame."""
    content = load(options.case, options.set).content
    if content.identify is None or content.frame is None or content.envelope is None:
        raise RefusedError("identify", None, "sections [identify], [frame] and [envelope]")
    frame = content.frame.structure(modulus_option(options.modulus))
    document, _ = learned(content.identify, frame, content.envelope.alpha)
    answer(options, document, out, run_text({"update": document}))
    return 0
