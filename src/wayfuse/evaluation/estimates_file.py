"""The file of estimates, EST.csv: what `wayfuse track` writes and `wayfuse evaluate` reads.

The header begins ``walk,t_ms,x,y,floor,lat,lon``; any further columns follow by name and are optional when
reading, so that other programs can write the file too. One row is one estimate; ``t_ms`` (ms in the
recording's own clock) is the time the position is *for*. A file of a lagged (``--lag L``) track may use
records up to ``t_ms + L``; its rows are still labelled with the time they refer to, so the same scorer serves
both. Rows of one walk ascend in time. The sidecar ``EST.csv.json`` says how the file was made.

This is a machine's file: a damaged line is an error of use that names file and line, not bad data.
"""

from __future__ import annotations

import csv
import json
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, TextIO

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.errors import FormatError, UsageError
from wayfuse.core.frames import GeoAnchor
from wayfuse.core.types import Array
from wayfuse.tracking.estimate import Estimate

__all__ = [
    "COLUMNS",
    "REQUIRED",
    "EstimatesFile",
    "EstimatesWriter",
    "Sidecar",
    "WalkEstimates",
    "from_track",
    "is_estimates_file",
    "open_writer",
    "read_estimates",
    "read_sidecar",
    "sidecar_path",
    "write_estimates",
    "write_sidecar",
]

REQUIRED = ("walk", "t_ms", "x", "y", "floor", "lat", "lon")
_SURE = ("var_x", "var_y", "cov_xy", "r68", "r95")
_WHY = ("n_steps", "n_aps", "share_blocked", "ess", "survey_distance")
COLUMNS = (*REQUIRED, "method", *_SURE, "state", *_WHY)
_TEXTS = ("walk", "floor", "method", "state")
# Decimals written: 1 mm, 1 mm on the ground, 1 cm for what is only an uncertainty.
_DECIMALS = {
    "x": 3, "y": 3, "lat": 8, "lon": 8, "var_x": 4, "var_y": 4, "cov_xy": 4, "r68": 2, "r95": 2,
    "n_steps": 0, "n_aps": 0, "share_blocked": 3, "ess": 3, "survey_distance": 2,
}  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class WalkEstimates:
    """The estimates of one method on one walk.

    t : (n,) s in the recording's clock, ascending. xy : (n, 2) m, building frame. floor : (n,) names.
    lonlat : (n, 2) degrees, NaN where not georeferenced. ``numbers`` maps the optional columns (``r68``, m,
    ..., see `COLUMNS`) to (n,) arrays with NaN where empty. state : (n,) names, empty where unknown.
    """

    walk: str
    method: str
    t: Array
    xy: Array
    floor: NDArray[np.str_]
    lonlat: Array
    numbers: Mapping[str, Array] = field(default_factory=dict)
    state: NDArray[np.str_] | None = None

    def __len__(self) -> int:
        return len(self.t)

    def number(self, name: str) -> Array:
        """(n,) values of an optional column, NaN where the file has none."""
        column = self.numbers.get(name)
        return np.full(len(self.t), np.nan) if column is None else column

    def states(self) -> NDArray[np.str_]:
        """(n,) names of the state, empty where the file has none."""
        return np.full(len(self.t), "", dtype="<U1") if self.state is None else self.state


@dataclass(frozen=True, slots=True)
class Sidecar:
    """How a file of estimates was made: folders as given, seed, lag (s), parameters, version of wayfuse."""

    site: str = ""
    radio_map: str = ""
    seed: int | None = None
    lag: float = 0.0
    parameters: Mapping[str, Any] = field(default_factory=dict)
    version: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class EstimatesFile:
    """A file as read: its tracks in the order of their first row, its sidecar, and remarks on what was
    odd."""

    path: str
    tracks: tuple[WalkEstimates, ...]
    sidecar: Sidecar | None = None
    notes: tuple[str, ...] = ()


def from_track(
    walk: str,
    method: str,
    estimates: Sequence[Estimate],
    floors: Sequence[str],
    anchors: Sequence[GeoAnchor | None] = (),
    survey_distance: Array | None = None,
) -> WalkEstimates:
    """Rows of a tracker's estimates; ``floors`` names the floor indices, ``anchors`` (one per floor) fill lat and
    lon.

    Of estimates at the same time the last one is kept: it is what the tracker knew then.
    """
    last = {e.t: i for i, e in enumerate(estimates)}
    rows = list(last.values())
    kept = [estimates[i] for i in rows]
    xy = np.array([(e.x, e.y) for e in kept], dtype=np.float64).reshape(-1, 2)
    fields = {"var_x": "cov_xx", "var_y": "cov_yy"}
    arrays = {
        name: np.array([getattr(e, fields.get(name, name)) for e in kept], dtype=np.float64)
        for name in (*_SURE, *_WHY[:-1])
    }
    if survey_distance is not None:
        arrays["survey_distance"] = np.asarray(survey_distance, dtype=np.float64)[rows]
    return WalkEstimates(
        walk=walk,
        method=method,
        t=np.array([e.t for e in kept], dtype=np.float64),
        xy=xy,
        floor=np.array([floors[e.floor] for e in kept], dtype=np.str_),
        lonlat=_lonlat(xy, [e.floor for e in kept], anchors),
        numbers=arrays,
        state=np.array([e.state.value for e in kept], dtype=np.str_),
    )


def _lonlat(xy: Array, floor: list[int], anchors: Sequence[GeoAnchor | None]) -> Array:
    out = np.full_like(xy, np.nan)
    index = np.asarray(floor, dtype=np.int64)
    for f, anchor in enumerate(anchors):
        if anchor is not None:
            out[index == f] = anchor.to_lonlat(xy[index == f])
    return out


# --- writing ------------------------------------------------------------------------------------------------


class EstimatesWriter:
    """Writes tracks to an open text stream, row by row, header first."""

    def __init__(self, stream: TextIO) -> None:
        self._rows = csv.writer(stream, lineterminator="\n")
        self._rows.writerow(COLUMNS)

    def add(self, track: WalkEstimates) -> int:
        """Write the rows of a track; returns how many.

        Raises
        ------
        UsageError
            if times do not ascend or a position is not finite: such a file could not be read again.
        """
        where = f"walk {track.walk!r}, method {track.method!r}"
        if len(track) and not np.all(np.diff(track.t) > 0):
            raise UsageError("the times of estimates must ascend", where=where)
        if not np.all(np.isfinite(track.xy)):
            raise UsageError("an estimate has no finite position", where=where)
        columns = [
            [track.walk] * len(track),
            [_milliseconds(t) for t in track.t.tolist()],
            _texts(track.xy[:, 0], "x"),
            _texts(track.xy[:, 1], "y"),
            track.floor.tolist(),
            _texts(track.lonlat[:, 1], "lat"),
            _texts(track.lonlat[:, 0], "lon"),
            [track.method] * len(track),
        ]
        columns += [
            track.states().tolist() if name == "state" else _texts(track.number(name), name)
            for name in COLUMNS[len(columns) :]
        ]
        self._rows.writerows(zip(*columns, strict=True))
        return len(track)


def _milliseconds(t: float) -> str:
    text = f"{t * 1000.0:.3f}"
    return text.rstrip("0").rstrip(".")


def _texts(values: Array, name: str) -> list[str]:
    decimals = _DECIMALS[name]
    return [f"{v:.{decimals}f}" if v - v == 0.0 else "" for v in values.tolist()]


@contextmanager
def open_writer(path: str | Path, sidecar: Sidecar | None = None) -> Iterator[EstimatesWriter]:
    """Write EST.csv (and its sidecar) so that the file appears whole or not at all."""
    target = Path(path)
    if not target.parent.is_dir():
        raise UsageError(f"there is no folder {target.parent}", where=target, remedy="create it first")
    draft = target.with_name(f".{target.name}.{os.getpid()}.part")
    try:
        with draft.open("w", newline="", encoding="utf-8") as stream:
            yield EstimatesWriter(stream)
        draft.replace(target)
    finally:
        draft.unlink(missing_ok=True)
    if sidecar is None:
        sidecar_path(target).unlink(missing_ok=True)  # that of a file overwritten would tell tales
    else:
        write_sidecar(target, sidecar)


def write_estimates(path: str | Path, tracks: Iterable[WalkEstimates], sidecar: Sidecar | None = None) -> int:
    """Write all tracks to EST.csv, with the sidecar beside it; returns the number of rows."""
    with open_writer(path, sidecar) as writer:
        return sum(writer.add(track) for track in tracks)


def sidecar_path(path: str | Path) -> Path:
    """Where the sidecar of a file of estimates lies: ``EST.csv.json``."""
    return Path(f"{path}.json")


def write_sidecar(path: str | Path, sidecar: Sidecar) -> None:
    """Write the sidecar of the file of estimates ``path``."""
    text = json.dumps(asdict(sidecar), indent=1, allow_nan=False, default=str)
    sidecar_path(path).write_text(text + "\n", encoding="utf-8")


def read_sidecar(path: str | Path) -> Sidecar | None:
    """Sidecar of the file of estimates ``path``, None where there is none; unknown keys are passed over."""
    place = sidecar_path(path)
    if not place.is_file():
        return None
    remedy = "delete it, or run track again"
    try:
        data = json.loads(place.read_text(encoding="utf-8"))
        return Sidecar(
            site=str(data.get("site") or ""),
            radio_map=str(data.get("radio_map") or ""),
            seed=None if data.get("seed") is None else int(data["seed"]),
            lag=float(data.get("lag") or 0.0),
            parameters=dict(data.get("parameters") or {}),
            version=str(data.get("version") or ""),
        )
    except (ValueError, TypeError, AttributeError) as error:
        raise FormatError(f"the sidecar is damaged: {error}", where=place, remedy=remedy) from None


# --- reading ------------------------------------------------------------------------------------------------


def is_estimates_file(path: str | Path) -> bool:
    """Whether a file's first line begins ``walk,t_ms`` (the mark of EST.csv)."""
    place = Path(path)
    if place.suffix.lower() != ".csv" or not place.is_file():
        return False
    with place.open("rb") as stream:
        head = stream.read(64).removeprefix(b"\xef\xbb\xbf")
    return head.replace(b'"', b"").replace(b" ", b"").startswith(b"walk,t_ms")


def read_estimates(path: str | Path) -> EstimatesFile:
    """Read a file of estimates; columns behind the first seven are optional, unknown ones are passed over.

    A file without a column ``method`` is of one method, named by the file's stem.

    Raises
    ------
    FormatError
        naming file and line: a wrong header, a missing field, no number, a position that is not finite, an
        empty walk or floor, a time that does not ascend within its walk, two different estimates for one
        time.
    """
    place = Path(path)
    try:
        with place.open(newline="", encoding="utf-8-sig") as stream:
            header, groups = _group(place, csv.reader(stream))
    except FileNotFoundError:
        raise UsageError(
            "there is no such file", where=place, remedy="give a file written by track"
        ) from None
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise FormatError(f"this is no text file of estimates: {error}", where=place) from None
    repeats = [0]
    tracks = tuple(_track(place, header, walk, method, g, repeats) for (walk, method), g in groups.items())
    notes = (f"{place}: {repeats[0]} rows repeat the row before them",) if repeats[0] else ()
    return EstimatesFile(str(place), tracks, read_sidecar(place), notes)


_Rows = tuple[list[int], list[list[str]]]  # line numbers, fields


def _group(place: Path, reader: Any) -> tuple[list[str], dict[tuple[str, str], _Rows]]:
    """Header, and the rows of each (walk, method) with their line numbers."""
    header = [name.strip() for name in next(reader, [])]
    if tuple(header[: len(REQUIRED)]) != REQUIRED:
        remedy = f"the first line must begin {','.join(REQUIRED)}"
        raise FormatError(f"the header begins {','.join(header[:7])!r}", where=f"{place}:1", remedy=remedy)
    if len(set(header)) != len(header):
        raise FormatError("a column occurs twice in the header", where=f"{place}:1")
    method_at = header.index("method") if "method" in header else -1
    groups: dict[tuple[str, str], _Rows] = {}
    for cells in reader:
        if not cells:
            continue
        line = reader.line_num
        if len(cells) != len(header):
            raise _damaged(place, line, f"{len(cells)} fields of {len(header)}")
        method = cells[method_at].strip() if method_at >= 0 else ""
        key = cells[0].strip(), method or place.stem
        if not key[0] or not cells[4].strip():
            raise _damaged(place, line, f"the {'floor' if key[0] else 'walk'} is empty")
        lines, rows = groups.setdefault(key, ([], []))
        lines.append(line)
        rows.append(cells)
    return header, groups


def _damaged(place: Path, line: int, what: str) -> FormatError:
    return FormatError(what, where=f"{place}:{line}", remedy="mend or delete the line, or run track again")


def _track(
    place: Path, header: list[str], walk: str, method: str, rows: _Rows, repeats: list[int]
) -> WalkEstimates:
    """Columns of one track; rows that repeat the row before them are dropped and counted in ``repeats``."""
    lines, cells = _without_repeats(place, *rows)
    repeats[0] += len(rows[0]) - len(lines)
    columns = dict(zip(header, map(list, zip(*cells, strict=True)), strict=True))
    wanted = [name for name in COLUMNS if name in columns and name not in _TEXTS]
    numbers = {name: _numbers(place, lines, name, columns[name]) for name in wanted}
    for name in ("t_ms", "x", "y"):
        _check(place, lines, np.isfinite(numbers[name]), f"{name} is not a finite number")
    for name in ("r68", "r95"):
        if name in numbers:
            _check(place, lines, ~(numbers[name] < 0), f"{name} is negative")
    t_ms = numbers["t_ms"]
    _check(place, lines[1:], np.diff(t_ms) > 0, f"t_ms does not ascend within walk {walk!r}")
    pair = [np.stack([numbers.pop(a), numbers.pop(b)], axis=1) for a, b in (("x", "y"), ("lon", "lat"))]
    del numbers["t_ms"]
    state = np.array([s.strip() for s in columns["state"]], dtype=np.str_) if "state" in columns else None
    floor = np.array([f.strip() for f in columns["floor"]], dtype=np.str_)
    return WalkEstimates(walk, method, t_ms / 1000.0, pair[0], floor, pair[1], numbers, state)


def _without_repeats(place: Path, lines: list[int], rows: list[list[str]]) -> _Rows:
    """Drop rows equal to the row before; refuse two different estimates for one time."""
    keep = [0]
    for i in range(1, len(rows)):
        if rows[i] == rows[keep[-1]]:
            continue
        if rows[i][1] == rows[keep[-1]][1]:
            raise _damaged(place, lines[i], f"a second, different estimate for t_ms = {rows[i][1]}")
        keep.append(i)
    return [lines[i] for i in keep], [rows[i] for i in keep]


def _numbers(place: Path, lines: list[int], name: str, cells: list[str]) -> Array:
    """A column as numbers, NaN where empty."""
    try:
        return np.array([float(c) if c else np.nan for c in cells], dtype=np.float64)
    except ValueError:
        for line, cell in zip(lines, cells, strict=True):
            try:
                float(cell or "nan")
            except ValueError:
                raise _damaged(place, line, f"{name} = {cell!r} is no number") from None
        raise


def _check(place: Path, lines: list[int], good: NDArray[np.bool_], what: str) -> None:
    if not np.all(good):
        raise _damaged(place, lines[int(np.argmin(good))], what)
