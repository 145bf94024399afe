"""The buildings of sodindoorloc with the published places of their access points, as experiments on papers use them."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from wayfuse.core.types import Array, IntArray
from wayfuse.formats.sodindoorloc import read
from wayfuse.formats.sodindoorloc_places import WORKBOOK, PlacedAccessPoint, read_places

__all__ = ["Building", "Samples", "absent", "read_buildings"]

_SHEETS = {"CETC331": ("Training_CETC331.csv", "Testing_CETC331.csv"),
           "HCXY": ("Training_HCXY_AP_30.csv", "Testing_HCXY_AP.csv"),
           "SYL": ("Training_SYL_AP_30.csv", "Testing_SYL_AP.csv")}  # fmt: skip


class Samples(NamedTuple):
    """Samples of surveyed points: xy (n, 2) m, floor (n,), point (n,), rssi (n, 2, m) dBm, 2.4 and 5 GHz."""

    xy: Array
    floor: IntArray
    point: IntArray
    rssi: Array

    def of_floor(self, floor: int, access_points: list[int]) -> Samples:
        """Those of a floor, of some access points."""
        here = self.floor == floor
        return Samples(
            self.xy[here], self.floor[here], self.point[here], self.rssi[here][:, :, access_points]
        )

    def first_of_points(self) -> IntArray:
        """Row of the first sample of each point."""
        return np.unique(self.point, return_index=True)[1]


class Building(NamedTuple):
    """Access points of published places and the samples of both tables."""

    name: str
    access_points: tuple[PlacedAccessPoint, ...]
    training: Samples
    testing: Samples

    def on(self, floor: int) -> list[int]:
        """The access points of a floor."""
        return [a for a, ap in enumerate(self.access_points) if ap.floor == floor]

    def ap_xy(self, access_points: list[int]) -> Array:
        """Their published places (m, 2) m."""
        placed = [self.access_points[a] for a in access_points]
        return np.array([(ap.x, ap.y) for ap in placed]).reshape(-1, 2)


def read_buildings(root: Path, *, both_bands: bool = False) -> tuple[Building, ...]:
    """All three buildings, or the access points of both bands of the two that have any; none without the data set."""
    if not (root / WORKBOOK).is_file():
        return ()
    out = []
    for name, sheets in _SHEETS.items():
        placed = tuple(ap for ap in read_places(root / WORKBOOK, name) if ap.column_5 or not both_bands)
        if placed:
            training, testing = (_samples(root / name / sheet, placed) for sheet in sheets)
            out.append(Building(name, placed, training, testing))
    return tuple(out)


def absent() -> str:
    """What a table says where the data set is not there."""
    return "`wayfuse datasets fetch sodindoorloc` gets the data set"


def _samples(path: Path, placed: tuple[PlacedAccessPoint, ...]) -> Samples:
    table = read(path)
    column = {int(number): k for k, number in enumerate(table.bssid)}
    silent = np.full(len(table.xy), np.nan)
    rssi = np.array([
        [table.rssi[:, column[n]] if n in column else silent for n in (ap.column_24, ap.column_5)] for ap in placed
    ])  # (m, 2, n)  # fmt: skip
    _, point = np.unique(np.column_stack([table.xy, table.floor]), axis=0, return_inverse=True)
    return Samples(table.xy, table.floor, point.ravel(), rssi.transpose(2, 1, 0).astype(np.float64))
