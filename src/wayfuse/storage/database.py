"""Opening a database: SQLite in WAL mode, or PostgreSQL by URL; brought up to date by migrations.

What is committed is on the disk: SQLite runs with ``synchronous=FULL``, which syncs the write-ahead log at every
commit; PostgreSQL does the same with its own default, ``synchronous_commit=on``. A batch that was answered therefore
survives a killed server and a lost power supply. The price, one sync per commit, is shared by all batches of a group.
A new file of SQLite can give back what is deleted in it (`storage.shrinking`).
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from alembic import command
from alembic.config import Config
from sqlalchemy import Connection, Engine, create_engine, event, text
from sqlalchemy.engine import make_url
from sqlalchemy.exc import ArgumentError, SQLAlchemyError

from wayfuse.core.errors import ConfigError, UsageError

__all__ = ["open_database", "take_lease"]

_MIGRATIONS = Path(__file__).parent / "migrations"
_BUSY_MS = 10_000  # a reader waits so long for the writer before it gives up
# bytes of the write-ahead log that stay when a large deletion made it longer; usually 4 MiB
_MOST_LOG = 16 << 20
_LEASE = 0x7761_7966  # number of the advisory lock of a server on PostgreSQL


def open_database(url: str) -> Engine:
    """Connect, and create or migrate the tables.

    Parameters
    ----------
    url : ``sqlite:///PATH`` or ``postgresql://USER:PASSWORD@HOST:PORT/NAME``.

    Raises
    ------
    ConfigError : the URL is of no supported kind.
    UsageError : the database cannot be reached, or was made by a newer wayfuse.
    """
    try:
        parsed = make_url(url)
    except ArgumentError as error:
        raise ConfigError("not the URL of a database", where="database", remedy=_KINDS) from error
    kind = parsed.get_backend_name()
    if kind == "sqlite":
        engine = create_engine(parsed, connect_args={"timeout": _BUSY_MS / 1000})
        event.listen(engine, "connect", _prepare_sqlite)
    elif kind == "postgresql":
        engine = create_engine(parsed.set(drivername="postgresql+pg8000"), pool_pre_ping=True)
    else:
        raise ConfigError(f"no support for {kind} databases", where="database", remedy=_KINDS)
    try:
        _migrate(engine)
    except SQLAlchemyError as error:
        engine.dispose()
        raise UsageError(
            f"cannot open the database: {type(error).__name__}",
            where=parsed.render_as_string(hide_password=True),
            remedy="check that it exists, that it can be reached, and that the user may create tables",
        ) from error
    return engine


_KINDS = "use sqlite:///PATH or postgresql://USER:PASSWORD@HOST/NAME"


def _prepare_sqlite(connection: Any, _record: object) -> None:
    cursor = connection.cursor()
    if cursor.execute("PRAGMA page_count").fetchone() == (0,):
        cursor.execute("PRAGMA auto_vacuum=INCREMENTAL")  # before anything is written, or it says nothing
    for pragma in (
        "journal_mode=WAL",
        "synchronous=FULL",
        "foreign_keys=ON",
        f"busy_timeout={_BUSY_MS}",
        f"journal_size_limit={_MOST_LOG}",
    ):
        cursor.execute(f"PRAGMA {pragma}")
    cursor.close()


def _migrate(engine: Engine) -> None:
    config = Config()
    config.set_main_option("script_location", str(_MIGRATIONS).replace("%", "%%"))
    config.set_main_option("path_separator", "os")
    with engine.begin() as connection:
        config.attributes["connection"] = connection
        command.upgrade(config, "head")


def take_lease(engine: Engine) -> Connection | None:
    """Keep a second server from writing to a PostgreSQL database: hold the connection given back as long as you write.

    None for SQLite, where the lock of the data folder serves.

    Raises
    ------
    UsageError : another server holds it.
    """
    if engine.dialect.name != "postgresql":
        return None
    connection = engine.connect()
    held = connection.execute(text("SELECT pg_try_advisory_lock(:key)"), {"key": _LEASE}).scalar_one()
    connection.commit()
    if not held:
        connection.close()
        raise UsageError(
            "another server writes to this database", where="database", remedy="stop it, or name another one"
        )
    return connection
