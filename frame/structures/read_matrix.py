"""Matrices of a frame program, from its own files or those of Matrix Market, NumPy, SciPy or CSV.

What a file states of itself is checked before memory is taken or a library sees it: sizes against
the unknowns and the memory that is free, indices against the shape, text against its alphabet.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from io import StringIO
from itertools import compress
from math import isnan
from pathlib import Path

import numpy as np

from alphacut.base.apart import read_apart
from alphacut.base.array_files import Numbers, names_in_npz, read_npy, read_npz
from alphacut.base.arrays import Array
from alphacut.base.csv_columns import NUMBER
from alphacut.base.errors import RefusedError, path_of, printable, require
from alphacut.base.memory import require_free_memory, require_text
from alphacut.base.stated import Stated, require_overrides, settled, warn_of_overrides
from alphacut.base.units import (
    FORCE,
    FREQUENCY,
    TRANSFORMED,
    Mention,
    decoded,
    has_unknown_words,
    mentions,
    without_units,
    word_of,
)
from alphacut.frame.records.stated import FACTOR
from alphacut.frame.structures.entry_lists import (
    NamedMatrix,
    chosen_place,
    read_abaqus,
    read_calculix,
)
from alphacut.frame.structures.mapdl import read_full
from alphacut.frame.structures.matrix_market import (
    matrix_market,
    require_last_line,
    require_size,
)
from alphacut.frame.structures.nastran import read_dmig, read_op4

# The allowed value in messages of all formats.
ALLOWED = "a file .mtx, .sti, .mas, .pch, .op4, .full, .npz, .npy or .csv of finite real numbers"
# Rows of the largest matrix where nothing else is said: it is dense here, and takes 200 MB.
MAX_ROWS = 5000
# Abaqus writes 1e36 or more on the diagonal of an unknown that it holds. No spring comes near it.
HELD_STIFFNESS = 1e35
# Quantities by the dimensions of units.
_QUANTITIES = {
    FORCE: "force", "m": "length", "s": "time", "rad": "angle",
    "kg": "mass", "kg m2": "mass", "kg m": "mass", "kg s-2": "stiffness", "kg m2 s-2": "stiffness",
    "kg m2 rad-1 s-2": "stiffness", "kg s-1": "damping", "kg m2 s-1": "damping",
    "kg m2 rad-1 s-1": "damping", "kg m s-1": "damping",
}  # fmt: skip
_UNKNOWN_PART = r"(?i)(?<![^\W\d_])(?!mass)[^\W\d_]{2,4}\s*/\s*$"
# Words that are a unit which is not known, in brackets or behind a colon.
_UNKNOWN_UNIT = (
    r"(?i)\[(?!SI\]|[KMC]\w?\])[^\W\d_][^\s\[\]]{0,9}\]|\bunits?\s*[:=]\s*(?!SI\b|consist)[^\W\d_]"
    r"|\b(?:mas+\w*|st[ei]+f\w*|entries|values|werte)\s+(?:in|en)\s+(?!SI\b)[^\W\d_]{2,}\W*$"
)
_NAMES = {"mass": "mass|trägheit", "stiffness": "stiff|steif|rigid", "damping": "damp|dämpf|amort"}
# What stands before the unit of all entries, where that has a number.
_IN_UNITS = r"(?i)\b(?:in|units?(?:\s+of)?)\W*$|[\[(]\s*$|^\W*$"
# Words of numbers that are no entries in units of SI, whatever units stand beside them.
_OTHER_NUMBERS = (
    r"(?i)\b(?:weights?|poids|pes[io]s?|gewicht\w*|compliance|flexibility|half|halved|doubled|twice|imperial|cgs|customary|ratios?"
    rf"|relative|us\s+units|wtmass\W+(?!1?\.?0*\s*$).*)\b|%|\bp(?:er|our?|or|ro)\s?[cz]i?ent|\bscaled\b|\bnegative\s+of|\bmass\w*\s+as\s+forces?"
    rf"|{TRANSFORMED}|\b[KMC]\^?\(?-1\b|\b[KMC]\s*/\s*\w{{1,3}}\b"
    r"|(?:1/\d|\d\s*[*·×])\s*[KMC]\b|\btimes\s+[a-z]"
)


def read_matrix(
    path: str | Path,
    *,
    name: str = "",
    max_rows: int = MAX_ROWS,
    unknowns: Sequence[str] = (),
    override: Sequence[str] = (),
    quantity: str = "",
) -> Array:
    """Read a matrix, as of masses or stiffnesses, from a file; a sparse one becomes dense.

    Args:
        path: File of Matrix Market or of Abaqus's ``*MATRIX OUTPUT`` (.mtx), of CalculiX's
            ``*FREQUENCY, SOLVER=MATRIXSTORAGE`` (.sti and .mas, with .dof beside), of Nastran's
            DMIG cards (.pch, .bdf or .nas) or OUTPUT4 (.op4), of MAPDL (.full), of
            `scipy.sparse.save_npz` or `numpy.savez` (.npz), of `numpy.save` (.npy), or of numbers
            between commas, semicolons or blanks (.csv).
        name: Name of the array in a .npz, .pch or .op4 file of several; K or M of a .full file.
        max_rows: Largest number of rows and of columns, as the number of unknowns.
        unknowns: Names of the rows to return, in their order, where the file names its own
            (`read_unknowns`). Unknowns that are left out are held, and their rows go; those that
            the file does not have are rows of zeros, as of unknowns without mass. A file without
            names is returned as it is.
        override: ``["unit"]`` where a comment in the file states a wrong unit of its numbers.
        quantity: "mass", "stiffness" or "damping", where the unit in the file must be that of it.

    Returns:
        The matrix, shape (n, m); or a vector, shape (n,), where the file has one. Its numbers are
        those of the file, but where a comment states kN or MN with m, or t, they are turned to SI.

    Raises:
        RefusedError: The file cannot be read, holds something else, or more than allowed; it states
            units whose numbers are no multiples of those in SI, as mm beside rotations; or it names
            unknowns, and none of these.

    Example:
        >>> read_matrix("cases/plane-frame/stiffness1.mtx").shape
        (18, 18)
    """
    require_overrides(override, ("unit",))
    file = path_of("path", path)
    array, names = _read_named(file, name, max_rows=max_rows)
    warn_of_overrides(file.name, override)
    factor = 1.0 if override else _stated_factor(file, name, quantity)
    if names and unknowns:
        array = _arranged(file.name, array, names, unknowns)
    shape = " × ".join(str(n) for n in array.shape)
    cure = "save numbers, as array.astype(float)"
    require(array.dtype.kind in "uif", file.name, f"an array of {array.dtype.name}", ALLOWED, cure)
    is_matrix = array.ndim in (1, 2) and array.size > 0
    cure = "save two dimensions, as array[0] of three" if array.ndim > 2 else ""
    require(is_matrix, file.name, f"an array of {shape or 'no'} numbers", ALLOWED, cure)
    require_size(file.name, array.shape, max_rows)
    require_free_memory(file.name, 8.0 * array.size, f"{array.size} numbers")
    wrong = np.argwhere(~np.isfinite(array))
    if len(wrong):
        index = tuple(wrong[0])
        place = f"row {index[0] + 1}"
        if array.ndim == 2:
            place += f", column {index[1] + 1}"
        cure = "write finite numbers there"
        raise RefusedError(file.name, f"{array[index]} at {place}", ALLOWED, cure)
    return factor * np.array(array, float)


def _texts_in(path: Path, member: str) -> Iterator[tuple[str, str]]:
    """Yield what may state a unit, with its place: comments, names and texts of arrays."""
    suffix = path.suffix.lower()
    if suffix == ".npz":
        for name in names_in_npz(path):
            if member in ("", name):
                yield name.replace("_", " "), "in the name of its array"
            if re.search("(?i)unit|meta|info|desc|comment|note|attr", name):
                yield f"unit {read_npz(path, name, kinds='SU')}", f"array {name}"
    if suffix in (".npz", ".npy", ".op4", ".full"):
        return
    content = path.read_bytes()
    for comment in re.finditer(
        rb"(?m)(?:^[ \t]*(?:%(?!%MatrixM)|\$|\*\*|//)|#|PARAM\W+WTMASS).*$", content
    ):
        row = content.count(b"\n", 0, comment.start()) + 1
        if text := decoded(comment[0]).lstrip(" \t\r%#$*/"):
            yield text, f"line {row}"


def _stated_factor(path: Path, member: str, quantity: str) -> float:
    """Return the factor to SI of the numbers of a matrix, by the units that its file states.

    In a system of units with m and s the numbers of stiffnesses, dampings and masses differ from
    those in SI by the factor of its force: of kN (with t) 1e3, of MN 1e6. Other lengths change
    those of rotations and of displacements differently.

    Raises:
        RefusedError: It states other units, two of different factors, or the unit of another
            quantity than the one asked for; or a value beside a unit that may be that of the
            numbers.
    """
    stated: list[Stated] = []
    named: set[str] = set()
    kinds = {".sti": {"stiffness"}, ".mas": {"mass"}}.get(path.suffix.lower(), set())
    unsure: list[Stated] = []
    cure = "write the matrix in N, m, kg, or say override = ['unit'] if the comment is wrong"
    for line, where_it_stands in _texts_in(path, member):
        place = f"{path.name}, {where_it_stands}"
        is_name = "name" in where_it_stands
        units = [one for one in mentions(line) if not is_name or (one.is_sure and not one.numbers)]
        # A number beside a unit may be a factor, as in "to be multiplied by 1e6 (N/m)".
        are_multiplied = r"(?i)\b(?:multipl\w*|divide\w*|factor|times)\b[^,;]*$"
        has_factor = any(one.numbers and re.search(are_multiplied, one.before) for one in units)
        rest = without_units(line, units)
        named |= {kind for kind, words in _NAMES.items() if re.search(words, rest, re.IGNORECASE)}
        # "mass = weight / g" is a mass.
        is_mass = re.search(r"(?i)\bmass\w*\s*=", line) is not None
        is_other = re.search(_OTHER_NUMBERS, rest) is not None and not is_mass
        # Of a unit in a script that is not known nothing would be seen.
        is_other |= not units and has_unknown_words(rest)
        # Of a unit of which a part is not known, as "Tn/m", nothing else would be seen.
        is_other |= any(re.search(_UNKNOWN_PART, x.before) for x in units)
        is_other |= any(re.match(r"\s*/\s*[^\W\d_]", x.behind) for x in units)
        is_other |= re.search(_UNKNOWN_UNIT, rest) is not None
        # As "N/(m kg)", of which "N/(m" is understood.
        is_other |= any(x.text.count("(") > x.text.count(")") for x in units)
        allowed = f"entries of {quantity or 'stiffness, damping or mass'} in units"
        # Units of mass and force in one product are a list of them, as kN-m-t.
        is_other_unit = any(
            x.is_sure and not x.numbers and "kg2" not in x.dimension
            and x.dimension not in _QUANTITIES and _metric_factor(x) != 0
            for x in units
        )  # fmt: skip
        is_of_entries = not is_other_unit and (is_name or not is_other)
        require(is_of_entries, place, line.strip()[:60], allowed, cure)
        units = [x for x in units if x.dimension and not (x.numbers and _is_value_of_another(x))]
        is_of_numbers = (
            any(x.is_sure for x in units)
            or re.search(r"(?i)scal|multipl|divi|times|fa[ck]t|[a-z]/1|[x×*·]\s*\d|\bin\s+1", rest)
            is not None
        )
        has_factor |= is_of_numbers and re.search(FACTOR, rest, re.IGNORECASE) is not None
        has_factor |= any(
            one.is_sure
            and one.is_multiple
            and (any(map(isnan, one.numbers)) or re.search(_IN_UNITS, one.before))
            for one in units
        )
        require(not has_factor, place, line.strip()[:60], "units without a factor", cure)
        for one in units:
            factor = _metric_factor(one)
            allowed = "units of SI, or kN and t with m"
            require(factor != 0 or not one.is_sure, place, f"in {one.shown}", allowed, cure)
            is_of_entries = one.is_sure and not one.is_multiple
            if factor:
                where = stated if is_of_entries else unsure
                where.append(Stated(factor, one.shown, where_it_stands))
            kind = _QUANTITIES.get(one.dimension, "list")
            # A force alone in brackets is the unit of each number, and of no matrix.
            if kind == "force" and one.behind.startswith(("]", ")")):
                kind = "a force"
            is_length = kind == "length" and not one.numbers
            kinds |= {kind} if is_of_entries or is_length else set()
    found = settled(path.name, "unit", stated)
    # Units of forces and of something else, or of masses, lengths and times, are a system.
    is_system = kinds <= {"list", "force", "mass", "length", "time", "angle"}
    is_system &= "list" in kinds or ("force" in kinds and len(kinds) > 1) or len(kinds) > 2
    if (is_system or not kinds) and len(named) == 1:
        kinds, is_system = named, False
    is_asked = not quantity or not kinds or quantity in kinds or is_system
    what = f"of {' and '.join(sorted(kinds))}, by {found or 'its words or ending'}"
    require(is_asked, path.name, what, f"of {quantity}", "name the file of that quantity")
    taken = found or Stated(1.0, "of SI")
    for doubtful in unsure:
        settled(path.name, "unit", [doubtful], taken)
    return taken.value


def _is_value_of_another(one: Mention) -> bool:
    """Return whether a value is that of a length, a mass or a time, and not of the entries."""
    is_of_another = "m-" in one.dimension or one.dimension in ("m", "kg", "s", "rad", FREQUENCY)
    return is_of_another and re.search(_IN_UNITS, one.before) is None


def _metric_factor(one: Mention) -> float | None:
    """Return the factor of forces and masses in a unit; 0 of other units than with m and s.

    None stands for a unit that has neither, as m or s.
    """
    factor = None
    for name, power in one.unit.atoms:
        word = word_of(name)
        assert word is not None
        # Masses and forces over a length, an area or a volume are loads, densities or pressures.
        is_metric = word.factor in (1.0, 1e3, 1e6, 1e9) and "m-" not in one.dimension
        if "kg" in word.dimension:
            if not is_metric or power != 1 or factor not in (None, word.factor):
                return 0.0
            factor = word.factor
        elif word.factor != 1 or word.dimension not in ("m", "s", "rad"):
            return 0.0
    return factor


def read_unknowns(path: str | Path, *, name: str = "", held: bool = False) -> tuple[str, ...]:
    """Return the names of the free unknowns of a matrix in a file, in the order of its rows.

    They are NODE.DIRECTION, with the program's own numbers: "12.1" is node 12 along 1; of MAPDL it
    is "12.UX". Unknowns that a boundary condition holds are left out; Abaqus adds 1e36 to their
    stiffness.

    Args:
        path: File of Abaqus in the formats MATRIX INPUT or LABELS (.mtx), of CalculiX (.sti or
            .mas) with its .dof beside, of Nastran's DMIG cards, or of MAPDL (.full).
        name: Name of the matrix in a file of several.
        held: Whether the names of the held unknowns are returned instead.

    Raises:
        RefusedError: The file cannot be read, or has a matrix whose rows are not named.
    """
    file = path_of("path", path)
    array, names = _read_named(file, name, max_rows=MAX_ROWS)
    cure = "let *MATRIX OUTPUT write FORMAT=LABELS, or keep the .dof of a .sti or .mas beside it"
    require(bool(names), file.name, "without names of unknowns", "a file that names them", cure)
    is_free = np.asarray(array.diagonal(), float) < HELD_STIFFNESS
    return tuple(compress(names, ~is_free if held else is_free))


def _read_named(path: Path, name: str, *, max_rows: int) -> NamedMatrix:
    """Return the array in a file and the names of its rows; empty where it has none.

    Raises:
        RefusedError: The file cannot be read, or holds no matrix.
    """
    try:
        return _read_by_ending(path, name, max_rows=max_rows)
    except RefusedError:
        raise
    except Exception as error:  # whatever the readers of files, texts and archives raise
        reason = getattr(error, "strerror", None) or printable(error, 80) or type(error).__name__
        raise RefusedError(printable(path.name, 80), reason, ALLOWED) from None


def _arranged(file: str, array: Numbers, names: Sequence[str], unknowns: Sequence[str]) -> Array:
    """Return the rows and columns of a matrix that have these names, in their order.

    Args:
        file: Name of the file, for the message.
        array: Shape (names, names).
        names: Names of its rows.
        unknowns: Names of the rows to return. Those that are not in `names` give zeros.

    Raises:
        RefusedError: None of the unknowns is in `names`.
    """
    place_of = {name: place for place, name in enumerate(names)}
    known = [k for k, unknown in enumerate(unknowns) if unknown in place_of]
    value = f"of unknowns {', '.join(names[:4])} …"
    cure = "name unknowns as the file does, NODE.DIRECTION by number"
    require(bool(known), file, value, f"unknowns as {', '.join(unknowns[:4])}", cure)
    places = [place_of[unknowns[k]] for k in known]
    arranged = np.zeros((len(unknowns), len(unknowns)))
    arranged[np.ix_(known, known)] = array[np.ix_(places, places)]
    return arranged


def _read_by_ending(path: Path, name: str, *, max_rows: int) -> NamedMatrix:
    """Return the array in a file, whose ending and first line tell its format.

    The array may have any number of axes and any type of numbers, and entries that are not finite;
    the caller checks it. A sparse matrix becomes dense.

    Args:
        path: The file.
        name: Name of the array in a .npz file of several; empty for the only one.
        max_rows: Largest number of rows and of columns of a sparse matrix or of a .mtx file. A
            file with names may have as many as `MAX_ROWS`, of which the caller takes some.

    Raises:
        RefusedError: The file is of another type, with a hint for known ones, or holds no matrix;
            or its last line does not end, as of a file of text that is cut off.
        Exception: Whatever readers of files and archives raise for damaged or missing ones.
    """
    ending = path.suffix.lower()
    if ending == ".npy":
        return NamedMatrix(read_npy(path))
    if ending == ".npz":
        return NamedMatrix(_read_archive(path, name, max_rows=max_rows))
    if ending in (".mtx", ".sti", ".mas"):
        require_text(path)
        content = path.read_bytes()
        require_last_line(path.name, content)
        max_named_rows = max(max_rows, MAX_ROWS)
        if ending != ".mtx":
            return read_calculix(path, content, max_rows=max_named_rows)
        if re.match(rb"\s*[-\d*]", content):
            return read_abaqus(path.name, content, max_rows=max_named_rows)
        return NamedMatrix(matrix_market(path.name, content, max_rows=max_rows))
    if ending == ".full":
        require_text(path)
        return read_full(path, member=name, max_rows=MAX_ROWS)
    if ending in (".op4", ".pch", ".bdf", ".nas"):
        require_text(path)
        content = path.read_bytes()
        if b"\0" not in content:  # .op4 may be binary
            require_last_line(path.name, content)
        if ending == ".op4":
            return NamedMatrix(read_op4(path, content, member=name, max_rows=max_rows))
        return read_dmig(path.name, content, member=name, max_rows=MAX_ROWS)
    if ending == ".csv":
        require_text(path)
        return NamedMatrix(_read_csv(path.name, path.read_text(encoding="utf-8-sig")))
    cure = "rename numbers alone to NAME.csv, Matrix Market to NAME.mtx; write others by numpy.save"
    raise RefusedError(path.name, f"of type {path.suffix or 'none'}", ALLOWED, cure)


def _read_csv(name: str, text: str) -> Array:
    """Return the numbers of a text, shape (rows, columns).

    In a text with semicolons these separate the numbers, and commas are decimal commas. Otherwise
    commas separate them, and in a text without either, blanks and tabs.

    Args:
        name: Name of the file, for messages.
        text: The text.

    Raises:
        RefusedError: A row has another text, or another count of numbers than the others.
    """
    require(bool(text.strip()), name, "", ALLOWED)
    numbers = re.sub("#.*", "", text)  # whose marks count, and not those in comments
    delimiter: str | None = ","
    # Where semicolons separate the cells, a comma can only be a decimal comma. Without any of both,
    # blanks separate them, which NumPy calls None.
    if ";" in numbers:
        delimiter = ";"
        text = text.replace(",", ".")
        numbers = numbers.replace(",", ".")
    elif "," not in numbers:
        delimiter = None
    try:
        return np.loadtxt(StringIO(numbers), delimiter=delimiter, ndmin=2)
    except ValueError:
        raise _wrong_row(name, text, delimiter) from None


def _wrong_row(name: str, text: str, delimiter: str | None) -> RefusedError:
    """Return, without raising it, the error about the first row that is unlike most others.

    A row is wrong if a cell is no number, or if it has another count of cells than most rows have;
    if all counts differ, the first row counts as right. Text behind # and empty lines do not count.

    Args:
        name: Name of the file.
        text: The text of the file, with one row at least.
        delimiter: What separates the numbers; None for blanks.
    """
    lines = {k: x.partition("#")[0] for k, x in enumerate(text.splitlines(), 1)}
    cells = {k: x.split(delimiter) for k, x in lines.items() if x.strip()}
    count, _ = Counter(len(row) for row in cells.values()).most_common(1)[0]
    for line, row in cells.items():
        are_numbers = all(NUMBER.fullmatch(cell.strip()) for cell in row)
        if not are_numbers or len(row) != count:
            allowed = f"rows of {count} numbers, as 1.5,0,2e6, without a head or names of rows"
            cure = "write numbers alone, in SI units; beside decimal commas part them by semicolons"
            return RefusedError(f"{name}, line {line}", lines[line].strip()[:60], allowed, cure)
    return RefusedError(name, "no matrix", ALLOWED)


def _read_archive(path: Path, name: str, *, max_rows: int) -> Numbers:
    """Return an array in a .npz file, or the sparse matrix in it, dense.

    Args:
        path: The file.
        name: Name of the array; empty for the only one.
        max_rows: Largest number of rows and of columns of a sparse matrix.

    Raises:
        RefusedError: There is no such array, or none is named and there are several; or an array is
            damaged.
    """
    names = names_in_npz(path)
    if set(names) >= {"format", "shape", "data"}:  # as scipy.sparse.save_npz writes it
        shape = read_npz(path, "shape", kinds="iu")
        require_size(path.name, tuple(int(n) for n in shape), max_rows)
        reader = "alphacut.frame.structures.read_matrix:dense_of_sparse"
        return read_apart(reader, path, library="SciPy")["matrix"]
    return read_npz(path, names[chosen_place(path.name, names, name)])


def dense_of_sparse(path: Path) -> dict[str, Numbers]:
    """Return the matrix in a file of `scipy.sparse.save_npz`: the reader that runs apart.

    SciPy's compiled code writes where wrong indices lead.

    Raises:
        Exception: Whatever SciPy raises of arrays that contradict one another.
    """
    from scipy import sparse

    matrix = sparse.load_npz(path)
    if matrix.format in ("csr", "csc"):
        matrix.check_format(full_check=True)
        if matrix.data.size != matrix.nnz:
            raise ValueError("unused entries")
    return {"matrix": matrix.toarray()}
