"""Estimates as GeoJSON: where, on which level, how sure, in which state, and why."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any

from wayfuse.maps.site import Site
from wayfuse.service.zones import Crossing
from wayfuse.tracking.estimate import Estimate

__all__ = ["Json", "collection", "feature", "told"]

Json = dict[str, Any]


def feature(site: Site, e: Estimate, more: Mapping[str, Any], ahead: float = 0.0) -> Json:
    """A GeoJSON Feature of an estimate.

    The geometry is longitude and latitude (WGS84, RFC 7946), null where the floor has no anchor. ``x``, ``y`` are
    metres of the floor's own frame, as is the covariance (m²). ``t`` is the phone's time, ``at`` the server's, and
    ``ahead`` (s) what lies between them.
    """
    floor = site.floors[e.floor]
    geometry: Json | None = None
    if floor.anchor is not None:
        lon, lat = floor.anchor.to_lonlat((e.x, e.y)).tolist()
        geometry = {"type": "Point", "coordinates": [lon, lat]}
    return {
        "type": "Feature",
        "geometry": geometry,
        "properties": {
            **more,
            "site": site.name,
            "level": floor.name,
            "floor": e.floor,
            "x": _finite(e.x),
            "y": _finite(e.y),
            "covariance_m2": [
                [_finite(e.cov_xx), _finite(e.cov_xy)],
                [_finite(e.cov_xy), _finite(e.cov_yy)],
            ],
            "radius_m_68": _finite(e.r68),
            "radius_m_95": _finite(e.r95),
            "state": e.state.value,
            "t": e.t,
            "at": _finite(e.t - ahead) if math.isfinite(ahead) else None,
            "why": {
                "steps": e.n_steps,
                "access_points": e.n_aps,
                "share_blocked": _finite(e.share_blocked),
                "effective_particles": _finite(e.ess),
            },
        },
    }


def told(crossing: Crossing, ahead: float) -> Json:
    """A zone that was entered or left: ``t`` is the phone's time, ``at`` the server's."""
    return {
        "event": "enter" if crossing.is_enter else "leave",
        "zone": crossing.zone,
        "name": crossing.name,
        "kind": "geofence" if crossing.is_fence else "room",
        "t": crossing.t,
        "at": _finite(crossing.t - ahead) if math.isfinite(ahead) else None,
    }


def collection(features: Iterable[Json]) -> Json:
    """A GeoJSON FeatureCollection."""
    return {"type": "FeatureCollection", "features": list(features)}


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None
