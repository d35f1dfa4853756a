"""Detection of network file systems, where a write of one machine is not at once seen by others."""

from __future__ import annotations

from pathlib import Path

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
