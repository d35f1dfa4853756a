"""Measured modes of a universal file: its data sets 55."""

from __future__ import annotations

from collections.abc import Mapping
from math import ceil
from pathlib import Path

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import RefusedError, require
from alphacut.frame.identify.mode_rows import ModeRows
from alphacut.frame.records.text_file import read_bytes
from alphacut.frame.records.uff import COMPLEX, DIRECTIONS, data_sets, floats

ENDINGS = (".uff", ".unv")
NORMAL_MODE, COMPLEX_MODES = 2, (3, 7)
"""Types of analysis in the head of a data set 55."""
MIN_COLLINEARITY = 0.9
"""Modal phase collinearity below which a complex shape has no real one (Pappa, Elliott 1993)."""


def uff_mode_rows(path: Path, floors: Mapping[str, int]) -> tuple[ModeRows, ...]:
    """Reads the modes of a universal file (data sets 55), one measurement each, by rising number.

    `floors` has the floor of each measured unknown, named NODE.DIRECTION, as {"12.x": 1}. Complex
    shapes are refused below a modal phase collinearity of `MIN_COLLINEARITY`.
    """
    content = read_bytes(path)
    try:
        sets = [_parse_shape(*rows) for rows in data_sets(content, 55)]
    except (ValueError, IndexError) as error:
        allowed = "data sets 55 of a universal file"
        raise RefusedError(path.name, str(error)[:80], allowed) from None
    modes: dict[int, ModeRows] = {}  # by number
    for mode, frequency, amplitudes in filter(None, sets):
        is_new, key = mode not in modes, f"{path.name}, data set 55"
        require(is_new, key, f"mode {mode} again", "each mode once")
        key = f"{path.name}, mode {mode}"
        is_positive, value = 0 < frequency < np.inf, f"{frequency:g} Hz"
        require(is_positive, f"{key}: frequency", value, "above 0 Hz")
        shape = _real_amplitudes(key, amplitudes, floors)
        modes[mode] = ModeRows(mode, np.array([frequency]), shape if len(shape) > 1 else {})
    require(bool(modes), path.name, "without a mode", "a data set 55 of a normal or complex mode")
    return tuple(modes[number] for number in sorted(modes))


Shape = tuple[int, float, dict[str, complex]]
"""A data set 55: number of the mode, frequency in Hz, amplitudes by NODE.DIRECTION."""


def _parse_shape(head: list[str], values: bytes | list[str]) -> Shape | None:
    """The mode shape of a data set 55; None of another analysis."""
    _, analysis, _, _, kind, size = (int(word) for word in head[5].split()[:6])
    if analysis not in (NORMAL_MODE, *COMPLEX_MODES):
        return None
    reals, parts = floats(head[7]), 2 if kind in COMPLEX else 1
    # of a complex mode the eigenvalue s has |s|/2π
    hertz = reals[0] if analysis == NORMAL_MODE else abs(complex(*reals[:2])) / (2 * np.pi)
    amplitudes: dict[str, complex] = {}
    lines = [str(line) for line in values if str(line).strip()]
    step = 1 + ceil(parts * size / 6)  # lines of a node: its number, then six numbers a line
    for start in range(0, len(lines), step):
        numbers = floats(" ".join(lines[start + 1 : start + step]))
        if len(numbers) != parts * size:
            raise ValueError(f"{len(numbers)} numbers at node {lines[start].strip()}")
        shape = [complex(*numbers[k : k + parts]) for k in range(0, parts * size, parts)]
        node = int(lines[start])
        if f"{node}.x" in amplitudes:
            raise ValueError(f"node {node} twice in a mode")
        amplitudes |= {f"{node}.{axis}": x for axis, x in zip(DIRECTIONS, shape, strict=False)}
    return int(head[6].split()[3]), hertz, amplitudes


def _real_amplitudes(
    key: str, amplitudes: Mapping[str, complex], floors: Mapping[str, int]
) -> dict[int, Array]:
    """Real amplitude of a mode, of shape (1,), on each floor of the unknowns in `floors`."""
    missing = [name for name in floors if name.lower() not in amplitudes]
    value, allowed = f"without {', '.join(missing)}", f"unknowns of {[*amplitudes][:8]} …"
    require(not missing, key, value, allowed)
    values = np.array([amplitudes[name.lower()] for name in floors])
    require(np.isfinite(values).all(), key, "not finite", "finite amplitudes")
    collinearity = phase_collinearity(values)
    allowed = f"a modal phase collinearity from {MIN_COLLINEARITY:g} on"
    require(collinearity >= MIN_COLLINEARITY, key, f"complex: {collinearity:.3f}", allowed)
    # the real part, after a turn of all phases that makes it largest
    turn = np.exp(-0.5j * np.angle((values**2).sum()))
    real_parts = (values * turn).real
    return {floor: real_parts[k : k + 1] for k, floor in enumerate(floors.values())}


def phase_collinearity(shape: Array) -> float:
    """Modal phase collinearity of a complex shape, 1 where all phases are equal or opposite.

    (λ₁ − λ₂)²/(λ₁ + λ₂)² with the eigenvalues λ of the covariance of real and imaginary parts
    (Pappa, Elliott 1993).
    """
    parts = np.stack([shape.real, shape.imag])
    covariance = parts @ parts.T
    difference = (covariance[0, 0] - covariance[1, 1]) ** 2 + 4 * covariance[0, 1] ** 2
    total = np.trace(covariance) ** 2
    return float(difference / total) if total > 0 else 1.0
