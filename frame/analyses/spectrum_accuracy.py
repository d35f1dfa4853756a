"""By how much the response-spectrum method errs under records, beside their exact peaks."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import require
from alphacut.base.number_text import MINUS
from alphacut.base.progress_bar import Progress, nth_subprogress
from alphacut.frame.analyses.answer import Answer, Row
from alphacut.frame.analyses.spectrum_response import SpectrumResponse
from alphacut.frame.analyses.suites import GroundMotion, ScaledRecord, record_peaks, scaled_records
from alphacut.frame.spectra.response_spectrum import response_spectrum
from alphacut.frame.structures.linear import LinearSystem
from alphacut.fuzzy import Crisp
from alphacut.fuzzy.result import Nature


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class SpectrumAccuracy(Answer):
    """Errors of the response-spectrum method at the nominal inputs, for R records and m outputs.

    Args:
        rule: Rule of combination.
        outputs: Names of the outputs.
        units: SI unit of each output.
        names: Names of the records.
        combined: Combined peaks by the spectrum of each record itself, shape (R, m).
        peaks: Lower and upper bound of the peaks under each record, shape (R, m, 2).
        nature: Guarantee of these bounds.
    """

    key = "spectrum_accuracy"
    title = "By how much does the response-spectrum method err under these records?"
    rule: str
    outputs: tuple[str, ...]
    units: tuple[str, ...]
    names: tuple[str, ...]
    combined: Array
    peaks: Array
    nature: Nature

    @property
    def errors(self) -> Array:
        """Bounds of combined peak over peak, less 1, shape (R, m, 2); NaN where nothing moves."""
        peaks = np.where(self.peaks > 0, self.peaks, np.nan)[..., ::-1]
        return np.asarray(self.combined[..., np.newaxis] / peaks - 1)

    def text_rows(self) -> Iterator[Row]:
        """Yield a row for each output: the range of its errors and where the extremes are."""
        for k, name in enumerate(self.outputs):
            errors = self.errors[:, k]
            low = int(np.nanargmin(errors[:, 0]))
            high = int(np.nanargmax(errors[:, 1]))
            yield {
                "peak of": name,
                "errs by": _range_text(errors),
                "nature": self.nature,
                "lowest under": self.names[low],
                "highest under": self.names[high],
            }

    def number_rows(self) -> Iterator[Row]:
        """Yield a row for each output and record: both peaks and the bounds of the error."""
        for k, (name, unit) in enumerate(zip(self.outputs, self.units, strict=True)):
            for r, record in enumerate(self.names):
                yield {
                    "output": name,
                    "unit": unit,
                    "record": record,
                    "combined peak": self.combined[r, k],
                    "lower peak": self.peaks[r, k, 0],
                    "upper peak": self.peaks[r, k, 1],
                    "least error": self.errors[r, k, 0],
                    "greatest error": self.errors[r, k, 1],
                }

    def words(self) -> str:
        """Return a sentence on the errors of all outputs."""
        return (
            f"At the most plausible inputs {self.rule} with the spectrum of each record errs by"
            f" {_range_text(self.errors.reshape(-1, 2))} on these {len(self.names)} records, beside"
            " the peak under the record itself. The spectra are those of the modes' own damping."
        )


def spectrum_accuracy(
    structure: LinearSystem,
    found: SpectrumResponse,
    suite: Sequence[GroundMotion],
    *,
    step: float,
    progress: Progress | None = None,
) -> SpectrumAccuracy:
    """Return by how much the response-spectrum method errs under each record of a suite.

    Each record moves the structure with its nominal inputs, to its end and for five natural periods
    more. Its peaks are compared with those that
    the method gives by the spectrum of the same record, for the damping ratio of each mode.

    Args:
        structure: The structure of `found`.
        found: What the method gave under a code's spectrum; the modes, outputs and the rule of
            combination are taken from it.
        suite: Records of one component each.
        step: Time step, in s.
        progress: Called with the completed fraction.

    Raises:
        RefusedError: A record is zero throughout, or has several components.
        FailedError: A peak is not bounded.
    """
    records = scaled_records(structure, suite, duration=np.inf, step=step)
    return accuracy_of(structure, found, records, step=step, progress=progress)


def accuracy_of(
    structure: LinearSystem,
    found: SpectrumResponse,
    records: Sequence[ScaledRecord],
    *,
    step: float,
    progress: Progress | None = None,
) -> SpectrumAccuracy:
    """Return by how much the method errs under each of some scaled records.

    The arguments are those of `spectrum_accuracy`, but of records with the length of their
    responses, which must not end before the record.

    Raises:
        RefusedError: A response ends before its record, or a record has several components.
        FailedError: A peak is not bounded.
    """
    for record in records:
        allowed = "records of one component, to their end"
        is_whole = len(record.components) == 1 and record.facts.truncated_fraction == 0
        require(is_whole, f"record {record.name}", "of several or cut off", allowed)
    inputs = {name: Crisp(value) for name, value in found.nominal_inputs.items()}
    combined = []
    peaks = []
    natures = []
    for r, record in enumerate(records):
        by_name = record_peaks(
            structure,
            inputs,
            record,
            found.outputs,
            step=step,
            alpha=[1.0],
            progress=nth_subprogress(progress, r, len(records)),
        )
        of_outputs = [by_name[name] for name in found.outputs]
        peaks.append([(x.reached[0], x.upper[0] + x.error[0]) for x in of_outputs])
        natures += [x.nature for x in of_outputs]
        combined.append(_combined(found, record))
    return SpectrumAccuracy(
        rule=found.method.rule,
        outputs=found.outputs,
        units=found.units,
        names=tuple(record.name for record in records),
        combined=np.array(combined),
        peaks=np.array(peaks),
        nature=Nature.weakest(natures),
    )


def _combined(found: SpectrumResponse, record: ScaledRecord) -> Array:
    """Return the combined peaks at the nominal inputs by the spectrum of a record, shape (m,)."""
    modes = found.modes
    pairs = zip(modes.periods[0].tolist(), modes.ratios[0].tolist(), strict=True)
    accelerations = [
        float(response_spectrum(record.ground, period, ratio, readings=2000))
        for period, ratio in pairs
    ]
    return np.asarray(found.method.combined(modes, np.array([accelerations]))[0])


def _range_text(errors: Array) -> str:
    """Return the range of errors, shape (…, 2), as text, such as "−12 … +31 %"."""
    low = np.floor(100 * np.nanmin(errors[:, 0]))
    high = np.ceil(100 * np.nanmax(errors[:, 1]))
    return f"{low:+.0f} … {high:+.0f} %".replace("-", MINUS)
