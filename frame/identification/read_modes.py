"""Measured modes from files, as fuzzy numbers with claims."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from alphacut.base.errors import checked_number, path_of, require
from alphacut.base.stated import require_overrides, warn_of_overrides
from alphacut.frame.identification.mode_rows import mode_rows
from alphacut.frame.identification.modes import MeasuredMode, measured_mode
from alphacut.frame.identification.uff_modes import uff_mode_rows


def read_modes(
    path: str | Path,
    *,
    frequency_deviation: float | None = None,
    shape_deviation: float | None = None,
    floors: Mapping[str, int] | None = None,
    frequency_unit: str = "",
    override: Sequence[str] = (),
) -> tuple[MeasuredMode, ...]:
    """Read the measured natural modes of a frame from a CSV file or a universal file.

    A CSV file has the header ``mode,frequency [Hz],q1,q2`` with the floors that were measured, and
    a row for each measurement of a mode. ``frequency_std [Hz]`` and ``shape_std``, the standard
    deviations of an operational modal analysis, may stand before ``q1``. A universal file (ending
    .uff or .unv) has the modes in data sets 55 or 2414.

    Args:
        path: The file.
        frequency_deviation: Standard deviation of a measured frequency over its mean, for modes for
            which the file states none; by default the scatter of several rows of a mode.
        shape_deviation: Standard deviation of an amplitude over the largest amplitude of its mode,
            likewise.
        floors: For a universal file, the floor of each unknown that was measured, by
            NODE.DIRECTION, as ``{"12.x": 1}``.
        frequency_unit: Unit of the frequencies of a CSV file that states none, as "Hz". Another one
            than the file states is refused.
        override: ``["frequency_unit"]`` where the file states a wrong one.

    Returns:
        The modes by rising number, each with its mean frequency and mean amplitudes as fuzzy
        numbers that carry claims of coverage. Deviations that the file states are preferred to the
        arguments.

    Raises:
        RefusedError: The file cannot be read, a deviation is not positive, floors are given for a
            CSV file or missing for a universal file, or the measurements contradict their
            deviation.

    Example:
        >>> modes = read_modes("cases/laboratory-frame.modes.csv", frequency_deviation=0.01)
        >>> [mode.mode for mode in modes], round(modes[0].frequency.nominal, 3)
        ([1, 2, 3, 4], 0.883)
    """
    deviations = {"frequency_deviation": frequency_deviation, "shape_deviation": shape_deviation}
    for key, deviation in deviations.items():
        if deviation is not None:
            checked_number(key, deviation, positive=True)
    require_overrides(override, ("frequency_unit",))
    file = path_of("path", path)
    warn_of_overrides(file.name, override)
    if file.suffix.lower() in (".uff", ".unv"):
        require(bool(floors), "floors", None, "the floors of its unknowns")
        found = uff_mode_rows(file, floors or {}, frequency_unit, override)
    else:
        require(not floors, "floors", floors, "left out beside a CSV file")
        found = mode_rows(file, frequency_unit, override)
    modes = []
    for rows in found:
        mode = measured_mode(
            rows.mode,
            rows.frequencies,
            rows.amplitudes,
            frequency_deviation=rows.frequency_deviation or frequency_deviation,
            shape_deviation=rows.shape_deviation or shape_deviation,
        )
        modes.append(mode)
    return tuple(modes)
