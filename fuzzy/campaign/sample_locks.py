"""Claims: which campaign runs a sample now, so that two on one store share the work.

A claim is a record lock on one byte of a file beside the store, at an offset that the sample's key
hashes to. The system drops it when its process ends, however it ends; nothing has to be cleaned up
and nothing times out. A claim on a stored sample is pointless, so the
order is: claim, then look it up, then run; and save, then release. On a network file system a write
of one machine is not at once seen by others, so that such a folder is told apart.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass, field
from hashlib import sha256
from pathlib import Path
from threading import Lock

# no record locks on this system: two campaigns on one store may run the same sample
try:
    import fcntl
except ImportError:
    fcntl = None  # type: ignore[assignment]


@dataclass
class _File:
    """Open file of one store; one per process, since closing a handle drops all locks."""

    handle: int
    users: int = 0
    held: set[int] = field(default_factory=set)


_ALONE = 1 << 62  # offset beyond those of samples

_FILES: dict[Path, _File] = {}
_GUARD = Lock()


class Claims:
    """The claims of one campaign on samples of a store.

    Args:
        store: Path of the store; the locks are on the empty file of that name with `.claims` added.
        scope: What tells the samples of this model from those of others that have the same keys.
    """

    def __init__(self, store: Path, scope: str) -> None:
        self._scope = sha256(scope.encode())
        self._path = store.with_name(store.name + ".claims").resolve()
        self._held: dict[str, int] = {}
        with _GUARD:
            if self._path not in _FILES:
                _FILES[self._path] = _File(os.open(self._path, os.O_CREAT | os.O_RDWR, 0o666))
            self._file = _FILES[self._path]
            self._file.users += 1

    def alone(self) -> bool:
        """Hold the file for this process as long as it is open, unless another process does."""
        try:
            if fcntl is not None:
                fcntl.lockf(self._file.handle, fcntl.LOCK_EX | fcntl.LOCK_NB, 1, _ALONE)
        except OSError:
            return False
        return True

    def take(self, keys: Iterable[str]) -> set[str]:
        """Claim what nobody else has claimed; the keys that are this campaign's now."""
        with _GUARD:
            return {key for key in keys if key in self._held or self._lock(key)}

    def release(self, keys: Iterable[str]) -> None:
        """Give claims up."""
        with _GUARD:
            for key in keys:
                offset = self._held.pop(key, None)
                if offset is not None:
                    self._file.held.discard(offset)
                    if fcntl is not None:
                        fcntl.lockf(self._file.handle, fcntl.LOCK_UN, 1, offset)

    def close(self) -> None:
        """Give all claims up."""
        self.release(list(self._held))
        with _GUARD:
            self._file.users -= 1
            if not self._file.users:
                os.close(self._file.handle)
                del _FILES[self._path]

    def _lock(self, key: str) -> bool:
        content = self._scope.copy()
        content.update(key.encode())
        offset = int.from_bytes(content.digest()[:8], "big") >> 2
        if offset in self._file.held:  # another campaign of this process
            return False
        try:
            if fcntl is not None:
                fcntl.lockf(self._file.handle, fcntl.LOCK_EX | fcntl.LOCK_NB, 1, offset)
        except OSError:
            return False
        self._held[key] = offset
        self._file.held.add(offset)
        return True


_MOUNTS = Path("/proc/self/mountinfo")
_NETWORK = (
    *("9p", "acfs", "afs", "beegfs", "ceph", "cifs", "cvmfs", "fuse", "gfs2", "glusterfs", "gpfs"),
    *("lustre", "ncpfs", "nfs", "ocfs2", "orangefs", "panfs", "pvfs2", "smb2", "smb3", "wekafs"),
)


def network_kind(path: Path) -> str:
    """Type of the network file system that holds a path; empty if it is of this machine.

    Systems in user space count, since most of them hold files of other machines.
    """
    try:
        mounts = [line.split(" - ") for line in _MOUNTS.read_text("utf-8").splitlines()]
    except OSError:  # not Linux: nothing is known
        return ""
    kinds = {Path(left.split()[4]): right.split()[0] for left, right in mounts}
    place = path.resolve()
    kind = next((kinds[folder] for folder in (place, *place.parents) if folder in kinds), "")
    return kind if kind.rstrip("4").split(".")[0] in _NETWORK else ""
