"""Raw observations as Parquet: every record of a track, with its values to the bit."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq

from wayfuse.sensors.records import Acceleration, BleReading, CsiFrame, Range, Step, WifiScan, bssid_text
from wayfuse.service.observations import COLUMNS, write_observations
from wayfuse.service.replay import envelopes
from wayfuse.service.wire import encode
from wayfuse.storage.log import Entry


def _entry(seq: int, body: bytes, adapter: str = "own") -> Entry:
    profile = '{"platform":"","standardised":false,"map":1}'
    return Entry(seq, 100.0 + seq, "s", adapter, "d", "t", profile, body)


def test_a_walk_comes_back_from_the_file(world: Any, tmp_path: Path) -> None:
    walk = world.walks[0]
    entries = [_entry(n, encode(e)) for n, e in enumerate(envelopes(walk, "p", "w", 0.1), 1)]
    assert len(entries) > 200  # more than one group
    n = write_observations(
        [*entries, _entry(10_000, b"", "deleted"), _entry(10_001, b"{")], tmp_path / "a.parquet"
    )
    table = pq.read_table(tmp_path / "a.parquet")
    assert tuple(table.column_names) == COLUMNS
    rows = table.to_pylist()
    assert len(rows) == n
    assert [r["seq"] for r in rows] == sorted(r["seq"] for r in rows)
    assert all(r["arrived"] == 100.0 + r["seq"] for r in rows)
    told = [(r["t"], *r["values"]) for r in rows if r["kind"] == "Acceleration"]
    np.testing.assert_array_equal(told, np.column_stack([walk.acceleration.t, walk.acceleration.values]))
    heard = [(r["t"], r["source"], r["values"][0]) for r in rows if r["kind"] == "WifiScan"]
    assert heard == [
        (s.t, bssid_text(i), level)
        for s in walk.wifi
        for i, level in zip(s.bssid.tolist(), s.rssi.tolist(), strict=True)
    ]


def test_an_empty_track_is_an_empty_file(tmp_path: Path) -> None:
    assert write_observations([], tmp_path / "a.parquet") == 0
    assert pq.read_table(tmp_path / "a.parquet").num_rows == 0


def test_other_kinds_of_records(tmp_path: Path) -> None:
    body = encode({"v": 1, "device": "d", "steps": [[1.0, 0.5, 0.7]], "ble": [[2.0, "b", -60.0, None]],
                   "ranges": [[3.0, "an", 4.5, None, None]]})  # fmt: skip
    frames = [{"target": "t", "csi": {"iq": [[[1, 2], [3, 4]]], "agc": 30}}]
    anchors = encode({"v": 1, "anchor": "an", "t": 4 * 10**9, "frames": frames})
    write_observations([_entry(1, body), _entry(2, anchors, "anchors")], tmp_path / "a.parquet")
    rows = {r["kind"]: r for r in pq.read_table(tmp_path / "a.parquet").to_pylist()}
    assert rows.keys() == {k.__name__ for k in (Step, BleReading, Range, CsiFrame)}
    assert rows[Step.__name__]["values"] == [0.7, 0.5]
    assert rows[Range.__name__]["values"][0] == 4.5
    assert rows[CsiFrame.__name__]["values"][1:2] + rows[CsiFrame.__name__]["values"][3:] == [
        30.0,
        1.0,
        2.0,
        3.0,
        4.0,
    ]
    assert {Acceleration.__name__, WifiScan.__name__}.isdisjoint(rows)


def test_only_an_administrator_may_have_them(app: Any, world: Any, tmp_path: Path) -> None:
    body = encode(next(envelopes(world.walks[0], "p", "w", 3.0)))
    track = app.post("/api/v1/in/own", body).json()["accepted"][0]["track"]
    app.settle()
    path = f"/api/v1/tracks/{track}/observations"
    for scope in ("read", "survey", "ingest"):
        assert app.get(path, scope).status_code == 403
    answer = app.get(path, "admin")
    assert answer.headers["content-type"] == "application/vnd.apache.parquet"
    (tmp_path / "a.parquet").write_bytes(answer.content)
    assert pq.read_table(tmp_path / "a.parquet").num_rows > 100
    assert app.get("/api/v1/tracks/0000000000000000/observations", "admin").status_code == 404
    assert app.get("/api/v1/audit", "admin").json()["audit"][0]["action"] == "export observations"
