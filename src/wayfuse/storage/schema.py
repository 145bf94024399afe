"""The tables of a server's database, the same for SQLite and PostgreSQL.

Times are Unix seconds (float64), bodies and archives are bytes, JSON is text. Migrations (`storage.migrations`) build
these tables; a test holds the two together.
"""

from __future__ import annotations

from sqlalchemy import (
    BigInteger,
    Boolean,
    Column,
    Double,
    ForeignKeyConstraint,
    Index,
    Integer,
    LargeBinary,
    MetaData,
    Table,
    Text,
)

__all__ = [
    "METADATA",
    "anchors",
    "audit",
    "checkpoints",
    "counters",
    "devices",
    "estimates",
    "ingest_log",
    "publications",
    "radio_maps",
    "sites",
    "tokens",
    "tracks",
]

METADATA = MetaData()

# SQLite counts rows by INTEGER PRIMARY KEY alone; as BIGINT the key would be a second tree
_WIDE = BigInteger().with_variant(Integer, "sqlite")


def _text(name: str) -> Column[str]:
    return Column(name, Text, nullable=False)


def _double(name: str) -> Column[float]:
    return Column(name, Double, nullable=False)


def _integer(name: str) -> Column[int]:
    return Column(name, Integer, nullable=False)


sites = Table(
    "sites",
    METADATA,
    Column("name", Text, primary_key=True),
    _text("digest"),
    _double("added"),
)

radio_maps = Table(
    "radio_maps",
    METADATA,
    Column("site", Text, primary_key=True),
    Column("version", Integer, primary_key=True, autoincrement=False),
    _text("sha256"),
    _double("created"),
    _text("note"),
    Column("archive", LargeBinary, nullable=False),
    ForeignKeyConstraint(["site"], ["sites.name"]),
)

# the newest row of a site is what is published; going back adds a row, so that the history stays
publications = Table(
    "publications",
    METADATA,
    Column("id", _WIDE, primary_key=True, autoincrement=True),
    _text("site"),
    _integer("version"),
    _double("at"),
    _text("actor"),
    ForeignKeyConstraint(["site", "version"], ["radio_maps.site", "radio_maps.version"]),
)

# the newest version of a site is in use; one whose files are empty says that there are no anchors any more
anchors = Table(
    "anchors",
    METADATA,
    Column("site", Text, primary_key=True),
    Column("version", Integer, primary_key=True, autoincrement=False),
    _double("added"),
    Column("places", LargeBinary, nullable=False),
    Column("channel", LargeBinary, nullable=False),
    ForeignKeyConstraint(["site"], ["sites.name"]),
)

# seq is given by the writer, without gaps in what was committed, and orders everything a server does
ingest_log = Table(
    "ingest_log",
    METADATA,
    Column("seq", _WIDE, primary_key=True, autoincrement=False),
    _double("arrived"),
    _text("site"),
    _text("adapter"),
    _text("device"),
    _text("track"),
    _text("profile"),
    Column("body", LargeBinary, nullable=False),
    Index("ix_ingest_log_track", "track"),
    Index("ix_ingest_log_arrived", "arrived"),
)

tracks = Table(
    "tracks",
    METADATA,
    Column("track", Text, primary_key=True),
    _text("site"),
    _text("device"),
    _integer("map_version"),
    _double("started"),
    _double("heard"),
    Column(
        "anchor_version", Integer, nullable=False, server_default="0"
    ),  # 0: none, or those of the site's folder
    Index("ix_tracks_heard", "heard"),
    Index("ix_tracks_device", "device"),
)

estimates = Table(
    "estimates",
    METADATA,
    Column("track", Text, primary_key=True),
    Column("n", Integer, primary_key=True, autoincrement=False),
    *map(_double, ("t", "x", "y")),
    _integer("floor"),
    *map(_double, ("cov_xx", "cov_xy", "cov_yy", "r68", "r95")),
    _text("state"),
    _integer("n_steps"),
    _integer("n_aps"),
    _double("share_blocked"),
    _double("ess"),
    ForeignKeyConstraint(["track"], ["tracks.track"]),
)

checkpoints = Table(
    "checkpoints",
    METADATA,
    Column("track", Text, primary_key=True),
    Column("seq", BigInteger, nullable=False),
    Column("state", LargeBinary, nullable=False),
    ForeignKeyConstraint(["track"], ["tracks.track"]),
)

counters = Table(
    "counters",
    METADATA,
    Column("name", Text, primary_key=True),
    Column("value", BigInteger, nullable=False),
)

tokens = Table(
    "tokens",
    METADATA,
    Column("id", Text, primary_key=True),
    _text("digest"),
    _text("scopes"),
    _text("site"),  # empty: all sites
    _text("label"),
    _double("created"),
    Column("expires", Double, nullable=True),
    Column("revoked", Double, nullable=True),
)

devices = Table(
    "devices",
    METADATA,
    Column("device", Text, primary_key=True),
    _text("platform"),  # empty: not stated
    Column("standardised", Boolean, nullable=False),
    _text("label"),
    _double("enrolled"),
)

audit = Table(
    "audit",
    METADATA,
    Column("id", _WIDE, primary_key=True, autoincrement=True),
    _double("at"),
    _text("actor"),
    _text("action"),
    _text("subject"),
    _text("detail"),
    Index("ix_audit_at", "at"),
)
