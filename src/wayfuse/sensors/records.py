"""Typed records: what one sensor said at one moment, in SI units, in the device frame unless said otherwise.

Times ``t`` are seconds in the recording's own clock (float64: sub-microsecond even for epoch seconds). Device
frame: x right, y up along the screen, z out of the screen (Android convention; readers convert others).
World frame of orientations: east, north, up.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.types import Array32, IdArray

__all__ = [
    "Acceleration",
    "BleReading",
    "CsiFrame",
    "MagneticField",
    "Orientation",
    "Pressure",
    "Range",
    "Record",
    "RotationRate",
    "Step",
    "Waypoint",
    "WifiScan",
    "bssid_id",
    "bssid_text",
]

_HASHED = 1 << 63  # set in identifiers that are digests of a token, never in a 48-bit hardware address


def bssid_id(text: str) -> int:
    """64-bit identifier of a BSSID: the 48-bit address itself, or a digest where it is an opaque token.

    >>> hex(bssid_id("0A:74:9c:2e:af:f7"))
    '0xa749c2eaff7'
    >>> bssid_id("token-17") >> 63
    1
    """
    digits = text.replace(":", "").replace("-", "")
    if len(digits) == 12:
        try:
            return int(digits, 16)
        except ValueError:
            pass
    from hashlib import blake2b

    return _HASHED | (int.from_bytes(blake2b(text.encode(), digest_size=8).digest(), "big") >> 1)


def bssid_text(identifier: int) -> str:
    """Readable form of an identifier: ``0a:74:9c:2e:af:f7`` or ``#`` and hexadecimal digits of a digest."""
    i = int(identifier)
    if i & _HASHED:
        return f"#{i ^ _HASHED:016x}"
    return ":".join(f"{(i >> s) & 255:02x}" for s in (40, 32, 24, 16, 8, 0))


class Acceleration(NamedTuple):
    """Specific force including gravity, m/s² (a phone lying face up reads z = +9.81)."""

    t: float
    x: float
    y: float
    z: float


class RotationRate(NamedTuple):
    """Angular velocity, rad/s, right-handed about the device axes."""

    t: float
    x: float
    y: float
    z: float


class MagneticField(NamedTuple):
    """Magnetic flux density, µT."""

    t: float
    x: float
    y: float
    z: float


class Pressure(NamedTuple):
    """Air pressure, hPa."""

    t: float
    hpa: float


class Orientation(NamedTuple):
    """Unit quaternion that turns device vectors into the east-north-up frame (rotation vector of the phone)."""

    t: float
    w: float
    x: float
    y: float
    z: float


@dataclass(frozen=True, slots=True, eq=False)
class WifiScan:
    """One delivered sweep of Wi-Fi readings; it may repeat readings of earlier sweeps (see ``last_seen``).

    bssid : (n,) identifiers (`bssid_id`). rssi : (n,) dBm. frequency : (n,) MHz, 0 where not recorded.
    last_seen : (n,) s in the recording's clock, NaN where not recorded. ``t`` is the time of delivery.
    """

    t: float
    bssid: IdArray
    rssi: Array32
    frequency: NDArray[np.int32]
    last_seen: NDArray[np.float64]


class BleReading(NamedTuple):
    """One Bluetooth Low Energy advertisement: identifier (`bssid_id`), RSSI in dBm, tx power in dBm or NaN."""

    t: float
    id: int
    rssi: float
    tx_power: float = float("nan")


class Range(NamedTuple):
    """Distance to an anchor, m, with its standard deviation (m, NaN unknown) and RSSI (dBm, NaN unknown)."""

    t: float
    anchor: int
    distance: float
    sigma: float = float("nan")
    rssi: float = float("nan")


class Step(NamedTuple):
    """A step that the phone worked out itself: length (m, NaN unknown), heading (rad counter-clockwise from east)."""

    t: float
    length: float
    heading: float


@dataclass(frozen=True, slots=True, eq=False)
class CsiFrame:
    """Channel state of one packet: (n_rx, n_tx, n_subcarriers) complex64, with RSS (dBm), AGC and noise (dBm)."""

    t: float
    anchor: int
    csi: NDArray[np.complex64]
    rss: float
    agc: float
    noise: float


class Waypoint(NamedTuple):
    """A place the surveyor stated: site metres (x, y) or WGS84 degrees (lat, lon), NaN where not given.

    ``floor`` is the floor's name, empty where the recording does not say.
    """

    t: float
    x: float
    y: float
    floor: str
    lat: float = float("nan")
    lon: float = float("nan")


Record: TypeAlias = (
    Acceleration
    | RotationRate
    | MagneticField
    | Pressure
    | Orientation
    | WifiScan
    | BleReading
    | Range
    | Step
    | CsiFrame
    | Waypoint
)
