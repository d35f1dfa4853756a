"""Settings of the searches of α-cuts. They decide accuracy and cost, and were tuned."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class SearchSettings:
    """Tuned numbers of `CutSearch`, `SingleLinkage` and `Automatic`.

    Lengths are fractions of the width of an α-cut. Slopes are in ranges of the output over the
    width of the cut, where the range of an output is that of all samples.
    """

    seed: int = 0
    """Seed of all samples, so that a search finds the same bounds each time."""
    min_samples: int = 100
    """Samples N of a cut from which the rule of Boender and Rinnooy Kan decides: with fewer samples
    the uniform prior does. Twice as many double the cost of smooth outputs."""
    max_uncovered: float = 0.002
    """Expected fraction of a cut in basins that were not seen, up to which a search goes on. A
    larger one takes fewer samples, N ~ √(W (W + 1) / fraction), and misses more optima."""
    value_tolerance: float = 1e-5
    """Difference, over the range of the output in the widest cut, below which two values count as
    one. It is also the declared error of an estimate; a larger one merges different optima."""
    rounding: float = 1e-9
    """The same over the magnitude of the output, for outputs that hardly vary."""
    tie: float = 1e-13
    """Difference of two samples, over the magnitude of the output, that puts them on a plateau. A
    larger one takes gentle slopes for plateaus."""
    max_on_plateaus: int = 1000
    """Samples on plateaus with which the search of a bound ends. Of uniform ones this many find a
    cone of 0.3 % of the plateaus with a probability of 95 %."""
    careful_first_step: float = 0.1
    """First step of a descent that shall not leave the basin of its start; longer ones pass over
    humps."""

    difference: float = 1e-6
    """Step of a difference quotient during a descent. Larger ones lose last digits of optima."""
    large_difference: float = 1e-4
    """The same at the end of a descent, where models that are solved to 1e-8 have such noise. A
    larger one takes curvature for a kink."""
    max_slope: float = 0.01
    """Slope up to which an optimum is smooth. Larger ones accept stalls at kinks and jumps."""

    max_searched_outputs: int = 12
    """Outputs up to which `Automatic` searches each bound; the cost is proportional to them."""
    walk_points: int = 20
    """Points of `Automatic` along its walk, and along each staircase of several inputs. Of 6,000
    trends with a wave, jumps or humps beside them, 2,700 kept their signs at these points, and of
    these 1 exceeded its corners. With 24 points and single steps from the corners it was 144 of
    898."""
    staircase_points_of_one_input: int = 40
    """The same along a staircase of a single input, which has fewer steps."""


SEARCH = SearchSettings()
"""The settings that all searches take."""


def value_tolerance(output_range: float, magnitude: float) -> float:
    """Return the difference of two values of an output up to which they count as one.

    It is 1e-5 of the range plus 1e-9 of the magnitude, which matters for outputs that hardly vary.
    It is also the error that is stated of an estimated bound.

    Args:
        output_range: Range of the output in the widest α-cut, 0 or more.
        magnitude: Largest magnitude of the output.
    """
    return SEARCH.value_tolerance * output_range + SEARCH.rounding * magnitude
