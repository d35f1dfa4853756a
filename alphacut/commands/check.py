"""Commands that check: ``check`` a case before it runs, ``verify`` proved envelopes after that."""

from __future__ import annotations

import argparse
import json
import re
from collections.abc import Iterator, Mapping, Sequence
from math import pi
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

import numpy as np

from alphacut.base.errors import FailedError, RefusedError, require
from alphacut.base.number_text import MINUS, STANDARD_GRAVITY, engineering, percent_text, text_table
from alphacut.case.content import Content
from alphacut.case.loads import ForceHistory, RecordsSection
from alphacut.case.parse import quantity_of
from alphacut.case.structure import MaterialDamping, Structure
from alphacut.case.types import Section
from alphacut.commands.options import Command, add_common, add_quiet, write_answer
from alphacut.commands.pipeline import cut_record_warnings, read_case, require_runnable
from alphacut.frame import Exact, History, LinearFlow
from alphacut.frame.analyses.peaks import WIDENING
from alphacut.frame.analyses.suites import NominalMode, ScaledRecord, nominal_mode
from alphacut.frame.boxes import AT_REST
from alphacut.frame.envelope import Ends, Envelope, within_steps
from alphacut.frame.structures.linear import LinearSystem, NominalModes, nominal_modes
from alphacut.frame.structures.matrix import Monomial
from alphacut.frame.structures.storey import yields
from alphacut.frame.verification.self_test import Trial, stored_motions
from alphacut.frame.verification.step_error import node_deviation
from alphacut.fuzzy import Crisp, FuzzyNumber, Interval, Trapezoidal, Triangular
from alphacut.fuzzy.campaign.call import CampaignError
from alphacut.fuzzy.result import Nature
from alphacut.io.quantity import QUANTITIES
from alphacut.io.results import ResultsFolder
from alphacut.report.results import agreement
from alphacut.rve.cell.cell import VoigtPhase
from alphacut.stages.cell import GPA
from alphacut.stages.foreseen import foreseen_structure
from alphacut.stages.image import study_of
from alphacut.stages.suite import suite_records

if TYPE_CHECKING:
    import xarray

    from alphacut.commands.foresee import Foreseen

USUAL_PERIODS = 1e-3, 30.0  # in s: towers have 10 s at most, machine parts seldom below 1 ms
LEAST_MODES, MAX_MODES = 3, 8
"""Modes that are shown, if the structure has as many."""
UNUSUAL = ", unusual"
"""Mark of the kind of a quantity that structures and their materials seldom have."""
KINDS = {Crisp: "crisp", Interval: "interval", Triangular: "triangle", Trapezoidal: "trapezoid"}
Row = tuple[str, str, str]


def check(options: argparse.Namespace, out: TextIO) -> int:
    """Check a case, show how it was read and what a run of it will take; return exit status 0."""
    content = read_case(options).content
    study = require_runnable(content)
    if content.image_cell is not None and study is None:
        study = study_of(content.image_cell)
    rows = list(rows_of("", content))
    text = text_table(("key", "value", "kind"), rows)
    for key, value, kind in rows:
        if kind.endswith(UNUSUAL):
            text += f"warning: {key} is {value}, which is unusual: is its unit right?\n"
    if study is not None:
        phases = (f"{name} {fraction:.2%}" for name, fraction in study.fractions.items())
        text += f"image: {study.extent}\nphases: {', '.join(phases)}\n"
    document: dict[str, object] = {"case": options.case, "stages": list(content.stages)}
    document |= {"period_s": None, "modes": None}
    structure = foreseen_structure(content) if "envelope" in content.stages else None
    if structure is not None and structure.linear is not None:
        modes = nominal_modes(structure.linear)
        document["modes"] = modes_document(modes)
        document["period_s"] = 2 * pi / float(modes.frequencies[0])
        text += modes_text(modes)
    section = content.structure_section
    if section is not None:
        text += "".join(f"warning: {line}\n" for line in section.warnings(structure))
    if structure is not None:
        text += motion_text(content, structure)
    keys = ("key", "value", "kind")
    document["inputs"] = [dict(zip(keys, row, strict=True)) for row in rows]
    if options.json or not options.quiet:  # else nobody would see what takes time to foresee
        foreseen, failure = foreseen_stages(content, options.petsc)
        document["foreseen"] = [stage._asdict() for stage in foreseen]
        text += foreseen_text(foreseen) + failure
    write_answer(options, document, out, f"{text}{options.case}: no problems\n")
    return 0


def motion_text(content: Content, structure: Structure) -> str:
    """Return lines on the records of the ground, and warnings of a step that misses peaks."""
    section, linear = content.envelope, structure.linear
    if section is None or linear is None:
        return ""
    text, duration, step, moved = "", section.duration, section.step, linear
    if (record := linear.ground) is not None:
        peak = record.extremes[0]
        sizes = f"peak {engineering(peak, 'm/s^2')}, {peak / STANDARD_GRAVITY:.3g} g"
        text += f"record: {len(record.samples)} samples of {record.step:g} s, {sizes}\n"
        text += "".join(f"{warning}\n" for warning in cut_record_warnings(content, structure))
    if content.records is not None:
        records = suite_records(content.records, section, structure)
        text += records_text(content.records, records, nominal_mode(linear))
        if not yields(linear):  # peaks under records are found with nodes of their own
            return text
        strongest = max(records, key=lambda record: record.measures["Sa(T1)"])
        duration = step * round(strongest.duration / step)
        moved = linear.moved_by(strongest.ground)
    return text + "".join(f"warning: {line}\n" for line in long_steps(moved, duration, step))


def foreseen_stages(content: Content, petsc: Mapping[str, str]) -> tuple[list[Foreseen], str]:
    """Return what stages of a run will take, and a warning if a part that was tried failed."""
    from alphacut.commands.foresee import foresee  # whose work imports much

    found: list[Foreseen] = []
    try:
        found.extend(foresee(content, petsc))
    except (FailedError, RefusedError, CampaignError) as error:
        return found, f"warning: work that was begun to foresee its time failed: {error}\n"
    return found, ""


def foreseen_text(foreseen: Sequence[Foreseen]) -> str:
    """Return a table of what stages of a run will take, with the sum; empty without stages."""
    if not foreseen:
        return ""
    rows = [
        (x.stage, f"{x.number:,} {x.pieces}", f"{engineering(x.seconds, '', digits=2)} s")
        for x in foreseen
    ]
    total = sum(x.seconds for x in foreseen)
    text = text_table(("stage", "pieces", "about, by one process"), rows)
    return f"{text}a run takes about {engineering(total, '', digits=2)} s, without figures\n"


def modes_document(modes: NominalModes) -> dict[str, object]:
    """Return periods in s, damping ratios, effective masses in kg and the moved mass, for JSON."""
    return {
        "periods_s": (2 * pi / np.maximum(modes.frequencies, 1e-300)).tolist(),
        "damping_ratios": modes.damping_ratios.tolist(),
        "effective_masses_kg": modes.effective_masses.tolist(),
        "moved_mass_kg": modes.moved_mass,
    }


def modes_text(modes: NominalModes) -> str:
    """Return the first period, a table of the first modes, and the weight that moves.

    Modes are shown up to 90 % of the moved mass, but not more than `MAX_MODES`.
    """
    periods = 2 * pi / np.maximum(modes.frequencies, 1e-300)
    first = float(2 * pi / modes.frequencies[0])
    text = f"first natural period: {first:.4g} s, at the most plausible values\n"
    if not USUAL_PERIODS[0] <= first <= USUAL_PERIODS[1]:
        text += "this is an unusual period: are units right, mass and stiffness not exchanged?\n"
    moved = modes.moved_mass
    fractions = modes.effective_masses / (moved or np.inf)
    needed = int(np.searchsorted(np.cumsum(fractions), 0.9)) + 1
    rows = []
    for k in range(min(max(needed, LEAST_MODES), MAX_MODES, len(fractions))):
        mass = percent_text(float(fractions[k])) if moved else "–"
        damping = percent_text(modes.damping_ratios[k], 2)
        rows.append((f"{k + 1}", f"{engineering(float(periods[k]), '')} s", damping, mass))
    text += text_table(("mode", "period", "damping ratio", "effective mass"), rows)
    if moved:
        weight = engineering(moved * STANDARD_GRAVITY, "N")
        text += f"total weight: {weight}, of {moved:,.6g} kg that move with the ground\n"
    return text


def long_steps(linear: LinearSystem, duration: float, step: float) -> Iterator[str]:
    """Yield a sentence for each output whose peak may rise much between nodes a step apart.

    The peak and what motions add to it between nodes are those of the most plausible structure. Of
    columns that yield all peaks but those of accelerations are found between nodes as well; these
    are judged by the motion of the initial stiffness.

    Args:
        linear: A linear structure, or a frame that yields.
        duration: Length of the motion, in s.
        step: Distance of the nodes, in s.
    """
    has_events = yields(linear)
    if has_events:
        read_at_nodes = [name for name in linear.outputs if linear.unit_of(name) == "m/s^2"]
        if not read_at_nodes:
            return
        linear = linear.elastic().with_outputs(read_at_nodes)
    flow = LinearFlow(linear, (), duration, step, Exact(), by_modes=False)
    nominal = np.zeros((1, 0))  # the one structure without fuzzy inputs
    at_nodes = np.abs(flow.values(nominal)[0]).T  # (outputs, times)
    between = node_deviation(flow, nominal).T
    # At rest rounding alone moves a structure: its peak is no measure of what is between nodes.
    peaks = np.maximum(at_nodes.max(axis=1), AT_REST * flow.reach())
    widening = within_steps(at_nodes, between).max(axis=1) / peaks - 1
    for name, fraction in zip(linear.outputs, widening, strict=True):
        if fraction <= WIDENING:
            continue
        if has_events:
            what = f"the step of {step:g} s is too coarse: its peak may be missed"
            most = "altogether" if fraction >= 1 else f"by about {fraction:.1%}"
            yield f"{name}: {what} {most} between nodes"
        else:
            # What motions add between nodes falls with the square of the step.
            what = f"the step of {step:g} s widens its bound by about {fraction:.1%}"
            yield f"{name}: {what} between nodes, one of {step / 2:g} s by {fraction / 4:.1%}"


def records_text(
    section: RecordsSection, records: Sequence[ScaledRecord], mode: NominalMode
) -> str:
    """Return a table of a suite's records, as files hold them and as they are used, and warnings.

    Args:
        section: The records of the case, as their files hold them.
        records: The same records as they move the structure.
        mode: First mode of the structure, of whose period and damping ratio Sa(T1) is.
    """
    rows = []
    for raw, record in zip(section.recordings, records, strict=True):
        peaks = raw.peak, record.measures["PGA"], record.measures["Sa(T1)"]
        peak, used_peak, spectral = (f"{x / STANDARD_GRAVITY:.3g} g" for x in peaks)
        rows.append(
            (
                raw.name,
                raw.file_format,
                raw.unit,
                f"{raw.step:g} s",
                f"{len(raw.samples)}",
                percent_text(raw.mean_to_peak_ratio, 2),
                peak,
                used_peak,
                spectral,
                f"{record.duration:.4g} s",
            )
        )
    head = ("record", "format", "unit", "step", "samples", "mean/peak", "peak", "PGA used")
    text = text_table((*head, "Sa(T1) used", "motion"), rows)
    of_mode = f"T1 = {mode.period:.4g} s with the structure's own damping ratio"
    text += f"Sa(T1): pseudo-acceleration ω² max |u| at {of_mode}, {percent_text(mode.ratio)}\n"
    return text + "".join(f"warning: {x}\n" for record in records for x in record.warnings)


def rows_of(prefix: str, section: Section) -> Iterator[Row]:
    """Yield rows (key, value, kind) of the quantities of a section, and of sections below it."""
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
    """Add the arguments of ``verify``."""
    parser.add_argument("folder", metavar="FOLDER", help="results of a run, as results/wind")
    add_quiet(parser)


def verify(options: argparse.Namespace, out: TextIO) -> int:
    """Test all proved envelopes in a folder by exact motions; return exit status 0.

    Raises:
        ContradictionError: A motion lies outside an envelope that is proved.
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
    """Return the envelope in a dataset, with the supports of its fuzzy inputs as intervals."""
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
