"""Anchors that come over the interface, and by which of their versions a track goes."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0002"
down_revision = "0001"


def upgrade() -> None:
    """Create their table; the tracks of before have none."""
    op.create_table(
        "anchors",
        sa.Column("site", sa.Text, primary_key=True),
        sa.Column("version", sa.Integer, primary_key=True, autoincrement=False),
        sa.Column("added", sa.Double, nullable=False),
        sa.Column("places", sa.LargeBinary, nullable=False),
        sa.Column("channel", sa.LargeBinary, nullable=False),
        sa.ForeignKeyConstraint(["site"], ["sites.name"]),
    )
    op.add_column("tracks", sa.Column("anchor_version", sa.Integer, nullable=False, server_default="0"))


def downgrade() -> None:
    """Drop them."""
    op.drop_column("tracks", "anchor_version")
    op.drop_table("anchors")
