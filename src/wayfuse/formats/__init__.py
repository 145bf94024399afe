"""Readers of recordings, one file per log format; the catalogue of public data sets.

>>> from wayfuse.formats import read  # doctest: +SKIP
>>> read("walk.txt").span  # doctest: +SKIP
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from wayfuse.formats.reading import expand, read, sniff

__all__ = ["expand", "read", "sniff"]


def __getattr__(name: str) -> Any:
    """Import the readers when they are first asked for (start-up time)."""
    if name in __all__:
        from wayfuse.formats import reading

        return getattr(reading, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
