"""Deletion that leaves nothing behind in the files of the database.

SQLite keeps what was deleted in pages that are free now, and in its write-ahead log, until something else is written
there. That does for what is deleted because it is old; not for a person who asks to be forgotten.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from sqlalchemy import Connection, Engine, text

__all__ = ["erasing"]


_WAIT_MS = 500  # for readers, before the log of changes can be cut; else the next to write cuts it


@contextmanager
def erasing(engine: Engine) -> Iterator[Connection]:
    """A transaction whose deletions overwrite what was there; PostgreSQL does so when it vacuums, by itself."""
    if engine.dialect.name != "sqlite":
        with engine.begin() as connection:
            yield connection
        return
    with engine.connect() as connection:
        wait = connection.execute(text("PRAGMA busy_timeout")).scalar_one()
        connection.execute(text("PRAGMA secure_delete = ON"))
        connection.commit()
        try:
            with connection.begin():
                yield connection
            connection.execute(text(f"PRAGMA busy_timeout = {_WAIT_MS}"))
            connection.execute(text("PRAGMA wal_checkpoint(TRUNCATE)"))
        finally:
            connection.execute(text("PRAGMA secure_delete = OFF"))
            connection.execute(text(f"PRAGMA busy_timeout = {int(wait)}"))
            connection.commit()
