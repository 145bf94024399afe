"""Channel state over TCP: what a card's log holds comes into the log of the server, record by record."""

from __future__ import annotations

import socket
import struct
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from service_running import App, started, wait_until

from wayfuse.formats import intel5300
from wayfuse.sensors.records import CsiFrame, bssid_id
from wayfuse.service.adapters import ADAPTERS
from wayfuse.service.adapters.intel5300 import intel5300_body
from wayfuse.service.message import BadBodyError, Profile
from wayfuse.storage.log import IngestLog


def _record(t: int, seed: int = 0, n_rx: int = 2) -> bytes:
    """A packet of one transmit antenna at t (µs)."""
    size = (30 * (n_rx * 16 + 3) + 7) // 8
    head = struct.pack("<IHHBBBBBbBBHH", t, 0, 0, n_rx, 1, 30, 31, 0, -127, 20, 0b100100, size, 0)
    body = head + np.random.default_rng(seed).integers(0, 256, size, np.uint8).tobytes()
    return struct.pack(">HB", len(body) + 1, 0xBB) + body


RECORDS = [_record(1000 + 20_000 * n, n) for n in range(40)]


@pytest.fixture(scope="module")
def port() -> int:
    """A free one."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        number: int = free.getsockname()[1]
    return number


@pytest.fixture(scope="module")
def app(world: Any, port: int, tmp_path_factory: pytest.TempPathFactory) -> Iterator[App]:
    """A server that listens for streams."""
    with started(world, tmp_path_factory.mktemp("server"), csi_port=port) as app:
        yield app


def _stream(port: int, hello: str, *parts: bytes, end: bool = True) -> tuple[str, socket.socket]:
    sender = socket.create_connection(("127.0.0.1", port), timeout=30.0)
    sender.sendall(hello.encode() + b"\n")
    answer = sender.makefile("rb").readline().decode().strip()
    if answer == "ok":
        for part in parts:
            sender.sendall(part)
    if end:
        sender.close()
    return answer, sender


def _logged(app: App, anchor: str) -> list[bytes]:
    return [e.body for e in IngestLog(app.server.engine).read() if e.body.startswith(anchor.encode() + b" ")]


def test_a_stream_is_logged_whole_however_it_is_cut(app: App, port: int, tmp_path: Any) -> None:
    whole = b"".join(RECORDS)
    cut = [whole[i : i + 777] for i in range(0, len(whole), 777)]
    answer, _ = _stream(port, f"{app.tokens['ingest']} an-1 tag-3", *cut)
    assert answer == "ok"
    wait_until(lambda: b"".join(b.partition(b"\n")[2] for b in _logged(app, "an-1")) == whole)
    app.settle()
    (view,) = [v for v in app.server.live.views() if v.counts.get("records")]
    assert view.counts["records"] == len(RECORDS)


def test_what_ends_in_the_middle_keeps_the_records_before(app: App, port: int) -> None:
    _, _ = _stream(port, f"{app.tokens['ingest']} an-2 tag-4 site", RECORDS[0], RECORDS[1][:50])
    wait_until(lambda: _logged(app, "an-2") == [b"an-2 tag-4\n" + RECORDS[0]])


def test_a_stream_that_pauses_is_not_waited_for(app: App, port: int) -> None:
    _, sender = _stream(port, f"{app.tokens['ingest']} an-3 tag-5", RECORDS[0], RECORDS[1][:50], end=False)
    sender.sendall(RECORDS[1][50:])
    wait_until(lambda: _logged(app, "an-3"))
    sender.sendall(RECORDS[2])
    wait_until(lambda: b"".join(b.partition(b"\n")[2] for b in _logged(app, "an-3")) == b"".join(RECORDS[:3]))
    sender.sendall(b"\0\0")
    assert b"no length" in sender.makefile("rb").read()
    sender.close()


@pytest.mark.parametrize(
    ("hello", "said"),
    [
        ("", "first line"),
        ("wf_no_no an tag", "no valid token"),
        ("READ an tag", "may not ingest"),
        ("TOKEN an tag elsewhere", "no site"),
        ("TOKEN an da:a1:19:00:00:01", "nobody's identity"),
        ("TOKEN an tag site more", "first line"),
    ],
)
def test_who_may_not_is_told_so(app: App, port: int, hello: str, said: str) -> None:
    line = hello.replace("TOKEN", app.tokens["ingest"]).replace("READ", app.tokens["read"])
    answer, _ = _stream(port, line, RECORDS[0])
    assert answer.startswith("refused: ")
    assert said in answer


# --- the adapter --------------------------------------------------------------------------------------------


def test_a_body_is_read_as_the_log_of_the_same_records(tmp_path: Any) -> None:
    path = tmp_path / "log.dat"
    path.write_bytes(b"".join(RECORDS))
    expected = intel5300.read(path).csi
    message = ADAPTERS["intel5300"].read(intel5300_body("an", "tag", b"".join(RECORDS)), Profile(), 100.0)[0]
    frames = [f for f in message.parts[0].records if isinstance(f, CsiFrame)]
    assert message.device == "tag"
    assert [round(f.t - 100.0, 6) for f in frames] == [round(e.t - expected[-1].t, 6) for e in expected]
    assert all(np.array_equal(f.csi, e.csi) and f.rss == e.rss for f, e in zip(frames, expected, strict=True))
    assert {f.anchor for f in frames} == {bssid_id("an")}


def test_a_card_that_was_started_anew_does_not_carry_frames_away() -> None:
    body = intel5300_body("an", "tag", _record(4_000_000_000) + _record(1000) + _record(2000))
    times = [r.t for r in ADAPTERS["intel5300"].read(body, Profile(), 50.0)[0].parts[0].records]
    assert max(times) == 50.0
    assert min(times) >= 50.0 - 60.0


@pytest.mark.parametrize(
    "body", [b"", b"an\n", b"an  tag\n", b"\xff \xff\n", b"a b c\n", b"an " + b"x" * 300 + b"\n"]
)
def test_bodies_that_are_none(body: bytes) -> None:
    with pytest.raises(BadBodyError):
        ADAPTERS["intel5300"].read(body, Profile(), 0.0)


def test_damage_is_counted() -> None:
    body = intel5300_body("an", "tag", RECORDS[0] + b"\x00\x05\xbbshort"[:7] + RECORDS[1])
    message = ADAPTERS["intel5300"].read(body, Profile(), 0.0)[0]
    assert message.n_records == 2
    assert message.notes == {"a record shorter than its head": 1}
