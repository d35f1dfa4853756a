"""Fuzzy inputs through any model: α-cuts, plans of samples, fuzzy results."""

from fuzzy.numbers import Cut, FuzzyNumber, Triangular

__all__ = ["Cut", "FuzzyNumber", "Triangular"]
