"""The cache folder of a user, which all processes and checkouts share."""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from hashlib import sha256
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from alphacut.base.errors import FailedError
from alphacut.base.kept_files import whole_file

Arrays = Sequence[NDArray[np.generic]]


def user_folder(name: str) -> Path | None:
    """Return a folder of this user's cache, which is made if need be; None if there can be none.

    The cache is the folder in the environment variable ALPHACUT_CACHE, else "alphacut" in the one
    in XDG_CACHE_HOME, else ~/.cache/alphacut. None is returned if the folder cannot be made, and
    also if it belongs to another user or others can write it: this user would trust files that
    others made.

    Args:
        name: Name of the folder in the cache.
    """
    try:
        home = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
        folder = Path(os.environ.get("ALPHACUT_CACHE") or Path(home, "alphacut"), name)
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        status = folder.stat()
    except (OSError, RuntimeError):  # the latter where the user has no home
        return None
    is_writable_by_others = bool(status.st_mode & 0o022)  # by the group or by all
    if is_writable_by_others or status.st_uid != os.getuid():
        return None
    return folder


def remove_unused(folder: Path) -> None:
    """Remove files and folders in `folder` that were not used for 14 days.

    The time of the last change counts: whoever uses a file or folder sets it.

    Raises:
        OSError: The folder cannot be read, or an old file cannot be removed, such as one that
            another process has just removed.
    """
    unused_days = 14  # work on a case seldom rests longer, and what is missing is made again
    for path in folder.iterdir():
        if path.stat().st_mtime >= time.time() - unused_days * 86400:
            continue
        if path.is_dir():
            shutil.rmtree(path)
        else:
            path.unlink()


def cached_arrays(name: str, content: bytes, make: Callable[[], Arrays]) -> Arrays:
    """Return arrays from the user's cache, or make them and keep them there.

    A file that is damaged, or that was made from something else, is made anew. If the cache cannot
    be read or written, the arrays are made, and no error is raised. Files in the folder that were
    not used for two weeks are removed when one is added.

    Args:
        name: Name of the folder in the cache.
        content: All that the arrays depend on; a digest of it is the name of the file.
        make: Function that makes the arrays, of numbers; its exceptions are raised.

    Returns:
        The arrays in the order in which `make` returns them.
    """
    folder = user_folder(name)
    if folder is None:
        return make()
    # The digest is the name of the file and also, as `key`, its first array.
    digest = sha256(content)
    file = folder / f"{digest.hexdigest()}.npz"
    key = np.frombuffer(digest.digest(), np.uint8)
    # One wrong bit of a ZIP file makes its reader raise errors of many kinds: NotImplementedError
    # for an unknown compression, RuntimeError for an encrypted entry, zlib.error, and others.
    with suppress(Exception):
        with np.load(file) as stored:  # pickled objects are not loaded
            stored_key, *arrays = (stored[name] for name in stored.files)
        if np.array_equal(stored_key, key):
            os.utime(file)  # so that `remove_unused` keeps it
            return arrays
    new_arrays = make()
    # On a full disk, or where the folder was cleared meanwhile, the arrays are not kept.
    with suppress(OSError, FailedError):
        with whole_file(file) as partial:
            np.savez(partial, key, *new_arrays)
        remove_unused(folder)
    return new_arrays
