"""Types of what comes over the wire, decoded and checked by msgspec; and the limits that hold before and after.

A body is limited in bytes before it is parsed (`service.limits`); the number of samples is limited here, after it, for
a byte costs nothing and a record costs microseconds.
"""

from __future__ import annotations

from typing import Annotated, Any, TypeVar

import msgspec

from wayfuse.service.message import BadBodyError

__all__ = [
    "MAX_RECORDS",
    "Advertisement",
    "Ap",
    "Distance",
    "Envelope",
    "Name",
    "Quad",
    "Scan",
    "Stepped",
    "Triple",
    "check_count",
    "decode",
    "encode",
]

MAX_RECORDS = 50_000  # of one body: a minute of a fast phone in raw samples

Name = Annotated[str, msgspec.Meta(min_length=1, max_length=200)]
Pair = tuple[float, float]
Triple = tuple[float, float, float, float]  # time and three axes
Quad = tuple[float, float, float, float, float]  # time and a quaternion w, x, y, z

T = TypeVar("T")


class Ap(msgspec.Struct, array_like=True, frozen=True, gc=False):
    """One reading: [bssid, rssi (dBm), frequency (MHz, 0 unknown), last seen (s, null unknown)]."""

    bssid: Name
    rssi: float
    mhz: float = 0.0
    seen: float | None = None


class Scan(msgspec.Struct, frozen=True):
    """A delivered scan."""

    t: float
    aps: list[Ap]


class Advertisement(msgspec.Struct, array_like=True, frozen=True, gc=False):
    """A Bluetooth advertisement: [t, id, rssi (dBm), tx power (dBm, null unknown)]."""

    t: float
    id: Name
    rssi: float
    tx_power: float | None = None


class Distance(msgspec.Struct, array_like=True, frozen=True, gc=False):
    """A range: [t, anchor, distance (m), sigma (m, null unknown), rssi (dBm, null unknown)]."""

    t: float
    anchor: Name
    distance: float
    sigma: float | None = None
    rssi: float | None = None


class Stepped(msgspec.Struct, array_like=True, frozen=True, gc=False):
    """A step the phone worked out: [t, heading (rad counter-clockwise from east), length (m, null unknown)]."""

    t: float
    heading: float
    length: float | None = None


class Envelope(msgspec.Struct, frozen=True, kw_only=True):
    """The own envelope, version 1. Times are seconds of the phone's clock (Unix time where it has it).

    device, track : what the phone calls itself and this session. id : of this message, for repetitions. Samples are
    rows [t, values...] in SI units (µT, hPa) about Android's axes. steps : instead of motion samples.
    end : the session is over.
    """

    v: Annotated[int, msgspec.Meta(ge=1, le=1)]
    device: Name
    track: Annotated[str, msgspec.Meta(max_length=200)] = ""
    id: Annotated[str, msgspec.Meta(max_length=200)] | int | None = None
    acceleration: list[Triple] = []
    rotation_rate: list[Triple] = []
    magnetic_field: list[Triple] = []
    orientation: list[Quad] = []
    pressure: list[Pair] = []
    wifi: list[Scan] = []
    ble: list[Advertisement] = []
    ranges: list[Distance] = []
    steps: list[Stepped] = []
    end: bool = False


def decode(body: bytes, kind: type[T]) -> T:
    """A JSON body as a type.

    Raises
    ------
    BadBodyError : it is not; the message names the place in the body.
    """
    try:
        return msgspec.json.decode(body, type=kind)
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise BadBodyError(f"the body cannot be read: {error}") from error
    except RecursionError as error:
        raise BadBodyError("the body cannot be read: nested too deeply") from error


def encode(value: Any) -> bytes:
    """JSON of a value."""
    return msgspec.json.encode(value)


def check_count(n: int) -> None:
    """Refuse a body with too many records.

    Raises
    ------
    BadBodyError : it has.
    """
    if n > MAX_RECORDS:
        raise BadBodyError(
            f"{n} records in one body, {MAX_RECORDS} are the most", remedy="send smaller bodies"
        )
