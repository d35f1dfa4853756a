"""The samples of one model in a store, as one campaign uses them."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterable, Iterator, Sequence
from contextlib import closing, contextmanager
from itertools import islice
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from alphacut.fuzzy.campaign.call import Failure, Outcome, Sample
from alphacut.fuzzy.campaign.sample_locks import Claims
from alphacut.fuzzy.campaign.store import Identity, Store, Stored, StoreError, canonical
from alphacut.fuzzy.samples.model import Layout
from alphacut.fuzzy.sets.numbers import Array

_CHUNK = 500  # points asked for in one query
_PAUSE = 0.05  # seconds between two transactions at least
_SHARE = 10  # a transaction that took t is not followed by another within 10 t
# outcomes that wait for a transaction at most: what is gathered takes no more memory however large
# the store has grown
_FULL = 1000
_SAVE = """
INSERT INTO sample VALUES (?, ?, ?, ?, ?) ON CONFLICT (model, point)
DO UPDATE SET outputs = excluded.outputs, error = excluded.error, seconds = excluded.seconds
WHERE sample.outputs IS NULL
"""


class Shelf:
    """The samples of one model in a store, as one campaign uses them.

    An outcome that took long is written at once. Quick ones are gathered and written together, a
    transaction every twentieth of a second
    or so, or every thousand outcomes: that much finished work is what a kill can cost.

    Args:
        store: The store.
        identity: What every sample depends on besides its inputs; text, numbers, lists and
            mappings.
        names: Names of the inputs.
    """

    def __init__(self, store: Store, identity: Identity, names: Sequence[str]) -> None:
        self._store = store
        self._names = tuple(names)
        self._order = sorted(range(len(names)), key=lambda i: names[i])
        self._gathered: dict[str, Outcome] = {}
        self._written, self._cost, self._urgent = perf_counter(), 0.0, False
        self._model: int = 0
        self._layout: Layout = ()
        self._identity = canonical(identity)
        self._model, self._layout = self._known_model()
        self._claims: Claims | None = (
            None  # neither these nor the model's row are made before there is something to run
        )

    def key(self, point: Array) -> str:
        """A point as text, exact to the last bit and the same whatever the order of the inputs."""
        return json.dumps(
            {self._names[i]: float(point[i]) + 0.0 for i in self._order}, separators=(",", ":")
        )

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
            return [
                json.loads(point)
                for (point,) in self._store.database.execute(query, (self._model,))
            ]

    def models(self) -> list[Stored]:
        """All models of the store."""
        return self._store.models()

    def claim(self, keys: Sequence[str]) -> tuple[set[str], dict[str, Sample]]:
        """Claim samples that are not stored.

        Returns:
            The keys that are now this campaign's to run, and the samples that turned out to be
            stored. What is in neither, another campaign is running.
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
        self._urgent |= outcome.seconds > _PAUSE

    def write(self, *, now: bool = False) -> None:
        """Write the gathered outcomes, unless the last transaction was a moment ago."""
        start = perf_counter()
        due = (
            now
            or self._urgent
            or len(self._gathered) >= _FULL
            or start - self._written > max(_PAUSE, _SHARE * self._cost)
        )
        if not (self._gathered and due):
            return
        self._commit(list(self._gathered))
        self._urgent = False
        self._written = perf_counter()
        self._cost = self._written - start

    def _commit(self, keys: list[str]) -> None:
        """Write outcomes in one transaction; as many as fit where the disk is full."""
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
                rows.append(
                    (self._model, key, outcome.row.astype("<f8").tobytes(), None, outcome.seconds)
                )
        database.executemany(_SAVE, rows)

    def _known_model(self) -> tuple[int, Layout]:
        """Number of the model in the store (0 if it has none yet) and the layout of its outputs."""
        if self._model and self._layout:
            return self._model, self._layout
        with self._store.reported():
            query = "SELECT id, layout FROM model WHERE identity = ?"
            number, layout = self._store.database.execute(query, (self._identity,)).fetchone() or (
                0,
                None,
            )
        return number, tuple((name, tuple(shape)) for name, shape in json.loads(layout or "[]"))

    def _require_layout(self, database: sqlite3.Connection, layout: Layout) -> None:
        if not self._layout:
            database.execute(
                "UPDATE model SET layout = ? WHERE id = ?", (json.dumps(layout), self._model)
            )
            self._layout = layout
        if layout != self._layout:
            outputs = (
                f"the store holds the outputs {self._layout} for this model, a new sample has"
                f" {layout}"
            )
            raise ValueError(f"{outputs}; a model that changed needs another identity")

    def _rows(self, columns: str, keys: Iterable[str], condition: str) -> Iterator[tuple[Any, ...]]:
        source = iter(keys)
        while chunk := list(islice(source, _CHUNK)):
            marks = ",".join("?" * len(chunk))
            query = (
                f"SELECT point, {columns} FROM sample WHERE model = ? AND point IN ({marks}) AND"
                f" {condition}"
            )
            yield from self._store.database.execute(query, (self._model, *chunk)).fetchall()


@contextmanager
def shelf(
    store: Store | str | Path | None, identity: Identity | None, names: Sequence[str]
) -> Iterator[Shelf | None]:
    """Samples of one model in a store or at a path; None without a store.

    Raises:
        ValueError: A store comes without an identity.
    """
    if store is None:
        yield None
        return
    if identity is None:
        raise ValueError(
            "a store comes without an identity; say what a sample depends on besides its inputs:"
            " identity={...}"
        )
    if isinstance(store, Store):
        with closing(Shelf(store, identity, names)) as samples:
            yield samples
        return
    with Store(store) as opened, closing(Shelf(opened, identity, names)) as samples:
        yield samples
