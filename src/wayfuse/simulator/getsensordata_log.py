"""Writes recordings as GetSensorData logs (LOPSI), the format of the IPIN competitions.

One record per line, four letters and fields between ``;``, on the clock of the app (s since the start). The
sensors' own clock runs with it from another origin, as on a phone. A recording of another origin loses what lies beyond
the decimals of `wayfuse.simulator.simulate_journey`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from wayfuse.core.types import Array
from wayfuse.sensors.recording import Recording, Series
from wayfuse.sensors.records import bssid_text
from wayfuse.simulator.simulate_journey import DECIMALS

__all__ = ["log_text", "write_log"]

_BOOT = 1000.0  # s the sensors' clock is ahead: the phone was switched on before
_KINDS = {"acceleration": "ACCE", "rotation_rate": "GYRO", "magnetic_field": "MAGN", "pressure": "PRES"}
_HEADER = (
    "% LogFile created by the 'GetSensorData' writer of wayfuse: simulated, no phone recorded this",
    "% Phone used for this logfile:",
    "% Manufacturer:            \t{brand}",
    "% Model:                   \t{model}",
    "% Android version Release: \t{release}",
    "%",
    "% 'ACCE;AppTimestamp(s);SensorTimestamp(s);Acc_X(m/s^2);Acc_Y(m/s^2);Acc_Z(m/s^2);Accuracy(integer)'",
    "% 'GYRO;AppTimestamp(s);SensorTimestamp(s);Gyr_X(rad/s);Gyr_Y(rad/s);Gyr_Z(rad/s);Accuracy(integer)'",
    "% 'MAGN;AppTimestamp(s);SensorTimestamp(s);Mag_X(uT);Mag_Y(uT);Mag_Z(uT);Accuracy(integer)'",
    "% 'PRES;AppTimestamp(s);SensorTimestamp(s);Pres(mbar);Accuracy(integer)'",
    "% 'AHRS;AppTimestamp(s);SensorTimestamp(s);PitchX(deg);RollY(deg);YawZ(deg);Quat(2);Quat(3);Quat(4);Accuracy'",
    "% 'WIFI;AppTimestamp(s);SensorTimeStamp(s);Name_SSID;MAC_BSSID;Frequency;RSS(dBm);'",
    "% 'POSI;Timestamp(s);Counter;Latitude(degrees);Longitude(degrees);floor ID(0,1,2..4);Building ID(0,1,2..3);'",
)


def log_text(recording: Recording, ssid: Mapping[int, str] | None = None) -> str:
    """A recording as a log; ``ssid`` names networks by identifier, others stay nameless."""
    lines = [
        line for name, kind in _KINDS.items() for line in _sensor_lines(getattr(recording, name), name, kind)
    ]
    lines += _orientation_lines(recording.orientation)
    lines += _wifi_lines(recording, ssid or {})
    for number, point in enumerate(recording.waypoints, 1):
        place = f"{point.lat:.{DECIMALS['degrees']}f};{point.lon:.{DECIMALS['degrees']}f}"
        lines.append((point.t, f"POSI;{point.t:.4f};{number};{place};{point.floor};0"))
    lines.sort(key=lambda line: line[0])  # stable: readings of one list keep their order
    device = recording.device
    release = device.system.removeprefix("Android ")
    head = [line.format(brand=device.brand, model=device.model, release=release) for line in _HEADER]
    return "\n".join([*head, *(text for _, text in lines)]) + "\n"


def write_log(path: Path, recording: Recording, ssid: Mapping[int, str] | None = None) -> None:
    """Write a recording as a GetSensorData log."""
    path.write_text(log_text(recording, ssid), encoding="utf-8", newline="\n")


def _sensor_lines(series: Series, name: str, kind: str) -> Iterator[tuple[float, str]]:
    values = ";".join([f"%.{DECIMALS[name]}f"] * series.values.shape[1])
    pattern = f"{kind};%.4f;%.4f;{values};3"
    for t, row in zip(series.t.tolist(), series.values.tolist(), strict=True):
        yield t, pattern % (t, _BOOT + t, *row)


def _orientation_lines(series: Series) -> Iterator[tuple[float, str]]:
    number = f"%.{DECIMALS['orientation']}f"
    pattern = f"AHRS;%.4f;%.4f;%.6f;%.6f;%.6f;{number};{number};{number};3"
    angles = _angles(series.values)
    for t, turn, row in zip(series.t.tolist(), angles.tolist(), series.values[:, 1:].tolist(), strict=True):
        yield t, pattern % (t, _BOOT + t, *turn, *row)


def _angles(q: Array) -> Array:
    """Right-handed turns (n, 3) degrees about the phone's x, y and the world's up axis."""
    w, x, y, z = q.T
    pitch = np.arcsin(np.clip(2.0 * (y * z + w * x), -1.0, 1.0))
    roll = np.arctan2(2.0 * (w * y - x * z), 1.0 - 2.0 * (x * x + y * y))
    yaw = np.arctan2(2.0 * (w * z - x * y), 1.0 - 2.0 * (x * x + z * z))
    return np.asarray(np.rad2deg(np.column_stack([pitch, roll, yaw])))


def _wifi_lines(recording: Recording, ssid: Mapping[int, str]) -> Iterator[tuple[float, str]]:
    networks: dict[int, str] = {}
    for scan in recording.wifi:
        columns = (scan.bssid.tolist(), scan.rssi.tolist(), scan.frequency.tolist(), scan.last_seen.tolist())
        for bssid, rssi, frequency, seen in zip(*columns, strict=True):
            network = networks.get(bssid)
            if network is None:
                network = networks[bssid] = f"{ssid.get(bssid, '')};{bssid_text(bssid)}"
            yield scan.t, f"WIFI;{scan.t:.4f};{_BOOT + seen:.4f};{network};{frequency};{rssi:.0f}"
