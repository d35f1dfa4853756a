"""Results as JSON documents and back: dataclasses of numbers, texts, arrays and others of these.

A document is what `json` reads and writes. Fields stand by their names; enumerations by their
value; arrays, tuples and lists as lists; named tuples and mappings as objects. Numbers that are not
finite are null in JSON, and nan when they are read. Fields that a dataclass makes itself are
written and not read.
"""

from __future__ import annotations

import types
from collections.abc import Callable, Mapping
from dataclasses import MISSING, dataclass, fields, is_dataclass
from enum import Enum
from functools import cache
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

T = TypeVar("T")


def to_document(value: object) -> Any:
    """Return a result as a JSON document.

    Args:
        value: A dataclass, named tuple, mapping, sequence, array, enumeration, number, text or
            None, or any nesting of these.
    """
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if is_dataclass(value):
        return {x.name: to_document(getattr(value, x.name)) for x in fields(value)}
    if isinstance(value, tuple) and hasattr(value, "_asdict"):
        value = value._asdict()
    if isinstance(value, Mapping):
        return {str(key): to_document(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [to_document(entry) for entry in value]
    return value


def from_document(kind: type[T], document: object, path: str = "") -> T:
    """Return the result of a kind that a JSON document holds.

    Args:
        kind: The type that `to_document` was given. Metadata of `Annotated` are functions that
            check a value, and raise ValueError.
        document: What `json` has read.
        path: Keys that lead to the document, for messages; empty for a whole one.

    Raises:
        ValueError: The document holds no such result. The message begins with the path of what is
            missing, unknown or of another type.
    """
    return cast("T", _read(kind, document, path))


def _read(kind: Any, document: Any, path: str) -> Any:
    """Return the value of a kind that a document holds; arguments and errors of `from_document`."""
    if get_origin(kind) is not None:
        return _read_parametrised(kind, document, path)
    if kind is Any or kind is object:
        return document
    is_bool = isinstance(document, bool)  # which Python takes for a number
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
    """Return the value of a kind with arguments, such as ``dict[str, float]`` or a union."""
    origin = get_origin(kind)
    arguments = get_args(kind)
    if origin is Annotated:
        value = _read(arguments[0], document, path)
        for check in arguments[1:]:
            _checked(check, value, path)
        return value
    if origin in (Union, types.UnionType):
        return _read_union(arguments, document, path)
    if origin is Literal:
        _require(document in arguments, document, path)
        return document
    if origin is np.ndarray:
        return _checked(lambda rows: np.array(rows, float), document, path)  # null becomes nan
    if issubclass(origin, Mapping):
        _require(isinstance(document, dict), document, path)
        values = {}
        for name, entry in document.items():
            key = _read(arguments[0], name, path)
            values[key] = _read(arguments[1], entry, _below(path, key))
        return values
    _require(isinstance(document, list), document, path)
    kinds = arguments
    if origin is list or arguments[-1] is ...:
        kinds = arguments[:1] * len(document)
    _require(len(kinds) == len(document), document, path)
    entries = enumerate(zip(kinds, document, strict=True))
    return origin(_read(item, entry, f"{path}.{k}") for k, (item, entry) in entries)


def _read_union(kinds: tuple[Any, ...], document: Any, path: str) -> Any:
    """Return what the first kind that fits the document makes of it.

    Raises:
        ValueError: No kind fits; the message is of the first that is not None.
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
    """Return a dataclass, typed dict or named tuple from the values of its fields by name."""
    _require(isinstance(document, dict), document, path)
    known = _known_fields(kind)
    for name in document:
        is_known = name in known.types or name in known.derived
        _require(is_known, name, _below(path, name))
    for name in known.required:
        _require(name in document, None, _below(path, name))
    values = {}
    for name, entry in document.items():
        if name not in known.derived:
            values[name] = _read(known.types[name], entry, _below(path, name))
    return kind(**values)


@dataclass(frozen=True)
class _KnownFields:
    """Fields of a kind: types by name, those without default, and those that follow from others."""

    types: Mapping[str, Any]
    required: tuple[str, ...]
    derived: tuple[str, ...] = ()


@cache
def _known_fields(kind: Any) -> _KnownFields:
    """Return the fields of a dataclass, typed dict or named tuple."""
    hints = get_type_hints(kind, include_extras=True)
    if is_typeddict(kind):
        return _KnownFields(hints, tuple(kind.__required_keys__))
    if not is_dataclass(kind):
        return _KnownFields(hints, tuple(x for x in kind._fields if x not in kind._field_defaults))
    own = [x for x in fields(kind) if x.init]
    required = [x.name for x in own if x.default is MISSING and x.default_factory is MISSING]
    derived = [x.name for x in fields(kind) if not x.init]
    return _KnownFields({x.name: hints[x.name] for x in own}, tuple(required), tuple(derived))


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


def _below(path: str, key: object) -> str:
    """Return the path of the entry with a key in the document of a path."""
    return f"{path}.{key}".lstrip(".")
