"""Section on a structure from the matrices of a frame program."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import BeforeValidator, Field, PlainValidator, ValidationInfo, model_validator

from alphacut.base.arrays import Array
from alphacut.base.errors import RefusedError, by_keys, require
from alphacut.case.structure import (
    LOSS_STAND_IN,
    DampingRatios,
    Ground,
    MaterialDamping,
    Structure,
    StructureSection,
    damping_ratios_by_name,
)
from alphacut.case.types import (
    Length,
    NotEmpty,
    Section,
    after,
    case_file,
    distinct,
    require_alone,
    text,
)
from alphacut.frame import (
    MatrixStructure,
    affine_terms,
    damping_from_loss,
    read_matrix,
    read_unknowns,
)
from alphacut.frame.structures.matrix import Monomial, modal_energy_fractions, require_symmetric
from alphacut.frame.structures.quantities import Output, require_names
from alphacut.frame.structures.read_matrix import HELD_STIFFNESS, MAX_ROWS
from alphacut.fuzzy import Crisp, FuzzyNumber
from alphacut.io.quantity import MAX_MAGNITUDE, parse_fuzzy_in_any_unit, parse_number


def _term(value: object, info: ValidationInfo) -> tuple[Monomial, Array]:
    """Return the factor and the matrix of one term of M, K or D.

    Args:
        value: Pair of texts [FACTOR, FILE], or the pair to return. FACTOR is a product of powers of
            parameters, such as "Ec*I/l^3". FILE is a matrix file, in the folder of the case;
            "K.npz:columns" names one array of several in it.
        info: Context of the case; its `data` has the names of the unknowns if these were accepted.

    Returns:
        The factor as a function of the parameters, and the array, shape (unknowns, unknowns). The
        shape is not checked if the names of the unknowns were refused.

    Raises:
        RefusedError: The value is no such pair, the factor is no product of powers, the file is
            missing or holds no matrix of this shape, or the matrix is not symmetric or zero.
    """
    match value:
        case (Monomial() as monomial, np.ndarray() as array):  # of exports
            return monomial, array
        case [str(factor), str(file)]:
            return Monomial.parse(factor), _array(file, info)
    raise RefusedError("", value, 'a pair [factor, file], as ["Ec*I", "columns.mtx"]')


def _array(file: str, info: ValidationInfo) -> Array:
    """Return the matrix in a file of the case, shape (unknowns, unknowns); see `_term`."""
    path, member = _file_and_member(file, info)
    # Pydantic leaves refused keys out: without names the number of rows is not judged.
    unknowns = info.data.get("unknowns", ())
    rows = len(unknowns) or MAX_ROWS
    override = info.data.get("override", [])
    array = read_matrix(
        path,
        name=member,
        max_rows=rows,
        unknowns=unknowns,
        override=override,
        quantity=info.field_name or "",
    )
    if unknowns:
        names = unknowns
        held: tuple[str, ...] = ()
        with suppress(RefusedError):  # of files that name no unknowns
            names = read_unknowns(path, name=member)
            held = read_unknowns(path, name=member, held=True)
        of_files = (info.context or {}).setdefault("names_of_files", {})
        for key, found in ((info.field_name, names), ("held", held)):
            of_files.setdefault(key, {}).update(dict.fromkeys(found))
        _require_shape(path.name, array, rows)
        require_symmetric(path.name, array, unknowns)
    largest = float(np.abs(array).max())
    allowed = f"entries up to {MAX_MAGNITUDE:g} in SI units"
    cure = "leave out unknowns that are held" if largest >= HELD_STIFFNESS else ""
    require(largest <= MAX_MAGNITUDE, path.name, f"with an entry of {largest:g}", allowed, cure)
    # A term of zeros does nothing: its author meant another array.
    require(bool(array.any()), path.name, "zeros throughout", "a matrix with entries")
    return array


def _terms_of_exports(value: object, info: ValidationInfo) -> object:
    """Return the terms of a matrix for which a list of tables names exports; see `affine_terms`.

    Args:
        value: List of tables, each with a matrix `file` and the values of the parameters for which
            it was written, as { file = "soft.mtx", E = "100 GPa" }; or anything else, which is
            returned as it is.
        info: As of `_term`.

    Raises:
        RefusedError: A file or a parameter cannot be read, or the matrix is not affine.
    """
    if not isinstance(value, list) or not any(isinstance(export, dict) for export in value):
        return value
    exports: list[tuple[dict[str, float], Array]] = []
    for export in value:
        is_export = isinstance(export, dict) and isinstance(export.get("file"), str)
        require(is_export, "", export, 'tables alone, as { file = "soft.mtx", E = "100 GPa" }')
        parameters = {
            name: _parameter(number, info)[0].nominal
            for name, number in export.items()
            if name != "file"
        }
        exports.append((parameters, _array(export["file"], info)))
    terms = affine_terms(
        exports,
        unknowns=info.data.get("unknowns", ()),
        is_affine=info.data.get("affine", False),
    )
    return [(Monomial.parse(str(factor)), array) for factor, array in terms]


def _file_and_member(text: str, info: ValidationInfo) -> tuple[Path, str]:
    """Return the file and the name of one of its matrices that a text such as "K.npz:columns" has.

    Raises:
        RefusedError: There is no such file in the folder of the case.
    """
    name, _, member = text.partition(":")
    return case_file(name, info), member


def _unknowns(value: object, info: ValidationInfo) -> object:
    """Return the unknowns of a matrix file whose name stands in their place.

    Raises:
        RefusedError: There is no such file, or it names no unknowns.
    """
    if not isinstance(value, str):
        return value
    path, member = _file_and_member(value, info)
    return read_unknowns(path, name=member)


def _require_shape(name: str, array: Array, n: int) -> None:
    """Refuse an array in a file that is not a matrix of n rows and n columns."""
    cure = f"the case names {n} unknowns, and a matrix has a row and a column for each"
    if array.shape == (n,):
        cure = "of a diagonal make a matrix, by numpy.diag"
    value = f"of shape ({', '.join(map(str, array.shape))})"
    require(array.shape == (n, n), name, value, f"({n}, {n})", cure)


def _parameter(value: object, info: ValidationInfo) -> tuple[FuzzyNumber, str]:
    """Return a parameter of the matrices in SI units, and this unit, whatever its dimension.

    Args:
        value: A number, or a text such as "30 GPa ± 5 %".
        info: Context of the validation, which is not used.

    Raises:
        RefusedError: The value is no quantity.
    """
    try:
        return parse_fuzzy_in_any_unit(value)
    except ValueError as error:
        raise RefusedError("", value, 'a quantity, as "30 GPa ± 5 %" or 1.2', str(error)) from None


def _one_direction(value: object) -> object:
    """Refuse what is neither a direction of the unknowns nor a table by unknown."""
    allowed = 'a direction of the unknowns, as "x", or a table by unknown'
    cure = 'of a list make a table: {"5.x" = 1, "5.y" = 0.3} has the ground move along both'
    require(isinstance(value, str | dict), "", value, allowed, cure)
    return value


Terms = Annotated[
    tuple[Annotated[tuple[Monomial, Array], PlainValidator(_term)], ...],
    BeforeValidator(_terms_of_exports),
]


def _entry(value: object) -> float:
    """Return an entry of a row; refuse a magnitude that no quantity has."""
    return parse_number(value, "")


Entry = Annotated[float, text(_entry)]
Parameters = dict[str, Annotated[tuple[FuzzyNumber, str], text(_parameter)]]
Direction = Annotated[str | dict[str, Entry], BeforeValidator(_one_direction)]
"""Direction of the ground: that of unknowns NODE.DIRECTION, or the influence vector by unknown."""


def _si_unit(value: object, _: ValidationInfo) -> str:
    """Return the value as a text if it is a coherent SI unit, or no known unit.

    Rows act on unknowns in SI units, so that a multiple such as kN would make the output a thousand
    times too large.

    Raises:
        RefusedError: The unit is a multiple of an SI unit.
    """
    unit = str(value)
    # Of "1 kN" the parser returns the number 1000 and the SI unit "N".
    try:
        number, si = parse_fuzzy_in_any_unit(f"1 {unit}")
    except ValueError:
        return unit
    cure = f"write {si}; a limit may be in {unit}"
    require(number.nominal == 1 or not si, "", unit, "SI units, as m, N or N*m", cure)
    return unit


class ObservedRow(Section):
    """One output of a structure from matrices: a row on the unknowns, or a drift of two of them.

    An acceleration is the absolute one, relative to the ground plus that of the ground;
    displacements, velocities and drifts are relative to the ground.

    Args:
        of: what of the unknowns the row takes.
        unit: SI unit of the output, as N or N*m; m, m/s or m/s^2 unless given, none of a drift
            ratio.
        row: entries of the row by unknown, as {"5.x" = 1}.
        upper: in place of the row: the unknown above, as "5.x", of a drift of the storey between
            two.
        lower: the unknown below; the ground unless given.
        height: height of the storey, by which the drift is divided to a drift ratio.
        factor: factor of the row, as "E*I*l^-2", 1 unless given.
    """

    of: Literal["displacement", "velocity", "acceleration"] = "displacement"
    unit: Annotated[str | None, text(_si_unit)] = None
    row: dict[str, Entry] = Field(default_factory=dict)
    upper: str = ""
    lower: str = ""
    height: Length | None = None
    factor: Annotated[Monomial, text(lambda x, _: Monomial.parse(str(x)))] = Monomial(1.0, ())

    def require_complete(self, key: str) -> None:
        """Refuse an output that is neither a row nor a drift, or both; `key` is its own."""
        if self.upper:
            require_alone(f"{key}.row", bool(self.row), "upper")
            require(self.upper != self.lower, f"{key}.lower", self.lower, "another than upper")
            return
        allowed = 'entries of the row by unknown, as {"5.x" = 1}, or upper and lower of a drift'
        require(bool(self.row), f"{key}.row", None, allowed)
        for name in ("lower", "height"):
            allowed = 'upper beside it, the unknown above, as "5.x"'
            require(not getattr(self, name), f"{key}.{name}", "without upper", allowed)

    @property
    def si_unit(self) -> str:
        """SI unit of the output."""
        units = {"displacement": "m", "velocity": "m/s", "acceleration": "m/s^2"}
        unit = units[self.of]
        if self.height is not None:
            unit = {"m": "", "m/s": "1/s", "m/s^2": "1/s^2"}[unit]
        return unit if self.unit is None else self.unit

    @property
    def entries(self) -> dict[str, float]:
        """Entries of the row by unknown."""
        if self.row:
            return self.row
        entry = 1.0 / (self.height or 1.0)
        entries = {self.upper: entry}
        if self.lower:
            entries[self.lower] = -entry
        return entries


class MatricesSection(StructureSection):
    """Linear structure from matrices in SI units, each times a product of powers of parameters.

    A modulus that a stage computes takes the place of parameter E.

    Args:
        unknowns: names of the unknowns in the order of the matrices, as NODE.DIRECTION; or a matrix
            file that names them.
        parameters: quantities, crisp or fuzzy, by name.
        affine: whether matrices of exports are known to be affine in their parameters: then two
            exports for one parameter are enough, and none tells whether it is so.
        override: what comments of files state wrongly: SI units are taken.
        mass: pairs [factor, file] of M, or exports; none for stage static alone.
        stiffness: pairs [factor, file] of K; or tables { file = FILE, NAME = VALUE } of exports for
            several values of the parameters, of which K is a sum of terms with one parameter each.
        damping: pairs [factor, file] of D, or exports.
        damping_ratio: damping over the critical one, of all modes, or texts, one a mode from the
            slowest on: ["2 %", "[2, 3, 4] %", "5 %"]; "material" takes that of the loss factors of
            the cell, "material + 1 %" adds that of joints.
        direction: direction of the ground: it moves all unknowns NODE.DIRECTION; or how it moves
            each, by unknown.
        directions: in place of it, the directions of the components of each record: two horizontal
            ones, and perhaps the vertical one, as ["x", "y"].
        accelerogram: file of the ground's acceleration; motion is relative to it.
        outputs: observed quantities by name.
    """

    unknowns: Annotated[tuple[str, ...], NotEmpty, BeforeValidator(_unknowns), after(distinct)]
    parameters: Parameters
    affine: bool = False
    override: list[Literal["unit"]] = Field([])
    mass: Terms = ()
    stiffness: Annotated[Terms, NotEmpty]
    damping: Terms = ()
    damping_ratio: DampingRatios = ()
    direction: Direction = ""
    directions: tuple[Direction, ...] = ()
    accelerogram: Ground | None = None
    outputs: dict[str, ObservedRow]

    # Names of unknowns in the files of "mass", "stiffness" and "damping", and of those that a file
    # itself holds ("held"). A file without names counts as one that names all unknowns of the case.
    _names_of_files: Mapping[str, Collection[str]] = {}

    @model_validator(mode="after")
    def _keep_names_of_files(self, info: ValidationInfo) -> Self:
        """Keep the names of unknowns that the files have, for warnings."""
        self._names_of_files = (info.context or {}).get("names_of_files", {})
        return self

    @property
    def places(self) -> tuple[str, ...]:
        """Names of the unknowns, on which forces act."""
        return self.unknowns

    def structure(
        self, modulus: FuzzyNumber | None = None, loss: FuzzyNumber | None = None
    ) -> Structure:
        """Return the structure with its fuzzy parameters.

        Args:
            modulus: Young's modulus in Pa that takes the place of parameter "E", if there is one;
                None to keep what the case states.
            loss: Loss factor of the material, for `damping_ratio` "material"; None for a stand-in
                of 2 %. It is ignored otherwise.

        Returns:
            The model at the nominal values, and its parameters by name, crisp or fuzzy, with
            damping ratios as "zeta" or "zeta1", "zeta2" …

        Raises:
            RefusedError: An output or the direction of the ground names an unknown that is not
                there, or the matrices make no structure, for example because M is not positive
                definite.
        """
        damping = None
        ratios: dict[str, FuzzyNumber] = {}
        if isinstance(self.damping_ratio, MaterialDamping):
            damping = self.damping_ratio
        else:
            ratios = damping_ratios_by_name(self.damping_ratio, None)
        # A structure needs one parameter at least: if there is none, an unused one is added.
        numbers = {name: number for name, (number, _) in self.parameters.items()}
        numbers = numbers | ratios or {"scale": Crisp(1.0)}
        if modulus is not None and "E" in numbers:
            numbers["E"] = modulus
        rows: dict[str, Array] = {}
        for name, output in self.outputs.items():
            key = "row" if output.row else "upper, lower"
            row = self._vector_over_unknowns(f"outputs.{name}.{key}", output.entries)
            # A row of 3n entries is on displacements, velocities and accelerations, in this order.
            place = ("displacement", "velocity", "acceleration").index(output.of)
            rows[Output(name, output.si_unit)] = np.append(np.zeros(place * len(row)), row)
        patterns = self._ground_patterns()
        with by_keys("matrices: {}".format):
            model = MatrixStructure(
                {name: number.nominal for name, number in numbers.items()},
                mass=self.mass,
                stiffness=self.stiffness,
                damping=self.damping,
                observed=rows,
                ground=self.accelerogram,
                pattern=patterns[0],
                components=[(None, pattern) for pattern in patterns[1:]],
                ratios=tuple(ratios),
                row_factors={name: output.factor for name, output in self.outputs.items()},
            )
            # Where the material makes up a part of the stiffness only, it damps each mode by its
            # fraction of the strain energy. These fractions need the modes, and so a first model
            # without damping ratios.
            if damping is not None:
                ratios = self._material_damping_ratios(damping, model, loss or LOSS_STAND_IN)
                numbers |= ratios
                nominal = {name: number.nominal for name, number in numbers.items()}
                model = replace(model, parameters=nominal, ratios=tuple(ratios))
        units = {name: unit for name, (_, unit) in self.parameters.items()}
        return Structure(model, numbers, input_units=units)

    def warnings(self, structure: Structure | None) -> Iterator[str]:
        """Yield sentences on fuzzy parameters in no factor, and on unknowns that are not named.

        Args:
            structure: The structure, of which the masses that directions move are compared.
        """
        if structure is not None and isinstance(structure.model, MatrixStructure):
            from alphacut.frame.analyses.doubts import direction_doubts  # takes time to import

            yield from (f"matrices.directions: {x}" for x in direction_doubts(structure.model))
        used = set[str]()
        for factor, _ in (*self.mass, *self.stiffness, *self.damping):
            used.update(dict(factor.powers))
        for output in self.outputs.values():
            used.update(dict(output.factor.powers))
        yield from self.file_warnings()
        for name, (number, _) in self.parameters.items():
            if number.support.width > 0 and name not in used:
                yield f"matrices.parameters.{name} is in no factor: is a name misspelt?"

    def file_warnings(self) -> Iterator[str]:
        """Yield sentences on unknowns that the case, or only one of M and K, does not name."""
        names = dict.fromkeys(chain.from_iterable(self._names_of_files.values()))
        held = self._names_of_files.get("held", ())
        if unnamed := [x for x in names if x not in self.unknowns and x not in held]:
            shown = ", ".join(unnamed[:6])
            yield f"{len(unnamed)} unknowns of the files are not named, and so are held: {shown}"
        for key, other in (("mass", "stiffness"), ("stiffness", "mass")) if self.mass else ():
            of_key = self._names_of_files.get(key, ())
            of_other = self._names_of_files.get(other, ())
            if missing := [x for x in self.unknowns if x in of_other and x not in of_key]:
                shown = ", ".join(missing[:6])
                yield (
                    f"the files of matrices.{key} do not name {len(missing)} unknowns that those "
                    f"of {other} name, whose rows are zeros: {shown}; is a file cut off?"
                )

    def _material_damping_ratios(
        self, damping: MaterialDamping, model: MatrixStructure, loss: FuzzyNumber
    ) -> dict[str, FuzzyNumber]:
        """Return the damping ratios that follow from the loss factor of the material, by name.

        Young's modulus of this material is the parameter E.

        Args:
            damping: Has the damping ratio of joints, which is added to each.
            model: The structure without these ratios, at its nominal values.
            loss: Loss factor of the material.

        Returns:
            "zeta" of all modes if E is in every term of the stiffness matrix K. Otherwise "zeta1",
            "zeta2" … of each mode, in the order of rising frequency. They follow from the fraction
            of the mode's strain energy in the terms with E, in the nominal model.

        Raises:
            RefusedError: E is in no term of K.
        """
        has_modulus = ["E" in dict(factor.powers) for factor, _ in self.stiffness]
        require(any(has_modulus), "damping_ratio", "material", "a term of the stiffness with E")
        # All energy is in the material: each mode has the same ratio, and one parameter is enough.
        if all(has_modulus):
            return damping_ratios_by_name(damping, loss)
        ratios: list[FuzzyNumber] = []
        for fraction in modal_energy_fractions(model, np.flatnonzero(has_modulus)):
            ratio = damping_from_loss(loss, joints=damping.joints, energy_fraction=fraction)
            ratios.append(ratio)
        return damping_ratios_by_name(tuple(ratios), None)

    def _vector_over_unknowns(self, key: str, entries: Mapping[str, float]) -> Array:
        """Return entries by unknown as a vector, 0 at the others; refuse other names."""
        for name in entries:
            allowed = f"unknowns, as {', '.join(self.unknowns[:6])}"
            require(name in self.unknowns, f"matrices.{key}", name, allowed)
        return np.array([entries.get(name, 0.0) for name in self.unknowns])

    def _ground_patterns(self) -> list[Array]:
        """Return how each unknown moves rigidly with the ground, shape (unknowns,), by direction.

        Raises:
            RefusedError: A table names another unknown.
        """
        patterns: list[Array] = []
        for direction in self.directions or (self.direction,):
            if isinstance(direction, dict):
                patterns.append(self._vector_over_unknowns(self._direction_key, direction))
                continue
            # Rotations move with the ground only where a table says so: their direction is their
            # own.
            of_unknowns = [name.rpartition(".")[2] for name in self.unknowns]
            patterns.append(np.array([float(name == direction) for name in of_unknowns]))
        return patterns

    @property
    def direction_count(self) -> int:
        """Number of directions in which the ground moves, one for each component of a record."""
        return len(self.directions) or 1

    @property
    def _direction_key(self) -> str:
        """Name of the key that has the directions of the ground."""
        return "directions" if self.directions else "direction"

    def require_consistent(self) -> None:
        """Refuse outputs and parameters without usable names, and a record without a direction.

        Raises:
            RefusedError: There is no output; a name is not of letters, digits and underscores; the
                motion of the ground moves no unknown, or its directions are not two or three, or
                stand beside a single one; or the matrices make no structure.
        """
        require(bool(self.outputs), "matrices.outputs", None, "one output or more")
        require_names("matrices.parameters", self.parameters)
        outputs = [Output(name, output.si_unit) for name, output in self.outputs.items()]
        require_names("matrices.outputs", outputs)
        for name, output in self.outputs.items():
            output.require_complete(f"matrices.outputs.{name}")
        if self.has_key("directions"):
            require_alone("matrices.directions", self.has_key("direction"), "direction")
            allowed = 'two horizontal ones, and perhaps the vertical one, as ["x", "y"]'
            count = len(self.directions)
            require(count in (2, 3), "matrices.directions", f"{count} directions", allowed)
            cure = 'give each component a file, as records.files = [["x.AT2", "y.AT2"]]'
            is_single = self.accelerogram is None
            require(is_single, "matrices.accelerogram", "beside directions", "[records]", cure)
        if self.accelerogram is not None or self.direction or self.directions:
            self.require_pattern()
        _ = self.nominal  # refuses matrices that do not fit together

    def require_pattern(self) -> None:
        """Refuse a direction of the ground in which it moves no unknown.

        Unknowns are named NODE.DIRECTION, such as "5.x". The ground in direction "x" moves all
        unknowns whose name ends in ".x"; a table gives the displacement of each unknown for a unit
        displacement of the ground.

        Raises:
            RefusedError: A direction is missing, no unknown moves in it, or two directions are one.
        """
        key = f"matrices.{self._direction_key}"
        names = sorted({name.rpartition(".")[2] for name in self.unknowns})
        allowed = f"one of {', '.join(names[:8])}, or a table by unknown"
        cure = ""
        if not any("." in name for name in self.unknowns):
            cure = "name the unknowns NODE.DIRECTION, as 1.x, or write a table as { NAME = 1.0 }"
        patterns = self._ground_patterns()
        for direction, pattern in zip(self.directions or (self.direction,), patterns, strict=True):
            require(bool(pattern.any()), key, direction or None, allowed, cure)
        is_independent = np.linalg.matrix_rank(patterns) == len(patterns)
        require(is_independent, key, self.directions, "directions that differ")
