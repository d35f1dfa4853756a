"""What moves the structure of a case, its modes, and doubts about time steps, in words."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import degrees

import numpy as np

from alphacut.base.number_text import STANDARD_GRAVITY, engineering, percent_text, text_table
from alphacut.case.content import Content
from alphacut.case.loads import RecordsSection
from alphacut.case.structure import Structure
from alphacut.frame import Exact, LinearFlow, MatrixStructure
from alphacut.frame.analyses.angles import TURN
from alphacut.frame.analyses.peaks import WIDENING
from alphacut.frame.analyses.suites import (
    ROTATED,
    NominalMode,
    ScaledRecord,
    nominal_mode,
    short_record_warnings,
)
from alphacut.frame.boxes import AT_REST
from alphacut.frame.result import within_steps
from alphacut.frame.structures.linear import LinearSystem, NominalModes, histories
from alphacut.frame.structures.storey import yields
from alphacut.frame.verification.step_error import node_deviation
from alphacut.stages.envelope import tasks


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
    duration = min(duration, 16_000 * step)
    return text + "".join(f"warning: {line}\n" for line in long_steps(moved, duration, step))


def modes_document(modes: NominalModes) -> dict[str, object]:
    """Return the natural modes of a structure as a JSON document.

    Args:
        modes: Undamped modes by rising frequency. A frequency of zero has a period above 1e300 s,
            since JSON has no infinity.

    Returns:
        "periods_s", "damping_ratios" and "effective_masses_kg", lists with an entry for each mode;
        and "moved_mass_kg", the mass that moves with the ground.
    """
    return {
        "periods_s": modes.periods.tolist(),
        "damping_ratios": modes.damping_ratios.tolist(),
        "effective_masses_kg": modes.effective_masses.tolist(),
        "moved_mass_kg": modes.moved_mass,
    }


def modes_text(
    modes: NominalModes, others: Sequence[NominalModes] = (), *, is_shaken: bool = False
) -> str:
    """Return the first period, a table of the lowest modes, and the weight that moves.

    Modes are shown until their effective masses add up to 90 % of the mass that moves with the
    ground, in each direction, but three at least and eight at most, if the structure has as many.
    Without such a mass eight are shown.

    Args:
        modes: Undamped modes by rising frequency, at the most plausible values.
        others: The same modes with the effective masses of further directions of the ground.
        is_shaken: Whether the ground moves. The structure is then taken for a building, whose
            first period is longer than that of a part of a machine.

    Returns:
        Lines that end with a newline, with a warning if the first period is unusual.
    """
    periods = modes.periods
    first = float(periods[0])
    shown = f"{first:.4g} s" if modes.frequencies[0] else "infinite"
    text = f"first natural period: {shown}, at the most plausible values\n"
    # Parts of machines have periods of some 1 ms, one-storey buildings 0.05 s, the highest towers
    # 10 s.
    shortest = 1e-3
    if is_shaken:
        shortest = 0.02
    if not modes.frequencies[0]:
        text += "warning: a mode has no stiffness within rounding: are units right, and all parts"
        text += " joined?\n"
    elif not shortest <= first <= 10.0:
        text += f"warning: {first:.4g} s is an unusual period: are units right, mass and stiffness"
        text += " not exchanged?\n"
    has_stiffness = modes.frequencies > 0  # without, a mode has no damping ratio
    largest = float(modes.damping_ratios.max(where=has_stiffness, initial=0.0))
    doubt = "are units of dampers, damping matrices and rayleigh factors right?"
    # ratios of structures are .1 to 60 %, of an undamped one below the rounding of 1e-12
    if largest > 1 or 1e-12 < largest < 1e-5:
        text += f"warning: damping ratios are up to {largest:.2g} of critical: {doubt}\n"
    moved = modes.moved_mass
    directions = [x.effective_masses / (x.moved_mass or np.inf) for x in (modes, *others)]
    # Building codes ask for the modes that have 90 % of the mass (EN 1998-1, 4.3.3.3.1).
    needed = max(int(np.searchsorted(np.cumsum(fractions), 0.9)) for fractions in directions) + 1
    rows = []
    for k in range(min(max(needed, 3), 8, len(periods))):
        masses = ["–"]
        if moved:
            masses = [percent_text(float(fractions[k])) for fractions in directions]
        period = "infinite"
        damping = "–"
        if has_stiffness[k]:
            period = f"{engineering(float(periods[k]), '')} s"
            damping = percent_text(modes.damping_ratios[k], 2)
        rows.append((f"{k + 1}", period, damping, *masses))
    titles = ["effective mass", *(f"direction {k + 2}" for k in range(len(others)))]
    text += text_table(("mode", "period", "damping ratio", *titles), rows)
    if moved:
        weight = engineering(moved * STANDARD_GRAVITY, "N")
        text += f"total weight: {weight}, of {moved:,.6g} kg that move with the ground\n"
    return text


def matrices_text(model: MatrixStructure, unknowns: Sequence[str], modes: NominalModes) -> str:
    """Return lines on the matrices of a structure: unknowns, those without mass, and five periods.

    Args:
        model: The structure.
        unknowns: Names of its unknowns.
        modes: Its undamped modes by rising frequency, at the most plausible values.
    """
    massless = [unknowns[k] for k in model.massless]
    text = f"matrices: {model.size} unknowns in N, m, kg, s, {len(massless)} of them without mass"
    if massless:
        text += f": {', '.join(massless[:8])}{', …' * (len(massless) > 8)}"
    periods = [engineering(float(period), "s") for period in modes.periods[:5]]
    return f"{text}\nfirst periods: {', '.join(periods)}\n"


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
            # This is the deviation of one structure. A bound over wide inputs may contain several
            # times as much, which only its computation tells.
            what = f"between time nodes {step:g} s apart the most plausible structure may add"
            bound = "a bound over all inputs may contain several times as much"
            yield f"{name}: {what} {fraction:.1%} to its peak; {bound}"


def records_text(
    section: RecordsSection, records: Sequence[ScaledRecord], mode: NominalMode
) -> str:
    """Return a table of the ground motion records of a suite, and their warnings.

    Each component has a row. The columns "PGA used", "Sa(T1) used" and so on, and "motion" describe
    each record as it moves the structure, after correction and scaling; the columns before them as
    its file holds it. Accelerations are in g.

    Args:
        section: The records of the case, as their files hold them.
        records: The same records in the same order, as they move the structure.
        mode: First mode of the structure, whose period and damping ratio Sa(T1) is for.

    Returns:
        Lines that end with a newline, with "warning: …" lines at the end.
    """
    measures = ["PGA", "Sa(T1)"]
    if section.component_count > 1:
        measures += ROTATED
    rows: list[list[str]] = []
    for components, record in zip(section.suite, records, strict=True):
        of_record = [_in_g(record.measures[name]) for name in measures]
        of_record.append(f"{record.duration:.4g} s")
        for raw in components:
            row = [raw.name, raw.file_format, raw.unit, f"{raw.step:g} s", f"{len(raw.samples)}"]
            row += [percent_text(raw.mean_to_peak_ratio, 2), _in_g(raw.peak)]
            rows.append(row + of_record)
            # What is said of a record stands beside its first component.
            of_record = [""] * len(of_record)
    head = ["record", "format", "unit", "step", "samples", "mean/peak", "peak"]
    head += [f"{name} used" for name in measures] + ["motion"]
    text = text_table(head, rows)
    of_mode = f"T1 = {mode.period:.4g} s with the structure's own damping ratio"
    text += f"Sa(T1): pseudo-acceleration ω² max |u| at {of_mode}, {percent_text(mode.ratio)}\n"
    if section.component_count > 1:
        angle = "all angles of incidence"
        if not section.has_all_angles:
            angle = f"turned by {degrees(section.angle):.4g}°"
        text += f"{section.component_count} components a record, {angle}. {TURN}\n"
    return text + "".join(f"warning: {x}\n" for record in records for x in record.warnings)


def _in_g(acceleration: float) -> str:
    """Return an acceleration in m/s² as text in g with three digits."""
    return f"{acceleration / STANDARD_GRAVITY:.3g} g"


def load_end_warnings(content: Content, structure: Structure) -> Iterator[str]:
    """Yield a warning of each load that does not end as the responses do.

    Warned of are an accelerogram that goes on after all responses have ended, and a force that is
    not zero where its file ends, before the longest response does: it jumps to zero there. There
    are no warnings without [envelope], or if the structure is not linear.

    Args:
        content: The case, for the durations of [envelope] and its studies.
        structure: Its structure.
    """
    linear = structure.linear
    if linear is None or content.envelope is None:
        return
    longest = max(task.duration for task in tasks(content.envelope, content.study))
    for name, history in histories(linear).items():
        end = history.start + history.step * (len(history.samples) - 1)
        largest, _ = history.extremes
        # Records and measured forces fade away: 1 % of the largest value is no jump (tuned). The
        # last value of a history that `is_held` stays on, so that it does not jump either.
        jumps = abs(history.samples[-1]) > 0.01 * largest and not history.is_held
        if history is linear.ground:
            if end > longest * (1 + 1e-9):
                yield f"the record lasts {end:g} s, and the motion is computed for {longest:g} s"
        elif jumps and end < longest * (1 - 1e-9):
            fraction = percent_text(float(abs(history.samples[-1])) / largest)
            yield (
                f"{name} ends at {end:g} s with {fraction} of its largest value, and is 0 from"
                f" then on, while the motion is computed for {longest:g} s: let its file last as"
                " long, or end with 0"
            )
