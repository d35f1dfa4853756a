"""Command ``alphacut check``: the case as it is read, and everything that is wrong with it."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from math import pi
from typing import TextIO

from alphacut.case.content import Content
from alphacut.case.keys import quantity_of
from alphacut.case.records import RecordsSection
from alphacut.case.structure import Structure
from alphacut.case.types import Section
from alphacut.commands.options import Command, add_common, read_case, write_answer
from alphacut.frame import MatrixStructure, StoreyFrame
from alphacut.frame.structures.linear import frequencies
from alphacut.fuzzy import Crisp, FuzzyNumber, Interval, Trapezoidal, Triangular
from alphacut.io.quantity import engineering
from alphacut.report.results import GRAVITY
from alphacut.report.tables import text_table
from alphacut.stages.cell import model_of, solve
from alphacut.stages.readiness import cut_record_warnings, require_runnable
from alphacut.stages.suite import SuiteRecord, suite, warnings

KINDS = {Crisp: "crisp", Interval: "interval", Triangular: "triangle", Trapezoidal: "trapezoid"}
Row = tuple[str, str, str]


def run(options: argparse.Namespace, out: TextIO) -> int:
    """Checks and reports."""
    content = read_case(options).content
    require_runnable(content)
    rows, linear = list(rows_of("", content)), structure(content)
    period = 2 * pi / float(frequencies(linear)[0]) if linear else None
    document = {
        "case": options.case,
        "stages": list(content.stages),
        "period_s": period,
        "inputs": [dict(zip(("key", "value", "kind"), row, strict=True)) for row in rows],
    }
    text = text_table(("key", "value", "kind"), rows)
    if period:
        text += f"first natural period: {period:.4g} s, at the most plausible values\n"
    if linear and (record := linear.ground):
        peak = engineering(record.extremes[0], "m/s^2")
        in_g = f"{record.extremes[0] / GRAVITY:.3g} g"
        text += f"record: {len(record.samples)} samples of {record.step:g} s, peak {peak}, {in_g}\n"
        text += "".join(
            f"{words}\n" for words in cut_record_warnings(content, Structure(linear, {}))
        )
    if content.records is not None and content.envelope is not None and linear:
        moved = Structure(linear, {})
        text += records_text(content.records, suite(content.records, content.envelope, moved))
    write_answer(options, document, out, f"{text}{options.case}: no problems\n")
    return 0


def records_text(section: RecordsSection, records: Sequence[SuiteRecord]) -> str:
    """What the files of a suite hold, and what is made of them."""
    rows = []
    for named, record in zip(section.recordings, records, strict=True):
        read, measures = named.recording, record.measures
        of_file = (
            named.name,
            read.file_format,
            read.unit,
            f"{read.step:g} s",
            f"{len(read.samples)}",
        )
        raw = (f"{read.offset_share:.2%}", f"{read.peak / GRAVITY:.3g} g")
        used = tuple(f"{measures[name] / GRAVITY:.3g} g" for name in ("PGA", "Sa(T1)"))
        rows.append((*of_file, *raw, *used, f"{record.duration:.4g} s"))
    head = ("record", "format", "unit", "step", "samples", "mean/peak", "peak", "PGA used")
    text = text_table((*head, "Sa(T1) used", "motion"), rows)
    return text + "".join(f"warning: {words}\n" for words in warnings(records))


def structure(content: Content) -> StoreyFrame | MatrixStructure | None:
    """The linear structure at the modal values; None where none vibrates.

    A modulus that is yet to be computed is that of the series at the modal values.
    """
    if "envelope" not in content.stages or content.structure_section is None:
        return None
    if content.frame is None:
        return content.structure_of().linear
    number = None
    if not content.frame.is_whole:
        if content.round is None or not content.round.has_series:
            return None
        if content.radius_map is None and content.round.fraction is None:
            return None
        quick = content.modulus.model_copy(update={"method": "auto", "tolerance": 1e-4})
        model = model_of(content.round, content.mesh, quick)
        number = Crisp(solve(*content.round_cell, model).modulus)
    return content.structure_of(number).frame


def rows_of(prefix: str, section: Section) -> Iterator[Row]:
    """Key, value and kind of every quantity of a section, and of those below it."""
    for key, info in type(section).model_fields.items():
        content, unit = getattr(section, key), quantity_of(info)
        if isinstance(content, dict):
            for name, part in content.items():
                if isinstance(part, Section):
                    yield from rows_of(f"{prefix}{key}.{name}.", part)
        sections = content if isinstance(content, tuple) else (content,)
        for number, subsection in enumerate(sections, start=1):
            row_key = f"{prefix}{key}" + (f"[{number}]" if len(sections) > 1 else "")
            if isinstance(subsection, Section):
                yield from rows_of(f"{row_key}.", subsection)
            elif isinstance(subsection, FuzzyNumber) and unit and section.has_key(key):
                yield row_key, _numbers(subsection, unit.si), KINDS.get(type(subsection), "fuzzy")
            elif key == "columns" and getattr(section, "stiffness", None) is None:
                yield row_key, _numbers(subsection, ""), "default"
            elif isinstance(subsection, float) and unit and unit.si and section.has_key(key):
                yield row_key, engineering(subsection, unit.si), "number"


def _numbers(number: FuzzyNumber, unit: str) -> str:
    corners = dict.fromkeys((number.support.lower, *number.cut(1.0), number.support.upper))
    return " … ".join(engineering(x, unit) for x in corners)


ABOUT = "check a case, and print what it was read as and its first natural period"
COMMANDS = {"check": Command(ABOUT, add_common, run)}
