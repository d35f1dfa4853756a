"""Measured frames: are modes that were held out predicted, or is the shear frame refuted?

Two frames whose natural modes were published with the package SMU (Y. Wang, X. Dong, D. Li, Y.
Otsuki: github.com/ywang-structures/Structural-Model-Updating, folder Examples): a four-storey
laboratory frame (FourStoryStructure; the case cases/laboratory-frame.toml), and the steel frame of
18 storeys at a third of its scale that was shaken at E-Defense in 2014 (EighteenStoryStructure;
Suita, Suzuki and Takahashi, International Journal of High-Rise Buildings 4, 2015), measured at
every third floor. Masses were weighed; stiffnesses may be 30 % off. No scatter was published: 1 %
of a frequency and 2 % of a shape are assumed. Writes benchmarks/results/measured_frames.csv.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from alphacut.case.content import load
from alphacut.frame import StoreyFrame
from alphacut.frame.identify import MeasuredMode, RefutedError, identify, measured_mode
from alphacut.frame.identify.modes import Chain, eigenvalue_ranges
from alphacut.fuzzy import Interval
from alphacut.stages.identify import IdentifiedResult, identify_inputs
from benchmarks.rows import write

ROOT = Path(__file__).parents[2]
FLOORS = (3, 6, 9, 12, 15, 18)
FREQUENCIES = (0.86517642, 2.68683262, 4.84910401)
SHAPES = (
    (0.19734211, 0.39201274, 0.57866593, 0.75191915, 0.90246834, 1.0),
    (-0.6084212, -0.89503499, -0.7511404, -0.22071769, 0.50537524, 1.0),
    (0.90395832, 0.62024159, -0.46043073, -0.96783845, -0.04978843, 1.0),
)
STIFFNESS = 1e5 * np.array(
    [1155, 1092, 1073, 1028, 1028, 990, 963, 938, 876, 840, 824, 788, 712, 660, 619, 562, 491, 363]
)
WEIGHT = 1e3 * np.array([208] * 11 + [206] * 6 + [202])
GRAVITY = 9.8


def tall_frame() -> StoreyFrame:
    """The frame of 18 storeys; its stiffnesses are carried by the columns alone."""
    return StoreyFrame([*WEIGHT / GRAVITY], [1.0] * 18, 1.0, 1.0, columns=[*STIFFNESS / 12])


def tall_modes(modes: Sequence[int]) -> list[MeasuredMode]:
    """Some of its measured modes."""
    return [
        measured_mode(
            mode,
            [FREQUENCIES[mode - 1]],
            {floor: [x] for floor, x in zip(FLOORS, SHAPES[mode - 1], strict=True)},
            frequency_deviation=0.01,
            shape_deviation=0.02,
        )
        for mode in modes
    ]


def tall_rows() -> list[dict[str, object]]:
    """The third mode of the tall frame: predicted from the priors, and learned from with them."""
    frame = tall_frame()
    prior = {f"c{z + 1}": Interval(0.7 * k, 1.3 * k) for z, k in enumerate(STIFFNESS / 12)}
    ends = np.full(18, np.log(0.7)), np.full(18, np.log(1.3))
    low, high = (np.sqrt(x[2]) / (2 * np.pi) for x in eigenvalue_ranges(Chain(frame, prior), *ends))
    verdicts = []
    for modes in ((1, 2), (1, 2, 3)):
        try:
            result = identify(frame, prior, tall_modes(modes), alpha=(0.05,))
            verdicts.append("agree")
        except RefutedError:
            verdicts.append("refuted")
            continue
        if modes == (1, 2):
            low, high = (end[0, 2] for end in result.predictions())
    return [row("E-Defense, 18 storeys", 3, (float(low), float(high)), FREQUENCIES[2], *verdicts)]


def laboratory_rows() -> list[dict[str, object]]:
    """Modes 3 and 4 of the laboratory frame, predicted from the first two."""
    content = load(ROOT / "cases" / "laboratory-frame.toml").content
    assert content.frame is not None
    assert content.identify is not None
    found, _ = identify_inputs(
        content.identify, content.frame.structure(), (0.05, 0.25, 0.5, 0.75, 1.0)
    )
    assert isinstance(found, IdentifiedResult)
    name = "laboratory, 4 storeys"
    return [row(name, x.mode, x.predicted, x.measured, "agree", "") for x in found.held_out]


def row(
    frame: str, mode: int, ends: tuple[float, float], measured: float, learned: str, together: str
) -> dict[str, object]:
    """A row of the table: ends of a mode's predicted frequency, and the verdicts on the frame."""
    return {
        "frame": frame,
        "mode": mode,
        "low": ends[0],
        "high": ends[1],
        "measured": measured,
        "inside": ends[0] <= measured <= ends[1],
        "learned_from": learned,
        "all_modes": together,
    }


def main(arguments: Sequence[str] | None = None) -> None:
    """Predict, compare, print and write the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path(__file__).parents[1] / "results")
    options = parser.parse_args(arguments)
    rows = [*laboratory_rows(), *tall_rows()]
    write(rows, options.out / "measured_frames.csv")
    print(*rows, sep="\n")


if __name__ == "__main__":
    main()
