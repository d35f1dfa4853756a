"""A durable store of samples: an SQLite file that campaigns resume from and share.

Samples are keyed by what they depend on: the identity of the model (case, mesh options, versions:
whatever the caller names) and the values of all inputs. Everything is written in transactions under
a rollback journal, which needs no shared memory and no file besides the store to be read, so it
also works where only file locks do, and on a full disk. A killed process loses what was not yet
committed; with `synchronous = FULL` so does a power cut, and no more.
"""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from errno import ENOSPC
from pathlib import Path
from typing import Any, NamedTuple

Identity = Mapping[str, Any]
_APPLICATION = 0x616C7068  # "alph"
_VERSION = 1
_PATIENCE = 60.0  # seconds to wait for another campaign's transaction
_SCHEMA = """
CREATE TABLE model (id INTEGER PRIMARY KEY, identity TEXT NOT NULL UNIQUE, layout TEXT);
CREATE TABLE sample (
    model INTEGER NOT NULL REFERENCES model, point TEXT NOT NULL, outputs BLOB, error TEXT,
    seconds REAL,
    PRIMARY KEY (model, point)
) WITHOUT ROWID;
"""


class StoreError(RuntimeError):
    """The store cannot be written or read; what is stored stays."""


class Stored(NamedTuple):
    """Content of a store for one model."""

    identity: dict[str, Any]
    samples: int
    failures: int
    mean_seconds: float


class Store:
    """An SQLite file of samples.

    Args:
        path: The file; made if there is none.

    Raises:
        ValueError: The file is something else, or of a later format.
        StoreError: It cannot be opened or made.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        self._database: sqlite3.Connection | None = None
        if self.path.is_dir():
            raise ValueError(
                f"{self.path} is a folder; give the store a file in it, such as"
                f" {self.path / 'samples.db'}"
            )
        with self.reported():
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self._database = sqlite3.connect(self.path, timeout=_PATIENCE, isolation_level=None)
            try:
                self._prepare(self._database)
            except sqlite3.OperationalError:
                raise
            except sqlite3.DatabaseError:
                raise ValueError(f"{self.path} is no store of samples; give another path") from None

    def _prepare(self, database: sqlite3.Connection) -> None:
        database.execute("PRAGMA journal_mode = TRUNCATE")
        database.execute("PRAGMA synchronous = FULL")
        with self.transaction() as database:
            version = database.execute("PRAGMA user_version").fetchone()[0]
            application = database.execute("PRAGMA application_id").fetchone()[0]
            if version == 0 and not database.execute("SELECT 1 FROM sqlite_master").fetchone():
                for statement in filter(str.strip, _SCHEMA.split(";")):
                    database.execute(statement)
                database.execute(f"PRAGMA application_id = {_APPLICATION}")
                database.execute(f"PRAGMA user_version = {_VERSION}")
            elif application != _APPLICATION:
                raise ValueError(f"{self.path} is no store of samples; give another path")
            elif version != _VERSION:
                raise ValueError(
                    f"{self.path} has format {version}, this program writes {_VERSION}; update the"
                    " program or give another path"
                )

    @property
    def database(self) -> sqlite3.Connection:
        """The open connection.

        Raises:
            ValueError: The store is closed.
        """
        if self._database is None:
            raise ValueError(f"the store {self.path} is closed; open it anew")
        return self._database

    @contextmanager
    def transaction(self) -> Iterator[sqlite3.Connection]:
        """All or nothing; waits for other campaigns first."""
        with self.reported():
            self.database.execute("BEGIN IMMEDIATE")
            try:
                yield self.database
                self.database.execute("COMMIT")
            except BaseException:
                if self.database.in_transaction:
                    self.database.execute("ROLLBACK")
                raise

    @contextmanager
    def reported(self) -> Iterator[None]:
        """Raise what goes wrong with the file as a StoreError."""
        try:
            yield
        except (sqlite3.DatabaseError, OSError) as error:
            cure = "free some space or find what blocks it, and run again: what is stored stays"
            if _barred(error):
                cure = "it cannot be written there: give another path, or the right to write"
            raise StoreError(f"the store {self.path} cannot be used ({error}): {cure}") from error

    def close(self) -> None:
        """Close the file."""
        if self._database is not None:
            self._database.close()
            self._database = None

    def __enter__(self) -> Store:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def models(self) -> list[Stored]:
        """Content of the store, model by model."""
        query = """SELECT identity, COUNT(outputs), COUNT(error), COALESCE(AVG(seconds), 0)
            FROM model LEFT JOIN sample ON sample.model = model.id GROUP BY model.id"""
        return [
            Stored(json.loads(identity), *rest) for identity, *rest in self.database.execute(query)
        ]


def _barred(error: Exception) -> bool:
    """True if the place of a store is the trouble, not its content or the space left."""
    if isinstance(error, OSError):
        return error.errno != ENOSPC
    return any(words in str(error) for words in ("unable to open", "readonly database"))


def canonical(identity: Identity) -> str:
    """An identity as text: the same for equal content, whatever the order of its keys.

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
