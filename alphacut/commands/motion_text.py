"""What moves the structure of a case, its modes, and doubts about time steps, in words."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import degrees

import numpy as np

from alphacut.base.number_text import STANDARD_GRAVITY, engineering, percent_text, text_table
from alphacut.case.content import Content
from alphacut.case.loads import RecordsSection
from alphacut.case.structure import Structure
from alphacut.frame import MatrixStructure
from alphacut.frame.analyses.angles import TURN
from alphacut.frame.analyses.doubts import load_doubts, mode_doubts, step_doubts
from alphacut.frame.analyses.suites import ROTATED, NominalMode, ScaledRecord, nominal_mode
from alphacut.frame.structures.linear import NominalModes
from alphacut.frame.structures.storey import yields
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
    if (record := linear.ground) is not None:
        peak = record.extremes[0]  # the largest magnitude; the other entry is that of its slope
        sizes = f"peak {engineering(peak, 'm/s^2')}, {peak / STANDARD_GRAVITY:.3g} g"
        text += f"record: {len(record.samples)} samples of {record.step:g} s, {sizes}\n"
    longest = max(task.duration for task in tasks(section, content.study))
    text += warning_lines(load_doubts(linear, longest))
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
    return text + warning_lines(step_doubts(moved, duration, step))


def warning_lines(doubts: Iterable[str]) -> str:
    """Return a line "warning: …" for each doubt, with its line end."""
    return "".join(f"warning: {doubt}\n" for doubt in doubts)


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
    text += warning_lines(mode_doubts(modes, is_shaken=is_shaken))
    has_stiffness = modes.frequencies > 0  # without, a mode has no damping ratio
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
    return text + warning_lines(x for record in records for x in record.warnings)


def _in_g(acceleration: float) -> str:
    """Return an acceleration in m/s² as text in g with three digits."""
    return f"{acceleration / STANDARD_GRAVITY:.3g} g"
