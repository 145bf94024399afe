"""What is deleted leaves the file as well, a bite at a time."""

from __future__ import annotations

import sqlite3
from pathlib import Path

import pytest
from sqlalchemy import Engine, text
from sqlalchemy.exc import SQLAlchemyError

from wayfuse.storage.database import open_database
from wayfuse.storage.log import Entry, IngestLog
from wayfuse.storage.shrinking import give_back
from wayfuse.storage.tracks import TrackStore

BODY = bytes(3000)
BITE = 256  # pages


def _filled(engine: Engine, n: int = 2000) -> IngestLog:
    log = IngestLog(engine)
    log.append([Entry(k, float(k), "s", "own", f"d{k}", f"t{k}", "{}", BODY) for k in range(1, n + 1)])
    return log


def _size(engine: Engine, path: Path) -> int:
    """Bytes of the file, with all of the write-ahead log in it."""
    with engine.connect() as connection:
        connection.execute(text("PRAGMA wal_checkpoint(TRUNCATE)"))
    return path.stat().st_size


def _number(engine: Engine, pragma: str) -> int:
    with engine.connect() as connection:
        return int(connection.execute(text(f"PRAGMA {pragma}")).scalar_one())


def _all(engine: Engine) -> int:
    n = 0
    while give_back(engine):
        n += 1
    return n


def test_the_file_gets_smaller_after_what_is_old_is_deleted(tmp_path: Path) -> None:
    engine = open_database(f"sqlite:///{tmp_path / 'a.db'}")
    log = _filled(engine)
    full = _size(engine, tmp_path / "a.db")
    assert not give_back(engine)
    log.trim(1900.0, 2000)
    assert _size(engine, tmp_path / "a.db") == full
    n = _all(engine)
    assert n >= 0.8 * full / 4096 / BITE
    assert _size(engine, tmp_path / "a.db") < 0.15 * full
    assert [e.seq for e in log.read()] == list(range(1900, 2001))
    assert _number(engine, "freelist_count") <= _number(engine, "page_count") // 8
    with engine.connect() as connection:
        assert connection.execute(text("PRAGMA integrity_check")).scalar() == "ok"
    engine.dispose()


def test_a_bite_is_small_and_pages_from_the_end_fill_the_holes(tmp_path: Path) -> None:
    engine = open_database(f"sqlite:///{tmp_path / 'a.db'}")
    log = _filled(engine)
    pages = _number(engine, "page_count")
    log.trim(1500.0, 2000)  # what is left lies at the end of the file
    assert give_back(engine)
    assert pages - 2 * BITE < _number(engine, "page_count") <= pages - BITE
    _all(engine)
    assert _number(engine, "page_count") < 0.4 * pages
    assert [(e.seq, e.body) for e in log.read()] == [(seq, BODY) for seq in range(1500, 2001)]
    engine.dispose()


def test_the_log_of_changes_does_not_stay_long(tmp_path: Path) -> None:
    engine = open_database(f"sqlite:///{tmp_path / 'a.db'}")
    log = _filled(engine, 8000)
    assert (tmp_path / "a.db-wal").stat().st_size > 24 << 20
    for seq in (8001, 8002):  # the log begins anew
        log.append([Entry(seq, float(seq), "s", "own", "d", "t", "{}", BODY)])
    assert (tmp_path / "a.db-wal").stat().st_size <= 16 << 20
    engine.dispose()


def test_what_is_forgotten_is_still_overwritten_where_pages_were_moved(tmp_path: Path) -> None:
    engine = open_database(f"sqlite:///{tmp_path / 'a.db'}")
    log = _filled(engine, 500)
    log.append([Entry(501, 501.0, "s", "own", "me", "t", "{}", b"whose phone this is " * 1000)])
    log.trim(450.0, 500)
    assert _all(engine) >= 1
    _size(engine, tmp_path / "a.db")
    assert b"whose phone this is" in (tmp_path / "a.db").read_bytes()
    TrackStore(engine).forget("me")
    assert b"whose phone this is" not in b"".join(p.read_bytes() for p in tmp_path.iterdir())
    engine.dispose()


def _of_before(path: Path) -> None:
    """A database as it was made before: without the means to shrink."""
    with sqlite3.connect(path) as connection:
        connection.execute("PRAGMA journal_mode=WAL")
    connection.close()


def test_a_database_of_before_works_and_is_changed_by_one_command(tmp_path: Path) -> None:
    path = tmp_path / "wayfuse.db"
    _of_before(path)
    engine = open_database(f"sqlite:///{path}")
    log = _filled(engine)
    full = _size(engine, path)
    log.trim(1900.0, 2000)
    assert not give_back(engine)
    assert _size(engine, path) == full
    engine.dispose()
    page = (Path(__file__).parents[2] / "docs" / "server.md").read_text(encoding="utf-8")
    (line,) = [line for line in page.splitlines() if line.startswith("sqlite3 wayfuse-data/")]
    _, _, statements = line.partition(" wayfuse-data/wayfuse.db ")
    converting = sqlite3.connect(path)
    converting.executescript(statements.strip('"'))
    converting.close()
    engine = open_database(f"sqlite:///{path}")
    assert _size(engine, path) < 0.15 * full
    more = [Entry(k, float(k), "s", "own", "d", "t", "{}", BODY) for k in range(2001, 4000)]
    log = IngestLog(engine)
    log.append(more)
    log.trim(3900.0, 4000)
    assert give_back(engine)
    engine.dispose()


def test_a_database_that_is_busy_says_so(tmp_path: Path) -> None:
    engine = open_database(f"sqlite:///{tmp_path / 'a.db'}")
    _filled(engine).trim(1900.0, 2000)
    with sqlite3.connect(tmp_path / "a.db") as other:
        other.execute("BEGIN IMMEDIATE")
        with engine.connect() as connection:
            connection.execute(text("PRAGMA busy_timeout = 1"))
        with pytest.raises(SQLAlchemyError, match="locked"):
            give_back(engine)
        other.rollback()
    other.close()
    assert give_back(engine)
    engine.dispose()


def test_postgresql_is_left_alone(engine: Engine) -> None:
    _filled(engine, 500).trim(450.0, 500)
    if engine.dialect.name == "postgresql":
        assert not give_back(engine)
