"""Random radius: the p-box (Fig. 13), the cone over θ (Fig. 14)."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING, Any

import numpy as np

from alphacut.case.material import RadiusMap
from alphacut.figures.style import GREY, INK, PURPLE, figure
from alphacut.fuzzy.arrays import Array
from alphacut.stochastic import HermiteMap

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def maps(section: RadiusMap, alpha: float) -> list[HermiteMap]:
    """The radius maps at the corners of an α-cut."""
    numbers = section.numbers
    corners = itertools.product(*(sorted(set(one.cut(alpha))) for one in numbers.values()))
    return [section.at(dict(zip(numbers, corner, strict=True))) for corner in corners]


def modal_map(section: RadiusMap) -> HermiteMap:
    """The radius map at the modal values."""
    return section.at({name: one.modal for name, one in section.numbers.items()})


def distribution(radius: HermiteMap, at: Array) -> Array:
    """P(r ≤ at) under the law of θ."""
    law = radius.distribution
    theta = np.linspace(law.lower, law.upper, 4001)
    radii, mass = radius((theta[1:] + theta[:-1]) / 2), np.diff(law.cdf(theta))
    order = np.argsort(radii, kind="stable")
    share = np.cumsum(mass[order]) - mass[order] / 2
    return np.asarray(np.interp(at, radii[order], share, left=0.0, right=1.0))


def p_box(section: RadiusMap) -> Figure:
    """Fig. 13: lower, upper and modal distribution of r_n over the fuzzy slopes."""
    drawn, axes = figure()
    corners = maps(section, 0.0)
    low = min(radius.extremes()[0] for radius in corners)
    high = max(radius.extremes()[1] for radius in corners)
    at = np.asarray(np.linspace(low, high, 600), float)
    family = np.array([distribution(radius, at) for radius in corners])
    axes.fill_between(
        at, family.min(0), family.max(0), color=PURPLE, alpha=0.15, lw=0, label="p-box, α = 0"
    )
    axes.plot(at, family.min(0), color=INK, lw=1)
    axes.plot(at, family.max(0), color=INK, lw=1)
    axes.plot(at, distribution(modal_map(section), at), color=PURPLE, lw=1.8, label="modal map")
    axes.set_xlabel("reduced radius r$_n$ = r/a")
    axes.set_ylabel("cumulative distribution")
    axes.set_ylim(0, 1.02)
    axes.legend(loc="lower right")
    return drawn


def cone(section: RadiusMap) -> Figure:
    """Fig. 14: the particle in the product domain, of radius r(θ) at every θ."""
    import matplotlib.pyplot as plt

    drawn = plt.figure(figsize=(5.0, 5.4))
    axes: Any = drawn.add_subplot(projection="3d")
    radius = modal_map(section)
    theta, angle = np.linspace(*section.theta, 80), np.linspace(0, 2 * np.pi, 80)
    r = radius(theta)[:, None]
    axes.plot_surface(
        r * np.cos(angle),
        r * np.sin(angle),
        np.broadcast_to(theta[:, None], (80, 80)),
        color=PURPLE,
        alpha=0.65,
        lw=0,
    )
    for level in np.linspace(theta[0], theta[-1], 5):
        axes.plot([-1, 1, 1, -1, -1], [-1, -1, 1, 1, -1], level, color=GREY, lw=0.8)
        axes.plot(
            radius(level) * np.cos(angle), radius(level) * np.sin(angle), level, color=INK, lw=0.8
        )
    for x, y in itertools.product((-1, 1), (-1, 1)):
        axes.plot([x, x], [y, y], [theta[0], theta[-1]], color=GREY, lw=0.8)
    axes.set_xlabel("x$_1$/a")
    axes.set_ylabel("x$_2$/a")
    axes.set_zlabel("θ")
    axes.set_xticks([-1, 0, 1])
    axes.set_yticks([-1, 0, 1])
    axes.set_box_aspect((1, 1, 1.3), zoom=0.88)
    axes.view_init(elev=18, azim=-55)
    return drawn
