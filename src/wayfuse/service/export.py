"""Tracks as files: CSV with everything, GPX 1.1 for tools that know places and times alone, OGC MF-JSON for those that
know moving things.

References
----------
.. [1] OGC 19-045r3, Moving Features Encoding Extension: JSON, section 7 (Prism).
"""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Sequence
from datetime import UTC, datetime
from xml.sax.saxutils import escape

from wayfuse.maps.site import Site
from wayfuse.tracking.estimate import Estimate

__all__ = ["CSV_COLUMNS", "to_csv", "to_gpx", "to_mf_json"]

CSV_COLUMNS = (
    "t",
    "x",
    "y",
    "floor",
    "level",
    "lat",
    "lon",
    "cov_xx",
    "cov_xy",
    "cov_yy",
    "radius_68",
    "radius_95",
    "state",
    "steps",
    "access_points",
)
_EARLIEST, _LATEST = 0.0, 253_402_300_799.0  # years GPX can write: 1970 to 9999


def to_csv(site: Site, estimates: Sequence[Estimate]) -> str:
    """A row per estimate; numbers as they are, to the bit; no place on earth where the floor has no anchor."""
    out = io.StringIO()
    writer = csv.writer(out)
    writer.writerow(CSV_COLUMNS)
    for e in estimates:
        lat, lon = _lat_lon(site, e) or ("", "")
        name = site.floors[e.floor].name
        where = (e.t, e.x, e.y, e.floor, name, lat, lon)
        how = (e.cov_xx, e.cov_xy, e.cov_yy, e.r68, e.r95, e.state.value, e.n_steps, e.n_aps)
        writer.writerow((*where, *how))
    return out.getvalue()


def to_gpx(site: Site, estimates: Sequence[Estimate], name: str) -> str:
    """A track; points without a place on earth or with a time that is none of a calendar are left out."""
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        '<gpx version="1.1" creator="wayfuse" xmlns="http://www.topografix.com/GPX/1/1">',
        f"<trk><name>{escape(name)}</name><trkseg>",
    ]
    for e in estimates:
        place = _lat_lon(site, e)
        if place is None or not _EARLIEST <= e.t <= _LATEST:
            continue
        when = _when(e.t)
        level = escape(site.floors[e.floor].name)
        lines.append(
            f'<trkpt lat="{place[0]:.8f}" lon="{place[1]:.8f}"><time>{when}</time>'
            f"<desc>level {level}, {e.state.value}, within {e.r95:.1f} m in 95 %</desc></trkpt>"
        )
    return "\n".join([*lines, "</trkseg></trk></gpx>", ""])


def to_mf_json(site: Site, estimates: Sequence[Estimate], name: str) -> str:
    """A moving point with its level, radius and state; the last of estimates of one time, left out as in GPX."""
    placed = {
        _when(e.t): (e, place)
        for e in estimates
        if (place := _lat_lon(site, e)) is not None and _EARLIEST <= e.t <= _LATEST
    }
    times = sorted(placed)
    said = [placed[t][0] for t in times]
    properties = {
        "datetimes": times,
        "level": _temporal("Text", "Discrete", [site.floors[e.floor].name for e in said]),
        "radius_95": _temporal("Measure", "Linear", [e.r95 if math.isfinite(e.r95) else None for e in said])
        | {"form": "MTR"},
        "state": _temporal("Text", "Discrete", [e.state.value for e in said]),
    }
    feature = {
        "type": "Feature",
        "id": name,
        "properties": {"site": site.name},
        "temporalGeometry": {
            "type": "MovingPoint",
            "datetimes": times,
            "coordinates": [[placed[t][1][1], placed[t][1][0]] for t in times],
            "interpolation": "Linear",
        },
        "temporalProperties": [properties],
    }
    return json.dumps(feature)


def _temporal(kind: str, interpolation: str, values: list[object]) -> dict[str, object]:
    return {"type": kind, "interpolation": interpolation, "values": values}


def _when(t: float) -> str:
    return datetime.fromtimestamp(t, UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")


def _lat_lon(site: Site, e: Estimate) -> tuple[float, float] | None:
    anchor = site.floors[e.floor].anchor
    if anchor is None or not (math.isfinite(e.x) and math.isfinite(e.y)):
        return None
    lon, lat = anchor.to_lonlat((e.x, e.y)).tolist()
    return lat, lon
