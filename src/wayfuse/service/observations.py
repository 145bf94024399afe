"""Raw observations of a track as a Parquet file, read from the log: a row per record, a group of entries at a time."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from wayfuse.sensors.records import BleReading, CsiFrame, Range, Record, WifiScan, bssid_text
from wayfuse.service.live import read_entry
from wayfuse.service.message import BadBodyError
from wayfuse.storage.log import Entry

__all__ = ["COLUMNS", "write_observations"]

COLUMNS = ("seq", "arrived", "t", "kind", "source", "values")
_GROUP = 200  # entries of one row group: a body has up to a megabyte


def write_observations(entries: Iterable[Entry], path: Path) -> int:
    """Write the records of entries of the log; how many.

    Columns: seq, arrived (s) of the batch; t (s, phone's clock); kind, a class of `sensors.records`; source, the access
    point, beacon or anchor, where there is one; values, those of the record in its own order and units (a reading of a
    scan: rssi, frequency, last seen; channel state: level, gain, noise, then real and imaginary parts in turn). Entries
    that this version cannot read are left out.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    types = (pa.int64(), pa.float64(), pa.float64(), pa.string(), pa.string(), pa.list_(pa.float64()))
    schema = pa.schema(list(zip(COLUMNS, types, strict=True)))
    n, waiting = 0, iter(entries)
    with pq.ParquetWriter(path, schema, compression="zstd") as writer:
        while group := list(islice(waiting, _GROUP)):
            rows = [row for entry in group for row in _rows(entry)]
            columns = list(zip(*rows, strict=True)) if rows else [()] * len(COLUMNS)
            writer.write_table(
                pa.table([pa.array(c, t) for c, t in zip(columns, types, strict=True)], schema=schema)
            )
            n += len(rows)
    return n


def _rows(entry: Entry) -> Iterator[tuple[Any, ...]]:
    try:
        message = read_entry(entry)
    except (BadBodyError, KeyError):  # of another version, or deleted
        return
    for part in message.parts:
        for record in part.records:
            kind = type(record).__name__
            for source, values in _values(record):
                yield (entry.seq, entry.arrived, record.t, kind, source, values)


def _values(record: Record) -> Iterator[tuple[str | None, list[float]]]:
    if isinstance(record, WifiScan):
        columns = (record.rssi, record.frequency, record.last_seen)
        rows = np.column_stack([c.astype(np.float64) for c in columns]).tolist()
        yield from zip(map(bssid_text, record.bssid.tolist()), rows, strict=True)
    elif isinstance(record, CsiFrame):
        flat = record.csi.ravel().astype(np.complex128).view(np.float64).tolist()
        yield bssid_text(record.anchor), [record.rss, record.agc, record.noise, *flat]
    elif isinstance(record, BleReading | Range):
        yield bssid_text(record[1]), list(map(float, record[2:]))
    else:
        yield None, list(map(float, record[1:]))  # type: ignore[arg-type]
