"""li2015 on real data: ranges of channel state (21 captures), and the range filter on walks with round-trip times.

The walks of ``wifi-rtt`` are of two rooms, two phones and five loops each, at 0.02 to 0.08 m/s, with motion sensors at
2 to 5 Hz in which no step can be seen. So this is R-PF, without a velocity; what it tries is the range likelihood and
its exponents (Eq. 8 to 12) under real errors. Loop 1 is the development part: the line that corrects ranges and each
method's parameters are chosen on it; loops 2 to 5 are the test.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise, product
from pathlib import Path

import numpy as np

from wayfuse.core.philox import Noise
from wayfuse.core.types import Array
from wayfuse.evaluation.results_bars import Bar, at_most
from wayfuse.evaluation.results_folds import Mapper
from wayfuse.formats import intel5300, wifi_rtt
from wayfuse.models.observation.ranges import Exponents
from wayfuse.papers.reproduction import Interval, Table, mean_interval
from wayfuse.papers.wifi_rtt_groups import ROOMS, TEST, TrackedWalks, walk_groups
from wayfuse.presets.li2015 import R_PF, Config, track
from wayfuse.radio.csi import direct_path_power
from wayfuse.radio.multilateration import (
    constrained_least_squares,
    weighted_centroid,
    weighted_least_squares,
)
from wayfuse.radio.range_correction import AS_MEASURED, RangeLine, fit_range_line
from wayfuse.radio.ranging import fit_antennas, fit_range, mean_range

__all__ = ["RangeWalk", "captures", "errors_of", "range_tables", "read_walks"]

_DEVELOPMENT = "1"  # loop, first letter of a walk's name
_FIXES: Mapping[str, Callable[[Array, Array, float], Array]] = {
    "weighted centroid": weighted_centroid,
    "WLS": weighted_least_squares,
    "WC-CWLS": constrained_least_squares,
}
_POWERS = (1.0, 2.0, 4.0)  # of the weights 1/d^power
_INVERSE = "R-PF, exponents 1/d (Eq. 12)"
_FILTERS = {
    "R-PF, exponents 1 (Eq. 8)": Exponents.ONE,
    "R-PF, exponents 1/N": Exponents.EQUAL,
    _INVERSE: Exponents.INVERSE_RANGE,
}
_SIGMAS = (2.0, 4.0, 8.0, 16.0)  # m, of a range
_ACCELERATIONS = (0.03, 0.1, 0.3)  # m/s²
_START = replace(R_PF, start_sigma=3.0, start_velocity_sigma=0.1, n_particles=500)  # about the first centroid
_OURS = "fused-ranges"
_CORRECTIONS = ("ranges as measured", "line of the other room", "line of the same room")
_BINS = (0.0, 5.0, 10.0, 20.0, 50.0)  # m


@dataclass(frozen=True, slots=True, eq=False)
class RangeWalk:
    """A walk: anchors (n, 2) m, times (k,) s, ranges (k, n) m with NaN, truth (k, 2) m."""

    room: str
    name: str
    anchors: Array
    t: Array
    ranges: Array
    xy: Array

    @property
    def is_development(self) -> bool:
        """Whether parameters may be chosen on it."""
        return self.name.startswith(_DEVELOPMENT)

    @property
    def distances(self) -> Array:
        """True distances (k, n) m."""
        return np.asarray(np.hypot(*(self.xy[:, None] - self.anchors).transpose(2, 0, 1)))

    def corrected(self, line: RangeLine) -> RangeWalk:
        """With ranges on a line."""
        return replace(self, ranges=line.distance(self.ranges))


def read_walks(root: Path) -> list[RangeWalk]:
    """All walks below the folder of the data set; none where it is not there."""
    out = []
    for room in ROOMS:
        for folder in root.glob(f"*/raw_data/{room}"):
            places = wifi_rtt.read_places(folder)
            paths = sorted(folder.glob("*/[0-9][0-9][0-9].csv"))
            out += [_walk(room, path, places) for path in paths]
    return out


def _walk(room: str, path: Path, places: Sequence[wifi_rtt.PlacedAnchor]) -> RangeWalk:
    recording = wifi_rtt.read(path)
    column = {place.anchor: k for k, place in enumerate(places)}
    known = [r for r in recording.ranges if r.anchor in column]
    t, row = np.unique([r.t for r in known], return_inverse=True)
    ranges = np.full((len(t), len(places)), np.nan)
    for k, r in zip(row.tolist(), known, strict=True):
        ranges[k, column[r.anchor]] = r.distance
    truth = np.array([w[:3] for w in recording.waypoints])
    xy = np.column_stack([np.interp(t, truth[:, 0], truth[:, k]) for k in (1, 2)])
    return RangeWalk(room, recording.name, np.array([p[1:] for p in places]), t, ranges, xy)


def errors_of(walk: RangeWalk, method: str, setting: tuple[float, ...], seed: int = 0) -> Array:
    """Errors (k,) m of a method at each moment of a walk; a fix that fails keeps the one before."""
    if method in _FIXES:
        places = _held(_FIXES[method](walk.anchors, walk.ranges, setting[0]), walk.anchors)
    else:
        sigma, acceleration = setting
        config: Config = replace(
            _START, range_sigma=sigma, acceleration_sigma=acceleration, exponents=_FILTERS[method]
        )
        x, y = weighted_centroid(walk.anchors, walk.ranges[:1])[0].tolist()
        noise = Noise.of(seed, f"{walk.room} {walk.name}")
        dt = np.diff(walk.t, prepend=walk.t[0])
        places = track(walk.anchors, walk.ranges, np.zeros((len(dt), 2)), (x, y), dt, noise, config)
    return np.asarray(np.hypot(*(places - walk.xy).T))


def _held(places: Array, anchors: Array) -> Array:
    """Places (k, 2) m with the last known one in place of NaN; before the first the middle of the anchors."""
    known = np.isfinite(places[:, 0])
    last = np.maximum.accumulate(np.where(known, np.arange(len(places)), -1))
    return np.where(last[:, None] >= 0, places[np.maximum(last, 0)], anchors.mean(axis=0))


@dataclass(frozen=True, slots=True, eq=False)
class _Work:
    """A method under a correction: settings tried on the development walks, the best one on all others."""

    walks: tuple[RangeWalk, ...]

    def __call__(self, what: tuple[str, str]) -> tuple[tuple[float, ...], float, Array]:
        """The setting chosen, its mean error on the development part (m), the mean error of each test walk (m)."""
        method, correction = what
        walks = [w.corrected(self._line(w.room, correction)) for w in self.walks]
        development = [w for w in walks if w.is_development]
        settings: list[tuple[float, ...]] = (
            [(p,) for p in _POWERS] if method in _FIXES else list(product(_SIGMAS, _ACCELERATIONS))
        )
        tried = [np.mean([errors_of(w, method, s).mean() for w in development]) for s in settings]
        best = int(np.argmin(tried))
        test = [float(errors_of(w, method, settings[best]).mean()) for w in walks if not w.is_development]
        return settings[best], float(tried[best]), np.array(test)

    def _line(self, room: str, correction: str) -> RangeLine:
        if correction == _CORRECTIONS[0]:
            return AS_MEASURED
        is_same = correction == _CORRECTIONS[2]
        fitted = [w for w in self.walks if w.is_development and (w.room == room) == is_same]
        return fit_range_line(
            np.concatenate([w.ranges.ravel() for w in fitted]),
            np.concatenate([w.distances.ravel() for w in fitted]),
        )


def range_tables(root: Path, mapper: Mapper) -> tuple[Table, ...]:
    """The tables of ``wifi-rtt``, or one that says that it is not there."""
    walks = tuple(read_walks(root))
    if not walks:
        why = "REAL DATA ABSENT: fetch with `wayfuse datasets fetch wifi-rtt`"
        return (Table("Real ranges: wifi-rtt", ("not measured",), ((why,),)),)
    methods = (*_FIXES, *_FILTERS)
    items = list(product(methods, _CORRECTIONS))
    found = dict(zip(items, mapper(_Work(walks), items, "li2015: wifi-rtt"), strict=True))
    ours = TrackedWalks(_OURS, walk_groups(root, TEST))
    tracked = np.array(list(mapper(ours, ours.items, f"li2015: wifi-rtt by {_OURS}")))
    return _range_errors(walks), _filter_errors(found, tracked, walks), _exponents(found)


def _range_errors(walks: Sequence[RangeWalk]) -> Table:
    rows: list[tuple[str | float | Interval, ...]] = []
    for room in ROOMS:
        here = [w for w in walks if w.room == room]
        true = np.concatenate([w.distances.ravel() for w in here])
        error = np.concatenate([w.ranges.ravel() for w in here]) - true
        for low, high in pairwise(_BINS):
            e = error[(true >= low) & (true < high) & np.isfinite(error)]
            if len(e):
                share = float(np.mean(np.abs(e) > 5.0))
                cells = (str(len(e)), f"{np.median(e):.2f}", f"{e.std():.2f}", f"{100 * share:.0f} %")
                rows.append((f"{room}, {low:g} to {high:g} m", *cells))
    return Table(
        "Real ranges: errors of round-trip times (wifi-rtt)",
        ("true distance", "ranges", "median error, m", "sd, m", "beyond 5 m"),
        tuple(rows),
        "All loops, as measured: what the exponents 1/d suppose. Nothing was tuned.",
    )


def _filter_errors(found: _Found, tracked: Array, walks: Sequence[RangeWalk]) -> Table:
    test = [w for w in walks if not w.is_development]
    last = found[_INVERSE, _CORRECTIONS[-1]][2]
    worst = int(np.argmax(last))
    rows: list[tuple[str | float | Interval, ...]] = [
        (method, *(mean_interval(found[method, c][2]) for c in _CORRECTIONS))
        for method in (*_FIXES, *_FILTERS)
    ]
    rows.append((f"{_OURS}, which is told neither line nor start", mean_interval(tracked), "-", "-"))
    note = (
        f"Mean error (m) with the 90 % interval of the mean over the {len(test)} walks of loops 2 to 5 (two rooms, two "
        "phones; walks of a room repeat one path, so they are less independent than the intervals say). Chosen on "
        "loop 1: the line (in the second column on that of the other room) and, for each method and column, the power "
        "of the weights or sigma and w. One seed; start at the weighted centroid of the first ranges. Worst walk of "
        f"the last cell: {test[worst].room} {test[worst].name}, {last[worst]:.2f} m; median of its walks "
        f"{np.median(last):.2f} m. "
        f"{_OURS} is the method of `track`, with motion sensors; it estimates the line. Its parameters were chosen on "
        f"loop 1 and in simulated warehouses. Median of its walks {np.median(tracked):.2f} m, worst "
        f"{tracked.max():.2f} m."
    )
    return Table("Real ranges: the range filter on wifi-rtt", ("method", *_CORRECTIONS), tuple(rows), note)


def _exponents(found: _Found) -> Table:
    rows: list[tuple[str | float | Interval, ...]] = []
    for method in _FILTERS:
        if method == _INVERSE:
            continue
        cells: list[str | Interval] = []
        for correction in _CORRECTIONS:
            gain = found[method, correction][2] - found[_INVERSE, correction][2]
            cells.append(f"{mean_interval(gain)}, {int((gain > 0).sum())} of {len(gain)}")
        rows.append((f"1/d in place of {method.removeprefix('R-PF, exponents ')}", *cells))
    chosen = ("chosen for 1/d: sigma, w", *(_text(found[_INVERSE, c][0]) for c in _CORRECTIONS))
    return Table(
        "Real ranges: what the exponents gain on wifi-rtt", ("", *_CORRECTIONS), (*rows, chosen),
        "Gain in mean error (m), 90 % interval over walks, and in how many walks it is a gain.",
    )  # fmt: skip


def _text(setting: tuple[float, ...]) -> str:
    return f"{setting[0]:g} m, {setting[1]:g} m/s²"


_Found = Mapping[tuple[str, str], tuple[tuple[float, ...], float, Array]]


def captures(folder: Path) -> tuple[Table, list[Bar]]:
    """Ranges of captures named ``<metres>-...``, each from regressions on all others; no row without the data."""
    title, columns = (
        "Real channel state: range, leave one capture out",
        ("input", "mean, m", "90 %, m", "greatest, m"),
    )
    paths = sorted(folder.glob("*.dat"))
    if not paths:
        note = "REAL DATA ABSENT: fetch with `wayfuse datasets fetch csi`; the bar of 0.3 m was not tried."
        return Table(title, columns, (), note), []
    frames = [intel5300.read(path).csi for path in paths]
    true = np.array([float(path.name.split("-")[0]) for path in paths])
    power = np.array([np.nanmedian([direct_path_power(f) for f in each], axis=0) for each in frames])
    rss = np.array([np.nanmedian([f.rss for f in each]) for each in frames])
    others = ~np.eye(len(true), dtype=bool)
    found = {
        "direct path, mean over antennas": [
            mean_range(fit_antennas(power[k], true[k]), power[i]) for i, k in enumerate(others)
        ],
        "received power (RSS) alone": [
            fit_range(rss[k], true[k]).distance(rss[i]) for i, k in enumerate(others)
        ],
        "mean distance of the other captures": [true[k].mean() for k in others],
    }
    errors = {name: np.abs(np.array(ranges, dtype=np.float64) - true) for name, ranges in found.items()}
    rows = tuple((n, float(e.mean()), float(np.percentile(e, 90)), float(e.max())) for n, e in errors.items())
    note = (
        f"{len(paths)} captures at 1 to 4.5 m, median over each; distances are those of the file names. In this one "
        "line-of-sight set-up channel state brings no gain over the received power."
    )
    mean = float(errors["direct path, mean over antennas"].mean())
    return Table(title, columns, rows, note), [at_most("range of real captures, mean", 0.3, mean, "m")]
