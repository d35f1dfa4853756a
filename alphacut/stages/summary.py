"""The results of a run, and its summary: all their numbers as one object, kept in summary.json."""

from __future__ import annotations

import json
from dataclasses import dataclass, field, fields, replace
from typing import Any, Self

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import RefusedError, require
from alphacut.base.number_text import STANDARD_GRAVITY, ShownUnit, axis_prefix
from alphacut.case.analyses import ANALYSES, answer_class
from alphacut.case.content import Content
from alphacut.case.structure import Structure
from alphacut.frame import LearnedInputs, StoreyFrame, SuitePeaks
from alphacut.frame.analyses.answer import Answer
from alphacut.frame.analyses.storey_table import assumptions, storey_table
from alphacut.frame.structures.linear import frequencies
from alphacut.frame.structures.quantities import output_of
from alphacut.io.files import Document
from alphacut.io.results import COMPLETE, RUN_AGAIN, PlainName, ResultsFolder
from alphacut.io.typed_json import from_document, to_document
from alphacut.stages.envelope import EnvelopeResult, EnvelopeTask
from alphacut.stages.image import ImageResult
from alphacut.stages.modulus import ModulusResult
from alphacut.stages.shares import ShareTable
from alphacut.stages.store import StageResult

SUMMARY = "summary.json"


@dataclass(frozen=True, eq=False, kw_only=True)
class FrameResult:
    """A frame at its nominal inputs.

    Args:
        omega_rad_per_s: Undamped angular frequencies, rising, shape (n,).
        period_s: First period.
        weight_N: Weight of all floors.
        heights_m: Heights of storeys by the names of the observed drifts.
        storeys: Texts of each storey of a frame by column, the top one first.
        assumptions: Sentences on what the model assumes.
    """

    omega_rad_per_s: Array
    period_s: float
    weight_N: float
    heights_m: dict[str, float]
    storeys: list[dict[str, str]] = field(default_factory=list)
    assumptions: list[str] = field(default_factory=list)


@dataclass
class Results:
    """Results of a run; None or empty where the case has no such stage.

    Args:
        content: The case, with the radius map that was computed.
        microstructure: Radius map of the particles.
        modulus: Stiffness of a cell.
        image: Stiffness of an image.
        structure: The structure, with its modulus and what was learned.
        tasks: The studies.
        envelopes: Their results by name.
        learned: What measured modes teach about the inputs.
        suite: Peaks over a suite of records.
        answers: Answers by the keys of their questions.
        shares: By how much each input widens the results.
    """

    content: Content
    microstructure: StageResult[Document] | None = None
    modulus: StageResult[ModulusResult] | None = None
    image: StageResult[ImageResult] | None = None
    structure: Structure | None = None
    tasks: tuple[EnvelopeTask, ...] = ()
    envelopes: dict[str, StageResult[EnvelopeResult]] = field(default_factory=dict)
    learned: LearnedInputs | None = None
    suite: SuitePeaks | None = None
    answers: dict[str, Answer] = field(default_factory=dict)
    shares: StageResult[ShareTable] | None = None

    @property
    def single(self) -> dict[str, StageResult[object]]:
        """Results of the stages that have one, by name."""
        names = ("microstructure", "modulus", "image", "shares")
        return {x: getattr(self, x) for x in names if getattr(self, x) is not None}

    @property
    def fingerprints(self) -> dict[str, str]:
        """Digest of what each result was made from, by the name of its stage."""
        studies = {f"envelope_{name}": x.fingerprint for name, x in self.envelopes.items()}
        return {name: x.fingerprint for name, x in self.single.items()} | studies

    @property
    def frame_result(self) -> FrameResult | None:
        """Return frequencies, weight and heights of the frame at its nominal inputs.

        Returns:
            Undamped angular frequencies in rad/s, rising; the first period in s; the weight of all
            floors in N; and the heights in m of the storeys whose drifts are observed. None without
            a structure, and of structures without floors.
        """
        structure = self.structure
        if structure is None or structure.linear is None or not structure.floor_masses:
            return None
        # Heights are shown as references of drifts, so that only observed drifts need theirs.
        omega = frequencies(structure.linear)
        observed = set(structure.outputs)
        heights = {x: height.nominal for x, height in structure.heights.items() if x in observed}
        described: dict[str, Any] = {}
        if isinstance(structure.model, StoreyFrame):
            described["storeys"] = storey_table(structure.model).records
            described["assumptions"] = assumptions(structure.model)
        return FrameResult(
            omega_rad_per_s=omega,
            period_s=float(2 * np.pi / omega[0]),
            weight_N=sum(mass.nominal for mass in structure.floor_masses) * STANDARD_GRAVITY,
            heights_m=heights,
            **described,
        )

    @property
    def damping(self) -> dict[str, tuple[float, float, float]]:
        """Return the damping ratios that the loss factor of the material gives, by name.

        Returns:
            Lower end of the support, nominal value and upper end of "zeta", or of "zeta1", "zeta2"
            … of each mode. Empty where the case states the damping itself.
        """
        # Ratios that the case states are inputs, which a table of results need not repeat.
        if self.structure is None or not self.content.has_material_damping:
            return {}
        return {
            name: (number.support.lower, number.nominal, number.support.upper)
            for name, number in self.structure.numbers.items()
            if name.startswith("zeta")
        }


@dataclass(frozen=True, eq=False, kw_only=True)
class Parts:
    """Numbers of all results of a run; None or empty where the case has no such stage."""

    microstructure: dict[str, Any] | None = None
    modulus: ModulusResult | None = None
    image: ImageResult | None = None
    structure: FrameResult | None = None
    damping: dict[str, tuple[float, float, float]] = field(default_factory=dict)
    envelopes: dict[PlainName, EnvelopeResult] = field(default_factory=dict)
    records: SuitePeaks | None = None
    update: LearnedInputs | None = None
    answered: dict[str, Answer] = field(default_factory=dict)
    shares: ShareTable = field(default_factory=dict)

    @classmethod
    def of(cls, results: Results, **further: object) -> Self:
        """Return the numbers of all results of a run.

        Args:
            results: The results. Stages that the case does not have leave their parts None or
                empty.
            further: Values of further fields of this class, such as the title and the case of a
                summary.

        Raises:
            TypeError: A name in `further` is no field, or a field without a default is missing.
        """
        drawn = {task.name: tuple(task.figures) for task in results.tasks}
        # Stages with a single result have the name of their field, such as "modulus".
        parts: dict[str, Any] = {name: x.numbers for name, x in results.single.items()}
        parts |= {
            "structure": results.frame_result,
            "damping": results.damping,
            "envelopes": {
                name: replace(result.numbers, drawn=drawn[name])
                for name, result in results.envelopes.items()
            },
            "records": results.suite,
            "update": results.learned,
        }
        return cls(**(parts | {"answered": results.answers} | further))

    def parts(self) -> Document:
        """Return all parts by name but those that the run lacks, as a JSON document.

        The answers stand by their own names.
        """
        # Empty texts and numbers of zero are results; None and empty tables are missing stages.
        values: dict[str, object] = {}
        for x in fields(self):
            if x.name == "answered":
                values |= {answer.key: answer for answer in self.answers}
            else:
                values[x.name] = getattr(self, x.name)
        is_there = {name: value is not None and value != {} for name, value in values.items()}
        return {name: to_document(x) for name, x in values.items() if is_there[name]}

    @property
    def encloses(self) -> str:
        """Name of the set of inputs around which the peaks are those of a box; empty without."""
        peaks = (peak for study in self.studies.values() for peak in study.peak.values())
        return next((peak.encloses for peak in peaks if peak.encloses), "")

    @property
    def studies(self) -> dict[str, EnvelopeResult | SuitePeaks]:
        """What has peaks, by name: the studies, and at last the suite as "records"."""
        suite = {} if self.records is None else {"records": self.records}
        return {**self.envelopes, **suite}

    @property
    def shown_units(self) -> dict[str, ShownUnit]:
        """Return the unit in which each output is shown, wherever it is.

        Returns:
            Label and factor from SI by output. It is the unit of the first limit of the output that
            states one; without such a limit g for accelerations, and for others the SI unit with a
            prefix that fits the largest peak. Outputs that no study has are left out.
        """
        units: dict[str, str] = {}
        largest: dict[str, float] = {}
        for study in self.studies.values():
            units |= study.units
            for name, peak in study.peak.items():
                ends = float(peak.lower[0]), float(peak.upper[0])
                output = output_of(name)
                largest[output] = max(largest.get(output, 0.0), *map(abs, ends))
        # Outputs without a peak have the extremes of their envelope.
        for envelope in self.envelopes.values():
            for output in envelope.min:
                size = max(abs(envelope.min[output]), abs(envelope.max[output]))
                largest.setdefault(output, float(size))

        found: dict[str, ShownUnit] = {}
        for output, unit in units.items():
            if unit == "m/s^2":  # engineers state accelerations in g
                found[output] = ShownUnit("g", 1 / STANDARD_GRAVITY)
            else:
                factor, label = axis_prefix(largest.get(output, 0.0), unit)
                found[output] = ShownUnit(label, factor)
        # Later entries replace earlier ones: the unit of the first answer that states one stays.
        for answer in reversed(self.answers):
            stated = answer.stated_units
            found |= {output: unit for output, unit in stated.items() if output in units}
        return found

    @property
    def answers(self) -> list[Answer]:
        """The answers to all questions of the case, in the order of the report."""
        return [self.answered[key] for key in ANALYSES if key in self.answered]


@dataclass(frozen=True, eq=False, kw_only=True)
class Summary(Parts):
    """Numbers of a run with their origin; `changes` are those of the command line."""

    format_version: int
    case: str
    title: str
    about: str = ""
    case_text: str
    command: str
    versions: dict[str, str]
    changes: tuple[str, ...] = ()
    figures: tuple[PlainName, ...] = ()
    seconds: float
    fingerprints: dict[PlainName, str] = field(default_factory=dict)

    @classmethod
    def read(cls, folder: ResultsFolder) -> Self:
        """Return the summary in a folder of results, from its file summary.json.

        Raises:
            RefusedError: The file is missing, changed, no JSON, or of another version of this
                class.
        """
        content = folder.content(SUMMARY)
        try:
            document = json.loads(content)
            answered = {}
            for key in ANALYSES:
                if isinstance(document, dict) and key in document:
                    answered[key] = from_document(answer_class(key), document.pop(key), key)
            return replace(from_document(cls, document), answered=answered)
        except (ValueError, RecursionError) as error:
            # Both readers begin their messages with what is wrong, such as the name of the key.
            keys = str(error).partition(":")[0] or "no JSON object"
            what = f"damaged ({SUMMARY}: {keys})"
            raise RefusedError(str(folder.path), what, COMPLETE, RUN_AGAIN) from None

    def require_run_of(self, folder: ResultsFolder) -> None:
        """Refuse a folder in which a result file is of another run than this summary.

        The summary lists a digest of what each result was made from, and the manifest of the folder
        lists the same digest with each file. They differ where a later run was interrupted before
        its summary.

        Raises:
            RefusedError: Naming the results of another run.
        """
        # `made_from` returns the files that the manifest lists with a digest.
        changed = [
            name
            for name, source in self.fingerprints.items()
            if f"{name}.json" not in folder.made_from(source)
        ]
        value = f"with {', '.join(changed)} of another run"
        require(not changed, str(folder.path), value=value, allowed="one run's files")
