"""Giving back what deletion leaves: a file of SQLite keeps its free pages, unless somebody takes them out.

New databases are made for that (``auto_vacuum=INCREMENTAL``, `storage.database`): free pages are cut off the end of the
file, and those in between are filled with pages from the end. It is done in small bites, so that nobody waits for long.
PostgreSQL does the like by itself.
"""

from __future__ import annotations

import sqlite3

from sqlalchemy import Engine
from sqlalchemy.exc import DBAPIError

__all__ = ["give_back"]

_INCREMENTAL = 2  # of PRAGMA auto_vacuum
_BITE = 256  # pages of 4 KiB, some hundredths of a second
# one page of so many stays free: a server that deletes as much as comes would move pages for nothing
_SPARE = 8


def give_back(engine: Engine) -> bool:
    """Give back a bite of free pages; False where there was none to give, as in a database of before.

    The file is smaller when the write-ahead log has been copied into it, which SQLite does by itself.

    Raises
    ------
    SQLAlchemyError : the database cannot be written now.
    """
    if engine.dialect.name != "sqlite":
        return False
    with engine.connect() as connection:
        free, pages, mode = (
            int(connection.exec_driver_sql(f"PRAGMA {name}").scalar_one())
            for name in ("freelist_count", "page_count", "auto_vacuum")
        )
        n = min(_BITE, free - pages // _SPARE)
        if mode != _INCREMENTAL or n <= 0:
            return False
        # as a script: a statement alone gives back a single page, for the driver takes but one step of it
        said = f"PRAGMA incremental_vacuum({n})"
        try:
            connection.connection.cursor().executescript(said)
        except sqlite3.Error as error:
            raise DBAPIError(said, None, error) from error
        return True
