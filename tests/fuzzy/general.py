"""Propagation with the general plan where a test names none: its samples are known beforehand."""

import alphacut.fuzzy
from alphacut.fuzzy import General

GENERAL = General()


def propagate(function, inputs, plan=GENERAL, **options):
    """`alphacut.fuzzy.propagate`."""
    return alphacut.fuzzy.propagate(function, inputs, plan, **options)
