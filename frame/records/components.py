"""Components of one record: those of one ground, corrected, and of one length."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from alphacut.base.errors import require
from alphacut.frame.records.history import Accelerogram
from alphacut.frame.records.recording import Baseline, Recording

VERTICAL = 2
"""Index of the vertical component of a record."""


def require_one_ground(components: Sequence[Recording]) -> None:
    """Refuse components of one record with other steps, or with the same samples.

    Raises:
        RefusedError: The step of one differs from that of the first, or all samples agree.
    """
    first, *others = components
    for other in others:
        ends = [f"{x.name} of {len(x.samples)} samples every {x.step:g} s" for x in (first, other)]
        allowed = "components of one step"
        cure = "bring both to one step"
        require(first.step == other.step, "components", " and ".join(ends), allowed, cure)
        is_other = not np.array_equal(first.samples, other.samples)
        require(is_other, "components", f"{first.name} twice", "a file for each component")


def corrected_components(
    components: Sequence[Recording], baseline: Baseline
) -> tuple[Accelerogram, ...]:
    """Return the components of a record after their baseline correction, of one length.

    The third component is the vertical one. Instruments may stop their channels at different times:
    components that are shorter than the longest one end in zeros, which is the last of their
    remarks.
    """
    grounds = [
        recording.accelerogram(baseline, is_vertical=k == VERTICAL)
        for k, recording in enumerate(components)
    ]
    longest = max(len(ground.samples) for ground in grounds)
    for k, ground in enumerate(grounds):
        if missing := longest - len(ground.samples):
            remark = f"ends in {missing} zeros, since it is shorter than another component"
            samples = np.append(ground.samples, np.zeros(missing))
            grounds[k] = replace(ground, samples=samples, remarks=(*ground.remarks, remark))
    return tuple(grounds)
