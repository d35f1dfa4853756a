"""Oscillators of ANSYS' verification manual, with their targets from textbooks.

Units are inch, pound of force and second, so that a mass is in lb s²/in; of VM52 foot, pound of
force and second, and of VM182 metre, kilogram and second. The masses move one way each, from below
q1, q2. A dashpot stands beside a spring. The manual has more targets than are listed.

* *VM45*: a mass of .006477 on a spring of 48.
* *VM52*: a rigid car, mass 100, moment of inertia 1600, on springs of 2400 and 2600, which stand
  4.5 and 5.5 from its centre of mass.
* *VM71*: a mass of .02590673 on a spring of 30, let go from a displacement of 1 (the manual's force
  of 30), with dashpots of 1.76318 (critical), .352636 and 0.
* *VM74*: a mass of .5 on a spring of 200 under an impulse of 10 (the manual's 4000 for .0025 s),
  with dashpots of 0 and 14.
* *VM75*: the same under a force of 200 from t = 0 on, with dashpots of 0 and 10.
* *VM89*: masses of .5 and 1, joined by a spring of 800, and each to a wall by one of 200.
* *VM91*: a pendulum, a mass of .5 on a rod of 100, let go 60 beside and 80 below its pivot under a
  gravity of 386; ux and uy are its way from there; T = 3.28284 is its period there.
* *VM182*: a mass of 2 on a spring of 16, and on it one of 2 by a spring of 6, which a force of 50
  pushes for 1.8 s. The manual counts the masses from above.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from alphacut.frame import Force, History, MatrixStructure, StoreyFrame, pendulum
from alphacut.frame.dynamics.nonlinear import make_flow
from alphacut.frame.structures.linear import LinearSystem
from benchmarks.frame.proved import eigenvalues, mapped, outputs_at
from benchmarks.public.row import Row

NAME = "ANSYS' verification manual: oscillators"
SOURCE = (
    "ansys-mapdl-core 0.74.1 on PyPI, `ansys/mapdl/core/examples/verif/vm45.dat` and so on, the"
    " numbers behind `*VFILL,VALUE`, of VM74 and VM75 `VALUE_1` and `VALUE_2`; they name W. T."
    " Thomson, *Vibration Theory and Applications*, and R. K. Vierck, *Vibration Analysis*"
)
PERIOD = 3.28284
"""Of the pendulum of VM91, in s."""


def oscillator(dashpot: float, *loads: Force) -> StoreyFrame:
    """The mass of .5 on a spring of 200 of VM74 and VM75."""
    return StoreyFrame(masses=[0.5], stiffness=[200.0], dampers=[dashpot], loads=loads)


def let_go(dashpot: float) -> StoreyFrame:
    """The mass of VM71 at its initial displacement."""
    return StoreyFrame(masses=[0.02590673], stiffness=[30.0], dampers=[dashpot], q0=[1.0])


def plane(mass: list[float], stiffness: list[list[float]]) -> MatrixStructure:
    """Two unknowns with their masses and stiffness matrix."""
    terms = ("factor", np.array(stiffness))
    rows = {"first": np.array([1.0, 0.0])}
    return MatrixStructure({"factor": 1.0}, [(1.0, np.diag(mass))], [terms], rows)


def frequencies(case: str, structure: LinearSystem, *published: str) -> Iterator[Row]:
    """Natural frequencies in Hz, from the lowest on."""
    for k, found in enumerate(eigenvalues(structure, len(published))):
        hertz = mapped(np.sqrt, found, 1 / (2 * math.pi))
        yield Row(f"{case}: frequency {k + 1}", published[k], hertz, 7, "Hz")


def displacement(
    case: str, structure: StoreyFrame, time: float, *published: str, cut: float = 0.0
) -> Iterator[Row]:
    """Displacements of all masses at one time, from the lowest on; `cut` is as a `tolerance`."""
    unit = "m" if case == "VM182" else "in"
    remark = "that target is cut after its last digit" if cut else ""
    for number, (name, found) in zip(published, outputs_at(structure, time).items(), strict=True):
        yield Row(f"{case}: {name} at {time:g} s", number, found, 7, unit, cut, remark)


def swing() -> Iterator[Row]:
    """Way of the pendulum from its start to the lowest point and to the other side."""
    steps = 1000  # in a quarter of the period
    swinging = pendulum(
        mass=0.5, length=100.0, damping=0.0, gravity=386.0, phi0=math.atan2(60.0, 80.0)
    )
    flow = make_flow(swinging, (), PERIOD / 2, PERIOD / 4 / steps, "midpoint")
    angle = flow.values(np.zeros((1, 0)))[0][:, swinging.outputs.index("phi")]
    aside, up = 100 * np.sin(angle) - 60, 80 - 100 * np.cos(angle)
    remark = f"midpoint rule, {4 * steps} steps in a period"
    yield Row("VM91: ux at T/4", "-60", float(aside[steps]), 5, "in", remark=remark)
    yield Row("VM91: uy at T/4", "-20", float(up[steps]), 5, "in", remark=remark)
    yield Row("VM91: ux at T/2", "-120", float(aside[-1]), 5, "in", remark=remark)


def rows() -> Iterator[Row]:
    """Enclose frequencies and displacements."""
    yield from frequencies("VM45", StoreyFrame(masses=[0.006477], stiffness=[48.0]), "13.701")
    coupling = 2600 * 5.5 - 2400 * 4.5
    turning = 2400 * 4.5**2 + 2600 * 5.5**2
    car = plane([100.0, 1600.0], [[5000.0, coupling], [coupling, turning]])
    yield from frequencies("VM52", car, "1.0981", "1.4406")
    yield from displacement("VM71, dashpot 1.76318", let_go(1.76318), 0.09, "0.18998")
    yield from displacement("VM71, dashpot .352636", let_go(0.352636), 0.09, "-0.52108", cut=2e-5)
    yield from displacement("VM71, no dashpot", let_go(0.0), 0.09, "-0.99688", cut=1e-5)
    impulse, push = Force(1, 10.0, None), Force(1, 200.0, History.constant())
    yield from displacement("VM74, no dashpot", oscillator(0.0, impulse), 0.08, "0.99957")
    yield from displacement("VM74, no dashpot", oscillator(0.0, impulse), 0.1, "0.90930")
    yield from displacement("VM74, dashpot 14", oscillator(14.0, impulse), 0.1, "0.34180")
    yield from displacement("VM75, no dashpot", oscillator(0.0, push), 0.2, "1.6536")
    yield from displacement("VM75, dashpot 10", oscillator(10.0, push), 0.2, "1.1531")
    chain = plane([0.5, 1.0], [[1000.0, -800.0], [-800.0, 1000.0]])
    yield from frequencies("VM89", chain, "2.5814", "8.3263")
    yield from swing()
    pushed = StoreyFrame(
        masses=[2.0, 2.0],
        stiffness=[16.0, 6.0],
        loads=[Force(2, 50.0, History(1.8, [1.0, 1.0]))],
    )
    yield from displacement("VM182", pushed, 1.3, "3.99", "14.48")
    yield from displacement("VM182", pushed, 2.4, "6.14", "18.32")
