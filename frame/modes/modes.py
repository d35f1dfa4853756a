"""Modes of all structures in a box of inputs, and what they leave open, whoever supplies them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.frame import numbers
from alphacut.frame.calculus.taylor_model import all_on_subbox
from alphacut.frame.modes.intervening import Oscillator
from alphacut.frame.modes.truncated_modes import TruncatedModes
from alphacut.frame.response.oscillators import Oscillators, Source, grid_over


@dataclass(frozen=True, eq=False)
class Modes:
    """Modes over a box, for T time nodes and m outputs.

    An output is the sum of what the oscillators and the truncated modes give, up to what is left
    `open`: coupling in blocks of classical modes, or the error of the polynomials of damped ones.
    """

    time: Array  # time nodes, (T,), in s
    sources: Sequence[Source]  # what moves the oscillators
    orders: Ints  # derivative by time of the oscillators' responses that each output takes, (m,)
    oscillators: list[Oscillator]  # one for each mode that is enclosed as such
    # what is known by sums over modes: truncated ones, and what forces add at once
    truncated: list[TruncatedModes]
    open: Array  # bound of what is left open at the nodes, (T, m)
    # bound of its distance from straight lines between nodes, (T, m)
    open_between: Array

    def at(self, nodes: Ints | slice, outputs: Ints | slice) -> Modes:
        """Return the modes at some nodes and for some outputs."""
        oscillators = [
            replace(mode, participation=mode.participation[:, outputs]) for mode in self.oscillators
        ]
        return Modes(
            time=self.time[nodes],
            sources=self.sources,
            orders=self.orders[outputs],
            oscillators=oscillators,
            truncated=[x.at(nodes, outputs) for x in self.truncated],
            open=self.open[nodes][:, outputs],
            open_between=self.open_between[nodes][:, outputs],
        )

    def on_subbox(self, low: Array, high: Array) -> Modes:
        """Return the modes over the sub-box low ≤ u ≤ high, in its own unit coordinates.

        What is left open stays that of the whole box, which is valid in the sub-box, too.

        Args:
            low: Lower ends, shape (d,), not below −1.
            high: Upper ends, shape (d,), not above 1.
        """
        models = [x for mode in self.oscillators for x in mode.models]
        for modes in self.truncated:
            models += [modes.participation, modes.amplitude]
        restricted = iter(all_on_subbox(models, low, high))  # in the same order
        oscillators = []
        for mode in self.oscillators:
            own_models = [next(restricted) for _ in mode.models]
            oscillators.append(mode.on_subbox(own_models))
        truncated = []
        for modes in self.truncated:
            participation = next(restricted)
            amplitude = next(restricted)
            truncated.append(replace(modes, participation=participation, amplitude=amplitude))
        return replace(self, oscillators=oscillators, truncated=truncated)

    def interpolation_error(self) -> Array:
        """Bound the distance of outputs from a straight line within each time step, shape (T, m).

        Row j belongs to the step that ends at node j. All outputs take displacements.

        Raises:
            UnprovedError: A mode turns too far within a sample interval of a load.
        """
        deviations = []
        for mode in self.oscillators:
            points = (numbers.DEVIATION_POINTS, 3)
            grid = grid_over(mode.omega_range, mode.quotient_range, points)
            oscillators = Oscillators(grid, self.time, (0,))
            deviations.append([oscillators.line_deviation(source, 0) for source in self.sources])
        return self.with_deviations({0: np.array(deviations)})

    def with_deviations(self, deviations: dict[int, Array]) -> Array:
        """Return the same bound from those of the oscillators' responses to unit sources.

        Args:
            deviations: By order of the derivative, shape (modes, sources, T).
        """
        error: Array = self.open_between + sum(x.interpolation_error for x in self.truncated)
        for o, order in enumerate(self.orders):
            of_modes = deviations[int(order)]
            for mode, of_mode in zip(self.oscillators, of_modes, strict=True):
                error[:, o] += mode.participation.magnitude()[:, o] @ of_mode
        return error
