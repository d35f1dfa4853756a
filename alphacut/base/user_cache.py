"""The folder in which processes and checkouts of one user share what is expensive to make anew."""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from hashlib import sha256
from pathlib import Path
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from alphacut.base.errors import FailedError
from alphacut.base.kept_files import whole_file

Arrays = Sequence[NDArray[np.generic]]
UNUSED_DAYS = 14
"""Days after which what no process has asked for is removed."""


def user_folder(name: str) -> Path | None:
    """Return a folder of this user's cache by its name, made if need be.

    None where it cannot be written, or where another user could write it, whose files this one
    would then trust.
    """
    try:
        home = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
        folder = Path(os.environ.get("ALPHACUT_CACHE") or Path(home, "alphacut"), name)
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        status = folder.stat()
    except (OSError, RuntimeError):
        return None
    return None if status.st_mode & 0o022 or status.st_uid != os.getuid() else folder


def remove_unused(folder: Path) -> None:
    """Remove files and folders in `folder` that were not used for `UNUSED_DAYS`."""
    for unused in folder.iterdir():
        if unused.stat().st_mtime < time.time() - UNUSED_DAYS * 86400:
            shutil.rmtree(unused) if unused.is_dir() else unused.unlink()


def cached_arrays(name: str, content: bytes, make: Callable[[], Arrays]) -> Arrays:
    """Return the arrays of `make`, from folder `name` of the cache where it has them.

    Args:
        name: Folder in the cache.
        content: All that the arrays depend on.
        make: Makes them. A file that is damaged or of another content is made anew.
    """
    folder, digest = user_folder(name), sha256(content)
    if folder is None:
        return make()
    file, key = folder / f"{digest.hexdigest()}.npz", np.frombuffer(digest.digest(), np.uint8)
    with suppress(OSError, ValueError, TypeError, EOFError, BadZipFile):
        with np.load(file) as stored:  # which loads no objects
            stored_key, *arrays = (stored[name] for name in stored.files)
        if np.array_equal(stored_key, key):
            os.utime(file)  # for `remove_unused`
            return arrays
    new_arrays = make()
    with suppress(OSError, FailedError):  # a full disk, or a folder that was cleared: none is kept
        with whole_file(file) as partial:
            np.savez(partial, key, *new_arrays)
        remove_unused(folder)
    return new_arrays
