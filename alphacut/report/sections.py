"""The sections of the report, each from its part of the summary."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

from markupsafe import Markup

from alphacut.figures.captions import INPUTS, caption, in_words
from alphacut.fuzzy.result import Nature
from alphacut.io.files import Document
from alphacut.io.units import between, ends
from alphacut.questions.question import Question
from alphacut.questions.table import QUESTIONS
from alphacut.report.html import code, folded, fragment, paragraphs, picture, section, table
from alphacut.report.results import (
    ANSWERS,
    answers,
    drivers,
    extremes,
    material,
    motion,
    nature_of,
    natures,
    width_text,
)
from alphacut.report.safe import figures

TERMS = {
    "α-cut": "All values whose membership is at least α.",
    "Support": "The α-cut at 0: all values that are possible.",
    "Most plausible": "The α-cut at 1, or that of the highest level computed.",
    "Envelope": "Least and greatest value of an output at each time, over one α-cut of the inputs.",
    "Peak": "Largest magnitude of an output over the motion.",
    "Possibility": "Degree of the highest α-cut in which something happens. 0: it cannot.",
    "Necessity": "One less the possibility of the contrary. 1: it must happen.",
    **{str(nature).capitalize(): nature.sentence for nature in Nature},
}
"""Terms of the page with their meaning."""


class Page:
    """The sections of one run.

    Args:
        summary: Its summary, made safe.
        folder: Where its figures are.
    """

    def __init__(self, summary: Document, folder: Path) -> None:
        self.summary, self.folder = summary, folder
        self.paper = any("fig" in name for name in summary.get("figures", ()))
        self.left = dict(figures(summary, folder))  # of those that no section has shown yet

    def sections(self) -> Iterator[Markup]:
        """All sections that the results allow, in reading order."""
        results = (material(self.summary), motion(self.summary), (ANSWERS, answers(self.summary)))
        tables = (table(head, rows) for head, rows in results)
        remarks = [*natures(self.summary), *drivers(self.summary)]
        yield section("Key results", *tables, paragraphs(*remarks))
        for name in ("microstructure", "modulus", "image", "response"):
            if name in self.summary:
                yield getattr(self, f"_{name}")(self.summary[name])
        if "update" in self.summary:
            yield self._identify(self.summary["update"])
        if self.summary.get("envelopes"):
            yield self._envelopes(self.summary["envelopes"])
        for question in QUESTIONS:
            if question.key in self.summary:
                yield self._question(question, self.summary[question.key])
        if self.summary.get("shares"):
            yield self._shares(self.summary["shares"])
        others = [self._drawn(stem) for stem in list(self.left)]
        yield section("Terms", fragment("glossary", TERMS.items()))
        yield section("More", folded("All other figures", *others), *self._origin())

    def _drawn(self, name: str) -> Markup:
        """A figure by its name without the paper's number; empty if this run has not drawn it."""
        stems = [stem for stem in self.left if stem == name or stem.endswith(f"-{name}")]
        shown = [
            picture(self.left.pop(stem), caption(stem, paper=self.paper)) for stem in stems[:1]
        ]
        return shown[0] if shown else Markup("")

    def _microstructure(self, part: Document) -> Markup:
        count, kind = part.get("discs"), "discs"
        if count is None:
            count, kind = part.get("spheres", 0), "spheres"
        words = f"{count:,} {kind} in {part.get('packings', 1)} sections or cubes."
        slopes = [
            (name, " … ".join(f"{end:.5g}" for end in _ends(part[name])))
            for name in ("a1", "a2", "a3", "a4")
        ]
        map_of = table(("parameter of the radius map", "least … modal … greatest"), slopes)
        drawn = self._drawn("pbox") or self._drawn("p-box")
        return section("Microstructure", paragraphs(words), drawn, folded("Radius map", map_of))

    def _modulus(self, part: Document) -> Markup:
        columns = [part["E_GPa"], *([part["nu_cuts"]] if "nu_cuts" in part else [])]
        cuts = [
            (f"{alpha:g}", *(end for one in columns for end in _cut(one, row, part)))
            for row, alpha in enumerate(part["alpha"])
        ]
        head = ("α", "E from, GPa", "E to, GPa", "ν from", "ν to")[: 1 + 2 * len(columns)]
        errors = [(in_words(x), f"{value:.2g}") for x, value in part.get("error", {}).items()]
        checks = [(in_words(x), f"{value:.2g}") for x, value in part.get("checks", {}).items()]
        return section(
            "How stiff is the material?",
            self._drawn("modulus"),
            folded("α-cuts", table(head, cuts)),
            folded(
                "Errors, checks and references",
                table(("source", "relative error of E"), errors),
                table(("property", "largest violation"), checks),
                table(("reference at the modal values", "E, GPa"), _references(part)),
            ),
        )

    def _image(self, part: Document) -> Markup:
        cuts = part["cuts"]
        rows = [
            (f"{alpha:g}", *_cut(cuts["E_GPa"], row, part))
            for row, alpha in enumerate(cuts["alpha"])
        ]
        words = "The bounds are those of the image as it was segmented, in plane strain."
        shares = (f"{name} {_percent(share)}" for name, share in part["fractions"].items())
        return section(
            "How stiff is the image?",
            paragraphs(words, f"Of the area: {', '.join(shares)}.", width_text(part) + "."),
            self._drawn("image"),
            folded("α-cuts", table(("α", "E from, GPa", "E to, GPa"), rows)),
        )

    def _response(self, part: Document) -> Markup:
        rows = [("mean", _widest(part["mean_GPa"]))]
        rows += [
            (f"quantile {one['probability']:g}", _widest(one["GPa"])) for one in part["quantiles"]
        ]
        if "exceedance" in part:
            limit = f"probability above {part['exceedance']['limit_GPa']:g} GPa"
            rows.append((limit, _widest(part["exceedance"])))
        words = f"Homogenised stress {part['quantity']}, random with θ at every fuzzy sample."
        head = ("quantity, GPa", f"at α = {part['alpha'][0]:g}")
        drawn = self._drawn("response")
        return section(
            "How much does the stress scatter?", paragraphs(words), drawn, table(head, rows)
        )

    def _identify(self, part: Document) -> Markup:
        title = "What do the measured modes teach?"
        if "refuted" in part:
            return section(title, paragraphs(str(part["refuted"])))
        rows = [
            (name, *(between(*ends, Nature.GUARANTEED, 5) for ends in (part["prior"][name], after)))
            for name, ends in part["inputs"].items()
            for after in [(ends["lower"][0], ends["upper"][0])]
        ]
        held = [
            (
                f"mode {one['mode']}",
                f"{one['measured']:.5g}",
                " … ".join(f"{end:.5g}" for end in one["predicted"]),
                "inside" if one["inside"] else "outside",
            )
            for one in part.get("held_out", ())
        ]
        head = ("input, SI", "before", f"after, at α = {part['alpha'][0]:g}")
        return section(
            title,
            self._drawn("update-inputs"),
            table(head, rows),
            table(("held out", "measured, Hz", "predicted, Hz", "measured is"), held),
            *(self._drawn(f"update-{name}") for name in part.get("envelope_width", {})),
        )

    def _envelopes(self, studies: Document) -> Markup:
        omega = self.summary.get("structure", {}).get("omega_rad_per_s", ())
        periods = ", ".join(f"{2 * math.pi / one:.3g}" for one in omega[:4])
        words = f"Linear elastic, with natural periods of {periods} s." if periods else ""
        natures = dict.fromkeys(nature_of(study["nature"]) for study in studies.values())
        tables = [
            folded(
                f"{name}: {study['method']}, fuzzy {', '.join(study['fuzzy'])}",
                table(*extremes(study)),
            )
            for name, study in studies.items()
        ]
        meaning = (f"{str(one).capitalize()}: {one.sentence}" for one in natures)
        return section(
            "How does the structure move?", fragment("plot"), paragraphs(words, *meaning), *tables
        )

    def _question(self, question: Question, part: Document) -> Markup:
        shown = table(question.head, question.rows(part))
        drawn = self._drawn(question.key)
        return section(question.title, drawn, shown, paragraphs(question.words(part)))

    def _shares(self, part: Document) -> Markup:
        inputs = dict.fromkeys(name for entry in part.values() for name in entry)
        rows = [
            (INPUTS.get(name) or in_words(name), *(_percent(part[of].get(name)) for of in part))
            for name in inputs
        ]
        words = "Share of the width that is lost when an input is fixed at its modal value."
        drawn = self._drawn("shares-over-time"), self._drawn("shares-modulus")
        shown = folded("Shares, on the lowest level", table(("input", *part), rows))
        return section("What drives the width?", paragraphs(words), *drawn, shown)

    def _origin(self) -> Iterator[Markup]:
        """The case file, what the command line changed, versions."""
        summary = self.summary
        changes = [code(str(change), "pre") for change in summary.get("changes", ())]
        yield folded(f"Case {summary['case']}", code(summary["case_text"], "pre"))
        yield folded("Changed on the command line", *changes)
        versions = [(name, version) for name, version in summary["versions"].items()]
        made = Markup("Made by {} in {:.0f} s.").format(
            code(summary["command"]), summary["seconds"]
        )
        yield folded("Versions", paragraphs(made), table(("program", "version"), versions))


def _ends(value: object) -> list[float]:
    return [float(x) for x in value] if isinstance(value, list) else [float(str(value))]


def _cut(of: Document, row: int, part: Document) -> tuple[str, str]:
    return ends(of["lower"][row], of["upper"][row], nature_of(part["nature"]), 5)


def _widest(ends: Document) -> str:
    return between(ends["lower"][0], ends["upper"][0], Nature.ESTIMATED)


def _percent(share: float | None) -> str:
    return "–" if share is None else f"{share:.1%}"


def _references(part: Document) -> list[tuple[str, str]]:
    known = {
        "hashin_shtrikman_E_GPa": "Hashin–Shtrikman bounds, isotropic composites",
        "mori_tanaka_E_GPa": "Mori–Tanaka, isotropic composites",
    }
    of = part.get("references", {})
    return [
        (words, " … ".join(f"{end:.5g}" for end in _ends(of[key])))
        for key, words in known.items()
        if key in of
    ]
