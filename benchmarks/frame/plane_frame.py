"""Plane frames on soil springs from their members' matrices, as a frame program makes them.

Bays and storeys of beam elements with consistent masses; the feet stand on springs. The
inputs are the soil's stiffness, Young's modulus of columns and of beams, and the floors' masses.

Run `python -m benchmarks.frame.plane_frame --help`; the shipped case comes from

    python -m benchmarks.frame.plane_frame --bays 1 --storeys 2 --write cases/plane-frame.toml
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.io import mmwrite
from scipy.sparse import coo_array

from alphacut.base.arrays import Array
from alphacut.frame import MatrixStructure, Output
from alphacut.frame.records.history import Accelerogram
from alphacut.frame.structures.loads import Factor
from benchmarks.synthetic_record import SyntheticRecord

SPAN, HEIGHT = 6.0, 3.2
"""Span of a beam and height of a storey, in m."""
COLUMN, BEAM = (0.16, 2.1e-3), (0.18, 5.4e-3)
"""Area (m²) and second moment (m⁴) of a column and of a beam."""
MODULUS, DENSITY = 30e9, 2500.0
SOIL = 1.2e8, 1.5e8, 6e7
"""Springs under a foot: horizontal and vertical, in N/m, and rotational, in N m."""
FLOOR = 60e3
"""Mass of a floor, in kg."""
DIGITS = 12
"""Significant digits of an entry in a file, so that files do not differ by round-off."""


def element(length: float, area: float, inertia: float) -> tuple[Array, Array]:
    """Stiffness and consistent mass of a beam along x: (u, w, φ) of both ends."""
    a, b = MODULUS * area / length, MODULUS * inertia / length**3
    c, m = length, DENSITY * area * length
    stiffness, mass = np.zeros((6, 6)), np.zeros((6, 6))
    bending = [1, 2, 4, 5]
    stiffness[np.ix_([0, 3], [0, 3])] = a * np.array([[1, -1], [-1, 1]])
    stiffness[np.ix_(bending, bending)] = b * np.array(
        [
            [12, 6 * c, -12, 6 * c],
            [6 * c, 4 * c * c, -6 * c, 2 * c * c],
            [-12, -6 * c, 12, -6 * c],
            [6 * c, 2 * c * c, -6 * c, 4 * c * c],
        ]
    )
    mass[np.ix_([0, 3], [0, 3])] = m / 6 * np.array([[2, 1], [1, 2]])
    mass[np.ix_(bending, bending)] = (m / 420) * np.array(
        [
            [156, 22 * c, 54, -13 * c],
            [22 * c, 4 * c * c, 13 * c, -3 * c * c],
            [54, 13 * c, 156, -22 * c],
            [-13 * c, -3 * c * c, -22 * c, 4 * c * c],
        ]
    )
    return stiffness, mass


def turned(matrix: Array, *, upright: bool) -> Array:
    """An element's matrix in the coordinates of the frame."""
    half = np.array([[0, 1.0, 0], [-1.0, 0, 0], [0, 0, 1.0]]) if upright else np.eye(3)
    turn = np.kron(np.eye(2), half)
    return np.asarray(turn.T @ matrix @ turn)


def plane_frame(bays: int, storeys: int, ground: Accelerogram) -> MatrixStructure:
    """A frame of 3 (bays + 1)(storeys + 1) unknowns, with springs under its feet."""
    columns, rows = bays + 1, storeys + 1
    n = 3 * columns * rows
    parts = {name: np.zeros((n, n)) for name in ("Ec", "Eb", "ks", "members")}
    floors = [np.zeros((n, n)) for _ in range(storeys)]

    def place(i: int, j: int) -> int:
        return 3 * (j * columns + i)

    def add(first: int, second: int, name: str) -> None:
        upright = name == "Ec"
        length, section = (HEIGHT, COLUMN) if upright else (SPAN, BEAM)
        stiffness, mass = element(length, *section)
        at = np.ix_(*[[first, first + 1, first + 2, second, second + 1, second + 2]] * 2)
        parts[name][at] += turned(stiffness, upright=upright)
        parts["members"][at] += turned(mass, upright=upright)

    for j in range(rows):
        for i in range(columns):
            if j:
                add(place(i, j - 1), place(i, j), "Ec")
                weight = (1.0 if 0 < i < bays else 0.5) / bays
                for axis in (0, 1):
                    floors[j - 1][place(i, j) + axis, place(i, j) + axis] = weight
                if i:
                    add(place(i - 1, j), place(i, j), "Eb")
    for i in range(columns):
        parts["ks"][[place(i, 0) + k for k in range(3)], [place(i, 0) + k for k in range(3)]] = SOIL
    roof, pattern, moment = np.zeros(n), np.zeros(n), np.zeros(n)
    roof[place(0, storeys)], pattern[::3] = 1.0, 1.0
    ends = [*range(place(0, 0), place(0, 0) + 3), *range(place(0, 1), place(0, 1) + 3)]
    moment[ends] = turned(element(HEIGHT, *COLUMN)[0], upright=True)[2]
    parameters = {"Ec": 1.0, "Eb": 1.0, "ks": 1.0, "zeta": 0.04}
    parameters |= {f"m{j + 1}": FLOOR for j in range(storeys)}
    return MatrixStructure(
        parameters,
        [(1.0, parts["members"]), *((f"m{j + 1}", mass) for j, mass in enumerate(floors))],
        [(name, parts[name]) for name in ("Ec", "Eb", "ks")],
        {Output("roof", "m"): roof, Output("moment", "N*m"): moment},
        ground=ground,
        pattern=pattern,
        ratios=("zeta",),
        row_factors={"moment": "Ec"},
    )


SECTIONS = """[records]
files = ["{records}"]
baseline = "mean"

[envelope]
fuzzy = ["Ec", "Eb", "ks"]
alpha = [0, 1]
duration = "{duration}"
step = "0.02 s"

[decision]
limits = ["roof <= {roof}", "moment <= {moment}"]

[fragility]
limits = ["roof <= {roof}"]
measure = "PGA"
"""
"""Other sections of the case that `--write` makes."""


@dataclass(frozen=True)
class MatrixCase:
    """A case of a structure whose factors are numbers and names of parameters.

    Args:
        title: Title of the case.
        structure: The structure.
        unknowns: Names of its unknowns, NODE.DIRECTION.
        quantities: Each parameter as a text, such as "1 ± 5 %".
        direction: Direction of the ground.
        sections: Text of all other sections.
    """

    title: str
    structure: MatrixStructure
    unknowns: Sequence[str]
    quantities: Mapping[str, str]
    direction: str
    sections: str

    def write(self, path: Path) -> None:
        """Writes the case, and its arrays into a folder of the same name."""
        folder = path.with_suffix("")
        folder.mkdir(parents=True, exist_ok=True)
        of, names = self.structure, ", ".join(f'"{name}"' for name in self.unknowns)
        lines = [f'title = "{self.title}"', 'stages = ["envelope"]', "", "[matrices]"]
        lines += [f"unknowns = [{names}]"]
        for kind in ("mass", "stiffness", "damping"):
            terms = [
                f'["{_factor(factor)}", "{self._array(folder, f"{kind}{k}", array)}"]'
                for k, (factor, array) in enumerate(getattr(of, kind), start=1)
            ]
            lines += [f"{kind} = [{', '.join(terms)}]"] * bool(terms)
        lines += [f'direction = "{self.direction}"']
        quantities = dict(self.quantities)
        if ratio := quantities.pop("zeta", ""):
            lines += [f'damping_ratio = "{ratio}"']
        lines += ["", "[matrices.parameters]"]
        lines += [f'{name} = "{text}"' for name, text in quantities.items()]
        lines += ["", "[matrices.outputs]", *(self._row(name) for name in of.outputs)]
        path.write_text("\n".join([*lines, "", self.sections]), encoding="utf-8")

    def _array(self, folder: Path, name: str, array: Array) -> str:
        mmwrite(folder / f"{name}.mtx", coo_array(array), precision=DIGITS)
        return f"{folder.name}/{name}.mtx"

    def _row(self, name: Output) -> str:
        row = self.structure.observed[name]
        entries = ", ".join(
            f'"{self.unknowns[k]}" = {float(f"{row[k]:.{DIGITS}g}")!r}' for k in np.flatnonzero(row)
        )
        factor = _factor(self.structure.row_factors.get(name, 1.0))
        return f'{name} = {{ row = {{ {entries} }}, unit = "{name.unit}", factor = "{factor}" }}'


def _factor(factor: Factor | str | float) -> str:
    """A factor as a text; a function is none."""
    assert not callable(factor)
    return factor if isinstance(factor, str) else f"{factor:.{DIGITS}g}"


def case_of(frame: MatrixStructure, bays: int, soil: float, **texts: str) -> MatrixCase:
    """A case of the frame under a suite; `texts` are those of `SECTIONS`."""
    ends = [f"{node + 1}.{axis}" for node in range(frame.size // 3) for axis in "xyr"]
    quantities = {"Ec": "1 ± 5 %", "Eb": "1 ± 10 %", "ks": f"1 ± {soil:.0%}", "zeta": "4 %"}
    quantities |= {name: "60 t" for name in frame.parameters if name[0] == "m"}
    title = f"Plane frame, bays: {bays}, from the matrices of its members"
    return MatrixCase(title, frame, ends, quantities, "x", SECTIONS.format(**texts))


def main() -> None:
    """Write the frame under synthetic records as a case."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bays", type=int, default=3)
    parser.add_argument("--storeys", type=int, default=4)
    parser.add_argument("--soil", type=float, default=0.25, help="half width of the soil's factor")
    parser.add_argument("--write", metavar="CASE.toml", type=Path, required=True)
    given = parser.parse_args()
    record = SyntheticRecord(duration=10.0, step=0.01)
    ground = Accelerogram(record.step, np.asarray(record.acceleration()))
    frame = plane_frame(given.bays, given.storeys, ground)
    texts = {"records": "suite/record-200[1-3].AT2", "duration": "6 s"}
    texts |= {"roof": "40 mm", "moment": "350 kN m"}
    case_of(frame, given.bays, given.soil, **texts).write(given.write)


if __name__ == "__main__":
    main()
