"""Spies on what commands compute, whatever is then told; no figures are drawn."""

from __future__ import annotations

import json
import pickle
import re
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from importlib.util import find_spec

from matplotlib import pyplot

import alphacut.figures.all
import alphacut.figures.style
import alphacut.frame
import alphacut.fuzzy.campaign.workers
import alphacut.io.progress
import alphacut.stages.material.modulus
import alphacut.stages.vibration.tolerances
import alphacut.stochastic.figures.all
from alphacut.commands import options
from alphacut.rve.series.model import SeriesModel
from alphacut.stages import pipeline
from alphacut.stages.material import references


def watch(command_modules: Iterable[object], events: list, monkeypatch) -> None:
    """Note every computation, pool, bar and answer of the commands in `events`."""
    for place, function in _pure():
        monkeypatch.setattr(place, function, _remembered(getattr(place, function)))
    for name, module in (
        ("safe scale", alphacut.stages.vibration.tolerances),
        ("envelope", alphacut.frame),
        ("propagate", alphacut.stages.material.modulus),
    ):
        function = name.replace(" ", "_")
        spy = _counted(name, getattr(module, function), events)
        monkeypatch.setattr(module, function, spy)
    drawings = {alphacut.figures.all: ["a.png"], alphacut.stochastic.figures.all: {}}
    for module, drawn in drawings.items():
        monkeypatch.setattr(module, "draw", _drawing(drawn, events))
    spies = {"progress": _bar(events), "answer": _answer(events), "pool": _pool(events)}
    monkeypatch.setattr(alphacut.figures.style, "save", _saving(events))
    monkeypatch.setattr(alphacut.fuzzy.campaign.workers, "pool", spies["pool"])
    for module in (alphacut.io.progress, options, pipeline, *command_modules):
        for name, spy in spies.items():
            if hasattr(module, name):
                monkeypatch.setattr(module, name, spy)


def _counted(name, real, events):
    def spy(*given, workers=1, **named):
        events.append((name, workers))
        return real(*given, **named)

    return spy


def _pure():
    """What is computed once for the same arguments, however often it is asked."""
    yield alphacut.frame, "envelope"
    yield references, "gauss_rule"
    yield SeriesModel, "solve"
    if find_spec("dolfinx"):
        from alphacut.rve.prism.model import PrismModel

        yield PrismModel, "solve"


def _remembered(real):
    """A function that computes the same call once: an option that goes past it seems idle."""
    known = {}

    def once(*given, progress=None, **named):
        key = (repr(given), pickle.dumps((given[1:], sorted(named.items()))))
        if key not in known:
            known[key] = pickle.dumps(real(*given, **named))
        return pickle.loads(known[key])

    return once


def _saving(events):
    """A figure's file without the figure: drawing is judged elsewhere."""

    def save(figure, path):
        events.append("figures")
        pyplot.close(figure)
        drawn = path.with_suffix(".png")
        drawn.parent.mkdir(parents=True, exist_ok=True)
        drawn.touch()
        return [drawn]

    return save


def _drawing(drawn, events):
    return lambda *_, **__: events.append("figures") or drawn


def _pool(events):
    @contextmanager
    def pool(count):
        events.append(("pool", count))
        with ThreadPoolExecutor(1) as executor:
            yield executor

    return pool


def _bar(events):
    @contextmanager
    def bar(title, *, quiet=False):
        events.append((title, quiet))
        yield None

    return bar


def _answer(events):
    real = options.answer

    def answer(given, document, out, text=""):
        events.append(("answer", told(json.dumps(document, default=str))))
        return real(given, document, out, text)

    return answer


def told(text):
    """A text without the time that a run took and the command line that it tells."""
    text = re.sub(r'"command": "[^"]*"', "", text)
    text = re.sub(r'"[a-z_]*seconds[a-z_]*": ([^,{}\[\]]+|\{[^}]*\})', "", text)
    text = re.sub(r"seconds: .*", "", text)
    text = re.sub(r"CASE --modulus .*", "", text)
    return re.sub(r"\d+(\.\d+)? s\b", "", text)
