"""Measured modes of a universal file: its data sets 55."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from math import ceil
from pathlib import Path
from typing import NamedTuple

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import RefusedError, require
from alphacut.base.stated import Stated
from alphacut.frame.identification.mode_rows import ModeRows, unit_of_frequencies
from alphacut.frame.records.text_file import read_bytes
from alphacut.frame.records.uff import COMPLEX, DIRECTIONS, data_sets, floats


def uff_mode_rows(
    path: Path, floors: Mapping[str, int], unit: str = "", override: Collection[str] = ()
) -> tuple[ModeRows, ...]:
    """Read the modes of a universal file, by rising number, with one measurement each.

    They stand in data sets 55 or 2414 of normal or complex modes; others are passed over. If only
    one floor was measured, the mode has no shape.

    Args:
        path: The file.
        floors: Floor of each measured unknown, named NODE.DIRECTION, such as ``{"12.x": 1}``.
        unit: Unit of the frequencies that the user says; the format has Hz.
        override: "frequency_unit", where the file has another one.

    Raises:
        RefusedError: The user, or a line of text in the file, states another unit or quantity;
            two unknowns belong to one floor, the file has no mode, a data set is damaged,
            a mode is given twice, a frequency is not positive and finite, an unknown is missing or
            not finite, or the phases of a shape differ too much for a real shape.
    """
    is_clear = len(set(floors.values())) == len(floors)
    require(is_clear, "floors", floors, "one unknown for each floor")
    content = read_bytes(path)
    try:
        sets = [
            _parse_shape(found.head, found.lines)
            for number in (55, 2414)
            for found in data_sets(content, number)
        ]
    except (ValueError, IndexError) as error:
        allowed = "data sets 55 or 2414 of a universal file"
        raise RefusedError(path.name, str(error)[:80], allowed) from None
    modes: dict[int, ModeRows] = {}
    for found in sets:
        if found is None:
            continue
        mode = found.mode
        hertz = found.hertz
        key = f"{path.name}, mode {mode}"
        require(mode not in modes, key, "there again", "each mode once")
        # Displacements, velocities and accelerations of a mode are multiples of one another.
        require(found.quantity in (0, 8, 11, 12), key, f"of result type {found.quantity}", "type 8")
        own = [Stated(1.0, "Hz", "by the format")]
        texts = {f"line {text!r} of mode {mode}": text for text in found.texts}
        factor = unit_of_frequencies(path.name, own, texts, unit, override=override)
        hertz *= factor.value if factor else 1.0
        require(0 < hertz < np.inf, f"{key}: frequency", f"{hertz:g} Hz", "above 0 Hz")
        shape = _real_amplitudes(key, found.amplitudes, floors)
        if len(shape) < 2:
            shape = {}  # the amplitude of one floor alone says nothing
        modes[mode] = ModeRows(mode, np.array([hertz]), shape)
    require(bool(modes), path.name, "without a mode", "a data set 55 or 2414 of a mode")
    return tuple(modes[number] for number in sorted(modes))


class UffShape(NamedTuple):
    """A mode shape of a data set 55 or 2414.

    Args:
        mode: Number of the mode.
        hertz: Natural frequency, in Hz.
        quantity: Code of what the amplitudes are, as 8 of displacements.
        texts: Lines of text in its head.
        amplitudes: Complex amplitudes by NODE.DIRECTION.
    """

    mode: int
    hertz: float
    quantity: int
    texts: list[str]
    amplitudes: dict[str, complex]


def _parse_shape(head: list[str], values: list[str]) -> UffShape | None:
    """Return the mode shape of a data set 55 or 2414, or None for a data set of another analysis.

    The frequency of a complex mode is |s| / 2π in Hz with its eigenvalue s. Amplitudes are complex
    numbers named by node and direction, such as "12.x"; real ones have no imaginary part.

    Args:
        head: The lines of the head, 8 of a data set 55, 13 of a data set 2414.
        values: The lines below the head: for each node a line that begins with its number, and
            lines with six numbers each. Empty lines are passed over.

    Returns:
        The number of the mode, its frequency in Hz, and its amplitudes by node and direction.

    Raises:
        ValueError: The data set is damaged: a word is no number, a line is missing, or a node is
            given twice.
        IndexError: A line of the head has too few words.
    """
    # A data set 2414 has its codes, the number of the mode, the frequency and the eigenvalue in
    # other lines, and each in a line of its own.
    is_2414 = len(head) > 8
    code_line, mode_line, real_line = (8, 9, 11) if is_2414 else (5, 6, 7)
    # The line of codes has six: of the model, the analysis (2 of normal modes, 3 and 7 of
    # complex modes of first and second order), the kind of the data (as of a displacement in three
    # directions), its meaning, the type of its numbers, and their count at a node.
    _, analysis, _, quantity, kind, size = (int(word) for word in head[code_line].split()[:6])
    is_normal = analysis == 2
    is_complex = analysis in (3, 7)
    if not (is_normal or is_complex):
        return None
    hertz = floats(head[real_line])[1 if is_2414 else 0]
    if is_complex:
        # The first two numbers are the complex eigenvalue s; its frequency is |s| / 2π.
        real, imaginary = floats(head[12 if is_2414 else 7])[:2]
        hertz = np.hypot(real, imaginary) / (2 * np.pi)

    # Each node has a line with its number, and then its numbers, six in a line.
    numbers_of_value = 2 if kind in COMPLEX else 1
    numbers_of_node = numbers_of_value * size
    step = 1 + ceil(numbers_of_node / 6)
    lines = [line for line in values if line.strip()]
    amplitudes: dict[str, complex] = {}
    for start in range(0, len(lines), step):
        numbers = floats(" ".join(lines[start + 1 : start + step]))
        if len(numbers) != numbers_of_node:
            raise ValueError(f"{len(numbers)} numbers at node {lines[start].strip()}")
        node = int(lines[start])
        if f"{node}.x" in amplitudes:
            raise ValueError(f"node {node} twice in a mode")
        # A node has three or six directions.
        for axis, k in zip(DIRECTIONS, range(0, numbers_of_node, numbers_of_value), strict=False):
            amplitudes[f"{node}.{axis}"] = complex(*numbers[k : k + numbers_of_value])
    # The seventh line of a data set 55 has the counts of its codes and of its numbers, the load
    # case and the mode; the tenth of a data set 2414 has the mode as its sixth number.
    mode = int(head[mode_line].split()[5 if is_2414 else 3])
    texts = [head[1], *head[3:8]] if is_2414 else head[:5]
    return UffShape(mode, hertz, quantity, texts, amplitudes)


def _real_amplitudes(
    key: str, amplitudes: Mapping[str, complex], floors: Mapping[str, int]
) -> dict[int, Array]:
    """Return the real amplitude of a mode on each measured floor, an array of one number each.

    The phases of all amplitudes are turned by a common angle that makes the norm of the real parts
    largest, and the imaginary parts that remain are left out.

    Args:
        key: Name of the mode in messages.
        amplitudes: Complex amplitudes by node and direction, such as "12.x".
        floors: Number of the floor of each measured unknown, by node and direction in either case.

    Raises:
        RefusedError: An unknown is missing or not finite, or the modal phase collinearity is below
            0.9, so that there is no real shape.
    """
    missing = [name for name in floors if name.lower() not in amplitudes]
    value = f"without {', '.join(missing)}"
    allowed = f"unknowns of {[*amplitudes][:8]} …"
    require(not missing, key, value, allowed)
    values = np.array([amplitudes[name.lower()] for name in floors])
    require(np.isfinite(values).all(), key, "not finite", "finite amplitudes")
    # Below this collinearity a complex shape has no real one (Pappa and Elliott 1993).
    min_collinearity = 0.9
    collinearity = phase_collinearity(values)
    allowed = f"a modal phase collinearity from {min_collinearity:g} on"
    require(collinearity >= min_collinearity, key, f"complex: {collinearity:.3f}", allowed)
    # All phases are turned by the angle that makes the norm of the real part largest.
    turn = np.exp(-0.5j * np.angle((values**2).sum()))
    real_parts = (values * turn).real
    return {floor: real_parts[k : k + 1] for k, floor in enumerate(floors.values())}


def phase_collinearity(shape: Array) -> float:
    """Return the modal phase collinearity of a complex shape.

    It is (λ₁ - λ₂)² / (λ₁ + λ₂)² with the eigenvalues λ of the covariance matrix of the real and
    the imaginary parts (Pappa and Elliott, J. Guidance Control Dyn. 16, 860, 1993). It is 1 if all
    phases are equal or opposite, and also if all amplitudes are 0; the smallest value is 0.

    Args:
        shape: Complex amplitudes, shape (unknowns,).
    """
    parts = np.stack([shape.real, shape.imag])
    # The eigenvalues of a symmetric matrix [[a, b], [b, c]] differ by √((a - c)² + 4 b²), and their
    # sum is the trace.
    covariance = parts @ parts.T
    difference = (covariance[0, 0] - covariance[1, 1]) ** 2 + 4 * covariance[0, 1] ** 2
    total = np.trace(covariance) ** 2
    return float(difference / total) if total > 0 else 1.0
