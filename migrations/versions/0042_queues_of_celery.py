"""messages of jobs: when each was sent, who runs what, and whose turn it is in each queue"""

import sqlalchemy as sa
from alembic import op

revision = "0042"
down_revision = "0041"
branch_labels = None
depends_on = None

OLD = ("ix_job_state_organisation_id_lane_due_at", ["state", "organisation_id", "lane", "due_at"])
NEW = ("ix_job_state_lane_organisation_id_due_at", ["state", "lane", "organisation_id", "due_at"])
SENT = sa.text("state = 'queued' AND sent_at IS NOT NULL")
QUEUES = ("looks", "frames", "fits", "maps")


def upgrade() -> None:
    op.add_column("job", sa.Column("holder", sa.String(), nullable=True))
    op.add_column("job", sa.Column("sent_at", sa.DateTime(timezone=True), nullable=True))
    op.drop_index(OLD[0], table_name="job")
    op.create_index(NEW[0], "job", NEW[1])
    op.create_index(
        "ix_job_lane_sent_at", "job", ["lane", "sent_at"], sqlite_where=SENT, postgresql_where=SENT
    )
    turn = op.create_table(
        "turn",
        sa.Column("queue", sa.String(), nullable=False),
        sa.Column("organisation_id", sa.String(), nullable=False),
        sa.PrimaryKeyConstraint("queue", name="pk_turn"),
    )
    op.bulk_insert(turn, [{"queue": queue, "organisation_id": ""} for queue in QUEUES])


def downgrade() -> None:
    op.drop_table("turn")
    op.drop_index("ix_job_lane_sent_at", table_name="job")
    op.drop_index(NEW[0], table_name="job")
    op.create_index(OLD[0], "job", OLD[1])
    for name in ("sent_at", "holder"):
        op.drop_column("job", name)
