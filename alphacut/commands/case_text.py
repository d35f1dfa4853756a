"""A case as it was read, in words: quantities, modes and records, and doubts about them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import pi
from typing import TYPE_CHECKING

import numpy as np

from alphacut.base.errors import FailedError, RefusedError
from alphacut.base.number_text import MINUS, STANDARD_GRAVITY, engineering, percent_text, text_table
from alphacut.case.content import Content
from alphacut.case.loads import ForceHistory, RecordsSection
from alphacut.case.parse import quantity_of
from alphacut.case.structure import MaterialDamping, Structure
from alphacut.case.types import Section
from alphacut.commands.required import load_end_warnings
from alphacut.frame import Exact, History, LinearFlow
from alphacut.frame.analyses.peaks import WIDENING
from alphacut.frame.analyses.suites import (
    NominalMode,
    ScaledRecord,
    nominal_mode,
    short_record_warnings,
)
from alphacut.frame.boxes import AT_REST
from alphacut.frame.result import within_steps
from alphacut.frame.structures.linear import LinearSystem, NominalModes, histories
from alphacut.frame.structures.matrix import Monomial
from alphacut.frame.structures.storey import yields
from alphacut.frame.verification.step_error import node_deviation
from alphacut.fuzzy import Crisp, FuzzyNumber, Interval, Trapezoidal, Triangular
from alphacut.io.quantity import QUANTITIES
from alphacut.rve.cell.cell import VoigtPhase
from alphacut.stages.cell import GPA
from alphacut.stages.foreseen import MOST_TIMED_STEPS, foreseen_structure

if TYPE_CHECKING:
    pass

UNUSUAL = ", unusual"
"""Mark of the kind of a quantity that structures and their materials seldom have."""
Row = tuple[str, str, str]


def doubts(content: Content, rows: Sequence[Row], structure: Structure | None) -> Iterator[str]:
    """Yield a sentence for each quantity and limit whose size suggests a wrong unit.

    The structure adds its own sentences: quantities that do not fit each other, and, if it is
    known, weights that should not be left out (P-Delta).

    Args:
        content: The case.
        rows: Key, value and kind of each quantity in it, as `rows_of` gives them.
        structure: The structure of the case; None if there is none or it cannot be built. Limits
            are not judged then.

    Raises:
        RefusedError: A limit does not fit the structure.
    """
    for key, value, kind in rows:
        if kind.endswith(UNUSUAL):
            yield f"{key} is {value}, which is unusual: is its unit right?"
    if content.structure_section is not None:
        yield from content.structure_section.warnings(structure)
    if structure is None:
        return
    # Towers sway by some 2 m, and floors move at less than 10 g: more is a slip of a unit.
    largest = {"m": 5.0, "m/s": 50.0, "m/s^2": 500.0}
    for key, question in content.questions.items():
        for limit in question.with_storeys(structure).limits:
            unit = structure.unit(limit.output)
            size = abs(limit.value_in_si(structure, f"{key}.limits"))
            if size > largest.get(unit, np.inf):
                yield (
                    f"{key}.limits: {limit.text} is more than structures reach: is its unit right?"
                )


def structure_of_envelope(content: Content) -> Structure | None:
    """Return the structure at its nominal values; None if no stage needs it or it is unknown."""
    if "envelope" not in content.stages:
        return None
    return foreseen_structure(content)


def doubts_before_refusal(content: Content, rows: Sequence[Row]) -> list[str]:
    """Return the sentences of `doubts` on a case that is refused, as far as it can be read."""
    try:
        return list(doubts(content, rows, structure_of_envelope(content)))
    except (RefusedError, FailedError):
        return list(doubts(content, rows, None))


def motion_text(
    content: Content, structure: Structure, records: Sequence[ScaledRecord] = ()
) -> str:
    """Return lines on what moves the structure, and warnings of a time step that misses peaks.

    Args:
        content: The case.
        structure: Its structure at the nominal values of the material.
        records: Records of its suite as they move the structure, if it has one.

    Returns:
        Lines that end with a newline: the record of the ground or the records of a suite, and
        "warning: …" lines. Empty without [envelope], and of a structure that is not linear.

    Raises:
        FailedError: The response that the time step is judged by could not be computed.
    """
    section = content.envelope
    linear = structure.linear
    if section is None or linear is None:
        return ""
    text = ""
    duration = section.duration
    step = section.step
    moved = linear
    for name, history in histories(linear).items():
        # A load history whose first step is longer than the simulation acts as one straight line.
        # This happens if its times are in another unit, such as ms.
        if len(history.samples) > 2 and history.step > duration:
            text += (
                f"warning: {name}: the motion ends before the second sample, at {history.step:g}"
            )
            text += " s: are its times in another unit than s?\n"
    if (record := linear.ground) is not None:
        peak = record.extremes[0]  # the largest magnitude; the other entry is that of its slope
        sizes = f"peak {engineering(peak, 'm/s^2')}, {peak / STANDARD_GRAVITY:.3g} g"
        text += f"record: {len(record.samples)} samples of {record.step:g} s, {sizes}\n"
        length = record.step * (len(record.samples) - 1)
        # The modes are needed only for a record that ends before the motion does.
        if length < duration:
            short = short_record_warnings("the record", length, nominal_mode(linear).period)
            text += "".join(f"warning: {line}\n" for line in short)
    text += "".join(f"warning: {line}\n" for line in load_end_warnings(content, structure))
    if content.records is not None:
        from alphacut.stages.suite import scaled_suite

        text += records_text(content.records, records, nominal_mode(linear))
        if (scaled := scaled_suite(content.records, structure)) is not None:
            text += str(scaled)
        # Of a linear structure peaks under records are found with time nodes of their own, finer
        # than the step of the case. Where columns yield, the step must be fine enough for the
        # strongest record.
        if not yields(linear):
            return text
        strongest = max(records, key=lambda record: record.measures["Sa(T1)"])
        duration = step * round(strongest.duration / step)
        moved = linear.moved_by(strongest.ground)
    # The first steps of a very long response are enough, and `check` is to end in seconds.
    duration = min(duration, MOST_TIMED_STEPS * step)
    return text + "".join(f"warning: {line}\n" for line in long_steps(moved, duration, step))


def modes_document(modes: NominalModes) -> dict[str, object]:
    """Return the natural modes of a structure as a JSON document.

    Args:
        modes: Undamped modes by rising frequency. A frequency of zero, which no structure of a case
            has, would give a period above 1e300 s, since JSON has no infinity.

    Returns:
        "periods_s", "damping_ratios" and "effective_masses_kg", lists with an entry for each mode;
        and "moved_mass_kg", the mass that moves with the ground.
    """
    return {
        "periods_s": (2 * pi / np.maximum(modes.frequencies, 1e-300)).tolist(),
        "damping_ratios": modes.damping_ratios.tolist(),
        "effective_masses_kg": modes.effective_masses.tolist(),
        "moved_mass_kg": modes.moved_mass,
    }


def modes_text(modes: NominalModes, *, is_shaken: bool = False) -> str:
    """Return the first period, a table of the lowest modes, and the weight that moves.

    Modes are shown until their effective masses add up to 90 % of the mass that moves with the
    ground, but three at least and eight at most, if the structure has as many. Without such a mass
    eight are shown.

    Args:
        modes: Undamped modes by rising frequency, at the most plausible values.
        is_shaken: Whether the ground moves. The structure is then taken for a building, whose
            first period is longer than that of a part of a machine.

    Returns:
        Lines that end with a newline, with a warning if the first period is unusual.
    """
    periods = 2 * pi / np.maximum(modes.frequencies, 1e-300)
    first = float(2 * pi / modes.frequencies[0])
    text = f"first natural period: {first:.4g} s, at the most plausible values\n"
    # Parts of machines have periods of some 1 ms, one-storey buildings 0.05 s, the highest towers
    # 10 s.
    shortest = 1e-3
    if is_shaken:
        shortest = 0.02
    if not shortest <= first <= 10.0:
        text += f"warning: {first:.4g} s is an unusual period: are units right, mass and stiffness"
        text += " not exchanged?\n"
    largest = float(modes.damping_ratios.max())
    doubt = "are units of dampers, damping matrices and rayleigh factors right?"
    # ratios of structures are .1 to 60 %, of an undamped one below the rounding of 1e-12
    if largest > 1 or 1e-12 < largest < 1e-5:
        text += f"warning: damping ratios are up to {largest:.2g} of critical: {doubt}\n"
    moved = modes.moved_mass
    fractions = modes.effective_masses / (moved or np.inf)
    # Building codes ask for the modes that have 90 % of the mass (EN 1998-1, 4.3.3.3.1).
    needed = int(np.searchsorted(np.cumsum(fractions), 0.9)) + 1
    rows = []
    for k in range(min(max(needed, 3), 8, len(fractions))):
        mass = "–"
        if moved:
            mass = percent_text(float(fractions[k]))
        damping = percent_text(modes.damping_ratios[k], 2)
        rows.append((f"{k + 1}", f"{engineering(float(periods[k]), '')} s", damping, mass))
    text += text_table(("mode", "period", "damping ratio", "effective mass"), rows)
    if moved:
        weight = engineering(moved * STANDARD_GRAVITY, "N")
        text += f"total weight: {weight}, of {moved:,.6g} kg that move with the ground\n"
    return text


def long_steps(linear: LinearSystem, duration: float, step: float) -> Iterator[str]:
    """Yield a sentence for each output whose peak may rise by over 1 % between time nodes.

    The peak, and what responses add to it between nodes, are computed for the most plausible
    structure. Where columns yield, peaks of accelerations alone are read at the nodes, so that only
    they are judged, by the response with the initial stiffness.

    Args:
        linear: A linear structure, or a frame that yields.
        duration: Length of the response, in s.
        step: Distance of the nodes, in s.

    Raises:
        FailedError: The response could not be computed.
    """
    has_events = yields(linear)
    if has_events:
        read_at_nodes = [name for name in linear.outputs if linear.unit_of(name) == "m/s^2"]
        if not read_at_nodes:
            return
        linear = linear.with_outputs(read_at_nodes).elastic()
    flow = LinearFlow(linear, (), duration, step, Exact(), by_modes=False)
    nominal = np.zeros((1, 0))  # the one structure without fuzzy inputs
    at_nodes = np.abs(flow.values(nominal)[0]).T  # (outputs, times)
    between = node_deviation(flow, nominal).T  # what each step may add, of the same shape
    # The peak of a structure at rest is rounding alone. It is replaced by AT_REST, a billionth, of
    # `reach`: the size that the energy of the response allows, shape (outputs,).
    peaks = np.maximum(at_nodes.max(axis=1), AT_REST * flow.reach())
    # If nothing moves at all, peaks are 0, and the ratio of 1 says that nothing is widened.
    farthest = within_steps(at_nodes, between).max(axis=1)
    widening = np.divide(farthest, peaks, out=np.ones_like(peaks), where=peaks > 0) - 1
    for name, fraction in zip(linear.outputs, widening, strict=True):
        if fraction <= WIDENING:
            continue
        if has_events:
            what = f"the step of {step:g} s is too coarse: its peak may be missed"
            by_how_much = f"by about {fraction:.1%}"
            if fraction >= 1:
                by_how_much = "altogether"
            yield f"{name}: {what} {by_how_much} between nodes"
        else:
            # A curve is farthest from its chord by h²/8 max |q''|: the distance falls with the
            # square of the step h, and half a step leaves a quarter.
            what = f"the step of {step:g} s widens its bound by about {fraction:.1%}"
            yield f"{name}: {what} between nodes, one of {step / 2:g} s by {fraction / 4:.1%}"


def records_text(
    section: RecordsSection, records: Sequence[ScaledRecord], mode: NominalMode
) -> str:
    """Return a table of the ground motion records of a suite, and their warnings.

    The columns "PGA used", "Sa(T1) used" and "motion" describe each record as it moves the
    structure, after correction and scaling; the columns before them as its file holds it.
    Accelerations are in g.

    Args:
        section: The records of the case, as their files hold them.
        records: The same records in the same order, as they move the structure.
        mode: First mode of the structure, whose period and damping ratio Sa(T1) is for.

    Returns:
        Lines that end with a newline, with "warning: …" lines at the end.
    """
    rows = []
    for raw, record in zip(section.recordings, records, strict=True):
        rows.append(
            (
                raw.name,
                raw.file_format,
                raw.unit,
                f"{raw.step:g} s",
                f"{len(raw.samples)}",
                percent_text(raw.mean_to_peak_ratio, 2),
                _in_g(raw.peak),
                _in_g(record.measures["PGA"]),
                _in_g(record.measures["Sa(T1)"]),
                f"{record.duration:.4g} s",
            )
        )
    head = ["record", "format", "unit", "step", "samples", "mean/peak", "peak"]
    head += ["PGA used", "Sa(T1) used", "motion"]
    text = text_table(head, rows)
    of_mode = f"T1 = {mode.period:.4g} s with the structure's own damping ratio"
    text += f"Sa(T1): pseudo-acceleration ω² max |u| at {of_mode}, {percent_text(mode.ratio)}\n"
    return text + "".join(f"warning: {x}\n" for record in records for x in record.warnings)


def _in_g(acceleration: float) -> str:
    """Return an acceleration in m/s² as text in g with three digits."""
    return f"{acceleration / STANDARD_GRAVITY:.3g} g"


def rows_of(prefix: str, section: Section) -> Iterator[Row]:
    """Yield a row of each quantity in a section of a case, and in the sections below it.

    Values that are no quantities have no row. Quantities that the case leaves out have none either,
    except columns of frames, whose default matters.

    Args:
        prefix: Beginning of the keys, empty or with its dot, such as "cell.".
        section: The validated section.

    Yields:
        The full key, with "[2]" for the second entry of an array; the value in SI units with
        prefixes; and the kind of number, such as "crisp" or "interval", or "default" where the case
        leaves it out. ", unusual" is added to the kind of fuzzy quantities of unusual size.
    """
    for key, info in type(section).model_fields.items():
        is_stated = section.has_key(key)
        is_default = key == "columns" and getattr(section, "stiffness", None) is None
        unit = quantity_of(info)
        si = ""
        if unit:
            si = unit.si
        for index, entry in _entries(getattr(section, key)).items():
            row_key = f"{prefix}{key}{index}"
            if isinstance(entry, Section):
                yield from rows_of(f"{row_key}.", entry)
            elif isinstance(entry, FuzzyNumber):
                if is_stated or is_default:
                    # Parameters of matrices have any unit, which is converted when it is read.
                    words = _numbers(entry, si)
                    if key == "parameters":
                        words += " in SI"
                    kind = "default"
                    if is_stated:
                        kind = _kind_of(entry)
                    if unit:
                        kind += _mark_of_size(entry, si)
                    yield row_key, words, kind
            elif isinstance(entry, float):
                if si and (is_stated or is_default):
                    yield row_key, engineering(entry, si), "number"
            else:
                yield from ((row_key, words, kind) for words, kind in _words_and_kind(entry))


def _kind_of(number: FuzzyNumber) -> str:
    """Return the kind of a fuzzy number in a word, "fuzzy" of those that no word tells."""
    kinds = {Crisp: "crisp", Interval: "interval", Triangular: "triangle", Trapezoidal: "trapezoid"}
    return kinds.get(type(number), "fuzzy")


def _entries(value: object) -> dict[str, object]:
    """Return the values of a key by what follows the key in a row of the table.

    Args:
        value: Value of the key. Entries of a dictionary have ".name", entries of a tuple "[1]",
            "[2]" … A single entry of a tuple, and any other value, has "". An empty tuple or
            dictionary gives nothing.
    """
    if isinstance(value, dict):
        return {f".{name}": entry for name, entry in value.items()}
    if type(value) is not tuple:  # a named tuple is one value
        return {"": value}
    if len(value) == 1:  # one entry, which holds for all floors
        return {"": value[0]}
    return {f"[{number}]": entry for number, entry in enumerate(value, start=1)}


def _words_and_kind(entry: object) -> Iterator[tuple[str, str]]:
    """Yield text and kind of a quantity that is no single number; nothing of any other value.

    Args:
        entry: An amplitude with its SI unit; a harmonic history; a factor with its matrix; the
            damping of the material; or the plane stiffness of a phase.

    Yields:
        The text, in SI units with prefixes or in GPa, and the kind in a word or two.
    """
    match entry:
        # Types are told apart by their own classes, since keys may take several of them.
        case (FuzzyNumber() as force, str(si)):
            yield _numbers(force, si), _kind_of(force) + _mark_of_size(force, si)
        case ForceHistory(History(frequency=omega)) if omega:  # in rad/s; 0 of other histories
            hertz = engineering(omega / (2 * pi), "")
            yield f"{hertz} Hz, period {engineering(2 * pi / omega, '')} s", "harmonic"
        case (Monomial() as factor, np.ndarray() as array):
            size = " × ".join(map(str, array.shape))
            yield f"{factor} × matrix {size}, largest {abs(array).max():.4g}", "in SI"
        case MaterialDamping(joints):
            yield f"of the material, and {_numbers(joints, '')} of joints", "computed"
        case VoigtPhase(matrix):
            rows = [" ".join(f"{x / GPA:g}" for x in row) for row in matrix]
            yield " | ".join(rows).replace("-", MINUS), "GPa, plane strain"


def _mark_of_size(number: FuzzyNumber, si: str) -> str:
    """Return a mark, ", unusual", for a quantity that structures seldom have; else "".

    Args:
        number: The quantity. The magnitudes of both ends of its support must lie in the usual range
            of its dimension, unless one of them is zero.
        si: SI unit of its dimension, a key of the table of units.
    """
    smallest, largest = QUANTITIES[si].usual
    sizes = [abs(end) for end in number.support]
    # A support that begins at 0, as of a velocity at rest, has no order of size to judge.
    is_usual = min(sizes) == 0 or (smallest <= min(sizes) and max(sizes) <= largest)
    if is_usual:
        return ""
    return UNUSUAL


def _numbers(number: FuzzyNumber, si: str) -> str:
    """Return the ends of the support and of the highest cut of a number, each once, rising."""
    support = number.support
    core = number.cut(1.0)
    corners = dict.fromkeys((support.lower, core.lower, core.upper, support.upper))
    return " … ".join(engineering(corner, si) for corner in corners)
