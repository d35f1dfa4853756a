"""The front door of alphacut: case files, units, command line, stages, report.

Counts, iterations and the reasons why a proof gave up go to the logger "alphacut", which is silent
unless a handler is added to it.
"""

import logging

logging.getLogger(__name__).addHandler(logging.NullHandler())
