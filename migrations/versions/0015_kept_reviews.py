"""kept reviews of campaigns, typeset certificates, and the indexes of long lists"""

import sqlalchemy as sa
from alembic import op

revision = "0015"
down_revision = "0014"
branch_labels = None
depends_on = None

_STALE = sa.text("kept_revision < revision")
_INDEXES = {
    "ix_frame_campaign_id_id": ("frame", ["campaign_id", "id"]),
    "ix_frame_campaign_id_state": ("frame", ["campaign_id", "state"]),
    "ix_job_organisation_id_state_id": ("job", ["organisation_id", "state", "id"]),
}


def upgrade() -> None:
    op.create_table(
        "campaign_review",
        sa.Column("campaign_id", sa.String(), nullable=False),
        sa.Column("revision", sa.BigInteger(), nullable=False),
        sa.Column("kept_revision", sa.BigInteger(), nullable=False),
        sa.Column("kept_by", sa.String(), nullable=True),
        sa.Column("not_before", sa.DateTime(timezone=True), nullable=True),
        sa.Column("missing", sa.JSON(), nullable=True),
        sa.Column("advice", sa.JSON(), nullable=True),
        sa.Column("checklist", sa.JSON(), nullable=True),
        sa.ForeignKeyConstraint(["campaign_id"], ["campaign.id"], name="fk_campaign_review_campaign_id"),
        sa.PrimaryKeyConstraint("campaign_id", name="pk_campaign_review"),
    )
    op.create_index(
        "ix_campaign_review_stale",
        "campaign_review",
        ["not_before"],
        sqlite_where=_STALE,
        postgresql_where=_STALE,
    )
    op.execute(
        "INSERT INTO campaign_review (campaign_id, revision, kept_revision) SELECT id, 0, -1 FROM campaign"
    )
    op.create_table(
        "frame_verdict",
        sa.Column("frame_id", sa.String(), nullable=False),
        sa.Column("campaign_id", sa.String(), nullable=False),
        sa.Column("reasons", sa.String(), nullable=False),
        sa.PrimaryKeyConstraint("frame_id", name="pk_frame_verdict"),
    )
    op.create_index("ix_frame_verdict_campaign_id", "frame_verdict", ["campaign_id"])
    op.create_table(
        "rendering",
        sa.Column("source_sha256", sa.String(64), nullable=False),
        sa.Column("sha256", sa.String(64), nullable=False),
        sa.Column("created_at", sa.DateTime(timezone=True), nullable=False),
        sa.ForeignKeyConstraint(["sha256"], ["blob.sha256"], name="fk_rendering_sha256"),
        sa.PrimaryKeyConstraint("source_sha256", name="pk_rendering"),
    )
    for name, (table, columns) in _INDEXES.items():
        op.create_index(name, table, columns)


def downgrade() -> None:
    for name, (table, _) in _INDEXES.items():
        op.drop_index(name, table_name=table)
    for table in ("rendering", "frame_verdict", "campaign_review"):
        op.drop_table(table)
