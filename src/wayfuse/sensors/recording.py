"""A recording: the columns of one walk, and its records merged in time order, lazily.

Columns serve the array path (a walk of minutes is a few small arrays), `records` serves the record-by-record path;
both carry the same values in the same order.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from itertools import repeat
from operator import attrgetter

import numpy as np

from wayfuse.core.errors import ConfigError
from wayfuse.core.types import Array
from wayfuse.sensors.quality import ReadReport
from wayfuse.sensors.records import (
    Acceleration,
    BleReading,
    CsiFrame,
    MagneticField,
    Orientation,
    Pressure,
    Range,
    Record,
    RotationRate,
    Step,
    Waypoint,
    WifiScan,
)

__all__ = ["Device", "Recording", "Series"]

_AT_ONCE = 1024  # samples that become records together: many, for speed; not a whole day, for memory


@dataclass(frozen=True, slots=True)
class Device:
    """The phone: as the recording names it, empty where it does not."""

    brand: str = ""
    model: str = ""
    system: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Series:
    """A sensor's column: times (n,) s, not decreasing, and values (n, k) in the units of its record."""

    t: Array
    values: Array

    def __post_init__(self) -> None:
        if self.t.ndim != 1 or self.values.ndim != 2 or len(self.t) != len(self.values):
            raise ConfigError(
                f"a series needs t (n,) and values (n, k), got {self.t.shape}, {self.values.shape}"
            )

    def __len__(self) -> int:
        return len(self.t)

    @classmethod
    def empty(cls, k: int) -> Series:
        """A column without samples."""
        return cls(np.empty(0), np.empty((0, k)))

    def between(self, start: float, stop: float) -> Series:
        """Samples with start < t <= stop (views)."""
        i, j = self.t.searchsorted((start, stop), "right").tolist()
        return Series(self.t[i:j], self.values[i:j])


@dataclass(frozen=True, slots=True, eq=False)
class Recording:
    """One walk of one phone.

    Series hold (x, y, z) except ``pressure`` (hPa) and ``orientation`` (w, x, y, z). ``floor`` is what the file says
    of its floor (a surveyor's label: truth, never an input of a tracker). ``clock`` names the clock of ``t``. ``steps``
    are those that the phone worked out itself.
    """

    name: str
    acceleration: Series = field(default_factory=lambda: Series.empty(3))
    rotation_rate: Series = field(default_factory=lambda: Series.empty(3))
    magnetic_field: Series = field(default_factory=lambda: Series.empty(3))
    pressure: Series = field(default_factory=lambda: Series.empty(1))
    orientation: Series = field(default_factory=lambda: Series.empty(4))
    wifi: tuple[WifiScan, ...] = ()
    ble: tuple[BleReading, ...] = ()
    ranges: tuple[Range, ...] = ()
    steps: tuple[Step, ...] = ()
    csi: tuple[CsiFrame, ...] = ()
    waypoints: tuple[Waypoint, ...] = ()
    site: str = ""
    floor: str = ""
    clock: str = ""
    device: Device = field(default_factory=Device)
    path: str = ""
    report: ReadReport = field(default_factory=ReadReport)

    @property
    def span(self) -> tuple[float, float]:
        """First and last time of any record (s); (0, 0) for an empty recording."""
        ends = [(s.t[0], s.t[-1]) for s in self._series() if len(s)]
        ends += [(q[0].t, q[-1].t) for q in self._events() if q]
        if not ends:
            return 0.0, 0.0
        return float(min(e[0] for e in ends)), float(max(e[1] for e in ends))

    @property
    def is_empty(self) -> bool:
        """Whether there is no record at all."""
        return not any(len(s) for s in self._series()) and not any(self._events())

    @property
    def n_motion(self) -> int:
        """Number of samples of the motion sensors."""
        return sum(len(series) for series in self._series())

    @property
    def n_records(self) -> int:
        """Number of records of all kinds."""
        return self.n_motion + sum(len(events) for events in self._events())

    def records(self) -> Iterator[Record]:
        """All records in time order, merged lazily; at equal times motion sensors come before radio, truth last."""
        makers: tuple[tuple[Series, Callable[..., Record]], ...] = (
            (self.acceleration, Acceleration),
            (self.rotation_rate, RotationRate),
            (self.magnetic_field, MagneticField),
            (self.pressure, Pressure),
            (self.orientation, Orientation),
        )
        streams: list[Iterator[Record]] = [_rows(series, make) for series, make in makers]
        streams += [iter(events) for events in self._events()]
        return heapq.merge(*streams, key=attrgetter("t"))

    def _series(self) -> tuple[Series, ...]:
        return self.acceleration, self.rotation_rate, self.magnetic_field, self.pressure, self.orientation

    def _events(self) -> tuple[tuple[Record, ...], ...]:
        return self.steps, self.wifi, self.ble, self.ranges, self.csi, self.waypoints


def _rows(series: Series, make: Callable[..., Record]) -> Iterator[Record]:
    for start in range(0, len(series.t), _AT_ONCE):
        part = slice(start, start + _AT_ONCE)
        rows = zip(series.t[part].tolist(), *series.values[part].T.tolist(), strict=True)
        # as `make(*row)`, without a call of Python's for each
        yield from map(tuple.__new__, repeat(make), rows)  # type: ignore[arg-type]
