"""The sections of the report, each a piece of HTML."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from markupsafe import Markup

from alphacut.figures.captions import core, in_words
from alphacut.fuzzy.samples.nature import Nature
from alphacut.io.files import Document
from alphacut.io.units import engineering
from alphacut.report import glossary
from alphacut.report.decisions import decided, learned, next_measured, together
from alphacut.report.differences import differences
from alphacut.report.envelopes import envelopes, natural
from alphacut.report.figures import gallery, listed
from alphacut.report.key_results import key_results
from alphacut.report.tables import (
    citation,
    code,
    details,
    items,
    paragraphs,
    section,
    sentence,
    table,
)
from alphacut.stages.material import response


def sections(summary: Document, folder: Path) -> Iterator[Markup]:
    """All sections that the results allow, in reading order."""
    yield key_results(summary)
    if "microstructure" in summary:
        yield microstructure(summary["microstructure"])
    if "modulus" in summary:
        yield modulus(summary["modulus"], listed(summary, folder, "modulus"))
    if "image" in summary:
        yield image(summary["image"], listed(summary, folder, "image"))
    if "given_modulus" in summary:
        yield given(summary["given_modulus"])
    if "response" in summary:
        yield stress(summary["response"], listed(summary, folder, "response"))
    if words := summary.get("structure", {}).get("words"):
        yield built(words, natural(summary))
    if "update" in summary:
        yield learned(summary, folder)
    if summary.get("envelopes"):
        yield envelopes(summary, listed(summary, folder, "exceedance"))
    if "decision" in summary:
        yield decided(summary, folder)
    if "joint" in summary:
        yield together(summary, folder)
    if (folder / "measure-next.json").is_file():
        yield next_measured(folder)
    if summary.get("shares"):
        yield shares(summary["shares"])
    if summary.get("paper"):
        yield comparison(summary["paper"])
    yield methods(summary)
    yield section("Terms", glossary.box())
    yield gallery(summary, folder)
    yield case_text(summary)
    yield differing(summary)
    yield versions(summary)


def microstructure(found: Document) -> Markup:
    """Particles, cells, and the fuzzy radius map."""
    low, high = found["limits"]
    words = paragraphs(
        f"{found['discs']} discs in {found['packings']} sections, area fraction"
        f" {found['area_fraction']:.4f}{of_map(found)}. The limits {low:.4g} and {high:.4g} of r/a"
        f" keep {found['share_kept']:.3%} of the area."
    )
    rows = [("a1", f"{found['a1']:.5g}")]
    rows += [
        (name, "[" + ", ".join(f"{end:.5g}" for end in found[name]) + "]") for name in ("a2", "a4")
    ]
    rows.insert(2, ("a3", f"{found['a3']:.5g}"))
    return section(
        "Microstructure", words, table(("parameter of the radius map", "fuzzy value"), rows)
    )


def of_map(found: Document) -> str:
    """The area fraction that the modulus gets, where it is known."""
    name = "mean_area_fraction_of_map"
    return (
        f"; {found[name]:.4f} by the fitted map at its modal values, which is what the modulus uses"
        if name in found
        else ""
    )


MEANING = {
    "cylinders": "E is the modulus of eq. 16, the paper's convention: a square array is not"
    " isotropic.",
    "spheres": "E is Hill's isotropic average of spheres in a simple cubic array.",
}


def modulus(found: Document, drawn: Markup) -> Markup:
    """The fuzzy modulus with its α-cuts, error budget and certificate."""
    cuts = zip(found["alpha"], found["E_GPa"]["lower"], found["E_GPa"]["upper"], strict=True)
    rows = [(f"{alpha:g}", f"{low:.4f}", f"{high:.4f}") for alpha, low, high in cuts]
    words = Markup(
        "<p>{} <strong>{}</strong>, support [{:.4f}, {:.4f}] GPa; Poisson's ratio {:.4f}. {} {}"
        " samples, {} linear systems, {:.1f} s. {} {} {}</p>"
    ).format(
        "Core" if "[" in core(found) else "Modal value",
        core(found),
        *(found[name] for name in ("lower_GPa", "upper_GPa", "nu")),
        MEANING[found.get("particles", "cylinders")],
        *(found[name] for name in ("samples", "solves", "seconds")),
        sentence(found.get("reason", "")),
        isotropy(found),
        sentence(found.get("shape", "")),
    )
    budget = [(in_words(name), f"{value:.2g}") for name, value in found.get("error", {}).items()]
    checks = [(in_words(name), f"{value:.2g}") for name, value in found.get("checks", {}).items()]
    return section(
        "Fuzzy modulus",
        words,
        drawn,
        table(("α", "lower E, GPa", "upper E, GPa"), rows),
        (
            Markup("<h3>Error budget</h3>")
            + table(("source", "estimated relative error of E"), budget)
            if budget
            else Markup("")
        ),
        (
            Markup("<h3>Certificate</h3>")
            + table(("property", "measured violation, largest of all samples"), checks)
            if checks
            else Markup("")
        ),
    )


def given(found: Document) -> Markup:
    """The modulus that the case gives instead of having it computed."""
    cuts = zip(found["alpha"], found["E_GPa"]["lower"], found["E_GPa"]["upper"], strict=True)
    rows = [(f"{alpha:g}", f"{low:.4f}", f"{high:.4f}") for alpha, low, high in cuts]
    words = paragraphs(Markup("Given by the case: {}.").format(code(found["of"])))
    return section("Fuzzy modulus", words, table(("α", "lower E, GPa", "upper E, GPa"), rows))


def image(found: Document, drawn: Markup) -> Markup:
    """The bounds of an image's modulus, what they are worth, and what widens them."""
    cuts = found["cuts"]
    ends = zip(
        cuts["alpha"], cuts["E_GPa"]["lower"], cuts["E_GPa"]["upper"], cuts["nature"], strict=True
    )
    rows = [(f"{a:g}", f"{low:.4f}", f"{high:.4f}", nature) for a, low, high, nature in ends]
    grains, least, greatest = (
        f"[{pair['lower']:.3f}, {pair['upper']:.3f}] GPa"
        for pair in (
            found["grains_E_GPa"],
            found["directions_E_GPa"]["least"],
            found["directions_E_GPa"]["greatest"],
        )
    )
    apparent = found.get("apparent_E_GPa")
    own = (
        f" The window as it is has E in [{apparent['lower']:.3f}, {apparent['upper']:.3f}] GPa;"
        " that is proved, and bounds its apparent stiffness only."
        if apparent
        else ""
    )
    words = paragraphs(
        "Plane strain: every section of the material is the image, as with fibres. If the"
        f" particles are grains, the Hashin–Shtrikman interval of E is {grains}. The plane-strain"
        f" Young's modulus of the softest direction lies in {least}, of the stiffest in"
        f" {greatest}.{own}"
    )
    widths = [
        (row["source"], f"{row['width_GPa']:.3g}", f"{row['share']:.1%}", row["cure"])
        for row in found["error_table"]
    ]
    return section(
        "Stiffness of the image",
        words,
        drawn,
        table(("α", "lower E, GPa", "upper E, GPa", "nature"), rows),
        random_threshold(found),
        Markup("<h3>What widens E, the source to improve first on top</h3>")
        + table(("source", "width of E, GPa", "share", "to narrow it"), widths),
    )


def random_threshold(found: Document) -> Markup:
    """Quantiles of E over a random threshold at the lowest and the highest level, or nothing."""
    random = found.get("random_threshold")
    if not random:
        return Markup("")
    levels = found["cuts"]["alpha"]
    rows = [
        (f"{row['share']:g}", *(f"[{e['lower']:.4f}, {e['upper']:.4f}]" for e in ends))
        for row in random["quantiles"]
        for ends in [(row["E_GPa"][-1], row["E_GPa"][0])]
    ]
    head = ("probability", f"E, GPa, at α = {levels[-1]:g}", f"E, GPa, at α = {levels[0]:g}")
    return Markup("<h3>Quantiles of E over the random threshold, proved</h3>") + table(head, rows)


def isotropy(found: Document) -> str:
    """Sentence on the array's anisotropy; empty where it was not computed."""
    from alphacut.rve.anisotropy import shear_ratio_in_words

    return (
        sentence(
            shear_ratio_in_words(
                float(found["shear_ratio"]), spheres=found.get("particles") == "spheres"
            )
        )
        if found.get("shear_ratio") is not None
        else ""
    )


def stress(found: Document, drawn: Markup) -> Markup:
    """The random and fuzzy stress of the cell."""
    words = paragraphs(
        f"Homogenised stress {found['quantity']}, random with θ at every fuzzy sample: intervals"
        " of its mean, its quantiles and of the probability of exceeding a limit. Bounds are"
        f" {found['nature']}; {found['note']}."
    )
    head = ("quantity", f"cut at α = {found['alpha'][0]:g}", f"cut at α = {found['alpha'][-1]:g}")
    return section("Random and fuzzy stress", words, drawn, table(head, response.table(found)))


def built(words: Document, periods: Markup) -> Markup:
    """The structure: what it is, its floors or inputs, its first periods."""
    sentences = paragraphs(*words["sentences"])
    return section("Structure", sentences, table(words["head"], words["rows"]), periods)


def shares(found: Document) -> Markup:
    """Contributions of the inputs to the widths."""
    from alphacut.figures.envelope import WORDS

    words = paragraphs(
        "Share of the width at α = 0 that is lost when an input is fixed at its modal value and"
        " all others are kept."
    )
    # quantities that depend on the same inputs share a table
    kinds = dict.fromkeys(tuple(entry) for entry in found.values())
    tables = []
    for inputs in kinds:
        of = [name for name, entry in found.items() if tuple(entry) == inputs]
        rows = [
            (
                WORDS.get(name) or in_words(name),
                *(f"{found[quantity][name]:.1%}" for quantity in of),
            )
            for name in inputs
        ]
        tables.append(table(("input", *of), rows))
    return section("What drives the width", words, *tables)


def comparison(rows: Sequence[Document]) -> Markup:
    """Paper, here, difference."""
    from alphacut.stages.summary import cells

    return section(
        "Paper and here",
        table(
            ("quantity", "place", "paper", "here", "difference", "share"),
            [cells(dict(row)) for row in rows],
            numbers=2,
        ),
    )


def methods(summary: Document) -> Markup:
    """Method and cost of each stage."""
    rows: list[tuple[object, ...]] = []
    if cell := summary.get("modulus"):
        rows.append(
            (
                "fuzzy modulus",
                f"{cell['method']}, plan {cell['plan']}",
                cell["nature"],
                f"{cell['samples']} samples",
                f"{cell['seconds']:.1f}",
            )
        )
    if picture := summary.get("image"):
        cost = f"{picture['iterations']} iterations"
        rows.append(("image", "trial fields", picture["nature"], cost, f"{picture['seconds']:.1f}"))
    for name, study in summary.get("envelopes", {}).items():
        rows.append(
            (
                f"envelope {name}",
                study["method"],
                study["nature"],
                effort(study),
                f"{study['seconds']:.1f}",
            )
        )
    words = paragraphs(*explained(rows), *proofs(summary))
    return section(
        "Methods and cost",
        table(("stage", "method", "nature of the bounds", "cost", "seconds"), rows, numbers=3),
        words,
    )


def explained(rows: Sequence[tuple[object, ...]]) -> Iterator[str]:
    """Meaning of each nature of bounds in the table."""
    told = {nature.value: nature.sentence() for nature in Nature}
    yield from (
        f"{nature.capitalize()}: {told[nature]}."
        for nature in dict.fromkeys(str(row[2]) for row in rows)
        if nature in told
    )


def proofs(summary: Document) -> Iterator[str]:
    """Gap of each certified envelope, and what it rests on."""
    from alphacut.frame.outputs import output_unit

    for name, study in summary.get("envelopes", {}).items():
        if "proved" in study:
            ends = study["proved"]
            words = ", ".join(
                f"{output} {engineering(ends['min'][output], output_unit(output))} …"
                f" {engineering(ends['max'][output], output_unit(output))}"
                for output in ends["min"]
            )
            yield (
                f"Beside envelope {name} stand guaranteed bounds of the exact motion at every node"
                f" and level, on the lowest from least to greatest {words}."
            )
        if "gap" in study:
            of = str(study.get("gap_output", next(iter(study.get("min", {"q": 0})))))
            gap, between = (
                engineering(float(study.get(key, 0.0)), output_unit(of), digits=2)
                for key in ("gap", "between_nodes")
            )
            yield (
                f"The bounds of envelope {name} are proved at every node, and no wider than {gap}"
                f" of {of} beyond what is attained; between nodes the motion leaves a straight line"
                f" by {between} at most. {sentence(study['proof'])}"
            )


def effort(study: Document) -> str:
    """Cost of an envelope: trajectories, or eigen-analyses."""
    return (
        f"{study['trajectories']}"
        f" {'eigen-analyses' if study['method'] == 'modal' else 'trajectories'}"
    )


def case_text(summary: Document) -> Markup:
    """The case file as it was, and what the command line changed."""
    changes = [code(change) for change in summary.get("changes", ())]
    return section(
        "The case",
        paragraphs("Changed on the command line:") + items(changes) if changes else Markup(),
        details(f"{summary['case']}.toml", code(summary["case_text"], "pre")),
    )


def differing(summary: Document) -> Markup:
    """Differences from the paper in the modules that the run used."""
    found = tuple(differences(summary))
    listed = items(
        Markup("<strong>{}</strong>: {}").format(subject, text) for subject, text in found
    )
    # for a case of one's own they are no news, but they are what the numbers rest on
    if not summary.get("paper"):
        head = f"{len(found)} places where the methods differ from the paper they follow"
        listed = details(head, listed)
    return section("Differences from the paper", listed) if found else Markup("")


def versions(summary: Document) -> Markup:
    """Versions, command, and how to cite."""
    found = ", ".join(f"{name} {version}" for name, version in summary["versions"].items())
    command = Markup("Made by {} in {:.0f} s.").format(code(summary["command"]), summary["seconds"])
    return section("Versions and citation", paragraphs(command, found), code(citation(), "pre"))
