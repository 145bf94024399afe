"""What an adapter makes of a body: messages, each of one device, in records the tracker understands."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple, Protocol

from wayfuse.core.errors import WayfuseError
from wayfuse.sensors.records import Record

__all__ = ["Adapter", "BadBodyError", "Message", "Part", "Profile", "SayToUserError"]


class BadBodyError(WayfuseError):
    """A body that cannot be read: nothing of it is kept, and the sender is told what is wrong."""


class SayToUserError(BadBodyError):
    """As `BadBodyError`, and the person at the phone can mend it."""


class Profile(NamedTuple):
    """What a body does not say: of the phone's enrolment, or beside the body (query, headers).

    device, track : names, for formats that carry none. platform, standardised : conventions of the phone's axes.
    """

    device: str = ""
    track: str = ""
    platform: str = ""
    standardised: bool = False


class Part(NamedTuple):
    """Records that come or do not come together. ``key`` tells a repetition; empty: taken as new."""

    key: str
    records: tuple[Record, ...]


class Message(NamedTuple):
    """What one device said.

    device, session : as it calls itself. body : what goes to the log: read again by the same adapter, it gives this
    message. is_end : the session is over. notes : what was left out, and how often.
    """

    device: str
    session: str
    body: bytes
    parts: tuple[Part, ...]
    is_end: bool = False
    notes: Mapping[str, int] = MappingProxyType({})

    @property
    def n_records(self) -> int:
        """Records in all parts."""
        return sum(len(part.records) for part in self.parts)


class Adapter(Protocol):
    """Reads bodies of one format. Pure: the log is read by it again after a restart."""

    def read(self, body: bytes, profile: Profile, arrived: float) -> list[Message]:
        """Messages of a body that arrived at a time (Unix s).

        Raises
        ------
        BadBodyError : the body is not of this format, or beyond its limits.
        """
        ...
