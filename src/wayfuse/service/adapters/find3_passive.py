"""FIND3's ``/passive``: a scanner says whom it heard. The devices are the addresses in the body, the scanner an anchor.

Each device becomes a message of its own, with a body that holds its levels alone, as with the anchors' own envelope. A
device with a random hardware address is dropped: such an address is nobody's identity.

References
----------
.. [1] FIND3, doc/passive_tracking.md and doc/api.md, github.com/schollz/find3.
"""

from __future__ import annotations

from collections import Counter

import msgspec

from wayfuse.formats.assembly import assemble
from wayfuse.formats.columns import Piece, Rows
from wayfuse.sensors.quality import ReadReport
from wayfuse.service.adapters.find3 import Data, take_level
from wayfuse.service.adapters.parts import digest_key, merged, notes_of
from wayfuse.service.identity import is_random_address
from wayfuse.service.message import Message, Part, Profile
from wayfuse.service.wire import check_count, decode, encode

__all__ = ["Find3Passive"]

_LONGEST = 200  # of a name, as everywhere
_RADIO = {"wifi": "wifi", "bluetooth": "ble"}
Heard = dict[str, dict[str, msgspec.Raw]]


class Find3Passive:
    """Adapter of FIND3's passive scanners."""

    def read(self, body: bytes, profile: Profile, arrived: float) -> list[Message]:
        """A message per device; those without time are stamped with their arrival."""
        data = decode(body, Data)
        check_count(sum(len(heard) for heard in data.s.values()))
        of: dict[str, Heard] = {}
        dropped = Counter[str]()
        for sensor, heard in data.s.items():
            for name, level in heard.items():
                if is_random_address(name):
                    dropped["device with a random address"] += 1
                elif 0 < len(name) <= _LONGEST and sensor in _RADIO:
                    of.setdefault(name, {})[sensor] = {name: level}
        out = [_message(data, name, heard, profile, arrived) for name, heard in of.items()]
        if out:
            out[0] = out[0]._replace(notes=Counter(out[0].notes) + dropped)
        return out


def _message(data: Data, name: str, heard: Heard, profile: Profile, arrived: float) -> Message:
    own = encode(msgspec.structs.replace(data, s=heard))
    report, rows = ReadReport(), Rows()
    t = data.t / 1e3 if data.t else arrived
    for sensor, levels in heard.items():
        take_level(_RADIO[sensor], data.d, levels[name], 1, t, rows, report)
    recording = assemble([Piece(rows.columns())], report, name="", clock="", one_stream=False)
    part = Part(digest_key(own), merged(recording.records()))
    return Message(name, profile.track or data.f, own, (part,), False, notes_of(report))
