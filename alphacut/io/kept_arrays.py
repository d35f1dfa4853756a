"""Arrays of an unfinished computation in a file, for the same computation begun again."""

from __future__ import annotations

import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from alphacut.io.files import whole_file
from alphacut.stochastic.theta.truncated_normal import Array

KEY = "fingerprint"


@dataclass(eq=False)
class KeptArrays:
    """What is found so far, by name, in a file that is whole at any time.

    Args:
        path: The file, with ending .npz.
        key: Fingerprint of the computation; a file of another one is not read.
        fresh: Not to read what is there.
    """

    path: Path
    key: str
    fresh: bool = False
    _all: dict[str, dict[str, Array]] = field(init=False)

    def __post_init__(self) -> None:
        self._all = {} if self.fresh else self._read()

    def load(self, name: str) -> Mapping[str, Array] | None:
        """What was saved under a name; None if nothing was."""
        return self._all.get(name)

    def save(self, name: str, found: Mapping[str, Array]) -> None:
        """Keep arrays under a name, in place of what it had."""
        self._all[name] = {part: np.array(array) for part, array in found.items()}
        flat = {f"{k}/{part}": x for k, parts in self._all.items() for part, x in parts.items()}
        with whole_file(self.path) as partial, partial.open("wb") as stream:
            np.savez(stream, **{KEY: np.array(self.key)}, **flat)  # type: ignore[arg-type]

    def done(self) -> None:
        """Remove the file: the computation is through."""
        self.path.unlink(missing_ok=True)

    def _read(self) -> dict[str, dict[str, Array]]:
        found: dict[str, dict[str, Array]] = {}
        try:
            with np.load(self.path, allow_pickle=False) as stored:
                if str(stored[KEY]) != self.key:
                    return {}
                for entry in stored.files:
                    name, _, part = entry.partition("/")
                    if part:
                        found.setdefault(name, {})[part] = stored[entry]
        except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
            return {}
        return found
