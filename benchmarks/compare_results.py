"""Comparison of two folders of results, number by number: which differ, to the last bit.

    ./enter python -m benchmarks.compare_results BEFORE AFTER

Each folder holds the results of cases, as `alphacut run` writes them. `summary.json` is compared
value by value, NetCDF files variable by variable. Seconds, versions, commands, paths and
fingerprints are left out. Exit status 1 where anything differs.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

LEFT_OUT = {
    "seconds",
    "versions",
    "command",
    "fingerprint",
    "created_by",
    "date",
    "folder",
    "files",
}


def leaves(value: Any, name: str = "") -> Iterator[tuple[str, Any]]:
    """Every value of a JSON document with its place."""
    if isinstance(value, dict):
        for key, inner in value.items():
            if key not in LEFT_OUT and "seconds" not in key:
                yield from leaves(inner, f"{name}.{key}")
    elif isinstance(value, list):
        for k, inner in enumerate(value):
            yield from leaves(inner, f"{name}[{k}]")
    else:
        yield name, value


def summary_values(path: Path) -> dict[str, Any]:
    """Values of a summary by their places."""
    return dict(leaves(json.loads(path.read_text(encoding="utf-8"))))


def variables(path: Path) -> dict[str, bytes]:
    """Bytes of every variable of a NetCDF file, with type and shape."""
    import netCDF4
    import numpy as np

    found: dict[str, bytes] = {}
    with netCDF4.Dataset(path) as file:
        for name, variable in file.variables.items():
            if "seconds" not in name:
                values = np.ma.getdata(variable[...])
                content = (
                    values.tobytes() if values.dtype != object else str(values.tolist()).encode()
                )
                found[name] = f"{values.dtype} {values.shape} ".encode() + content
    return found


def differences(before: Path, after: Path) -> Iterator[str]:
    """Places at which two results differ."""
    names = {
        path.relative_to(root).as_posix()
        for root in (before, after)
        for path in [*root.rglob("*.nc"), *root.rglob("summary.json")]
    }
    for name in sorted(names):
        if not ((before / name).is_file() and (after / name).is_file()):
            yield f"{name}: only in one of the two"
            continue
        read = variables if name.endswith(".nc") else summary_values
        old, new = read(before / name), read(after / name)
        for key in sorted({*old, *new}):
            if key not in old or key not in new or old[key] != new[key]:
                yield f"{name}: {key}"


def main(arguments: list[str] | None = None) -> int:
    """Compare two folders and print what differs."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("before", type=Path)
    parser.add_argument("after", type=Path)
    options = parser.parse_args(arguments)
    found = list(differences(options.before, options.after))
    files = sum(1 for _ in options.after.rglob("*.nc"))
    print("\n".join([*found, f"{len(found)} differences, {files} NetCDF files"]))
    return int(bool(found) or not files)


if __name__ == "__main__":
    sys.exit(main())
