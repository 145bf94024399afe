"""What floor names mean: B1 is -1, F1 is 1, as people count.

>>> [parse_level(name) for name in ("B1", "F1", "2F", "L10", "LG2", "G", "UG")]
[-1, 1, 2, 10, -2, 0, 0]
>>> parse_level("roof garden") is None
True
"""

from __future__ import annotations

import re

__all__ = ["parse_level", "sort_key"]

_ABOVE = re.compile(r"(?:F|L|LEVEL|FLOOR|P)[ _-]?0*(\d+)|0*(\d+)F?|F?0*(\d+)F")
_BELOW = re.compile(r"(?:B|BF|LG|LB|UB|BASEMENT|-F?|F-|L-)[ _-]?0*(\d+)F?|0*(\d+)B")
_NAMED = {
    "G": 0,
    "GF": 0,
    "UG": 0,
    "GROUND": 0,
    "M": 0,
    "MF": 0,
    "B": -1,
    "BF": -1,
    "LG": -1,
    "F": 1,
    "BM": -1,
}
# between the levels of whole numbers: lower ground over B1, mezzanine over upper ground over ground
_WITHIN = {"LG": 1, "BM": 1, "UG": 1, "M": 2, "MF": 2}


def parse_level(name: str) -> int | None:
    """Level of a floor name, None where the name does not say."""
    text = name.strip().upper()
    if text in _NAMED:
        return _NAMED[text]
    if below := _BELOW.fullmatch(text):
        return -int(next(group for group in below.groups() if group)) or None
    if above := _ABOVE.fullmatch(text):
        return int(next(group for group in above.groups() if group))
    return None


def sort_key(name: str) -> tuple[bool, int, int, str]:
    """Bottom up; floors whose name does not say come last, by name."""
    level = parse_level(name)
    return level is None, level or 0, _WITHIN.get(name.strip().upper(), 0), name.casefold()
