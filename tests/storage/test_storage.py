"""What is stored comes back, on both databases: log, sites, radio maps, tracks, tokens, devices, audit."""

from __future__ import annotations

import itertools
from pathlib import Path

import pytest
from alembic.autogenerate import compare_metadata
from alembic.migration import MigrationContext
from sqlalchemy import Engine, text
from sqlalchemy.exc import IntegrityError

from wayfuse.core.errors import ConfigError, RadioMapError, UsageError
from wayfuse.storage.audit import AuditLog
from wayfuse.storage.database import open_database, take_lease
from wayfuse.storage.devices import Device, DeviceStore
from wayfuse.storage.log import Entry, IngestLog, last_seq
from wayfuse.storage.schema import METADATA
from wayfuse.storage.sites import SiteStore
from wayfuse.storage.tokens import TokenStore
from wayfuse.storage.tracks import Checkpoint, TrackRow, TrackStore
from wayfuse.tracking.estimate import Estimate, State


def _entry(seq: int, **changes: object) -> Entry:
    entry = Entry(seq, 1000.0 + seq, "site", "own", "d1", f"t{seq % 2}", "{}", bytes([seq % 256, 0, 255]))
    return entry._replace(**changes)


def _estimate(t: float) -> Estimate:
    return Estimate(t, 0.1 + t, 1 / 3, 1, 0.5, -0.25, 0.7, 1.1, 2.2, State.LOST, 3, 4, 0.125, 0.9)


# --- the database -----------------------------------------------------------------------------------------


def test_migrations_build_the_schema_of_the_code(engine: Engine) -> None:
    with engine.connect() as connection:
        assert compare_metadata(MigrationContext.configure(connection), METADATA) == []


def test_opening_again_keeps_everything(url: str) -> None:
    first = open_database(url)
    IngestLog(first).append([_entry(1)])
    first.dispose()
    again = open_database(url)
    assert list(IngestLog(again).read()) == [_entry(1)]
    again.dispose()


def test_sqlite_syncs_every_commit(tmp_path: Path) -> None:
    engine = open_database(f"sqlite:///{tmp_path / 'a.db'}")
    with engine.connect() as connection:
        assert connection.execute(text("PRAGMA journal_mode")).scalar() == "wal"
        assert connection.execute(text("PRAGMA synchronous")).scalar() == 2
        assert connection.execute(text("PRAGMA foreign_keys")).scalar() == 1
    engine.dispose()


@pytest.mark.parametrize("bad", ["nonsense", "mysql://a/b", ""])
def test_an_unknown_kind_of_database_is_refused(bad: str) -> None:
    with pytest.raises(ConfigError, match="database"):
        open_database(bad)


def test_a_database_that_is_not_there_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="cannot open the database"):
        open_database(f"sqlite:///{tmp_path / 'no' / 'such' / 'folder.db'}")
    with pytest.raises(UsageError, match="cannot open the database") as told:
        open_database("postgresql://somebody:secret@127.0.0.1:1/none")
    assert "secret" not in str(told.value)


def test_two_servers_do_not_share_a_postgresql_database(engine: Engine) -> None:
    lease = take_lease(engine)
    if engine.dialect.name == "sqlite":
        assert lease is None
        return
    assert lease is not None
    with pytest.raises(UsageError, match="another server"):
        take_lease(engine)
    lease.close()


# --- the log ----------------------------------------------------------------------------------------------


def test_the_log_gives_back_what_was_appended_in_order(engine: Engine) -> None:
    log = IngestLog(engine)
    entries = [_entry(seq) for seq in range(1, 1203)]
    for group in (entries[:7], entries[7:1000], [], entries[1000:]):
        log.append(group)
    assert list(log.read()) == entries
    assert list(log.read(after=1100)) == entries[1100:]
    assert list(log.read(track="t1")) == entries[0::2]
    assert last_seq(engine) == 1202


def test_a_group_is_written_whole_or_not_at_all(engine: Engine) -> None:
    log = IngestLog(engine)
    log.append([_entry(1)])
    with pytest.raises(IntegrityError):
        log.append([_entry(2), _entry(1)])
    assert [e.seq for e in log.read()] == [1]


def test_trimming_keeps_what_no_checkpoint_covers_and_the_last_row(engine: Engine) -> None:
    log = IngestLog(engine)
    log.append([_entry(seq) for seq in range(1, 11)])
    assert log.trim(older_than=1005.5, up_to=3) == 3
    assert [e.seq for e in log.read()] == list(range(4, 11))
    assert log.trim(older_than=9999.0, up_to=99) == 6
    assert [e.seq for e in log.read()] == [10]
    assert last_seq(engine) == 10


# --- sites and radio maps ---------------------------------------------------------------------------------


def test_radio_maps_are_published_and_rolled_back(engine: Engine) -> None:
    store = SiteStore(engine)
    store.register("site", "aa", 1.0)
    store.register("site", "bb", 2.0)
    assert store.names() == ("site",)
    assert store.published("site") is None
    versions = [store.add_radio_map("site", bytes([n]) * 3, 10.0 + n, f"map {n}") for n in range(3)]
    assert [v.version for v in versions] == [1, 2, 3]
    assert store.add_radio_map("site", bytes([1]) * 3, 99.0) == versions[1]
    assert store.radio_maps("site") == versions
    assert store.archive("site", 2) == b"\1\1\1"
    for version in (1, 3, 2):
        store.publish("site", version, 20.0, "me")
        assert store.published("site") == version
    assert store.roll_back("site", 21.0, "me") == 3
    assert store.roll_back("site", 22.0, "me") == 1  # what was in use before 3 came, not 2 again
    assert store.published("site") == 1
    with pytest.raises(RadioMapError, match="before"):
        store.roll_back("site", 23.0, "me")


def test_versions_that_are_not_there(engine: Engine) -> None:
    store = SiteStore(engine)
    store.register("site", "aa", 1.0)
    for call in (lambda: store.publish("site", 1, 0.0, "me"), lambda: store.archive("site", 7)):
        with pytest.raises(RadioMapError, match="no version"):
            call()


# --- tracks -----------------------------------------------------------------------------------------------


def test_checkpoints_and_estimates_come_back_to_the_bit(engine: Engine) -> None:
    store = TrackStore(engine)
    row = TrackRow("t", "site", "d", 1, 5.0, 6.0)
    first, second = [_estimate(1.0), _estimate(2.0)], [_estimate(3.0)]
    store.save(17, [Checkpoint(row, 0, first, b"one"), Checkpoint(row._replace(track="u"), 0, [], b"x")])
    store.save(18, [Checkpoint(row._replace(heard=9.0), 2, second, b"two")])
    assert store.round() == 0
    assert store.newest_seq() == 18
    store.close_round(16)
    store.close_round(17)
    assert store.round() == 17
    assert last_seq(engine) == 17  # though the log is empty
    assert store.state("t") == (row._replace(heard=9.0), b"two", 18)
    assert store.state("nobody") is None
    assert store.estimates("t") == list(enumerate(first + second))
    assert store.estimates("t", since=2.0, until=2.5) == [(1, first[1])]
    assert store.n_estimates("t") == 3
    assert store.row("t") == row._replace(heard=9.0)
    assert store.row("nobody") is None
    assert store.last_estimate("t") == second[0]
    assert store.last_estimate("u") is None
    assert [r.track for r in store.newest()] == ["t", "u"]
    assert [r.track for r in store.newest(heard_after=7.0)] == ["t"]
    assert [r.track for r in store.newest(limit=1)] == ["t"]
    assert store.newest(site="elsewhere") == []
    assert store.trim(7.0) == 1
    assert [r.track for r in store.newest()] == ["t"]
    store.save(19, [Checkpoint(row, 0, second, b"anew")])  # begun anew: what was is replaced
    assert store.estimates("t") == [(0, second[0])]


def test_checkpoints_are_written_whole_or_not_at_all(engine: Engine) -> None:
    store = TrackStore(engine)
    row = TrackRow("t", "site", "d", 1, 5.0, 6.0)
    store.save(1, [Checkpoint(row, 0, [_estimate(1.0), _estimate(2.0)], b"one")])
    twice = Checkpoint(row, 1, [_estimate(2.0)], b"y")  # there is a number 1 already
    with pytest.raises(IntegrityError):
        store.save(2, [Checkpoint(row._replace(track="u"), 0, [], b"x"), twice])
    assert store.newest_seq() == 1
    assert store.state("u") is None
    assert store.state("t") == (row, b"one", 1)


def test_a_forgotten_phone_leaves_nothing_but_empty_rows(engine: Engine) -> None:
    store, log = TrackStore(engine), IngestLog(engine)
    row = TrackRow("t", "site", "d1", 1, 5.0, 6.0)
    store.save(3, [Checkpoint(row, 0, [_estimate(1.0)], b"one")])
    log.append([_entry(1), _entry(2, device="d2"), _entry(3)])
    assert store.forget("d1") == {"t"}
    assert store.state("t") is None
    assert store.estimates("t") == []
    assert [(e.seq, e.device, e.body == b"") for e in log.read()] == [
        (1, "", True),
        (2, "d2", False),
        (3, "", True),
    ]


@pytest.mark.parametrize("size", [100, 100_000])  # in a page of the table, and in pages of its own
def test_what_is_forgotten_is_not_in_the_files_either(tmp_path: Path, size: int) -> None:
    engine = open_database(f"sqlite:///{tmp_path / 'a.db'}")
    store, log = TrackStore(engine), IngestLog(engine)
    gone, kept = b"whose phone this is " * (size // 20), b"another's phone"
    log.append([_entry(1, body=gone), _entry(2, device="d2", body=kept)])

    def files() -> bytes:
        return b"".join(path.read_bytes() for path in tmp_path.iterdir())

    assert b"whose phone this is" in files()
    store.forget("d1")
    assert b"whose phone this is" not in files()
    assert kept in files()
    with engine.connect() as connection:
        assert connection.execute(text("PRAGMA secure_delete")).scalar() == 0
        assert connection.execute(text("PRAGMA busy_timeout")).scalar() == 10_000
    engine.dispose()


# --- tokens, devices, audit -------------------------------------------------------------------------------


def _store(engine: Engine) -> TokenStore:
    draws = itertools.count(1)
    return TokenStore(engine, lambda n: next(draws).to_bytes(n, "big"))


def test_a_token_opens_what_its_scopes_say(engine: Engine) -> None:
    store = _store(engine)
    text_of, made = store.create({"ingest", "read"}, 10.0, site="a", label="phone", expires=20.0)
    found = store.verify(text_of, 15.0)
    assert found == made
    assert found is not None
    assert found.allows("read", "a")
    assert not found.allows("read", "b")
    assert not found.allows("admin", "a")
    assert store.verify(text_of, 20.0) is None
    assert _store(engine).all() == [made]


def test_a_revoked_token_is_none(engine: Engine) -> None:
    store = _store(engine)
    text_of, made = store.create({"admin"}, 10.0)
    assert store.verify(text_of, 11.0) is not None
    assert made.allows("ingest", "anywhere")
    assert store.revoke(made.id, 12.0)
    assert not store.revoke(made.id, 13.0)
    assert store.verify(text_of, 14.0) is None


@pytest.mark.parametrize("bad", ["", "wf", "wf__", "wf_a_b", "xx_0_0", "wf_é_ü", "wf_\0_\0", "_" * 200])
def test_other_texts_are_no_tokens(engine: Engine, bad: str) -> None:
    store = _store(engine)
    text_of, _ = store.create({"read"}, 10.0)
    assert store.verify(bad, 11.0) is None
    assert store.verify(text_of[:-1], 11.0) is None
    assert store.verify(text_of + "0", 11.0) is None


def test_secrets_are_not_stored(url: str) -> None:
    engine = open_database(url)
    text_of, _ = _store(engine).create({"read"}, 10.0)
    with engine.connect() as connection:
        stored = str(connection.execute(text("SELECT * FROM tokens")).all())
    engine.dispose()
    assert text_of.split("_")[2] not in stored


@pytest.mark.parametrize("scopes", [[], ["root"], ["read", "everything"]])
def test_unknown_scopes_are_refused(engine: Engine, scopes: list[str]) -> None:
    with pytest.raises(UsageError, match="scopes must be of"):
        _store(engine).create(scopes, 0.0)


def test_devices_are_enrolled_changed_and_removed(engine: Engine) -> None:
    store = DeviceStore(engine)
    store.enrol(Device("d1", "ios", label="first", enrolled=1.0))
    store.enrol(Device("d2", "android", enrolled=2.0))
    store.enrol(Device("d1", "ios", standardised=True, enrolled=3.0))
    assert [d.device for d in store.all()] == ["d2", "d1"]
    assert store.get("d1") == Device("d1", "ios", True, "", 3.0)
    assert store.remove("d1")
    assert not store.remove("d1")
    assert store.get("d1") is None
    with pytest.raises(UsageError, match="platform"):
        store.enrol(Device("d3", "symbian"))


def test_the_audit_log_tells_the_newest_first(engine: Engine) -> None:
    log = AuditLog(engine)
    for n in range(5):
        log.add(float(n), "me", "publish", f"site {n}")
    assert [row.subject for row in log.newest(2)] == ["site 4", "site 3"]
