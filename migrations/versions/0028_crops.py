"""parts of frames are kept as pictures of their pixels, the newest of each organisation"""

import sqlalchemy as sa
from alembic import op

revision = "0028"
down_revision = "0027"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_table(
        "crop",
        sa.Column("id", sa.String(), nullable=False),
        sa.Column("organisation_id", sa.String(), nullable=False),
        sa.Column("frame_id", sa.String(), nullable=False),
        sa.Column("asked", sa.String(), nullable=False),
        sa.Column("job_id", sa.String(), nullable=False),
        sa.Column("png", sa.LargeBinary(), nullable=False),
        sa.Column("created_at", sa.DateTime(timezone=True), nullable=False),
        sa.ForeignKeyConstraint(["frame_id"], ["frame.id"], name="fk_crop_frame_id"),
        sa.ForeignKeyConstraint(["job_id"], ["job.id"], name="fk_crop_job_id"),
        sa.ForeignKeyConstraint(["organisation_id"], ["organisation.id"], name="fk_crop_organisation_id"),
        sa.PrimaryKeyConstraint("id", name="pk_crop"),
    )
    op.create_index("ix_crop_frame_id_asked", "crop", ["frame_id", "asked"])
    op.create_index("ix_crop_organisation_id_id", "crop", ["organisation_id", "id"])


def downgrade() -> None:
    op.drop_table("crop")
