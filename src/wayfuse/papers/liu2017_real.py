"""liu2017 on real data: sequences at surveyed points of known access points, and the filter on walks of a museum.

The points are those of sodindoorloc, three buildings whose access points have published places: a fix from one sample,
the floor known, 2.4 GHz alone (the bands differ in level, which an order does not survive). The walks are those of
ipin2023-track3 on one floor, where places are estimated from the other repetitions (`papers.ipin2023_walks`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from wayfuse.core.types import Array
from wayfuse.evaluation.results_folds import Mapper
from wayfuse.inertial.autocorrelation_steps import count_steps
from wayfuse.maps.site import Site
from wayfuse.papers.ipin2023_walks import WalkMethod, fused_beside, steps_alone, walk_table
from wayfuse.papers.oxford_counts import step_count_table
from wayfuse.papers.reproduction import Interval, Table, mean_interval
from wayfuse.papers.sodindoorloc_buildings import Building, Samples, absent, read_buildings
from wayfuse.presets import liu2017_tracker
from wayfuse.presets.liu2017 import Config, fingerprint_neighbours
from wayfuse.radio.ap_estimation import estimate_places
from wayfuse.radio.ap_places import ApPlaces
from wayfuse.radio.ap_sequence import Neighbours, from_positions
from wayfuse.radio.survey import Survey
from wayfuse.sensors.recording import Series
from wayfuse.tracking.tracker import Tracker

__all__ = ["estimated_places_errors", "fix_errors", "real_tables", "walks_table"]

_MARGIN = 3.0  # m round the training points: the area of the grid
_LEAST = 3  # access points that make a sequence
_CONFIG = Config()
_Fix: TypeAlias = Callable[[Array], Array | None]


def real_tables(root: Path, mapper: Mapper) -> tuple[Table, ...]:
    """The tables on real data, or those that say that they were not measured where a data set is not there."""
    buildings = read_buildings(root / "sodindoorloc")
    walks = walks_table(root / "ipin2023-track3" / "logs", mapper)
    counts = step_count_table(root, _counted, "The counter of Section III-C.")
    if not buildings:
        return Table("Real data: sodindoorloc", ("not measured",), ((absent(),),)), walks, counts
    return _fixes(buildings), _estimates(buildings), walks, counts


def _counted(acceleration: Series) -> int:
    return int(count_steps(acceleration).steps[-1])


# --- points -------------------------------------------------------------------------------------------------


def fix_errors(building: Building) -> dict[str, Array]:
    """Errors (n,) m of a fix from the first sample of each testing point, by method; the floor is known."""
    errors: dict[str, list[float]] = {}
    for floor in np.unique(building.testing.floor).tolist():
        mine = building.on(floor)
        train, test = (s.of_floor(floor, mine) for s in (building.training, building.testing))
        methods = _methods(building.ap_xy(mine), _estimated(train), train)
        for k in test.first_of_points():
            for name, fix in methods.items():
                found = fix(test.rssi[k, 0])
                if found is not None:
                    errors.setdefault(name, []).append(float(np.hypot(*(found - test.xy[k]))))
    return {name: np.array(values) for name, values in errors.items()}


def _methods(ap_xy: Array, estimated: Array, train: Samples) -> Mapping[str, _Fix]:
    """Methods of a floor: scan (m,) dBm to place; estimated (m, 2) m has NaN where there is no estimate."""
    low, high = train.xy.min(axis=0) - _MARGIN, train.xy.max(axis=0) + _MARGIN
    extent = (float(low[0]), float(low[1]), float(high[0]), float(high[1]))
    _, point = np.unique(train.point, return_inverse=True)
    xy = np.array([train.xy[point == p][0] for p in range(point.max() + 1)])
    surveyed = np.array([_mean(train.rssi[point == p, 0]) for p in range(len(xy))])
    known = np.isfinite(estimated[:, 0])

    def cosine(scan: Array) -> Array | None:
        return _centre(fingerprint_neighbours(xy, surveyed, scan[None], _CONFIG)[0])

    return {
        "sequences": lambda scan: _sequence_fix(ap_xy, scan, extent),
        "sequences, heard only": lambda scan: _sequence_fix(ap_xy, scan, extent, heard_only=True),
        "sequences, estimated places": lambda scan: _sequence_fix(estimated[known], scan[known], extent),
        "weighted centroid": lambda scan: _centroid(ap_xy, scan),
        "fingerprints": cosine,
    }


def _sequence_fix(
    ap_xy: Array, scan: Array, extent: tuple[float, float, float, float], *, heard_only: bool = False
) -> Array | None:
    heard = np.isfinite(scan)
    if heard.sum() < _LEAST:
        return None
    kept = heard if heard_only else np.ones(len(scan), np.bool_)
    return _centre(from_positions(ap_xy[kept], extent, _CONFIG.cell).neighbours(scan[kept], _CONFIG.k))


def _centroid(ap_xy: Array, scan: Array) -> Array | None:
    """Mean of the access points heard, weighted by the power of their readings."""
    heard = np.isfinite(scan)
    if heard.sum() < _LEAST:
        return None
    weight = np.power(10.0, (scan[heard] - scan[heard].max()) / 10.0)
    return np.asarray(weight @ ap_xy[heard] / weight.sum())


def _centre(near: Neighbours) -> Array:
    """Weighted k-NN: the mean of the neighbours."""
    weight = np.exp(near.log_weight - near.log_weight.max())
    return np.asarray(weight @ near.xy / weight.sum())


def _mean(rssi: Array) -> Array:
    """Mean (m,) dBm of the samples (n, m) of a point, NaN where an access point was never heard."""
    heard = np.isfinite(rssi)
    n = heard.sum(axis=0)
    return np.where(n > 0, np.where(heard, rssi, 0.0).sum(axis=0) / np.maximum(n, 1), np.nan)


def _estimated(train: Samples) -> Array:
    """Estimated places (m, 2) m of the access points of a floor from its training points, NaN where none."""
    out = np.full((train.rssi.shape[2], 2), np.nan)
    floor = np.zeros(len(train.xy), np.int32)
    found = estimate_places(Survey.from_dense(train.rssi[:, 0], train.xy, floor, ("",)))
    out[found.bssid.astype(np.int64) - 1] = found.xy  # `from_dense` numbers them from 1
    return out


def estimated_places_errors(building: Building) -> tuple[Array, Array]:
    """Errors (n,) m of estimated places from all training points, 2.4 GHz, and their standard deviations (n,) m."""
    levels, floor = np.unique(building.training.floor, return_inverse=True)
    survey = Survey.from_dense(
        building.training.rssi[:, 0], building.training.xy, floor.ravel(), tuple(map(str, levels))
    )
    found = estimate_places(survey)
    true = building.ap_xy((found.bssid.astype(np.int64) - 1).tolist())
    sigma = np.full(len(found), np.nan) if found.sigma is None else found.sigma
    return np.hypot(*(found.xy - true).T), sigma


def _fixes(buildings: tuple[Building, ...]) -> Table:
    errors = [fix_errors(building) for building in buildings]
    names = list(errors[0])
    rows: list[tuple[str | float | Interval, ...]] = [
        (building.name, str(len(of[names[0]])), *(mean_interval(of[name]) for name in names))
        for building, of in zip(buildings, errors, strict=True)
    ]
    return Table(
        "Real data: a fix from one sample on sodindoorloc (mean, m)", ("building", "points", *names), tuple(rows),
        "Published places except in the column that says otherwise; estimated ones and fingerprints are from the "
        "training points. Cells of 2 m, k = 4, cosine of RSS + 100, floor known, 2.4 GHz. Unheard access points come "
        "last, or (heard only) are left out. Intervals over points. Nothing was tuned but the estimate of places.",
    )  # fmt: skip


def _estimates(buildings: tuple[Building, ...]) -> Table:
    rows: list[tuple[str | float | Interval, ...]] = []
    for building in buildings:
        error, sigma = estimated_places_errors(building)
        median, most = (float(np.quantile(error, q)) for q in (0.5, 0.9))
        rows.append((building.name, str(len(error)), median, most, float(np.median(sigma))))
    return Table(
        "Real data: places of access points estimated from training points (m)",
        ("building", "access points", "error, median", "error, 90 %", "stated deviation per axis, median"), tuple(rows),
        "The numbers of the estimate were chosen on these buildings.",
    )  # fmt: skip


# --- walks --------------------------------------------------------------------------------------------------


def _liu(site: Site, survey: Survey, places: ApPlaces) -> Tracker[Any]:
    return liu2017_tracker.build(site, survey, places=places)


def _as_printed(site: Site, survey: Survey, places: ApPlaces) -> Tracker[Any]:
    return liu2017_tracker.build(site, survey, places=places, config=replace(_CONFIG, levelled=False))


def _wifi(site: Site, survey: Survey, places: ApPlaces) -> Tracker[Any]:
    return liu2017_tracker.build(site, survey, places=places, use_steps=False)


def walks_table(folder: Path, mapper: Mapper) -> Table:
    """The filter on the walks, against its parts alone and beside `fused`."""
    methods = {
        "sequences + steps": WalkMethod(_liu),
        "sequences + steps, from the true start": WalkMethod(_liu, from_waypoint=True),
        "sequences + steps, equal powers (as printed)": WalkMethod(_as_printed),
        "sequences alone": WalkMethod(_wifi),
        "steps alone, from the true start": WalkMethod(steps_alone, from_waypoint=True),
        "fused (fingerprints, steps, plan)": WalkMethod(fused_beside),
    }
    return walk_table(
        "Real data: walks on one floor of ipin2023-track3 (m)", folder, methods, mapper,
        "Trials 01-05 and 21-27, error at the waypoints. PLACES OF ACCESS POINTS ARE ESTIMATED from the other "
        "repetitions, and so are their powers but in the row that says otherwise. Intervals over walks.",
    )  # fmt: skip
