"""Spies on what commands compute, whatever is then told; no figures are drawn."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager

import alphacut.figures.all
import alphacut.frame
import alphacut.frame.decisions.safe_scale
import alphacut.fuzzy.campaign.workers
import alphacut.io.progress
import alphacut.stages.material.modulus
import alphacut.stochastic.figures.all
from alphacut.commands import options
from alphacut.stages import pipeline


def watch(command_modules: Iterable[object], events: list, monkeypatch) -> None:
    """Note every computation, pool, bar and answer of the commands in `events`."""
    for name, module in (
        ("safe scale", alphacut.frame.decisions.safe_scale),
        ("envelope", alphacut.frame),
        ("propagate", alphacut.stages.material.modulus),
    ):
        function = name.replace(" ", "_")
        spy = _counted(name, getattr(module, function), events)
        monkeypatch.setattr(module, function, spy)
    drawings = {alphacut.figures.all: ["a.png"], alphacut.stochastic.figures.all: {}}
    for module, drawn in drawings.items():
        monkeypatch.setattr(module, "draw", _drawing(drawn, events))
    bar, answer = _bar(events), _answer(events)
    monkeypatch.setattr(alphacut.fuzzy.campaign.workers, "pool", _pool(events))
    for module in (alphacut.io.progress, pipeline, *command_modules):
        if hasattr(module, "progress"):
            monkeypatch.setattr(module, "progress", bar)
        if hasattr(module, "answer"):
            monkeypatch.setattr(module, "answer", answer)


def _counted(name, real, events):
    def spy(*given, workers=1, **named):
        events.append((name, workers))
        return real(*given, **named)

    return spy


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
