"""Law of sphere radii from circle radii in a plane section (Wicksell, Biometrika 17, 84, 1925).

A plane hits a sphere of radius R with a chance in proportion to R, and cuts a circle greater than
r with the chance √(1 − r²/R²). With ν the law of the spheres that are hit, S(r) = ∫ √(1 − r²/R²)
dν the share of circles greater than r, known to within the band of Dvoretzky, Kiefer, Wolfowitz
and Massart, bounds every ν by linear inequalities; the least and the greatest distribution function
that they allow are a p-box. Spheres hardly larger than the smallest visible circle almost never
show one, and any number of them may be there: the p-box is of those above a stated radius, and what
lies between is free. Nor does a section exclude a few spheres larger than any circle, which may
hold much of the volume: the largest radius is stated too.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from alphacut.stochastic.errors import RefusedError
from alphacut.stochastic.particles.radius_laws import MeasuredRadii, TabulatedRadii
from alphacut.stochastic.theta.truncated_normal import Array

# power of R from the law of spheres hit to the law by number or by volume
WEIGHTS = {"number": -1.0, "hit": 0.0, "volume": 2.0}
_FREE = 6  # bins between the smallest visible circle and the smallest sphere of the law
_INSIDE = 9  # places in a bin at which its kernels are bounded


@dataclass(frozen=True)
class RadiiPBox:
    """Bounds of the distribution function of sphere radii.

    Args:
        edges: Radii, rising, shape (n + 1,), in m: from the smallest sphere of the law to the
            largest that may be there.
        lower: Least share of spheres up to each radius, shape (n + 1,).
        upper: Greatest share.
        weight: "number", "hit" or "volume".
        level: Chance with which the whole true function lies inside.
    """

    edges: Array
    lower: Array
    upper: Array
    weight: str
    level: float

    @property
    def unknown(self) -> str:
        """Sentence on what no section tells."""
        factor, unit = (1e6, "µm") if self.edges[-1] < 1e-3 else (1e3, "mm")
        low, high = (f"{factor * self.edges[end]:.4g}" for end in (0, -1))
        return (
            f"by {self.weight}, of the spheres between {low} and {high} {unit}: what smaller ones"
            " there are the section does not tell, and larger ones are excluded by assumption"
        )

    def holds(self, radius: ArrayLike, share: ArrayLike) -> bool:
        """True if a distribution function, given at rising radii, lies inside at all edges."""
        truth = np.interp(self.edges, np.asarray(radius), np.asarray(share))
        return bool((truth >= self.lower - 1e-9).all() and (truth <= self.upper + 1e-9).all())


def possible_laws(box: RadiiPBox) -> dict[str, TabulatedRadii]:
    """Four laws at the ends of a p-box by volume: of small, large, like and unlike spheres.

    The least and the greatest distribution function; the one that rises at the median from the
    least to the greatest, and the one that goes from the greatest to the least and is level at one
    half between: no law of the p-box is narrower or wider about that.

    Raises:
        ValueError: The p-box is not one by volume.
    """
    if box.weight != "volume":
        raise ValueError(f"the p-box is one by {box.weight}; laws are made of one by volume")
    middle = box.lower + box.upper >= 1
    ends = {
        "smallest spheres": box.upper,
        "largest spheres": box.lower,
        "most alike": np.where(middle, box.upper, box.lower),
        "least alike": np.clip(0.5, box.lower, box.upper),
    }
    return {name: by_number(box.edges, share, name) for name, share in ends.items()}


def middle_law(circles: ArrayLike, box: RadiiPBox, *, visible: float) -> TabulatedRadii:
    """The law `unfolded` from circles, as far as a p-box of theirs by volume allows it.

    Args:
        circles: Radii of circles greater than `visible`, shape (n,), in m.
        box: Their p-box by volume.
        visible: Radius from which on every circle is seen, in m.
    """
    radii = np.array(unfolded(circles, visible=visible, largest=float(box.edges[-1])).values)
    radii = np.maximum(radii[radii >= box.edges[0]], box.edges[0] * (1 + 1e-12))
    volume = np.concatenate([[0.0], np.cumsum(radii**3)])
    at = volume[np.searchsorted(radii, box.edges, side="right")] / max(volume[-1], 1e-300)
    return by_number(box.edges, np.clip(at, box.lower, box.upper), "unfolded circles")


def by_number(radii: Array, volume: Array, label: str) -> TabulatedRadii:
    """Law by number of a distribution function by volume that is linear between rising radii."""
    fine = np.unique(np.concatenate([np.linspace(*pair, 9) for pair in itertools.pairwise(radii)]))
    number = np.diff(np.interp(fine, radii, volume)) / ((fine[1:] + fine[:-1]) / 2) ** 3
    share = np.concatenate([[0.0], np.cumsum(number)])
    return TabulatedRadii(tuple(fine), tuple(share / share[-1]), label)


def radii_pbox(
    circles: ArrayLike,
    *,
    visible: float,
    smallest: float,
    largest: float,
    weight: str = "volume",
    level: float = 0.95,
    bins: int = 32,
) -> RadiiPBox:
    """P-box of the sphere radii behind the circles of a section.

    Args:
        circles: Radii of circles greater than `visible`, shape (n,), in m.
        visible: Radius from which on every circle is seen, in m.
        smallest: Radius from which on spheres belong to the law, greater than `visible`, in m.
        largest: Radius that no sphere exceeds, in m.
        weight: The law by "number" or "volume" of these spheres, or of those "hit" by the section.
        level: Chance of covering the truth, in (0, 1).
        bins: Steps of the p-box.

    Raises:
        ValueError: A value lies outside its range.
        RefusedError: No law of spheres makes these circles.
    """
    circles = np.asarray(circles, float)
    _require(circles, (visible, smallest, largest), weight, level)
    law = np.geomspace(smallest, largest, bins + 1)
    edges = np.concatenate([np.geomspace(visible, smallest, _FREE + 1)[:-1], law])
    margin = np.sqrt(np.log(2 / (1 - level)) / (2 * len(circles)))
    seen = (circles[None] > edges[:-1, None]).mean(axis=1)
    low, high = np.maximum(seen - margin, 0.0), np.minimum(seen + margin, 1.0)
    least, greatest = _kernels(edges, low, high, WEIGHTS[weight])
    lower, upper = _extremes(np.vstack([least, -greatest]), free=_FREE)
    return RadiiPBox(law, lower, upper, weight, level)


def unfolded(
    circles: ArrayLike, *, visible: float, largest: float, bins: int = 16
) -> MeasuredRadii:
    """One law of sphere radii behind the circles, by number: Saltykov's, by least squares.

    Shares of bins in the law of spheres hit, none negative, whose share of circles greater than r
    is nearest to the circles' own; a `RadiusLaw` for a packing. What the p-box says of its worth
    holds for it too.

    Args:
        circles: Radii of circles greater than `visible`, shape (n,), in m.
        visible: Radius from which on every circle is seen, and the smallest sphere, in m.
        largest: Radius that no sphere exceeds, in m.
        bins: Bins of equal ratio between them.
    """
    from scipy.optimize import nnls

    circles = np.asarray(circles, float)
    edges = np.geomspace(visible, largest, bins + 1)
    middle = np.sqrt(edges[1:] * edges[:-1])
    heights = np.geomspace(visible, largest, 8 * bins + 1)[:-1]
    seen = (circles[None] > heights[:, None]).mean(axis=1)
    kernel = np.sqrt(np.maximum(1 - (heights[:, None] / middle) ** 2, 0.0))
    hit = nnls(kernel / kernel[0], seen)[0] / kernel[0]
    share = np.concatenate([[0.0], np.cumsum(hit / middle)])
    grade = (np.arange(4000) + 0.5) / 4000
    return MeasuredRadii(tuple(np.interp(grade, share / share[-1], edges)), "unfolded circles")


def _require(circles: Array, limits: tuple[float, float, float], weight: str, level: float) -> None:
    """Refuse what makes no section."""
    visible, smallest, largest = limits
    if weight not in WEIGHTS:
        raise ValueError(f"the weight is {weight!r}; it must be one of {', '.join(WEIGHTS)}")
    if not 0 < level < 1:
        raise ValueError(f"the level is {level:g}; it must lie in (0, 1)")
    if circles.size < 10 or not (circles > visible).all() or not visible > 0:
        raise ValueError(
            f"got {circles.size} circles, the smallest of {circles.min(initial=np.inf):g} m; at"
            f" least 10 are needed, all greater than {visible:g} m, and that positive"
        )
    if not visible < smallest < largest < np.inf or not circles.max() < largest:
        raise ValueError(
            f"the smallest sphere is {smallest:g} m, the largest {largest:g} m, circles are seen"
            f" from {visible:g} m and go up to {circles.max():g} m; the first must be greater than"
            " the third, the second greater than all, and finite"
        )


def _kernels(edges: Array, low: Array, high: Array, power: float) -> tuple[Array, Array]:
    """Bounds of K_r − S_high K_0 from below and of K_r − S_low K_0 from above in each bin.

    K_r(R) = √(1 − r²/R²) at the radii r of `edges[:-1]`, K_0 at the smallest of them; both over
    R^power, and over K_0 in the free bins, whose unit is one visible circle. Of the masses η of any
    law in these units Σ lower η ≤ 0 ≤ Σ upper η.

    Returns:
        Shape (n, n) each, by r and bin.
    """
    inside = np.linspace(0, 1, _INSIDE)
    places = edges[:-1, None] + np.diff(edges)[:, None] * inside  # (bins, places)
    kernel = np.sqrt(np.maximum(1 - (edges[:-1, None, None] / places) ** 2, 0.0))
    visible = kernel[0]
    unit = places**power
    unit[:_FREE] = np.where(visible > 0, visible, 1.0)[:_FREE]
    kernel[0, 0, 0] = visible[0, 0] = 1.0  # K_r / K_0 as R falls to the smallest r
    least = ((kernel - high[:, None, None] * visible) / unit).min(axis=-1)
    greatest = ((kernel - low[:, None, None] * visible) / unit).max(axis=-1)
    return least, greatest


def _extremes(constraints: Array, *, free: int) -> tuple[Array, Array]:
    """Least and greatest share up to each edge of a law, constraints η ≤ 0 ≤ η.

    The first `free` bins do not belong to it; those of the others sum up to 1.
    """
    from scipy.optimize import linprog

    bins, own = constraints.shape[1] - free, np.arange(constraints.shape[1]) - free
    scale = abs(constraints).max(axis=1, keepdims=True)
    rows, ends = constraints / np.where(scale > 0, scale, 1.0), np.zeros((2, bins + 1))
    for k in range(1, bins):
        for end, sign in enumerate((1.0, -1.0)):
            cost, whole = sign * ((own >= 0) & (own < k)), (own >= 0).astype(float)[None]
            found = linprog(cost, rows, np.full(len(rows), 1e-12), whole, [1.0])
            if found.status != 0:
                told = "are they of spheres, in a random plane, all above the smallest radius?"
                raise RefusedError(f"no law of spheres makes these circles: {told}")
            ends[end, k] = sign * found.fun
    ends[:, -1] = 1.0
    return np.clip(ends[0], 0, 1), np.clip(ends[1], 0, 1)
