"""A small house with every kind of connector, clouds in it, and reports of movements."""

from __future__ import annotations

from typing import Any

import numpy as np

from wayfuse.core.frames import GeoAnchor
from wayfuse.core.philox import Noise
from wayfuse.filters.cloud import Cloud
from wayfuse.inertial.vertical import Behaviour, VerticalEvent
from wayfuse.maps.build import build_floor
from wayfuse.maps.connectors import Connector, ConnectorKind, Landing
from wayfuse.maps.site import Polygon, Site
from wayfuse.models.motion.connectors import ConnectorMotion

ELEVATION = (0.0, 4.0, 8.0)
STAIRS, EXPRESS, LIFT, ESCALATOR, RAMP, LOCAL = range(6)  # connectors of `house`
# landings are apart by floors, so that places on the way can be told from places on a floor
CONNECTORS = (
    Connector(
        "stairs", ConnectorKind.STAIRS, (Landing(0, 10.0, 5.0), Landing(1, 14.0, 5.0), Landing(2, 14.0, 9.0))
    ),
    Connector("express stairs", ConnectorKind.STAIRS, (Landing(0, 40.0, 5.0), Landing(2, 44.0, 5.0))),
    Connector("lift", ConnectorKind.LIFT, (Landing(0, 70.0, 5.0), Landing(2, 70.0, 5.0))),
    Connector("escalator", ConnectorKind.ESCALATOR, (Landing(0, 10.0, 35.0), Landing(1, 18.0, 35.0)), (), 1),
    Connector("ramp", ConnectorKind.RAMP, (Landing(0, 40.0, 35.0), Landing(1, 60.0, 35.0))),
    Connector(
        "local lift",
        ConnectorKind.LIFT,
        (Landing(0, 80.0, 35.0), Landing(1, 80.0, 35.0), Landing(2, 80.0, 35.0)),
    ),
)
CORNER = ((0.0, 0.0), (5.0, -3.0), (-2.0, 4.0))  # m, of the floors' frames, in that of the lowest


def site_of(connectors: tuple[Connector, ...] = CONNECTORS, shifted: bool = False) -> Site:
    ring = Polygon(np.array([(0.0, 0.0), (90.0, 0.0), (90.0, 45.0), (0.0, 45.0), (0.0, 0.0)]))
    ground = GeoAnchor.from_origin(10.0, 50.0)
    anchors = [GeoAnchor.from_origin(*ground.to_lonlat(corner).tolist()) for corner in CORNER]
    floors = tuple(
        build_floor(f"F{i}", i, [ring], elevation=z, anchor=anchors[i] if shifted else None)
        for i, z in enumerate(ELEVATION)
    )
    return Site("house", floors, {}, connectors)


def event(
    rise: float, kind: Behaviour = Behaviour.STAIRS, sigma: float = 0.3, steps: int = 0, over: bool = False
) -> VerticalEvent:
    return VerticalEvent(9.0, 0.0, kind, rise, sigma, steps, over, 8.0 if over else np.nan, True)


def cloud_at(x: float, y: float, floor: int, n: int = 400) -> Cloud:
    full = [np.full(n, value, np.float32) for value in (x, y, 0.1, 1.0)]
    return Cloud.on_floors(*full, np.full(n, floor, np.int32))


def spread(n: int = 500, seed: int = 1) -> Cloud:
    """Particles all over the house."""
    rng = np.random.default_rng(seed)
    columns = rng.uniform(0, 90, n), rng.uniform(0, 45, n), rng.normal(0, 0.2, n), rng.normal(1, 0.1, n)
    return Cloud.on_floors(*(c.astype(np.float32) for c in columns), rng.integers(0, 3, n).astype(np.int32))


def aboard(connector: int, floor: int, base: float, n: int = 300) -> Cloud:
    cloud = cloud_at(1.0, 1.0, floor, n)
    return cloud._replace(connector=np.full(n, connector, np.int32), base=np.full(n, base, np.float32))


def boarded(motion: ConnectorMotion, cloud: Cloud, said: VerticalEvent) -> tuple[Cloud, np.ndarray]:
    log_weights = np.zeros(cloud.n)
    return motion.board(Noise.of(3, "x"), cloud, said, log_weights), log_weights


def ended(motion: ConnectorMotion, cloud: Cloud, said: VerticalEvent, key: str = "x") -> tuple[Cloud, Any]:
    log_weights = np.zeros(cloud.n)
    return motion.end(Noise.of(4, key), cloud, said, log_weights), log_weights


def same(a: Cloud, b: Cloud) -> None:
    for one, other in zip(a, b, strict=True):
        np.testing.assert_array_equal(one, other)
