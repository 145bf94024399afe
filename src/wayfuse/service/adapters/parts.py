"""Small things all adapters need: keys of repetitions, identifiers, order, and notes."""

from __future__ import annotations

import heapq
from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache
from hashlib import blake2b
from operator import attrgetter

from wayfuse.sensors.quality import ReadReport
from wayfuse.sensors.records import Record, Waypoint, bssid_id

__all__ = ["digest_key", "identifier", "merged", "notes_of"]

_DIGEST = 1 << 63
_REMEMBERED = (
    1 << 15
)  # names; a building has thousands of access points, a phone hears the same ones again and again


def digest_key(body: bytes) -> str:
    """Key of a body that has no number: the same bytes are the same message."""
    return "of " + blake2b(body, digest_size=12).hexdigest()


@lru_cache(_REMEMBERED)
def identifier(text: str) -> int:
    """64-bit identifier of an access point or beacon; also takes back what `bssid_text` wrote of a digest."""
    if text.startswith("#") and len(text) == 17:
        try:
            return _DIGEST | int(text[1:], 16) & (_DIGEST - 1)
        except ValueError:
            pass
    return bssid_id(text)


def merged(records: Iterable[Record], more: Sequence[Record] = ()) -> tuple[Record, ...]:
    """Records in time order, without what a surveyor stated: truth is no input."""
    if more:
        records = heapq.merge(records, sorted(more, key=attrgetter("t")), key=attrgetter("t"))
    return tuple(r for r in records if not isinstance(r, Waypoint))


def notes_of(report: ReadReport) -> Mapping[str, int]:
    """What a report counted, by kind; an empty body is no fault."""
    return {
        kind: issue.count for kind, issue in report.issues.items() if kind != "no record in the recording"
    }
