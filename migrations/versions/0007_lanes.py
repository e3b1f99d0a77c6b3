"""lanes in which jobs wait, what they wait for and since when; no job is hinted at by name"""

import sqlalchemy as sa
from alembic import op

revision = "0007"
down_revision = "0006"
branch_labels = None
depends_on = None

INDEX = "ix_job_state_organisation_id_lane_due_at"


def upgrade() -> None:
    op.add_column("job", sa.Column("lane", sa.String(), nullable=False, server_default="extract"))
    op.add_column("job", sa.Column("faulty_since", sa.DateTime(timezone=True), nullable=True))
    op.add_column("job", sa.Column("waits_for", sa.String(), nullable=True))
    op.execute("UPDATE job SET lane = kind WHERE kind <> 'extract'")
    op.drop_column("job", "hinted_at")
    op.drop_index("ix_job_state_created_at", table_name="job")
    op.create_index(INDEX, "job", ["state", "organisation_id", "lane", "due_at"])


def downgrade() -> None:
    op.drop_index(INDEX, table_name="job")
    op.create_index("ix_job_state_created_at", "job", ["state", "created_at"])
    op.add_column("job", sa.Column("hinted_at", sa.DateTime(timezone=True), nullable=True))
    for name in ("waits_for", "faulty_since", "lane"):
        op.drop_column("job", name)
