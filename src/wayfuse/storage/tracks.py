"""Tracks: settled estimates, and checkpoints to go on from; written together, so that they always fit.

A checkpoint says: all of the log up to its ``seq`` is in this state and the estimates written with it. A round is
closed when every track that changed before it began has one; a server that starts reads the states, and then the log
after the last round for each track from its own ``seq`` on.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from sqlalchemy import Connection, Engine, Table, delete, func, insert, select, update
from sqlalchemy.dialects import postgresql, sqlite

from wayfuse.storage.erasing import erasing
from wayfuse.storage.schema import checkpoints, counters, estimates, ingest_log, tracks
from wayfuse.tracking.estimate import Estimate, State

__all__ = ["Checkpoint", "TrackRow", "TrackStore"]

_ROUND = "checkpoint"
_COLUMNS = [estimates.c[name] for name in Estimate._fields]


class TrackRow(NamedTuple):
    """A track: its pseudonym, site and phone, the versions of the radio map and of the anchors it is tracked with, and
    when (Unix s)."""

    track: str
    site: str
    device: str
    map_version: int
    started: float
    heard: float
    anchor_version: int = 0


class Checkpoint(NamedTuple):
    """What is kept of a track: estimates that can no longer change, from number ``first`` on, and the state."""

    row: TrackRow
    first: int
    settled: Sequence[Estimate]
    state: bytes


class TrackStore:
    """Tracks of a database."""

    def __init__(self, engine: Engine) -> None:
        self._engine = engine

    def save(self, seq: int, kept: Sequence[Checkpoint]) -> None:
        """Write checkpoints, each with all of the log up to ``seq`` in it, in one transaction."""
        if not kept:
            return
        with self._engine.begin() as connection:
            _put(connection, tracks, [each.row._asdict() for each in kept])
            states = [{"track": each.row.track, "seq": seq, "state": each.state} for each in kept]
            _put(connection, checkpoints, states)
            # begun anew: a checkpoint of another version could not be gone on from
            anew = [each.row.track for each in kept if each.first == 0]
            if anew:
                connection.execute(delete(estimates).where(estimates.c.track.in_(anew)))
            rows = [
                {"track": each.row.track, "n": n, **e._asdict(), "state": e.state.value}
                for each in kept
                for n, e in enumerate(each.settled, each.first)
            ]
            if rows:
                connection.execute(insert(estimates), rows)

    def close_round(self, seq: int) -> None:
        """Say that all of the log up to ``seq`` is in checkpoints."""
        with self._engine.begin() as connection:
            connection.execute(delete(counters).where(counters.c.name == _ROUND))
            connection.execute(insert(counters).values(name=_ROUND, value=seq))

    def round(self) -> int:
        """The seq of the last round, 0 before the first."""
        with self._engine.connect() as connection:
            found = connection.execute(select(counters.c.value).where(counters.c.name == _ROUND)).scalar()
        return int(found or 0)

    def newest_seq(self) -> int:
        """The greatest seq that is in any checkpoint, 0 before the first."""
        with self._engine.connect() as connection:
            return int(connection.execute(select(func.max(checkpoints.c.seq))).scalar() or 0)

    def state(self, track: str) -> tuple[TrackRow, bytes, int] | None:
        """A track, its checkpoint, and up to where the log is in it."""
        with self._engine.connect() as connection:
            row = connection.execute(select(tracks).where(tracks.c.track == track)).first()
            kept = connection.execute(
                select(checkpoints.c.state, checkpoints.c.seq).where(checkpoints.c.track == track)
            ).first()
        return None if row is None or kept is None else (TrackRow(*row), bytes(kept[0]), int(kept[1]))

    def row(self, track: str) -> TrackRow | None:
        """A track."""
        with self._engine.connect() as connection:
            found = connection.execute(select(tracks).where(tracks.c.track == track)).first()
        return None if found is None else TrackRow(*found)

    def newest(self, heard_after: float = 0.0, *, limit: int | None = None, site: str = "") -> list[TrackRow]:
        """Tracks heard after a time, of a site or all, the last heard first."""
        query = select(tracks).where(tracks.c.heard > heard_after).order_by(tracks.c.heard.desc())
        if site:
            query = query.where(tracks.c.site == site)
        with self._engine.connect() as connection:
            return [TrackRow(*row) for row in connection.execute(query.limit(limit))]

    def estimates(
        self, track: str, since: float | None = None, until: float | None = None
    ) -> list[tuple[int, Estimate]]:
        """Settled estimates with their numbers, in order, of a span of the phone's time."""
        query = select(estimates.c.n, *_COLUMNS).where(estimates.c.track == track).order_by(estimates.c.n)
        if since is not None:
            query = query.where(estimates.c.t >= since)
        if until is not None:
            query = query.where(estimates.c.t <= until)
        with self._engine.connect() as connection:
            return [(row[0], _estimate(row[1:])) for row in connection.execute(query)]

    def last_estimate(self, track: str) -> Estimate | None:
        """The last settled estimate."""
        query = select(*_COLUMNS).where(estimates.c.track == track).order_by(estimates.c.n.desc()).limit(1)
        with self._engine.connect() as connection:
            row = connection.execute(query).first()
        return None if row is None else _estimate(row)

    def n_estimates(self, track: str) -> int:
        """How many estimates of a track are written."""
        query = select(func.count()).select_from(estimates).where(estimates.c.track == track)
        with self._engine.connect() as connection:
            return int(connection.execute(query).scalar_one())

    def trim(self, heard_before: float) -> int:
        """Delete tracks last heard before a time (Unix s); how many."""
        with self._engine.begin() as connection:
            old = select(tracks.c.track).where(tracks.c.heard < heard_before)
            connection.execute(delete(checkpoints).where(checkpoints.c.track.in_(old)))
            connection.execute(delete(estimates).where(estimates.c.track.in_(old)))
            return int(connection.execute(delete(tracks).where(tracks.c.heard < heard_before)).rowcount)

    def forget(self, device: str) -> set[str]:
        """Delete all of a phone, its part of the log too, from the files as well; which tracks it had."""
        with erasing(self._engine) as connection:
            names = select(tracks.c.track).where(tracks.c.device == device)
            gone = set(connection.execute(names).scalars())
            connection.execute(delete(checkpoints).where(checkpoints.c.track.in_(names)))
            connection.execute(delete(estimates).where(estimates.c.track.in_(names)))
            connection.execute(delete(tracks).where(tracks.c.device == device))
            # the rows stay as empty ones: seq has no gaps, and its last value is never lost
            empty = {"body": b"", "device": "", "track": "", "profile": "", "adapter": "deleted"}
            connection.execute(update(ingest_log).where(ingest_log.c.device == device).values(empty))
            return gone


def _put(connection: Connection, table: Table, rows: Sequence[Mapping[str, Any]]) -> None:
    """Insert rows, or replace those of their tracks."""
    kind = sqlite if connection.dialect.name == "sqlite" else postgresql
    statement = kind.insert(table)
    values = {name: statement.excluded[name] for name in rows[0] if name != "track"}
    connection.execute(
        statement.on_conflict_do_update(index_elements=["track"], set_=values), [dict(r) for r in rows]
    )


def _estimate(row: Any) -> Estimate:
    e = Estimate(*row)
    return e._replace(state=State(e.state))
