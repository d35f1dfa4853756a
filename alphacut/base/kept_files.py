"""Files that are kept, of samples and of results: written whole, named by digests, by one writer.

Nothing is read or replaced through a link, and no device, pipe or folder is taken for a file.
"""

from __future__ import annotations

import hashlib
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from alphacut.base.errors import FailedError, RefusedError


def digest_of(content: bytes) -> str:
    """Return the SHA-256 of a content in hexadecimal digits."""
    return hashlib.sha256(content).hexdigest()


def file_digest(path: Path) -> str:
    """Return the SHA-256 of a file, which may be larger than the memory."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def is_regular(path: Path) -> bool:
    """Return whether a path names a regular file itself, and no link to one.

    Raises:
        OSError: There is nothing of this name.
    """
    return stat.S_ISREG(os.lstat(path).st_mode)


def is_special(path: Path) -> bool:
    """Return whether a path leads to a device, a pipe or a socket, which nothing may replace."""
    return path.exists() and not (path.is_file() or path.is_dir())


def read_regular(path: Path, size: int = -1) -> bytes:
    """Return the content of a regular file, or at most its first `size` bytes if that is not −1.

    Raises:
        OSError: There is no such file, or it is a link, a device, a pipe or a folder.
    """
    # A pipe without a writer would block the opening, so the path is looked at before; what was
    # opened is looked at again, because the path may name something else by then.
    if is_regular(path):
        flags = os.O_RDONLY
        for flag in ("O_NOFOLLOW", "O_NONBLOCK", "O_BINARY"):
            flags |= getattr(os, flag, 0)
        with open(os.open(path, flags), "rb") as stream:
            if stat.S_ISREG(os.fstat(stream.fileno()).st_mode):
                return stream.read(size)
    raise OSError("no regular file")


@contextmanager
def whole_file(path: Path | str, *, follow_links: bool = True) -> Iterator[Path]:
    """Yield a temporary path; what the block writes there becomes the file `path` in one step.

    The temporary file stands beside `path`, with the same suffix, and is empty at first. Folders on
    the way are made. If the block raises an exception, the temporary file is removed and `path`
    stays as it was.

    If `path` leads to a device or a pipe and `follow_links` is true, nothing is replaced: the block
    must create the temporary file itself, and its content is then written into the device.

    Args:
        path: The file, which need not exist.
        follow_links: Whether a link stays and its target is replaced; otherwise whatever has the
            name is replaced itself, also a link to a device.

    Raises:
        FailedError: An OSError or RuntimeError occurred in the block or here, and less than 1 MiB
            of the disk is free.
        OSError: The place cannot be written for another reason.
    """
    # Commands that write no file spare these modules, which take time to import.
    import secrets
    import shutil
    import tempfile

    path = Path(path)
    if is_special(path) and follow_links:
        with tempfile.TemporaryDirectory() as folder:
            partial = Path(folder) / path.name
            yield partial
            path.write_bytes(partial.read_bytes())
        return
    path = Path(os.path.realpath(path)) if follow_links else path
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(f".{path.stem}.{secrets.token_hex(4)}.part{path.suffix}")
    try:
        os.close(os.open(partial, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))  # through no link
        yield partial
        os.replace(partial, path)
    # Libraries report a full disk in their own words, HDF5 by a RuntimeError without a reason. So
    # the free space is looked at; a full disk may have some small blocks left.
    except (OSError, RuntimeError):
        if shutil.disk_usage(path.parent).free < 1 << 20:
            cure = "free some space"
            if path.is_relative_to(tempfile.gettempdir()):
                cure += ", or set TMPDIR to another folder"
            raise FailedError(f"the disk of {path.parent} is full", cure) from None
        raise
    finally:
        partial.unlink(missing_ok=True)


def write_text(path: Path | str, text: str, *, follow_links: bool = True) -> None:
    """Write a text file in UTF-8, whole or not at all; arguments and errors are `whole_file`'s."""
    with whole_file(path, follow_links=follow_links) as partial:
        partial.write_text(text, encoding="utf-8")


@contextmanager
def locked(option: str, folder: Path) -> Iterator[None]:
    """Make a folder, and lock it during the block against other runs of this program.

    On Windows, and on file systems without locks, the block runs without one. The lock ends with
    the block or the process, and leaves no file behind.

    Args:
        option: Option that names the folder, for the message.
        folder: The folder, which need not exist.

    Raises:
        RefusedError: Another run holds the lock; the block does not begin.
        OSError: The folder cannot be made or opened.
    """
    folder.mkdir(parents=True, exist_ok=True)
    try:
        import fcntl
    except ImportError:  # Windows
        yield
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        with suppress(OSError):
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                cure = "another run is writing into it"
                raise RefusedError(option, str(folder), "a folder of its own", cure) from None
        yield
    finally:
        os.close(handle)
