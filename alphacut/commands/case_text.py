"""A case as it was read, in words: its quantities, and doubts about them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import pi
from typing import TYPE_CHECKING

import numpy as np

from alphacut.base.errors import FailedError, RefusedError
from alphacut.base.number_text import MINUS, engineering
from alphacut.case.content import Content
from alphacut.case.loads import ForceHistory
from alphacut.case.parse import quantity_of
from alphacut.case.structure import MaterialDamping, Structure
from alphacut.case.types import Section
from alphacut.frame import History
from alphacut.frame.structures.matrix import Monomial
from alphacut.fuzzy import Crisp, FuzzyNumber, Interval, Trapezoidal, Triangular
from alphacut.io.quantity import QUANTITIES
from alphacut.rve.cell.cell import VoigtPhase
from alphacut.stages.cell import GPA
from alphacut.stages.foreseen import foreseen_structure

if TYPE_CHECKING:
    from alphacut.rve.image.fields.forest import Percolation

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


def percolation_text(found: Percolation) -> str:
    """Return lines on what the phases of an image outside its pores connect, and how closely.

    By `./enter python -m benchmarks.rve.porous` the bounds of E of noise with pores are 0.4 to 0.6
    over the thickness of the walls in voxels apart, as a fraction of the upper bound; in the plane
    less.
    """
    axes = dict(zip("zyx"[-len(found.axes) :], found.axes, strict=True))
    joined = ", ".join(axis for axis in sorted(axes) if axes[axis])
    apart = ", ".join(axis for axis in sorted(axes) if not axes[axis])
    text = f"solid: connected along {joined or 'no axis'}"
    if found.isolated > 0:
        text += f"; {found.isolated:.2%} of it loose, which carries nothing"
    cells = "pixels" if len(axes) == 2 else "voxels"
    text += f"; walls {found.thickness:.1f} {cells} thick in the mean\n"
    if apart:
        return f"{text}bounds: none from below along {apart}, nor of the mean E\n"
    return f"{text}bounds of E: some {100 * min(0.45 / found.thickness, 1):.0f} % apart\n"


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
        if not is_stated and (key != "columns" or getattr(section, "stiffness", None) is not None):
            continue
        unit = quantity_of(info)
        si = unit.si if unit else ""
        for index, entry in _entries(getattr(section, key)).items():
            row_key = f"{prefix}{key}{index}"
            if isinstance(entry, Section):
                yield from rows_of(f"{row_key}.", entry)
            elif isinstance(entry, FuzzyNumber):
                kind = _kind_of(entry) if is_stated else "default"
                if unit:
                    kind += _mark_of_size(entry, si)
                yield row_key, _numbers(entry, si), kind
            elif isinstance(entry, float):
                if si:
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
        case ForceHistory(frequency=FuzzyNumber() as frequency):
            kind = _kind_of(frequency) + _mark_of_size(frequency, "Hz")
            yield _numbers(frequency, "Hz"), f"harmonic, {kind}"
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
