"""Sites a server knows, and the versions of their radio maps: published, replaced, and brought back."""

from __future__ import annotations

import hashlib
from typing import NamedTuple, TypeVar

from sqlalchemy import Column, Connection, Engine, func, insert, select, update

from wayfuse.core.errors import RadioMapError
from wayfuse.storage.schema import publications, radio_maps, sites

__all__ = ["RadioMapVersion", "SiteStore"]

T = TypeVar("T")


class RadioMapVersion(NamedTuple):
    """A version of a site's radio map; ``version`` counts from 1."""

    site: str
    version: int
    sha256: str
    created: float
    note: str


_COLUMNS = (
    radio_maps.c.site,
    radio_maps.c.version,
    radio_maps.c.sha256,
    radio_maps.c.created,
    radio_maps.c.note,
)


class SiteStore:
    """Sites and radio maps of a database."""

    def __init__(self, engine: Engine) -> None:
        self._engine = engine

    def register(self, name: str, digest: str, now: float) -> None:
        """Note a site, or that its plan changed (another digest)."""
        with self._engine.begin() as connection:
            known = connection.execute(select(sites.c.digest).where(sites.c.name == name)).scalar()
            if known is None:
                connection.execute(insert(sites).values(name=name, digest=digest, added=now))
            elif known != digest:
                connection.execute(update(sites).where(sites.c.name == name).values(digest=digest))

    def names(self) -> tuple[str, ...]:
        """Names of all sites, sorted."""
        with self._engine.connect() as connection:
            return tuple(connection.execute(select(sites.c.name).order_by(sites.c.name)).scalars())

    def add_radio_map(self, site: str, archive: bytes, now: float, note: str = "") -> RadioMapVersion:
        """Keep an archive as the next version, not yet published; the same bytes again are the version they were."""
        sha256 = hashlib.sha256(archive).hexdigest()
        with self._engine.begin() as connection:
            same = select(*_COLUMNS).where(radio_maps.c.site == site, radio_maps.c.sha256 == sha256)
            known = connection.execute(same).first()
            if known is not None:
                return RadioMapVersion(*known)
            newest = select(func.max(radio_maps.c.version)).where(radio_maps.c.site == site)
            version = int(connection.execute(newest).scalar() or 0) + 1
            added = RadioMapVersion(site, version, sha256, now, note)
            connection.execute(insert(radio_maps).values(archive=archive, **added._asdict()))
            return added

    def radio_maps(self, site: str) -> list[RadioMapVersion]:
        """All versions, oldest first."""
        with self._engine.connect() as connection:
            rows = connection.execute(
                select(*_COLUMNS).where(radio_maps.c.site == site).order_by(radio_maps.c.version)
            )
            return [RadioMapVersion(*row) for row in rows]

    def archive(self, site: str, version: int) -> bytes:
        """The bytes of a version.

        Raises
        ------
        RadioMapError : there is no such version.
        """
        with self._engine.connect() as connection:
            return bytes(_of_version(connection, radio_maps.c.archive, site, version))

    def published(self, site: str) -> int | None:
        """The version in use, None where none was ever published."""
        with self._engine.connect() as connection:
            return _published(connection, site)

    def publish(self, site: str, version: int, now: float, actor: str) -> None:
        """Put a version to use.

        Raises
        ------
        RadioMapError : there is no such version.
        """
        with self._engine.begin() as connection:
            _of_version(connection, radio_maps.c.version, site, version)
            _publish(connection, site, version, now, actor)

    def roll_back(self, site: str, now: float, actor: str) -> int:
        """Put the version to use that was in use before this one was first published; its number.

        Raises
        ------
        RadioMapError : there is none before.
        """
        with self._engine.begin() as connection:
            rows = connection.execute(
                select(publications.c.version).where(publications.c.site == site).order_by(publications.c.id)
            ).scalars()
            history = list(rows)
            before = history[: history.index(history[-1])] if history else []
            if not before:
                raise RadioMapError(
                    f"site {site} has no version before this one", remedy="publish a version by its number"
                )
            _publish(connection, site, before[-1], now, actor)
            return int(before[-1])


def _of_version(connection: Connection, column: Column[T], site: str, version: int) -> T:
    """What a column has of a version; a RadioMapError where there is no such version."""
    query = select(column).where(radio_maps.c.site == site, radio_maps.c.version == version)
    found = connection.execute(query).scalar()
    if found is None:
        raise RadioMapError(
            f"site {site} has no version {version} of its radio map", remedy="list the versions first"
        )
    return found


def _published(connection: Connection, site: str) -> int | None:
    newest = (
        select(publications.c.version)
        .where(publications.c.site == site)
        .order_by(publications.c.id.desc())
        .limit(1)
    )
    found = connection.execute(newest).scalar()
    return None if found is None else int(found)


def _publish(connection: Connection, site: str, version: int, now: float, actor: str) -> None:
    connection.execute(insert(publications).values(site=site, version=version, at=now, actor=actor))
