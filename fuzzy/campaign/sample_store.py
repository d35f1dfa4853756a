"""The samples of one model in a store, as one campaign uses them."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager, nullcontext
from pathlib import Path
from time import perf_counter
from typing import NamedTuple

import numpy as np

from alphacut.fuzzy.campaign.call import Failure, Outcome, Sample
from alphacut.fuzzy.campaign.sample_locks import Claims, network_kind
from alphacut.fuzzy.campaign.store import (
    Identity,
    Store,
    Stored,
    StoreError,
    canonical,
    content_of,
    model_key,
)
from alphacut.fuzzy.samples.model import Layout
from alphacut.fuzzy.sets.numbers import Array

_PAUSE = 0.05  # seconds between two writes at least
_SHARE = 10  # a write that took t is not followed by another within 10 t
# outcomes that wait to be written at most: what is gathered takes no more memory however large
# the store has grown
_FULL = 1000


class _Place(NamedTuple):
    """Where a sample is in the file, or why it failed."""

    start: int
    end: int
    error: str
    seconds: float


class Shelf:
    """Samples of one model in a store, as one campaign uses them.

    An outcome that took long is written at once. Quick ones are gathered and written together every
    twentieth of a second or so, or every thousand outcomes: that much finished work is what a kill
    can cost.

    Args:
        store: The store.
        identity: What every sample depends on besides its inputs; text, numbers, lists and
            mappings.
        names: Names of the inputs.

    Raises:
        StoreError: The store is damaged.
    """

    def __init__(self, store: Store, identity: Identity, names: Sequence[str]) -> None:
        self._store, self._identity = store, identity
        self._names = tuple(names)
        self._order = sorted(range(len(names)), key=lambda i: names[i])
        self._model = model_key(identity)
        self._gathered: dict[str, Outcome] = {}
        self._written, self._cost, self._urgent = perf_counter(), 0.0, False
        self._places: dict[str, _Place] = {}
        self._layout: Layout = ()
        self._named, self._end = False, 0
        self._claims: Claims | None = None  # not made before there is something to run
        self._look()
        self._begun, self.torn = self._end, store.torn  # before anybody writes
        self.held = sum(not place.error for place in self._places.values())  # likewise

    def key(self, point: Array) -> str:
        """A point as text, exact to the last bit and the same whatever the order of the inputs."""
        return json.dumps(
            {self._names[i]: float(point[i]) + 0.0 for i in self._order}, separators=(",", ":")
        )

    def _look(self) -> None:
        """Note what has been written since the last look, by whomever."""
        for end, entry in self._store.entries(self._model, self._end):
            self._end = end
            if entry is None:
                continue
            self._named |= "identity" in entry.head
            error = entry.head.get("error", "")
            if entry.point and (not error or entry.point not in self._places):
                self._places[entry.point] = _Place(
                    entry.start, entry.end, error, entry.head["seconds"]
                )
                self._layout = self._layout or _layout(entry.head)

    def stored(self, keys: Iterable[str]) -> dict[str, Sample]:
        """The samples that are there; failed ones are not."""
        self._look()
        found = {key: self._places[key] for key in keys if key in self._places}
        return {key: self._sample(place) for key, place in found.items() if not place.error}

    def _sample(self, place: _Place) -> Sample:
        entry = self._store.entry(place.start, place.end)
        row = np.frombuffer(entry.outputs, "<f8").astype(float)
        return Sample(_layout(entry.head), row, entry.head["seconds"])

    def old(self, keys: Iterable[str]) -> dict[str, float]:
        """Samples that were there when the campaign began, with the seconds that they took."""
        places = {key: self._places[key] for key in keys if key in self._places}
        return {
            key: place.seconds
            for key, place in places.items()
            if place.end <= self._begun and not place.error
        }

    def failed(self, keys: Iterable[str]) -> dict[str, str]:
        """Errors of the samples that failed before."""
        places = {key: self._places[key] for key in keys if key in self._places}
        return {key: place.error for key, place in places.items() if place.error}

    def points(self) -> list[dict[str, float]]:
        """Inputs of all samples of this model, by name."""
        return [json.loads(key) for key, place in self._places.items() if not place.error]

    def models(self) -> list[Stored]:
        """All models of the store."""
        return self._store.models()

    def claim(self, keys: Sequence[str]) -> tuple[set[str], dict[str, Sample]]:
        """Claim samples that are not stored.

        Returns:
            The keys that are now this campaign's to run, and the samples that turned out to be
            stored. What is in neither, another campaign is running.
        """
        claims = self._claims or self._begin()
        mine = claims.take(keys)
        stored = self.stored(keys)
        claims.release(mine & stored.keys())
        return mine - stored.keys(), stored

    def _begin(self) -> Claims:
        """Make the claims; alone on a network file system.

        Raises:
            StoreError: Another process works on a store there.
        """
        path = self._store.path
        with self._store.reported():
            self._claims = Claims(path, canonical(self._identity))
        if (kind := network_kind(path)) and not self._claims.alone():
            raise StoreError(
                f"the store {path} is on a network file system ({kind}) and in use by another"
                " campaign, or it keeps no locks; one campaign at a time works on such a store:"
                " give each its own, or a folder of this machine"
            )
        return self._claims

    def gather(self, key: str, outcome: Outcome) -> None:
        """Keep an outcome for the next write."""
        self._gathered[key] = outcome
        self._urgent |= outcome.seconds > _PAUSE

    def write(self, *, now: bool = False) -> None:
        """Write what is gathered: now, or when the last write is long enough ago to cost little."""
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
        """Write gathered outcomes; where the disk is too full for all, as many as fit."""
        contents = [] if self._named else [content_of(self._model, {"identity": self._identity})]
        try:
            self._store.append([*contents, *map(self._content, keys)])
        except StoreError:
            if len(keys) == 1:
                raise
            self._commit(keys[: len(keys) // 2])
            self._commit(keys[len(keys) // 2 :])
            return
        self._named = True
        if self._claims:
            self._claims.release(keys)
        for key in keys:
            del self._gathered[key]

    def _content(self, key: str) -> bytes:
        """A gathered outcome as the content of a record."""
        outcome = self._gathered[key]
        head: dict[str, object] = {"point": json.loads(key), "seconds": outcome.seconds}
        if isinstance(outcome, Failure):
            return content_of(self._model, {**head, "error": outcome.error or "failed"})
        self._layout = self._layout or outcome.layout
        if outcome.layout != self._layout:
            raise ValueError(
                f"the store holds the outputs {self._layout} for this model, a new sample has"
                f" {outcome.layout}; a model that changed needs another identity"
            )
        outputs = outcome.row.astype("<f8").tobytes()
        return content_of(self._model, {**head, "layout": outcome.layout}, outputs)

    def close(self) -> None:
        """Write what is gathered and give up all claims."""
        try:
            self.write(now=True)
        finally:
            if self._claims:
                self._claims.close()


def _layout(head: dict[str, list[tuple[str, list[int]]]]) -> Layout:
    return tuple((name, tuple(shape)) for name, shape in head.get("layout", []))


@contextmanager
def shelf(
    store: Store | str | Path | None, identity: Identity | None, names: Sequence[str]
) -> Iterator[Shelf | None]:
    """The samples of one model in a store or at its path; None where no store is asked for.

    Raises:
        ValueError: A store comes without an identity.
    """
    if store is None:
        yield None
        return
    if identity is None or identity == {}:
        said = "without an identity" if identity is None else "with an empty identity"
        raise ValueError(
            f"a store comes {said}; say what a sample depends on besides its inputs, as"
            " identity={'version': 1}"
        )
    if not isinstance(identity, Mapping):
        raise ValueError(
            f"the identity is {identity!r}; it must map names to what a sample depends on, as"
            " identity={'version': 1}"
        )
    with (
        nullcontext(store) if isinstance(store, Store) else Store(store) as opened,
        closing(Shelf(opened, identity, names)) as samples,
    ):
        yield samples
