"""The report's terms: each explained where it first occurs, and all together in a box."""

from __future__ import annotations

import re

from markupsafe import Markup, escape

from alphacut.report.tables import fragment

TERMS = {
    "α-cut": "All values whose membership is at least α. At α = 0 it is the support, at α = 1 the"
    " most plausible values.",
    "Declared error": "What a printed number may be away from the exact answer of the stated model,"
    " all causes together.",
    "Envelope": "Lowest and highest value that an output can take at each time, for all inputs of"
    " one α-cut.",
    "Estimated": "Of bounds: from a model whose error is estimated, not proved.",
    "Guaranteed": "Proved: no admissible input gives a value outside the bounds. A result that"
    " rests on something stated by you says so beside the word. Of an image, *at two corners* where"
    " materials that can occur reach both bounds, and *enclosure* where they need not.",
    "Inner": "Of bounds: found by trying, so the true range is at least so wide.",
    "Membership": "Degree, between 0 and 1, to which a value is possible.",
    "Modal value": "Value of membership 1. Of a structure's motion, *modal* means by natural"
    " modes.",
    "Nature": "What a bound is: guaranteed, verified by sampling, estimated, searched or inner.",
    "Necessity": "One minus the possibility of the contrary. A necessity of 1 says that it must"
    " happen.",
    "Possibility": "Highest membership among the inputs for which something happens. A possibility"
    " of 0 says that it cannot happen.",
    "Searched": "Of bounds: that no better optimum is left rests on samples alone, and so does the"
    " declared error.",
    "Support": "Values whose membership is above 0, with their limits.",
    "Verified by sampling": "Of bounds: the search leaves nothing out, but the error of its model"
    " was only sampled, so they are not proved.",
}
"""Terms and their meaning, word for word as in the documentation's glossary."""
_SAID = {name: meaning.replace("*", "") for name, meaning in TERMS.items()}
_WORDS = re.compile(
    "|".join(rf"(?<![\w-]){re.escape(name)}(?![\w-])" for name in sorted(TERMS, key=len)[::-1]),
    re.IGNORECASE,
)
_CLOSED = "pre|code|svg|script|h[1-3]|a|summary|select|button|strong"
_PIECES = re.compile(rf"(<({_CLOSED})\b.*?</\2>|<[^>]*>)", re.DOTALL)


def explained(html: Markup) -> Markup:
    """HTML in which the first occurrence of each term leads to the glossary and shows its meaning.

    Headings, code, drawings, links and what stands in tags are left alone.
    """
    pieces, told = _PIECES.split(html), set[str]()
    # split gives text, tag or closed element, the element's name, and again
    pieces[::3] = [_WORDS.sub(lambda found: _linked(found[0], told), text) for text in pieces[::3]]
    del pieces[2::3]
    return Markup("".join(pieces))


def _linked(word: str, told: set[str]) -> str:
    """The word as a link to its term when it occurs first."""
    name = next(name for name in TERMS if name.lower() == word.lower())
    if name in told:
        return word
    told.add(name)
    return f'<a class="term" href="#{anchor(name)}" data-meaning="{escape(_SAID[name])}">{word}</a>'


def anchor(name: str) -> str:
    """Identifier of a term on the page."""
    return "term-" + name.lower().replace(" ", "-").replace("α", "alpha")


def box() -> Markup:
    """All terms with their meanings."""
    return fragment("glossary", [(anchor(name), name, text) for name, text in _SAID.items()])
