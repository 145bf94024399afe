"""Where access points hang: known from a plan, or estimated from a survey (`radio.ap_estimation`).

Read and written as a CSV with the header ``bssid,x,y,floor,height``: places in metres of the frame of the floor, floors
by name, height above that floor empty where nobody measured it. Estimated places carry a further column, ``sigma``,
the standard deviation of the place in metres; a file that has it holds estimates, and methods say so. A column
``power`` has the level at 1 m in dBm, where known. This file is made by hand or by a command, so a damaged line is an
error of use that names file and line, not bad data.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from string import hexdigits
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.errors import ConfigError, DataMissingError, FormatError, UsageError
from wayfuse.core.types import Array, IdArray
from wayfuse.sensors.records import bssid_id, bssid_text

__all__ = ["ApPlaces", "read_ap_places", "write_ap_places"]

_HEADER = ("bssid", "x", "y", "floor", "height")
_SIGMA, _POWER = "sigma", "power"
_HASHED = 1 << 63  # marks a digest, as `bssid_text` takes it off
_DIGEST_DIGITS = 16
_FARTHEST = 1e5  # m; no building frame reaches so far
_Row: TypeAlias = tuple[
    int, float, float, int, float, float, float
]  # bssid, x, y, floor, height, sigma, power
_REMEDY = "give bssid,x,y,floor,height: metres of the floor's frame, the floor's name, height may be empty"


@dataclass(frozen=True, slots=True, eq=False)
class ApPlaces:
    """Places of n access points.

    bssid : (n,) identifiers, each once. x, y : (n,) m, frame of the floor. floor : (n,) index into the site's floors.
    height : (n,) m above that floor, NaN where unknown. is_estimated : estimated from readings, not measured.
    sigma : (n,) m, standard deviation of an estimated place, NaN where unknown; None for measured places.
    power : (n,) dBm at 1 m, NaN where unknown; None where nobody knows any.
    """

    bssid: IdArray
    x: Array
    y: Array
    floor: NDArray[np.int32]
    height: Array
    is_estimated: bool = False
    sigma: Array | None = None
    power: Array | None = None

    def __post_init__(self) -> None:
        known = [column for column in (self.sigma, self.power) if column is not None]
        columns: list[NDArray[Any]] = [self.x, self.y, self.floor, self.height, *known]
        if self.bssid.ndim != 1 or any(column.shape != self.bssid.shape for column in columns):
            raise ConfigError("columns of different lengths", where="ApPlaces")
        if len(np.unique(self.bssid)) != len(self.bssid):
            raise ConfigError("an access point has two places", where="ApPlaces", remedy="keep one of them")
        if not np.all(np.isfinite(self.x) & np.isfinite(self.y) & (self.floor >= 0)):
            raise ConfigError("an access point without a place", where="ApPlaces", remedy="leave it out")

    def __len__(self) -> int:
        return len(self.bssid)

    @property
    def xy(self) -> Array:
        """(n, 2) m, frame of the floor of each."""
        return np.column_stack([self.x, self.y])

    def rows(self, bssid: IdArray) -> NDArray[np.int64]:
        """Row of each identifier (k,), -1 where its place is not known."""
        if not len(self.bssid):
            return np.full(len(bssid), -1, np.int64)
        order = np.argsort(self.bssid)
        ascending = self.bssid[order]
        at = np.minimum(np.searchsorted(ascending, bssid), len(order) - 1)
        return np.where(ascending[at] == bssid, order[at], -1)

    def select(self, rows: NDArray[np.integer] | NDArray[np.bool_]) -> ApPlaces:
        """Some of them."""
        return ApPlaces(
            self.bssid[rows],
            self.x[rows],
            self.y[rows],
            self.floor[rows],
            self.height[rows],
            self.is_estimated,
            None if self.sigma is None else self.sigma[rows],
            None if self.power is None else self.power[rows],
        )


def read_ap_places(path: str | PathLike[str], floor_names: Sequence[str]) -> ApPlaces:
    """Read a CSV of places; columns in any order, ``height``, ``sigma`` and ``power`` may be missing.

    Raises
    ------
    DataMissingError : the file cannot be read. FormatError : a line is damaged, names a floor that the site does not
    have, or an access point for the second time.
    """
    path = Path(path)
    try:
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise DataMissingError(f"cannot be read: {error.strerror}", where=path, remedy=_REMEDY) from error
    except UnicodeDecodeError as error:
        raise FormatError("is not text in UTF-8", where=path, remedy=_REMEDY) from error
    lines = _lines(path, text)
    _, first_line = next(lines, (1, []))
    header = [name.strip().lower() for name in first_line]
    if not set(_HEADER[:4]) <= set(header):
        raise FormatError("the header lacks a column", where=f"{path}:1", remedy=_REMEDY)
    floors = {name: index for index, name in enumerate(floor_names)}
    seen: dict[int, int] = {}
    rows: list[_Row] = []
    for number, fields in lines:
        where = f"{path}:{number}"
        if not any(field.strip() for field in fields):
            continue
        if len(fields) != len(header):
            what = f"{len(fields)} fields, the header has {len(header)}"
            raise FormatError(what, where=where, remedy=_REMEDY)
        row = _row(dict(zip(header, (field.strip() for field in fields), strict=True)), floors, where)
        first = seen.setdefault(row[0], number)
        if first != number:
            raise FormatError(
                f"bssid {bssid_text(row[0])} is in line {first} already", where=where, remedy="keep one"
            )
        rows.append(row)
    return _places(rows, is_estimated=_SIGMA in header, has_power=_POWER in header)


def _lines(path: Path, text: str) -> Iterator[tuple[int, list[str]]]:
    """Numbers of lines and their fields."""
    lines = csv.reader(text.splitlines())
    try:
        for fields in lines:
            yield lines.line_num, fields
    except csv.Error as error:
        raise FormatError(f"{error}", where=f"{path}:{lines.line_num}", remedy=_REMEDY) from error


def _row(fields: Mapping[str, str], floors: Mapping[str, int], where: str) -> _Row:
    if not fields["bssid"]:
        raise FormatError("bssid is empty", where=where, remedy=_REMEDY)
    if fields["floor"] not in floors:
        raise FormatError(
            f"floor {fields['floor']!r} is none of the site's",
            where=where,
            remedy=f"one of {', '.join(floors)}",
        )
    x, y, height, sigma, power = (
        _number(fields, name, where) for name in ("x", "y", "height", _SIGMA, _POWER)
    )
    if sigma < 0.0:
        raise FormatError(f"sigma {sigma} is negative", where=where, remedy="a standard deviation in metres")
    return _identifier(fields["bssid"]), x, y, floors[fields["floor"]], height, sigma, power


def _identifier(text: str) -> int:
    """The inverse of `bssid_text`: digests are written as # and hexadecimal digits."""
    digits = text.removeprefix("#")
    is_digest = len(digits) == len(text) - 1 == _DIGEST_DIGITS and set(digits) <= set(hexdigits)
    return _HASHED | int(digits, 16) if is_digest else bssid_id(text)


def _number(fields: Mapping[str, str], name: str, where: str) -> float:
    text = fields.get(name, "")
    if not text and name not in ("x", "y"):
        return math.nan
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not abs(value) <= _FARTHEST:
        raise FormatError(f"{name} {text!r} is no such number", where=where, remedy=_REMEDY)
    return value


def _places(rows: Sequence[_Row], *, is_estimated: bool, has_power: bool) -> ApPlaces:
    numbers = np.array([row[1:] for row in rows], dtype=np.float64).reshape(-1, 6)
    x, y, floor, height, sigma, power = numbers.T
    bssid = np.array([row[0] for row in rows], np.uint64)
    return ApPlaces(
        bssid, x, y, floor.astype(np.int32), height, is_estimated,
        sigma if is_estimated else None, power if has_power else None,
    )  # fmt: skip


def write_ap_places(path: str | PathLike[str], places: ApPlaces, floor_names: Sequence[str]) -> None:
    """Write places so that `read_ap_places` reads the same to the centimetre.

    Raises
    ------
    UsageError : the folder is not there, or the site has fewer floors than the places name.
    """
    target = Path(path)
    if not target.parent.is_dir():
        raise UsageError(f"there is no folder {target.parent}", where=target, remedy="create it first")
    if len(places) and int(places.floor.max()) >= len(floor_names):
        raise UsageError(
            f"floor {int(places.floor.max())} of {len(floor_names)}",
            where=target,
            remedy="places of another site",
        )
    with target.open("w", newline="", encoding="utf-8") as stream:
        out = csv.writer(stream, lineterminator="\n")
        further = _further(places)
        out.writerow((*_HEADER, *further))
        for row in range(len(places)):
            numbers = (places.x, places.y, places.height, *further.values())
            x, y, height, *rest = (_text(column[row]) for column in numbers)
            out.writerow(
                (bssid_text(int(places.bssid[row])), x, y, floor_names[int(places.floor[row])], height, *rest)
            )


def _further(places: ApPlaces) -> dict[str, Array]:
    """The columns that not every file has."""
    sigma = np.full(len(places), np.nan) if places.sigma is None else places.sigma
    out = {_SIGMA: sigma} if places.is_estimated else {}
    return out if places.power is None else {**out, _POWER: places.power}


def _text(value: float) -> str:
    return f"{value:.2f}" if math.isfinite(value) else ""
