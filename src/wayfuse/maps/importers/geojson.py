"""Coordinates of GeoJSON as arrays of degrees, checked."""

from __future__ import annotations

from typing import Any

import numpy as np

from wayfuse.core.types import Array

__all__ = ["line", "lonlat", "polygons"]


def lonlat(points: Any) -> Array:
    """Longitude and latitude (k, 2) of GeoJSON positions; altitudes are dropped.

    Raises
    ------
    ValueError, TypeError, IndexError, KeyError : they are not places on the earth.
    """
    places = np.array([p[:2] for p in points], dtype=np.float64)
    if places.ndim != 2 or places.shape[1] != 2 or not np.all(np.abs(places) <= (180.0, 90.0)):
        raise ValueError("not places on the earth")
    return places


def polygons(feature: Any) -> tuple[tuple[Array, ...], ...]:
    """Rings in degrees of each polygon of a feature; empty where it is none, or not on the earth."""
    try:
        kind, drawn = feature["geometry"]["type"], feature["geometry"]["coordinates"]
        parts = {"Polygon": [drawn], "MultiPolygon": drawn}[kind]
        found = tuple(tuple(lonlat(ring) for ring in part) for part in parts)
    except (KeyError, TypeError, ValueError, IndexError):
        return ()
    return found if all(found) else ()


def line(feature: Any) -> Array | None:
    """Points (k, 2) in degrees of a LineString, None where it is none."""
    try:
        if feature["geometry"]["type"] != "LineString":
            return None
        points = lonlat(feature["geometry"]["coordinates"])
    except (KeyError, TypeError, ValueError, IndexError):
        return None
    return points if len(points) > 1 else None
