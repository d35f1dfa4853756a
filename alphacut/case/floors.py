"""Section on floor spectra."""

from __future__ import annotations

from typing import Annotated

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import RefusedError, require
from alphacut.case.limits import AnalysisSection
from alphacut.case.structure import Structure
from alphacut.case.types import Names, OneOrMany, Quantity, Time
from alphacut.frame import Accelerogram
from alphacut.frame.spectra.response_spectrum import MIN_PERIOD
from alphacut.frame.structures.linear import frequencies

Period = Annotated[float, Quantity("s", minimum=0)]
DampingRatio = Annotated[float, Quantity(minimum=0, maximum=0.999)]
RANGE = ("shortest", "longest", "count")


class FloorSpectrumSection(AnalysisSection):
    """Spectra of light oscillators on floors, over the α-cuts of [envelope], with its time step.

    With [records] they are means over the records.
    """

    key = "floor_spectrum"
    records = "allowed"

    outputs: Names
    """absolute accelerations of the floors, as a4 of [frame]"""
    damping: OneOrMany[DampingRatio] = (0.05,)
    """damping ratio of the oscillators; of several, as ["2 %", "5 %"], the figure shows all"""
    shortest: Time = 0.05
    """shortest period; short ones take long"""
    longest: Time = 2.0
    """longest period"""
    count: Annotated[int, Quantity(minimum=2, maximum=500, is_integer=True)] = 20
    """number of periods in geometric progression, beside 0, the floor's largest acceleration, and
    the nominal periods of the structure in this range"""
    periods: OneOrMany[Period] = ()
    """periods in place of these, as ["0 s", "0.2 s"]"""

    def require_consistent(self) -> None:
        """Refuse periods beside their range, too short ones, and a range without width."""
        given = [name for name in RANGE if self.has_key(name)]
        is_one = not (self.periods and given)
        require(is_one, "floor_spectrum.periods", f"beside {', '.join(given)}", "one of them")
        for name in ("periods", "shortest"):
            smallest = min((x for x in np.atleast_1d(getattr(self, name)) if x), default=1.0)
            allowed = f"0 s, and periods from {MIN_PERIOD:g} s on"
            is_long = smallest >= MIN_PERIOD
            require(is_long, f"floor_spectrum.{name}", f"{smallest:g} s", allowed)
        for name, unit in (("periods", " s"), ("damping", "")):
            values = getattr(self, name)
            text = ", ".join(f"{x:g}{unit}" for x in values)
            require(len(set(values)) == len(values), f"floor_spectrum.{name}", text, "each once")
        allowed = f"more than floor_spectrum.shortest, {self.shortest:g} s"
        is_range = self.shortest < self.longest
        require(is_range, "floor_spectrum.longest", f"{self.longest:g} s", allowed)

    @property
    def stated_periods(self) -> Array:
        """The periods in s, shape (periods,), without those of the structure."""
        if self.periods:
            return np.array(self.periods)
        return np.append(0.0, np.geomspace(self.shortest, self.longest, self.count))

    def periods_of(self, structure: Structure) -> Array:
        """Return the periods in s, shape (periods,), and nominal ones of the structure in a range.

        Spectra are largest about these.
        """
        if self.periods or structure.linear is None:
            return self.stated_periods
        own = 2 * np.pi / frequencies(structure.linear)
        own = own[(own >= self.shortest) & (own <= self.longest)]
        return np.union1d(self.stated_periods, own)

    def require_records(self, *, components: int, all_angles: bool) -> None:
        """Refuse all angles of incidence, over which floor spectra are not bounded."""
        allowed = "an angle in records.angle"
        require(not all_angles, "floor_spectrum", "over all angles", allowed)

    def require_answerable(self, structure: Structure, components: int) -> None:
        """Refuse a structure without floor spectra, and outputs that are no accelerations."""
        # takes time to import
        from alphacut.frame.analyses.floor_oscillators import moved_by, observed_accelerations

        motions = [(Accelerogram(1.0, np.zeros(2)),) * components] if components else []
        try:
            (model,) = moved_by(structure.model, motions)
            observed_accelerations(model, self.outputs, {})
        except RefusedError as error:
            key = f"floor_spectrum: {error.key}"
            raise RefusedError(key, error.value, error.allowed, error.cure) from None
