"""Stiffnesses from measured modes: boxes, coverage and predictions."""

from alphacut.frame.identify.identify import Identified, Prediction, RefutedError, identify
from alphacut.frame.identify.measured import MeasuredMode, measured_mode

__all__ = ["Identified", "MeasuredMode", "Prediction", "RefutedError", "identify", "measured_mode"]
