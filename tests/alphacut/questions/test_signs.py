"""Limits and peaks are told with the sign of the output: of the greatest, the least, the magnitude."""

import re

import numpy as np
import pytest

from alphacut.case.limits import parse_limit
from alphacut.frame import Accelerogram, StoreyFrame, envelope
from alphacut.frame.questions.peaks import Peak, passing
from alphacut.frame.questions.peaks import peaks as peaks_over_time
from alphacut.fuzzy import Interval
from alphacut.fuzzy.result import Nature
from alphacut.questions.decision import LimitDecision
from alphacut.stages.envelope import peak_results, peaks_of
from alphacut.stages.store import CutsResult

SIDES = ("max", "min", "")


def drawn(rng):
    """A limit, and bounds of an output's peak with its own sign: outer, reached, by side."""
    side = SIDES[rng.integers(3)]
    limit = rng.normal() * 10.0 ** rng.integers(-3, 3)
    limit = abs(limit) + 1e-6 if side == "" else limit
    low, high = np.sort(limit + abs(limit) * rng.normal(size=2))
    if side == "":
        low, high = np.sort(np.abs([low, high]))
    reached = low + 0.9 * (high - low) if side != "min" else high - 0.9 * (high - low)
    return side, limit, low, high, reached


def peaks_with(side, low, high, reached):
    """Peaks as the frame has them: of the negative of the output for its least value."""
    if side == "min":
        low, high, reached = -high, -low, -reached
    ends = [np.array([value]) for value in (low, high, 0.0, reached, low, high)]
    peak = Peak(np.zeros(1), *ends, Nature.GUARANTEED, is_signed=bool(side))
    name = f"{side} q1".strip()
    return name, {name: peak}


def test_every_number_on_a_limit_has_the_sign_of_the_output(rng):
    for _ in range(700):
        side, limit, low, high, reached = drawn(rng)
        relation = ">=" if side == "min" else "<="
        parsed = parse_limit(f"{side} q1 {relation} {float(limit)!r} m".strip())
        assert (parsed.side, parsed.value) == (side, pytest.approx(limit))
        name, peaks = peaks_with(side, low, high, reached)
        peak = peak_results(peaks)[name]
        assert (peak.lower[0], peak.upper[0], peak.reached[0]) == pytest.approx(
            (low, high, reached)
        )
        again = peaks_of({name: peak}, [0.0])
        assert again[name].upper[0] == pytest.approx(peaks[name].upper[0])
        assert again[name].lower[0] == pytest.approx(peaks[name].lower[0])
        far = low if side == "min" else high
        assert peak.proved[0] == pytest.approx(far)
        assert peak.far_end[0] == pytest.approx(far)
        answer = passing(peaks, {name: parsed.sign * parsed.value})[name]
        breaks = reached < limit if side == "min" else reached > limit
        may_break = far < limit if side == "min" else far > limit
        must_break = (high if side == "min" else low) * parsed.sign > limit * parsed.sign
        expected = "exceeded" if must_break else "can be exceeded" if breaks else "undecided"
        assert answer.outcome == (expected if may_break else "not exceeded")
        told = LimitDecision(
            side=side, output="q1", unit="m", limit=parsed.value, possibility=(0, 1),
            necessity=(0, 1), margin=CutsResult.of([[0.0, 0.0]]), verdict=answer.outcome, from_level=0,
            nature=Nature.GUARANTEED, peak=peak,
        )  # fmt: skip
        sign = "≥" if side == "min" else "≤"
        shown_name = "|q1|" if side == "" else f"{side} q1"
        assert told.words.startswith(f"{shown_name} {sign} ")
        assert told.words.count("−") == (limit < 0)


def test_python_says_the_bound_over_time_as_the_command_does():
    ground = Accelerogram(0.02, np.sin(np.arange(60)))
    frame = StoreyFrame(masses=[1.0], stiffness=[150.0], damping_ratio=0.02, ground=ground)
    inputs = {"k1": Interval(149.0, 151.0)}
    found = envelope(frame, inputs, duration=1.2, step=0.02, alpha=[0], progress=False)
    proved = float(re.search(r"proved (\S+) m", found.peak_words)[1])
    bound = peaks_over_time(found)["q1"].upper[0]
    assert bound <= proved <= 1.001 * bound
    assert bound > np.maximum(found.upper, -found.lower).max()  # that at the nodes
