"""Declared errors of envelopes against exact inner bounds, on random frames and on the paper's.

Half of the random frames stand on a record (odd steps, cut ends among them); two to eight storeys,
one to six fuzzy inputs of ±5, ±10 or ±20 %, undamped, with dampers or Rayleigh's damping. All
nodes, outputs and sides are compared. Run `python -m benchmarks.frame.calibration --help`.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from alphacut.frame import Accelerogram, Exact, LinearFlow, StoreyFrame, envelope, pendulum
from alphacut.frame.boxes import UnitFlow, boxes
from alphacut.frame.calculus.jet import Array
from alphacut.frame.methods.auto import ToleranceError
from alphacut.fuzzy import FuzzyNumber, Triangular
from benchmarks.frame.envelopes import FRAME, INPUTS
from benchmarks.frame.pendulum import inputs as pendulum_inputs
from benchmarks.frame.pendulum import missed_and_declared
from benchmarks.frame.references.exact_modes import inner_bounds
from benchmarks.frame.references.swing import Swing, exact_bounds
from benchmarks.frame.references.wide import sixteen
from benchmarks.rows import write

RESULTS = Path(__file__).parents[1] / "results"
ROUNDING = 1e-9
"""Share of an output's peak by which exact trajectories themselves are rounded."""
MANY_STEPS = 20
"""Steps between the nodes of the case of sixteen inputs."""
SWUNG = 6.0
"""Length of the pendulum's motion, in s."""
SMALL = 0.01
"""Share of the tolerance below which errors count as alike where declared is set against true."""


@dataclass(frozen=True, eq=False)
class Case:
    """A structure with fuzzy inputs, and how long and how finely it is followed.

    Args:
        name: For the table.
        frame: The structure.
        inputs: Its fuzzy inputs.
        duration: In s.
        step: Of the nodes, in s.
        alpha: Levels.
    """

    name: str
    frame: StoreyFrame
    inputs: Mapping[str, FuzzyNumber]
    duration: float
    step: float
    alpha: tuple[float, ...]


def around(middle: float, share: float) -> FuzzyNumber:
    """A triangular number, `share` to either side."""
    return Triangular(middle - share * abs(middle), middle, middle + share * abs(middle))


def random_record(rng: np.random.Generator) -> Accelerogram:
    """Noise that swells and fades; one in two is cut before it has faded."""
    step = float(rng.choice([0.02, 0.01, 0.017, 1 / 128]))
    count = int(rng.integers(200, 500))
    end = count if rng.random() < 0.5 else int(0.6 * count)
    swell = np.sin(np.pi * np.arange(count) / (count - 1))
    return Accelerogram(step, (rng.normal(size=count) * swell)[:end])


def random_case(seed: int) -> Case:
    """All of it from `seed`."""
    rng = np.random.default_rng(seed)
    n, damping = int(rng.integers(2, 9)), str(rng.choice(["no", "ground", "storey", "rayleigh"]))
    dampers = damping in ("ground", "storey")
    frame = StoreyFrame(
        rng.uniform(4e3, 3e4, n),
        rng.uniform(2.3, 3.2, n),
        rng.uniform(20e9, 30e9),
        10 ** rng.uniform(-6.3, -4.8),
        rng.uniform(20, 500, n) if dampers else (),
        damping if damping == "storey" else "ground",  # type: ignore[arg-type]
        rng.uniform(-0.1, 0.1, n),
        rng.uniform(-0.5, 0.5, n),
        rayleigh=(rng.uniform(0, 0.2), rng.uniform(0, 2e-3)) if damping == "rayleigh" else (0, 0),
        ground=random_record(rng) if seed % 2 else None,
    )
    names = ["E", *(x for g in ("m", "l", "q0", "v0") for x in frame.group(g))]
    names += frame.group("d") if dampers else ()
    chosen = rng.choice(names, int(rng.integers(1, 7)), replace=False)
    share = float(rng.choice([0.05, 0.1, 0.2]))
    inputs = {str(name): around(frame.parameters[str(name)], share) for name in chosen}
    label = f"{n} storeys, {len(chosen)} inputs ±{share:.0%}, damping {damping}"
    return Case(f"{seed}: {label}{', record' * (seed % 2)}", frame, inputs, 8.0, 0.04, (0.0,))


def named_cases(step: float) -> list[Case]:
    """The paper's frame, and a stiff one with storey dampers, at five levels."""
    light = replace(FRAME, masses=(2e3, 1e3, 500.0), damper_placement="storey")
    levels = (0.0, 0.25, 0.5, 0.75, 1.0)
    cases = []
    for name, frame in (("paper's", FRAME), ("light", light)):
        masses = {f"m{k + 1}": around(m, 0.05) for k, m in enumerate(frame.masses)}
        e = {"E": INPUTS["E"]}
        for fuzzy, inputs in (("E", e), ("m", masses), ("E, m", {**e, **masses})):
            cases.append(Case(f"{name} frame, {fuzzy}", frame, inputs, 30.0, step, levels))
    for share in (0.1, 0.2, 0.5):
        wide = {name: around(FRAME.parameters[name], share) for name in INPUTS}
        cases.append(Case(f"paper's frame ±{share:.0%}", FRAME, wide, 30.0, step, (0.0,)))
    top = replace(FRAME, outputs=("q3",))
    nodes = MANY_STEPS * step  # of q3 alone: sixteen inputs at all nodes would take an hour
    cases.append(Case("paper's frame, sixteen inputs", top, sixteen(), 30.0, nodes, (0.0,)))
    return cases


def references(case: Case, *, samples: int, starts: int, seed: int, nodes: int = 16) -> list[Array]:
    """Inner bounds of every level, each (T, m, 2), of (−output, output)."""
    flow = unit_flow(case)
    return [
        inner_bounds(flow, level, samples=samples, starts=starts, seed=seed, nodes=nodes)
        for level in range(len(case.alpha))
    ]


def unit_flow(case: Case) -> UnitFlow:
    """Exact trajectories of a case."""
    cuts = boxes(case.inputs, case.alpha)
    exact = LinearFlow(case.frame, cuts.names, case.duration, case.step, Exact())
    return UnitFlow(exact, cuts, relative=True)


@dataclass(frozen=True, eq=False)
class Certified:
    """Where a certificate says that the upper bounds of (−output, output) lie.

    Args:
        attained: Values of exact motions, shape (A, T, m, 2).
        proved: What no motion exceeds, same shape.
    """

    attained: Array
    proved: Array

    @classmethod
    def of(cls, case: Case, gap: float) -> Certified | None:
        """By a proof of its own to a relative gap; None where it is not guaranteed."""
        common: dict[str, Any] = {"duration": case.duration, "step": case.step, "relative": True}
        how = {"method": "modal", "certify": gap, "alpha": case.alpha}
        found = envelope(case.frame, case.inputs, **common, **how)
        if found.nature != "guaranteed":
            return None
        assert found.inner_lower is not None
        assert found.inner_upper is not None
        print(f"{case.name}: certificate to {gap:g} in {found.seconds:.0f} s", flush=True)
        attained = np.stack([-found.inner_lower, found.inner_upper], -1)
        return cls(attained, np.stack([-found.lower, found.upper], -1))

    def refuted(self, level: int, given: Array, error: Array) -> int:
        """Number of bounds (T, m, 2) that lie farther from the truth than their error."""
        missed = self.attained[level] > given + error
        too_far = self.proved[level] < given - error
        return int((missed | too_far).sum())


def judged(
    case: Case,
    *,
    samples: int,
    starts: int,
    seed: int,
    nodes: int = 16,
    known: list[Array] | None = None,
    proof: Certified | None = None,
    **options: Any,
) -> dict[str, Any]:
    """Compare one envelope with inner bounds: errors in shares of the outputs' modal peaks."""
    begun, clock = time.process_time(), time.perf_counter()
    common: dict[str, Any] = {"duration": case.duration, "step": case.step, "alpha": case.alpha}
    try:
        found = envelope(case.frame, case.inputs, relative=True, **common, **options)
    except ToleranceError as refusal:
        return {"case": case.name, "method": f"refused: {refusal}"}
    seconds, wall = time.process_time() - begun, time.perf_counter() - clock
    flow = unit_flow(case)
    if known is None:
        known = references(case, samples=samples, starts=starts, seed=seed, nodes=nodes)
    assert found.error is not None
    ratio, wrong, outside, refuted = [], 0.0, 0, 0
    least = SMALL * float(options.get("tolerance", 1e-3))
    for level in range(len(case.alpha)):
        inner = known[level]
        given = np.stack([-found.lower[level], found.upper[level]], -1)
        missed = (inner - given) / flow.scale[:, None]
        error = (found.error[level] / flow.scale)[..., None]
        wrong = max(wrong, float(missed.max()))
        outside += int((missed > error + ROUNDING).sum())
        if proof is not None:
            own = (error + ROUNDING) * flow.scale[:, None]
            refuted += proof.refuted(level, given, own)
        told = np.abs(missed) <= np.maximum(error, least)  # a reference further short says nothing
        shares = np.maximum(error, least) / np.maximum(np.abs(missed), least)
        ratio.append(shares[told])
    return {
        "case": case.name,
        "method": found.method,
        "error": wrong,
        "declared": float((found.error / flow.scale).max()),
        "values": found.lower.size * 2,
        "above_declared": outside + refuted,
        "certified": proof is not None,
        "median_declared_over_true": float(np.median(np.concatenate(ratio))),
        "share_with_reference": sum(map(len, ratio)) / (found.lower.size * 2),
        "seconds": seconds,
        "wall_seconds": wall,
        "reference_seconds": time.process_time() - begun - seconds,
    }


def measured(
    cases: list[Case], tolerances: list[float], gap: float, **effort: Any
) -> Iterator[dict[str, Any]]:
    """One row per case and tolerance of `auto`; a tolerance that is refused is no broken one.

    Where a certificate to a positive gap can be had, its proof judges the bounds as well.
    """
    for case in cases:
        known = references(case, **effort)
        proof = Certified.of(case, gap) if gap > 0 else None
        for tolerance in tolerances:
            own: dict[str, Any] = {"known": known, "proof": proof, "tolerance": tolerance}
            row = judged(case, method="auto", **own, **effort)
            if "error" not in row:
                print(f"{case.name}; auto at {tolerance:g}: {row['method']}", flush=True)
                yield {"tolerance": tolerance, **row, "kept": ""}
                continue
            kept = row["error"] <= tolerance and not row["above_declared"]
            print(
                f"{case.name}; auto at {tolerance:g}: error {row['error']:.1e}, declared"
                f" {row['declared']:.1e} by {row['method']}, {row['above_declared']} of"
                f" {row['values']} above it, median ratio"
                f" {row['median_declared_over_true']:.2g} of"
                f" {row['share_with_reference']:.0%}, {row['seconds']:.1f} +"
                f" {row['reference_seconds']:.1f} s{'' if kept else '  BROKEN'}",
                flush=True,
            )
            yield {"tolerance": tolerance, **row, "kept": kept}


def swung(
    tolerances: list[float], *, step: float, samples: int, seed: int
) -> Iterator[dict[str, Any]]:
    """One row per tolerance for the pendulum, judged by attained bounds of its exact motion."""
    low, high = np.array([number.cut(0) for number in pendulum_inputs("narrow").values()]).T
    inner = exact_bounds(low, high, SWUNG, step, samples=samples, seed=seed)
    modal = Swing(low, high, step, len(inner)).values(np.zeros((1, len(low))))
    for tolerance in tolerances:
        yield _swing(inner, float(np.abs(modal).max()), tolerance, step)


def _swing(inner: Array, peak: float, tolerance: float, step: float) -> dict[str, Any]:
    """The pendulum's row of a tolerance, printed too."""
    row: dict[str, Any] = {"case": "pendulum", "tolerance": tolerance}
    begun = time.process_time()
    how: dict[str, Any] = {"method": "auto", "integrator": "composition4", "relative": True}
    over: dict[str, Any] = {"duration": SWUNG, "step": step, "alpha": (0.0,)}
    try:
        found = envelope(pendulum(), pendulum_inputs("narrow"), tolerance=tolerance, **how, **over)
    except ToleranceError as refusal:
        print(f"pendulum; auto at {tolerance:g}: refused: {refusal}", flush=True)
        return row | {"method": f"refused: {refusal}", "kept": ""}
    missed, error = (share / peak for share in missed_and_declared(found, inner))
    above = int((missed > error + ROUNDING).sum())
    kept = bool(missed.max() <= tolerance and not above)
    print(
        f"pendulum; auto at {tolerance:g}: error {missed.max():.1e}, declared"
        f" {error.max():.1e} by {found.method}, {above} of {missed.size} above it"
        f"{'' if kept else '  BROKEN'}",
        flush=True,
    )
    return row | {
        "method": found.method,
        "error": float(missed.max()),
        "declared": float(error.max()),
        "values": missed.size,
        "above_declared": above,
        "seconds": time.process_time() - begun,
        "kept": kept,
    }


def main() -> None:
    """Measure, print, write; exit status 1 where a tolerance or a declared error is broken."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--first", type=int, default=0, help="first seed (0)")
    parser.add_argument("--frames", type=int, default=100, help="number of random frames (100)")
    parser.add_argument(
        "--tolerance", type=float, nargs="+", default=[1e-3], help="relative (1e-3)"
    )
    parser.add_argument("--named", action="store_true", help="the named frames instead")
    parser.add_argument("--step", type=float, default=0.05, help="nodes of the named, s (0.05)")
    parser.add_argument("--samples", type=int, default=3000, help="of each reference (3000)")
    parser.add_argument("--starts", type=int, default=8, help="polished per bound (8)")
    parser.add_argument("--nodes", type=int, default=16, help="polished nodes of each (16)")
    parser.add_argument("--only", default="", help="named cases whose name holds this")
    parser.add_argument(
        "--certify", type=float, default=0.0, help="relative gap of certificates that judge too"
    )
    o = parser.parse_args()
    seeds = range(o.first, o.first + o.frames)
    cases = named_cases(o.step) if o.named else [random_case(seed) for seed in seeds]
    cases = [case for case in cases if o.only in case.name]
    effort = {"samples": o.samples, "seed": o.first + 1}
    rows = list(measured(cases, o.tolerance, o.certify, starts=o.starts, nodes=o.nodes, **effort))
    if o.named and o.only in "pendulum":
        rows += swung(o.tolerance, step=o.step, **effort)
    told = [row for row in rows if row["kept"] != ""]
    print(
        f"{sum(row['kept'] for row in told)} of {len(told)} kept, {len(rows) - len(told)} refused;"
        f" {time.process_time():.0f} s of processor time"
    )
    fields = dict.fromkeys(key for row in rows for key in row)
    filled = [{key: row.get(key, "") for key in fields} for row in rows]
    write(filled, RESULTS / f"frame_calibration{'_named' if o.named else ''}.csv")
    raise SystemExit(any(row["kept"] is False for row in told))


if __name__ == "__main__":
    main()
