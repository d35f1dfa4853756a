"""The front door of alphacut: case files, units, command line, stages, report."""
