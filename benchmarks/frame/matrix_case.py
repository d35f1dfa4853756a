"""Writes a structure from matrices as a case: a TOML file and a folder of its arrays."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.io import mmwrite
from scipy.sparse import coo_array

from alphacut.frame import MatrixStructure, Output
from alphacut.frame.structures.loads import Factor
from alphacut.fuzzy.arrays import Array

DIGITS = 12
"""Significant digits of an entry, so that files do not differ by round-off."""


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
        lines += [f'damping_ratio = "{self.quantities["zeta"]}"'] * ("zeta" in self.quantities)
        lines += ["", "[matrices.parameters]"]
        lines += [f'{name} = "{text}"' for name, text in self.quantities.items() if name != "zeta"]
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
    """A factor as a text.

    Raises:
        TypeError: It is a function, which no file holds.
    """
    if callable(factor):
        raise TypeError("a factor is a function, which no file holds")
    return factor if isinstance(factor, str) else f"{factor:.{DIGITS}g}"
