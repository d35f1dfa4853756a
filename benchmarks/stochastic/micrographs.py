"""Synthetic micrographs of touching and overlapping discs: area fraction and fuzzy E found.

    ./enter python -m benchmarks.stochastic.micrographs --seed 1

Each image shows 200 to 600 discs on a share of 0.2 to 0.6 of its area; three in ten tries put one
against another, two overlap by up to a fifth of the smaller radius; blurred, noisy, particles dark
or bright. The chain of docs/howto/own-particles.md (section image, isotropic average) gets the
picture and its pixel, nothing else. True are the share of the pixels inside a disc, and E of the
very discs, between proved bounds of their fine crisp image, E_i/E_m = 4. Writes micrographs.csv and
fails where more than one image of twenty is missed.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from alphacut.case.load import load
from alphacut.rve.image.solve import solve_image
from alphacut.stages.material import microstructure, modulus
from alphacut.stages.material.campaign import campaign
from alphacut.stochastic.errors import RefusedError
from alphacut.stochastic.microstructure import study
from alphacut.stochastic.microstructure_summary import fragment
from benchmarks.rows import write
from benchmarks.rve.image.cases import moduli_of, phases_of
from benchmarks.stochastic.synthetic_section import Section, micrograph, overlapping_discs

RESULTS = Path(__file__).parents[1] / "results"
CASE = """schema = 1
title = "Discs of a micrograph"
about = "Drawn by benchmarks.stochastic.micrographs."
stages = ["microstructure", "modulus"]
[microstructure]
seed = 1
[microstructure.image]
file = "section.png"
pixel = "1 um"
[cell]
matrix_modulus = "20 GPa"
matrix_poisson = 0.3
inclusion_modulus = "80 GPa"
inclusion_poisson = 0.3
[modulus]
method = "series"
average = "isotropic"
plan = "signed"
alpha = [0, 1]
"""
GPA = 1e9
FRACTION_WITHIN = 0.02  # relative
SHARE_HELD = 0.95
FRACTIONS, COUNTS, RADII = (0.2, 0.615), (200, 600), (10.0, 16.0)


@dataclass(frozen=True)
class Row:
    """One image, fractions of its area and Young's moduli in GPa."""

    number: int
    discs: int
    pixels: int
    fraction: float
    fraction_found: float
    true_low: float
    true_high: float
    chain_low: float
    chain_high: float
    axes_low: float
    axes_high: float
    refused: str

    @property
    def right_fraction(self) -> bool:
        """True if the fraction found is within 2 % of the truth."""
        return abs(self.fraction_found / self.fraction - 1) <= FRACTION_WITHIN

    @property
    def holds(self) -> bool:
        """True if the fuzzy E of the chain overlaps the truth."""
        return self.chain_low <= self.true_high and self.true_low <= self.chain_high

    @property
    def axes_hold(self) -> bool:
        """True if that of eq. 16 does."""
        return self.axes_low <= self.true_high and self.true_low <= self.axes_high


def drawn(generator: np.random.Generator, fraction: float, folder: Path) -> tuple[Section, int]:
    """A section whose image stands in the folder, and the image's side in pixels."""
    count = int(generator.integers(COUNTS[0], COUNTS[1] + 1))
    overlap, spread = generator.uniform(0.05, 0.2), generator.uniform(0.05, 0.3)
    section = overlapping_discs(generator, count, fraction, overlap=overlap, spread=spread)
    size = round(generator.uniform(*RADII) / np.sqrt(fraction / np.pi / count))
    grey = micrograph(
        section.share(size),
        generator,
        dark=bool(generator.random() < 0.5),
        blur=generator.uniform(0.5, 1.5),
        noise=generator.uniform(0.02, 0.15),
    )
    from skimage import io

    io.imsave(folder / "section.png", grey, check_contrast=False)
    (folder / "case.toml").write_text(CASE, encoding="utf-8")
    return section, size


def chain(folder: Path) -> tuple[float, dict[str, tuple[float, float]]]:
    """Area fraction of the image, and supports of E in GPa by each average."""
    case = load(folder / "case.toml")
    found = study(microstructure.study_of(case))
    supports = {}
    for average in ("isotropic", "axes"):
        own = load(folder / "case.toml", [f"modulus.average={average}"])
        own = microstructure.with_radius(own, fragment(found))
        low, high = modulus.compute(campaign(own)).result.bounds("E")
        supports[average] = (float(low[0]) / GPA, float(high[0]) / GPA)
    return float(found.sections[0].read.phase_fraction or 0.0), supports


def judged(number: int, of: int, seed: int, fine: int) -> Row:
    """One image, what the chain makes of it, and the truth."""
    generator = np.random.default_rng([seed, number])
    fraction = FRACTIONS[0] + (FRACTIONS[1] - FRACTIONS[0]) * number / max(1, of - 1)
    with tempfile.TemporaryDirectory() as name:
        section, size = drawn(generator, fraction, Path(name))
        refused, none = "", (np.nan, np.nan)
        try:
            found, supports = chain(Path(name))
        except (ValueError, RefusedError) as error:
            refused, found, supports = str(error), np.nan, {"isotropic": none, "axes": none}
    true = solve_image(*moduli_of(section.mask(fine), phases_of(4.0))).bounds.modulus
    share = float(section.share(size).mean())
    return Row(
        number,
        len(section.radii),
        size,
        share,
        found,
        *true,
        *supports["isotropic"],
        *supports["axes"],
        refused,
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Judge the images; 1 where more than one of twenty is missed."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--images", type=int, default=40, help="number of images (40)")
    parser.add_argument("--seed", type=int, default=1, help="seed of the images (1)")
    parser.add_argument("--fine", type=int, default=512, help="pixels a side of the truth (512)")
    parser.add_argument("--out", type=Path, default=RESULTS, help="folder for the results")
    options = parser.parse_args(arguments)
    rows = []
    for number in range(options.images):
        rows.append(row := judged(number, options.images, options.seed, options.fine))
        print(told(row), flush=True)
    write([vars(row) for row in rows], options.out / "micrographs.csv")
    right, held = (sum(getattr(row, what) for row in rows) for what in ("right_fraction", "holds"))
    farthest = np.nanmax([abs(row.fraction_found / row.fraction - 1) for row in rows])
    width = np.nanmedian([(r.chain_high - r.chain_low) / r.true_low for r in rows])
    print(
        f"area fraction within {FRACTION_WITHIN:.0%} of the truth in {right} of {len(rows)} images,"
        f" farthest {farthest:.2%}\n"
        f"fuzzy E (isotropic average) overlaps the true E in {held} of {len(rows)}, median width"
        f" {width:.1%} of E; by eq. 16 in {sum(row.axes_hold for row in rows)}"
    )
    return 0 if min(right, held) >= SHARE_HELD * len(rows) else 1


def told(row: Row) -> str:
    """One image in a line."""
    if row.refused:
        return f"{row.number:2d}: {row.discs} discs, fraction {row.fraction:.4f}: {row.refused}"
    return (
        f"{row.number:2d}: {row.discs} discs, {row.pixels}² pixels, fraction {row.fraction:.4f},"
        f" found {row.fraction_found:.4f}; E in [{row.true_low:.2f}, {row.true_high:.2f}], chain"
        f" [{row.chain_low:.2f}, {row.chain_high:.2f}]{'' if row.holds else ' MISSED'}, by eq. 16"
        f" [{row.axes_low:.2f}, {row.axes_high:.2f}]{'' if row.axes_hold else ' missed'} GPa"
    )


if __name__ == "__main__":
    sys.exit(main())
