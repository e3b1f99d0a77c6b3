"""rigs: cameras that are mounted together"""

import sqlalchemy as sa
from alembic import op

revision = "0013"
down_revision = "0012"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_table(
        "rig",
        sa.Column("id", sa.String(), nullable=False),
        sa.Column("organisation_id", sa.String(), nullable=False),
        sa.Column("name", sa.String(), nullable=False),
        sa.Column("camera_ids", sa.JSON(), nullable=False),
        sa.Column("created_at", sa.DateTime(timezone=True), nullable=False),
        sa.ForeignKeyConstraint(["organisation_id"], ["organisation.id"], name="fk_rig_organisation_id"),
        sa.PrimaryKeyConstraint("id", name="pk_rig"),
        sa.UniqueConstraint("organisation_id", "name", name="uq_rig_organisation_id_name"),
    )


def downgrade() -> None:
    op.drop_table("rig")
