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

TABLE_SPACING = 0.07
"""Distance of the points of a mode's table along ω and g, as a fraction of its decay."""
PATIENCE = 12
"""Subgradient steps without a third of the expected fall of D after which less is expected."""
ASCENTS = 6
"""Most steps of the model's ascent from one point; with 20 peaks of 13 inputs are 0.01 % lower."""
CELL_GRACE = 8
"""Cells of a node after which the fall of its gap counts."""
MIN_CELL_PROGRESS = 0.5
"""The effort for a node ends where its gap has fallen by less than this fraction of an even fall
to what suffices."""
EXPECTED_CUBIC = 0.5
"""Fraction of the cubic parts' sizes that is expected of their sum, in which they partly cancel."""

PRUNING_CELLS, PRUNING_STEPS = 24, 40
"""Most cells of a bound over an end of an input's range, and evaluations of D for each."""
LEAST_PEAK_BISECTIONS = 48
"""Most bisections of cells; three times as many raise the bounds of six storeys by 2 %."""
LEAST_PEAK_NODES, LEAST_PEAK_STEPS, LEAST_PEAK_PATIENCE = 4, 40, 5
"""Nodes that are tried in a cell, evaluations of D for each, and `PATIENCE` of them: they begin at
multipliers of a cell before, so that twice as many steps raise the bounds by less than 0.1 %."""
LEAST_PEAK_DESCENTS = 3
"""Steps of the descent over corners to a motion that peaks low."""
PEAK_CELLS, PEAK_STEPS = 240, 40
"""Most cells of a bound above a peak over a sub-box, and evaluations of D for each."""
CELLS_ABOVE_PEAK = 3
"""Multiple of the cells that nodes are worth whose bounds lie above the peak; twice as many lower
peaks of 13 inputs by 0.05 %."""
FIRST_CELLS = 6
"""Most cells of a node before those with the highest bounds alone get more, where these alone
count; four times as many lower peaks of 13 inputs by less than 0.02 %."""
REMAINDER_MULTIPLE, REMAINDER_MULTIPLE_AT_PEAKS = 1.0, 0.25
"""Multiples of the remainders' own part of a bound below which no gap is worth any effort."""
TRUNCATION = 0.1
"""Fraction of a gap that modes may take which are not enclosed."""

MAX_ERROR_FRACTION = 0.2
"""Fraction of the gap that the error of the modal model may take on either side."""
LEFT_OUT_MODES = 1 / 120
"""Fraction of the gap that modes may be worth that are left out; their energy counts as error."""
BOXES_OF_INPUT = 4.0
"""Factor by which one more input multiplies the boxes of a branch and bound, about."""
FIRST_DEGREE, MAX_DEGREE = 3, 20
"""Degrees of the modal model that are tried."""
MAX_TERMS = 3100
"""Monomials of a polynomial: degree 13, 10 and 8 of 4, 5 and 6 inputs."""
FIRST_DECAY = 0.1
"""Factor by which a degree more multiplies the error, before any is seen."""
DEGREE_CAUTION = 0.8
"""Fraction of the degrees that the errors ask for which is taken at once."""
DEVIATION_POINTS = 24
"""Points along ω of each mode at which its straying from lines between nodes is read."""
NEWTON_GAP = 0.02
"""Fraction of the gap that Newton's method may leave."""
NEWTON_SAMPLES = 256
"""Trajectories of the model that the first optima begin at."""
NEWTON_PIECE = 6000
"""Most problems solved together, of six inputs; more would leave the cache."""
NEWTON_LOCAL_STEPS = 6
"""Newton steps by local maxima of the quadratic models; problems that need more lie on ridges, and
their models are maximised over all faces of the box."""
NEWTON_RADIUS = 0.4
"""First radius of the trust region, in unit coordinates."""
NEWTON_SOUND = 0.1
"""Relative error of a predicted gain up to which the radius grows five times in place of twice."""
NEWTON_STEPS = 300
"""Newton steps after which a problem that has not converged is left as it is."""
