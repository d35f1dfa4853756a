"""Values of a case that most likely have the wrong unit."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from statistics import median_low
from typing import TYPE_CHECKING

import numpy as np

from alphacut.case.case import Case
from alphacut.case.limits import storey_height
from alphacut.case.names import structures
from alphacut.case.readings import limits, readings
from alphacut.io.files import say
from alphacut.io.units import engineering

if TYPE_CHECKING:
    from alphacut.frame import Accelerogram
    from alphacut.stages.vibration.structure import Structure

PERIODS = (0.05, 15.0)  # s, from a stiff machine frame to the slenderest towers
SLOW, USUAL = (0.01, 1.0), (0.05, 0.3)  # s of the first period for each storey of a frame
SOFTEST = 3.0  # the same of a frame whose modulus is computed
# unit, and how far a storey's value may be from the median of all
STOREYS = {"masses": ("kg", 50), "lengths": ("m", 8), "second_moment": ("m^4", 100)}
STOREYS |= {"stiffness": ("N/m", 50)}
FLOORS = (0.01, 1e7)  # kg
SPREAD = 0.002  # of a fuzzy value, that of measurements of a laboratory
DAMPED = (0.001, 0.2)  # of the critical damping
MOST_DAMPED = 0.5  # the same of dampers, some of which are made to
MODULI = (1e5, 2e12)  # Pa, from soft gels to diamond
BUILT = (1e9, 1e12)  # Pa, of what frames are made of
CONTRAST = 1000.0  # between the phases
STIFF = {
    r"glass|\w*glas": (3e10, 1.2e11),
    r"steel (fib\w+|wires?|balls?|shot|particles?)|stahlfasern?": (1.5e11, 2.6e11),
    r"ceramics?|alumina|zirconia|silicon carbide|\w*keramik": (5e10, 6e11),
}
"""Words for materials of particles, and what their E is."""
SOFT = {r"epox\w+|\w*resin|polymers?|polyester|\w*harz": (1e8, 1.5e10)}
DRIFTS = (1e-4, 0.1)  # of the storey's height
SHEARS = (0.002, 20.0)  # of the weight of a frame
ANY = (0.0, math.inf)
LIMITS = {"m": (1e-6, 20.0), "m/s": (1e-4, 50.0), "m/s^2": (1e-3, 50.0), "N": (1.0, 1e9)}
DESIGNED = (0.5, 15.0)  # m/s², of records that structures are designed for
PEAKS = (0.003, 30.0)  # m/s², of the ground, from the weakest record to the strongest


def unlikely(case: Case, ground: Accelerogram | None, period: float | None) -> Iterator[str]:
    """Remarks on values of which one has most likely the wrong unit."""
    floors = len(case.frame.masses) if case.sections.frame else 0
    slow = SOFTEST * floors if {"modulus", "image"} & set(case.stages) else max(2, floors) * SLOW[1]
    low, high = max(PERIODS[0], floors * SLOW[0]), min(PERIODS[1], slow if floors else math.inf)
    if period is not None and not low <= period <= high:
        told = f"{part(case)}: a first natural period of {period:.3g} s is unusual for a structure"
        usual = " to ".join(f"{each * floors:.2g}" for each in USUAL)
        more = f"; {floors} storey{'s' * (floors > 1)} usually take {usual} s" * bool(floors)
        yield f"{told}; check the units of masses, lengths, stiffness and moduli{more}"
    if ground is not None:
        yield from unlikely_ground(record_key(case), ground)


def unlikely_ground(key: str, ground: Accelerogram) -> Iterator[str]:
    """A remark on a record whose peak is unusual, with the key that names it."""
    peak = float(abs(ground.acceleration).max())
    if not PEAKS[0] <= peak <= PEAKS[1]:
        told = f"a peak of {peak:.3g} m/s² is unusual for the ground"
        yield f"{key}: {told}; check the unit in its header"


def overdamped(case: Case, wanted: Structure) -> Iterator[str]:
    """A remark on dampers or factors of Rayleigh that hardly let a structure vibrate."""
    from scipy.linalg import eigh

    from alphacut.frame.structures.linear import evaluate

    if wanted.linear is None:
        return
    given = evaluate(wanted.linear, (), np.zeros((1, 0)), derivatives=False)[0]
    squares, shapes = eigh(given.stiffness.value[0], given.mass.value[0])
    ratio = shapes[:, 0] @ given.damping.value[0] @ shapes[:, 0] / (2 * squares[0] ** 0.5)
    if ratio > MOST_DAMPED:
        told = f"the slowest mode is damped by {ratio:.3g} of the critical damping"
        yield f"{part(case)}: {told}, unusual for a structure; check the unit of its damping"


def odd(case: Case) -> Iterator[str]:
    """Remarks on moduli of a structure and on limits that most likely have the wrong unit."""
    from alphacut.frame.structures.quantities import Output

    for one in readings(case):
        if one.unit == "Pa" and one.key.startswith(("frame.", "tower.")):
            yield from unlike(one.key, one.values[0], one.unit, BUILT, "a frame")
        if one.key.startswith("frame.masses"):
            yield from unlike(one.key, one.values[0], one.unit, FLOORS, "a floor")
        width = abs(one.values[-1] - one.values[0]) if one.values else 0.0
        if one.key.startswith(("frame.", "tower.")) and 0 < width < SPREAD * abs(one.values[-1]):
            share = f"{100 * width / abs(one.values[-1]):.2g} %"
            yield f"{one.key}: a width of {share} is unusually small; is its percentage right?"
        for end in one.values[:: len(one.values) - 1 or 1] if "damping_ratio" in one.key else ():
            if one.values[-1] > 0:  # 0 leaves a structure undamped
                yield from unlike(one.key, end, "", DAMPED, "a damping ratio")
    for section, output, value in limits(case):
        height, unit = storey_height(case, output), Output(output).unit
        usual = (DRIFTS[0] * height, DRIFTS[1] * height) if height else LIMITS.get(unit, ANY)
        if unit == "N" and case.sections.frame:
            weight = 9.81 * sum(number.modal for number in case.frame.masses)
            usual = SHEARS[0] * weight, SHEARS[1] * weight
        yield from unlike(f"{section}: the limit of {output}", value, unit, usual, "one")


def strangers(case: Case) -> Iterator[str]:
    """Remarks on values of one storey that are of another order than those of the others."""
    given = case.sections.frame
    for name, (unit, apart) in STOREYS.items() if given else ():
        values = [number.modal for number in getattr(given, name) or ()]
        for storey, value in enumerate(values, start=1):
            middle = median_low(values)
            if not 1 / apart < value / middle < apart:
                told = f"{engineering(value, unit)} is {value / middle:.3g} times the median of"
                yield f"frame.{name} {storey}: {told} all storeys; check its unit"


def unlike(key: str, value: float, unit: str, usual: tuple[float, float], of: str) -> Iterator[str]:
    """A remark on a value outside what is usual."""
    if not usual[0] <= value <= usual[1]:
        yield f"{key}: {engineering(value, unit)} is unusual for {of}; check its unit"


def unlikely_material(case: Case) -> Iterator[str]:
    """Remarks on phases and radii of which one is most likely a slip of the pen."""
    if phases := case.sections.cell:
        named = {"matrix": phases.matrix_modulus, "inclusion": phases.inclusion_modulus}
        for name, modulus in named.items():
            yield from unlike(f"cell.{name}_modulus", modulus.modal, "Pa", MODULI, "a solid")
        ratios = {"matrix": phases.matrix_poisson, "inclusion": phases.inclusion_poisson}
        for name, poisson in ratios.items():
            if poisson.modal < 0:
                told = f"{poisson.modal:g} is unusual for a solid"
                yield f"cell.{name}_poisson: {told}; check its sign"
        ratio = phases.inclusion_modulus.modal / phases.matrix_modulus.modal
        meant = re.search(r"(?i)\b(pore|void|hole|rigid)", case.text_of_file)
        if not 1 / CONTRAST <= ratio <= CONTRAST and not meant:
            yield (
                f"cell: the particle's modulus is {ratio:.3g} times the matrix's; check the units"
                " of both, or name pores or rigid particles in the case's text"
            )
        moduli = {name: modulus.modal for name, modulus in named.items()}
        yield from () if meant else unlike_words(case.words, moduli)
    if (radius := case.sections.radius) and radius.a1.modal > radius.a3.modal:
        yield "radius: a1 is greater than a3, so the radius falls where θ rises; is that meant?"


def between_levels(case: Case, own: Sequence[float]) -> Iterator[str]:
    """Remarks on levels of the motion at which E has no cut of its own, but some at others."""
    if own:
        key = "modulus.alpha" if case.computes_modulus else "modulus.file"
        if missing := [f"{x:g}" for x in case.envelope.alpha if x not in own and len(own) > 1]:
            yield (
                f"envelope.alpha: {key} has no {', '.join(missing)}; there E's wider cut of the"
                f" level below stands in: add what is missing to {key}"
            )
        if case.sections.decision:
            known = ", ".join(f"{x:g}" for x in own)
            yield f"decision: E has cuts at {known}; degrees between two of them stay open"


def unlike_words(words: str, moduli: dict[str, float]) -> Iterator[str]:
    """Remarks on phases that are not what a case says: other moduli, or swapped ones."""
    for pattern, (low, high) in (STIFF | SOFT).items():
        found = re.search(rf"(?i)\b({pattern})\b(?P<matrix>[ -]matrix)?", words)
        if found and not any(low <= value <= high for value in moduli.values()):
            told = " and ".join(f"{name} {engineering(x, 'Pa')}" for name, x in moduli.items())
            span = f"{engineering(low, 'Pa')} to {engineering(high, 'Pa')}"
            yield f"cell: the case says {found[1]!r}, of {span}, and has {told}; check the units"
            continue
        swapped = pattern in STIFF and moduli["inclusion"] < moduli["matrix"]
        if found and swapped and not found["matrix"]:
            told = "the particles are softer than the matrix; are the phases swapped?"
            yield f"cell: the case says {found[1]!r}, and {told}"


def say_unlikely_material(case: Case) -> None:
    """The remarks on material that `check` prints, where a command computes that alone."""
    for remark in unlikely_material(case):
        say(f"warning: {remark}")


def record_key(case: Case) -> str:
    """Key of the record of the ground's motion."""
    return f"{part(case)}.accelerogram"


def part(case: Case) -> str:
    """Section of the structure."""
    return next(iter(structures(case)))
