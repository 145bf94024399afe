"""The first tables."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0001"
down_revision = None

_WIDE = sa.BigInteger().with_variant(sa.Integer, "sqlite")
_TABLES = (
    "sites",
    "radio_maps",
    "publications",
    "ingest_log",
    "tracks",
    "estimates",
    "checkpoints",
    "counters",
    "tokens",
    "devices",
    "audit",
)


def _text(name: str) -> sa.Column[str]:
    return sa.Column(name, sa.Text, nullable=False)


def _double(name: str, *, nullable: bool = False) -> sa.Column[float]:
    return sa.Column(name, sa.Double, nullable=nullable)


def _integer(name: str) -> sa.Column[int]:
    return sa.Column(name, sa.Integer, nullable=False)


def upgrade() -> None:
    """Create them."""
    _create_maps()
    _create_log()
    _create_tracks()
    _create_administration()


def _create_maps() -> None:
    op.create_table("sites", sa.Column("name", sa.Text, primary_key=True), _text("digest"), _double("added"))
    op.create_table(
        "radio_maps",
        sa.Column("site", sa.Text, primary_key=True),
        sa.Column("version", sa.Integer, primary_key=True, autoincrement=False),
        _text("sha256"),
        _double("created"),
        _text("note"),
        sa.Column("archive", sa.LargeBinary, nullable=False),
        sa.ForeignKeyConstraint(["site"], ["sites.name"]),
    )
    op.create_table(
        "publications",
        sa.Column("id", _WIDE, primary_key=True, autoincrement=True),
        _text("site"),
        _integer("version"),
        _double("at"),
        _text("actor"),
        sa.ForeignKeyConstraint(["site", "version"], ["radio_maps.site", "radio_maps.version"]),
    )


def _create_log() -> None:
    op.create_table(
        "ingest_log",
        sa.Column("seq", _WIDE, primary_key=True, autoincrement=False),
        _double("arrived"),
        *(_text(name) for name in ("site", "adapter", "device", "track", "profile")),
        sa.Column("body", sa.LargeBinary, nullable=False),
    )
    op.create_index("ix_ingest_log_track", "ingest_log", ["track"])
    op.create_index("ix_ingest_log_arrived", "ingest_log", ["arrived"])


def _create_tracks() -> None:
    op.create_table(
        "tracks",
        sa.Column("track", sa.Text, primary_key=True),
        _text("site"),
        _text("device"),
        _integer("map_version"),
        _double("started"),
        _double("heard"),
    )
    op.create_index("ix_tracks_heard", "tracks", ["heard"])
    op.create_index("ix_tracks_device", "tracks", ["device"])
    op.create_table(
        "estimates",
        sa.Column("track", sa.Text, primary_key=True),
        sa.Column("n", sa.Integer, primary_key=True, autoincrement=False),
        *(_double(name) for name in ("t", "x", "y")),
        _integer("floor"),
        *(_double(name) for name in ("cov_xx", "cov_xy", "cov_yy", "r68", "r95")),
        _text("state"),
        _integer("n_steps"),
        _integer("n_aps"),
        _double("share_blocked"),
        _double("ess"),
        sa.ForeignKeyConstraint(["track"], ["tracks.track"]),
    )
    op.create_table(
        "checkpoints",
        sa.Column("track", sa.Text, primary_key=True),
        sa.Column("seq", sa.BigInteger, nullable=False),
        sa.Column("state", sa.LargeBinary, nullable=False),
        sa.ForeignKeyConstraint(["track"], ["tracks.track"]),
    )
    op.create_table(
        "counters",
        sa.Column("name", sa.Text, primary_key=True),
        sa.Column("value", sa.BigInteger, nullable=False),
    )


def _create_administration() -> None:
    op.create_table(
        "tokens",
        sa.Column("id", sa.Text, primary_key=True),
        *(_text(name) for name in ("digest", "scopes", "site", "label")),
        _double("created"),
        _double("expires", nullable=True),
        _double("revoked", nullable=True),
    )
    op.create_table(
        "devices",
        sa.Column("device", sa.Text, primary_key=True),
        _text("platform"),
        sa.Column("standardised", sa.Boolean, nullable=False),
        _text("label"),
        _double("enrolled"),
    )
    op.create_table(
        "audit",
        sa.Column("id", _WIDE, primary_key=True, autoincrement=True),
        _double("at"),
        *(_text(name) for name in ("actor", "action", "subject", "detail")),
    )
    op.create_index("ix_audit_at", "audit", ["at"])


def downgrade() -> None:
    """Drop them."""
    for name in reversed(_TABLES):
        op.drop_table(name)
