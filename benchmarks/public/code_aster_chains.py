"""Chains of masses and springs of the French guide of validation, as code_aster tests them.

*SDLD02*: eight masses of 10 kg in a row between two walls, joined by nine springs of 100 kN/m.

*SDLD04*: three masses of 1 kg on each other by springs of 1 kN/m, at rest, whose base accelerates
by 2·10⁵ m/s⁴ t². It is taken here every .1 ms and linear between, which the bounds are of.
Displacements are relative to the base.

*SDLD27*: the chain of SDLD02 with dashpots along its springs, of 250 N s/m at one wall, 25 at the
other and 50 between. The numbers are code_aster's own; those of the guide have three or four digits
and differ by up to .13 % in damping. An eigenvalue λ has the frequency Im λ / 2π and the damping
ratio −Re λ / |λ|.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from alphacut.base.arrays import Array
from alphacut.frame import Accelerogram, MatrixStructure, StoreyFrame
from alphacut.frame.boxes import boxes
from alphacut.frame.identification.modes import chain_modes
from alphacut.frame.modes.damped import DampedModes, DampedStructure
from benchmarks.frame.proved import eigenvalues, mapped, outputs_at
from benchmarks.public.row import MINUS, Row

NAME = "Chains of the validation guide (code_aster)"
SOURCE = (
    "code_aster, https://github.com/ralic/Code_Aster, `astest/sdld02a.comm` (`PARA = 'FREQ'`),"
    " `astest/sdld04a.comm` (`PARA = 'FREQ'` and `N04_DX_1`) and `astest/sdld27a.comm` (`VALE_CALC`"
    " of `FREQ` and `AMOR_REDUIT`); they name the guide VPCS of the SFM"
)
FREQUENCIES = (
    "5.5274",
    "10.8868",
    "15.9155",
    "20.4606",
    "24.3840",
    "27.5664",
    "29.9113",
    "31.3474",
)
THREE = ("2.239", "6.275", "9.069")
ACCELERATED = (
    (0.02, "-0.0027"),
    (0.04, "-0.0426"),
    (0.05, "-0.1041"),
    (0.06, "-0.2158"),
    (0.08, "-0.6813"),
    (0.1, "-1.658"),
)
"""Time in s and displacement of the third mass in m."""
DAMPED = (
    ("5.5291472398111", "0.015208962368362"),
    ("10.895926802498", "0.028757520349640"),
    ("15.926969742083", "0.039564458857692"),
    ("20.452303555733", "0.047033824290880"),
    ("24.335490536469", "0.050916778"),
    ("27.487121646", "0.051764645"),
    ("29.835124901424", "0.051084392063134"),
    ("31.294832374407", "0.050296429"),
)
"""Frequencies in Hz and damping ratios of the modes of SDLD27."""


def between_walls(values: Array) -> Array:
    """Matrix of nine springs, or dashpots, in a row between two walls, shape (8, 8)."""
    inner = values[1:-1]
    return np.diag(values[:-1] + values[1:]) - np.diag(inner, 1) - np.diag(inner, -1)


def row_of_eight(dashpots: Array | None = None) -> MatrixStructure:
    """The chain between two walls."""
    return MatrixStructure(
        {"mass": 10.0},
        [("mass", np.eye(8))],
        [(1.0, between_walls(np.full(9, 1e5)))],
        {"first": np.eye(8)[0]},
        damping=[] if dashpots is None else [(1.0, between_walls(dashpots))],
    )


def damped_eigenvalues(structure: MatrixStructure) -> Array:
    """Eigenvalues λ with Im λ > 0, by rising magnitude, in 1/s."""
    box = boxes({"mass": 10.0}, (0.0,))
    model = DampedStructure.over_box(structure, box, order=1)
    return DampedModes.of_structure(model, np.arange(structure.size)).eigenvalue.value


def closed_form(tower: StoreyFrame, time: float) -> float:
    """q3 of SDLD04 by the sum of its modes, in m."""
    squares, shapes = chain_modes(np.array(tower.stiffness), np.array(tower.masses))
    waves = time**2 - 2 / squares * (1 - np.cos(np.sqrt(squares) * time))
    return float(-(shapes[2] * shapes.sum(axis=0) * 2e5 / squares) @ waves)


def rows() -> Iterator[Row]:
    """Enclose frequencies and displacements."""
    chain = row_of_eight()
    for k, found in enumerate(eigenvalues(chain, len(FREQUENCIES))):
        hertz = mapped(np.sqrt, found, 1 / (2 * math.pi))
        yield Row(f"SDLD02: frequency {k + 1}", FREQUENCIES[k], hertz, 7, "Hz")
    times = np.arange(1001) * 1e-4
    tower = StoreyFrame(
        masses=[1.0] * 3,
        stiffness=[1e3] * 3,
        ground=Accelerogram(1e-4, 2e5 * times**2),
        outputs=("q3",),
    )
    for k, found in enumerate(eigenvalues(tower, len(THREE))):
        hertz = mapped(np.sqrt, found, 1 / (2 * math.pi))
        # The first two are cut after their last digit.
        cut = (2e-4, "cut after its last digit") if k < 2 else ()
        yield Row(f"SDLD04: frequency {k + 1}", THREE[k], hertz, 7, "Hz", *cut)
    for time, published in ACCELERATED:
        found = outputs_at(tower, time)["q3"]
        exact = f"{closed_form(tower, time):.6f}".replace("-", MINUS)
        remark = f"that file allows 1 % and more; for t² itself the sum of modes is {exact} m"
        yield Row(f"SDLD04: q3 at {time:g} s", published, found, 6, "m", 7e-4, remark)
    damped = damped_eigenvalues(row_of_eight(np.array([250.0] + [50.0] * 7 + [25.0])))
    for k, (value, published) in enumerate(zip(damped.tolist(), DAMPED, strict=True)):
        hertz = value.imag / (2 * math.pi)
        yield Row(f"SDLD27: frequency {k + 1}", published[0], hertz, 10, "Hz", 1e-9, "rounding")
        ratio = -value.real / abs(value)
        yield Row(f"SDLD27: damping ratio {k + 1}", published[1], ratio, 8, "", 1e-7, "rounding")
