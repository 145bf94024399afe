"""Writes recordings and buildings in the public ms-indoor layout (Indoor Location Competition 2.0).

A site folder holds one folder per floor with ``floor_info.json`` (the size of the outline in metres) and
``geojson_map.json`` (WGS84: the outline first, then the shops); a walk is a text file of tab-separated
records in time order. Times are whole milliseconds and values carry the decimals of
`wayfuse.simulator.simulate`; a recording of another origin loses what lies beyond them.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from wayfuse.core.frames import GeoAnchor
from wayfuse.core.types import Array
from wayfuse.sensors.recording import Recording, Series
from wayfuse.sensors.records import bssid_text
from wayfuse.simulator.building import Building, Storey
from wayfuse.simulator.simulate import DECIMALS

__all__ = ["recording_text", "write_recording", "write_site"]

_EARTH = 6378137.0  # m, radius of Web Mercator
_SHOP, _VOID = "5d35733edb07255e495599ed", "5d357b7f0c02a37d6cc84c8a"  # category ids of the public plans
_SENSORS = (
    ("acceleration", "TYPE_ACCELEROMETER"),
    ("magnetic_field", "TYPE_MAGNETIC_FIELD"),
    ("rotation_rate", "TYPE_GYROSCOPE"),
    ("orientation", "TYPE_ROTATION_VECTOR"),
)
_HEADER_SENSORS = (
    "type:1\tname:Simulated Accelerometer\tversion:1\tvendor:wayfuse\tresolution:0.0023956299",
    "type:4\tname:Simulated Gyroscope\tversion:1\tvendor:wayfuse\tresolution:0.0010681152",
    "type:2\tname:Simulated Magnetometer\tversion:1\tvendor:wayfuse\tresolution:0.5996704",
)


def recording_text(recording: Recording, ssid: Mapping[int, str] | None = None) -> str:
    """A recording as an ms-indoor text; ``ssid`` names networks by identifier, others stay nameless."""
    first, last = recording.span
    lines: list[tuple[int, int, str]] = [
        line
        for order, (name, kind) in enumerate(_SENSORS)
        for line in _sensor_lines(recording, name, kind, order)
    ]
    lines.extend(_wifi_lines(recording, ssid or {}))
    for waypoint in recording.waypoints:
        ms = _ms(waypoint.t)
        lines.append((ms, -1, f"{ms}\tTYPE_WAYPOINT\t{waypoint.x:.4f}\t{waypoint.y:.4f}"))
    lines.sort(key=lambda line: line[:2])  # stable: readings of one list keep their order
    site, floor = recording.site, recording.floor
    system = recording.device.system.removeprefix("Android ")
    head = [
        f"startTime:{_ms(first)}",
        f"SiteID:{_object_id(site)}\tSiteName:{site}\tFloorId:{_object_id(site, floor)}\tFloorName:{floor}",
        f"Brand:{recording.device.brand}\tModel:{recording.device.model}\tAndroidName:{system}\tAPILevel:29\t",
        *_HEADER_SENSORS,
        "VersionName:wayfuse-simulator\tVersionCode:1\t",
    ]
    text = [f"#\t{line}" for line in head]
    text.extend(line[2] for line in lines)
    text.append(f"#\tendTime:{_ms(last)}\n")
    return "\n".join(text)


def write_recording(path: Path, recording: Recording, ssid: Mapping[int, str] | None = None) -> None:
    """Write a recording as an ms-indoor text file."""
    path.write_text(recording_text(recording, ssid), encoding="utf-8", newline="\n")


def write_site(folder: Path, building: Building) -> tuple[Path, ...]:
    """Write a building in the ms-indoor layout; returns the floor folders, bottom up."""
    folders = []
    for number, storey in enumerate(building.storeys, start=1):
        place = folder / storey.name
        place.mkdir(parents=True, exist_ok=True)
        info = {"map_info": {"height": building.height, "width": building.width}}
        _write_json(place / "floor_info.json", info)
        _write_json(place / "geojson_map.json", _feature_collection(building, storey, number))
        folders.append(place)
    return tuple(folders)


def _sensor_lines(recording: Recording, name: str, kind: str, order: int) -> Iterator[tuple[int, int, str]]:
    series: Series = getattr(recording, name)
    values = series.values[:, 1:] if name == "orientation" else series.values
    number = f"%.{DECIMALS[name]}f"
    pattern = f"%d\t{kind}\t{number}\t{number}\t{number}\t3"
    for t, row in zip(np.rint(series.t * 1000).astype(np.int64).tolist(), values.tolist(), strict=True):
        yield t, order, pattern % (t, *row)


def _wifi_lines(recording: Recording, ssid: Mapping[int, str]) -> Iterator[tuple[int, int, str]]:
    networks: dict[int, str] = {}
    for scan in recording.wifi:
        ms = _ms(scan.t)
        rows: Iterable[tuple[int, float, int, float]] = zip(
            scan.bssid.tolist(),
            scan.rssi.tolist(),
            scan.frequency.tolist(),
            scan.last_seen.tolist(),
            strict=True,
        )
        for bssid, rssi, frequency, seen in rows:
            network = networks.get(bssid)
            if network is None:
                network = networks[bssid] = f"{ssid.get(bssid, '')}\t{bssid_text(bssid)}"
            yield ms, len(_SENSORS), f"{ms}\tTYPE_WIFI\t{network}\t{rssi:.0f}\t{frequency}\t{_ms(seen)}"


def _ms(t: float) -> int:
    return round(1000 * t)


def _feature_collection(building: Building, storey: Storey, number: int) -> dict[str, Any]:
    outline = {
        "type": "Feature",
        "geometry": {"type": "MultiPolygon", "coordinates": [[_ring(storey.outline, building.anchor)]]},
        "properties": {"category": "floor", "name": storey.name, "floor_num": number, "type": "floor"},
        "order": 1,
        "id": _object_id(building.name, storey.name),
    }
    shops = [
        {
            "type": "Feature",
            "properties": {
                "id": _object_id(building.name, storey.name, room.name),
                "name": room.name,
                "display": room.name,
                "category": [_VOID if room in storey.voids else _SHOP],
                "point": _mercator(room.polygon.mean(axis=0), building.anchor),
                "points": [],
            },
            "geometry": {"type": "Polygon", "coordinates": [_ring(room.polygon, building.anchor)]},
            "id": _object_id(building.name, storey.name, room.name),
        }
        for room in (*storey.rooms, *storey.voids)
    ]
    return {"type": "FeatureCollection", "features": [outline, *shops]}


def _ring(polygon: Array, anchor: GeoAnchor) -> list[list[float]]:
    closed = np.concatenate([polygon, polygon[:1]])
    return [[float(lon), float(lat)] for lon, lat in np.round(anchor.to_lonlat(closed), 12).tolist()]


def _mercator(xy: Array, anchor: GeoAnchor) -> list[float]:
    lon, lat = np.deg2rad(anchor.to_lonlat(xy)).tolist()
    return [_EARTH * lon, float(_EARTH * np.log(np.tan(0.25 * np.pi + 0.5 * lat)))]


def _object_id(*names: str) -> str:
    """24 hexadecimal digits as the public files have them, the same for the same names."""
    from hashlib import blake2b

    return blake2b("/".join(names).encode(), digest_size=12).hexdigest()


def _write_json(path: Path, value: dict[str, Any]) -> None:
    path.write_text(json.dumps(value, ensure_ascii=False) + "\n", encoding="utf-8", newline="\n")
