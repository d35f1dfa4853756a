"""Stiffnesses from measured modes: boxes, coverage and predictions."""

from alphacut.frame.identify.identify import Identified, RefutedError, identify
from alphacut.frame.identify.learned import LearnedInputs, Prediction, Predictions
from alphacut.frame.identify.modes import MeasuredMode, measured_mode
from alphacut.frame.identify.read_modes import read_modes

__all__ = [
    "Identified", "LearnedInputs", "MeasuredMode", "Prediction", "Predictions", "RefutedError",
    "identify", "measured_mode", "read_modes",
]  # fmt: skip
