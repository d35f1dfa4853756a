"""A frame of storeys as a table: what each storey weighs, how high and how stiff it is."""

from __future__ import annotations

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.number_text import STANDARD_GRAVITY, Table, engineering, percent_text
from alphacut.frame.analyses.answer import table_of
from alphacut.frame.calculus.polynomials import Jet
from alphacut.frame.structures.storey import StoreyFrame


def storey_table(frame: StoreyFrame) -> Table:
    """Return a table of texts with a row for each storey at the nominal values, the top one first.

    The columns are the number of the storey, the weight of the floor on it under standard gravity,
    its stiffness; its height and the coefficient P/(k l) of the weight P that it carries, if the
    frame has heights; and the force at which it yields and its hardening, if columns yield.

    Example:
        >>> frame = StoreyFrame(masses=[2e3, 1e3], stiffness=[4e6, 2e6], lengths=[4.0, 3.0])
        >>> storey_table(frame).rows[0]
        ('2', '9.807 kN', '2.000 MN/m', '3.000 m', '0.16%')
    """
    p = {name: Jet.constant(np.array([value]), 0) for name, value in frame.parameters.items()}
    springs = frame.springs(p).value[0]
    second_order: Array = np.full(frame.floors, np.nan)
    if frame.lengths:
        second_order = frame.stability_coefficients({})
    forces: Array = np.full(frame.floors, np.nan)
    if frame.hardening:
        forces = springs * frame.yield_drifts(p).value[0]
    rows = []
    for z in reversed(range(frame.floors)):
        weight = frame.masses[z] * STANDARD_GRAVITY
        row = {
            "storey": str(z + 1),
            "weight": engineering(weight, "N"),
            "stiffness": engineering(float(springs[z]), "N/m"),
        }
        if frame.lengths:
            row["height"] = engineering(frame.lengths[z], "m")
            row["P/(k l)"] = percent_text(float(second_order[z]), 2)
        if frame.hardening:
            row["yields at"] = engineering(float(forces[z]), "N")
            row["hardening"] = percent_text(frame.hardening[z])
        rows.append(row)
    return table_of(rows)


def assumptions(frame: StoreyFrame) -> list[str]:
    """Return sentences on what the model of the frame assumes."""
    sentences = ["Floors are rigid and move sideways alone; each column is clamped at both ends."]
    if frame.stiffness:
        sentences = ["Floors move sideways alone, each storey as a spring of the given stiffness."]
    if frame.gravity:
        sentences.append("Weights reduce the stiffness of each storey by P/l (P-Delta).")
    else:
        sentences.append("Second-order effects of the weights (P-Delta) are left out.")
    if frame.hardening:
        words = "Storeys yield bilinearly with kinematic hardening, without loss of strength."
        sentences.append(words)
    else:
        sentences.append("All members stay elastic.")
    if frame.ratios:
        ratios = ", ".join(percent_text(ratio) for ratio in frame.ratios.values())
        sentences.append(f"The damping ratio of the modes is {ratios}.")
    if any(frame.dampers):
        where = "between the storeys"
        if frame.damper_placement == "ground":
            where = "from the floors to the ground"
        sentences.append(
            f"Dashpots {where} damp the motion, too. Shears, the base shear and the overturning"
            " moment are those of the columns, without the dashpots."
        )
    if any(frame.rayleigh):
        sentences.append("Rayleigh damping is added.")
    if not (frame.ratios or any(frame.dampers) or any(frame.rayleigh)):
        sentences.append("Nothing damps the motion.")
    return sentences
