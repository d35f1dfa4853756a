"""A durable store of samples: a file of checked records that campaigns resume from and share.

Samples are keyed by what they depend on: the identity of the model (case, mesh options, versions:
whatever the caller names) and the values of all inputs. Records are only ever appended, under a
lock, and written through to the disk. A killed process or a power cut loses what was not yet
written. Damage is found by the checksum of every record, told, and dropped by `Store.repair`.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from errno import EDQUOT, EFBIG, ENOSPC
from hashlib import blake2b
from pathlib import Path
from shlex import quote
from threading import RLock
from time import monotonic, sleep
from typing import Any, NamedTuple

from alphacut.fuzzy.campaign import records
from alphacut.fuzzy.campaign.records import Damage, Record

try:
    import fcntl
except ImportError:  # no locks on this system: one campaign on a store at a time
    fcntl = None  # type: ignore[assignment]

Identity = Mapping[str, Any]
_PATIENCE = 60.0  # seconds to wait for another campaign's write
_MODEL = 16  # bytes that tell a model's records
_FULL = (ENOSPC, EDQUOT, EFBIG)
_WRITING = RLock()  # campaigns in threads of one process


class StoreError(RuntimeError):
    """Trouble with a store's file: damage, no space, no right, or another campaign's lock."""


class Stored(NamedTuple):
    """Summary of one model's samples in a store."""

    identity: dict[str, Any]
    samples: int
    failures: int
    mean_seconds: float


class Repaired(NamedTuple):
    """Outcome of a repair: records that are whole, damaged places, and their bytes."""

    kept: int
    places: int
    size: int


class Entry(NamedTuple):
    """A record of a model.

    Args:
        head: What it says: `identity`, or `point`, `seconds` and either `error` or `layout`.
        outputs: Outputs at the point, as bytes; empty without.
        start: Where the record starts in the file.
        end: Where it ends.
    """

    head: dict[str, Any]
    outputs: bytes
    start: int
    end: int

    @property
    def point(self) -> str:
        """Inputs as text; empty if the record is of no sample."""
        return json.dumps(self.head["point"], separators=(",", ":")) if "point" in self.head else ""


class Store:
    """A file of samples, each with its checksum.

    Args:
        path: The file; made if there is none.

    Raises:
        ValueError: The file is something else, or of another format.
        StoreError: It cannot be opened or made.
    """

    def __init__(self, path: str | Path) -> None:
        if not isinstance(path, str | os.PathLike):
            raise ValueError(f"the store is {path!r}; it must be the path of a file, or a Store")
        self.path = Path(path)
        self._handle: int | None = None
        self._whole = 0  # up to here the file holds whole records
        self.torn = False  # whether it was seen to end within a record
        if self.path.is_dir():
            raise ValueError(
                f"{self.path} is a folder; give the store a file in it, such as"
                f" {self.path / 'samples.db'}"
            )
        with self.reported():
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self._handle = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_APPEND, 0o666)
        self._require_store()

    def _require_store(self) -> None:
        """Refuse a file that holds neither a record nor the mark of one."""
        start = self._read(0, len(records.MARK))
        if records.MARK.startswith(start) or start[:1] == records.VOID:
            return  # a record, or the torn beginning of the first one
        if any(isinstance(one, Record) for one in self._scan(0)):
            return
        self.close()
        if records.marked(start):
            raise ValueError(
                f"{self.path} has format {start[len(records.NAME)]}, this program writes"
                f" {records.FORMAT}; update the program or give another path"
            )
        raise ValueError(f"{self.path} is no store of samples; give another path")

    @property
    def handle(self) -> int:
        """The open file.

        Raises:
            ValueError: The store is closed.
        """
        if self._handle is None:
            raise ValueError(f"the store {self.path} is closed; open it anew")
        return self._handle

    def _read(self, start: int, count: int) -> bytes:
        with self.reported():
            return os.pread(self.handle, count, start)

    def _scan(self, start: int) -> Iterator[Record | Damage]:
        return records.scan(self._read, start, os.fstat(self.handle).st_size)

    def entries(self, model: bytes, start: int = 0) -> Iterator[tuple[int, Entry | None]]:
        """End of every record from the end of another on, with what it says if it is the model's.

        Args:
            model: Key of the model; empty for all.
            start: Where to begin.

        Raises:
            StoreError: Something there is damaged; after the last record that is whole.
        """
        damage: list[Damage] = []
        for one in self._scan(start):
            if isinstance(one, Damage):
                damage += [] if one.torn else [one]
                self.torn |= one.torn
            else:
                yield one.end, _entry(one) if one.content.startswith(model) else None
        if damage:
            raise StoreError(self._told(damage))

    def entry(self, start: int, end: int) -> Entry:
        """The record between two offsets, checked once more.

        Raises:
            StoreError: It has been damaged meanwhile.
        """
        one = next(records.scan(self._read, start, end), None)
        if not isinstance(one, Record):
            raise StoreError(self._told([one or Damage(start, b"", end - start, False)]))
        return _entry(one)

    def _told(self, damage: list[Damage]) -> str:
        """The damage with the first sample that it names, and what to do."""
        named = [text for text in map(_sample_in, damage) if text]
        which = f"; among what is lost: the sample {named[0]}" if named else ""
        return (
            f"the store {self.path} is damaged at {len(damage)} places, the first at byte"
            f" {damage[0].start}{which}: run `python -m alphacut repair {quote(str(self.path))}`"
            " (in Python: fuzzy.Store(path).repair()), which drops what is lost; the next run"
            " computes only that anew"
        )

    def append(self, contents: Iterable[bytes]) -> None:
        """Write contents as records: all or none.

        Raises:
            StoreError: There is no space, or another campaign blocks the file.
        """
        data = b"".join(map(records.packed, contents))
        with self._locked():
            end = self._end()
            try:
                with self.reported():
                    if os.write(self.handle, data) < len(data):
                        raise OSError(ENOSPC, os.strerror(ENOSPC))
                    os.fsync(self.handle)
            except BaseException:
                os.ftruncate(self.handle, end)
                raise

    def _end(self) -> int:
        """Size of the file, without the torn end of a write that was killed."""
        for one in self._scan(self._whole):
            if isinstance(one, Damage) and one.torn:
                os.ftruncate(self.handle, one.start)
                break
            self._whole = one.end
        return os.fstat(self.handle).st_size

    def repair(self) -> Repaired:
        """Void whatever is damaged; whole records stay where they are.

        Raises:
            StoreError: The file cannot be written.
        """
        with self._locked():
            kept, damage = 0, []
            for one in self._scan(0):
                damage += [one] if isinstance(one, Damage) else []
                kept += isinstance(one, Record)
            with self.reported():
                handle = os.open(self.path, os.O_WRONLY)
                try:
                    for one in damage:
                        os.pwrite(handle, records.VOID * one.size, one.start)
                    os.fsync(handle)
                finally:
                    os.close(handle)
        lost = [one for one in damage if not one.torn]
        return Repaired(kept, len(lost), sum(one.size for one in lost))

    @contextmanager
    def _locked(self) -> Iterator[None]:
        """Nobody else writes meanwhile."""
        if not _WRITING.acquire(timeout=_PATIENCE):
            raise StoreError(self._blocked())
        try:
            until = monotonic() + _PATIENCE
            while fcntl is not None:
                try:
                    fcntl.flock(self.handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
                    break
                except OSError:
                    if monotonic() > until:
                        raise StoreError(self._blocked()) from None
                    sleep(0.01)
            try:
                yield
            finally:
                if fcntl is not None:
                    fcntl.flock(self.handle, fcntl.LOCK_UN)
        finally:
            _WRITING.release()

    def _blocked(self) -> str:
        return (
            f"the store {self.path} cannot be used: another campaign has been writing to it for"
            f" {_PATIENCE:g} s; see whether it hangs, and run again: what is stored stays"
        )

    @contextmanager
    def reported(self) -> Iterator[None]:
        """Raise what goes wrong with the file as a StoreError."""
        try:
            yield
        except OSError as error:
            cure = "it cannot be written there: give another path, or the right to write"
            if error.errno in _FULL:
                cure = "free some space and run again: what is stored stays"
            raise StoreError(
                f"the store {self.path} cannot be used ({error.strerror or error}): {cure}"
            ) from error

    def close(self) -> None:
        """Close the file."""
        if self._handle is not None:
            os.close(self._handle)
            self._handle = None

    def __enter__(self) -> Store:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def models(self) -> list[Stored]:
        """Summary of every model.

        Raises:
            StoreError: The file is damaged.
        """
        identities: dict[bytes, dict[str, Any]] = {}
        samples: dict[bytes, dict[str, tuple[bool, float]]] = {}
        for entry in (entry for _, entry in self.entries(b"") if entry):
            rows = samples.setdefault(entry.head["model"], {})
            if not entry.point:
                identities[entry.head["model"]] = entry.head["identity"]
            elif "layout" in entry.head or not rows.get(entry.point, (False,))[0]:
                rows[entry.point] = "layout" in entry.head, entry.head["seconds"]
        lost = {"identity": "lost to damage"}
        return [
            _summary(identities.get(key, lost), [*rows.values()]) for key, rows in samples.items()
        ]


def _summary(identity: dict[str, Any], rows: list[tuple[bool, float]]) -> Stored:
    done = sum(row[0] for row in rows)
    return Stored(identity, done, len(rows) - done, sum(row[1] for row in rows) / max(len(rows), 1))


def model_key(identity: Identity) -> bytes:
    """Bytes that tell the records of a model from those of others."""
    return blake2b(canonical(identity).encode(), digest_size=_MODEL).digest()


def content_of(model: bytes, head: Mapping[str, object], outputs: bytes = b"") -> bytes:
    """Content of a record."""
    return model + json.dumps(head, separators=(",", ":")).encode() + b"\n" + outputs


def _entry(record: Record) -> Entry:
    head, _, outputs = record.content[_MODEL:].partition(b"\n")
    return Entry(
        {**json.loads(head), "model": record.content[:_MODEL]}, outputs, record.start, record.end
    )


def _sample_in(damage: Damage) -> str:
    """Inputs of the sample in a damaged record, as far as they can be read."""
    text = damage.content.partition(b'"point":{')[2].partition(b"}")[0]
    return text.decode("utf-8", "replace").replace('"', "").replace(":", " = ").replace(",", ", ")


def canonical(identity: Identity) -> str:
    """An identity as text, the same for equal content whatever the order of its keys.

    Raises:
        ValueError: It holds something that JSON does not.
    """
    try:
        return json.dumps(identity, sort_keys=True, separators=(",", ":"), allow_nan=False)
    except (TypeError, ValueError) as error:
        raise ValueError(
            f"the identity of the model holds what JSON does not ({error}); name it by text and"
            " numbers"
        ) from None
