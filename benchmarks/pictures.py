"""The pictures of README and documentation, each with the command that draws it.

    ./enter python -m benchmarks.pictures          copies those that runs of cases draw

`make charts` runs all of these commands.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
OF_RUNS = {
    "docs/pictures/envelope.png": ("paper", "fig33-envelope-E-m-30s-q3.png"),
    "docs/pictures/prism-mesh.png": ("paper", "fig15-prism-mesh.png"),
    "docs/pictures/modulus.png": ("paper-3d", "modulus.png"),
}
"""Case and figure of each picture that a run of a case draws."""
COMMANDS = {
    "benchmarks/results/one_shape.png": "python -m benchmarks.rve.one_shape",
    "benchmarks/results/costs.png": "python -m benchmarks.costs",
    "benchmarks/results/frame_envelopes.png": "python -m benchmarks.frame.envelopes",
    "benchmarks/results/frame_integrators.png": "python -m benchmarks.frame.integrators",
    "benchmarks/results/mesh_bounds.png": "python -m benchmarks.rve.mesh_bounds --seed 4131833150",
    "benchmarks/results/voxels.png": "python -m benchmarks.rve.voxels --chart",
    "cases/composite.png": "python cases/make_composite.py",
    "docs/pictures/tomogram.png": "xvfb-run -a python cases/make_tomogram.py --picture",
    **dict.fromkeys(OF_RUNS, "python -m benchmarks.pictures"),
}
"""Command below `./enter` of each picture; VTK needs a display, which ``xvfb-run`` lends it."""


def main() -> None:
    """Run the cases of `OF_RUNS`, draw the figures of the paper alone, and copy their pictures."""
    for case in dict.fromkeys(case for case, _ in OF_RUNS.values()):
        words = ["run", f"cases/{case}.toml", f"--out=results/{case}", "--workers=2"]
        subprocess.run([sys.executable, "-m", "alphacut", *words], cwd=ROOT, check=True)
    subprocess.run([sys.executable, "cases/paper_figures.py"], cwd=ROOT, check=True)
    for picture, (case, figure) in OF_RUNS.items():
        shutil.copyfile(ROOT / "results" / case / "figures" / figure, ROOT / picture)


if __name__ == "__main__":
    main()
