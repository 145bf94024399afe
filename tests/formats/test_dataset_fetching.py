"""Fetching from a real HTTP server: resume, retries, hostile answers; copies from a local folder."""

from __future__ import annotations

import hashlib
import re
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from urllib.parse import unquote

import pytest

from wayfuse.core.errors import DataMissingError, UsageError
from wayfuse.formats import fetching
from wayfuse.formats.datasets import Entry

BIG = bytes(range(256)) * 4096  # 1 MiB: four chunks
CONTENT = {"a/walk 1.txt": BIG, "b/läge.txt": b"two\n", "c.txt": b""}


class Site:
    """What the server serves and how it misbehaves; ``log`` holds (path, Range header) of each request."""

    def __init__(self) -> None:
        self.files = {f"/toy/{p}": d for p, d in CONTENT.items()}
        self.cut_after: list[int] = []  # bytes after which the next answers end
        self.errors: list[int] = []  # status codes of the next answers
        self.ranges = True
        self.log: list[tuple[str, str]] = []


@pytest.fixture
def site() -> Site:
    return Site()


@pytest.fixture
def address(site: Site) -> Iterator[str]:
    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            path, wanted = unquote(self.path), self.headers.get("Range", "")
            site.log.append((path, wanted))
            if site.errors:
                self.send_error(site.errors.pop(0))
                return
            if path not in site.files:
                self.send_error(404)
                return
            body, start = site.files[path], 0
            match = re.fullmatch(r"bytes=(\d+)-", wanted)
            if match and site.ranges:
                start = int(match[1])
                self.send_response(206)
                self.send_header("Content-Range", f"bytes {start}-{len(body) - 1}/{len(body)}")
            else:
                self.send_response(200)
            self.send_header("Content-Length", str(len(body) - start))
            self.end_headers()
            stop = start + site.cut_after.pop(0) if site.cut_after else len(body)
            self.wfile.write(body[start:stop])
            self.close_connection = True

        def log_message(self, *args: object) -> None:
            """Keep the tests quiet."""

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    yield f"http://127.0.0.1:{server.server_port}"
    server.shutdown()
    server.server_close()
    thread.join()


@pytest.fixture(autouse=True)
def toy(monkeypatch: pytest.MonkeyPatch) -> None:
    def entries(_: str) -> tuple[Entry, ...]:
        return tuple(
            Entry(p, len(d), hashlib.sha256(d).hexdigest(), ("o/r", "HEAD", f"data/{p}"))
            for p, d in CONTENT.items()
        )

    monkeypatch.setattr(fetching, "manifest", entries)


def assert_whole(root: Path) -> None:
    for path, data in CONTENT.items():
        assert (root / "toy" / path).read_bytes() == data
    assert not list(root.rglob("*.part"))


def run(root: Path, address: str) -> tuple[fetching.Outcome, list[int], list[float]]:
    done: list[int] = []
    pauses: list[float] = []
    outcome = fetching.fetch("toy", root, mirror=address, progress=done.append, pause=pauses.append)
    return outcome, done, pauses


def test_everything_is_brought_once(tmp_path: Path, site: Site, address: str) -> None:
    outcome, done, pauses = run(tmp_path, address)
    assert outcome.is_whole
    assert outcome.brought == list(CONTENT)
    assert sum(done) == sum(map(len, CONTENT.values()))
    assert pauses == []
    assert_whole(tmp_path)
    n = len(site.log)
    again, done, _ = run(tmp_path, address)
    assert again.present == list(CONTENT)
    assert len(site.log) == n
    assert sum(done) == sum(map(len, CONTENT.values()))


def test_an_interrupted_download_goes_on_where_it_stopped(tmp_path: Path, site: Site, address: str) -> None:
    site.cut_after = [300_000, 300_000]
    outcome, done, pauses = run(tmp_path, address)
    assert outcome.is_whole
    assert [wanted for path, wanted in site.log if "walk" in path] == ["", "bytes=300000-", "bytes=600000-"]
    assert pauses == [0.5, 1.0]
    assert sum(done) == sum(map(len, CONTENT.values()))
    assert_whole(tmp_path)


def test_a_later_run_goes_on_too(tmp_path: Path, site: Site, address: str) -> None:
    site.cut_after = [100_000, 0, 0, 0]
    outcome, _, _ = run(tmp_path, address)
    assert list(outcome.failed) == ["a/walk 1.txt"]
    assert (tmp_path / "toy" / "a" / "walk 1.txt.part").stat().st_size == 100_000
    assert not (tmp_path / "toy" / "a" / "walk 1.txt").exists()
    site.log.clear()
    outcome, _, _ = run(tmp_path, address)
    assert outcome.is_whole
    assert site.log == [("/toy/a/walk 1.txt", "bytes=100000-")]
    assert_whole(tmp_path)


def test_a_server_without_ranges_starts_anew(tmp_path: Path, site: Site, address: str) -> None:
    site.ranges = False
    site.cut_after = [300_000]
    assert run(tmp_path, address)[0].is_whole
    assert_whole(tmp_path)


def test_a_spoilt_part_is_thrown_away_after_its_checksum(tmp_path: Path, site: Site, address: str) -> None:
    part = tmp_path / "toy" / "a" / "walk 1.txt.part"
    part.parent.mkdir(parents=True)
    part.write_bytes(b"x" * 500_000)
    assert run(tmp_path, address)[0].is_whole
    assert [wanted for path, wanted in site.log if "walk" in path] == ["bytes=500000-", ""]
    assert_whole(tmp_path)


def test_passing_errors_are_tried_again_and_lasting_ones_not(
    tmp_path: Path, site: Site, address: str
) -> None:
    site.errors = [503, 500]
    outcome, _, pauses = run(tmp_path, address)
    assert outcome.is_whole
    assert len(pauses) == 2
    (tmp_path / "toy" / "c.txt").unlink()
    del site.files["/toy/c.txt"]
    outcome, done, pauses = run(tmp_path, address)
    assert outcome.failed == {"c.txt": "HTTP 404 Not Found"}
    assert pauses == []
    assert sum(done) == sum(map(len, CONTENT.values()))


@pytest.mark.parametrize(
    ("body", "reason"),
    [
        (b"other", "the file is larger than the manifest says"),
        (b"tow\n", "the checksum differs from the manifest"),
        (b"tw", "the connection ended early"),
    ],
)
def test_wrong_content_never_gets_into_place(
    tmp_path: Path, site: Site, address: str, body: bytes, reason: str
) -> None:
    site.files["/toy/b/läge.txt"] = body
    outcome, _, _ = run(tmp_path, address)
    assert outcome.failed == {"b/läge.txt": reason}
    assert not (tmp_path / "toy" / "b" / "läge.txt").exists()
    assert outcome.brought == ["a/walk 1.txt", "c.txt"]


def test_a_server_that_is_not_there_is_a_reason(tmp_path: Path) -> None:
    outcome, _, pauses = run(tmp_path, "http://127.0.0.1:1")
    assert set(outcome.failed) == {"a/walk 1.txt", "b/läge.txt", "c.txt"}
    assert "refused" in outcome.failed["c.txt"]
    assert len(pauses) == 9


def test_only_web_addresses_are_mirrors(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="no http"):
        fetching.fetch("toy", tmp_path, mirror="file:///etc")


def test_files_without_address_are_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    entry = Entry("c.txt", 4, "0" * 64, None)
    monkeypatch.setattr(fetching, "manifest", lambda _: (entry,))
    outcome = fetching.fetch("toy", tmp_path)
    assert outcome.without_address == ["c.txt"]
    assert not outcome.is_whole


@pytest.mark.parametrize("layout", ["", "toy", "data"])
def test_a_copy_from_the_set_a_data_root_or_a_clone(tmp_path: Path, layout: str) -> None:
    source = tmp_path / "source"
    for path, data in CONTENT.items():
        target = source / layout / path
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(data)
    done: list[int] = []
    outcome = fetching.copy("toy", tmp_path / "root", source, progress=done.append)
    assert outcome.brought == list(CONTENT)
    assert sum(done) == sum(map(len, CONTENT.values()))
    assert_whole(tmp_path / "root")
    assert fetching.copy("toy", tmp_path / "root", source).present == list(CONTENT)


def test_a_copy_verifies_and_names_what_it_lacks(tmp_path: Path) -> None:
    source = tmp_path / "source"
    source.mkdir()
    (source / "c.txt").write_bytes(b"not empty")
    outcome = fetching.copy("toy", tmp_path / "root", source)
    assert outcome.failed == {
        "a/walk 1.txt": "not in the folder",
        "b/läge.txt": "not in the folder",
        "c.txt": "differs from the manifest",
    }
    with pytest.raises(DataMissingError, match="no such folder"):
        fetching.copy("toy", tmp_path / "root", tmp_path / "absent")
