"""Sensor Logger's HTTP push, as the app sends it.

The body says neither which platform it is from nor whether the axes were standardised; both come from the phone's
enrolment or the address it posts to. Without a platform the body is refused with a sentence for the person at the
phone, for the axes of iOS and Android differ in sign.

References
----------
.. [1] Sensor Logger: PUSHING.md, UNITS.md, github.com/tszheichoi/awesome-sensor-logger.
"""

from __future__ import annotations

import math
from typing import Annotated, Any

import msgspec

from wayfuse.formats.columns import Rows
from wayfuse.formats.sensor_logger import PLATFORMS, recording_of
from wayfuse.sensors.quality import ReadReport
from wayfuse.service.adapters.parts import digest_key, identifier, merged, notes_of
from wayfuse.service.message import Message, Part, Profile, SayToUserError
from wayfuse.service.wire import Name, check_count, decode

__all__ = ["SensorLogger"]

_NOMAP = "_nomap"  # the owner of the access point wants it in no map


class _Item(msgspec.Struct, frozen=True):
    name: Annotated[str, msgspec.Meta(max_length=200)]
    time: int | float
    values: msgspec.Raw = msgspec.Raw(b"{}")


class _Push(msgspec.Struct, frozen=True, rename="camel"):
    device_id: Name
    session_id: Annotated[str, msgspec.Meta(max_length=200)] = ""
    message_id: int | None = None
    payload: list[_Item] = []


class _Vector(msgspec.Struct, frozen=True):
    x: float
    y: float
    z: float


class _Quaternion(msgspec.Struct, frozen=True):
    qw: float
    qx: float
    qy: float
    qz: float


class _Pressure(msgspec.Struct, frozen=True):
    pressure: float


class _Wifi(msgspec.Struct, frozen=True):
    bssid: Name
    level: float
    frequency: float = 0.0
    ssid: str = ""


class _Bluetooth(msgspec.Struct, frozen=True, rename={"tx_power": "txPowerLevel"}):
    id: Name
    rssi: float
    tx_power: float | None = None


_KINDS: dict[str, tuple[str, type[Any]]] = {
    "totalacceleration": ("acceleration", _Vector),
    "accelerometer": ("linear", _Vector),
    "gravity": ("gravity", _Vector),
    "gyroscope": ("rotation_rate", _Vector),
    "magnetometer": ("magnetic_field", _Vector),
    "orientation": ("orientation", _Quaternion),
    "barometer": ("pressure", _Pressure),
    "wifi": ("wifi", _Wifi),
    "bluetooth": ("ble", _Bluetooth),
}


class SensorLogger:
    """Adapter of Sensor Logger's push."""

    def read(self, body: bytes, profile: Profile, arrived: float) -> list[Message]:
        """One message per body."""
        push = decode(body, _Push)
        check_count(len(push.payload))
        if profile.platform not in PLATFORMS:
            raise SayToUserError(
                "this server does not know whether your phone is an Android or an iPhone",
                remedy="add ?platform=android or ?platform=ios to the push address, or enrol the phone",
            )
        report, rows = ReadReport(), Rows()
        for n, item in enumerate(push.payload, 1):
            _take(item, n, rows, report)
        recording = recording_of(
            rows.columns(),
            report,
            platform=profile.platform,
            standardised=profile.standardised,
            name=push.session_id,
        )
        key = digest_key(body) if push.message_id is None else f"id {push.message_id}"
        part = Part(key, merged(recording.records()))
        return [Message(push.device_id, push.session_id, body, (part,), False, notes_of(report))]


def _take(item: _Item, n: int, rows: Rows, report: ReadReport) -> None:
    name = item.name.lower()
    known = _KINDS.get("bluetooth" if name.startswith("bluetooth") else name)
    if known is None:
        return  # pictures, annotations, other sensors
    kind, wanted = known
    t = item.time / 1e9
    try:
        v = msgspec.json.decode(item.values, type=wanted)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError):
        report.add(f"{item.name}: values cannot be read", n)
        return
    if isinstance(v, _Wifi):
        if v.ssid.endswith(_NOMAP):
            report.add("wifi: owner wants it in no map", n)
            return
        rows.add(kind, n, t, (v.level, v.frequency, math.nan), identifier(v.bssid))
    elif isinstance(v, _Bluetooth):
        power = math.nan if v.tx_power is None else v.tx_power
        rows.add(kind, n, t, (v.rssi, power), identifier(v.id))
    else:
        rows.add(kind, n, t, msgspec.structs.astuple(v))
