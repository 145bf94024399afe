"""Small floor plans in the ms-indoor layout, made to be broken in tests."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

WEST, SOUTH = 10.0, 50.0
WIDTH, HEIGHT = 40.0, 30.0
METRE = np.deg2rad(6378137.0)  # m of a degree of latitude on the sphere of Web-Mercator


def degrees(ring):
    """Degrees of a ring in metres from the corner (WEST, SOUTH)."""
    middle = SOUTH + 0.5 * HEIGHT / METRE
    east = METRE * np.cos(np.deg2rad(middle))
    return [[WEST + x / east, SOUTH + y / METRE] for x, y in ring]


def box(x0, y0, x1, y1):
    return [[x0, y0], [x1, y0], [x1, y1], [x0, y1], [x0, y0]]


def outline(ring, name="F1"):
    geometry = {"type": "MultiPolygon", "coordinates": [[degrees(ring)]]}
    return {"type": "Feature", "properties": {"name": name, "type": "floor"}, "geometry": geometry}


def unit(ident, *rings, name="shop", category=()):
    properties = {"id": ident, "name": name, "category": list(category)}
    geometry = {"type": "Polygon", "coordinates": [degrees(ring) for ring in rings]}
    return {"type": "Feature", "properties": properties, "geometry": geometry}


def write_floor(folder: Path, features, width=WIDTH, height=HEIGHT) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    info = {"map_info": {"width": width, "height": height}}
    (folder / "floor_info.json").write_text(json.dumps(info))
    if features is not None:
        collection = {"type": "FeatureCollection", "features": features}
        (folder / "geojson_map.json").write_text(json.dumps(collection))
    return folder
