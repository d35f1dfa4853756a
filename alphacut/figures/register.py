"""The figures of a run, each registered in one entry; those of answers stand with their analyses.

A new figure is a function that draws it, and an entry here.
"""

from __future__ import annotations

import re
from typing import Literal, NamedTuple

from alphacut.case.analyses import ANALYSES


class RunFigure(NamedTuple):
    """A figure of a run.

    Args:
        caption: Its caption on the page.
        draw: Place "module:function" of the function that draws it, imported at first use. It takes
            the results of the run; of a study also its task, and of an output the output's name
            too. It returns None where the results have no such figure. Empty where a stage draws
            the figure itself, since what it shows is not kept.
        section: Name of the section of the page, which shows its figures in the order of
            `FIGURES`; empty for the last section, of all other figures.
        of: What has one such figure: the run, each study, or each drawn output of a study.
    """

    caption: str
    draw: str = ""
    section: str = ""
    of: Literal["run", "study", "output"] = "run"


FIGURES: dict[str, RunFigure] = {
    "pbox": RunFigure(
        "Measured distribution of the reduced radius, and the p-box of its fuzzy map",
        section="microstructure",
    ),
    "radius_map": RunFigure("Fuzzy map from θ to the reduced radius"),
    "image_circles": RunFigure("Circles that stand for the particles, drawn over the image"),
    "modulus": RunFigure("Fuzzy effective modulus", "alphacut.figures.all:modulus", "modulus"),
    "image": RunFigure(
        "The image as segmented, and the proved bounds of E",
        "alphacut.figures.all:image",
        "image",
    ),
    "update-inputs": RunFigure(
        "Inputs before and after the measurement, level by level",
        "alphacut.figures.all:inputs_learned",
        "update",
    ),
    "structure": RunFigure(
        "The model at its nominal values: weight of each floor, stiffness and height of each"
        " storey; orange storeys yield",
        "alphacut.figures.all:sketch",
        "structure",
    ),
    "spectra": RunFigure(
        "Spectra of the scaled records, their mean and median, and the target spectrum",
        "alphacut.figures.all:spectra",
        "records",
    ),
    "envelope": RunFigure("Envelope of", "alphacut.figures.envelope:envelope_of", of="output"),
    "profile": RunFigure(
        "Peaks over the height: bands by α, lines at the highest α, dots at the farthest attained"
        " peak",
        "alphacut.figures.all:profiles",
        "envelopes",
        "study",
    ),
    "loops": RunFigure(
        "Shear over drift of the storeys that yield",
        "alphacut.figures.all:loops",
        "envelopes",
        "study",
    ),
}
"""Figures by the beginning of their names; "-STUDY" or "-STUDY-OUTPUT" follows it."""


def caption(name: str) -> str:
    """Return the caption of a figure from its name.

    Args:
        name: Name of the file without its ending. "figNUMBER-" before it gives the number in the
            paper, with which the caption begins. A figure that is not registered has its name as
            its caption, with blanks for the hyphens.
    """
    number = ""
    rest = name
    if match := re.fullmatch(r"fig(\d+)-(.+)", name):
        number = f"Fig. {match[1]}: "
        rest = match[2]
    captions = {name: figure.caption for name, figure in FIGURES.items()}
    for analysis in ANALYSES.values():
        captions |= {name: picture.caption for name, picture in analysis.pictures.items()}
    if rest in captions:
        return number + captions[rest]
    kind, _, study = rest.partition("-")
    figure = FIGURES.get(kind)
    if figure is None or figure.of == "run":
        return number + rest.replace("-", " ")
    text = figure.caption
    if figure.of == "output":
        study, _, output = study.rpartition("-")
        text += f" {output}"
    if study != "all":  # the name of the study that [envelope] alone makes
        text += f", study {study}"
    return number + text
