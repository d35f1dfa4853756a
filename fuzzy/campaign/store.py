"""A durable store of samples: an SQLite file that campaigns resume from.

The key of a sample is the identity of the model (case, mesh options, versions: whatever the caller
names) and the values of all inputs. Each row has a checksum over all its columns, and a batch is
one transaction: a killed process or a power cut loses only samples that were not yet written.
Opening a store reads and checks all rows. A damaged file is set aside as NAME.damaged and a new one
takes its intact rows; other samples are computed anew. SQLite's application id tells that a file is
a store. Links, devices, pipes and data bases of other programs are refused, unchanged.
"""

from __future__ import annotations

import json
import os
import warnings
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from hashlib import blake2b
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import FailedError, path_of, require
from alphacut.base.kept_files import is_regular, read_regular
from alphacut.fuzzy.campaign.call import Layout, Sample, named_point

if TYPE_CHECKING:
    import sqlite3

# SQLite is imported by the first store: many a campaign keeps no samples.
Identity = Mapping[str, object]
"""What a sample depends on besides its inputs, as JSON has it."""
_APPLICATION = 0x616C7068  # application id in the head of each store: "alph" in ASCII


class Row(NamedTuple):
    """A sample as it is stored, a field for each column of the table.

    Args:
        model: Key of the model, as of `model_key`.
        point: Key of the point, as of `point_key`: the inputs by name, exact to the last bit.
        layout: Names and shapes of the outputs as JSON.
        outputs: Outputs as little-endian doubles.
        checksum: Hash of the other columns.
    """

    model: bytes
    point: str
    layout: str
    outputs: bytes
    checksum: bytes

    @classmethod
    def from_sample(cls, model: bytes, point: str, sample: Sample) -> Row:
        """Return the row of a sample, with its checksum."""
        layout = json.dumps(sample.layout)
        outputs = sample.row.astype("<f8").tobytes()
        return cls(model, point, layout, outputs, _checksum(model, point, layout, outputs))

    @property
    def is_intact(self) -> bool:
        """Whether the checksum is that of the other columns, and these have their types."""
        try:
            checksum = _checksum(self.model, self.point, self.layout, self.outputs)
        except (TypeError, AttributeError):
            return False
        return checksum == self.checksum

    @property
    def sample(self) -> Sample:
        """The sample that the row holds."""
        layout: Layout = tuple((name, tuple(shape)) for name, shape in json.loads(self.layout))
        return Sample(layout, np.frombuffer(self.outputs, "<f8").astype(float))


def _checksum(model: bytes, point: str, layout: str, outputs: bytes) -> bytes:
    """Return a hash of the columns of a row; their sizes keep them apart."""
    columns = [model, point.encode(), layout.encode(), outputs]
    sizes = np.array([len(column) for column in columns], "<i8").tobytes()
    return blake2b(sizes + b"".join(columns), digest_size=16).digest()


class Store:
    """Samples of all models in one file, which is created if there is none.

    All samples are read when the store is opened, and are then held in memory.

    Args:
        path: Path of the file.

    Raises:
        RefusedError: The path is none, the file is not a store, or it cannot be created.
        FailedError: SQLite cannot use the file.

    Example:
        >>> from tempfile import TemporaryDirectory
        >>> from alphacut.fuzzy import Interval, Reduced, propagate
        >>> with TemporaryDirectory() as folder, Store(f"{folder}/samples.db") as store:
        ...     options = {"store": store, "identity": {"version": 1}, "alpha": [0]}
        ...     propagate(lambda x: x, {"x": Interval(0, 1)}, Reduced(), **options).evaluations
        2
    """

    create_table = """CREATE TABLE sample
(model blob, point text, layout text, outputs blob, checksum blob, primary key (model, point))"""
    """Statement that makes the table, with a column for each field of `Row`. SQLite keeps its text,
    by which a store is known."""

    def __init__(self, path: str | Path) -> None:
        self.path = path_of("store", path)
        self._rows: dict[tuple[bytes, str], Row] = {}
        cure = "move it away, or name another path"
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            is_store = _is_store(self.path)
        except OSError as error:
            is_store = False
            cure = str(error)
        allowed = "a file of samples that may be written"
        require(is_store, "store", value=self.path, allowed=allowed, cure=cure)
        with self._reported():
            self._connection = self._connect()
            if not self._read():
                self._renew()

    def _connect(self) -> sqlite3.Connection:
        """Return a connection that waits a minute for another campaign's write."""
        import sqlite3

        return sqlite3.connect(self.path, timeout=60.0)

    def _read(self) -> bool:
        """Read the intact rows into memory, and return whether the file and all rows are intact.

        A row is intact if its checksum fits its columns. Such rows are added to `self._rows`
        by the keys of their model and point, also where the file is damaged elsewhere. A new, empty
        file gets its table here and is intact. False means damage: SQLite's check of the file
        finds some, the only table is not the one of `create_table`, or a row is not intact.

        Raises:
            sqlite3.DatabaseError: The file cannot be accessed (it is locked, its disk is full, it
                may not be read or written), which is no damage.
        """
        import sqlite3

        schema = "select sql from sqlite_master where sql is not null"
        samples = f"select {', '.join(Row._fields)} from sample"
        try:
            _prepare(self._connection)
            check = self._connection.execute("pragma quick_check").fetchone()
            tables = self._connection.execute(schema).fetchall()
            is_intact = check == ("ok",) and tables == [(self.create_table,)]
            for columns in self._connection.execute(samples):
                row = Row._make(columns)
                if row.is_intact:
                    self._rows[row.model, row.point] = row
                else:
                    is_intact = False
        except (sqlite3.DatabaseError, UnicodeDecodeError) as error:
            # A text that is no UTF-8 raises an error without a name.
            name = getattr(error, "sqlite_errorname", "")
            of_access = ("BUSY", "LOCKED", "FULL", "READONLY", "CANTOPEN", "PERM", "NOMEM")
            if any(word in name for word in of_access):
                raise
            return False
        return is_intact

    def _renew(self) -> None:
        """Set the damaged file aside, write the intact rows into a new one, and warn.

        The damaged file becomes NAME.damaged, in place of an earlier one of this name. The rows of
        `self._rows`, which `_read` has filled, go into a new file under the old name, to which the
        connection is opened again.

        Raises:
            OSError: The file cannot be renamed.
            sqlite3.Error: The new file cannot be written.
        """
        self._connection.close()
        # SQLite would play the journal of the damaged file back into the new one of the same name.
        with suppress(FileNotFoundError):
            os.remove(f"{self.path}-journal")
        os.replace(self.path, self.path.with_name(f"{self.path.name}.damaged"))
        self._connection = self._connect()
        _prepare(self._connection)
        self._write(self._rows.values())
        outcome = f"{len(self._rows)} samples are intact, the others are evaluated anew"
        warnings.warn(f"the store {self.path} was damaged: {outcome}", stacklevel=4)

    def get(self, model: bytes, point: str) -> Sample | None:
        """Return the sample of a model at a point from memory; None where there is none.

        Args:
            model: Key of the model: the hash (16 bytes) that `model_key` returns.
            point: Key of the point: the inputs by name as JSON, as `point_key` returns it.
        """
        row = self._rows.get((model, point))
        return row and row.sample

    def put(self, model: bytes, samples: Mapping[str, Sample]) -> None:
        """Write samples in one transaction, all or none, and keep them in memory.

        A sample of the same model and point is replaced.

        Args:
            model: Key of the model: the hash (16 bytes) that `model_key` returns.
            samples: Samples by the keys of their points, which `point_key` returns.

        Raises:
            FailedError: SQLite cannot write them, also where another process has locked the file
                for a minute; then none is kept.
        """
        rows = [Row.from_sample(model, point, sample) for point, sample in samples.items()]
        with self._reported():
            self._write(rows)
        self._rows |= {(row.model, row.point): row for row in rows}

    def _write(self, rows: Iterable[Row]) -> None:
        """Write rows in one transaction; rows of the same model and point are replaced."""
        names = ", ".join(Row._fields)
        insert = f"insert or replace into sample ({names}) values (?, ?, ?, ?, ?)"
        with self._connection as transaction:
            transaction.executemany(insert, rows)

    @contextmanager
    def _reported(self) -> Iterator[None]:
        """Context manager that turns errors of SQLite into a `FailedError` with a cure."""
        import sqlite3

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
        connection.execute(Store.create_table)


def _is_store(path: Path) -> bool:
    """Return whether a path is a store of samples, an empty file, or names nothing.

    It is False for any other file, and if the file, or one of those that SQLite makes beside it
    (-journal, -wal, -shm), is a folder, a link, a pipe or a device.

    Raises:
        OSError: The file cannot be read.
    """
    # SQLite's file format: bytes 68 to 71 of the head are the application id, big-endian.
    head_size = 72
    for end in ("", "-journal", "-wal", "-shm"):
        with suppress(FileNotFoundError):
            if not is_regular(path.with_name(f"{path.name}{end}")):
                return False
    if not path.exists():
        return True
    head = read_regular(path, head_size)
    if not head.startswith(b"SQLite format 3\0"):
        return not head  # True for an empty file
    return int.from_bytes(head[head_size - 4 :], "big") == _APPLICATION


def model_key(identity: Identity) -> bytes:
    """Return the key of a model's samples: a hash (16 bytes) of its identity.

    The order of names does not matter.

    Args:
        identity: What a sample depends on besides its inputs, such as versions and options.

    Raises:
        RefusedError: The identity is no mapping, is empty, or holds something that JSON does not,
            such as NaN.
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
    return json.dumps(named_point(names, point + 0.0), sort_keys=True, separators=(",", ":"))
