"""A durable store of samples: an SQLite file that campaigns resume from.

The key of a sample is the identity of the model (case, mesh options, versions: whatever the caller
names) and the values of all inputs. Each row has a checksum over all its columns, and a batch is
one transaction: a killed process or a power cut loses only samples that were not yet written.
Opening a store reads and checks all rows. The rows of a damaged file that can be read are copied
into a new one, with a warning; other samples are computed anew. SQLite's application id tells that
a file is a store. Links, devices, pipes and data bases of other programs are refused, unchanged.
"""

from __future__ import annotations

import json
import os
import sqlite3
import stat
import warnings
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from hashlib import blake2b
from pathlib import Path
from typing import NamedTuple

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.campaign.call import Layout, Sample
from alphacut.fuzzy.refused import FailedError, require

Identity = Mapping[str, object]
_WRITE_TIMEOUT = 60.0  # seconds to wait for another campaign's write
_APPLICATION = 0x616C7068
"""Application id in the head of each store: "alph" in ASCII."""
_TABLE = """CREATE TABLE sample
(model blob, point text, layout text, outputs blob, checksum blob, primary key (model, point))"""
_SCHEMA = "select sql from sqlite_master where sql is not null"
_HEAD = 72
"""Bytes of the head of an SQLite file that end with its application id."""
_ACCESS_ERRORS = ("BUSY", "LOCKED", "FULL", "READONLY", "CANTOPEN", "PERM", "NOMEM")
_COLUMNS = "model, point, layout, outputs, checksum"


class Row(NamedTuple):
    """A sample as it is stored.

    Args:
        model: Key of the model.
        point: Inputs by name as JSON, exact to the last bit, in the order of their names.
        layout: Names and shapes of the outputs as JSON.
        outputs: Outputs as bytes of little-endian doubles.
        checksum: Of all that.
    """

    model: bytes
    point: str
    layout: str
    outputs: bytes
    checksum: bytes

    @classmethod
    def from_sample(cls, model: bytes, point: str, sample: Sample) -> Row:
        """Row of a sample, with its checksum."""
        layout = json.dumps(sample.layout)
        outputs = sample.row.astype("<f8").tobytes()
        return cls(model, point, layout, outputs, _checksum(model, point, layout, outputs))

    @property
    def is_intact(self) -> bool:
        """Whether the checksum is that of the other columns."""
        with suppress(TypeError, AttributeError):
            return _checksum(*self[:4]) == self.checksum
        return False

    @property
    def sample(self) -> Sample:
        """The sample."""
        layout: Layout = tuple((name, tuple(shape)) for name, shape in json.loads(self.layout))
        return Sample(layout, np.frombuffer(self.outputs, "<f8").astype(float))


def _checksum(model: bytes, point: str, layout: str, outputs: bytes) -> bytes:
    """Return a hash (16 bytes) of the columns of a row and of their lengths."""
    parts = model, point.encode(), layout.encode(), outputs
    sizes = np.array([len(part) for part in parts], "<i8").tobytes()
    return blake2b(b"".join((sizes, *parts)), digest_size=16).digest()


class Store:
    """Samples of all models in one file.

    Args:
        path: The file; created if there is none.

    Raises:
        RefusedError: The file is not a store, or it cannot be opened or created.

    Example:
        >>> from tempfile import TemporaryDirectory
        >>> from alphacut.fuzzy import Interval, Reduced, propagate
        >>> with TemporaryDirectory() as folder, Store(f"{folder}/samples.db") as store:
        ...     options = {"store": store, "identity": {"version": 1}, "alpha": [0]}
        ...     propagate(lambda x: x, {"x": Interval(0, 1)}, Reduced(), **options).evaluations
        2
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        self._rows: dict[tuple[bytes, str], Row] = {}
        allowed, cure = (
            "a file of samples that may be written",
            "move it away, or name another path",
        )
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            is_store = _is_store(self.path)
        except OSError as error:
            is_store, cure = False, str(error)
        require(is_store, "store", value=self.path, allowed=allowed, cure=cure)
        self._connection = self._open()

    def _open(self) -> sqlite3.Connection:
        """Open the file and read its intact rows; a damaged one is replaced by those rows."""
        connection = self._connect(self.path)
        with self.reported():
            try:
                _prepare(connection)
                damaged = connection.execute("pragma quick_check").fetchone() != ("ok",)
                damaged |= connection.execute(_SCHEMA).fetchall() != [(_TABLE,)]
            except (sqlite3.DatabaseError, UnicodeDecodeError) as error:
                name = getattr(error, "sqlite_errorname", "")  # none: text is no UTF-8
                if any(word in name for word in _ACCESS_ERRORS):  # no damage
                    raise
                damaged = True
        damaged |= not self._read(connection)
        return self._with_intact_rows(connection) if damaged else connection

    def _read(self, connection: sqlite3.Connection) -> bool:
        """Read the intact rows; False if a row is damaged, or SQLite could not read all."""
        all_intact = True
        try:
            for columns in connection.execute(f"select {_COLUMNS} from sample"):
                row = Row(*columns)
                all_intact &= row.is_intact
                if row.is_intact:
                    self._rows[row.model, row.point] = row
        except (sqlite3.DatabaseError, UnicodeDecodeError):
            return False
        return all_intact

    def _with_intact_rows(self, connection: sqlite3.Connection) -> sqlite3.Connection:
        """Close the damaged file, rename it, and return a new file with the rows that were read."""
        connection.close()
        damaged = self.path.with_name(f"{self.path.name}.damaged")
        with suppress(FileNotFoundError):
            os.remove(f"{self.path}-journal")
        if os.path.lexists(damaged):  # of an earlier damage, or of somebody else
            os.remove(self.path)
        else:
            os.rename(self.path, damaged)
        new_connection = self._connect(self.path)
        with self.reported():
            _prepare(new_connection)
        self._write(new_connection, self._rows.values())
        outcome = f"{len(self._rows)} samples are intact, the others are evaluated anew"
        warnings.warn(f"the store {self.path} was damaged: {outcome}", stacklevel=2)
        return new_connection

    def _connect(self, path: Path) -> sqlite3.Connection:
        with self.reported():
            return sqlite3.connect(path, timeout=_WRITE_TIMEOUT)

    def get(self, model: bytes, point: str) -> Sample | None:
        """The sample of a model at a point; None where there is none."""
        row = self._rows.get((model, point))
        return row and row.sample

    def put(self, model: bytes, samples: Mapping[str, Sample]) -> None:
        """Write samples in one transaction: all or none."""
        rows = [Row.from_sample(model, point, sample) for point, sample in samples.items()]
        self._write(self._connection, rows)
        self._rows |= {(row.model, row.point): row for row in rows}

    def _write(self, connection: sqlite3.Connection, rows: Iterable[Row]) -> None:
        insert = f"insert or replace into sample ({_COLUMNS}) values (?, ?, ?, ?, ?)"
        with self.reported(), connection:
            connection.executemany(insert, rows)

    @contextmanager
    def reported(self) -> Iterator[None]:
        """Context manager that turns errors of SQLite into a `FailedError` with a cure."""
        try:
            yield
        except sqlite3.Error as error:
            cure = "see to its space, its rights, and who else writes; what is stored stays"
            raise FailedError(f"the store {self.path} cannot be used: {error}", cure) from error

    def close(self) -> None:
        """Close the file."""
        self._connection.close()

    def __enter__(self) -> Store:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _prepare(connection: sqlite3.Connection) -> None:
    """Mark the file as a store and add its table, if it is new."""
    connection.execute("pragma synchronous = full")
    if connection.execute("pragma application_id").fetchone() != (_APPLICATION,):
        connection.execute(f"pragma application_id = {_APPLICATION}")
    if not connection.execute("select 1 from sqlite_master where name = 'sample'").fetchall():
        connection.execute(_TABLE)


def _is_store(path: Path) -> bool:
    """Return True for a store, an empty file, or where there is nothing; none of them a link."""
    sqlite_files = (path.with_name(f"{path.name}{end}") for end in ("", "-journal", "-wal", "-shm"))
    if not all(_is_regular(file, missing=True) for file in sqlite_files):
        return False
    if not os.path.lexists(path):
        return True
    with path.open("rb") as file:
        head = file.read(_HEAD)
    if not head.startswith(b"SQLite format 3\0"):
        return not head
    application = int.from_bytes(head[_HEAD - 4 :], "big")
    return application == _APPLICATION


def _is_regular(path: Path, *, missing: bool) -> bool:
    """Return whether a path is a regular file, no link or device; `missing` without a file."""
    try:
        return stat.S_ISREG(os.lstat(path).st_mode)
    except FileNotFoundError:
        return missing


def model_key(identity: Identity) -> bytes:
    """Return the key of a model's samples: a hash (16 bytes) of its identity.

    Raises:
        RefusedError: The identity is empty, or holds something that JSON does not.
    """
    try:
        text = json.dumps(identity, sort_keys=True, separators=(",", ":"), allow_nan=False)
    except (TypeError, ValueError):
        text = ""
    is_allowed = isinstance(identity, Mapping) and bool(identity) and bool(text)
    allowed = "a mapping, as {'version': 1}"
    cure = "it says what a sample depends on besides its inputs; texts and numbers"
    require(is_allowed, "identity", value=identity, allowed=allowed, cure=cure)
    return blake2b(text.encode(), digest_size=16).digest()


def point_key(names: tuple[str, ...], point: Array) -> str:
    """Return the key of a point: its inputs as JSON in alphabetical order, exact to the bit."""
    values = {name: float(x) + 0.0 for name, x in zip(names, point, strict=True)}
    return json.dumps(values, sort_keys=True, separators=(",", ":"))
