"""The whole of a track: estimates that are in the database, and those that are still in memory."""

from __future__ import annotations

import time

from wayfuse.service.live import Look
from wayfuse.service.server import Server
from wayfuse.tracking.estimate import Estimate

__all__ = ["estimates_of"]


def estimates_of(
    server: Server, look: Look, since: float | None = None, until: float | None = None
) -> list[tuple[int, Estimate]]:
    """Numbered estimates of a span of the phone's time (s), in order."""
    track, first = look.view.row.track, look.first
    for _ in range(20):  # what has settled is on its way into the database
        if server.tracks.n_estimates(track) >= first:
            break
        time.sleep(0.05)
    written = server.tracks.estimates(track, since, until)
    inside = [
        (n, e)
        for n, e in enumerate(look.recent, first)
        if (since is None or e.t >= since) and (until is None or e.t <= until)
    ]
    return [(n, e) for n, e in written if n < first] + inside
