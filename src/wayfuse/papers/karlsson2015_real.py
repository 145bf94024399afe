"""karlsson2015 on sodindoorloc: both bands of access points whose places are published, at surveyed points.

Two buildings have access points of both bands: CETC331 (three floors, a sample per point) and SYL (one floor, 30
samples per point). The correlation of the bands (Table I) is measured on the training points; a fix per point (Table II
without a walk: the most likely place of a grid) on the testing points, with a path loss fitted to the training points.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from wayfuse.core.types import Array, IntArray
from wayfuse.formats.sodindoorloc import read
from wayfuse.formats.sodindoorloc_places import WORKBOOK, PlacedAccessPoint, read_places
from wayfuse.papers.reproduction import Interval, Table, mean_interval
from wayfuse.radio.band_correlation import SplitErrors, correlate, split_errors
from wayfuse.radio.path_loss import PathLoss, distances, fit_path_loss, log_likelihood

__all__ = ["Building", "band_errors", "fix_errors", "read_buildings", "real_tables"]

_SHEETS = {"CETC331": ("Training_CETC331.csv", "Testing_CETC331.csv"),
           "SYL": ("Training_SYL_AP_30.csv", "Testing_SYL_AP.csv")}  # fmt: skip
_LEAST_POINTS = 20  # at which an access point is heard on both bands, to take part
_GRID = 1.0  # m
_MARGIN = 3.0  # m round the training points
_KEPT = {"2.4 and 5 GHz": (0, 1), "2.4 GHz": (0,), "5 GHz": (1,)}


class Samples(NamedTuple):
    """Means of the samples of a point, or the samples: xy (n, 2) m, floor (n,), point (n,), rssi (n, 2, m) dBm."""

    xy: Array
    floor: IntArray
    point: IntArray
    rssi: Array


class Building(NamedTuple):
    """Access points of both bands and the samples of both tables."""

    name: str
    access_points: tuple[PlacedAccessPoint, ...]
    training: Samples
    testing: Samples


def read_buildings(root: Path) -> tuple[Building, ...]:
    """The buildings with access points of both bands; none where the data set is not there."""
    if not (root / WORKBOOK).is_file():
        return ()
    out = []
    for name, sheets in _SHEETS.items():
        placed = tuple(ap for ap in read_places(root / WORKBOOK, name) if ap.column_5)
        training, testing = (_samples(root / name / sheet, placed) for sheet in sheets)
        out.append(Building(name, placed, training, testing))
    return tuple(out)


def _samples(path: Path, placed: tuple[PlacedAccessPoint, ...]) -> Samples:
    table = read(path)
    column = {int(number): k for k, number in enumerate(table.bssid)}
    silent = np.full(len(table.xy), np.nan)
    rssi = np.array([
        [table.rssi[:, column[n]] if n in column else silent for n in (ap.column_24, ap.column_5)] for ap in placed
    ])  # (m, 2, n)  # fmt: skip
    _, point = np.unique(np.column_stack([table.xy, table.floor]), axis=0, return_inverse=True)
    return Samples(table.xy, table.floor, point.ravel(), rssi.transpose(2, 1, 0).astype(np.float64))


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
        mine = [a for a, ap in enumerate(building.access_points) if ap.floor == floor]
        ap_xy = np.array([[building.access_points[a].x, building.access_points[a].y] for a in mine])
        train, test = (_of_floor(s, int(floor), mine) for s in (building.training, building.testing))
        away = distances(train.xy, ap_xy).ravel()
        bands: list[PathLoss] = [fit_path_loss(away, train.rssi[:, b].ravel()) for b in keep]
        low, high = train.xy.min(axis=0) - _MARGIN, train.xy.max(axis=0) + _MARGIN
        axes = np.meshgrid(np.arange(low[0], high[0], _GRID), np.arange(low[1], high[1], _GRID))
        grid = np.column_stack([axis.ravel() for axis in axes])
        _, first = np.unique(test.point, return_index=True)
        for k in first:
            found = grid[np.argmax(log_likelihood(bands, ap_xy, test.rssi[k][list(keep)], grid))]
            errors.append(float(np.hypot(*(found - test.xy[k]))))
    return np.array(errors)


def _of_floor(samples: Samples, floor: int, access_points: list[int]) -> Samples:
    here = samples.floor == floor
    rssi = samples.rssi[here][:, :, access_points]
    return Samples(samples.xy[here], samples.floor[here], samples.point[here], rssi)


def real_tables(root: Path) -> tuple[Table, ...]:
    """The tables on real data, or one that says that they were not measured where the data set is not there."""
    buildings = read_buildings(root)
    if not buildings:
        why = "`wayfuse datasets fetch sodindoorloc` gets the data set"
        return (Table("Real data: sodindoorloc", ("not measured",), ((why,),)),)
    return _correlations(buildings), _fixes(buildings)


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
