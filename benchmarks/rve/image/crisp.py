"""Both proved bounds of one image: width, time, memory, and how they go with contrast and size.

Each run is a process of its own, as a user's would be; processor time stands beside wall time,
since other work on the machine lengthens the latter only.
"""

from __future__ import annotations

import argparse
import resource
import subprocess
import sys
import time
from collections.abc import Sequence

from alphacut.rve.image.fields.conjugate_gradient import ConjugateGradient
from alphacut.rve.image.model import ImageModel
from alphacut.rve.image.phase_images import ModuliImages
from alphacut.stages.image.reading import ACCURACY
from benchmarks.rve.image.cases import discs, moduli_of, noise, phases_of

RUNS = [  # picture, pixels a side, contrast, parts of a pixel: 0 as the command takes by itself
    ("discs", 512, 4.0, 0),
    ("discs", 512, 100.0, 0),
    ("discs", 256, 4.0, 1),
    ("discs", 512, 4.0, 1),
    ("discs", 1024, 4.0, 1),
    ("discs", 256, 100.0, 1),
    ("discs", 1024, 100.0, 1),
    ("noise", 512, 4.0, 0),
    ("noise", 512, 100.0, 0),
]


def one(picture: str, size: int, contrast: float, division: int, seed: int) -> None:
    """Print what one run gives."""
    mask = discs(size, seed=seed) if picture == "discs" else noise(size, seed=seed) > 0.5
    began, spent = time.perf_counter(), time.process_time()
    bulk, shear = moduli_of(mask, phases_of(contrast))
    settings = ImageModel(division=division or None, solver=ConjugateGradient(ACCURACY))
    model, cut = settings.refined(ModuliImages((bulk, bulk), (shear, shear), attained=True))
    found = cut.solution
    assert found is not None
    wall, processor = time.perf_counter() - began, time.process_time() - spent
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    pixels = size * size * model.parts**2
    print(
        f"{picture} {size}² contrast {contrast:g}, pixels divided by {model.parts}: "
        f"width {found.bounds.width:.2e}, "
        f"iterations {found.upper.iterations} and {found.lower.iterations}, "
        f"solve {wall:.1f} s wall, {processor:.1f} s processor "
        f"({1e6 * processor / pixels:.1f} µs a pixel), {memory:.2f} GB"
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the list, or the one run named."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--one", nargs=4, metavar=("PICTURE", "SIZE", "CONTRAST", "PARTS"))
    parser.add_argument("--runs", type=int, default=len(RUNS), help="only the first so many")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args(arguments)
    if options.one:
        picture, size, contrast, division = options.one
        one(picture, int(size), float(contrast), int(division), options.seed)
        return 0
    for run in RUNS[: options.runs]:
        command = [sys.executable, "-m", "benchmarks.rve.image.crisp", "--seed", str(options.seed)]
        began = time.perf_counter()
        subprocess.run([*command, "--one", *map(str, run)], check=True)
        print(f"    the whole process: {time.perf_counter() - began:.1f} s", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
