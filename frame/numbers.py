"""Tuned numbers of the proofs of this room.

They decide how long a proof takes and how wide its bounds are, never whether the bounds hold:
`tests/frame/test_numbers.py` halves and doubles each of them and checks the same bounds. Each says
what a larger number would do. Numbers that only say how long attained values are searched for, or
how work is forecast, stand where they are used.
"""

# Branch and bound over boxes of inputs (`bounds.spatial_branch_and_bound`).

WIDE = 0.1
"""Gap of a peak, as a fraction of the peak, above which all nodes of a sub-box are bounded anew
after a bisection, because bounds elsewhere are worth little either. A larger number saves time and
leaves wider bounds below the peaks. Peaks lie within a few per cent where the models are good."""
GRACE = 8
"""Sub-boxes of a peak that are bounded before the progress of its gap is judged. A larger number
spends more time on hopeless gaps; a smaller one gives up too early, because the first bisections of
several inputs close little."""
MIN_GAP_PROGRESS = 0.8
"""Fraction of an even fall of the gap over all sub-boxes below which a gap is left as it is. A
larger number gives up earlier."""
GAP_POWER = 3.0
"""Power of the widths of the inputs with which gaps are taken to fall. The remainders fall with the
fourth power; a larger number expects more of bisections and gives up later."""
NARROWED = 0.5
"""Sum over the inputs of the pruned fractions of a box from which on the rest is bounded anew
instead of being bisected. A larger number bisects more often."""

# The dual bound (`bounds.box`, `bounds.level`, `bounds.node_bounds`).

TABLE_SPACING = 0.07
"""Distance of neighbouring points of the table of a mode along ω and g, as a fraction of the decay
of the mode. A larger number makes tables smaller and bounds wider."""
PATIENCE = 12
"""Subgradient steps without a third of the expected fall of the dual function after which less is
expected. A larger number takes more steps for slightly lower bounds."""
ASCENTS = 6
"""Largest number of steps of an ascent of the model from one point. With 20 the peaks of 13 inputs
are 0.01 % lower."""
CELL_GRACE = 8
"""Cells of a node after which the fall of its gap is judged, as `GRACE` for sub-boxes."""
MIN_CELL_PROGRESS = 0.5
"""Fraction of an even fall of the gap of a node, to the gap that suffices, below which its effort
ends. A larger number ends it earlier."""
EXPECTED_CUBIC = 0.25
"""Sum of the cubic parts over the sum of their magnitudes that is expected: they partly cancel.
With 1 they are not expected to cancel at all."""

PRUNING_CELLS, PRUNING_STEPS = 24, 40
"""Largest numbers of cells of a bound over an end of the range of an input, and of evaluations of
the dual function for each cell. Larger numbers prune a little more in more time."""
LEAST_PEAK_BISECTIONS = 48
"""Largest number of bisections of cells for the smallest peak. Three times as many raise the bounds
of six storeys by 2 %."""
LEAST_PEAK_NODES, LEAST_PEAK_STEPS, LEAST_PEAK_PATIENCE = 4, 40, 5
"""Nodes that are tried in a cell, evaluations of the dual function for each of them, and their
`PATIENCE`. The evaluations begin at the multipliers of an earlier cell, so that twice as many steps
raise the bounds by less than 0.1 %."""

PEAK_CELLS, PEAK_STEPS = 240, 40
"""Largest numbers of cells of a bound above a peak over a sub-box, and of evaluations for each
cell. Larger numbers close gaps by cells that bisections of the inputs close faster."""

REMAINDER_MULTIPLE, REMAINDER_MULTIPLE_AT_PEAKS = 1.0, 0.25
"""Gaps that are not worth any effort, as multiples of what the remainders add to a bound, below and
at peaks. Larger numbers save time and leave wider gaps."""
TRUNCATION = 0.1
"""Fraction of a gap that the modes may take that are not enclosed. A larger number encloses fewer
modes and leaves less of the gap to the search."""

# The modal model and branch and bound over it (`methods.proof`, `bounds.branch_and_bound`).

MAX_ERROR_FRACTION = 0.2
"""Fraction of the gap that the error of the modal model may take on either side. A larger number
needs a lower degree and leaves less of the gap to the search."""
LEFT_OUT_MODES = 0.1
"""Fraction of the wanted error of a modal model that modes may contribute that are left out. Their
energy counts as error; a larger number leaves out more modes and increases the error."""

FIRST_DEGREE, MAX_DEGREE = 3, 20
"""Smallest and largest degree of the modal model. A larger first degree is wasted on narrow boxes;
beyond the largest one rounding dominates."""

DEVIATION_POINTS = 24
"""Points along ω of each mode at which its distance from straight lines between the nodes is
computed, at least. More narrow the bound between the nodes slightly."""
DEVIATION_DISTANCE = 0.1
"""Largest distance of these points over the decay of a mode that turns by more than 1 rad in a
step, up to three times as many points. More cost time in proportion."""
NEWTON_GAP = 0.02
"""Fraction of the gap that Newton's method may leave. A larger number saves steps and leaves less
of the gap to the search."""
