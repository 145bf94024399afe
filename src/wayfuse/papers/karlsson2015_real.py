"""karlsson2015 on sodindoorloc: both bands of access points whose places are published, at surveyed points.

Two buildings have access points of both bands: CETC331 (three floors, a sample per point) and SYL (one floor, 30
samples per point). The correlation of the bands (Table I) is measured on the training points; a fix per point (Table II
without a walk: the most likely place of a grid) on the testing points, with a path loss fitted to the training points.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from wayfuse.core.types import Array, BoolArray
from wayfuse.evaluation.results_folds import Mapper
from wayfuse.inertial.derivative_steps import count_steps
from wayfuse.maps.site import Site
from wayfuse.papers.ipin2023_walks import WalkMethod, fused_beside, walk_table
from wayfuse.papers.oxford_counts import step_count_table
from wayfuse.papers.reproduction import Interval, Table, mean_interval
from wayfuse.papers.sodindoorloc_buildings import Building, absent, read_buildings
from wayfuse.presets import karlsson2015_tracker
from wayfuse.presets.karlsson2015 import Config
from wayfuse.radio.ap_hearing import is_5ghz
from wayfuse.radio.ap_places import ApPlaces
from wayfuse.radio.band_correlation import SplitErrors, correlate, split_errors
from wayfuse.radio.path_loss import PathLoss, distances, fit_path_loss, log_likelihood
from wayfuse.radio.survey import Survey
from wayfuse.sensors.recording import Series
from wayfuse.tracking.tracker import Tracker

__all__ = ["band_errors", "fix_errors", "real_tables", "walks_table"]

_LEAST_POINTS = 20  # at which an access point is heard on both bands, to take part
_GRID = 1.0  # m
_MARGIN = 3.0  # m round the training points
_KEPT = {"2.4 and 5 GHz": (0, 1), "2.4 GHz": (0,), "5 GHz": (1,)}


def band_errors(building: Building) -> list[SplitErrors]:
    """Errors of both bands of each access point on its own floor, from a path loss fitted per access point and band."""
    samples, out = building.training, []
    for a, ap in enumerate(building.access_points):
        here = (samples.floor == ap.floor) & np.isfinite(samples.rssi[:, :, a]).all(axis=1)
        if len(np.unique(samples.point[here])) < _LEAST_POINTS:
            continue
        away = distances(samples.xy[here], np.array([[ap.x, ap.y]]))[:, 0]
        low, high = samples.rssi[here, :, a].T
        out.append(split_errors(away, low, high, samples.point[here]))
    return out


def fix_errors(building: Building, keep: tuple[int, ...]) -> Array:
    """Errors (n,) m of the most likely place of the first sample of each testing point, the floor known."""
    errors = []
    for floor in np.unique(building.testing.floor):
        mine = building.on(int(floor))
        ap_xy = building.ap_xy(mine)
        train, test = (s.of_floor(int(floor), mine) for s in (building.training, building.testing))
        away = distances(train.xy, ap_xy).ravel()
        bands: list[PathLoss] = [fit_path_loss(away, train.rssi[:, b].ravel()) for b in keep]
        low, high = train.xy.min(axis=0) - _MARGIN, train.xy.max(axis=0) + _MARGIN
        axes = np.meshgrid(np.arange(low[0], high[0], _GRID), np.arange(low[1], high[1], _GRID))
        grid = np.column_stack([axis.ravel() for axis in axes])
        for k in test.first_of_points():
            found = grid[np.argmax(log_likelihood(bands, ap_xy, test.rssi[k][list(keep)], grid))]
            errors.append(float(np.hypot(*(found - test.xy[k]))))
    return np.array(errors)


def real_tables(root: Path, mapper: Mapper) -> tuple[Table, ...]:
    """The tables on real data, or those that say that they were not measured where a data set is not there."""
    buildings = read_buildings(root / "sodindoorloc", both_bands=True)
    walks = walks_table(root / "ipin2023-track3" / "logs", mapper)
    counts = step_count_table(
        root,
        _counted,
        "One threshold of 8 m/s³ for all, chosen with these walks in view; the paper prints none.",
    )
    if not buildings:
        return Table("Real data: sodindoorloc", ("not measured",), ((absent(),),)), walks, counts
    return _correlations(buildings), _fixes(buildings), walks, counts


def _counted(acceleration: Series) -> int:
    return len(count_steps(acceleration))


def _correlations(buildings: tuple[Building, ...]) -> Table:
    rows: list[tuple[str | float | Interval, ...]] = []
    for building in buildings:
        errors = band_errors(building)
        across = [correlate(*e.across).r for e in errors]
        changing = [e.within for e in errors if np.all(e.within.std(axis=1) > 0.0)]
        within = mean_interval([correlate(*e).r for e in changing]) if changing else "one sample per point"
        spread = [np.sqrt(np.mean([e.across[b].var() for e in errors])) for b in (0, 1)]
        rows.append(
            (
                building.name,
                str(len(errors)),
                mean_interval(across),
                within,
                f"{spread[0]:.1f} / {spread[1]:.1f}",
            )
        )
    return Table(
        "Real data: correlation of the bands on sodindoorloc (means over access points)",
        (
            "building",
            "access points",
            "between points",
            "between samples of a point",
            "sigma, 2.4 / 5 GHz (dB)",
        ),
        tuple(rows),
        "Errors of a path loss fitted to each access point and band at known distances. Nothing here was tuned.",
    )


def _fixes(buildings: tuple[Building, ...]) -> Table:
    rows: list[tuple[str | float | Interval, ...]] = [
        (building.name, str(len(set(building.testing.point))),
         *(mean_interval(fix_errors(building, keep)) for keep in _KEPT.values()))
        for building in buildings
    ]  # fmt: skip
    return Table(
        "Real data: error of a single scan on sodindoorloc (mean, m)", ("building", "points", *_KEPT), tuple(rows),
        "The most likely place of a 1 m grid, the floor known; one path loss per floor and band, fitted to the "
        "training points. Intervals over points.",
    )  # fmt: skip


# --- walks --------------------------------------------------------------------------------------------------


def _both(site: Site, survey: Survey, places: ApPlaces) -> Tracker[Any]:
    return karlsson2015_tracker.build(site, survey, places=places)


def _as_printed(site: Site, survey: Survey, places: ApPlaces) -> Tracker[Any]:
    config = replace(Config(), offset_sigma=0.0)
    return karlsson2015_tracker.build(site, survey, places=places, config=config)


def _wifi(site: Site, survey: Survey, places: ApPlaces) -> Tracker[Any]:
    return karlsson2015_tracker.build(site, survey, places=places, use_steps=False)


def _lower_band(site: Site, survey: Survey, places: ApPlaces) -> Tracker[Any]:
    return _both(site, survey, places.select(~_upper(survey, places)))


def _upper_band(site: Site, survey: Survey, places: ApPlaces) -> Tracker[Any]:
    return _both(site, survey, places.select(_upper(survey, places)))


def _upper(survey: Survey, places: ApPlaces) -> BoolArray:
    """Which of the places (n,) are of access points of 5 GHz."""
    return is_5ghz(survey.frequency[survey.columns(places.bssid)])


def walks_table(folder: Path, mapper: Mapper) -> Table:
    """The filter on walks of a museum whose access points have estimated places, beside `fused`."""
    methods = {
        "Wi-Fi + steps, start unknown": WalkMethod(_both),
        "Wi-Fi + steps, from the true place": WalkMethod(_both, from_waypoint=True),
        "Wi-Fi + steps, levels of the phone known (as printed)": WalkMethod(_as_printed),
        "Wi-Fi + steps, 2.4 GHz alone": WalkMethod(_lower_band),
        "Wi-Fi + steps, 5 GHz alone": WalkMethod(_upper_band),
        "Wi-Fi alone": WalkMethod(_wifi),
        "fused (fingerprints, steps, plan)": WalkMethod(fused_beside),
    }
    return walk_table(
        "Real data: walks on one floor of ipin2023-track3 (m)", folder, methods, mapper,
        "Trials 01-05 and 21-27, error at the waypoints. PLACES AND POWERS OF ACCESS POINTS ARE ESTIMATED from the "
        "other repetitions, alpha and sigma fitted to them. The heading at the start is unknown throughout. "
        "Intervals over walks.",
    )  # fmt: skip
