"""TOML tables into frozen dataclasses, strictly: what no class has, and values of the wrong kind, are errors.

A class gives the defaults. A field may say more in its metadata: ``one_of`` lists the words allowed; ``of`` is what the
entries of a list are: ``str``, a dataclass (a table each), or a named tuple (a list each).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import Field, fields, is_dataclass, replace
from typing import Any, TypeVar, get_type_hints

from wayfuse.core.errors import ConfigError

__all__ = ["no_negative", "read_table", "require"]

T = TypeVar("T")


def read_table(base: T, table: Mapping[str, Any], where: str) -> T:
    """``base`` with what the table names changed.

    Parameters
    ----------
    where : file and table, for errors.

    Raises
    ------
    ConfigError : an unknown key, a value of another kind or outside its range; names file, key and remedy.
    """
    known = {f.name: f for f in fields(base)}  # type: ignore[arg-type]
    changes: dict[str, Any] = {}
    for key, value in table.items():
        if key not in known:
            raise ConfigError(f"unknown key {key!r}", where=where, remedy="one of " + ", ".join(known))
        changes[key] = _value(getattr(base, key), known[key], value, _below(where, key))
    try:
        return replace(base, **changes)  # type: ignore[type-var]
    except ConfigError as error:
        raise ConfigError(error.what, where=where, remedy=error.remedy) from error


def require(key: str, ok: bool, value: object, remedy: str) -> None:
    """Refuse a value of a key.

    Raises
    ------
    ConfigError : not ``ok``.
    """
    if not ok:
        raise ConfigError(f"{key} = {value!r}", remedy=remedy)


def no_negative(model: object, but: tuple[str, ...] = ()) -> None:
    """Refuse negative numbers in a dataclass, except in the fields ``but``.

    Raises
    ------
    ConfigError : there is one.
    """
    for f in fields(model):  # type: ignore[arg-type]
        value = getattr(model, f.name)
        numbers = value if isinstance(value, tuple) else (value,)
        if f.name not in but and any(_is_number(n) and n < 0 for n in numbers):
            raise ConfigError(f"{f.name} = {value!r}", remedy="give a number that is not negative")


def _below(where: str, key: str) -> str:
    """Place of a key: ``file.toml: radio.rim.doi``."""
    return f"{where}.{key}" if ": " in where else f"{where}: {key}"


def _value(default: Any, field: Field[Any], value: Any, where: str) -> Any:
    """The value in the kind of its default."""
    if is_dataclass(default):
        if not isinstance(value, dict):
            raise ConfigError(f"{value!r}", where=where, remedy="a table belongs here")
        return read_table(default, value, where)
    if isinstance(value, dict):
        raise ConfigError("a table where a value belongs", where=where, remedy=f"such as {default!r}")
    if "of" in field.metadata:
        return _list(field.metadata["of"], value, where)
    if isinstance(default, tuple):
        if isinstance(value, list) and len(value) == len(default) and all(map(_is_number, value)):
            return tuple(float(v) for v in value)
        raise ConfigError(f"{value!r}", where=where, remedy=f"a list of {len(default)} numbers")
    if isinstance(default, str):
        return _word(field, value, where)
    if isinstance(default, bool):
        if isinstance(value, bool):
            return value
        raise ConfigError(f"{value!r}", where=where, remedy="true or false")
    if _is_number(value) and (isinstance(default, float) or value == int(value)):
        return type(default)(value)
    kind = "a number" if isinstance(default, float) else "a whole number"
    raise ConfigError(f"{value!r}", where=where, remedy=f"{kind} such as {default!r}")


def _word(field: Field[Any], value: Any, where: str) -> str:
    words = field.metadata.get("one_of", ())
    if isinstance(value, str) and (not words or value in words):
        return value
    remedy = f"one of {', '.join(words)}" if words else "a text in quotes"
    raise ConfigError(f"{value!r}", where=where, remedy=remedy)


def _list(of: Any, value: Any, where: str) -> tuple[Any, ...]:
    if not isinstance(value, list):
        raise ConfigError(f"{value!r}", where=where, remedy="a list in brackets")
    return tuple(_entry(of, entry, f"{where}[{k}]") for k, entry in enumerate(value))


def _entry(of: Any, value: Any, where: str) -> Any:
    """One entry of a list: a word, a table, or a short list of numbers and words."""
    if of is str:
        if isinstance(value, str):
            return value
        raise ConfigError(f"{value!r}", where=where, remedy="a text in quotes")
    if is_dataclass(of):
        if isinstance(value, dict):
            return read_table(of(), value, where)  # type: ignore[operator]
        raise ConfigError(f"{value!r}", where=where, remedy="a table belongs here")
    kinds = get_type_hints(of).items()
    remedy = f"a list such as [{', '.join(str(name) for name, _ in kinds)}]"
    if not isinstance(value, list) or len(value) != len(kinds):
        raise ConfigError(f"{value!r}", where=where, remedy=remedy)
    out: list[Any] = []
    for part, (_, kind) in zip(value, kinds, strict=True):
        is_word = kind is str
        if isinstance(part, str) != is_word or not (is_word or _is_number(part)):
            raise ConfigError(f"{value!r}", where=where, remedy=remedy)
        out.append(part if is_word else float(part))
    return of(*out)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
