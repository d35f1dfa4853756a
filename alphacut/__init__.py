"""The front door of alphacut: case files, units, command line, stages, report."""

import sys
from importlib.util import LazyLoader, find_spec, module_from_spec

import numpy


def _load_when_used(name: str) -> None:
    """Put off a module of NumPy that SciPy names and does not use: half of SciPy's loading time."""
    spec = find_spec(f"numpy.{name}")
    if spec is None or spec.loader is None or spec.name in sys.modules:
        return
    spec.loader = LazyLoader(spec.loader)
    module = sys.modules[spec.name] = module_from_spec(spec)
    spec.loader.exec_module(module)
    setattr(numpy, name, module)


for _name in ("f2py", "testing"):
    _load_when_used(_name)
