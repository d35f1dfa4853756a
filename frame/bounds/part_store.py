"""Bounds of parts in a folder, from which a proof that was killed goes on.

A file is named by all that the bounds follow from: the proof and its options, exact motions of the
structure at some inputs, the part, what is asked for and what is known.
"""

from __future__ import annotations

import hashlib
import os
import tempfile
import zipfile
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from alphacut.frame.bounds.box_proof import Goal, PartBounds
from alphacut.frame.boxes import Boxes
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.result import Ends

Found = Sequence[PartBounds | UnprovedError]


@dataclass(frozen=True)
class PartStore:
    """Bounds of parts by what they follow from.

    Args:
        folder: Where the files are; made if it does not exist.
        problem: Fingerprint of the proof and the structure.
    """

    folder: Path
    problem: bytes

    def path(self, boxes: Boxes, goal: Goal) -> Path:
        """Return the file of the bounds of a part; its name is a hash of the part and the goal."""
        digest = hashlib.sha256(self.problem)
        goal_arrays = goal.needed, goal.outer, goal.incumbent, np.array(goal.last)
        for array in (boxes.alpha, boxes.lower, boxes.upper, *goal_arrays):
            digest.update(np.ascontiguousarray(array).tobytes())
        return self.folder / f"part-{digest.hexdigest()[:32]}.npz"

    def read(self, path: Path) -> Found | None:
        """Return the stored bounds on each level, or None if there is no readable file."""
        if path.is_symlink() or not path.is_file():
            return None
        try:
            with np.load(path, allow_pickle=False) as arrays:
                return [_level_bounds(arrays, k) for k in range(int(arrays["levels"]))]
        except (OSError, EOFError, KeyError, ValueError, zipfile.BadZipFile):
            return None

    def write(self, path: Path, found: Found) -> None:
        """Write bounds to a file, completely or not at all; without room nothing is written."""
        arrays: dict[str, Array] = {"levels": np.array(len(found))}
        for k, bounds in enumerate(found):
            arrays |= {f"{k}.{name}": array for name, array in _arrays_of(bounds).items()}
        with suppress(OSError):
            self.folder.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryDirectory(dir=self.folder) as folder:
                partial = Path(folder) / path.name
                np.savez(partial, **arrays)  # type: ignore[arg-type]
                os.replace(partial, path)


def _arrays_of(bounds: PartBounds | UnprovedError) -> dict[str, Array]:
    """Return bounds, or the text and input of a refusal, as arrays by name for `np.savez`."""
    if isinstance(bounds, UnprovedError):
        along = -1 if bounds.along is None else bounds.along
        return {"refusal": np.array([bounds.what, bounds.cure]), "along": np.array(along)}
    arrays = {field.name: getattr(bounds, field.name) for field in fields(bounds)}
    facts = arrays.pop("facts")
    arrays |= {"fact_names": np.array([*facts], str), "facts": np.array([*facts.values()], float)}
    return {name: np.asarray(array) for name, array in arrays.items() if array is not None}


def _level_bounds(arrays: np.lib.npyio.NpzFile, k: int) -> PartBounds | UnprovedError:
    """Return the bounds or the refusal of level k from the arrays of a file, named "k.field"."""
    fields: dict[str, Any] = {
        name.partition(".")[2]: arrays[name] for name in arrays if name.startswith(f"{k}.")
    }
    if "refusal" in fields:
        along, (what, cure) = int(fields["along"]), map(str, fields["refusal"])
        return UnprovedError(what, cure, None if along < 0 else along)
    names = fields.pop("fact_names").tolist()
    facts = dict(zip(names, fields.pop("facts").tolist(), strict=True))
    if "least_peaks" in fields:
        fields["least_peaks"] = Ends(*fields["least_peaks"])
    return PartBounds(**fields, facts=facts)
