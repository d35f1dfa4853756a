"""Stiffnesses from measured modes: boxes, coverage and predictions."""

from alphacut.frame.identify.identify import Identified, RefutedError, identify
from alphacut.frame.identify.modes import MeasuredMode, measured_mode

__all__ = ["Identified", "MeasuredMode", "RefutedError", "identify", "measured_mode"]
