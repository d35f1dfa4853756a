"""Results as JSON documents and back: dataclasses of numbers, texts, arrays and others of these.

A document is what `json` reads and writes. Fields stand by their names; enumerations by their
value; arrays, tuples and lists as lists; named tuples and mappings as objects. Numbers that are not
finite are null in JSON, and nan when they are read. Fields that a dataclass makes itself are
written and not read.
"""

from __future__ import annotations

import types
from collections.abc import Mapping
from dataclasses import MISSING, fields, is_dataclass
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
    origin, arguments = get_origin(kind), get_args(kind)
    if kind is Any or kind is object:
        return document
    if origin is Annotated:
        value = _read(arguments[0], document, path)
        for check in arguments[1:]:
            _checked(check, value, path)
        return value
    if origin in (Union, types.UnionType):
        return _read_union(arguments, document, path)
    if origin is Literal:
        return _required(document in arguments, document, path)
    if origin is np.ndarray:
        return _read_array(document, path)
    if origin is tuple:
        _required(isinstance(document, list), document, path)
        kinds = arguments[:1] * len(document) if arguments[-1:] == (...,) else arguments
        _required(len(kinds) == len(document), document, path)
        pairs = enumerate(zip(kinds, document, strict=True))
        return tuple(_read(item, entry, f"{path}.{k}") for k, (item, entry) in pairs)
    if origin is list:
        _required(isinstance(document, list), document, path)
        return [_read(arguments[0], entry, f"{path}.{k}") for k, entry in enumerate(document)]
    if origin is not None and issubclass(origin, Mapping):
        _required(isinstance(document, dict), document, path)
        read = {_read(arguments[0], key, path): entry for key, entry in document.items()}
        return {key: _read(arguments[1], entry, _below(path, key)) for key, entry in read.items()}
    if kind is float:
        if document is None:
            return np.nan
        is_number = isinstance(document, int | float) and not isinstance(document, bool)
        return float(_required(is_number, document, path))
    if is_dataclass(kind) or hasattr(kind, "_field_defaults") or is_typeddict(kind):
        return _read_fields(kind, document, path)
    if issubclass(kind, Enum):
        return _checked(kind, document, path)
    # texts, whole numbers, truth values, None, and documents of which nothing more is known
    is_bool_for_int = kind is int and isinstance(document, bool)
    return _required(isinstance(document, kind) and not is_bool_for_int, document, path)


def _read_union(kinds: tuple[Any, ...], document: Any, path: str) -> Any:
    """Return what the first kind that fits the document makes of it."""
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


def _read_array(document: Any, path: str) -> Any:
    try:
        return np.array(document, float)  # null becomes nan
    except (TypeError, ValueError):
        raise ValueError(f"{path}: no array of numbers") from None


def _read_fields(kind: Any, document: Any, path: str) -> Any:
    """Return a dataclass or a named tuple from the values of its fields by name."""
    _required(isinstance(document, dict), document, path)
    hints, required = _field_types(kind)
    document = {key: entry for key, entry in document.items() if key not in _derived(kind)}
    for key in document:
        _required(key in hints, key, _below(path, key))
    for name in required:
        _required(name in document, None, _below(path, name))
    values = {x: _read(hints[x], document[x], _below(path, x)) for x in document}
    return kind(**values)


@cache
def _field_types(kind: Any) -> tuple[dict[str, Any], tuple[str, ...]]:
    """Return the types of the fields of a dataclass or named tuple, and those without default."""
    hints = get_type_hints(kind, include_extras=True)
    if is_typeddict(kind):
        return hints, tuple(kind.__required_keys__)
    if not is_dataclass(kind):
        return hints, tuple(x for x in kind._fields if x not in kind._field_defaults)
    own = [x for x in fields(kind) if x.init]
    required = [x.name for x in own if x.default is MISSING and x.default_factory is MISSING]
    return {x.name: hints[x.name] for x in own}, tuple(required)


@cache
def _derived(kind: Any) -> frozenset[str]:
    """Return the names of the fields of a dataclass that follow from others."""
    own = fields(kind) if is_dataclass(kind) else ()
    return frozenset(x.name for x in own if not x.init)


def _required(condition: bool, document: Any, path: str) -> Any:
    """Return the document, or raise ValueError with its path where the condition fails."""
    if not condition:
        raise ValueError(f"{path or 'the document'}: {document!r:.40}")
    return document


def _checked(check: Any, value: Any, path: str) -> Any:
    try:
        return check(value)
    except ValueError:
        raise ValueError(f"{path}: {value!r:.40}") from None


def _below(path: str, key: object) -> str:
    return f"{path}.{key}".lstrip(".")
