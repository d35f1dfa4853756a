"""What can be known of a proof before anything is computed: whether there will be one."""

from __future__ import annotations

from collections.abc import Iterator

from alphacut.io.problem import Problem
from alphacut.stages.vibration.envelope_task import EnvelopeTask
from alphacut.stages.vibration.structure import Structure

MANY = 5
"""Inputs from which on a proof may take minutes."""


def too_many(key: str, wanted: Structure, task: EnvelopeTask) -> Iterator[Problem]:
    """The problem that a proof is asked for with too many inputs, by the key that asks."""
    from alphacut.frame.certificate.remainder import MOST_PARAMETERS

    names = wanted.inputs(task.fuzzy)
    if len(names) > MOST_PARAMETERS:
        what = f"proofs are affordable up to {MOST_PARAMETERS} fuzzy inputs, and there are"
        cure = "fewer in [envelope] fuzzy, or no proof: envelopes and peaks need none"
        if key == "decision":
            cure = f"fewer in [envelope] fuzzy, or no [decision]: {BY_PEAKS}"
        yield Problem(key, f"{what} {len(names)}", ", ".join(names), cure)


BY_PEAKS = (
    "peaks.csv, which report --csv writes, then judges a limit: below 'least peak at nodes (bound)'"
    " less its error every motion exceeds it, above 'greatest peak at nodes' and its error every"
    " motion keeps it, which is searched and not proved"
)


def estimated_reason(wanted: Structure, task: EnvelopeTask) -> str:
    """Why bounds will be estimated where no proof is asked for; empty where one will be tried."""
    from alphacut.frame.certificate.remainder import MOST_PARAMETERS

    count = len(wanted.inputs(task.fuzzy))
    if wanted.linear is None or task.certify is not None or task.method != "auto":
        return ""
    if count > MOST_PARAMETERS:
        what = f"proofs are affordable up to {MOST_PARAMETERS} fuzzy inputs, and there are {count}"
        return f"{what}; fewer can be proved"
    if reason := unproved_reason(wanted, task):
        return reason
    if count < MANY:
        return ""
    return (
        f"a proof with {count} fuzzy inputs may take minutes and is then not tried unasked;"
        " envelope.certify asks for one, which with a wide gap may take less time than estimated"
        " bounds, and fewer fuzzy inputs are proved at once"
    )


def unproved_reason(wanted: Structure, task: EnvelopeTask) -> str:
    """Why the bounds of a linear structure will not be guaranteed; empty if that is not known."""
    from alphacut.frame.boxes import boxes
    from alphacut.frame.structures.polynomial_dependence import UnprovedError, degrees

    if wanted.linear is None:
        return ""
    cuts = boxes(wanted.inputs(task.fuzzy), task.alpha)
    ends = {name: (cuts.lower[0, k], cuts.upper[0, k]) for k, name in enumerate(cuts.names)}
    try:
        degrees(wanted.linear, ends)
    except UnprovedError as error:
        return str(error)
    return ""
