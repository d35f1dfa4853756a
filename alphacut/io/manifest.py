"""Manifest of a folder of results: every file by stage, with its SHA-256.

A file is compared with its digest before a library opens it, and none is read or written through a
link. New digests are listed before the files take their places, so that a run that is killed leaves
no file of unknown origin: at worst one that does not match and is computed anew. The store of
samples, whose rows have checksums, is listed without a digest.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import stat
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from typing import Self

from alphacut.fuzzy.refused import RefusedError, require
from alphacut.io.files import Document, as_json, whole_file
from alphacut.io.provenance import FORMAT, door

MANIFEST = "manifest.json"
PLAIN = re.compile(r"(?!.*\.\.)[\w+-][\w.+-]{0,100}")
"""Names of files and folders in a folder of results, which lead to no other folder."""
READ_ONLY = os.O_RDONLY | sum(
    getattr(os, flag, 0) for flag in ("O_NOFOLLOW", "O_NONBLOCK", "O_BINARY")
)
RUN = door("run", "CASE.toml")
COMPLETE = "whole results of a run"
"""Allowed state of a folder of results."""
RUN_AGAIN = f"make it anew by {RUN}"
"""Cure of files that were changed."""


@dataclass(frozen=True)
class StageFiles:
    """Files of a stage.

    Args:
        fingerprint: Digest of everything that the files depend on.
        files: SHA-256 of each file by its name, with "/" below a folder; "" for a store.
    """

    fingerprint: str
    files: Mapping[str, str]


@dataclass
class ResultsFolder:
    """A folder of results with its manifest.

    Args:
        path: The folder; it may be a link itself.
        stage_files: Files of each stage, by the stage's name.
        is_damaged: Whether there was a manifest that could not be read, so that a run replaces its
            files although none lists them.
    """

    path: Path
    stage_files: dict[str, StageFiles] = field(default_factory=dict)
    is_damaged: bool = False

    @classmethod
    def read(cls, path: Path) -> Self:
        """The folder with what its manifest lists; nothing where that is missing or damaged.

        Raises:
            RefusedError: The manifest is of another format or program, or no regular file.
        """
        file = path / MANIFEST
        if not os.path.lexists(file):
            return cls(path)
        try:
            document = json.loads(read_regular(file))
        except OSError as error:
            raise RefusedError(str(file), str(error), "a regular file of this program") from None
        except (ValueError, RecursionError):
            return cls(path, is_damaged=True)
        try:
            require_known(document, file)
            parts = {name: StageFiles(*part) for name, part in document["stages"].items()}
            intact = document["checksum"] == _checksum(parts) and all(map(is_plain, _names(parts)))
        except (LookupError, TypeError, AttributeError):
            return cls(path, is_damaged=True)
        return cls(path, parts) if intact else cls(path, is_damaged=True)

    def problem(self, stage: str) -> str:
        """What is wrong with the files of a stage, such as "modulus.nc was changed"; else ""."""
        if stage not in self.stage_files:
            return "the manifest is damaged" if self.is_damaged else "no files"
        for name, digest in self.stage_files[stage].files.items():
            try:
                self._read_checked(name, digest)
            except RefusedError as error:
                return f"{name} {error.value}"
        return ""

    def content(self, name: str) -> bytes:
        """The content of a listed file, which is what was written.

        Raises:
            RefusedError: The file is not listed, missing, changed, or a link.
        """
        for stage in self.stage_files.values():
            if name in stage.files:
                return self._read_checked(name, stage.files[name])
        what = f"without {name} in its manifest"
        raise RefusedError(str(self.path), what, COMPLETE, RUN_AGAIN)

    def _read_checked(self, name: str, digest: str) -> bytes:
        """The content of a file, whose SHA-256 must be `digest`; any if that is empty."""
        file = self.path / name
        try:
            self._require_real_parents(name)
            content = read_regular(file)
        except OSError as error:
            state = "is missing" if isinstance(error, FileNotFoundError) else "is no regular file"
            raise RefusedError(str(file), state, COMPLETE, RUN_AGAIN) from None
        is_same = not digest or digest_of(content) == digest
        require(is_same, str(file), value="was changed", allowed=COMPLETE, cure=RUN_AGAIN)
        return content

    def _require_real_parents(self, name: str) -> None:
        """Requires that no folder between the folder of results and a file is a link.

        Raises:
            NotADirectoryError: One is.
        """
        for parent in PurePosixPath(name).parents[:-1]:
            if not stat.S_ISDIR(os.lstat(self.path / parent).st_mode):
                raise NotADirectoryError(f"{parent} is no folder")

    def require_free(self, name: str) -> None:
        """Refuses a name that an unlisted file, a pipe or a folder has, so that none is lost.

        A link with a listed name is free: the file will replace it, not its target.
        """
        file, allowed = self.path / name, "a place for a file of this run"
        cure = "move it away, or name another folder"
        try:
            self._require_real_parents(name)
            mode = os.lstat(file).st_mode
        except FileNotFoundError:
            return
        except NotADirectoryError as error:
            raise RefusedError(str(file), str(error), allowed, cure) from None
        is_listed = self.is_damaged or any(name in part.files for part in self.stage_files.values())
        is_regular = stat.S_ISREG(mode)
        kind = "a file that no manifest lists" if is_regular else "no regular file"
        is_free = is_listed and (is_regular or stat.S_ISLNK(mode))
        require(is_free, str(file), value=kind, allowed=allowed, cure=cure)

    def put(self, stage: str, fingerprint: str, source: Path) -> None:
        """Copies all files below a folder here as those of a stage, and lists them.

        Files that the stage listed before and has no more are removed.

        Raises:
            RefusedError: Something else is in the place of one.
        """
        files = (file for file in sorted(source.rglob("*")) if file.is_file())
        contents = {file.relative_to(source).as_posix(): file.read_bytes() for file in files}
        for name in contents:
            self.require_free(name)
        before = self.stage_files[stage].files if stage in self.stage_files else {}
        digests = {name: digest_of(content) for name, content in contents.items()}
        self.list_files(stage, fingerprint, digests)
        for name, content in contents.items():
            with whole_file(self.path / name, follow_links=False) as partial:
                partial.write_bytes(content)
        for name in before.keys() - contents.keys():
            self._remove(name, before[name])

    def list_files(self, stage: str, fingerprint: str, digests: Mapping[str, str]) -> None:
        """Writes the manifest with the files of a stage by their digests."""
        self.stage_files[stage] = StageFiles(fingerprint, dict(digests))
        self._write()

    def clear(self) -> None:
        """Removes every file that is listed, and the list; links are removed, not followed."""
        for name in _names(self.stage_files):
            self._remove(name)
        self.stage_files, self.is_damaged = {}, False
        self._write()

    def _remove(self, name: str, digest: str = "") -> None:
        """Removes a link, or a regular file with this digest ("": any); leaves everything else."""
        file = self.path / name
        try:
            self._require_real_parents(name)
            is_link = stat.S_ISLNK(os.lstat(file).st_mode)
            if is_link or digest in ("", digest_of(read_regular(file))):
                file.unlink()
        except OSError:
            return

    def _write(self) -> None:
        """Writes manifest.json, with a checksum of its own list."""
        stages = {name: [part.fingerprint, part.files] for name, part in self.stage_files.items()}
        document: Document = {
            "format_version": FORMAT,
            "about": "SHA-256 of every file of results by stage; --fresh removes these files",
            "checksum": _checksum(self.stage_files),
            "stages": stages,
        }
        with whole_file(self.path / MANIFEST, follow_links=False) as partial:
            partial.write_text(as_json(document, indent=1), encoding="utf-8")


def read_regular(file: Path) -> bytes:
    """The content of a regular file.

    Raises:
        OSError: It is missing, a link, a device, a pipe or a folder, or cannot be read.
    """
    require_regular(os.lstat(file))
    with open(os.open(file, READ_ONLY), "rb") as stream:
        require_regular(os.fstat(stream.fileno()))
        return stream.read()


def require_regular(state: os.stat_result) -> None:
    """Requires the state of a regular file.

    Raises:
        OSError: It is that of something else.
    """
    if not stat.S_ISREG(state.st_mode):
        raise OSError("no regular file")


def digest_of(content: bytes) -> str:
    """SHA-256 of a content in hexadecimal digits."""
    return hashlib.sha256(content).hexdigest()


def is_plain(name: str) -> bool:
    """True for the name of a file in a folder of results, or in its folder of figures."""
    return PLAIN.fullmatch(name.removeprefix("figures/")) is not None


def require_known(facts: Mapping[str, object], path: Path) -> None:
    """Refuses a JSON file of this program, with content `facts`, whose format is not `FORMAT`."""
    version = facts.get("format_version")
    value, allowed = f"of format {version}", f"files of format {FORMAT}"
    cure = "name another folder" if version is None else f"make it anew by {RUN}"
    require(version == FORMAT, str(path), value=value, allowed=allowed, cure=cure)


def _names(parts: Mapping[str, StageFiles]) -> Iterator[str]:
    """Names of all files."""
    return (name for part in parts.values() for name in part.files)


def _checksum(parts: Mapping[str, StageFiles]) -> str:
    """Checksum of a manifest's list."""
    listed = {stage: [part.fingerprint, dict(part.files)] for stage, part in parts.items()}
    return digest_of(json.dumps(listed, sort_keys=True).encode())
