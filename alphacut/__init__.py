"""The front door: case files, units, command line, stages, report; logs as "alphacut", silently."""

import logging

logging.getLogger(__name__).addHandler(logging.NullHandler())
