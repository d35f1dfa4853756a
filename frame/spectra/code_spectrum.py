"""Spectra of codes and from files by their few numbers, and what records are scaled to."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, Literal

import numpy as np

from alphacut.base.errors import require, require_choice
from alphacut.base.quantity import Quantity
from alphacut.frame.spectra.asce7 import asce7_multi_period
from alphacut.frame.spectra.eurocode8 import eurocode8_spectrum
from alphacut.frame.spectra.target import TargetSpectrum


@dataclass(frozen=True, kw_only=True)
class CodeSpectrum:
    """A spectrum of a code or from a file.

    A spectrum of EN 1998-1 has `ground_acceleration` and `ground_type`, the multi-period spectrum
    of ASCE 7-22 `values`, a spectrum of one's own `file`.

    Args:
        ground_acceleration: design ground acceleration a_g = γI a_gR, as "0.25 g", of EN 1998-1
        ground_type: A to E, of EN 1998-1
        type: type of the spectrum of EN 1998-1
        values: the site's 22 accelerations of ASCE 7-22, 11.4.5.1, from 0 to 10 s
        file: CSV file with the head period [s],acceleration [g]
        damping: damping ratio of the spectrum; of [records.spectrum] that of the records' spectra,
            too
    """

    ground_acceleration: Annotated[float, Quantity("m/s^2", above=0)] | None = None
    ground_type: str = ""
    type: Literal[1, 2] = 1
    values: tuple[Annotated[float, Quantity("m/s^2", above=0)], ...] = ()
    file: TargetSpectrum | None = None
    damping: Annotated[float, Quantity(minimum=0, below=1)] = 0.05

    def __post_init__(self) -> None:
        """Refuse none or several spectra, and one that is no spectrum."""
        choices = ("ground_acceleration", "values", "file")
        stated = [name for name in choices if getattr(self, name) not in (None, ())]
        allowed = "one of ground_acceleration, values and file"
        require(len(stated) > 0, "ground_acceleration", None, allowed)
        require(len(stated) == 1, "spectrum", f"with {' and '.join(stated)}", allowed)
        if self.ground_acceleration is None:
            allowed = "beside ground_acceleration"
            require(not self.ground_type, "ground_type", self.ground_type, allowed)
            require(self.type == 1, "type", self.type, allowed)
        _ = self.target

    @property
    def behaviour_factor(self) -> float | None:
        """Behaviour factor q of EN 1998-1 for its design spectrum; None for the elastic one."""
        return None

    @property
    def target(self) -> TargetSpectrum:
        """The spectrum.

        Raises:
            RefusedError: The ground type is unknown, or there are not 22 values.
        """
        if self.file is not None:
            return replace(self.file, damping=self.damping)
        if self.ground_acceleration is None:
            return replace(asce7_multi_period(np.array(self.values)), damping=self.damping)
        require_choice("ground_type", self.ground_type, "ABCDE")
        return eurocode8_spectrum(
            self.ground_acceleration,
            self.ground_type,
            spectrum_type=self.type,
            damping=self.damping,
            q=self.behaviour_factor,
        )


@dataclass(frozen=True, kw_only=True)
class SuiteTarget(CodeSpectrum):
    """Target spectrum to which the records are scaled, of a code or from a file.

    The elastic spectrum of EN 1998-1 has `ground_acceleration` and `ground_type`, the multi-period
    spectrum of ASCE 7-22 `values`, a spectrum of one's own `file`.

    Args:
        fit: a factor of each record or of the suite, by least squares; or the target's value at T1
        over: range of periods that are fitted, over T1
    """

    fit: Literal["record", "suite", "period"] = "record"
    over: tuple[float, float] = (0.2, 2.0)
