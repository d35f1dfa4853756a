"""PETSc, started without the option files of the caller's home and folder.

PETSc reads ``~/.petscrc`` when it is first imported, DOLFINx imports it too: import this file
before either.
"""

import petsc4py

petsc4py.init(["alphacut", "-skip_petscrc"])

from petsc4py import PETSc as PETSc  # noqa: E402
