"""The anchors of sites that came over the interface: where they hang and their channel model, by version.

A version is never changed: tracks go by the one they began with to their end, also where the log is read again.
"""

from __future__ import annotations

from typing import NamedTuple

from sqlalchemy import Engine, func, insert, select

from wayfuse.storage.schema import anchors

__all__ = ["NONE", "AnchorFiles", "AnchorStore"]


class AnchorFiles(NamedTuple):
    """Two files as they were uploaded; empty: none."""

    places: bytes = b""
    channel: bytes = b""


NONE = AnchorFiles()


class AnchorStore:
    """Anchors of a database."""

    def __init__(self, engine: Engine) -> None:
        self._engine = engine

    def newest(self, site: str) -> int:
        """The version that is in use, 0 before the first."""
        with self._engine.connect() as connection:
            found = select(func.max(anchors.c.version)).where(anchors.c.site == site)
            return int(connection.execute(found).scalar() or 0)

    def files(self, site: str, version: int) -> AnchorFiles:
        """The files of a version; none where there is no such version."""
        query = select(anchors.c.places, anchors.c.channel).where(
            anchors.c.site == site, anchors.c.version == version
        )
        with self._engine.connect() as connection:
            row = connection.execute(query).first()
        return NONE if row is None else AnchorFiles(bytes(row[0]), bytes(row[1]))

    def add(self, site: str, files: AnchorFiles, now: float) -> int:
        """Put files to use; the number of their version."""
        version = self.newest(site) + 1
        with self._engine.begin() as connection:
            connection.execute(
                insert(anchors).values(site=site, version=version, added=now, **files._asdict())
            )
        return version
