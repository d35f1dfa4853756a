"""How far the cuts of an envelope are from lying in one another."""

import numpy as np

from alphacut.frame.envelope import Envelope


def nesting_violation(found: Envelope) -> float:
    """By how much an α-cut leaves the next wider one, at most; 0 when nested."""
    low = np.diff(found.lower, axis=0).min(initial=0.0)
    high = np.diff(found.upper, axis=0).max(initial=0.0)
    return float(max(-low, high, 0.0))
