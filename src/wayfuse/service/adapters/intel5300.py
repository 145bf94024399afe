"""Channel state of an Intel 5300 card, as the CSI Tool logs it: records in a row, after a line that says whose.

The card's clock has no date: the last frame of a body is of its arrival, those before it as much earlier as the card
says.
"""

from __future__ import annotations

from wayfuse.formats.intel5300 import frames_of
from wayfuse.sensors.quality import ReadReport
from wayfuse.sensors.records import CsiFrame, bssid_id
from wayfuse.service.adapters.parts import notes_of
from wayfuse.service.message import BadBodyError, Message, Part, Profile
from wayfuse.service.wire import check_count

__all__ = ["Intel5300", "intel5300_body"]

_LONGEST_S = 60.0  # that a body may be under way: a card whose clock says more was started anew
_LONGEST_NAME = 200


def intel5300_body(anchor: str, target: str, records: bytes) -> bytes:
    """The body of records in a row.

    Raises
    ------
    BadBodyError : a name is empty, too long, or has a space.
    """
    for name in (anchor, target):
        if not 1 <= len(name) <= _LONGEST_NAME or name.split() != [name]:
            raise BadBodyError(
                "not the name of an anchor or target", remedy="send 'TOKEN ANCHOR TARGET' first"
            )
    return f"{anchor} {target}\n".encode() + records


class Intel5300:
    """Adapter of a stretch of a card's stream."""

    def read(self, body: bytes, profile: Profile, arrived: float) -> list[Message]:
        """One message per body."""
        line, _, records = body.partition(b"\n")
        try:
            anchor, target = line.decode("utf-8").split(" ")
        except ValueError as error:
            raise BadBodyError("the body does not begin with an anchor and a target") from error
        intel5300_body(anchor, target, b"")
        report = ReadReport()
        frames = frames_of(records, report, anchor=bssid_id(anchor))
        check_count(len(frames))
        last = frames[-1].t if frames else 0.0
        stamped = tuple(sorted((_stamped(f, arrived, last) for f in frames), key=lambda f: f.t))
        return [Message(target, profile.track, body, (Part("", stamped),), False, notes_of(report))]


def _stamped(frame: CsiFrame, arrived: float, last: float) -> CsiFrame:
    before = last - frame.t
    t = arrived - before if 0.0 <= before <= _LONGEST_S else arrived
    return CsiFrame(t, frame.anchor, frame.csi, frame.rss, frame.agc, frame.noise)
