"""Voltages along a transmission line, within the reachable set of CORA.

Twenty cells, each of an inductance of .1 nH and a resistance of 1 Ω in line, 10 Ω in the first one,
and a capacitance of .4 pF to earth. The voltage at the head of the line is between .99 and 1.01 V.
At the start each voltage is between −.201 and .201 V and each current between −1 and 1 mA, each for
itself. The line is computed as a frame of twenty floors: displacements are the charges through the
cells, masses their inductances, springs the reciprocals of the capacitances, and forces voltages.

CORA encloses all motions in the 50th time step of 1 ps, where also the voltage at the head may vary
in time, resistances by 1 % and capacitances by .25 %. Here is the exact range after 50 ps where all
of these are constant and as stated, by superposition of one proved motion for each start value and
one for the voltage at the head. CORA's range has to hold it.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from alphacut.base.arrays import Array
from alphacut.frame import Force, History, StoreyFrame
from benchmarks.frame.proved import outputs_at
from benchmarks.public.row import Row

NAME = "Transmission line (CORA)"
SOURCE = (
    "CORA, https://github.com/TUMcps/CORA, `unitTests/contDynamics/linParamSys/testLong_"
    "linParamSys_reach_01_rlc_const.m` (`IH_saved`) and `models/Cora/RLCcircuit.m`, of M. Althoff,"
    " B. H. Krogh and O. Stursberg, *Analyzing reachability of linear dynamic systems with"
    " parametric uncertainties*, 2011"
)
CELLS, TIME = 20, 0.05
CAPACITANCE = 4e-4
VOLTAGE, CURRENT = 0.201, 1e-3
PUBLISHED = {
    1: "[0.3474711660292502, 0.9771699932663527]",
    5: "[0.1583635984956000, 1.0690778752260774]",
    10: "[-0.5597831909865391, 0.5836874628735770]",
    20: "[-0.3277805304599952, 0.3277805304602377]",
}
"""Voltage of each cell, in V."""


def motion_after(outputs: tuple[str, ...], **beginning: Any) -> Array:
    """Lower and upper bounds of voltages after 50 ps, shape (outputs, 2).

    Args:
        outputs: Forces of the springs of these cells.
        beginning: `loads`, or `q0` and `v0`, of the frame. Time is in ns, current in A.
    """
    line = StoreyFrame(
        masses=[0.1] * CELLS,
        stiffness=[1 / CAPACITANCE] * CELLS,
        dampers=[1.0] * (CELLS - 1) + [10.0],
        outputs=outputs,
        **beginning,
    )
    return np.array(list(outputs_at(line, TIME, gap=0.1).values()))


def rows() -> Iterator[Row]:
    """Add all motions up."""
    outputs = tuple(f"shear{CELLS + 1 - cell}" for cell in PUBLISHED)
    # A voltage of one cell alone is a drift of its storey: all floors above it are displaced.
    head = motion_after(outputs, loads=[Force(CELLS, 1.0, History.constant())])
    middle, radius = head, 0.01 * np.abs(head).max(axis=1)
    for floor in range(CELLS):
        displaced = (np.arange(CELLS) >= floor) * CAPACITANCE
        by_voltage = motion_after(outputs, q0=displaced)
        by_current = motion_after(outputs, v0=np.eye(CELLS)[floor])
        radius = radius + VOLTAGE * np.abs(by_voltage).max(axis=1)
        radius = radius + CURRENT * np.abs(by_current).max(axis=1)
    for k, (cell, published) in enumerate(PUBLISHED.items()):
        found = (float(middle[k, 0] - radius[k]), float(middle[k, 1] + radius[k]))
        yield Row(f"voltage of cell {cell}", published, found, 6, "V", remark="theirs holds ours")
