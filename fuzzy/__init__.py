"""Fuzzy inputs through any model: α-cuts, plans of samples, fuzzy results."""

from fuzzy.numbers import Crisp, Cut, FuzzyNumber, Interval, PiecewiseLinear, Trapezoidal, Triangular

__all__ = ["Crisp", "Cut", "FuzzyNumber", "Interval", "PiecewiseLinear", "Trapezoidal", "Triangular"]
