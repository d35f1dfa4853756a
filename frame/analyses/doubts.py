"""Doubts about a structure and its loads: sizes that betray a wrong unit, and what is left out.

A doubt is a sentence, and no error: what is unusual need not be wrong.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.number_text import STANDARD_GRAVITY, percent_text
from alphacut.frame.analyses.peaks import WIDENING
from alphacut.frame.analyses.suites import nominal_mode, short_record_warnings
from alphacut.frame.boxes import AT_REST
from alphacut.frame.dynamics.flow import LinearFlow
from alphacut.frame.dynamics.integrators import Exact
from alphacut.frame.result import within_steps
from alphacut.frame.structures.linear import LinearSystem, NominalModes, evaluate, histories
from alphacut.frame.structures.matrix import MatrixStructure
from alphacut.frame.structures.storey import StoreyFrame, yields
from alphacut.frame.verification.step_error import node_deviation

MAX_RATIO = 300.0
"""Ratio of two storeys from which a prefix of a unit is doubted: wrong prefixes k, M and G are
factors of a thousand and more, while an isolator is some 50 times softer than a storey."""
TALLEST = 100.0
"""Height in m from which the unit of a storey is doubted, ten times that of a tall one."""


class Doubt(NamedTuple):
    """A doubt about a frame: the argument that has it, or none, and what is said of it."""

    argument: str
    words: str


def storey_doubts(
    frame: StoreyFrame, supports: Mapping[str, tuple[float, float]] | None = None
) -> Iterator[Doubt]:
    """Yield a doubt for each number of an unusual size and each weight left out (P-Delta).

    Doubtful are masses, lengths, second moments, stiffnesses or yield forces of two storeys that
    differ more than 300-fold, a storey above 100 m, and starts, yield points and gravity far from
    those of buildings. Weights are not judged if gravity is part of the frame.

    Args:
        frame: The frame at its nominal values.
        supports: Lower and upper ends of its parameters in SI units, by name; None to judge no
            weight, as while the modulus of the columns is unknown.
    """
    weight = STANDARD_GRAVITY * sum(frame.masses)
    for key in ("masses", "lengths", "second_moment", "stiffness", "yield_force"):
        given = getattr(frame, key)
        sizes = np.ravel(1.0 if given is None else given)
        if key == "yield_force":
            # A storey that is to stay elastic has a force that no motion reaches, such as 1 GN.
            sizes = sizes[sizes < 10 * weight]
        ratio = sizes.max() / sizes.min() if sizes.size else 1.0
        if ratio > MAX_RATIO:
            yield Doubt(key, f"of two storeys differ {ratio:,.0f}-fold: is a unit wrong?")
    tallest = max(frame.lengths, default=5.0)  # m, a guess without heights
    if tallest > TALLEST:
        yield Doubt("lengths", f"has a storey of {tallest:g} m: is its unit right, m or mm?")
        return
    yield from _size_doubts(frame, tallest, weight)
    of_columns = ("shear", "base_shear", "overturning_moment")
    shears = [x for x in frame.outputs if x.rstrip("0123456789") in of_columns]
    if shears and any(frame.dampers):
        what = "forces of the columns, without those of the dampers, which act on storeys"
        yield Doubt("", f"{', '.join(shears)}: {what} and foundation, too")
    if frame.lengths and supports is not None and not frame.gravity:
        # The coefficients are the largest in the supports of all parameters: if they are small,
        # the weights may be left out at every value that the inputs may have.
        yield from _weight_doubts(frame.stability_coefficients(supports), frame, supports)


def _size_doubts(frame: StoreyFrame, height: float, weight: float) -> Iterator[Doubt]:
    """Yield a doubt for each start, yield drift, yield force or gravity of an unusual size.

    Args:
        frame: The frame.
        height: Height of the tallest storey in m, or a guess.
        weight: Weight of all floors in N.
    """
    drift = np.abs(np.diff(frame.q0, prepend=0.0)).max()
    # storeys stand drifts of some 5 % of their height, and yield below 2 %
    if drift > height / 4:
        yield Doubt("q0", f"shear a storey by {drift:.3g} m: is a unit wrong?")
    largest = max(frame.yield_drift, default=0.0)
    if largest > height / 4:
        yield Doubt("yield_drift", f"is up to {largest:.3g} m: is its unit right?")
    fraction = max(frame.yield_force, default=np.inf) / weight
    # even isolators slide at some 2 % of the weight above them
    if fraction < 0.002:
        what = f"is at most {fraction:.2g} of the weight: is its unit right?"
        yield Doubt("yield_force", what)
    if frame.gravity > 2 * STANDARD_GRAVITY:
        yield Doubt("gravity", f'is {frame.gravity:g} m/s^2: write "1 g" or "9.81 m/s^2"')


def _weight_doubts(
    coefficients: Array, frame: StoreyFrame, supports: Mapping[str, tuple[float, float]]
) -> Iterator[Doubt]:
    """Yield a doubt for each storey whose weight should not be left out.

    Args:
        coefficients: Weight over stiffness and height of each storey, shape (floors,), the largest
            that the inputs allow. From 1 on the storey buckles: then, and if all are below 1e-5, a
            unit is doubted. Each storey between 0.1 and 1 has its own sentence, and so has each
            storey that yields and of whose hardening the weight takes much.
        frame: The frame.
        supports: Ends of its parameters by name.
    """
    lightest = 1e-5  # buildings have coefficients above 1e-4
    largest = coefficients.max()
    unit = "are the units of stiffness, masses and lengths right?"
    cure = 'say frame.gravity = "1 g"'
    if largest >= 1:
        what = f"the weight on storey {coefficients.argmax() + 1} is up to {largest:.3g} times"
        yield Doubt("", f"{what} its stiffness times its height, and would buckle it: {unit}")
    elif largest < lightest:
        what = f"weights over stiffness and height of storeys are below {lightest:g}"
        yield Doubt("", f"{what}: {unit}")
    for z, coefficient in enumerate(coefficients, start=1):
        if coefficient > 0.1 and largest < 1:  # below it EN 1998-1, 4.4.2.2, neglects P-Delta
            what = f"weight over stiffness and height of storey {z} is up to {coefficient:.2g}"
            yield Doubt("", f"{what}: {cure}, so that drifts grow by it (P-Delta)")
    for z, coefficient in enumerate(coefficients[: len(frame.hardening)], start=1):
        left = supports[f"hardening{z}"][0]
        if left < 1 and coefficient > left / 4:  # tuned: drifts may grow by a third
            what = f"storey {z} yields to {left:.2g} of its stiffness, and its weight takes up to"
            yield Doubt("", f"{what} {coefficient:.2g} (P-Delta): {cure}")


def direction_doubts(model: MatrixStructure) -> Iterator[str]:
    """Yield a sentence on two horizontal directions that are no motions of one ground.

    They are at right angles where ι₁ᵀ M ι₂ = 0 for the influence vectors ι, and move the same mass.
    """
    if not model.components:
        return
    matrices, _ = evaluate(model, (), np.zeros((1, 0)), derivatives=False)
    _, second_pattern = model.components[0]
    patterns = np.array([model.pattern, second_pattern])
    moved = patterns @ matrices.mass.value[0] @ patterns.T
    first, second = map(float, moved.diagonal())
    doubt = "is a sign wrong, or an unknown missing?"
    if abs(moved[0, 1]) > 1e-6 * np.sqrt(first * second):
        yield f"the first two are not at right angles: {doubt}"
    elif abs(first - second) > 1e-6 * max(first, second):
        yield f"the first two move {first:,.0f} kg and {second:,.0f} kg: {doubt}"


def mode_doubts(modes: NominalModes, *, is_shaken: bool) -> Iterator[str]:
    """Yield a sentence on a first period, and on damping ratios, that structures do not have.

    Args:
        modes: Undamped modes by rising frequency, at the most plausible values.
        is_shaken: Whether the ground moves. The structure is then taken for a building, whose
            first period is longer than that of a part of a machine.
    """
    first = float(modes.periods[0])
    # Parts of machines have periods of some 1 ms, one-storey buildings 0.05 s, the highest towers
    # 10 s.
    shortest = 0.02 if is_shaken else 1e-3
    if not modes.frequencies[0]:
        yield "a mode has no stiffness within rounding: are units right, and all parts joined?"
    elif not shortest <= first <= 10.0:
        what = f"{first:.4g} s is an unusual period"
        yield f"{what}: are units right, mass and stiffness not exchanged?"
    # a mode without stiffness has no damping ratio
    largest = float(modes.damping_ratios.max(where=modes.frequencies > 0, initial=0.0))
    # ratios of structures are .1 to 60 %, of an undamped one below the rounding of 1e-12
    if largest > 1 or 1e-12 < largest < 1e-5:
        doubt = "are units of dampers, damping matrices and rayleigh factors right?"
        yield f"damping ratios are up to {largest:.2g} of critical: {doubt}"


def load_doubts(linear: LinearSystem, duration: float) -> Iterator[str]:
    """Yield a sentence on each load that does not begin or end as the response does.

    These are a load whose first step is longer than the response, a record that is shorter than
    half the first period or that goes on after the response, and a force that is not zero where
    its samples end, before the response does: it jumps to zero there.

    Args:
        linear: The structure with its loads.
        duration: Length of the response, in s.
    """
    for name, history in histories(linear).items():
        samples = history.samples
        length = history.step * (len(samples) - 1)
        end = history.start + length
        # Such a history acts as one straight line. This happens if its times are in another unit,
        # such as ms.
        if len(samples) > 2 and history.step > duration:
            what = f"{name}: the motion ends before the second sample, at {history.step:g} s"
            yield f"{what}: are its times in another unit than s?"
        if history is linear.ground:
            # The modes are needed only for a record that ends before the response does.
            if length < duration:
                period = nominal_mode(linear).period
                yield from short_record_warnings("the record", length, period)
            if end > duration * (1 + 1e-9):
                yield f"the record lasts {end:g} s, and the motion is computed for {duration:g} s"
            continue
        # Records and measured forces fade away: 1 % of the largest value is no jump (tuned). The
        # last value of a history that `is_held` stays on, so that it does not jump either.
        last = float(abs(samples[-1]))
        largest, _ = history.extremes
        is_jump = last > 0.01 * largest and not history.is_held
        if is_jump and end < duration * (1 - 1e-9):
            fraction = percent_text(last / largest)
            yield (
                f"{name} ends at {end:g} s with {fraction} of its largest value, and"
                f" is 0 from then on, while the motion is computed for {duration:g} s: let its file"
                " last as long, or end with 0"
            )


def step_doubts(linear: LinearSystem, duration: float, step: float) -> Iterator[str]:
    """Yield a sentence for each output whose peak may rise by over 1 % between time nodes.

    The peak, and what responses add to it between nodes, are computed for the most plausible
    structure. Where columns yield, peaks of accelerations alone are read at the nodes, so that only
    they are judged, by the response with the initial stiffness.

    Args:
        linear: A linear structure, or a frame that yields.
        duration: Length of the response, in s.
        step: Distance of the nodes, in s.

    Raises:
        FailedError: The response could not be computed.
    """
    has_events = yields(linear)
    if has_events:
        read_at_nodes = [name for name in linear.outputs if linear.unit_of(name) == "m/s^2"]
        if not read_at_nodes:
            return
        linear = linear.with_outputs(read_at_nodes).elastic()
    flow = LinearFlow(linear, (), duration, step, Exact(), by_modes=False)
    nominal = np.zeros((1, 0))  # the one structure without fuzzy inputs
    at_nodes = np.abs(flow.values(nominal)[0]).T  # (outputs, times)
    between = node_deviation(flow, nominal).T  # what each step may add, of the same shape
    # The peak of a structure at rest is rounding alone. It is replaced by AT_REST, a billionth, of
    # `reach`: the size that the energy of the response allows, shape (outputs,).
    peaks = np.maximum(at_nodes.max(axis=1), AT_REST * flow.reach())
    # If nothing moves at all, peaks are 0, and the ratio of 1 says that nothing is widened.
    farthest = within_steps(at_nodes, between).max(axis=1)
    widening = np.divide(farthest, peaks, out=np.ones_like(peaks), where=peaks > 0) - 1
    for name, fraction in zip(linear.outputs, widening, strict=True):
        if fraction <= WIDENING:
            continue
        if has_events:
            by_how_much = f"by about {fraction:.1%}" if fraction < 1 else "altogether"
            what = f"the step of {step:g} s is too coarse: its peak may be missed"
            yield f"{name}: {what} {by_how_much} between nodes"
        else:
            # This is the deviation of one structure. A bound over wide inputs may contain several
            # times as much, which only its computation tells.
            what = f"between time nodes {step:g} s apart the most plausible structure may add"
            bound = "a bound over all inputs may contain several times as much"
            yield f"{name}: {what} {fraction:.1%} to its peak; {bound}"
