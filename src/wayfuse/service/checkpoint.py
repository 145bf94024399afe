"""States as bytes and back, to the bit: NamedTuples, frozen dataclasses, enums, arrays and plain values.

No pickle: what is read makes only classes of this package's own rooms, by their fields. A checkpoint of another
version of the package, whose classes have other fields, is refused, and the log is read instead.
"""

from __future__ import annotations

import dataclasses
import importlib
import math
from enum import Enum
from typing import Any

import msgspec
import numpy as np

from wayfuse.core.errors import FormatError

__all__ = ["pack", "unpack"]

_ROOMS = tuple(
    f"wayfuse.{room}."
    for room in ("tracking", "filters", "inertial", "radio", "models", "sensors", "service")
)
# what a list stands for, by its first element
_ARRAY, _SCALAR, _ENUM, _TUPLE_OF, _DATACLASS, _TUPLE, _LIST, _DICT = range(8)


def pack(value: Any) -> bytes:
    """Bytes of a state.

    Raises
    ------
    TypeError : it holds something else than states do.
    """
    return msgspec.msgpack.encode(_plain(value))


def unpack(content: bytes) -> Any:
    """The state of bytes.

    Raises
    ------
    FormatError : they are none of this version's.
    """
    try:
        return _value(msgspec.msgpack.decode(content))
    except (msgspec.DecodeError, ValueError, TypeError, KeyError, IndexError, AttributeError) as error:
        raise FormatError(
            f"not a checkpoint of this version ({type(error).__name__})",
            where="checkpoint",
            remedy="the log is read instead",
        ) from error


def _plain(v: Any) -> Any:
    if v is None or type(v) in {bool, int, float, str, bytes}:
        return v
    if isinstance(v, np.ndarray):
        order = "F" if v.flags.f_contiguous and not v.flags.c_contiguous else "C"
        return [_ARRAY, v.dtype.str, list(v.shape), order, v.tobytes(order)]  # type: ignore[arg-type]
    if isinstance(v, np.generic):
        return [_SCALAR, v.dtype.str, v.tobytes()]
    kind = type(v)
    if isinstance(v, Enum):
        return [_ENUM, _name(kind), v.value]
    if isinstance(v, tuple):
        if hasattr(v, "_fields"):
            return [_TUPLE_OF, _name(kind), list(v._fields), [_plain(x) for x in v]]
        return [_TUPLE, [_plain(x) for x in v]]
    if dataclasses.is_dataclass(v):
        names = [f.name for f in dataclasses.fields(v) if f.init]
        return [_DATACLASS, _name(kind), names, [_plain(getattr(v, n)) for n in names]]
    if isinstance(v, list):
        return [_LIST, [_plain(x) for x in v]]
    if isinstance(v, dict):
        return [_DICT, [[_plain(k), _plain(x)] for k, x in v.items()]]
    raise TypeError(f"{kind.__name__} is no part of a state")


def _value(v: Any) -> Any:
    if not isinstance(v, list):
        return v
    kind, *rest = v
    if kind == _ARRAY:
        dtype, shape, order, content = rest
        _check_dtype(dtype)
        flat = np.frombuffer(content, dtype)
        if math.prod(shape) != len(flat):
            raise ValueError("an array of another size")
        return flat.reshape(shape, order=order).copy(order)
    if kind == _SCALAR:
        _check_dtype(rest[0])
        return np.frombuffer(rest[1], rest[0])[0]
    if kind == _TUPLE:
        return tuple(_value(x) for x in rest[0])
    if kind == _LIST:
        return [_value(x) for x in rest[0]]
    if kind == _DICT:
        return {_value(k): _value(x) for k, x in rest[0]}
    made = _class(rest[0])
    if kind == _ENUM:
        return made(rest[1])
    values = [_value(x) for x in rest[2]]
    if kind == _TUPLE_OF and list(made._fields) == rest[1]:
        return made(*values)
    if kind == _DATACLASS and [f.name for f in dataclasses.fields(made) if f.init] == rest[1]:
        return made(**dict(zip(rest[1], values, strict=True)))
    raise ValueError("other fields")


def _check_dtype(text: str) -> None:
    if np.dtype(text).hasobject:
        raise ValueError("an array of objects")


def _name(kind: type) -> str:
    return f"{kind.__module__}:{kind.__qualname__}"


def _class(name: str) -> Any:
    module, _, attribute = name.partition(":")
    if not module.startswith(_ROOMS) or not attribute.isidentifier():
        raise ValueError("a class of no state")
    made = getattr(importlib.import_module(module), attribute)
    is_state = isinstance(made, type) and (
        issubclass(made, Enum) or hasattr(made, "_fields") or dataclasses.is_dataclass(made)
    )
    if not is_state:
        raise ValueError("a class of no state")
    return made
