"""FIND3's ``/data``: one scan of a device, as a map of addresses to levels.

References
----------
.. [1] FIND3, doc/api.md, github.com/schollz/find3.
"""

from __future__ import annotations

import math
from typing import Annotated

import msgspec

from wayfuse.formats.assembly import assemble
from wayfuse.formats.columns import Piece, Rows
from wayfuse.sensors.quality import ReadReport
from wayfuse.service.adapters.parts import digest_key, identifier, merged, notes_of
from wayfuse.service.message import BadBodyError, Message, Part, Profile
from wayfuse.service.wire import Name, check_count, decode

__all__ = ["Data", "Find3", "take_level"]

_RADIO = {"wifi": "wifi", "bluetooth": "ble"}


class Data(msgspec.Struct, frozen=True):
    """A body. d : device. f : family. t : ms. s : levels (dBm) by address, by sensor."""

    d: Name
    f: Annotated[str, msgspec.Meta(max_length=200)] = ""
    t: int | float = 0  # ms
    s: dict[str, dict[str, msgspec.Raw]] = {}
    l: str = ""  # noqa: E741 (FIND3's own name)


class Find3:
    """Adapter of FIND3's scanners."""

    def read(self, body: bytes, profile: Profile, arrived: float) -> list[Message]:
        """One message per body; a scan without time is stamped with its arrival."""
        data = decode(body, Data)
        check_count(sum(len(heard) for heard in data.s.values()))
        if data.l:
            raise BadBodyError(
                "learning a place by its name is not supported",
                remedy="survey with recordings, and leave l out",
            )
        report, rows = ReadReport(), Rows()
        t = data.t / 1e3 if data.t else arrived
        for sensor, heard in data.s.items():
            kind = _RADIO.get(sensor)
            for n, (name, raw) in enumerate(heard.items(), 1):
                if kind is not None:
                    take_level(kind, name, raw, n, t, rows, report)
        recording = assemble([Piece(rows.columns())], report, name="", clock="", one_stream=False)
        part = Part(digest_key(body), merged(recording.records()))
        session = profile.track or data.f
        return [Message(data.d, session, body, (part,), False, notes_of(report))]


def take_level(
    kind: str, name: str, raw: msgspec.Raw, n: int, t: float, rows: Rows, report: ReadReport
) -> None:
    """Add a level of an access point or beacon to the rows; one that is no number is counted instead."""
    try:
        level = msgspec.json.decode(raw, type=float)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError):
        level = math.nan
    if not name or not math.isfinite(level):
        report.add(f"{kind}: not a level where one is due", n)
        return
    values = (level, 0.0, math.nan) if kind == "wifi" else (level, math.nan)
    rows.add(kind, n, t, values, identifier(name))
