"""Command ``alphacut spectrum``: response spectrum of a record of the ground's motion."""

from __future__ import annotations

import argparse
import csv
import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

import numpy as np

from alphacut.commands.options import add_quiet, answer, with_unit
from alphacut.io import quantity
from alphacut.io.files import Document, say, write_text
from alphacut.io.problem import BadInput
from alphacut.stages.plausible import unlikely_ground
from alphacut.stages.vibration.accelerogram import accelerogram
from alphacut.stochastic.theta.truncated_normal import Array

if TYPE_CHECKING:
    from alphacut.frame.dynamics.response_spectrum import ResponseSpectrum

HEAD = (
    "damping",
    *("period [s]", "displacement [m]", "pseudo-velocity [m/s]", "pseudo-acceleration [m/s^2]"),
    *("error of the displacement [m]", "record"),
)
ABOUT = "response spectrum of a record of the ground's motion"
MOST = 2000
"""Periods, at most."""
TABLE = 12
"""Periods in the printed table."""


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    parser.add_argument(
        "record", metavar="RECORD", help="time [s],acceleration [m/s^2], [g] or [gal]; or AT2"
    )
    parser.add_argument(
        "--damping",
        metavar="RATIOS",
        action="append",
        help="share of the critical damping, as '2 %%,5 %%' or once for each (default 5 %%)",
    )
    parser.add_argument(
        "--shortest", metavar="PERIOD", default="0.05 s", help="shortest period (default 0.05 s)"
    )
    parser.add_argument(
        "--longest", metavar="PERIOD", default="4 s", help="longest period (default 4 s)"
    )
    parser.add_argument(
        "--count", metavar="N", type=int, default=120, help="periods, spread evenly (default 120)"
    )
    parser.add_argument(
        "--out", metavar="FOLDER", help="write spectrum.csv and a figure, spectrum.svg and .png"
    )
    add_quiet(parser)


def run(options: argparse.Namespace, petsc: Mapping[str, str], out: TextIO) -> int:
    """Compute, write and report."""
    from alphacut.frame.dynamics.response_spectrum import response_spectrum

    periods, ratios = wanted_periods(options), wanted_ratios(",".join(options.damping or ["5 %"]))
    ground = accelerogram(Path(options.record), "record")
    for remark in unlikely_ground("record", ground):
        say(f"warning: {remark}")
    try:
        found = [response_spectrum(ground, periods, ratio) for ratio in ratios]
    except ValueError as error:
        raise BadInput.of("--shortest, --longest", str(error)) from None
    if options.out:
        write(found, Path(options.record).name, Path(options.out))
    answer(options, document(found), out, table(found))
    return 0


def wanted_periods(options: argparse.Namespace) -> Array:
    """The periods, evenly spread by their logarithm."""
    ends = [one(option, getattr(options, option[2:])) for option in ("--shortest", "--longest")]
    if not 2 <= options.count <= MOST:
        got = str(options.count)
        raise BadInput.of("--count", "out of range", got, f"from 2 to {MOST}")
    if not 0 < ends[0] < ends[1]:
        got = f"{options.shortest} and {options.longest}"
        raise BadInput.of("--shortest, --longest", "out of range", got, "0 < shortest < longest")
    return np.asarray(np.geomspace(ends[0], ends[1], options.count))


def one(option: str, text: str) -> float:
    """A time in s; a bare number is one."""
    try:
        return quantity.number(with_unit(text, "s"), "s")
    except ValueError as error:
        raise BadInput.of(option, str(error), text, 'a time, as "0.05 s"') from None


def wanted_ratios(text: str) -> list[float]:
    """Damping ratios from ``2 %,5 %``."""
    allowed = '0 or greater and below 1, as "5 %" or "2 %,5 %"'
    try:
        found = [quantity.number(part, "") for part in text.split(",")]
    except ValueError as error:
        raise BadInput.of("--damping", str(error), text, allowed) from None
    if not all(0 <= ratio < 1 for ratio in found):
        raise BadInput.of("--damping", "out of range", text, allowed)
    if len(set(found)) < len(found):
        raise BadInput.of("--damping", "a ratio stands there twice", text, allowed)
    return found


def document(found: Sequence[ResponseSpectrum]) -> Document:
    """The spectra as they are printed with ``--json``, in SI."""
    return {
        "period_s": found[0].periods,
        "spectra": [
            {
                "damping": one.damping,
                "displacement_m": one.displacement,
                "error_m": one.error,
                "pseudo_velocity_m_per_s": one.pseudo_velocity,
                "pseudo_acceleration_m_per_s2": one.pseudo_acceleration,
            }
            for one in found
        ],
    }


def table(found: Sequence[ResponseSpectrum]) -> str:
    """Some periods with displacement and pseudo-acceleration of each ratio."""
    heads = [f"{100 * x.damping:.3g} %" for x in found]
    head = "".join(f"{f'displacement, {at}':>22}{f'pseudo-acc., {at}':>22}" for at in heads)
    lines = [f"{'period':>10}{head}"]
    rows = np.unique(np.linspace(0, len(found[0].periods) - 1, TABLE).round().astype(int))
    for row in rows:
        cells = "".join(
            f"{1000 * x.displacement[row]:>19.4g} mm{x.pseudo_acceleration[row]:>16.4g} m/s^2"
            for x in found
        )
        lines.append(f"{found[0].periods[row]:>8.3g} s{cells}")
    if len(found[0].periods) > len(rows):
        lines.append(f"{len(rows)} of {len(found[0].periods)} periods; --out has all")
    worst = max(float(x.error.max() / x.displacement.max()) for x in found)
    peak = max(float(x.pseudo_acceleration.max()) for x in found)
    lines.append(
        f"largest pseudo-acceleration {peak:.4g} m/s^2; a displacement may be wrong by up to"
        f" {worst:.1g} of the largest"
    )
    return "\n".join([*lines, ""])


def write(found: Sequence[ResponseSpectrum], record: str, folder: Path) -> None:
    """The table of all periods, and the figure."""
    from alphacut.figures.envelope import spectrum
    from alphacut.figures.style import save, style

    text = io.StringIO()
    lines = csv.writer(text, lineterminator="\n")
    lines.writerow(HEAD)
    for x in found:
        columns = (x.periods, x.displacement, x.pseudo_velocity, x.pseudo_acceleration, x.error)
        rows = zip(*columns, strict=True)
        lines.writerows([repr(x.damping), *map(float, row), record] for row in rows)
    write_text(folder / "spectrum.csv", text.getvalue())
    with style():
        save(spectrum(found), folder / "spectrum")
