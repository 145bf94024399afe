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

sites = Table(
    "sites",
    METADATA,
    Column("name", Text, primary_key=True),
    Column("digest", Text, nullable=False),
    Column("added", Double, nullable=False),
)

radio_maps = Table(
    "radio_maps",
    METADATA,
    Column("site", Text, primary_key=True),
    Column("version", Integer, primary_key=True, autoincrement=False),
    Column("sha256", Text, nullable=False),
    Column("created", Double, nullable=False),
    Column("note", Text, nullable=False),
    Column("archive", LargeBinary, nullable=False),
    ForeignKeyConstraint(["site"], ["sites.name"]),
)

# the newest row of a site is what is published; going back adds a row, so that the history stays
publications = Table(
    "publications",
    METADATA,
    Column("id", _WIDE, primary_key=True, autoincrement=True),
    Column("site", Text, nullable=False),
    Column("version", Integer, nullable=False),
    Column("at", Double, nullable=False),
    Column("actor", Text, nullable=False),
    ForeignKeyConstraint(["site", "version"], ["radio_maps.site", "radio_maps.version"]),
)

# seq is given by the writer, without gaps in what was committed, and orders everything a server does
ingest_log = Table(
    "ingest_log",
    METADATA,
    Column("seq", _WIDE, primary_key=True, autoincrement=False),
    Column("arrived", Double, nullable=False),
    Column("site", Text, nullable=False),
    Column("adapter", Text, nullable=False),
    Column("device", Text, nullable=False),
    Column("track", Text, nullable=False),
    Column("profile", Text, nullable=False),
    Column("body", LargeBinary, nullable=False),
    Index("ix_ingest_log_track", "track"),
    Index("ix_ingest_log_arrived", "arrived"),
)

tracks = Table(
    "tracks",
    METADATA,
    Column("track", Text, primary_key=True),
    Column("site", Text, nullable=False),
    Column("device", Text, nullable=False),
    Column("map_version", Integer, nullable=False),
    Column("started", Double, nullable=False),
    Column("heard", Double, nullable=False),
    Index("ix_tracks_heard", "heard"),
    Index("ix_tracks_device", "device"),
)

estimates = Table(
    "estimates",
    METADATA,
    Column("track", Text, primary_key=True),
    Column("n", Integer, primary_key=True, autoincrement=False),
    Column("t", Double, nullable=False),
    Column("x", Double, nullable=False),
    Column("y", Double, nullable=False),
    Column("floor", Integer, nullable=False),
    Column("cov_xx", Double, nullable=False),
    Column("cov_xy", Double, nullable=False),
    Column("cov_yy", Double, nullable=False),
    Column("r68", Double, nullable=False),
    Column("r95", Double, nullable=False),
    Column("state", Text, nullable=False),
    Column("n_steps", Integer, nullable=False),
    Column("n_aps", Integer, nullable=False),
    Column("share_blocked", Double, nullable=False),
    Column("ess", Double, nullable=False),
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
    Column("digest", Text, nullable=False),
    Column("scopes", Text, nullable=False),
    Column("site", Text, nullable=False),  # empty: all sites
    Column("label", Text, nullable=False),
    Column("created", Double, nullable=False),
    Column("expires", Double, nullable=True),
    Column("revoked", Double, nullable=True),
)

devices = Table(
    "devices",
    METADATA,
    Column("device", Text, primary_key=True),
    Column("platform", Text, nullable=False),  # empty: not stated
    Column("standardised", Boolean, nullable=False),
    Column("label", Text, nullable=False),
    Column("enrolled", Double, nullable=False),
)

audit = Table(
    "audit",
    METADATA,
    Column("id", _WIDE, primary_key=True, autoincrement=True),
    Column("at", Double, nullable=False),
    Column("actor", Text, nullable=False),
    Column("action", Text, nullable=False),
    Column("subject", Text, nullable=False),
    Column("detail", Text, nullable=False),
    Index("ix_audit_at", "at"),
)
