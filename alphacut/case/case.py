"""A case: its content and the file that it comes from."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from alphacut.case.content import CONTENT, Content
from alphacut.io.provenance import digest


@dataclass(frozen=True)
class Case:
    """A case that was read.

    Args:
        path: File that it comes from.
        text: The file as it stands.
        content: The sections of the file, built.
        changes: Changes from the command line, KEY=VALUE each.
    """

    path: Path
    text: str
    content: Content
    changes: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """The file's name without its ending: results go to results/NAME."""
        return self.path.stem

    @property
    def stages(self) -> tuple[str, ...]:
        """The stages that a run computes."""
        return self.content.stages

    def traces(self) -> dict[str, str]:
        """Digest of each section; "" of those that the file does not have."""
        names = (name for name in CONTENT.model_fields if name not in ("title", "about"))
        every: Mapping[str, object] = {name: getattr(self.content, name) for name in names}
        return {name: digest(section) if section else "" for name, section in every.items()}


def file_digest(path: Path) -> str:
    """Digest of the content of a file."""
    return hashlib.sha256(path.read_bytes()).hexdigest()
