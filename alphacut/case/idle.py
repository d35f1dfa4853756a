"""Keys that have no effect beside the method that is chosen, and changes that no command reads."""

from __future__ import annotations

from collections.abc import Collection, Iterator

from alphacut.case.case import Case
from alphacut.io.problem import Problem, refuse

STEERED = ("auto", "modal", "graph-follower", "improved-graph-follower")
FOLLOWERS = ("graph-follower", "improved-graph-follower")
OF_MODELS = {
    "mesh.layers": ("prism",),
    "mesh.size": ("prism", "slices"),
    "mesh.interface": ("prism",),
}
"""Keys of the mesh with the models of the cell that have them; `alphacut mesh` has them always."""
OF_ENVELOPES = {
    "envelope.order": FOLLOWERS,
    "envelope.gain": FOLLOWERS,
    "envelope.tolerance": STEERED,
    "envelope.relative_tolerance": STEERED,
    "pendulum.tolerance": STEERED,
}
"""Keys with the methods of an envelope that have them."""


def idle_mesh(case: Case, models: Collection[str]) -> Iterator[Problem]:
    """Changed keys of the mesh that no model has; `alphacut mesh` reads those of the file."""
    for key, known in OF_MODELS.items():
        if key in case.changed and not set(models) & set(known):
            named = " and ".join(models)
            yield Problem(
                key,
                f"method {named} has no such option",
                str(case.written[key]),
                f"beside method {' or '.join(known)}",
                file="command line",
            )


def idle_envelope(case: Case) -> Iterator[Problem]:
    """Keys that the method does not have; a changed method passes over those of the file."""
    method = case.envelope.method
    for key, known in OF_ENVELOPES.items():
        if not case.asked(key) or method in known:
            continue
        if key in case.changed or "envelope.method" not in case.changed:
            yield case.problem(
                key, f"method {method} has no such option", f"beside method {', '.join(known)}"
            )


def require_read(case: Case, sections: Collection[str], command: str) -> None:
    """Refuse changes of keys that a command does not read.

    Args:
        case: The case.
        sections: Sections and full names of keys that the command reads.
        command: Name of the command, for the message.

    Raises:
        BadInput: One problem for each key.
    """
    unread = [
        key
        for key in sorted(case.changed)
        if key not in sections and not any(key.startswith(f"{name}.") for name in sections)
    ]
    what, allowed = f"command {command} does not read this key", f"keys of {', '.join(sections)}"
    where = "command line"
    refuse([Problem(x, what, str(case.written[x]), allowed, file=where) for x in unread])


def changed_moduli(case: Case) -> list[str]:
    """Keys of a modulus that the command line gives."""
    keys = ("modulus.value", "modulus.file", "modulus.measured", "frame.modulus")
    return [key for key in keys if key in case.changed]
