"""How possibly and how necessarily a case's frame exceeds its limits, and its safety margin."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from alphacut.case.case import Case
from alphacut.case.limits import Limit, limits_of
from alphacut.frame.decisions.exceeding import Exceeding, any_exceeding, exceeding
from alphacut.frame.structures.modes import ModalError
from alphacut.frame.structures.quantities import Output
from alphacut.io.files import Document
from alphacut.io.problem import BadInput
from alphacut.io.progress import Tick
from alphacut.io.units import engineering
from alphacut.stages.vibration import envelope
from alphacut.stages.vibration.envelope_task import EnvelopeTask, task_of
from alphacut.stages.vibration.exceedance import with_peaks
from alphacut.stages.vibration.structure import Structure
from alphacut.stochastic.theta.truncated_normal import Array

if TYPE_CHECKING:
    import xarray

ANY = "any of them"


def decision(
    case: Case,
    wanted: Structure,
    peaks: xarray.Dataset | None = None,
    *,
    workers: int = 1,
    progress: Tick | None = None,
) -> xarray.Dataset:
    """Decisions on every limit of [decision] and on any of them, with the margins of the peaks.

    Args:
        case: With the sections decision, envelope and frame.
        wanted: The structure.
        peaks: The envelope that [envelope] asks for, where it is computed already.
        workers: Processes of the proof.
        progress: Told the share done.

    Raises:
        BadInput: The motion has no model that a proof could rest on.
    """
    limits, task = limits_of(case), task_of(case)
    peaks = _peaks([one.output for one in limits], wanted, task, peaks)
    reached = peaks["peak"].sel(bound="upper").max("alpha")

    def near(one: Limit) -> float:
        """The peak as a share of the limit; where the farthest is unproved, the others are."""
        return float(reached.sel(output=one.output)) / one.value

    try:
        found = _decisions(wanted, task, sorted(limits, key=near), workers, progress)
    except (ValueError, ModalError) as error:
        raise BadInput.of("decision", str(error), file=str(case.path)) from None
    names = [one.name for one in limits]
    in_order = {name: found[name] for name in (*names, ANY) if name in found}
    return _dataset(in_order, limits, peaks, task)


def _peaks(
    outputs: Sequence[str], wanted: Structure, task: EnvelopeTask, given: xarray.Dataset | None
) -> xarray.Dataset:
    """Peaks of `outputs`: those given, and those of an envelope of the outputs without any.

    That envelope begins with the given one's first output, which a tolerance or gap is of.
    """
    import xarray

    known = [] if given is None else [*map(str, given["output"].values)]
    missing = [name for name in dict.fromkeys(outputs) if name not in known]
    if given is not None and not missing:
        return given
    assert wanted.frame is not None
    limited = replace(wanted, model=replace(wanted.frame, outputs=(*known[:1], *missing)))
    more = with_peaks(envelope.compute(limited, task), limited, task)
    if given is None:
        return more
    parts = (given, more.sel(output=missing))
    bare = [part[[name for name in PEAKS if name in part]] for part in parts]
    nature = " or ".join(dict.fromkeys(str(part.attrs["nature"]) for part in parts))
    return xarray.concat(bare, "output", fill_value=0.0).assign_attrs(nature=nature)


PEAKS = ("peak", "peak_error", "peak_below")


def _decisions(
    wanted: Structure,
    task: EnvelopeTask,
    limits: Sequence[Limit],
    workers: int,
    progress: Tick | None,
) -> dict[str, Exceeding]:
    assert wanted.frame is not None
    failed: dict[str, list[tuple[float, float, str]]] = {}  # by unit: boxes not to be tried again
    count = len(limits) + 1
    of = partial(exceeding, wanted.frame, wanted.inputs(task.fuzzy), workers=workers)
    of = partial(of, duration=task.duration, step=task.step, lowest=task.alpha[0], progress=False)
    each, least = {}, {one.output: one.value for one in sorted(limits, key=lambda x: -x.value)}
    for one in limits:
        alike = failed.setdefault(Output(one.output).unit, [])
        each[one.name] = of({one.output: one.value}, failed=alike)
        if progress:
            progress(len(each) / count)
    if count == 2:
        return each
    passed = any(found.scale.safe is None for found in each.values())
    return {**each, ANY: any_exceeding(each, of(least) if passed else None)}


def explained(case: Case, wanted: Structure, task: EnvelopeTask) -> list[str]:
    """A line on what the decisions cost: each limit takes models of its own, and their proofs."""
    if wanted.frame is None:
        return []
    limits = limits_of(case)
    cost = MODELS * len(limits) * 1.0
    count = f"{len(limits)} limits" if len(limits) > 1 else "a limit"
    words = f"{count}, ten times as much if one lies within the peaks"
    if (inputs := len(wanted.inputs(task.fuzzy))) >= MANY:
        words += f"; a minute or more for each limit where no proof covers the {inputs} inputs"
    return [f"decision, of run: about {float(f'{cost:.1g}'):g} s; {words}"]


MANY = 5
"""Inputs from which on a proof of the modes' error is tried at length before it is given up."""
MODELS = 3
"""Cost of a decision far from the limit, beside that of the envelope of its output."""


def _dataset(
    found: Mapping[str, Exceeding],
    limits: Sequence[Limit],
    peaks: xarray.Dataset,
    task: EnvelopeTask,
) -> xarray.Dataset:
    import xarray

    names = [*next(iter(found.values())).scale.names]
    nowhere = np.full(len(names), np.nan)
    witness = [nowhere if x.scale.witness is None else x.scale.witness for x in found.values()]
    outputs, values = [one.output for one in limits], [one.value for one in limits]
    of = peaks["peak"].sel(output=outputs).transpose("alpha", "bound", "output").values
    above, below = (
        peaks[name].sel(output=outputs).values if name in peaks else 0.0
        for name in ("peak_error", "peak_below")
    )
    ends = np.stack([of[:, 1] + above, np.maximum(of[:, 0] - below, 0.0)], axis=1)
    margin = np.array(values) - ends
    words = {"units": "SI, by output", "long_name": "limit less the peak of the magnitude"}
    return xarray.Dataset(
        {
            "possibility": (("limit", "bound"), [outward(x.possibility) for x in found.values()]),
            "necessity": (("limit", "bound"), [outward(x.necessity) for x in found.values()]),
            "witness": (("limit", "parameter"), witness, {"units": "SI, by input"}),
            "margin": (("alpha", "bound", "output"), margin, words),
        },
        {
            "limit": list(found),
            "bound": ["lower", "upper"],
            "parameter": names,
            "alpha": peaks["alpha"].values,
            "output": [one.name for one in limits],
            "observed": ("output", outputs),
            "allowed": ("output", values, {"units": "SI, by output"}),
        },
        {
            "verdict": ", ".join(_verdicts(found, margin[0], str(peaks.attrs["nature"]))),
            "nature": ", ".join(x.scale.nature for x in found.values()),
            "reason": "\n".join(_reasons(found)),
            "claim": next(iter(found.values())).claim,
            "step": task.step,
            "peaks": str(peaks.attrs["nature"]),
        },
    )


def _reasons(found: Mapping[str, Exceeding]) -> Iterator[str]:
    """Why limits are not proved, each reason with the limits that it is of."""
    told = {name: one.scale.reason for name, one in found.items() if name != ANY}
    for reason in dict.fromkeys(filter(None, told.values())):
        yield f"of {', '.join(name for name in told if told[name] == reason)}: {reason}"


def _verdicts(found: Mapping[str, Exceeding], margin: Array, nature: str) -> Iterator[str]:
    """A verdict on each limit; where nothing is proved, what the envelope says of it.

    `margin` is limit less peak at the lowest level, lower and upper ends, (2, limits).
    """
    unproved = "" if nature == "guaranteed" else " (not proved)"
    told, held = [], HOLDS.format(nature) + unproved
    for one, (low, high) in zip(found.values(), [*margin.T, (np.nan, np.nan)], strict=False):
        verdict = one.verdict
        if verdict == "undecided" and one.scale.witness is None and low > 0:
            verdict = held
        elif verdict == "undecided" and high < 0:
            verdict = f"exceeded by the {nature} envelope{unproved}"
        told.append(verdict)
    calm = all(verdict == held or verdict.startswith(KEPT) for verdict in told[:-1])
    if ANY in found and told[-1] == "undecided" and calm:
        told[-1] = held
    yield from told


HOLDS = "holds by the {} envelope"
KEPT = ("safe", "kept from")
PASSED = ("unsafe", "exceeded from")
"""How verdicts begin that are proved: on all levels, or from the lowest one up."""


def decision_document(found: xarray.Dataset) -> Document:
    """Decisions as they are printed with ``--json``, in SI."""
    limits, margins = {}, {}
    told = zip(found.attrs["verdict"].split(", "), found.attrs["nature"].split(", "), strict=True)
    for name, (verdict, nature) in zip(map(str, found["limit"].values), told, strict=True):
        one = found.sel(limit=name)
        point = dict(zip(map(str, one["parameter"].values), one["witness"].values, strict=True))
        limits[name] = {
            "possibility": one["possibility"].values,
            "necessity": one["necessity"].values,
            "verdict": verdict,
            "nature": nature,
            "witness": None if np.isnan(one["witness"].values).any() else point,
        }
    for name in map(str, found["output"].values):
        observed = str(found.coords.get("observed", found["output"]).sel(output=name).values)
        margins[name] = {
            "output": observed,
            "limit": float(found["allowed"].sel(output=name)),
            "unit": Output(observed).unit,
            **{side: found["margin"].sel(output=name, bound=side).values for side in SIDES},
        }
    facts = {key: found.attrs[key] for key in ("reason", "claim", "step", "peaks")}
    whole = {"limits": limits, "alpha": found["alpha"].values, "margins": margins, **facts}
    for name in limits:
        limits[name]["between_nodes"] = between_nodes(whole, name)
    return whole


def between_nodes(found: Document, name: str) -> str:
    """What a verdict, which is on the motion at nodes, says of that between them."""
    if found["limits"][name]["verdict"].startswith(("unsafe", "exceeded")):
        return "exceeded there, so over time, too"
    if all(one["lower"][0] > 0 for x, one in found["margins"].items() if name in (x, ANY)):
        return f"between them kept by the {found['peaks']} envelope, see the margin"
    if not found["limits"][name]["verdict"].startswith(KEPT):
        return "the motion between them is not included"
    far = _spare(found, name, " by up to {}")
    return f"between them {OPEN}{far}; a smaller step may settle it"


OPEN = "open"


def verdict_of(found: Document, name: str) -> str:
    """A verdict in words: a limit is not called safe where the margin between nodes is negative."""
    verdict, between = (found["limits"][name][key] for key in ("verdict", "between_nodes"))
    at_nodes = between.startswith(f"between them {OPEN}")
    return re.sub("^(safe|kept)", "kept at the nodes", verdict) if at_nodes else str(verdict)


def worth(found: Document, name: str) -> str:
    """Nature of a verdict, the nodes that it is on, and what it says of the motion between."""
    one, nodes = found["limits"][name], f"at nodes every {found['step']:g} s"
    of = "" if one["verdict"].startswith((*KEPT, *PASSED)) else "both degrees "
    of = "" if degree(*one["possibility"]) == UNKNOWN else f"{of}{one['nature']}, "
    return f"{of}{nodes}: {between_nodes(found, name)}"


def margin_ends(found: Document, name: str, level: int) -> tuple[float, float]:
    """Ends of a safety margin; a limit that every motion exceeds leaves none above 0."""
    low, high = (float(found["margins"][name][side][level]) for side in SIDES)
    passed = found["limits"][name]["verdict"].startswith(PASSED)
    return low, max(low, min(high, 0.0)) if passed else high


SIDES = ("lower", "upper")
DIGITS = 6  # of a degree; the search that proves it goes little further


def outward(ends: tuple[float, float]) -> tuple[float, float]:
    """Bounds of a degree, moved out to `DIGITS` decimals."""
    low, high = (end * 10**DIGITS for end in ends)
    return float(np.floor(low)) / 10**DIGITS, float(np.ceil(high)) / 10**DIGITS


def degree(low: float, high: float) -> str:
    """A degree between two bounds in words, one number where four decimals tell them alike."""
    ends = [f"{round(float(end), 4):g}" for end in (low, high)]
    return UNKNOWN if ends == ["0", "1"] else " … ".join(dict.fromkeys(ends))


UNKNOWN = "0 … 1 (unknown)"


def why(one: Document) -> str:
    """Why a limit is neither safe nor unsafe, and what would decide it."""
    if one["verdict"] != "undecided":
        cure = "; fewer or narrower fuzzy inputs would give a proof"
        return cure if "not proved" in one["verdict"] else ""
    if one["witness"] is None:
        return ", since neither a proof nor a motion beyond it was found; narrower inputs decide"
    if one["necessity"][1] >= 1:
        return ", since a motion beyond it was found, and neither one that keeps it nor a proof"
    return ", since some of the motions exceed it and some do not; narrower inputs decide"


def _spare(found: Document, name: str, words: str) -> str:
    """`words` on how far peaks between nodes are from a limit; empty for several limits."""
    if (one := found["margins"].get(name)) is None:
        return ""
    return words.format(engineering(abs(float(one["lower"][0])), one["unit"], digits=3))


def sentences(found: Document) -> Iterator[str]:
    """A line for each limit and one for any of them, then the proof and what is claimed."""
    for name, one in found["limits"].items():
        of = name
        if (margin := found["margins"].get(name)) is not None:
            of = f"|{margin.get('output', name)}| > {engineering(margin['limit'], margin['unit'])}"
        (a, b), (c, d) = one["possibility"], one["necessity"]
        degrees = f"possible to {degree(a, b)}, necessary to {degree(c, d)}"
        if one["verdict"].startswith((*KEPT, *PASSED)):
            yield f"{of}: {degrees}: {verdict_of(found, name)} ({worth(found, name)})"
            continue
        verdict, more = one["verdict"], f". It is {degrees}, {worth(found, name)}"
        if verdict.startswith(HOLDS[:5]):
            spare, more = _spare(found, name, " with {} to spare"), "" if UNKNOWN in more else more
            proof = "not proved, but " if "not proved" in verdict else ""
            verdict = f"{proof}kept by the {found['peaks']} envelope{spare}"
        yield f"{of}: {verdict}{why(one)}{more}"
    for name, margin in found["margins"].items():
        low, high = margin_ends(found, name, 0)
        ends = (engineering(end, margin["unit"], digits=3) for end in (low, high))
        level, of = f"α = {found['alpha'][0]:g}", f"peaks {found['peaks']}"
        if (above := float(margin["upper"][0])) > high:
            alone = engineering(above, margin["unit"], digits=3)
            of += f"; upper end 0 by the decision, {alone} by them alone"
        yield f"safety margin of {name} at {level}: {' … '.join(ends)} ({of})"
    yield from (f"not proved, {reason}" for reason in found["reason"].splitlines())
    if found["claim"]:
        yield f"a limit is exceeded with P at most as it is possible: {found['claim']}"
