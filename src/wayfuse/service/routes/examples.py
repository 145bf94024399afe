"""Examples of bodies and answers, for the OpenAPI description; a test posts each."""

from __future__ import annotations

from typing import Any

__all__ = ["EXAMPLES", "POSITION"]

EXAMPLES: dict[str, Any] = {
    "own": {
        "v": 1,
        "device": "phone-7",
        "track": "2026-11-22 morning",
        "id": 17,
        "acceleration": [[1763801000.01, 0.1, 0.2, 9.8], [1763801000.02, 0.1, 0.3, 9.7]],
        "rotation_rate": [[1763801000.01, 0.01, 0.0, 0.02]],
        "pressure": [[1763801000.0, 1013.2]],
        "wifi": [{"t": 1763801000.5, "aps": [["00:1b:63:00:00:01", -61.0, 2437, 1763801000.4]]}],
    },
    "sensor-logger": {
        "messageId": 17,
        "sessionId": "4e0f",
        "deviceId": "a1b2",
        "payload": [
            {
                "name": "totalacceleration",
                "time": 1763801000010000000,
                "values": {"x": 0.1, "y": 0.2, "z": 9.8},
            },
            {
                "name": "wifi",
                "time": 1763801000500000000,
                "values": {"ssid": "office", "bssid": "00:1b:63:00:00:01", "frequency": 2437, "level": -61},
            },
        ],
    },
    "find3": {
        "d": "phone-7",
        "f": "museum",
        "t": 1763801000500,
        "s": {"wifi": {"00:1b:63:00:00:01": -61}, "bluetooth": {}},
    },
    "getsensordata": "% GetSensorData\nWIFI;12.5;12.4;office;00:1b:63:00:00:01;2437;-61\n",
    "anchors": {
        "v": 1,
        "anchor": "an-07",
        "t": 1763801000500000000,
        "frames": [
            {
                "target": "tag-3",
                "rssi": -61.5,
                "freq_mhz": 2437,
                "seq": 1203,
                "range_m": 8.2,
                "range_std": 0.9,
            }
        ],
    },
}

POSITION: dict[str, Any] = {
    "type": "Feature",
    "geometry": {"type": "Point", "coordinates": [11.5755, 48.1374]},
    "properties": {
        "track": "9f86d081884c7d65",
        "device": "60303ae22b998861",
        "n": 42,
        "heard": 1763801001.2,
        "is_ended": False,
        "zones": ["Reading room"],
        "site": "museum",
        "level": "F1",
        "floor": 0,
        "x": 12.3,
        "y": 4.5,
        "covariance_m2": [[1.2, 0.1], [0.1, 0.9]],
        "radius_m_68": 1.9,
        "radius_m_95": 3.8,
        "state": "tracking",
        "t": 1763801000.5,
        "at": 1763801000.4,
        "why": {"steps": 1, "access_points": 14, "share_blocked": 0.02, "effective_particles": 0.61},
    },
}
