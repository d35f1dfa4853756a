"""A mark for tests of compiled code, which are skipped where there is no compiler."""

import pytest

from alphacut.frame.calculus.c_library import c_library

NONE = c_library("int one(void) { return 1; }\n") is None
compiled = pytest.mark.skipif(NONE, reason="no compiler, or ALPHACUT_KERNEL forbids its code")
