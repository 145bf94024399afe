"""Errors of estimates against the truth, point by point, and the figures that sum them up.

An estimate counts online: at an evaluation time it is the last row at or before that time, never a later one.
The horizontal error disregards the floor; the combined error adds 15 m per floor of difference (the rule of
the indoor location competitions), and its 75th percentile is the IPIN score. A time before a method's first
estimate is *missing*: it is counted, and either skipped or filled back with the first estimate, as the caller
says.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.errors import UsageError
from wayfuse.core.types import Array, BoolArray, IntArray
from wayfuse.evaluation.estimates_file import EstimatesFile, WalkEstimates
from wayfuse.evaluation.truth import TIME_TOLERANCE, TIMES, CommonFrame, SiteFloors, Truth, truth_of
from wayfuse.radio.survey import Survey
from wayfuse.sensors.recording import Recording

__all__ = [
    "FLOOR_PENALTY",
    "MISSING",
    "NO_ESTIMATES",
    "MethodScores",
    "PointErrors",
    "Scores",
    "Summary",
    "last_at_or_before",
    "places_in_frame",
    "score",
    "summarise",
    "survey_distances",
]

FLOOR_PENALTY = 15.0  # m per floor, rule of the IPIN and Microsoft indoor location competitions
MISSING = ("skip", "backfill", "all")
# Reasons why a walk is not scored
NO_ESTIMATES = "recording without estimates"
NO_RECORDING = "estimates without a recording"
NO_WAYPOINTS = "recording without waypoints"
NO_DEGREES = "waypoints in degrees, estimates without lat and lon (give --site)"


@dataclass(frozen=True, slots=True, eq=False)
class PointErrors:
    """Errors of one method at its evaluation times, all walks one below the other; columns of length n.

    walk : index into `Scores.walks`. t : s, recording's clock. since_start : s since the first scan, negative
    before it. missing : no estimate at or before t (the values are then those of the first estimate).
    truth_xy : (n, 2) m. offset : (n, 2) m, estimate minus truth. error : m, horizontal. floor_steps : floors
    between estimate and truth, NaN where the truth names no floor. transit : the truth changes floor between
    the waypoints around t. r68, r95 : m; cov : (n, 3) m² xx, yy, xy; NaN where the file has none. state :
    name. survey_distance : m from the true place to the survey on its floor, inf where the floor has none,
    NaN where no survey is given.
    """

    walk: IntArray
    t: Array
    since_start: Array
    missing: BoolArray
    truth_xy: Array
    offset: Array
    error: Array
    floor_steps: Array
    transit: BoolArray
    r68: Array
    r95: Array
    cov: Array
    state: NDArray[np.str_]
    survey_distance: Array

    def __len__(self) -> int:
        return len(self.t)

    @property
    def combined(self) -> Array:
        """(n,) m, error + 15 m per floor; NaN where the truth names no floor."""
        return self.error + FLOOR_PENALTY * self.floor_steps

    def select(self, rows: BoolArray) -> PointErrors:
        """The points where ``rows`` (n,) holds."""
        return PointErrors(*(getattr(self, f.name)[rows] for f in fields(self)))

    def used(self, missing: str = "skip") -> PointErrors:
        """Points that figures are taken over.

        "skip": from the first scan on, where there is an estimate; "backfill": from the first scan on, filled
        back with the first estimate; "all": all times from the first waypoint on, filled back likewise.
        """
        if missing not in MISSING:
            raise UsageError(f"no such treatment of missing estimates: {missing!r}", remedy=f"use {MISSING}")
        rows = np.ones(len(self), np.bool_) if missing == "all" else self.since_start >= -TIME_TOLERANCE
        return self.select(rows & ~self.missing if missing == "skip" else rows)

    def of_known_floor(self) -> PointErrors:
        """Without the moments between two waypoints on different floors: nobody knows the floor then."""
        return self.select(~self.transit)

    @property
    def availability(self) -> float:
        """Share of the times from the first scan on that have an estimate; NaN without any time."""
        online = self.since_start >= -TIME_TOLERANCE
        return float(np.mean(~self.missing[online])) if np.any(online) else float("nan")

    @classmethod
    def join(cls, parts: Sequence[PointErrors]) -> PointErrors:
        """Points of several walks, one below the other."""
        return cls(*(np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(cls)))


@dataclass(frozen=True, slots=True, eq=False)
class MethodScores:
    """One method: its errors at 1 Hz and at waypoints, the tracks scored, the walks it has no estimate
    for."""

    name: str
    points: Mapping[str, PointErrors]
    tracks: tuple[WalkEstimates, ...]
    missing_walks: tuple[str, ...] = ()

    @property
    def n_walks(self) -> int:
        """Number of walks scored."""
        return len(self.tracks)


@dataclass(frozen=True, slots=True, eq=False)
class Scores:
    """All methods over the same truth.

    walks : names of the walks with truth and an estimate of any method. truths : by name. unscored : (name,
    reason) of what could not be scored. notes : what the reader of the score should know. reports : what the
    recordings' readers met. frame : in which places were compared.
    """

    walks: tuple[str, ...]
    truths: Mapping[str, Truth]
    methods: tuple[MethodScores, ...]
    frame: CommonFrame
    unscored: tuple[tuple[str, str], ...] = ()
    notes: tuple[str, ...] = ()
    reports: tuple[str, ...] = ()

    def method(self, name: str) -> MethodScores:
        """The scores of one method by its name."""
        for scores in self.methods:
            if scores.name == name:
                return scores
        names = ", ".join(m.name for m in self.methods)
        raise UsageError(f"no method {name!r} among the estimates", remedy=f"there are: {names}")


@dataclass(frozen=True, slots=True)
class Summary:
    """Figures over points (m, shares in 0..1, NaN where nothing is known); IPIN = p75 of the combined
    error."""

    n: int
    n_walks: int
    mean: float
    p50: float
    p75: float
    p90: float
    p95: float
    floor_accuracy: float
    combined_mean: float
    ipin: float


def summarise(points: PointErrors) -> Summary:
    """Figures over all points given (percentiles by linear interpolation)."""
    nan = float("nan")
    p = np.percentile(points.error, (50, 75, 90, 95)) if len(points) else np.full(4, nan)
    known = np.isfinite(points.floor_steps)
    combined = points.combined[known]
    return Summary(
        n=len(points),
        n_walks=len(np.unique(points.walk)),
        mean=float(np.mean(points.error)) if len(points) else nan,
        p50=float(p[0]),
        p75=float(p[1]),
        p90=float(p[2]),
        p95=float(p[3]),
        floor_accuracy=float(np.mean(points.floor_steps[known] == 0)) if known.any() else nan,
        combined_mean=float(np.mean(combined)) if known.any() else nan,
        ipin=float(np.percentile(combined, 75)) if known.any() else nan,
    )


def last_at_or_before(t: Array, at: Array) -> IntArray:
    """Index of the last of the ascending times ``t`` (n,) at or before each of ``at`` (k,), -1 where none
    is."""
    return np.asarray(np.searchsorted(t, at + TIME_TOLERANCE, side="right") - 1)


def survey_distances(survey: Survey, frame: CommonFrame, xy: Array, floor: NDArray[np.str_]) -> Array:
    """Distance (m) from places (n, 2) of named floors (n,), common frame, to the nearest fingerprint there.

    Infinite where the survey has none on that floor.
    """
    from scipy.spatial import cKDTree

    out = np.full(len(xy), np.inf)
    for index, name in enumerate(survey.floors):
        rows = np.char.lower(floor) == name.lower()
        places = survey.xy[survey.floor == index]
        if rows.any() and len(places):
            tree = cKDTree(places + frame.shift(np.array([name])))
            out[rows] = tree.query(xy[rows])[0]
    return out


def score(
    estimates: Iterable[EstimatesFile | WalkEstimates],
    recordings: Iterable[Recording],
    site: SiteFloors | None = None,
    survey: Survey | None = None,
) -> Scores:
    """Score estimates against the waypoints of recordings.

    Parameters
    ----------
    estimates : files as `read_estimates` gives them, or tracks of any number of methods.
    recordings : with waypoints; only their truth is kept, so a generator will do.
    site : orders the floors and takes waypoints in degrees into metres; without it floors whose names differ
    are
        one floor apart.
    survey : places of the fingerprints, for the split by distance to the survey.

    Raises
    ------
    UsageError
        if nothing can be scored, a recording's name occurs twice, a method has two tracks of a walk, or an
        estimate is on a floor that the site does not have.
    """
    frame = CommonFrame(site)
    tracks = _by_method(estimates, frame)
    tracked = {walk for of_method in tracks.values() for walk in of_method}
    truths, unscored, notes, reports = _truths(recordings, frame, tracked)
    rows: dict[str, list[tuple[WalkEstimates, dict[str, PointErrors]]]] = {name: [] for name in tracks}
    for index, (walk, truth) in enumerate(truths.items()):
        grids = {at: _Grid.of(truth, at, frame, survey) for at in TIMES}
        for name in tracks:
            track = tracks[name].get(walk)
            xy = None if track is None else places_in_frame(track, truth, frame)
            if track is not None and xy is not None:
                rows[name].append((track, {at: grids[at].errors(index, track, xy, frame) for at in TIMES}))
            elif track is not None:
                unscored.append((f"{walk} ({name})", NO_DEGREES))
    lone = tracked - set(truths) - {name for name, _ in unscored}
    unscored += [(walk, NO_RECORDING) for walk in sorted(lone)]
    methods = tuple(_method_scores(name, scored, tuple(truths)) for name, scored in rows.items() if scored)
    if not methods:
        raise UsageError("no walk can be scored", remedy=_why_nothing(unscored))
    return Scores(tuple(truths), truths, methods, frame, tuple(unscored), tuple(notes), tuple(reports))


def _by_method(
    estimates: Iterable[EstimatesFile | WalkEstimates], frame: CommonFrame
) -> dict[str, dict[str, WalkEstimates]]:
    """Tracks by method and walk, in the order given."""
    out: dict[str, dict[str, WalkEstimates]] = {}
    for item in estimates:
        for track in item.tracks if isinstance(item, EstimatesFile) else (item,):
            of_method = out.setdefault(track.method, {})
            if not len(track):
                continue
            if track.walk in of_method:
                what = f"method {track.method!r} has two tracks of walk {track.walk!r}"
                raise UsageError(what, remedy="give each method a name of its own in the column method")
            of_method[track.walk] = track
            if frame.site is not None and np.any(frame.index(track.floor) < 0):
                bad = str(track.floor[np.argmin(frame.index(track.floor))])
                names = ", ".join(f.name for f in frame.site.floors)
                what = f"walk {track.walk!r}, method {track.method!r}: the site has no floor {bad!r}"
                raise UsageError(
                    what, remedy=f"its floors are {names}; give the --site the estimates were made in"
                )
    return out


def _truths(
    recordings: Iterable[Recording], frame: CommonFrame, tracked: set[str]
) -> tuple[dict[str, Truth], list[tuple[str, str]], list[str], list[str]]:
    truths: dict[str, Truth] = {}
    unscored: list[tuple[str, str]] = []
    notes: list[str] = []
    reports: list[str] = []
    paths: dict[str, str] = {}
    for recording in recordings:
        if recording.name in paths:
            what = f"two recordings are named {recording.name!r}: {paths[recording.name]}, {recording.path}"
            raise UsageError(what, remedy="score them one after the other")
        paths[recording.name] = recording.path
        reports += recording.report.describe()
        truth = truth_of(recording, frame) if recording.name in tracked else None
        if truth is None:
            unscored.append((recording.name, NO_WAYPOINTS if recording.name in tracked else NO_ESTIMATES))
            continue
        truths[recording.name] = truth
        if not truth.has_radio:
            notes.append(f"{recording.name}: no Wi-Fi scan, scored from the first waypoint on")
        if frame.site is not None and np.any((frame.index(truth.floor) < 0) & (truth.floor != "")):
            notes.append(
                f"{recording.name}: the site lacks the floor of a waypoint; it counts as one floor away"
            )
    return truths, unscored, notes, reports


def places_in_frame(track: WalkEstimates, truth: Truth, frame: CommonFrame) -> Array | None:
    """Estimates (n, 2) m in the frame of the truth, None where they cannot be taken there."""
    if truth.plane is None:
        return np.asarray(track.xy + frame.shift(track.floor))
    return truth.plane.to_xy(track.lonlat) if np.all(np.isfinite(track.lonlat)) else None


def _method_scores(
    name: str, scored: list[tuple[WalkEstimates, dict[str, PointErrors]]], walks: tuple[str, ...]
) -> MethodScores:
    points = {at: PointErrors.join([of_walk[at] for _, of_walk in scored]) for at in TIMES}
    have = {track.walk for track, _ in scored}
    return MethodScores(
        name, points, tuple(track for track, _ in scored), tuple(w for w in walks if w not in have)
    )


def _why_nothing(unscored: list[tuple[str, str]]) -> str:
    if not unscored:
        return "give recordings with waypoints whose names are the walks of the estimates"
    shown = "; ".join(f"{name}: {reason}" for name, reason in unscored[:3])
    return f"{shown}{'; ...' if len(unscored) > 3 else ''}"


@dataclass(frozen=True, slots=True, eq=False)
class _Grid:
    """Truth of one walk at its evaluation times."""

    t: Array
    since_start: Array
    xy: Array
    floor: NDArray[np.str_]
    transit: BoolArray
    survey_distance: Array

    @classmethod
    def of(cls, truth: Truth, at: str, frame: CommonFrame, survey: Survey | None) -> _Grid:
        t = truth.times(at)
        xy, floor = truth.at(t)
        known = survey is not None and truth.plane is None
        distance = (
            survey_distances(survey, frame, xy, floor)
            if survey is not None and known
            else np.full(len(t), np.nan)
        )
        return cls(t, t - truth.start, xy, floor, truth.in_transit(t), distance)

    def errors(self, walk: int, track: WalkEstimates, xy: Array, frame: CommonFrame) -> PointErrors:
        """Errors of a track whose places in the common frame are ``xy``."""
        row = last_at_or_before(track.t, self.t)
        missing = row < 0
        row = self._after_knowing_nothing(np.maximum(row, 0), track)
        offset = xy[row] - self.xy
        cov = np.stack([track.number(name)[row] for name in ("var_x", "var_y", "cov_xy")], axis=1)
        return PointErrors(
            walk=np.full(len(self.t), walk),
            t=self.t,
            since_start=self.since_start,
            missing=missing,
            truth_xy=self.xy,
            offset=offset,
            error=np.hypot(offset[:, 0], offset[:, 1]),
            floor_steps=frame.steps(track.floor[row], self.floor),
            transit=self.transit,
            r68=track.number("r68")[row],
            r95=track.number("r95")[row],
            cov=cov,
            state=track.states()[row],
            survey_distance=self.survey_distance,
        )

    def _after_knowing_nothing(self, row: IntArray, track: WalkEstimates) -> IntArray:
        """Rows of before the first scan, where a tracker only knows the building, become the first row after."""
        start = self.t[0] - self.since_start[0] if len(self.t) else 0.0
        first = int(np.searchsorted(track.t, start - TIME_TOLERANCE))
        if first >= len(track):
            return row
        ignorant = (row < first) & (track.states()[row] == "initialising")
        return np.where(ignorant, first, row)
