"""Stiffnesses from measured modes: boxes, samples, coverage and predictions."""

from alphacut.frame.identify.identify import Identified, Prediction, RefutedError, identify
from alphacut.frame.identify.measured import MeasuredMode, Measurement, measured_mode

__all__ = [
    "Identified", "MeasuredMode", "Measurement", "Prediction", "RefutedError", "identify",
    "measured_mode",
]  # fmt: skip
