"""A recording as a phone would send it while it is made: own envelopes, one per stretch of time."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import numpy as np

from wayfuse.core.errors import ConfigError
from wayfuse.sensors.recording import Recording, Series
from wayfuse.sensors.records import WifiScan, bssid_text
from wayfuse.service.wire import Advertisement, Ap, Distance, Envelope, Scan, Stepped

__all__ = ["envelopes"]


def envelopes(recording: Recording, device: str, track: str = "", every: float = 1.0) -> Iterator[Envelope]:
    """Envelopes of ``every`` seconds each, numbered from 0; the last one says that the session is over.

    Raises
    ------
    ConfigError : ``every`` is not positive.
    """
    if not every > 0.0:
        raise ConfigError(f"every must be positive, got {every}", where="every")
    start, end = recording.span
    edges = [-math.inf, *(start + every * np.arange(1, math.ceil((end - start) / every))).tolist(), end]
    stretches = list(pairwise(edges))
    for n, (after, to) in enumerate(stretches):
        yield _envelope(recording, device, track, n, (after, to), is_last=n == len(stretches) - 1)


def _envelope(
    r: Recording, device: str, track: str, n: int, within: tuple[float, float], *, is_last: bool
) -> Envelope:
    after, to = within
    scans = [
        Scan(scan.t, [Ap(*ap) for ap in zip(*_readings(scan), strict=True)])
        for scan in r.wifi
        if after < scan.t <= to
    ]
    return Envelope(
        v=1,
        device=device,
        track=track,
        id=n,
        acceleration=_rows(r.acceleration, within),
        rotation_rate=_rows(r.rotation_rate, within),
        magnetic_field=_rows(r.magnetic_field, within),
        orientation=_rows(r.orientation, within),
        pressure=_rows(r.pressure, within),
        wifi=scans,
        ble=[
            Advertisement(b.t, bssid_text(b.id), b.rssi, _known(b.tx_power))
            for b in r.ble
            if after < b.t <= to
        ],
        ranges=[
            Distance(d.t, bssid_text(d.anchor), d.distance, _known(d.sigma), _known(d.rssi))
            for d in r.ranges
            if after < d.t <= to
        ],
        steps=[Stepped(s.t, s.heading, _known(s.length)) for s in r.steps if after < s.t <= to],
        end=is_last,
    )


def _rows(series: Series, within: tuple[float, float]) -> list[Any]:
    part = series.between(*within)
    return list(map(tuple, np.column_stack([part.t, part.values]).tolist()))


def _readings(scan: WifiScan) -> tuple[list[str], list[float], list[float], list[float | None]]:
    return (
        [bssid_text(i) for i in scan.bssid.tolist()],
        scan.rssi.tolist(),
        scan.frequency.tolist(),
        [_known(t) for t in scan.last_seen.tolist()],
    )


def _known(value: float) -> float | None:
    return value if math.isfinite(value) else None
