"""A folder of results, each known by its digest: nothing else is believed, followed or removed.

The list, manifest.json, has for every file its SHA-256 and the digest of what it was made from. A
file is compared with the former before a library opens it, and none is read or written through a
link. The list is written before the files take their places: a run that is killed leaves no file
of unknown origin, at worst one that does not match and is computed anew.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple, Self

import numpy as np

from alphacut.base.errors import RefusedError, printable, require
from alphacut.base.kept_files import digest_of, is_regular, read_regular, whole_file
from alphacut.io.files import as_json
from alphacut.io.provenance import FORMAT, command_to_paste
from alphacut.io.typed_json import from_document

if TYPE_CHECKING:
    import xarray

MANIFEST = "manifest.json"
COMPLETE = "whole results of a run"
"""Allowed state of a folder of results."""
EMPTY = "variables_without_entries"
"""Attribute of a dataset in a file for variables that the format has no place for."""
TEXTS = "lists_of_texts"
"""Attribute for the attributes that are lists of texts."""
RUN_AGAIN = f"make it anew by {command_to_paste('run', 'CASE.toml')}"
"""Cure of files that were changed."""


def plain_name(name: str) -> str:
    """Return a name if it is a plain one, which cannot lead out of a folder of results.

    A plain name has 1 to 101 letters, digits and ".", "_", "+" and "-", no dot at its beginning and
    no ".." inside, such as "envelope.nc". It may have "figures/" in front. The list of a folder may
    have been tampered with, so its names are checked here.

    Raises:
        ValueError: The name is another one, such as "../a", "/a" or "a/b".
    """
    if re.fullmatch(r"(figures/)?(?!.*\.\.)[\w+-][\w.+-]{0,100}", name) is None:
        raise ValueError("no plain name")
    return name


PlainName = Annotated[str, plain_name]
"""Type of such names in documents that `from_document` reads."""


class Listed(NamedTuple):
    """What the list knows of a file.

    Args:
        digest: SHA-256 of its content; empty for a store of samples, whose rows have checksums.
        source: Digest of everything that it was made from; empty for a text of the run itself.
    """

    digest: str
    source: str


def write_arrays(data: xarray.Dataset, path: Path) -> None:
    """Write a dataset in the classic format of NetCDF, which `ResultsFolder.dataset` reads.

    The format has no axes of length 0, such as that of the loads of a structure without loads:
    variables without entries become an attribute with the length of each of their axes. It has no
    attributes of several texts either, which become one text.

    Args:
        data: The dataset, of numbers and texts. Integers must fit into 32 bits.
        path: The file, which is written anew.

    Raises:
        ValueError: An integer does not fit.
        OSError: The file cannot be written.
    """
    empty = {name: dict(x.sizes) for name, x in data.variables.items() if x.size == 0}
    if empty:
        data = data.drop_vars(empty).assign_attrs({EMPTY: json.dumps(empty)})
    texts: dict[str, Any] = {}
    others: dict[str, Any] = {}
    for name, value in data.attrs.items():
        is_list = not isinstance(value, str) and np.asarray(value).dtype.kind == "U"
        (texts if is_list else others)[name] = value
    if texts:
        data = data.copy()
        data.attrs = others | {TEXTS: json.dumps({name: list(x) for name, x in texts.items()})}
    data.to_netcdf(path, engine="scipy", format="NETCDF3_64BIT")


@dataclass
class ResultsFolder:
    """A folder of results and its list of files.

    Args:
        path: The folder, which may be a link itself.
        files: What is known of each listed file, by its name; it changes with the list.
        is_damaged: Whether the list cannot be understood. Then a run may replace files that no list
            names.
    """

    path: Path
    files: dict[str, Listed] = field(default_factory=dict)
    is_damaged: bool = False

    @classmethod
    def read(cls, path: Path) -> Self:
        """Return a folder of results with its list of files, which is read from manifest.json.

        Without the list, or without the folder, nothing is listed. If the list is no JSON object of
        the right form, or its checksum is wrong, nothing is listed either and `is_damaged` is set.

        Args:
            path: The folder.

        Returns:
            The folder, whose `files` have, by name, the SHA-256 of the content of a file and the
            digest of what it was made from.

        Raises:
            RefusedError: The list is of another format or program, or is no regular file.
        """
        file = path / MANIFEST
        if not os.path.lexists(file):
            return cls(path)
        try:
            document = json.loads(read_regular(file))
        except OSError as error:
            raise RefusedError(str(file), str(error), "a regular file of this program") from None
        # Python's parser raises a RecursionError for thousands of nested brackets.
        except (ValueError, RecursionError):
            document = None
        if not isinstance(document, dict):
            return cls(path, is_damaged=True)
        # The format is looked at before the form, so that results of another version of this
        # program are not taken for damaged ones, which a run may replace.
        version = document.get("format_version")
        value = f"of format {version}"
        allowed = f"files of format {FORMAT}"
        cure = "name another folder" if version is None else f"{RUN_AGAIN} in another folder"
        require(version == FORMAT, str(file), value, allowed, cure=cure)
        files = document.get("files")
        try:
            pairs = from_document(dict[PlainName, tuple[str, str]], files)
        except ValueError:
            return cls(path, is_damaged=True)
        if document.get("checksum") != digest_of(json.dumps(files).encode()):
            return cls(path, is_damaged=True)
        return cls(path, {name: Listed(*pair) for name, pair in pairs.items()})

    def require_own_files(self, option: str) -> None:
        """Raise RefusedError for a folder of other files, in which no run has written its list.

        A folder is this program's if it has the list manifest.json, damaged or not; an empty one,
        a missing one, and one with hidden files alone are allowed, too.

        Args:
            option: Option that names the folder, for the message.
        """
        is_own = os.path.lexists(self.path / MANIFEST) or not any(self.path.glob("[!.]*"))
        allowed = "an empty folder, or one of results"
        require(is_own, option, f"{self.path}, with other files", allowed, "name another folder")

    def made_from(self, source: str) -> tuple[str, ...]:
        """Return the names of the files that were made from what has this digest."""
        return tuple(name for name, entry in self.files.items() if entry.source == source)

    def content(self, name: str) -> bytes:
        """Return the content of a listed file, which is compared with its digest in the list.

        A store of samples changes, so its digest in the list is empty and nothing is compared.

        Args:
            name: Name of the file in this folder, such as "envelope.nc" or "figures/peaks.svg".

        Raises:
            RefusedError: The file is not listed, missing, changed, or a link, a device or a pipe;
                or a folder that leads to it is a link.
        """
        # The whole file is read before it is compared, so that what was compared is what is used:
        # a library that opened it by its name might read something else.
        what = f"without {name} in its manifest"
        require(name in self.files, str(self.path), what, COMPLETE, RUN_AGAIN)
        file = self.path / name
        digest = self.files[name].digest
        try:
            self._require_real_parents(name)
            content = read_regular(file)
        except OSError as error:
            state = None if isinstance(error, FileNotFoundError) else "no regular file"
            raise RefusedError(str(file), state, COMPLETE, RUN_AGAIN) from None
        require(digest in ("", digest_of(content)), str(file), "changed", COMPLETE, cure=RUN_AGAIN)
        return content

    def dataset(self, name: str) -> xarray.Dataset:
        """Return the dataset in a listed NetCDF file, whose values are all in memory.

        Args:
            name: Name of the file in this folder, such as "envelope.nc".

        Raises:
            RefusedError: The file is not listed, missing, changed or a link; or it is no file in
                the classic format of NetCDF.
        """
        content = self.content(name)
        # A folder may come from elsewhere, with a list of its own. HDF5, the format of NetCDF-4,
        # can take values from other files by external storage and links: a page that shows them
        # would show any file of the user. The classic format has values of its own alone.
        is_classic = content[:4] in (b"CDF\x01", b"CDF\x02")
        value = "no file in the classic format of NetCDF"
        require(is_classic, str(self.path / name), value, COMPLETE, RUN_AGAIN)
        import xarray

        try:
            data = xarray.load_dataset(BytesIO(content), engine="scipy")
            sizes_of = json.loads(data.attrs.pop(EMPTY, "{}"))
            for variable, sizes in sizes_of.items():
                data[variable] = (tuple(sizes), np.empty(tuple(sizes.values())))
            return data.assign_attrs(json.loads(data.attrs.pop(TEXTS, "{}")))
        except Exception as error:  # whatever the reader raises for a damaged file
            value = f"damaged ({printable(error, 80)})"
            raise RefusedError(str(self.path / name), value, COMPLETE, RUN_AGAIN) from None

    def require_free(self, name: str) -> None:
        """Raise RefusedError if a new file of a name would replace what this program has not made.

        A name is free if nothing has it, or a regular file or a link that is listed. If the list is
        damaged (`is_damaged`), any regular file or link may be replaced. A link is then replaced
        itself, not its target.

        Args:
            name: Name of the file in this folder, such as "figures/peaks.svg".

        Raises:
            RefusedError: A file that is not listed, a folder, a pipe or a device has the name, or a
                folder that leads to it is a link or no folder.
        """
        file = self.path / name
        allowed = "a place for a file of this run"
        cure = "move it away, or name another folder"
        try:
            self._require_real_parents(name)
            is_file = is_regular(file)
        except FileNotFoundError:
            return
        except NotADirectoryError as error:
            raise RefusedError(str(file), str(error), allowed, cure) from None
        is_listed = self.is_damaged or name in self.files
        is_free = is_listed and (is_file or file.is_symlink())
        kind = "a file that no manifest lists" if is_file else "no regular file"
        require(is_free, str(file), kind, allowed, cure=cure)

    def put_files(self, source: str, folder: Path, before: str = "") -> None:
        """Copy all files below another folder to this one, and list them.

        Args:
            source: Digest of what they were made from, which the list states.
            folder: The folder that is copied, with its folders below.
            before: Digest of what an earlier result was made from. Files of that result leave the
                list, and those that are not replaced here are removed, unless their content has
                changed since. Empty for none.

        Raises:
            RefusedError: What this program has not made is in the place of a file; then nothing is
                changed.
            FailedError: The disk is full.
            OSError: A file cannot be read or written.
        """
        paths = (path for path in sorted(folder.rglob("*")) if path.is_file())
        contents = {path.relative_to(folder).as_posix(): path.read_bytes() for path in paths}
        made_before = {x: self.files[x] for x in self.made_from(before)} if before else {}
        self._write(source, contents, forget=made_before)
        for name in made_before.keys() - contents.keys():
            self._remove(name, made_before[name].digest)

    def put_text(self, name: str, text: str) -> None:
        """Write a text of the run itself, such as summary.json, and list it; errors as `_write`."""
        self._write("", {name: text.encode()})

    def _write(
        self, source: str, contents: Mapping[str, bytes], forget: Iterable[str] = ()
    ) -> None:
        """Add files to the list in manifest.json, and then write them.

        Args:
            source: Digest of what the files were made from; empty for a text of the run itself.
            contents: Content of each file by its name in this folder.
            forget: Names of listed files that leave the list; the files stay.

        Raises:
            RefusedError: What this program has not made is in the place of a file; then nothing is
                changed.
            FailedError: The disk is full.
            OSError: A file cannot be written.
        """
        # The list comes first. A run that is killed in between leaves listed files that are missing
        # or do not match, which are made anew. In the other order it would leave files that no list
        # names, which no later run may replace.
        for name in contents:
            self.require_free(name)
        for name in forget:
            del self.files[name]
        self.add_to_list({name: Listed(digest_of(x), source) for name, x in contents.items()})
        for name, content in contents.items():
            with whole_file(self.path / name, follow_links=False) as partial:
                partial.write_bytes(content)

    def add_to_list(self, files: Mapping[str, Listed]) -> None:
        """Add files to `self.files`, and write the whole list to manifest.json.

        The list has the format of the folder and a checksum of its own. The files need not exist.

        Args:
            files: Digest of the content, and digest of the origin, of each file by its name.

        Raises:
            FailedError: The disk is full.
            OSError: The list cannot be written.
        """
        self.files |= files
        document = {
            "format_version": FORMAT,
            "about": "SHA-256 of every file, and of what it was made from; --fresh removes them",
            "checksum": digest_of(json.dumps(self.files).encode()),
            "files": self.files,
        }
        with whole_file(self.path / MANIFEST, follow_links=False) as partial:
            partial.write_text(as_json(document, indent=1), encoding="utf-8")

    def clear(self) -> None:
        """Remove every listed file, and empty the list, which is written to manifest.json.

        A link is removed itself, not its target. What cannot be removed stays, without an
        error; so do files that are not listed, and folders.

        Raises:
            FailedError: The disk is full.
            OSError: The list cannot be written.
        """
        # A file of a listed name belongs to this program, whatever its content is by now.
        for name in self.files:
            self._remove(name)
        self.files = {}
        self.is_damaged = False
        self.add_to_list({})

    def _remove(self, name: str, digest: str = "") -> None:
        """Remove a file of this folder if it is what it is taken for; otherwise it stays.

        No error is raised if there is nothing, or it cannot be removed.

        Args:
            name: Name of the file in this folder. A link is removed itself, not its target.
            digest: SHA-256 that the content of a regular file must have; empty for any content.
        """
        file = self.path / name
        try:
            self._require_real_parents(name)
            if file.is_symlink() or digest in ("", digest_of(read_regular(file))):
                file.unlink()
        except OSError:
            return

    def _require_real_parents(self, name: str) -> None:
        """Raise an error unless the folders between this one and a file are real ones, no links.

        Otherwise a file would be read or written outside this folder. Of "figures/peaks.svg" it is
        the folder "figures"; a name without a folder passes.

        Raises:
            NotADirectoryError: One is a link or no folder.
            FileNotFoundError: One is missing.
        """
        for parent in PurePosixPath(name).parents[:-1]:
            folder = self.path / parent
            os.lstat(folder)  # FileNotFoundError where there is nothing
            if folder.is_symlink() or not folder.is_dir():
                raise NotADirectoryError(f"{parent} is no folder")
