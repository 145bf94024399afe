"""Bodies that phones and anchors post, for the OpenAPI description: JSON Schemas.

The own envelope is described by the type that reads it. The formats of others are written out here, for they hold more
than is read; a test draws bodies from all of them and posts them.
"""

from __future__ import annotations

from typing import Any

import msgspec

from wayfuse.service.wire import Envelope

__all__ = ["BODIES"]

Json = dict[str, Any]
_REF = "#/"
_NAME: Json = {"type": "string", "minLength": 1, "maxLength": 200}
_NUMBER: Json = {"type": "number"}
_TEXT: Json = {"type": "string", "maxLength": 200}


def _inlined(part: Any, types: Json) -> Any:
    """A schema with its references replaced by what they refer to."""
    if isinstance(part, list):
        return [_inlined(each, types) for each in part]
    if not isinstance(part, dict):
        return part
    if "$ref" in part:
        return _inlined(types[part["$ref"].removeprefix(_REF)], types)
    return {key: _inlined(value, types) for key, value in part.items()}


def _own() -> Json:
    """The own envelope."""
    (schema,), types = msgspec.json.schema_components([Envelope], ref_template=_REF + "{name}")
    said: Json = _inlined(schema, types)
    return said | {"description": " ".join((Envelope.__doc__ or "").split())}


def _object(required: tuple[str, ...], /, **properties: Json) -> Json:
    return {"type": "object", "properties": properties, "required": list(required)}


def _maybe(schema: Json) -> Json:
    return {"anyOf": [schema, {"type": "null"}]}


def _rows(n: int, what: str) -> Json:
    row = {"type": "array", "items": _NUMBER, "minItems": n, "maxItems": n}
    return {"type": "array", "items": row, "description": what}


_SENSOR_LOGGER = _object(
    ("deviceId",),
    deviceId=_NAME | {"description": "What the app calls the phone."},
    sessionId=_TEXT | {"description": "Of one recording: a track."},
    messageId=_maybe({"type": "integer", "minimum": 0, "maximum": 2**63 - 1}),
    payload={
        "type": "array",
        "items": _object(
            ("name", "time"),
            name=_TEXT
            | {
                "description": "totalacceleration, accelerometer, gravity, gyroscope, magnetometer, orientation, "
                "barometer, wifi, bluetooth...; others are left out.",
            },
            time=_NUMBER | {"description": "Unix ns."},
            values={"description": "x, y, z; qw, qx, qy, qz; pressure; or ssid, bssid, frequency and level."},
        ),
    },
)
_FIND3 = _object(
    ("d",),
    d=_NAME | {"description": "Device."},
    f=_TEXT | {"description": "Family: names the track."},
    t=_NUMBER | {"description": "Unix ms; 0 or none: when it arrives."},
    s={
        "type": "object",
        "description": "Levels (dBm) by address, for `wifi` and `bluetooth`.",
        "additionalProperties": {"type": "object", "additionalProperties": _NUMBER},
    },
    l={"type": "string", "maxLength": 0, "description": "Learning a place by its name is not supported."},
)
_ANCHORS = _object(
    ("v", "anchor", "t", "frames"),
    v={"const": 1},
    anchor=_NAME,
    t={
        "type": "integer",
        "minimum": 0,
        "maximum": 2**63 - 1,
        "description": "Unix ns, of the anchor's clock.",
    },
    frames={
        "type": "array",
        "items": _object(
            ("target",),
            target=_NAME | {"description": "Dropped where it is a random hardware address."},
            rssi=_maybe(_NUMBER) | {"description": "dBm"},
            freq_mhz=_NUMBER,
            seq=_maybe({"type": "integer", "minimum": 0, "maximum": 2**63 - 1})
            | {"description": "Of the packet: its motion samples count once, however many anchors heard it."},
            t=_maybe({"type": "integer", "minimum": 0, "maximum": 2**63 - 1})
            | {"description": "ns, if another"},
            range_m=_maybe(_NUMBER),
            range_std=_maybe(_NUMBER),
            csi=_maybe(
                _object(
                    ("iq",),
                    iq={"type": "array", "items": _rows(2, "[re, im] of each subcarrier.")}
                    | {"description": "A list per receiving antenna."},
                    idx={
                        "type": "array",
                        "items": {"type": "integer", "minimum": -(2**31), "maximum": 2**31},
                    },
                    agc=_NUMBER | {"description": "dB"},
                    noise=_NUMBER | {"description": "dBm"},
                )
            ),
            imu=_rows(7, "Of the target: t (ns), acceleration x, y, z (m/s²), rotation x, y, z (rad/s)."),
        ),
    },
)
BODIES: Json = {
    "own": _own(),
    "sensor-logger": _SENSOR_LOGGER,
    "find3": _FIND3,
    "anchors": _ANCHORS,
    "getsensordata": {"type": "string", "description": "A GetSensorData log, whole."},
}
