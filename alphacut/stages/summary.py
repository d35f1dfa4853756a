"""summary.json of a run, and the table paper / here / difference."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np

from alphacut.case.case import Case
from alphacut.frame import StoreyFrame
from alphacut.frame.structures.linear import LinearSystem, frequencies
from alphacut.io.files import Document
from alphacut.io.provenance import FORMAT, command, versions
from alphacut.rve.spheres.result import volume_fraction
from alphacut.stages.material import modulus, response
from alphacut.stages.material.cell import GPA, modal_parts
from alphacut.stages.material.references import references
from alphacut.stages.pipeline import Results
from alphacut.stages.vibration import exceedance as outcomes
from alphacut.stages.vibration.decision import decision_document
from alphacut.stages.vibration.update import narrower
from alphacut.stochastic.theta.truncated_normal import Array

if TYPE_CHECKING:
    import xarray

Row = dict[str, Any]
# attributes of an envelope
COST = ("trajectories", "seconds", "method", "nature")
GAP = ("gap", "gap_output", "between_nodes", "proof")
CLAIM = ("claim", "unproved")


def summary(results: Results) -> Document:
    """Everything in numbers: inputs, fuzzy modulus, extremes, comparison."""
    found = {
        **origin(results.case),
        **inputs_numbers(results),
        **material_numbers(results),
        **motion_numbers(results),
        **question_numbers(results),
    }
    return found


def origin(case: Case) -> Document:
    """The case in words, and what made its results."""
    return {
        "format_version": FORMAT,
        "case": case.name,
        "title": case.top.title,
        "about": case.top.about,
        "case_text": case.text_of_file,
        "command": command(),
        "versions": versions(),
    }


def inputs_numbers(results: Results) -> Document:
    """What particles were found, and their share of the area."""
    found: dict[str, Any] = {}
    particles = results.folder / "microstructure.json"
    if "microstructure" in results.case.stages and particles.is_file():
        found["microstructure"] = json.loads(particles.read_text(encoding="utf-8"))
    if results.case.sections.radius:
        found |= fraction(results)
    return found


def material_numbers(results: Results) -> Document:
    """The modulus, computed, proved of an image or given, and the response of the cell."""
    found: dict[str, Any] = {}
    if results.modulus is not None:
        found["modulus"] = cell_numbers(results, results.modulus)
    elif results.image is not None:
        found["image"] = json.loads(results.image.attrs["document"])
    elif results.handed is not None:
        found["given_modulus"] = given(results)
    if results.response is not None:
        found["response"] = response.document(results.response)
    return found


def cell_numbers(results: Results, dataset: xarray.Dataset) -> Document:
    """The fuzzy modulus beside its references."""
    return {**modulus_numbers(dataset), "references": references(results.case)}


def motion_numbers(results: Results) -> Document:
    """The structure, every study's envelope, and what measured modes leave."""
    found: dict[str, Any] = {}
    if results.envelopes:
        found["structure"] = structure_numbers(results)
        fuzzy = {study.name: study.task.fuzzy for study in results.studies}
        found["envelopes"] = {
            name: {"fuzzy": fuzzy[name], **envelope_numbers(dataset)}
            for name, dataset in results.envelopes.items()
        }
    if results.learned is not None:
        found["update"] = learned_numbers(results)
    return found


def question_numbers(results: Results) -> Document:
    """Answers to what the case asks of the motion."""
    found: dict[str, Any] = {}
    if results.exceedance is not None:
        found["exceedance"] = outcomes.exceedances_document(results.exceedance)
    if results.decision is not None:
        found["decision"] = decision_document(results.decision)
    return found


def learned_numbers(results: Results) -> Document:
    """What measured modes leave of the inputs, and of the widths of the envelopes."""
    assert results.learned is not None
    assert results.update is not None
    found = results.learned.document()
    return found if "refuted" in found else {**found, "envelope_width": narrower(results.update)}


def fraction(results: Results) -> Document:
    """Mean fraction of the cell that the particle takes: E[π r²/4], of spheres E[π r³/6]."""
    from alphacut.stochastic import gauss_rule

    case = results.case
    radius, _, _ = modal_parts(case)
    rule = gauss_rule(radius.distribution, points=20)
    if case.cell.particles == "spheres":
        return {"volume_fraction": float(rule.mean(volume_fraction(radius(rule.nodes))))}
    return {"area_fraction": float(rule.mean(np.pi / 4 * radius(rule.nodes) ** 2))}


def modulus_numbers(dataset: xarray.Dataset) -> Document:
    """α-cuts in GPa, modal value, support, cost."""
    ends = dataset["E"].transpose("alpha", "bound").values / GPA
    cuts = {"alpha": dataset["alpha"].values, "E_GPa": {"lower": ends[:, 0], "upper": ends[:, 1]}}
    support = {
        "modal_GPa": ends[-1].mean(),
        "lower_GPa": ends[0, 0],
        "upper_GPa": ends[0, 1],
        "nu": dataset["nu"].values[-1].mean(),
    }
    of_poisson = dataset["nu"].transpose("alpha", "bound").values
    support["nu_cuts"] = {"lower": of_poisson[:, 0], "upper": of_poisson[:, 1]}
    cost = {
        name: dataset.attrs[name]
        for name in ("samples", "solves", "seconds", "method", "plan", "nature")
    }
    cost |= {"reason": dataset.attrs.get("reason", "")}
    cost |= {"particles": dataset.attrs.get("particles", "cylinders")}
    cost |= {"average": dataset.attrs.get("average", cost["particles"])}
    cost |= {name: dataset.attrs[name] for name in ("shear_ratio",) if name in dataset.attrs}
    budget = {"error": modulus.listed(dataset, "error"), "checks": modulus.listed(dataset, "check")}
    return {**cuts, **support, **cost, **budget}


def given(results: Results) -> Row:
    """The modulus that stands in for a computed one: where it comes from, and its α-cuts."""
    assert results.handed is not None
    key = next(iter(results.case.stand_ins), "frame.modulus")
    alpha = results.case.envelope.alpha if results.envelopes else (0.0, 1.0)
    cuts = np.array([results.handed.cut(level) for level in alpha]) / GPA
    return {
        "of": f"{key} = {results.case.written.get(key, '')}",
        "alpha": alpha,
        "E_GPa": {"lower": cuts[:, 0], "upper": cuts[:, 1]},
    }


def structure_numbers(results: Results) -> Document:
    """The structure in words, and natural frequencies at the modal values where it has any."""
    wanted = results.structure
    assert wanted is not None
    if wanted.linear is None:
        return {}
    omega = frequencies(wanted.linear)
    period = 2 * np.pi / omega[0]
    return {
        "omega_rad_per_s": omega,
        "period_s": period,
        "two_periods_s": 2 * period,
        "parameters": counted(wanted.linear),
    }


def counted(model: LinearSystem) -> int:
    """Parameters of the structure, as the paper counts them: initial conditions included."""
    left_out: set[str] = set()
    if isinstance(model, StoreyFrame):
        each = (f"{name}{floor + 1}" for name in "cI" for floor in range(model.floors))
        left_out = {"I", "rayleigh_mass", "rayleigh_stiffness", *each}
    return len(set(model.parameters) - left_out)


def envelope_numbers(dataset: xarray.Dataset) -> Document:
    """Extremes over time at the lowest level, widths, errors, cost."""
    lowest = dataset.isel(alpha=0)
    columns = {
        "min": lowest["lower"].min("time").values,
        "max": lowest["upper"].max("time").values,
        "mean_width": (lowest["upper"] - lowest["lower"]).mean("time").values,
    }
    if "error" in dataset:
        columns["error"] = lowest["error"].max("time").values
    return {
        **{key: by_output(dataset, column) for key, column in columns.items()},
        "alpha": dataset["alpha"].values,
        "peak": outcomes.peak_document(dataset),
        **{name: dataset.attrs[name] for name in COST},
        "step": float(dataset["time"].values[1]),
        **(told(dataset, *GAP) if "gap" in dataset.attrs else {}),
        **proved_numbers(dataset),
        **told(dataset, *CLAIM),
    }


def told(dataset: xarray.Dataset, *names: str) -> Document:
    """Those of the attributes that there are."""
    return {name: dataset.attrs[name] for name in names if name in dataset.attrs}


def by_output(dataset: xarray.Dataset, column: Array) -> dict[str, float]:
    """A number for each output, by its name."""
    names = [str(name) for name in dataset["output"].values]
    return dict(zip(names, map(float, column), strict=True))


def proved_numbers(dataset: xarray.Dataset) -> Document:
    """Proved extremes over time at the lowest level, where there are any."""
    if "proved_lower" not in dataset:
        return {}
    lowest = dataset.isel(alpha=0)
    least, most = lowest["proved_lower"].min("time"), lowest["proved_upper"].max("time")
    ends = {"min": by_output(dataset, least.values), "max": by_output(dataset, most.values)}
    return {"proved": {**ends, "gap": float(dataset.attrs["proved_gap"])}}
