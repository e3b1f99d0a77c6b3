"""the revision of its campaign at which each frame last changed, and previews at the size of a cell"""

import sqlalchemy as sa
from alembic import op

revision = "0033"
down_revision = "0032"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_table(
        "frame_change",
        sa.Column("frame_id", sa.String(), nullable=False),
        sa.Column("campaign_id", sa.String(), nullable=False),
        sa.Column("revision", sa.BigInteger(), nullable=False),
        sa.PrimaryKeyConstraint("frame_id", name="pk_frame_change"),
    )
    op.create_index("ix_frame_change_campaign_id_revision", "frame_change", ["campaign_id", "revision"])
    op.create_table(
        "small_preview",
        sa.Column("preview_sha256", sa.String(64), nullable=False),
        sa.Column("webp", sa.LargeBinary(), nullable=False),
        sa.PrimaryKeyConstraint("preview_sha256", name="pk_small_preview"),
    )
    whole = sa.Column("whole_revision", sa.BigInteger(), nullable=False, server_default="0")
    op.add_column("campaign_review", whole)


def downgrade() -> None:
    op.drop_table("small_preview")
    op.drop_column("campaign_review", "whole_revision")
    op.drop_table("frame_change")
