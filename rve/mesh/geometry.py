"""Gmsh geometry of a periodic square cut by discs and their images."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import gmsh
import numpy as np

# half of it is how far a curve's box may be from the side that the curve lies on; Gmsh pads boxes
# by 1e-7
_NEAR = 1e-6


@dataclass(frozen=True)
class PeriodicSquare:
    """The square [low, high]² in Gmsh's current model.

    Args:
        low: Left and lower side.
        high: Right and upper side.
    """

    low: float
    high: float

    def cut(self, discs: Iterable[tuple[float, float, float]]) -> set[int]:
        """Draw the square cut by discs (x, y, r) and images; tags of surfaces inside discs."""
        occ, period = gmsh.model.occ, self.high - self.low
        square = occ.addRectangle(self.low, self.low, 0, period, period)
        circles = []
        for x, y, r in discs:
            for u in (x - period, x, x + period):
                for v in (y - period, y, y + period):
                    if (
                        np.hypot(
                            u - np.clip(u, self.low, self.high), v - np.clip(v, self.low, self.high)
                        )
                        < r
                    ):
                        circles.append((2, occ.addDisk(float(u), float(v), 0, float(r), float(r))))
        parts, _ = occ.intersect(circles, [(2, square)], removeTool=False)
        _, pieces = occ.fragment([(2, square)], parts)
        occ.synchronize()
        return {tag for piece in pieces[1:] for _, tag in piece}

    def bind_sides(self) -> None:
        """Bind each curve of the right and upper sides to its partner on the left and lower ones.

        Raises:
            RuntimeError: Opposite sides have different curves.
        """
        boxes = {tag: gmsh.model.getBoundingBox(1, tag) for _, tag in gmsh.model.getEntities(1)}
        for axis in (0, 1):
            sides = []
            for value in (self.low, self.high):
                on = [
                    t
                    for t, box in boxes.items()
                    if max(abs(box[axis] - value), abs(box[axis + 3] - value)) < _NEAR / 2
                ]
                sides.append(sorted(on, key=lambda t: boxes[t][1 - axis] + boxes[t][4 - axis]))
            if len(sides[0]) != len(sides[1]):
                raise RuntimeError(
                    "opposite sides of the cell are cut by circles differently; a circle grazes a"
                    " side"
                )
            shift = np.eye(4)
            shift[axis, 3] = self.high - self.low
            gmsh.model.mesh.setPeriodic(1, sides[1], sides[0], shift.ravel().tolist())
