"""Numbers of the frame's methods that were tuned: they decide time and width, never validity.

Each has its reason; a test halves and doubles them and sees the same bounds hold.
"""

WIDE = 0.1
"""Gap of a peak, as a fraction of it, above which bounds elsewhere are worth little either: all
nodes are bounded anew on its halves. Peaks lie within a few per cent where the models are good."""
GRACE = 8
"""Boxes that are bounded before the progress of a gap counts: the first bisections of several
inputs close little."""
MIN_GAP_PROGRESS = 0.8
"""A gap is left where it has fallen by less than this fraction of an even fall over all boxes."""
GAP_POWER = 3.0
"""Power of the inputs' widths with which gaps fall at least; remainders are of fourth degree."""
NARROWED = 0.5
"""Fractions pruned from all inputs, in sum, from which a box is bounded anew, not bisected."""
