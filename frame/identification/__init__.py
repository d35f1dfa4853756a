"""Stiffnesses from measured modes: boxes, coverage and predictions."""
