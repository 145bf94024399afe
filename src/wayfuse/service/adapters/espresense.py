"""ESPresense: a node tells how far a Bluetooth device is from it.

The message names neither node nor device as its topic does, and no time; the body in the log is therefore an envelope
of the topic's names and what the node said, and its time is that of its arrival. Nodes tell filtered distances, several
a second: one message is little news, so its spread is taken wide.

References
----------
.. [1] ESPresense, espresense.com: topic ``espresense/devices/DEVICE/NODE``.
"""

from __future__ import annotations

import math
from typing import Annotated

import msgspec

from wayfuse.sensors.records import BleReading, Range, Record
from wayfuse.service.adapters.parts import identifier
from wayfuse.service.identity import is_random_address
from wayfuse.service.message import Message, Part, Profile
from wayfuse.service.wire import Name, decode, encode

__all__ = ["Espresense", "espresense_body"]

_FARTHEST_M = 1e3
_SHARE, _LEAST_M = 0.5, 2.0  # spread of a distance: of itself, at least
_LEVELS = (-127.0, 20.0)  # dBm


class _Said(msgspec.Struct, frozen=True):
    distance: float | None = None
    rssi: float | None = None


class _Envelope(msgspec.Struct, frozen=True):
    device: Name
    node: Name
    said: _Said
    session: Annotated[str, msgspec.Meta(max_length=200)] = ""


def espresense_body(device: str, node: str, payload: bytes) -> bytes:
    """The body of what a node said of a device, with what the topic says.

    Raises
    ------
    BadBodyError : it is no message of a node.
    """
    return encode(_Envelope(device, node, decode(payload, _Said)))


class Espresense:
    """Adapter of a node's message."""

    def read(self, body: bytes, profile: Profile, arrived: float) -> list[Message]:
        """One message per body; none of a device with a random address."""
        said = decode(body, _Envelope)
        if is_random_address(said.device):
            return []
        node, notes, records = identifier(said.node), dict[str, int](), list[Record]()
        rssi = math.nan if said.said.rssi is None else said.said.rssi
        if said.said.rssi is not None and _LEVELS[0] <= rssi <= _LEVELS[1]:
            records.append(BleReading(arrived, node, rssi))
        distance = said.said.distance
        if distance is not None and 0.0 <= distance <= _FARTHEST_M:
            records.append(Range(arrived, node, distance, max(_LEAST_M, _SHARE * distance), rssi))
        elif distance is not None:
            notes["range: out of range"] = 1
        part = Part("", tuple(records))
        return [Message(said.device, said.session or profile.track, body, (part,), False, notes)]
