"""PETSc, started without the option files of the caller's home and folder.

PETSc reads ``~/.petscrc`` when it is first imported, DOLFINx imports it too: import this file
before either. Open MPI's transport for one-sided messages over fabrics, which nothing here sends,
takes a second to look for a fabric when MPI starts; it is left out unless the caller names
transports.
"""

import os

os.environ.setdefault("OMPI_MCA_btl", "^ofi")

import petsc4py

petsc4py.init(["alphacut", "-skip_petscrc"])

from petsc4py import PETSc as PETSc  # noqa: E402
