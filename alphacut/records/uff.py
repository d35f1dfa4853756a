"""Universal files: mode shapes (data set 55) and time histories (data set 58), read by pyuff.

pyuff is an optional extra: ``pip install 'alphacut[uff]'``.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.refused import RefusedError, require
from alphacut.io.measured import ModeRows
from alphacut.records.recording import Recording
from alphacut.records.text_file import ACCELERATION_UNITS, acceleration_factor

ENDINGS = (".uff", ".unv")
NORMAL_MODE, COMPLEX_MODES = 2, (3, 7)
TIME_HISTORY = 1
ACCELERATION = 12
"""Specific data type of an acceleration in data set 58."""
DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")
MIN_COLLINEARITY = 0.9
"""Modal phase collinearity below which a complex shape has no real one (Pappa, Elliott 1993)."""
EVEN = 1e-3
"""Share of a step by which times may be uneven; the format has them in single precision."""


def uff_mode_rows(path: Path, floors: Mapping[str, int]) -> tuple[ModeRows, ...]:
    """Reads the modes of a universal file (data sets 55), one measurement each, by rising number.

    Args:
        path: The file.
        floors: Floor of each measured unknown, named NODE.DIRECTION, as {"12.x": 1}.

    Raises:
        RefusedError: The file cannot be read, has no mode or one mode twice, a named unknown is not
            in it, or a shape is complex with a modal phase collinearity below `MIN_COLLINEARITY`.
    """
    modes: dict[int, ModeRows] = {}  # by number
    for dataset in _datasets(path, 55):
        kind, key = dataset.get("analysis_type"), f"{path.name}, data set 55"
        if kind not in (NORMAL_MODE, *COMPLEX_MODES):
            continue
        number = int(dataset["mode_n"])
        require(number not in modes, key, value=f"mode {number} again", allowed="each mode once")
        modes[number] = _mode_rows(path, dataset, number, floors)
    allowed = "a data set 55 of a normal or complex mode"
    require(bool(modes), path.name, value="without a mode", allowed=allowed)
    return tuple(modes[number] for number in sorted(modes))


def read_uff_record(path: Path, channel: str = "") -> Recording:
    """Reads a recording of acceleration from a data set 58 of a universal file.

    Args:
        path: The file.
        channel: NODE.DIRECTION of the response, as "7.x"; may be left out where there is one.

    Raises:
        RefusedError: The file cannot be read, or holds no such acceleration over even times in a
            known unit.
    """
    sets = {_response_name(dataset): dataset for dataset in _datasets(path, 58)}
    names = [name for name in sets if not channel or name == channel.lower()]
    value, allowed = f"channel {channel or 'not named'}", ", ".join(sets) or "none is there"
    require(len(names) == 1, path.name, value=value, allowed=f"one of: {allowed}")
    dataset, key = sets[names[0]], f"{path.name}, response {names[0]}"
    kind = dataset["func_type"], dataset.get("ordinate_spec_data_type")
    allowed = "a time history (1) of an acceleration (12)"
    value = f"of function type {kind[0]} and data type {kind[1]}"
    require(kind == (TIME_HISTORY, ACCELERATION), key, value=value, allowed=allowed)
    unit = str(dataset.get("ordinate_axis_units_lab", "")).strip()
    factor = acceleration_factor(unit)
    if factor is None:
        raise RefusedError(key, f"in units of {unit or 'none'}", ACCELERATION_UNITS)
    time, samples = np.asarray(dataset["x"], float), np.real(np.asarray(dataset["data"]))
    steps = np.diff(time)
    is_even = len(steps) > 0 and steps[0] > 0 and np.ptp(steps) <= EVEN * steps[0]
    fits = is_even and np.isfinite(samples).all()
    require(fits, key, value="uneven", allowed="even times, finite samples")
    step = float(time[-1] - time[0]) / len(steps)
    return Recording("UFF 58", unit, step, factor * samples)


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


def _datasets(path: Path, kind: int) -> list[dict[str, Any]]:
    """Data sets of a kind (55 or 58) in a universal file, as pyuff reads them."""
    import pyuff

    try:
        file = pyuff.UFF(str(path))
        indices = [k for k, set_kind in enumerate(file.get_set_types()) if set_kind == kind]
        sets = file.read_sets(indices) if indices else []
    except Exception as error:  # pyuff raises plain exceptions, and whatever NumPy does
        reason = str(error)[:80] or type(error).__name__
        raise RefusedError(path.name, reason, "a universal file (UFF)") from None
    return [sets] if isinstance(sets, dict) else list(sets)


def _mode_rows(
    path: Path, dataset: dict[str, Any], number: int, floors: Mapping[str, int]
) -> ModeRows:
    """Frequency of a mode, and its real amplitudes on the floors of the unknowns in `floors`."""
    key = f"{path.name}, mode {number}"
    nodes = [int(node) for node in dataset["node_nums"]]
    values: dict[str, complex] = {}  # amplitude of each unknown
    for axis, direction in enumerate(DIRECTIONS, start=1):
        column = dataset.get(f"r{axis}")
        if column is not None:
            values |= {f"{n}.{direction}": complex(x) for n, x in zip(nodes, column, strict=True)}
    missing = [name for name in floors if name.lower() not in values]
    value, allowed = f"without {', '.join(missing)}", f"unknowns of {nodes[:8]} …"
    require(not missing, key, value=value, allowed=allowed)
    shape = np.array([values[name.lower()] for name in floors])
    collinearity = phase_collinearity(shape)
    is_real, value = collinearity >= MIN_COLLINEARITY, f"complex: {collinearity:.3f}"
    allowed = f"a modal phase collinearity from {MIN_COLLINEARITY:g} on"
    require(is_real, key, value=value, allowed=allowed)
    pairs = zip(floors.values(), _real_shape(shape), strict=True)
    amplitudes = {floor: np.array([amplitude]) for floor, amplitude in pairs}
    frequency = _frequency(dataset)
    require(frequency > 0, f"{key}: frequency", value=frequency, allowed="above 0 Hz")
    return ModeRows(number, np.array([frequency]), amplitudes if len(amplitudes) > 1 else {})


def _frequency(dataset: dict[str, Any]) -> float:
    """Natural frequency in Hz; that of a complex eigenvalue s is |s|/2π."""
    if dataset["analysis_type"] == NORMAL_MODE:
        return float(dataset["freq"])
    return float(abs(dataset["eig"])) / (2 * np.pi)


def _real_shape(shape: Array) -> Array:
    """Real part of a complex shape, after a turn of all phases that makes it largest."""
    angle = 0.5 * np.angle((shape**2).sum())
    return np.asarray((shape * np.exp(-1j * angle)).real)


def _response_name(dataset: dict[str, Any]) -> str:
    """NODE.DIRECTION of the response, whose direction is ±1 … ±6."""
    direction = abs(int(dataset["rsp_dir"]))
    name = DIRECTIONS[direction - 1] if 1 <= direction <= len(DIRECTIONS) else str(direction)
    return f"{int(dataset['rsp_node'])}.{name}"
