"""Nature of a bound: what it is worth, in one word and in one sentence."""

from __future__ import annotations

from collections.abc import Sequence
from enum import StrEnum


class Nature(StrEnum):
    """Worth of a bound."""

    GUARANTEED = "guaranteed"
    VERIFIED = "verified by sampling"
    INNER = "inner"
    ESTIMATED = "estimated"
    SEARCHED = "searched"

    def sentence(self, given: Sequence[str] = ()) -> str:
        """The nature in words, with what it rests on.

        Args:
            given: Facts that nobody proved, as "the signs of x hold, as stated by the caller".
        """
        return f"{_MEANING[self]}{condition(given)}"


_MEANING = {
    Nature.GUARANTEED: "proved to hold the true range",
    Nature.VERIFIED: "the search is proved to leave nothing out, the error of its model is sampled",
    Nature.INNER: "attained by the parameters stored with them; the true range may go further",
    Nature.ESTIMATED: "from a surrogate whose error is estimated, not proved",
    Nature.SEARCHED: "that no better optimum is left rests on samples alone, and so does the error",
}


def condition(given: Sequence[str]) -> str:
    """What a proof rests on, in brackets; empty where it rests on nothing."""
    return f" (given that {' and '.join(given)})" if given else ""
