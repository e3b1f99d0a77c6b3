"""what each organisation stores, counted as it arrives"""

import sqlalchemy as sa
from alembic import op

revision = "0011"
down_revision = "0010"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_table(
        "usage",
        sa.Column("organisation_id", sa.String(), nullable=False),
        sa.Column("frames", sa.Integer(), nullable=False),
        sa.Column("stored_bytes", sa.BigInteger(), nullable=False),
        sa.Column("counted_at", sa.DateTime(timezone=True), nullable=False),
        sa.ForeignKeyConstraint(["organisation_id"], ["organisation.id"], name="fk_usage_organisation_id"),
        sa.PrimaryKeyConstraint("organisation_id", name="pk_usage"),
    )
    op.execute(
        "INSERT INTO usage (organisation_id, frames, stored_bytes, counted_at) "
        "SELECT o.id, count(f.id), coalesce(sum(b.size_bytes), 0), CURRENT_TIMESTAMP FROM organisation o "
        "LEFT JOIN campaign c ON c.organisation_id = o.id LEFT JOIN frame f ON f.campaign_id = c.id "
        "LEFT JOIN blob b ON b.sha256 = f.sha256 GROUP BY o.id"
    )


def downgrade() -> None:
    op.drop_table("usage")
