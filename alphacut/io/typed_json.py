"""Results as JSON documents and back: dataclasses of numbers, texts, arrays and others of these.

A document is what `json` reads and writes. Fields stand by their names; enumerations by their
value; arrays, tuples and lists as lists; named tuples and mappings as objects. Numbers that are not
finite are null in JSON, and nan when they are read. Fields that a dataclass makes itself are
written and not read.
"""

from __future__ import annotations

import types
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from functools import cache
from inspect import Parameter, signature
from typing import (
    Annotated,
    Any,
    Literal,
    TypeVar,
    Union,
    cast,
    get_args,
    get_origin,
    get_type_hints,
    is_typeddict,
)

import numpy as np
from numpy.typing import NDArray

T = TypeVar("T")


def to_document(value: object) -> Any:
    """Return a result as a JSON document, of dictionaries, lists, numbers, texts and None.

    Dataclasses and named tuples become dictionaries of their fields, enumerations their values,
    arrays and tuples lists, and keys of mappings texts. Numbers that are not finite stay, and the
    caller decides how they are written. Any other value is returned unchanged.

    Args:
        value: A dataclass, named tuple, mapping, list, tuple, array, enumeration, number, text or
            None, or any nesting of these.
    """
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if is_dataclass(value):
        return {x.name: to_document(getattr(value, x.name)) for x in fields(value)}
    if isinstance(value, tuple) and hasattr(value, "_asdict"):
        value = value._asdict()  # before tuples without names below
    if isinstance(value, Mapping):
        return {str(key): to_document(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [to_document(entry) for entry in value]
    return value


def from_document(kind: type[T], document: object, path: str = "") -> T:
    """Return the result of a kind that a JSON document holds, as `to_document` has written it.

    Args:
        kind: The type of the result: a dataclass, typed dict, named tuple, enumeration, float, int,
            bool, str, None, Any or object; a list, tuple, mapping, union, Literal or array of
            these with their arguments. Metadata of `Annotated` are functions that check the value,
            and raise ValueError.
        document: What `json` has read. Where a float is expected, null is NaN.
        path: Keys that lead to the document, for messages; empty for a whole one.

    Raises:
        ValueError: The document holds no such result. The message begins with the path of what is
            missing, unknown or of another type, as "peaks.0.value".
    """
    return cast("T", _read(kind, document, path))


def _read(kind: Any, document: Any, path: str) -> Any:
    """Return the value of a kind that a JSON document holds.

    Args:
        kind: A dataclass, typed dict, named tuple, enumeration, float, int, bool, str, None's type,
            list, dict, or a kind with arguments such as ``list[float]``. With Any or object the
            document itself is returned.
        document: What `json` has read: dict, list, str, int, float, bool or None.
        path: Keys that lead to the document, for messages; empty for a whole one.

    Returns:
        An object of the kind. For float it is NaN if the document is None, and true is no number.

    Raises:
        ValueError: The document holds no such value; the message begins with the path.
    """
    if get_origin(kind) is not None:
        return _read_parametrised(kind, document, path)
    if kind is Any or kind is object:
        return document
    # Python takes True for the number 1, JSON does not.
    is_bool = isinstance(document, bool)
    if kind is float:
        if document is None:
            return np.nan
        _require(isinstance(document, int | float) and not is_bool, document, path)
        return float(document)
    if is_dataclass(kind) or is_typeddict(kind) or hasattr(kind, "_field_defaults"):
        return _read_fields(kind, document, path)
    if issubclass(kind, Enum):
        return _checked(kind, document, path)
    # What remains are texts, whole numbers, truth values, None, and plain lists and dicts.
    _require(isinstance(document, kind) and not (kind is int and is_bool), document, path)
    return document


def _read_parametrised(kind: Any, document: Any, path: str) -> Any:
    """Return the value of a kind with arguments that a JSON document holds.

    Args:
        kind: ``Annotated[kind, function, …]``, whose functions raise ValueError for a wrong value;
            a union, of which the first kind that fits is taken; a Literal; an array of NumPy, whose
            entries become floats; a mapping, whose keys are texts in the document; ``list[kind]``,
            ``tuple[kind, ...]``, or a tuple with a kind for each entry.
        document: What `json` has read.
        path: Keys that lead to the document, for messages; empty for a whole one.

    Raises:
        ValueError: The document holds no such value; the message begins with the path.
    """
    origin = get_origin(kind)
    arguments = get_args(kind)
    if origin is Annotated:
        value = _read(arguments[0], document, path)
        # `_checked` puts the path in front of the error of a check.
        for check in arguments[1:]:
            _checked(check, value, path)
        return value
    if origin in (Union, types.UnionType):
        return _read_union(arguments, document, path)
    if origin is Literal:
        _require(document in arguments, document, path)
        return document
    # Of NDArray[…] the origin is NDArray itself from NumPy 2.5 on, and np.ndarray before.
    if origin in (np.ndarray, NDArray):
        # null becomes NaN; lists of different lengths, and texts, raise ValueError
        return _checked(lambda rows: np.array(rows, float), document, path)
    if issubclass(origin, Mapping):
        _require(isinstance(document, dict), document, path)
        values = {}
        for name, entry in document.items():
            key = _read(arguments[0], name, path)
            values[key] = _read(arguments[1], entry, _entry_path(path, key))
        return values
    _require(isinstance(document, list), document, path)
    # One kind for all entries, or one for each
    kinds = arguments
    if origin is list or arguments[-1] is ...:
        kinds = arguments[:1] * len(document)
    _require(len(kinds) == len(document), document, path)
    entries = enumerate(zip(kinds, document, strict=True))
    return origin(_read(item, entry, f"{path}.{k}") for k, (item, entry) in entries)


def _read_union(kinds: tuple[Any, ...], document: Any, path: str) -> Any:
    """Return the value that a document holds of the first of several kinds that fits it.

    Args:
        kinds: Members of a union in their order. If None is among them, null is None, also where
            a float before it would take null for NaN.
        document: What `json` has read.
        path: Keys that lead to the document, for messages.

    Raises:
        ValueError: No kind fits; the message is the one for the first kind that is not None.
    """
    if document is None and type(None) in kinds:
        return None
    reasons: list[ValueError] = []
    for kind in kinds:
        if kind is type(None):
            continue
        try:
            return _read(kind, document, path)
        except ValueError as error:
            reasons.append(error)
    raise reasons[0]


def _read_fields(kind: Any, document: Any, path: str) -> Any:
    """Return a dataclass, typed dict or named tuple from the values of its fields by name.

    Fields with a default may be missing. Fields that a dataclass makes itself (`init=False`) may be
    there and are not read.

    Args:
        kind: The class, whose annotations are the kinds of the fields.
        document: What `json` has read.
        path: Keys that lead to the document, for messages; empty for a whole one.

    Raises:
        ValueError: The document is no object, a field is unknown or missing, or its value is of
            another kind; the message begins with the path. Also what the class itself raises.
    """
    _require(isinstance(document, dict), document, path)
    hints = _hints(kind)
    taken = hints if is_typeddict(kind) else _parameters(kind)  # typed dicts require no field
    for name, x in taken.items():
        has_default = getattr(x, "default", None) is not Parameter.empty
        _require(has_default or name in document, None, _entry_path(path, name))
    values = {}
    for name, entry in document.items():
        entry_path = _entry_path(path, name)
        # An unknown field tells of another version of the program, or of a slip in a file by hand.
        _require(name in hints, name, entry_path)
        # What a dataclass makes itself follows from the other fields, and is made again by it.
        if name in taken:
            values[name] = _read(hints[name], entry, entry_path)
    return kind(**values)


@cache
def _hints(kind: Any) -> dict[str, Any]:
    """Return the types of the fields of a kind, with the checks of their values."""
    return get_type_hints(kind, include_extras=True)


@cache
def _parameters(kind: Any) -> Mapping[str, Parameter]:
    """Return the fields that a dataclass or named tuple is made from."""
    return signature(kind).parameters


def _require(condition: bool, document: Any, path: str) -> None:
    """Raise ValueError with the path of a document unless a condition about it holds."""
    if not condition:
        raise ValueError(f"{path or 'the document'}: {document!r:.40}")


def _checked(check: Callable[[Any], Any], value: Any, path: str) -> Any:
    """Return what a function makes of a value; an error of it becomes ValueError with the path."""
    try:
        return check(value)
    except (TypeError, ValueError):
        raise ValueError(f"{path}: {value!r:.40}") from None


def _entry_path(path: str, key: object) -> str:
    """Return the path of the entry with a key in the document of a path."""
    return f"{path}.{key}".lstrip(".")
