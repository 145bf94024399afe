"""The ingest log: every accepted batch, as it came, before it is answered.

Rows are never changed. ``seq`` orders them: whoever reads the log in this order and feeds it to the same code gets the
same tracks. Retention cuts the log from below, never its last row, so that ``seq`` never starts anew.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from sqlalchemy import Engine, delete, func, insert, select

from wayfuse.storage.schema import counters, ingest_log

__all__ = ["Entry", "IngestLog", "last_seq"]

_PAGE = 500  # rows read at a time: bodies can have a megabyte


class Entry(NamedTuple):
    """One accepted batch.

    arrived : Unix s. site : its name. adapter : how ``body`` is read. device, track : pseudonyms. profile : JSON of
    what the phone's enrolment said when the batch came, for the body alone may not be readable without.
    """

    seq: int
    arrived: float
    site: str
    adapter: str
    device: str
    track: str
    profile: str
    body: bytes


class IngestLog:
    """The log of a database; one writer at a time."""

    def __init__(self, engine: Engine) -> None:
        self._engine = engine

    def append(self, entries: Sequence[Entry]) -> None:
        """Write a group in one transaction; when this returns, the group is on the disk."""
        if not entries:
            return
        with self._engine.begin() as connection:
            connection.execute(insert(ingest_log), [entry._asdict() for entry in entries])

    def read(self, after: int = 0, *, track: str | None = None) -> Iterator[Entry]:
        """Entries with seq > ``after``, in order, of one track or of all."""
        while True:
            query = select(ingest_log).where(ingest_log.c.seq > after).order_by(ingest_log.c.seq).limit(_PAGE)
            if track is not None:
                query = query.where(ingest_log.c.track == track)
            with self._engine.connect() as connection:
                rows = connection.execute(query).all()
            for row in rows:
                yield Entry(*row)
            if len(rows) < _PAGE:
                return
            after = rows[-1].seq

    def trim(self, older_than: float, up_to: int) -> int:
        """Delete entries older than a time (Unix s) with seq up to ``up_to``; how many. The last one stays."""
        with self._engine.begin() as connection:
            last = select(func.max(ingest_log.c.seq)).scalar_subquery()
            done = connection.execute(
                delete(ingest_log).where(
                    ingest_log.c.arrived < older_than, ingest_log.c.seq <= up_to, ingest_log.c.seq < last
                )
            )
            return int(done.rowcount)


def last_seq(engine: Engine) -> int:
    """The greatest seq ever given: of the log, or of the checkpoints; 0 before the first."""
    with engine.connect() as connection:
        logged = connection.execute(select(func.max(ingest_log.c.seq))).scalar()
        kept = connection.execute(select(func.max(counters.c.value)).where(counters.c.name == "checkpoint"))
        return max(int(logged or 0), int(kept.scalar() or 0))
