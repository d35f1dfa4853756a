"""Numbers from data hold what they claim as often as they say, over laws, claims and counts."""

import numpy as np
import pytest

from benchmarks.fuzzy.coverage import ALPHA, FREE, LAWS, NAMED, held, jointly_held
from tests.calibration.declared import free_seed

FAR = 4.5
"""Standard errors below the claim that chance does not explain in a thousand comparisons."""


def ways(law, n):
    """Claim and named law of every number that n values of a law can make."""
    yield from ((claim, None) for claim in FREE)
    if np.abs(LAWS[law][1]).max() <= 1:
        yield "mean", None
    if n > 1:
        yield from ((claim, law) for claim in NAMED.get(law, ()))


def lacking(law, counts, repetitions, rng):
    """Print a row for each way: how often cuts held more than they claim, least and greatest.

    Returns:
        The ways that held less, by more than chance explains.
    """
    broken = []
    for n in counts:
        for claim, named in ways(law, n):
            score, excess = held(law, claim, n, repetitions, rng, named=named)
            worst = int(score.argmin())
            print(
                f"{law:12} {claim:13} n = {n:3} {named or 'any law':11}"
                f" held − claimed {excess.min():+.3f} … {excess.max():+.3f},"
                f" least score {score[worst]:+.2f} at α = {ALPHA[worst]:g}"
            )
            broken += [(law, claim, n, named)] if score[worst] < -FAR else []
    return broken


@pytest.mark.slow
@pytest.mark.parametrize("law", LAWS)
def test_cuts_hold_what_they_claim(law):
    rng = np.random.default_rng(free_seed(law))
    assert not lacking(law, (1, 5, 10, 30), 1500, rng)


@pytest.mark.slow
@pytest.mark.parametrize("links", [2, 5])
def test_joint_cuts_hold_all_of_them(links):
    rng = np.random.default_rng(free_seed(f"{links} claims"))
    scores = jointly_held(links, 600, rng)
    print(scores)
    assert min(scores["unknown"], scores["independent"]) > -FAR
    assert scores["minimum"] < -FAR  # the usual rule, which claims too much
