"""Who did what: a list of everything that changes who may do what, what is published, what is deleted.

Rows are added and, when they are old, deleted; never changed.
"""

from __future__ import annotations

from typing import NamedTuple

from sqlalchemy import Engine, delete, insert, select

from wayfuse.storage.schema import audit

__all__ = ["AuditLog", "AuditRow"]


class AuditRow(NamedTuple):
    """at : Unix s. actor : identifier of the token. action, subject, detail : words."""

    at: float
    actor: str
    action: str
    subject: str
    detail: str


class AuditLog:
    """The list of a database."""

    def __init__(self, engine: Engine) -> None:
        self._engine = engine

    def add(self, at: float, actor: str, action: str, subject: str, detail: str = "") -> None:
        """Note one thing done."""
        with self._engine.begin() as connection:
            connection.execute(insert(audit).values(**AuditRow(at, actor, action, subject, detail)._asdict()))

    def newest(self, limit: int = 100) -> list[AuditRow]:
        """The last things done, newest first."""
        columns = (audit.c.at, audit.c.actor, audit.c.action, audit.c.subject, audit.c.detail)
        with self._engine.connect() as connection:
            rows = connection.execute(select(*columns).order_by(audit.c.id.desc()).limit(limit))
            return [AuditRow(*row) for row in rows]

    def trim(self, before: float) -> int:
        """Delete what was done before a time (Unix s); how many rows."""
        with self._engine.begin() as connection:
            return int(connection.execute(delete(audit).where(audit.c.at < before)).rowcount)
