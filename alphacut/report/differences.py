"""Differences from the paper, read from the heads of the modules."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator

from alphacut.io.files import Document
from alphacut.io.provenance import sources

PACKAGES = ("stochastic", "rve", "fuzzy", "frame")
MARK = "This differs from the paper in:"


def differences(found: Document | None = None) -> Iterator[tuple[str, str]]:
    """Subject and differences of each module, "1. … 2. …", that concern a run."""
    for package in PACKAGES:
        for name, file in sources(package):
            if file.suffix != ".py":
                continue
            if found is not None and not concerns(
                f"{package}.{name[:-3].replace('/', '.')}", found
            ):
                continue
            words = ast.get_docstring(ast.parse(file.read_text(encoding="utf-8"))) or ""
            if MARK in words:
                after = words.partition(MARK)[2].split("\n\n")[0]
                subject = re.sub(r"\s*\(.*", "", words.partition("\n")[0].rstrip("."))
                yield subject, " ".join(after.split())


def concerns(module: str, found: Document) -> bool:
    """True if a run used the module, by its summary."""
    methods = {study["method"] for study in found.get("envelopes", {}).values()}
    if module == "stochastic.radius_map":
        return "modulus" in found or "microstructure" in found
    if module.startswith("stochastic."):
        return "microstructure" in found
    if module.startswith("rve."):
        return "modulus" in found and (
            module != "rve.prism.model" or found["modulus"]["method"] == "prism"
        )
    if module == "frame.methods.graph_follower":
        return any(method.endswith("graph-follower") for method in methods)
    return not module.startswith("frame.") or bool(methods)
