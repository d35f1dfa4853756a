"""Commands that check: ``check`` a case before it runs, ``verify`` proved envelopes after that."""

from __future__ import annotations

import argparse
import json
import re
from collections.abc import Iterator, Sequence
from math import pi
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

import numpy as np

from alphacut.base.errors import require
from alphacut.base.number_text import MINUS, STANDARD_GRAVITY, engineering, percent_text, text_table
from alphacut.case.loads import ForceHistory, RecordsSection
from alphacut.case.parse import quantity_of
from alphacut.case.structure import MaterialDamping
from alphacut.case.types import Section
from alphacut.commands.options import Command, add_common, add_quiet, write_answer
from alphacut.commands.pipeline import cut_record_warnings, read_case, require_runnable
from alphacut.frame import Exact, History, LinearFlow
from alphacut.frame.analyses.peaks import WIDENING
from alphacut.frame.analyses.suites import NominalMode, ScaledRecord, nominal_mode
from alphacut.frame.boxes import AT_REST
from alphacut.frame.envelope import Ends, Envelope, within_steps
from alphacut.frame.methods.sampled import PeakSearch
from alphacut.frame.structures.linear import LinearSystem, NominalModes, nominal_modes
from alphacut.frame.structures.matrix import Monomial
from alphacut.frame.structures.storey import yields
from alphacut.frame.verification.self_test import Trial, stored_motions
from alphacut.frame.verification.step_error import node_deviation
from alphacut.fuzzy import Crisp, FuzzyNumber, Interval, Trapezoidal, Triangular
from alphacut.fuzzy.result import Nature
from alphacut.io.quantity import QUANTITIES
from alphacut.io.results import ResultsFolder
from alphacut.report.results import agreement
from alphacut.rve.cell.cell import VoigtPhase
from alphacut.stages.cell import GPA
from alphacut.stages.envelope import tasks
from alphacut.stages.foreseen import foreseen_structure
from alphacut.stages.image import study_of
from alphacut.stages.suite import analyses_of, suite_records

if TYPE_CHECKING:
    import xarray

USUAL_PERIODS = 1e-3, 30.0  # in s: towers have 10 s at most, machine parts seldom below 1 ms
LEAST_MODES, MAX_MODES = 3, 8
"""Modes that are shown, if the structure has as many."""
UNUSUAL = ", unusual"
"""Mark of the kind of a quantity that structures and their materials seldom have."""
KINDS = {Crisp: "crisp", Interval: "interval", Triangular: "triangle", Trapezoidal: "trapezoid"}
Row = tuple[str, str, str]


def check(options: argparse.Namespace, out: TextIO) -> int:
    """Checks a case, and shows how it was read and its first period; returns exit status 0."""
    content = read_case(options).content
    study_of_image = require_runnable(content)
    rows = list(rows_of("", content))
    structure = foreseen_structure(content) if "envelope" in content.stages else None
    linear = None if structure is None else structure.linear
    modes = nominal_modes(linear) if linear else None
    period = 2 * pi / float(modes.frequencies[0]) if modes else None
    document = {
        "case": options.case,
        "stages": list(content.stages),
        "period_s": period,
        "modes": modes_document(modes) if modes else None,
        "inputs": [dict(zip(("key", "value", "kind"), row, strict=True)) for row in rows],
    }
    text = text_table(("key", "value", "kind"), rows)
    for key, value, kind in rows:
        if kind.endswith(UNUSUAL):
            text += f"warning: {key} is {value}, which is unusual: is its unit right?\n"
    if content.image_cell is not None:
        study = study_of_image or study_of(content.image_cell)
        shares = study.fractions.items()
        text += f"image: {study.extent}\n"
        text += f"phases: {', '.join(f'{name} {share:.2%}' for name, share in shares)}\n"
    if modes and period:
        text += f"first natural period: {period:.4g} s, at the most plausible values\n"
        if not USUAL_PERIODS[0] <= period <= USUAL_PERIODS[1]:
            text += (
                "this is an unusual period: are units right, mass and stiffness not exchanged?\n"
            )
        text += modes_text(modes)
    section = content.structure_section
    if section is not None:
        text += "".join(f"warning: {line}\n" for line in section.warnings(structure))
    if structure and linear and (record := linear.ground):
        peak = engineering(record.extremes[0], "m/s^2")
        in_g = f"{record.extremes[0] / STANDARD_GRAVITY:.3g} g"
        text += f"record: {len(record.samples)} samples of {record.step:g} s, peak {peak}, {in_g}\n"
        warnings = cut_record_warnings(content, structure)
        text += "".join(f"{warning}\n" for warning in warnings)
    if linear and content.envelope is not None and content.records is None:
        times = content.envelope.duration, content.envelope.step
        text += "".join(f"warning: {line}\n" for line in long_steps(linear, *times))
    if content.records is not None and content.envelope is not None and structure and linear:
        records = suite_records(content.records, content.envelope, structure)
        text += records_text(content.records, records, nominal_mode(linear))
        strongest = max(records, key=lambda record: record.measures["Sa(T1)"])
        if yields(linear):
            step = content.envelope.step
            duration = step * round(strongest.duration / step)
            moved = linear.moved_by(strongest.ground)
            text += "".join(f"warning: {line}\n" for line in long_steps(moved, duration, step))
        question = content.incremental_question
        if question is not None:
            (task,) = tasks(content.envelope, ())
            analyses = analyses_of(question, structure, task, records)
            motions, seconds = np.sum([x.foresee() for x in analyses.values()], axis=0)
            text += f"fragility: about {motions:,.0f} motions, {seconds:.0f} s by one process\n"
            text += f"before that the peaks under {len(records)} records, whose searches of up to"
            text += f" {PeakSearch.budget:,} motions each are not foreseen\n"
    write_answer(options, document, out, f"{text}{options.case}: no problems\n")
    return 0


def modes_document(modes: NominalModes) -> dict[str, object]:
    """Periods in s, damping ratios, effective masses in kg and the moved mass, for JSON."""
    return {
        "periods_s": (2 * pi / np.maximum(modes.frequencies, 1e-300)).tolist(),
        "damping_ratios": modes.damping_ratios.tolist(),
        "effective_masses_kg": modes.effective_masses.tolist(),
        "moved_mass_kg": modes.moved_mass,
    }


def modes_text(modes: NominalModes) -> str:
    """Table of the first modes, up to 90 % of the mass but at most `MAX_MODES`; then the weight."""
    moved = modes.moved_mass
    shares = modes.effective_masses / moved if moved else np.zeros_like(modes.effective_masses)
    needed = int(np.searchsorted(np.cumsum(shares), 0.9)) + 1
    rows = []
    for k in range(min(max(needed, LEAST_MODES), MAX_MODES, len(shares))):
        period = engineering(2 * pi / max(float(modes.frequencies[k]), 1e-300), "")
        mass = percent_text(float(shares[k])) if moved else "–"
        rows.append((f"{k + 1}", f"{period} s", percent_text(modes.damping_ratios[k], 2), mass))
    text = text_table(("mode", "period", "damping ratio", "effective mass"), rows)
    if moved:
        weight = engineering(moved * STANDARD_GRAVITY, "N")
        text += f"total weight: {weight}, of {moved:,.6g} kg that move with the ground\n"
    return text


def long_steps(linear: LinearSystem, duration: float, step: float) -> Iterator[str]:
    """Yields a sentence for each output whose peak may rise much between nodes a step apart.

    Both are those of the motion at the most plausible values. Of columns that yield all peaks but
    those of accelerations are found between nodes as well; these are judged by the motion of the
    initial stiffness.
    """
    has_events = yields(linear)
    if has_events:
        read_at_nodes = [name for name in linear.outputs if linear.unit_of(name) == "m/s^2"]
        if not read_at_nodes:
            return
        linear = linear.elastic().with_outputs(read_at_nodes)
    flow = LinearFlow(linear, (), duration, step, Exact(), by_modes=False)
    nominal = np.zeros((1, 0))
    size, between = np.abs(flow.values(nominal)[0]).T, node_deviation(flow, nominal).T
    peaks = np.maximum(size.max(1), AT_REST * flow.reach())  # at rest rounding alone moves
    widening = within_steps(size, between).max(1) / peaks - 1
    for name, share in zip(linear.outputs, widening, strict=True):
        if share > WIDENING:
            if has_events:
                what = f"the step of {step:g} s is too coarse: its peak may be missed"
                most = "altogether" if share >= 1 else f"by about {share:.1%}"
                yield f"{name}: {what} {most} between nodes"
            else:
                what = f"the step of {step:g} s widens its bound by about {share:.1%}"
                yield f"{name}: {what} between nodes, one of {step / 2:g} s by {share / 4:.1%}"


def records_text(
    section: RecordsSection, records: Sequence[ScaledRecord], mode: NominalMode
) -> str:
    """Table of a suite's records, as their files hold them and as they are used; then warnings."""
    rows = []
    for raw, record in zip(section.recordings, records, strict=True):
        counts = f"{raw.step:g} s", f"{len(raw.samples)}", percent_text(raw.mean_to_peak_ratio, 2)
        peaks = raw.peak, record.measures["PGA"], record.measures["Sa(T1)"]
        sizes = (f"{peak / STANDARD_GRAVITY:.3g} g" for peak in peaks)
        file_cells = raw.name, raw.file_format, raw.unit
        rows.append((*file_cells, *counts, *sizes, f"{record.duration:.4g} s"))
    head = ("record", "format", "unit", "step", "samples", "mean/peak", "peak", "PGA used")
    text = text_table((*head, "Sa(T1) used", "motion"), rows)
    text += (
        f"Sa(T1): pseudo-acceleration ω² max |u| at T1 = {mode.period:.4g} s with the structure's"
    )
    text += f" own damping ratio, {percent_text(mode.ratio)}\n"
    return text + "".join(f"warning: {x}\n" for record in records for x in record.warnings)


def rows_of(prefix: str, section: Section) -> Iterator[Row]:
    """Rows (key, value, kind) of every quantity of a section, and of the sections below it."""
    for key, info in type(section).model_fields.items():
        value, unit = getattr(section, key), quantity_of(info)
        entries = (
            {f"[{n}]": x for n, x in enumerate(value, 1)} if type(value) is tuple else {"": value}
        )
        if isinstance(value, dict):
            entries = {f".{name}": x for name, x in value.items()}
        is_default = key == "columns" and getattr(section, "stiffness", None) is None
        is_shown = section.has_key(key) or is_default
        for index, entry in entries.items():
            row_key = f"{prefix}{key}" + (index if index != "[1]" or len(entries) > 1 else "")
            match entry:
                case Section():
                    yield from rows_of(f"{row_key}.", entry)
                case FuzzyNumber() if is_shown:
                    words = _numbers(entry, unit.si if unit else "")
                    words += " in SI" * (key == "parameters")  # of matrices, in any unit
                    kind = KINDS.get(type(entry), "fuzzy") if section.has_key(key) else "default"
                    mark = _mark_of_size(entry, unit.si) if unit else ""
                    yield row_key, words, kind + mark
                case (FuzzyNumber() as force, str(si)):
                    kind = KINDS.get(type(force), "fuzzy") + _mark_of_size(force, si)
                    yield row_key, _numbers(force, si), kind
                case ForceHistory(History(frequency=omega)) if omega:
                    hertz, period = (engineering(x, "") for x in (omega / (2 * pi), 2 * pi / omega))
                    yield row_key, f"{hertz} Hz, period {period} s", "harmonic"
                case (Monomial() as factor, np.ndarray() as array):
                    size, largest = " × ".join(map(str, array.shape)), abs(array).max()
                    yield row_key, f"{factor} × matrix {size}, largest {largest:.4g}", "in SI"
                case MaterialDamping(joints):
                    words = f"of the material, and {_numbers(joints, '')} of joints"
                    yield row_key, words, "computed"
                case VoigtPhase(rows):
                    stiffness = " | ".join(" ".join(f"{x / GPA:g}" for x in row) for row in rows)
                    yield row_key, stiffness.replace("-", MINUS), "GPa, plane strain"
                case float() if unit and unit.si and is_shown:
                    yield row_key, engineering(entry, unit.si), "number"


def _mark_of_size(number: FuzzyNumber, si: str) -> str:
    """Return `UNUSUAL` if a quantity, in the SI unit `si`, is 0 nowhere and of an unusual size."""
    smallest, largest = QUANTITIES[si].usual
    sizes = [abs(end) for end in number.support]
    is_usual = min(sizes) == 0 or (smallest <= min(sizes) and max(sizes) <= largest)
    return "" if is_usual else UNUSUAL


def _numbers(number: FuzzyNumber, unit: str) -> str:
    corners = dict.fromkeys((number.support.lower, *number.cut(1.0), number.support.upper))
    return " … ".join(engineering(x, unit) for x in corners)


def add_folder(parser: argparse.ArgumentParser) -> None:
    """Adds the arguments of ``verify``."""
    parser.add_argument("folder", metavar="FOLDER", help="results of a run, as results/wind")
    add_quiet(parser)


def verify(options: argparse.Namespace, out: TextIO) -> int:
    """Tests all proved envelopes in a folder by exact motions; returns exit status 0.

    A motion outside one raises ContradictionError.
    """
    path = Path(options.folder)
    folder, document, text = ResultsFolder.read(path), dict[str, object](), ""
    names = [x.removesuffix(".nc") for x in folder.files if re.fullmatch(r"envelope_.*\.nc", x)]
    is_suite = any(name.startswith("record_") for name in folder.files)
    value = f"{path}, of a suite, whose peaks the run tested as it proved them"
    allowed = "results of a run with an envelope"
    require(bool(names), "FOLDER", value if is_suite else str(path), allowed)
    for name in names:
        data, n_motions, verdict = folder.dataset(f"{name}.nc"), 0, "nothing in it is proved"
        peaks = json.loads(folder.content(f"{name}.json"))["result"]["peak"].values()
        if any(peak["nature"] == Nature.GUARANTEED for peak in peaks):
            verdict = "its guaranteed peaks were tested by the run, nothing else in it is proved"
        if "motion_inputs" in data:  # which proved envelopes alone store
            points, motions = stored_motions(data)
            trial = Trial(envelope_of(data), *np.moveaxis(data["cut"].values, -1, 0))
            trial.require_agreement(points, motions)
            n_motions = len(points)
            is_guaranteed = data.attrs["nature"] == Nature.GUARANTEED
            verdict = f"{n_motions} exact motions {agreement(is_guaranteed)}"
        nature = str(data.attrs["nature"])
        document[name] = {"nature": nature, "motions_tested": n_motions}
        text += f"{name}: {verdict} ({nature})\n"
    write_answer(options, document, out, text)
    return 0


def envelope_of(data: xarray.Dataset) -> Envelope:
    """The envelope that a dataset holds, with the supports of its fuzzy inputs as intervals."""
    values = {name: variable.values for name, variable in data.data_vars.items()}
    names = ("lower", "upper", "lower_at", "upper_at", "error", "between", "attained_error")
    arguments: dict[str, Any] = {name: values[name] for name in names if name in values}
    for side, name in (("inner", "inner"), ("outer", "proved")):
        if f"{name}_lower" in values:
            arguments[side] = Ends(values[f"{name}_lower"], values[f"{name}_upper"])
    supports = zip(data["parameter"].values, values["cut"][0], strict=True)
    return Envelope(
        alpha=data["alpha"].values,
        time=data["time"].values,
        outputs=tuple(map(str, data["output"].values)),
        inputs={str(name): Interval(*map(float, support)) for name, support in supports},
        nature=Nature(data.attrs["nature"]),
        method=str(data.attrs["method"]),
        units=tuple(str(x).partition("[")[2].rstrip("]") for x in values["label"]),
        **arguments,
    )


COMMANDS = {
    "check": Command(
        "check a case, and print what it was read as and its first natural period",
        add_common,
        check,
    ),
    "verify": Command(
        "test the proved envelopes of a run by exact motions, without the proof", add_folder, verify
    ),
}
