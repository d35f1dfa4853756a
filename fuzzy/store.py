"""A durable store of samples: an SQLite file that campaigns resume from and share.

Samples are keyed by what they depend on: the identity of the model (case, mesh options, versions: whatever the caller names) and the
values of all inputs. Everything is written in transactions under a rollback journal, which needs no shared memory and no file besides
the store to be read, so it also works where only file locks do, and on a full disk. A killed process loses what was not yet committed; with
`synchronous = FULL` so does a power cut, and no more.
"""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from itertools import islice
from pathlib import Path
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np

from fuzzy.call import Failure, Outcome, Sample
from fuzzy.claims import Claims
from fuzzy.model import Layout
from fuzzy.numbers import Array

Identity = Mapping[str, Any]
_APPLICATION = 0x616C7068  # "alph"
_VERSION = 1
_PATIENCE = 60.0  # seconds to wait for another campaign's transaction
_CHUNK = 500  # points asked for in one query
_PAUSE = 0.05  # seconds between two transactions at least
_SHARE = 10  # a transaction that took t is not followed by another within 10 t
_SCHEMA = """
CREATE TABLE model (id INTEGER PRIMARY KEY, identity TEXT NOT NULL UNIQUE, layout TEXT);
CREATE TABLE sample (
    model INTEGER NOT NULL REFERENCES model, point TEXT NOT NULL, outputs BLOB, error TEXT, seconds REAL,
    PRIMARY KEY (model, point)
) WITHOUT ROWID;
"""
_SAVE = """
INSERT INTO sample VALUES (?, ?, ?, ?, ?) ON CONFLICT (model, point)
DO UPDATE SET outputs = excluded.outputs, error = excluded.error, seconds = excluded.seconds WHERE sample.outputs IS NULL
"""


class StoreError(RuntimeError):
    """The store cannot be written: the disk is full or broken, or another campaign blocks it. What is stored stays readable."""


class Stored(NamedTuple):
    """What a store holds of one model."""

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
                    f"{self.path} has format {version}, this program writes {_VERSION}; update the program or give another path"
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
        """What is in the store, model by model."""
        query = """SELECT identity, COUNT(outputs), COUNT(error), COALESCE(AVG(seconds), 0)
            FROM model LEFT JOIN sample ON sample.model = model.id GROUP BY model.id"""
        return [Stored(json.loads(identity), *rest) for identity, *rest in self.database.execute(query)]


def canonical(identity: Identity) -> str:
    """An identity as text: the same for equal content, whatever the order of its keys.

    Raises:
        ValueError: It holds something that JSON does not.
    """
    try:
        return json.dumps(identity, sort_keys=True, separators=(",", ":"), allow_nan=False)
    except (TypeError, ValueError) as error:
        raise ValueError(f"the identity of the model holds what JSON does not ({error}); name it by text and numbers") from None


class Shelf:
    """The samples of one model in a store, as one campaign uses them.

    Outcomes are gathered and written together, a transaction every twentieth of a second at most: that is what a kill can cost.

    Args:
        store: The store.
        identity: What every sample depends on besides its inputs; text, numbers, lists and mappings.
        names: Names of the inputs.
    """

    def __init__(self, store: Store, identity: Identity, names: Sequence[str]) -> None:
        self._store = store
        self._names = tuple(names)
        self._order = sorted(range(len(names)), key=lambda i: names[i])
        self._gathered: dict[str, Outcome] = {}
        self._written, self._cost = perf_counter(), 0.0
        self._model: int = 0
        self._layout: Layout = ()
        self._identity = canonical(identity)
        self._model, self._layout = self._known_model()
        self._claims: Claims | None = None  # neither these nor the model's row are made before there is something to run

    def key(self, point: Array) -> str:
        """A point as text, exact to the last bit and the same whatever the order of the inputs."""
        return json.dumps({self._names[i]: float(point[i]) + 0.0 for i in self._order}, separators=(",", ":"))

    def stored(self, keys: Iterable[str]) -> dict[str, Sample]:
        """The samples that are there; failed ones are not."""
        found: dict[str, Sample] = {}
        with self._store.reported():
            self._model, self._layout = self._known_model()
            for key, blob, seconds in self._rows("outputs, seconds", keys, "outputs IS NOT NULL"):
                found[key] = Sample(self._layout, np.frombuffer(blob, "<f8").astype(float), seconds)
        return found

    def failed(self, keys: Iterable[str]) -> dict[str, str]:
        """Errors of the samples that failed before."""
        with self._store.reported():
            return {key: error for key, error in self._rows("error", keys, "error IS NOT NULL")}

    def points(self) -> list[dict[str, float]]:
        """Inputs of all samples of this model, by name."""
        query = "SELECT point FROM sample WHERE model = ? AND outputs IS NOT NULL"
        with self._store.reported():
            return [json.loads(point) for (point,) in self._store.database.execute(query, (self._model,))]

    def models(self) -> list[Stored]:
        """All models of the store."""
        return self._store.models()

    def claim(self, keys: Sequence[str]) -> tuple[set[str], dict[str, Sample]]:
        """Claim samples that are not stored.

        Returns:
            The keys that are now this campaign's to run, and the samples that turned out to be stored. What is in neither, another
            campaign is running.
        """
        if self._claims is None:
            with self._store.reported():
                self._claims = Claims(self._store.path, self._identity)
        mine = self._claims.take(keys)
        stored = self.stored(keys)
        self._claims.release(mine & stored.keys())
        return mine - stored.keys(), stored

    def gather(self, key: str, outcome: Outcome) -> None:
        """Keep an outcome for the next transaction."""
        self._gathered[key] = outcome

    def write(self, *, now: bool = False) -> None:
        """Write what is gathered: now, or when the last transaction is long enough ago not to slow the campaign down."""
        start = perf_counter()
        if not self._gathered or not (now or start - self._written > max(_PAUSE, _SHARE * self._cost)):
            return
        self._commit(list(self._gathered))
        self._written = perf_counter()
        self._cost = self._written - start

    def _commit(self, keys: list[str]) -> None:
        """Write gathered outcomes in one transaction; where the disk is too full for all, as many as fit."""
        try:
            with self._store.transaction() as database:
                self._save(database, keys)
        except BaseException as error:
            self._model, self._layout = 0, ()  # nothing of it was written
            if not isinstance(error, StoreError) or len(keys) == 1:
                raise
            self._commit(keys[: len(keys) // 2])
            self._commit(keys[len(keys) // 2 :])
            return
        if self._claims:
            self._claims.release(keys)
        for key in keys:
            del self._gathered[key]

    def close(self) -> None:
        """Write what is gathered and give up all claims."""
        try:
            self.write(now=True)
        finally:
            if self._claims:
                self._claims.close()

    def _save(self, database: sqlite3.Connection, keys: Iterable[str]) -> None:
        database.execute("INSERT OR IGNORE INTO model (identity) VALUES (?)", (self._identity,))
        self._model, self._layout = self._known_model()
        rows: list[tuple[int, str, bytes | None, str | None, float]] = []
        for key in keys:
            outcome = self._gathered[key]
            if isinstance(outcome, Failure):
                rows.append((self._model, key, None, outcome.error, outcome.seconds))
            else:
                self._require_layout(database, outcome.layout)
                rows.append((self._model, key, outcome.row.astype("<f8").tobytes(), None, outcome.seconds))
        database.executemany(_SAVE, rows)

    def _known_model(self) -> tuple[int, Layout]:
        """Number of the model in the store (0 if it has none yet) and the layout of its outputs."""
        if self._model and self._layout:
            return self._model, self._layout
        with self._store.reported():
            query = "SELECT id, layout FROM model WHERE identity = ?"
            number, layout = self._store.database.execute(query, (self._identity,)).fetchone() or (0, None)
        return number, tuple((name, tuple(shape)) for name, shape in json.loads(layout or "[]"))

    def _require_layout(self, database: sqlite3.Connection, layout: Layout) -> None:
        if not self._layout:
            database.execute("UPDATE model SET layout = ? WHERE id = ?", (json.dumps(layout), self._model))
            self._layout = layout
        if layout != self._layout:
            outputs = f"the store holds the outputs {self._layout} for this model, a new sample has {layout}"
            raise ValueError(f"{outputs}; a model that changed needs another identity")

    def _rows(self, columns: str, keys: Iterable[str], condition: str) -> Iterator[tuple[Any, ...]]:
        source = iter(keys)
        while chunk := list(islice(source, _CHUNK)):
            marks = ",".join("?" * len(chunk))
            query = f"SELECT point, {columns} FROM sample WHERE model = ? AND point IN ({marks}) AND {condition}"
            yield from self._store.database.execute(query, (self._model, *chunk)).fetchall()


@contextmanager
def shelf(store: Store | str | Path | None, identity: Identity | None, names: Sequence[str]) -> Iterator[Shelf | None]:
    """The samples of one model in a store or in the store at a path; None where no store is asked for.

    Raises:
        ValueError: A store comes without an identity.
    """
    if store is None:
        yield None
        return
    if identity is None:
        raise ValueError("a store comes without an identity; say what a sample depends on besides its inputs: identity={...}")
    if isinstance(store, Store):
        with closing(Shelf(store, identity, names)) as samples:
            yield samples
        return
    with Store(store) as opened, closing(Shelf(opened, identity, names)) as samples:
        yield samples
