"""Sections of the report on the material: particles, modulus, image, stress."""

from __future__ import annotations

from markupsafe import Markup

from alphacut.figures.captions import core, in_words, widest
from alphacut.io.files import Document
from alphacut.io.units import fixed
from alphacut.report.tables import paragraphs, section, sentence, table
from alphacut.stages import response


def microstructure(found: Document, seen: Markup) -> Markup:
    """Particles, cells, and the fuzzy radius map."""
    low, high = found["limits"]
    cells = CELLS[found.get("particles", "discs")]
    told = spheres(found) if cells == "volume" else discs(found)
    words = paragraphs(
        f"{told}. The limits {low:.4g} and {high:.4g} of r/a keep {found['share_kept']:.3%} of the"
        f" {cells}.",
        *map(sentence, found.get("remarks", ())),
    )
    rows = [("a1", f"{found['a1']:.5g}")]
    rows += [
        (name, "[" + ", ".join(f"{end:.5g}" for end in found[name]) + "]") for name in ("a2", "a4")
    ]
    rows.insert(2, ("a3", f"{found['a3']:.5g}"))
    return section(
        "Microstructure", seen, words, table(("parameter of the radius map", "fuzzy value"), rows)
    )


OF_MAP = " by the fitted map at its modal values, which is what the modulus uses"
CELLS = {"discs": "area", "spheres": "volume"}


def discs(found: Document) -> str:
    """Discs and their area fractions."""
    whole = found.get("area_fraction_of_image")
    name = "mean_area_fraction_of_map"  # which results of an older program lack
    own = f"; {found[name]:.4f}{OF_MAP}" if name in found else ""
    image = "" if whole is None else f"; share of the whole image {whole:.4f}"
    return (
        f"{found['discs']} discs in {found['packings']} sections, area fraction"
        f" {found['area_fraction']:.4f}{own}{image}"
    )


def spheres(found: Document) -> str:
    """Spheres and their volume fractions."""
    others = len(found["possible_laws"])
    besides = f", and {others} more laws of radii that are possible" if others else ""
    return (
        f"{found['spheres']} spheres in {found['packings']} periodic cubes, divided into Laguerre"
        f" cells{besides}. Volume fraction {found['volume_fraction']:.4f}, packed as"
        f" {found['volume_fraction_packed']:.4f} because {found['share_beyond_limit']:.1%} of the"
        " volume lies in cells tighter than a cubic one may be;"
        f" {found['mean_volume_fraction_of_map']:.4f}{OF_MAP}"
    )


MEANING = {
    "cylinders": "E is the modulus of eq. 16 in plane strain, the paper's convention: a square"
    " array is not isotropic.",
    "isotropic": "E is that of the isotropic average of the square array's plane stiffness.",
    "spheres": "E is Hill's isotropic average of spheres in a simple cubic array.",
}


def meaning(found: Document) -> str:
    """What E is of: cylinders (eq. 16), isotropic or spheres; older results name the particles."""
    return str(found.get("average", found.get("particles", "cylinders")))


def modulus(found: Document, drawn: Markup) -> Markup:
    """The fuzzy modulus with its α-cuts, error budget and certificate."""
    poisson = found.get("nu_cuts", {"lower": [], "upper": []})
    columns = [found["E_GPa"], *([poisson] if len(poisson["lower"]) else [])]
    ends = [one[side] for one in columns for side in ("lower", "upper")]
    rows = [
        (f"{alpha:g}", *(fixed(end[level], 4) for end in ends))
        for level, alpha in enumerate(found["alpha"])
    ]
    head = ("α", "lower E, GPa", "upper E, GPa", "lower ν", "upper ν")[: 1 + len(ends)]
    low, high = found["references"]["hashin_shtrikman_E_GPa"]
    told = [f"Hashin–Shtrikman bounds of E at the modal values: {low:.4f} … {high:.4f} GPa."]
    words = Markup(
        "<p>{} <strong>{}</strong>, {} [{}, {}] GPa; Poisson's ratio {:.4f}. {} {}"
        " samples, {} linear systems, {:.1f} s.</p>"
    ).format(
        "Core" if "[" in core(found) else "Modal value",
        core(found),
        widest(found),
        *(fixed(found[name], 4) for name in ("lower_GPa", "upper_GPa")),
        found["nu"],
        MEANING[meaning(found)],
        *(found[name] for name in ("samples", "solves", "seconds")),
    )
    each = (
        ("Error budget", "source", "estimated relative error of E", "error"),
        ("Certificate", "property", "measured violation, largest of all samples", "checks"),
    )
    more = (
        Markup(f"<h3>{title}</h3>")
        + table(names, [(in_words(x), f"{value:.2g}") for x, value in found[key].items()])
        for title, *names, key in each
        if found.get(key)
    )
    return section("Fuzzy modulus", words + paragraphs(*told), drawn, table(head, rows), *more)


def interval(ends: Document) -> str:
    """An interval of moduli in GPa."""
    return f"[{fixed(ends['lower'], 4)}, {fixed(ends['upper'], 4)}] GPa"


def image(found: Document, drawn: Markup) -> Markup:
    """The bounds of an image's modulus, what they are worth, and what widens them."""
    cuts = found["cuts"]
    ends = zip(
        cuts["alpha"], cuts["E_GPa"]["lower"], cuts["E_GPa"]["upper"], cuts["nature"], strict=True
    )
    rows = [(f"{a:g}", fixed(low, 4), fixed(high, 4), nature) for a, low, high, nature in ends]
    words = paragraphs(
        "Plane strain: every section of the material is the image, as with fibres; E is that of an"
        " isotropic solid with its plane bulk and shear moduli, not E_T across the fibres.",
    )
    widths = [(name, f"{width:.3g}") for name, width in found["widths_GPa"].items()]
    phases = [f"{name}: {share:.1%} of the area." for name, share in found["fractions"].items()]
    return section(
        "Stiffness of the image",
        paragraphs(*phases) + words,
        drawn,
        table(("α", "lower E, GPa", "upper E, GPa", "nature"), rows),
        Markup("<h3>What widens E, the source to improve first on top</h3>")
        + table(("source", "width of E, GPa"), widths),
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
